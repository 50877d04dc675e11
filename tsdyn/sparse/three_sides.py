"""Solves for three right-hand sides at once by the factors of `factor_lu`, each row's in one register.

b (4 rows,): of every row in order of elimination its three right-hand sides and a zero. The factors are read once.
"""

from ..jit.kernels import kernel
from ..jit.simd import fma, four, put, splat, sub, times


@kernel
def solve_three(pattern, lower, upper, b):
    """b <- the solutions of N x = b."""
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    for j in range(heads.size):
        for k in range(starts[j + 1] - starts[j]):
            _forward(pattern, lower[heads[j] + k * widths[j] :], j, k, b)
    for j in range(heads.size - 1, -1, -1):
        for k in range(starts[j + 1] - starts[j] - 1, -1, -1):
            _backward(pattern, upper[heads[j] + k * widths[j] :], j, k, b)


@kernel
def _forward(pattern, row, j, k, b):
    """Take unknown k of block j from the rows after it; row is that of its panel."""
    first, size = pattern.starts[j], pattern.starts[j + 1] - pattern.starts[j]
    x = times(four(b, 4 * (first + k)), splat(row[k]))
    put(b, 4 * (first + k), x)
    for i in range(k + 1, size):
        at = 4 * (first + i)
        put(b, at, sub(four(b, at), times(x, splat(row[i]))))
    at = size
    for e in range(pattern.columns[j], pattern.columns[j + 1]):
        to = pattern.segments[2 * e] - at
        for i in range(at, at + pattern.segments[2 * e + 1]):
            put(b, 4 * (to + i), sub(four(b, 4 * (to + i)), times(x, splat(row[i]))))
        at += pattern.segments[2 * e + 1]


@kernel
def _backward(pattern, row, j, k, b):
    """Unknown k of block j by those after it."""
    first, size = pattern.starts[j], pattern.starts[j + 1] - pattern.starts[j]
    x, at = splat(0.0), size
    for i in range(k + 1, size):
        x = fma(four(b, 4 * (first + i)), splat(row[i]), x)
    for e in range(pattern.columns[j], pattern.columns[j + 1]):
        to = pattern.segments[2 * e] - at
        for i in range(at, at + pattern.segments[2 * e + 1]):
            x = fma(four(b, 4 * (to + i)), splat(row[i]), x)
        at += pattern.segments[2 * e + 1]
    put(b, 4 * (first + k), sub(four(b, 4 * (first + k)), times(x, splat(row[k]))))
