"""Numeric part of the sparse factorisation: block elimination in the panels that blocks.analyse laid out.

    S = U^T D^-1 U    symmetric and positive definite, values hold U
    N = L D^-1 U      any other, without pivoting: `upper` holds U, `lower` holds L^T

D is the diagonal of U and of L; the arrays hold its reciprocals. With U = L^T both are the same, so that one pair of
kernels solves with either, and a matrix's transpose is solved by handing its arrays over in the other order. Only the
upper triangle of a diagonal block is read. After the panels comes room for the diagonal as it was before elimination,
against which pivots are judged.
"""

import math

from ._four import get, let
from ._kernel import kernel


@kernel
def _less(values, at, x):
    """values[at] -= x."""
    let(values, at, get(values, at) - x)


@kernel
def _keep_diagonal(pattern, values):
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    kept = pattern.shape[1]
    for j in range(heads.size):
        at, step, first = get(heads, j), get(widths, j) + 1, get(starts, j)
        for k in range(first, get(starts, j + 1)):
            let(values, kept + k, get(values, at))
            at += step


@kernel
def _update(pattern, j, head, size, width, left, right, values):
    """Subtract block j's products from later panels: left's columns times right's, the diagonal of both inverted."""
    updates, records = pattern.updates, pattern.records
    for e in range(get(updates, j), get(updates, j + 1)):
        at, rows, run = get(records, 6 * e), get(records, 6 * e + 1), get(records, 6 * e + 2)
        count, target, stride = get(records, 6 * e + 3), get(records, 6 * e + 4), get(records, 6 * e + 5)
        for r in range(rows):
            skip = r if run == at else 0  # a block on the diagonal: its upper triangle
            row, k = head, 0
            while k + 3 <= size:
                second, third = row + width, row + 2 * width
                f = get(left, row + at + r) * get(right, row + k)
                g = get(left, second + at + r) * get(right, second + k + 1)
                h = get(left, third + at + r) * get(right, third + k + 2)
                row, second, third = row + run, second + run, third + run
                for c in range(skip, count):
                    x = f * get(right, row + c) + g * get(right, second + c) + h * get(right, third + c)
                    _less(values, target + c, x)
                row += 3 * width - run
                k += 3
            while k < size:
                f = get(left, row + at + r) * get(right, row + k)
                for c in range(skip, count):
                    _less(values, target + c, f * get(right, row + run + c))
                row += width
                k += 1
            target += stride


@kernel
def factor(pattern, values, limit):
    """Factor S in place; S positive definite.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry.
    """
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    _keep_diagonal(pattern, values)
    kept = pattern.shape[1]
    for j in range(heads.size):
        first, width, head = get(starts, j), get(widths, j), get(heads, j)
        size = get(starts, j + 1) - first
        for k in range(size):
            row = head + k * (width + 1)
            pivot = get(values, row)
            if not limit * get(values, kept + first + k) < pivot < math.inf:
                return first + k
            inverse = 1.0 / pivot
            let(values, row, inverse)
            for i in range(1, size - k):
                f, at = get(values, row + i) * inverse, row + i * width
                for c in range(i, width - k):
                    _less(values, at + c, f * get(values, row + c))
        _update(pattern, j, head, size, width, values, values, values)
    return -1


@kernel
def factor_lu(pattern, lower, upper, limit):
    """Factor N in place, without pivoting.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry's
    size, or a number that is not finite.
    """
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    _keep_diagonal(pattern, upper)
    kept = pattern.shape[1]
    for j in range(heads.size):
        first, width, head = get(starts, j), get(widths, j), get(heads, j)
        size = get(starts, j + 1) - first
        for k in range(size):
            row = head + k * (width + 1)
            pivot = get(upper, row)
            if not limit * abs(get(upper, kept + first + k)) < abs(pivot) < math.inf:
                return first + k
            inverse = 1.0 / pivot
            let(upper, row, inverse)
            let(lower, row, inverse)
            for i in range(1, size - k):
                at = row + i * width
                f, g = get(lower, row + i) * inverse, get(upper, row + i) * inverse
                for c in range(i, width - k):
                    _less(upper, at + c, f * get(upper, row + c))
                for c in range(i + 1, width - k):
                    _less(lower, at + c, g * get(lower, row + c))
        _update(pattern, j, head, size, width, lower, upper, upper)
        _update(pattern, j, head, size, width, upper, lower, lower)
    return -1


@kernel
def solve(pattern, values, b):
    """Solve S x = b in place, b (rows,) in the eliminated order, with what `factor` left."""
    solve_lu(pattern, values, values, b)


@kernel
def solve_lu_transposed(pattern, lower, upper, b):
    """Solve N^T x = b in place, with what `factor_lu` left."""
    solve_lu(pattern, upper, lower, b)


@kernel
def solve_lu(pattern, lower, upper, b):
    """Solve N x = b in place, b (rows,) in the eliminated order, with what `factor_lu` left."""
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    columns, segments = pattern.columns, pattern.segments
    for j in range(heads.size):
        first, width, row = get(starts, j), get(widths, j), get(heads, j)
        size = get(starts, j + 1) - first
        ce, cf = get(columns, j), get(columns, j + 1)
        k = 0
        while k + 3 <= size:
            i = first + k
            second, third = row + width, row + 2 * width
            u = get(b, i) * get(lower, row + k)
            v = (get(b, i + 1) - u * get(lower, row + k + 1)) * get(lower, second + k + 1)
            x = (get(b, i + 2) - u * get(lower, row + k + 2) - v * get(lower, second + k + 2)) * get(
                lower, third + k + 2
            )
            let(b, i, u)
            let(b, i + 1, v)
            let(b, i + 2, x)
            for c in range(k + 3, size):
                _less(b, first + c, u * get(lower, row + c) + v * get(lower, second + c) + x * get(lower, third + c))
            at = size
            for e in range(ce, cf):
                start, count = get(segments, 2 * e), get(segments, 2 * e + 1)
                for c in range(count):
                    f = u * get(lower, row + at + c) + v * get(lower, second + at + c) + x * get(lower, third + at + c)
                    _less(b, start + c, f)
                at += count
            row += 3 * width
            k += 3
        while k < size:
            u = get(b, first + k) * get(lower, row + k)
            let(b, first + k, u)
            for c in range(k + 1, size):
                _less(b, first + c, u * get(lower, row + c))
            at = size
            for e in range(ce, cf):
                start, count = get(segments, 2 * e), get(segments, 2 * e + 1)
                for c in range(count):
                    _less(b, start + c, u * get(lower, row + at + c))
                at += count
            row += width
            k += 1
    for j in range(heads.size - 1, -1, -1):
        first, width = get(starts, j), get(widths, j)
        size = get(starts, j + 1) - first
        ce, cf = get(columns, j), get(columns, j + 1)
        row = get(heads, j) + size * width
        k = size
        while k >= 3:
            k -= 3
            row -= 3 * width
            second, third = row + width, row + 2 * width
            u, v, x = 0.0, 0.0, 0.0
            for c in range(k + 3, size):
                f = get(b, first + c)
                u += get(upper, row + c) * f
                v += get(upper, second + c) * f
                x += get(upper, third + c) * f
            at = size
            for e in range(ce, cf):
                start, count = get(segments, 2 * e), get(segments, 2 * e + 1)
                for c in range(count):
                    f = get(b, start + c)
                    u += get(upper, row + at + c) * f
                    v += get(upper, second + at + c) * f
                    x += get(upper, third + at + c) * f
                at += count
            i = first + k
            x = get(b, i + 2) - x * get(upper, third + k + 2)
            v = get(b, i + 1) - (v + get(upper, second + k + 2) * x) * get(upper, second + k + 1)
            u = get(b, i) - (u + get(upper, row + k + 1) * v + get(upper, row + k + 2) * x) * get(upper, row + k)
            let(b, i, u)
            let(b, i + 1, v)
            let(b, i + 2, x)
        while k > 0:
            k -= 1
            row -= width
            u = 0.0
            for c in range(k + 1, size):
                u += get(upper, row + c) * get(b, first + c)
            at = size
            for e in range(ce, cf):
                start, count = get(segments, 2 * e), get(segments, 2 * e + 1)
                for c in range(count):
                    u += get(upper, row + at + c) * get(b, start + c)
                at += count
            _less(b, first + k, get(upper, row + k) * u)
