"""Numeric part of the sparse factorisation: block elimination in the panels that blocks.analyse laid out.

    S = U^T D^-1 U    symmetric and positive definite, values hold U
    N = L D^-1 U      any other, without pivoting: `upper` holds U, `lower` holds L^T

D is the diagonal of U and of L; the arrays hold its reciprocals. With U = L^T both are the same, so that one pair of
kernels solves with either, and a matrix's transpose is solved by handing its arrays over in the other order. Only the
upper triangle of a diagonal block is read. After the panels comes room for the diagonal as it was before elimination,
against which pivots are judged.
"""

import math

from ._kernel import kernel


@kernel
def _keep_diagonal(pattern, values):
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    kept = values[pattern.shape[1] :]
    for j in range(heads.size):
        head, step, first = heads[j], widths[j] + 1, starts[j]
        for k in range(starts[j + 1] - first):
            kept[first + k] = values[head + k * step]


@kernel
def _subtract(target, factor, source, n):
    for x in range(n):
        target[x] -= factor * source[x]


@kernel
def _subtract2(target, f, u, g, v, n):
    for x in range(n):
        target[x] -= f * u[x] + g * v[x]


@kernel
def _subtract3(target, f, u, g, v, h, w, n):
    for x in range(n):
        target[x] -= f * u[x] + g * v[x] + h * w[x]


@kernel
def factor(pattern, values, limit):
    """Factor S in place; S positive definite.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry.
    """
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    _keep_diagonal(pattern, values)
    kept = values[pattern.shape[1] :]
    for j in range(heads.size):
        first, width = starts[j], widths[j]
        size = starts[j + 1] - first
        panel = values[heads[j] :]
        for k in range(size):
            row = panel[k * width + k :]
            pivot = row[0]
            if not limit * kept[first + k] < pivot < math.inf:
                return first + k
            inverse = 1.0 / pivot
            row[0] = inverse
            for i in range(1, size - k):
                _subtract(panel[(k + i) * (width + 1) :], row[i] * inverse, row[i:], width - k - i)
        _update(pattern, j, size, width, panel, panel, values)
    return -1


@kernel
def _update(pattern, j, size, width, left, right, values):
    """Subtract block j's products from later panels: left's columns times right's."""
    updates, records = pattern.updates, pattern.records
    for e in range(updates[j], updates[j + 1]):
        record = records[6 * e : 6 * e + 6]
        at, rows, run, count, target, stride = record[0], record[1], record[2], record[3], record[4], record[5]
        for r in range(rows):
            skip = r if run == at else 0  # a block on the diagonal: its upper triangle
            out = values[target + r * stride + skip :]
            column, source, n = left[at + r :], right[run + skip :], count - skip
            k = 0
            while k + 3 <= size:
                a, b, c = k * width, (k + 1) * width, (k + 2) * width
                u, v, w = right[k * (width + 1) :], right[(k + 1) * (width + 1) :], right[(k + 2) * (width + 1) :]
                _subtract3(
                    out,
                    column[a] * u[0],
                    source[a:],
                    column[b] * v[0],
                    source[b:],
                    column[c] * w[0],
                    source[c:],
                    n,
                )
                k += 3
            while k < size:
                a = k * width
                _subtract(out, column[a] * right[k * (width + 1)], source[a:], n)
                k += 1


@kernel
def factor_lu(pattern, lower, upper, limit):
    """Factor N in place, without pivoting.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry's
    size, or a number that is not finite.
    """
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    _keep_diagonal(pattern, upper)
    kept = upper[pattern.shape[1] :]
    for j in range(heads.size):
        first, width = starts[j], widths[j]
        size = starts[j + 1] - first
        left, right = lower[heads[j] :], upper[heads[j] :]
        for k in range(size):
            row, column = right[k * width + k :], left[k * width + k :]
            pivot = row[0]
            if not limit * abs(kept[first + k]) < abs(pivot) < math.inf:
                return first + k
            inverse = 1.0 / pivot
            row[0] = inverse
            column[0] = inverse
            for i in range(1, size - k):
                at = (k + i) * (width + 1)
                _subtract(right[at:], column[i] * inverse, row[i:], width - k - i)
                _subtract(left[at + 1 :], row[i] * inverse, column[i + 1 :], width - k - i - 1)
        _update(pattern, j, size, width, left, right, upper)
        _update(pattern, j, size, width, right, left, lower)
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
        first, width = starts[j], widths[j]
        size = starts[j + 1] - first
        own = b[first:]
        for k in range(size):
            row = lower[heads[j] + k * width :]
            value = own[k] * row[k]
            own[k] = value
            for i in range(1, size - k):
                own[k + i] -= value * row[k + i]
            at = size
            for e in range(columns[j], columns[j + 1]):
                start, count = segments[2 * e], segments[2 * e + 1]
                _subtract(b[start:], value, row[at:], count)
                at += count
    for j in range(heads.size - 1, -1, -1):
        first, width = starts[j], widths[j]
        size = starts[j + 1] - first
        own = b[first:]
        for k in range(size - 1, -1, -1):
            row = upper[heads[j] + k * width :]
            total = 0.0
            for i in range(1, size - k):
                total += row[k + i] * own[k + i]
            at = size
            for e in range(columns[j], columns[j + 1]):
                start, count = segments[2 * e], segments[2 * e + 1]
                source, values = b[start:], row[at:]
                for x in range(count):
                    total += values[x] * source[x]
                at += count
            own[k] -= row[k] * total
