"""Selection of independent rows of H among redundant ones, by rank-revealing elimination of S.

A redundant row holds wherever the rows that it depends on hold. It is dropped: its row of H and its right-hand sides
are zero and its diagonal entry of S and N is one, so its multiplier is zero and every sparsity pattern is unchanged.
The selection is renewed when the kept rows come close to dependence.

Rows are ordered by diagonally pivoted Cholesky, pivots relative to the diagonal entry; rows with negligible pivots are
dropped. In large scenes pivoting is confined to the blocks of the fill-reducing order: the selection is independent,
but not the best conditioned.
"""

import math

from ..jit.kernels import kernel, long_kernel
from ..jit.simd import put, splat
from ..sparse.block_operations import eliminate, subtract_products
from ..sparse.factorisation import keep_diagonal, record
from .axis_rows import leave_axes_out
from .schur_complement import inner, multiply_rows, weigh_rows
from .tolerances import ZERO_PIVOT

FIRST, FINER = 1e-3, 1e-2  # the share below which rows are dropped, at first; how it falls while those are too many
WORSE = 0.1  # of what the weakest row has had since it was chosen: below it the choice is made anew


@kernel
def drop(dropped, b):
    """Zero the right-hand sides of dropped rows."""
    for i in range(dropped[0]):
        b[dropped[1 + i]] = 0.0


@kernel
def drop_rows(dropped, H):
    """Zero the rows of H that are dropped."""
    for i in range(dropped[0]):
        at = 16 * dropped[1 + i]
        for c in range(0, 16, 4):
            put(H, at + c, splat(0.0))


@kernel
def drop_diagonal(network, dropped, values):
    """Ones on the diagonal of S, or of one of the parts of N, where rows are dropped."""
    for i in range(dropped[0]):
        values[network.diagonal[dropped[1 + i]]] = 1.0


@kernel
def weakest(network, values):
    """The least share of its diagonal entry that elimination has left of a row, axis rows not among them.

    values are factors of S.
    """
    pattern, least = network.pattern, 1.0
    kept = values[pattern.shape[1] :]
    for e in range(network.diagonal.size):
        share = values[network.diagonal[e]] * kept[e]
        if not share * least < 1.0 and not kept[e] < 0.0:
            least = 1.0 / share
    return least


@long_kernel
def _choose_of_all(network, H, Y, wanted, least, dropped, A, order):
    """Choose among all rows at once, A (m, m) scratch; how many are dropped, those that are left less than `least`."""
    m, count = network.row.size, 0
    for i in range(m):
        if network.row[i] >= 0:
            order[count] = i
            count += 1
        for j in range(i + 1):
            x = 0.0
            for k in range(2):
                for l in range(2):
                    body = network.sides[i, k]
                    if body == network.sides[j, l] and body < network.bodies.shape[0]:
                        x += inner(H, 16 * i + 8 * k, Y, 16 * j + 8 * l)
            A[i * m + j] = x
    for i in range(m):
        for j in range(i):
            size = A[i * m + i] * A[j * m + j]
            A[i * m + j] = A[j * m + i] = A[i * m + j] / math.sqrt(size) if size > 0.0 else 0.0
    for i in range(m):
        A[i * m + i] = 1.0 if A[i * m + i] > 0.0 else 0.0
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
        own = A[order[k] * m :]
        for i in range(k + 1, count):
            other = A[order[i] * m :]
            f = other[order[k]] / best
            if f != 0.0:
                for j in range(k + 1, count):
                    other[order[j]] -= f * own[order[j]]
    for i in range(rank, count):
        dropped[1 + i - rank] = order[i]
    return count - rank


@kernel
def _choose(size, width, panel, kept, joints, share, A, order):
    """Order the rows of a block, A (size, size) scratch: the kept ones first; how many they are.

    joints (size,) is negative for rows that are kept in any case, the welds of a hub and the rows of axes.
    """
    for i in range(size):
        order[i] = i
        for j in range(i, size):
            A[i * size + j] = A[j * size + i] = panel[i * width + j]
    for k in range(size):
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
        row = order[k]
        d = 1.0 / A[row * size + row]
        for i in range(k + 1, size):
            f = A[order[i] * size + row] * d
            for j in range(k + 1, size):
                A[order[i] * size + order[j]] -= f * A[row * size + order[j]]
    return size


@long_kernel
def _eliminate_choosing(network, values, share, dropped, A, order):
    """Factor S in place but for the rows that are left less than a share of their diagonal entry; how many they are.

    As factorisation.factor; what is left in `values` serves nothing. Negative where a row that must be kept can't be.
    """
    pattern = network.pattern
    starts, heads, widths, updates = pattern.starts, pattern.heads, pattern.widths, pattern.updates
    keep_diagonal(pattern, values)
    kept, count = values[pattern.shape[1] :], 0
    for j in range(heads.size):
        first, width, panel = starts[j], widths[j], values[heads[j] :]
        size = starts[j + 1] - first
        rank = _choose(size, width, panel, kept[first:], network.row[first:], share, A, order)
        for i in range(rank, size):
            row = order[i]
            dropped[1 + count] = first + row
            count += 1
            for c in range(row, width):
                panel[row * width + c] = 0.0
            for r in range(row):
                panel[r * width + row] = 0.0
            panel[row * width + row] = kept[first + row] = 1.0
        for k in range(0, size, 3):
            u = panel[k * (width + 1) :]
            if eliminate(u, size - k, width, width - k, kept[first + k :], 0.0) >= 0:
                return -1
            if size - k > 3:
                out, right = u[3 * (width + 1) :], u[3:]
                subtract_products(u, 3, width, right, right, out, width, size - k - 3, width - k - 3, True)
        for e in range(updates[j], updates[j + 1]):
            at, rows, run, n, target, stride = record(pattern, e)
            for k in range(0, size, 3):
                u, r = panel[k * (width + 1) :], panel[k * width :]
                subtract_products(u, size - k, width, r[at:], r[run:], values[target:], stride, rows, n, at == run)
    return count


@kernel
def _settle(f, count, wanted):
    """Drop the rows that were chosen, if they are as many as wanted."""
    if count < 0 or (wanted >= 0 and count != wanted):
        return False
    f.dropped[0] = count
    for i in range(1, count + 1):
        f.dropped[i] = f.chosen[i]
    return True


@long_kernel
def select(network, f, H, Y, S, wanted, least):
    """Choose `wanted` rows to drop of H, that of all rows; where wanted < 0, all that are left less than a least share.

    Whether there are so many; f.dropped then has them, in order of elimination. Y and S are scratch.
    """
    m, count = network.row.size, -1
    if f.block.size >= m * m and network.welds.shape[0] == 0:
        weigh_rows(network, H, Y)
        count = _choose_of_all(network, H, Y, wanted, ZERO_PIVOT if wanted >= 0 else least, f.chosen, f.block, f.order)
        return _settle(f, count, wanted)
    share = FIRST if wanted >= 0 else least
    while True:
        weigh_rows(network, H, Y)
        multiply_rows(network, H, Y, S)
        leave_axes_out(network, S)
        count = _eliminate_choosing(network, S, share, f.chosen, f.block, f.order)
        if _settle(f, count, wanted):
            return True
        share *= FINER
        if count < wanted or share < least:
            return False
