"""Numeric part of the sparse factorisation: block elimination in the panels laid out by symbolic.py.

    S = U^T D^-1 U    symmetric and, but for late nodes (see symbolic.py), positive definite; values hold U
    N = L D^-1 U      any other, without pivoting: `upper` holds U, `lower` holds L^T

D is the diagonal of U and of L; the arrays hold its reciprocals. A symmetric matrix has U = L^T, so one pair of kernels
solves both kinds, and a transposed system is solved with the two arrays exchanged. Only the upper triangle of a
diagonal block is read. The diagonal before elimination is stored after the panels: each pivot is judged relative to it.
"""

from ..jit.kernels import kernel, long_kernel
from ..jit.predicates import below, choose
from ..jit.simd import get, let
from .block_operations import eliminate, eliminate_lu, link, link_lu, subtract_products


@kernel
def keep_diagonal(pattern, values):
    """Copy the diagonal to where `factor` judges pivots by it, its sign that of the pivot."""
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    kept = values[pattern.shape[1] :]
    for j in range(heads.size):
        head, step, first = heads[j], widths[j] + 1, starts[j]
        for k in range(starts[j + 1] - first):
            kept[first + k] = abs(values[head + k * step])
    # Axis rows have negative pivots
    for i in range(pattern.negative.size):
        row = pattern.negative[i]
        size = abs(kept[row])
        kept[row] = -choose(below(0.0, size), size, 1.0)


@kernel
def factor(pattern, values, limit):
    """Factor S in place; S positive definite, but for rows that are to have negative pivots.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry.
    """
    if pattern.shape[0] == 1:
        return factor_row(pattern, values, limit)
    return factor_blocks(pattern, values, values, 0, limit)


@kernel
def factor_and_solve(pattern, values, b, limit):
    """`factor`, then `solve` where it succeeds; b is eliminated with the matrix, in the time that pivots take."""
    if pattern.shape[0] == 1:
        failed = factor_row(pattern, values, limit)
        b[0] *= values[0]
        return failed
    failed = factor_blocks(pattern, values, b, 1, limit)
    if failed < 0:
        solve_blocks(pattern, values, values, b, 1)
    return failed


@kernel
def factor_row(pattern, values, limit):
    """Factor a matrix of one row."""
    keep_diagonal(pattern, values)
    return eliminate(values, 1, 1, 1, values[pattern.shape[1] :], limit)


@long_kernel
def factor_blocks(pattern, values, b, with_b, limit):
    """Factor a matrix block by block; with_b 1: b <- D^-1 L^-1 b, too."""
    kept = values[pattern.shape[1] :]
    starts, heads, widths, updates = pattern.starts, pattern.heads, pattern.widths, pattern.updates
    keep_diagonal(pattern, values)
    for j in range(heads.size):
        # A link of a chain: 3 rows that update one other block of 3
        first, width = starts[j], widths[j]
        size = starts[j + 1] - first
        if size == 3 and width == 6 and updates[j + 1] - updates[j] == 1:
            target, stride = place_of_products(pattern, updates[j])
            failed = link(values, heads[j], target, stride, pattern.shape[1] + first, limit)
            if failed >= 0:
                return first + failed
            if with_b == 1:
                _forward_block(pattern, values, b, j)
            continue
        # Otherwise: the diagonal block, three pivots at a time
        panel = values[heads[j] :]
        for k in range(0, size, 3):
            u = panel[k * (width + 1) :]
            failed = eliminate(u, size - k, width, width - k, kept[first + k :], limit)
            if failed >= 0:
                return first + k + failed
            # Rows of the block below these pivots
            if size - k > 3:
                out, right = u[3 * (width + 1) :], u[3:]
                subtract_products(u, 3, width, right, right, out, width, size - k - 3, width - k - 3, True)
        # Rows of later blocks
        update_later_blocks(pattern, values, panel, j, size, width)
        if with_b == 1:
            _forward_block(pattern, values, b, j)
    return -1


@kernel
def update_later_blocks(pattern, values, panel, j, size, width):
    """Subtract the products of the eliminated block j, `size` rows of a panel, from later panels."""
    for e in range(pattern.updates[j], pattern.updates[j + 1]):
        # values[target] -= U_at^T D^-1 U_run for the rows and runs of columns that the record names
        at, rows, run, n, target, stride = record(pattern, e)
        for k in range(0, size, 3):
            u, r = panel[k * (width + 1) :], panel[k * width :]
            subtract_products(u, size - k, width, r[at:], r[run:], values[target:], stride, rows, n, at == run)


@kernel
def record(pattern, e):
    """Which products go where: columns of a panel and how many, twice; place and row length of what they change."""
    one = pattern.records[6 * e :]
    return one[0], one[1], one[2], one[3], one[4], one[5]


@kernel
def place_of_products(pattern, e):
    """Place and row length of what the products change."""
    return pattern.records[6 * e + 4], pattern.records[6 * e + 5]


@kernel
def factor_lu(pattern, lower, upper, limit):
    """Factor N in place, without pivoting.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry's
    size, or a number that is not finite.
    """
    if pattern.shape[0] == 1:
        return factor_lu_row(pattern, lower, upper, limit)
    return factor_lu_blocks(pattern, lower, upper, limit)


@kernel
def factor_lu_row(pattern, lower, upper, limit):
    """Factor a matrix of one row."""
    kept = upper[pattern.shape[1] :]
    kept[0] = upper[0]
    return eliminate_lu(lower, upper, 1, 1, 1, kept, limit)


@long_kernel
def factor_lu_blocks(pattern, lower, upper, limit):
    """Factor a matrix block by block."""
    kept = upper[pattern.shape[1] :]
    starts, heads, widths, updates = pattern.starts, pattern.heads, pattern.widths, pattern.updates
    keep_diagonal(pattern, upper)
    for j in range(heads.size):
        # A link of a chain
        first, width = starts[j], widths[j]
        size = starts[j + 1] - first
        if size == 3 and width == 6 and updates[j + 1] - updates[j] == 1:
            target, stride = place_of_products(pattern, updates[j])
            failed = link_lu(lower, upper, heads[j], target, stride, pattern.shape[1] + first, limit)
            if failed >= 0:
                return first + failed
            continue
        # The diagonal block, three pivots at a time, in both factors
        below, above = lower[heads[j] :], upper[heads[j] :]
        for k in range(0, size, 3):
            l, u = below[k * (width + 1) :], above[k * (width + 1) :]
            failed = eliminate_lu(l, u, size - k, width, width - k, kept[first + k :], limit)
            if failed >= 0:
                return first + k + failed
            if size - k > 3:
                # Rows of the block below these pivots: U -= L D^-1 U, then L likewise
                left, right, corner = l[3:], u[3:], 3 * (width + 1)
                out, other = u[corner:], l[corner:]
                for _ in range(2):
                    subtract_products(u, 3, width, left, right, out, width, size - k - 3, width - k - 3, True)
                    left, right, out = right, left, other
        for e in range(updates[j], updates[j + 1]):
            # Later blocks: U -= L D^-1 U, then L with the factors exchanged
            at, rows, run, n, target, stride = record(pattern, e)
            left, right, out = below, above, upper[target:]
            for _ in range(2):
                for k in range(0, size, 3):
                    u, l, r = above[k * (width + 1) :], left[k * width + at :], right[k * width + run :]
                    subtract_products(u, size - k, width, l, r, out, stride, rows, n, at == run)
                left, right, out = above, below, lower[target:]
    return -1


@kernel
def solve(pattern, values, b):
    """Solve S x = b in place, b (rows,) in elimination order, by the factors of `factor`."""
    solve_lu(pattern, values, values, b)


@kernel
def solve_lu(pattern, lower, upper, b):
    """Solve N x = b in place, b (rows,) in elimination order, by the factors of `factor_lu`."""
    if pattern.shape[0] == 1:
        b[0] *= lower[0]
        return
    solve_blocks(pattern, lower, upper, b, 0)


@kernel
def _forward_block(pattern, lower, b, j):
    """D^-1 L^-1 b of a block, and what it takes from the rows after it."""
    columns, segments = pattern.columns, pattern.segments
    first, width, head = pattern.starts[j], pattern.widths[j], pattern.heads[j]
    size = pattern.starts[j + 1] - first
    if width == 6 and size == 3 and columns[j + 1] - columns[j] == 1:
        _forward_link(lower, head, b, first, segments[2 * columns[j]])
        return
    # Three unknowns of the block, then what they take from the rows after them
    own, u = b[first:], lower[head:]
    while True:
        _forward(size, width, u, own)
        _forward_rest(size, width, u, own, b, columns[j], columns[j + 1], segments)
        if size <= 3:
            break
        u, own, size = u[3 * (width + 1) :], own[3:], size - 3


@long_kernel
def solve_blocks(pattern, lower, upper, b, begun):
    """Solve block by block; begun 1: b is D^-1 L^-1 b already."""
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    columns, segments = pattern.columns, pattern.segments
    if begun == 0:
        for j in range(heads.size):
            _forward_block(pattern, lower, b, j)
    for j in range(heads.size - 1, -1, -1):
        # Backward: U^-1 b, from the last block on
        first, width, head = starts[j], widths[j], heads[j]
        size = starts[j + 1] - first
        if width == 6 and size == 3 and columns[j + 1] - columns[j] == 1:
            _backward_link(upper, head, b, first, segments[2 * columns[j]])
            continue
        # Three unknowns at a time, the last ones first
        k = (size - 1) // 3 * 3
        while k >= 0:
            own, u = b[first + k :], upper[head + k * (width + 1) :]
            x, y, z = _backward_rest(size - k, width, u, own, b, columns[j], columns[j + 1], segments)
            _backward(size - k, width, u, own, x, y, z)
            k -= 3


@kernel
def _forward_link(u, h, b, i, o):
    """Three unknowns, at b[i], of a block as `link` eliminates, at u[h]; taken from the three rows at b[o]."""
    # L^-1 within the block, times D^-1
    x = get(b, i) * get(u, h)
    y = (get(b, i + 1) - x * get(u, h + 1)) * get(u, h + 7)
    z = (get(b, i + 2) - x * get(u, h + 2) - y * get(u, h + 8)) * get(u, h + 14)
    let(b, i, x)
    let(b, i + 1, y)
    let(b, i + 2, z)
    # What the three unknowns take from the rows after the block
    for c in range(3):
        let(b, o + c, get(b, o + c) - (x * get(u, h + 3 + c) + y * get(u, h + 9 + c) + z * get(u, h + 15 + c)))


@kernel
def _backward_link(u, h, b, i, o):
    """The same, backwards."""
    # Products of the rows beside the block with the three unknowns known already
    e, f, g = get(b, o), get(b, o + 1), get(b, o + 2)
    x = e * get(u, h + 3) + f * get(u, h + 4) + g * get(u, h + 5)
    y = e * get(u, h + 9) + f * get(u, h + 10) + g * get(u, h + 11)
    z = get(b, i + 2) - get(u, h + 14) * (e * get(u, h + 15) + f * get(u, h + 16) + g * get(u, h + 17))
    # U^-1 within the block
    x += get(u, h + 2) * z
    y = get(b, i + 1) - get(u, h + 7) * (y + get(u, h + 8) * z)
    let(b, i, get(b, i) - get(u, h) * (x + get(u, h + 1) * y))
    let(b, i + 1, y)
    let(b, i + 2, z)


@kernel
def _forward(size, width, u, own):
    x = own[0] * u[0]
    own[0] = x
    if size > 1:
        v = u[width:]
        y = (own[1] - x * u[1]) * v[1]
        own[1] = y
        if size > 2:
            w = v[width:]
            own[2] = (own[2] - x * u[2] - y * v[2]) * w[2]


@kernel
def solve_three(lower, upper, b):
    """Solve a block of three rows that has no others."""
    _forward(3, 3, lower, b)
    _backward(3, 3, upper, b, 0.0, 0.0, 0.0)


@kernel
def _forward_rest(size, width, u, own, b, here, end, segments):
    """Take up to three unknowns from the rows after them."""
    # One unknown; segments are runs of consecutive rows in b
    if size == 1:
        x = own[0]
        at = 1
        for e in range(here, end):
            out, n, us = b[segments[2 * e] :], segments[2 * e + 1], u[at:]
            for i in range(n):
                out[i] -= x * us[i]
            at += n
    elif size == 2:
        x, y = own[0], own[1]
        v = u[width:]
        at = 2
        for e in range(here, end):
            out, n, us, vs = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:]
            for i in range(n):
                out[i] -= x * us[i] + y * vs[i]
            at += n
    else:
        # Three unknowns, and the rest of the block
        x, y, z = own[0], own[1], own[2]
        v, w = u[width:], u[2 * width :]
        for i in range(3, size):
            own[i] -= x * u[i] + y * v[i] + z * w[i]
        at = size
        for e in range(here, end):
            out, n, us, vs, ws = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:], w[at:]
            for i in range(n):
                out[i] -= x * us[i] + y * vs[i] + z * ws[i]
            at += n


@kernel
def _backward(size, width, u, own, x, y, z):
    if size > 1:
        v = u[width:]
        if size > 2:
            w = v[width:]
            z = own[2] - w[2] * z
            own[2] = z
            x += u[2] * z
            y += v[2] * z
        y = own[1] - v[1] * y
        own[1] = y
        x += u[1] * y
    own[0] -= u[0] * x


@kernel
def _backward_rest(size, width, u, own, b, here, end, segments):
    """What the rows after them give to up to three unknowns."""
    x, y, z = 0.0, 0.0, 0.0
    # One unknown; segments are runs of consecutive rows in b
    if size == 1:
        at = 1
        for e in range(here, end):
            source, n, us = b[segments[2 * e] :], segments[2 * e + 1], u[at:]
            for i in range(n):
                x += us[i] * source[i]
            at += n
    elif size == 2:
        v = u[width:]
        at = 2
        for e in range(here, end):
            source, n, us, vs = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:]
            for i in range(n):
                x += us[i] * source[i]
                y += vs[i] * source[i]
            at += n
    else:
        # Three unknowns, and the rest of the block
        v, w = u[width:], u[2 * width :]
        for i in range(3, size):
            x += u[i] * own[i]
            y += v[i] * own[i]
            z += w[i] * own[i]
        at = size
        for e in range(here, end):
            source, n, us, vs, ws = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:], w[at:]
            for i in range(n):
                x += us[i] * source[i]
                y += vs[i] * source[i]
                z += ws[i] * source[i]
            at += n
    return x, y, z
