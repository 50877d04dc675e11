"""Selection of independent rows of H among redundant ones, by rank-revealing elimination of S.

Rows are ordered by diagonally pivoted Cholesky, pivots relative to the diagonal entry; rows with negligible pivots are
dropped. In large scenes pivoting is confined to the blocks of the fill-reducing order: the selection is independent,
but not the best conditioned.
"""

import math

from ..jit.kernels import kernel, long_kernel
from ..sparse.block_operations import eliminate, subtract_products
from ..sparse.factorisation import keep_diagonal, update_later_blocks
from .axis_rows import leave_axes_out
from .schur_complement import form_schur_complement, inner, weigh_rows
from .tolerances import FEWER, FIRST_SHARE, ZERO_PIVOT


@kernel
def weakest(graph, values):
    """Return the smallest pivot relative to its diagonal entry, axis rows excluded.

    values are factors of S.
    """
    pattern, least = graph.pattern, 1.0
    kept = values[pattern.shape[1] :]
    for e in range(graph.diagonal.size):
        # Reciprocal pivot times diagonal entry; not a number counts as a vanishing pivot
        share = values[graph.diagonal[e]] * kept[e]
        if not share * least < 1.0 and not kept[e] < 0.0:
            least = 1.0 / share
    return least


@kernel
def weakest_of_all(graph, values):
    """The same, or the smallest pivot of an axis row, which is the part of an inertia that the other rows account for.

    In METRIC these pivots are one.
    """
    least = weakest(graph, values)
    for i in range(graph.axes.rows.shape[0]):
        share = abs(values[graph.diagonal[graph.axes.rows[i].row]])
        if not share * least < 1.0:
            least = 1.0 / share
    return least


@long_kernel
def _choose_of_all(graph, H, Y, wanted, least, dropped, A, order):
    """Select rows by global pivoting, A (m, m) scratch; return the number of rows with pivots below `least`."""
    m, count = graph.row.size, 0
    for i in range(m):
        if graph.row[i] >= 0:
            order[count] = i
            count += 1
        for j in range(i + 1):
            # A = H W H^T over the bodies that two rows share
            x = 0.0
            for k in range(2):
                for l in range(2):
                    body = graph.sides[i, k]
                    if body == graph.sides[j, l] and body < graph.bodies.shape[0]:
                        x += inner(H, 16 * i + 8 * k, Y, 16 * j + 8 * l)
            A[i * m + j] = x
    # Scaled to a unit diagonal: pivots are squared sines of angles between rows
    for i in range(m):
        for j in range(i):
            size = A[i * m + i] * A[j * m + j]
            A[i * m + j] = A[j * m + i] = A[i * m + j] / math.sqrt(size) if size > 0.0 else 0.0
    for i in range(m):
        A[i * m + i] = 1.0 if A[i * m + i] > 0.0 else 0.0
    # Cholesky with diagonal pivoting, until the wanted number of rows, or only negligible pivots, are left
    rank = count
    for k in range(count):
        best, pivot = -1.0, k
        for i in range(k, count):
            if A[order[i] * m + order[i]] > best:
                best, pivot = A[order[i] * m + order[i]], i
        if count - k <= wanted or not best > least:
            rank = k
            break
        order[k], order[pivot] = order[pivot], order[k]
        # Subtract the pivot row from the rows that are left
        own = A[order[k] * m :]
        for i in range(k + 1, count):
            other = A[order[i] * m :]
            f = other[order[k]] / best
            if f != 0.0:
                for j in range(k + 1, count):
                    other[order[j]] -= f * own[order[j]]
    # The rows that are left depend on the others
    for i in range(rank, count):
        dropped[1 + i - rank] = order[i]
    return count - rank


@kernel
def _choose(size, width, panel, kept, joints, share, A, order):
    """Order the rows of a block by pivoting, kept rows first, A (size, size) scratch; return the number of kept rows.

    joints (size,) is negative for rows that are kept in any case, the welds of a hub and the rows of axes.
    """
    # The diagonal block, as a symmetric matrix
    for i in range(size):
        order[i] = i
        for j in range(i, size):
            A[i * size + j] = A[j * size + i] = panel[i * width + j]
    for k in range(size):
        # Largest pivot relative to its diagonal entry; rows that must stay go first
        best, pivot = -1.0, k
        for i in range(k, size):
            row = order[i]
            part = A[row * size + row] / kept[row] if kept[row] > 0.0 else 0.0
            if joints[row] < 0:
                part += 2.0
            if part > best:
                best, pivot = part, i
        if not best > share:
            return k
        order[k], order[pivot] = order[pivot], order[k]
        # Eliminate it from the rows that are left
        row = order[k]
        d = 1.0 / A[row * size + row]
        for i in range(k + 1, size):
            f = A[order[i] * size + row] * d
            for j in range(k + 1, size):
                A[order[i] * size + order[j]] -= f * A[row * size + order[j]]
    return size


@long_kernel
def _eliminate_choosing(graph, values, share, dropped, A, order):
    """Factor S in place without rows whose relative pivots are below `share`; return the number of these rows.

    As factorisation.factor; `values` are scratch afterwards. Negative if a row that must be kept depends on others.
    """
    pattern = graph.pattern
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    keep_diagonal(pattern, values)
    kept, count = values[pattern.shape[1] :], 0
    for j in range(heads.size):
        # Which rows of this block are independent of each other and of earlier blocks
        first, width, panel = starts[j], widths[j], values[heads[j] :]
        size = starts[j + 1] - first
        rank = _choose(size, width, panel, kept[first:], graph.row[first:], share, A, order)
        for i in range(rank, size):
            # A dropped row: zero in its row and column, one on the diagonal
            row = order[i]
            dropped[1 + count] = first + row
            count += 1
            for c in range(row, width):
                panel[row * width + c] = 0.0
            for r in range(row):
                panel[r * width + row] = 0.0
            panel[row * width + row] = kept[first + row] = 1.0
        # Elimination of the block, three pivots at a time, as factorisation.factor_blocks
        for k in range(0, size, 3):
            u = panel[k * (width + 1) :]
            if eliminate(u, size - k, width, width - k, kept[first + k :], 0.0) >= 0:
                return -1
            if size - k > 3:
                out, right = u[3 * (width + 1) :], u[3:]
                subtract_products(u, 3, width, right, right, out, width, size - k - 3, width - k - 3, True)
        update_later_blocks(pattern, values, panel, j, size, width)
    return count


@kernel
def _accept(f, count, wanted):
    """Drop the selected rows if their number is the wanted one."""
    if count < 0 or (wanted >= 0 and count != wanted):
        return False
    f.dropped[0] = count
    for i in range(1, count + 1):
        f.dropped[i] = f.chosen[i]
    return True


@long_kernel
def select(graph, f, rows, wanted, least):
    """Select `wanted` rows of H to drop; if wanted < 0, all rows with relative pivots below `least`.

    Return True if that many exist; f.dropped then lists them in elimination order. Y and S are scratch.
    """
    m, count = graph.row.size, -1
    # Few rows: choose among all at once
    if f.block.size >= m * m and graph.welds.shape[0] == 0:
        weigh_rows(graph, rows.H, rows.Y)
        share = ZERO_PIVOT if wanted >= 0 else least
        count = _choose_of_all(graph, rows.H, rows.Y, wanted, share, f.chosen, f.block, f.order)
        return _accept(f, count, wanted)
    # Many rows: within the blocks of the elimination order, with an ever smaller share until the number is right
    share = FIRST_SHARE if wanted >= 0 else least
    while True:
        weigh_rows(graph, rows.H, rows.Y)
        form_schur_complement(graph, rows.H, rows.Y, rows.S)
        leave_axes_out(graph, rows.S)
        count = _eliminate_choosing(graph, rows.S, share, f.chosen, f.block, f.order)
        if _accept(f, count, wanted):
            return True
        share *= FEWER
        if count < wanted or share < least:
            return False
