"""Sums with their rounding errors."""

from ..jit.kernels import kernel
from ..jit.simd import add, put, sub


@kernel
def put_sum(out, at, high, change, low, i):
    """out[at : at + 4] = high + change, rounded; low[i : i + 4] is the rounding error (two-sum)."""
    # Knuth's two-sum: low is the rounding error of the sum, exactly
    rounded = add(high, change)
    taken = sub(rounded, high)
    put(out, at, rounded)
    put(low, i, add(sub(high, sub(rounded, taken)), sub(change, taken)))
