"""Redundant rows: a row that holds wherever the rows hold that it depends on.

It is dropped: its row of H and its right-hand sides are zero and its diagonal entry of S and N is one, so its
multiplier is zero and every sparsity pattern is unchanged.
"""

import math

from ..elements.loops.constraint_rows import POSE, R
from ..jit.kernels import kernel
from ..jit.simd import four, put, splat
from ..maths.dense_linalg import copy, largest
from ..maths.tolerances import HALF_DIGITS
from .tolerances import HELD


@kernel
def clear_redundant(f, b):
    """Zero the right-hand sides of redundant rows."""
    for i in range(f.dropped[0]):
        b[f.dropped[1 + i]] = 0.0


@kernel
def clear_rates(graph, b):
    """Zero the entries of rows on velocities: they hold nothing in place."""
    for i in range(graph.rates.size):
        b[graph.rates[i]] = 0.0


@kernel
def is_rate(graph, e):
    """Whether a row is one on velocities; their places are in ascending order."""
    low, high = 0, graph.rates.size
    while low < high:
        middle = (low + high) // 2
        if graph.rates[middle] < e:
            low = middle + 1
        else:
            high = middle
    return low < graph.rates.size and graph.rates[low] == e


@kernel
def keep_redundant(f, b, kept):
    """Zero the right-hand sides of redundant rows, after storing them in `kept`, one of `RedundantRows`."""
    if kept.size > 0:
        for i in range(f.dropped[0]):
            kept[i] = b[f.dropped[1 + i]]
    clear_redundant(f, b)


@kernel
def leave_redundant_rows(graph, f, Phi, H):
    """Zero the redundant rows of Phi and H, after keeping these rows of H and how well the residuals hold."""
    worst = -math.inf
    for i in range(f.dropped[0]):
        row = f.dropped[1 + i]
        # Residual beyond HELD of the terms of the row
        over = abs(Phi[row]) - HELD * _position_terms(graph, f, H, row)
        if not over <= worst:
            worst = over
        _leave_pair(f, H, row, i)
        for j in range(graph.tails.shape[0]):
            if graph.tails[j] == row:
                _leave_pair(f, H, graph.row.shape[0] + j, graph.row.shape[0] + j)
    f.selection.excess = worst
    clear_redundant(f, Phi)


@kernel
def rates_hold_along(graph, f, Z):
    """Whether the redundant rows on velocities vanish for Z (b, 8), which the other rows admit."""
    rounding = HALF_DIGITS * largest(Z)  # of bodies that the other rows hold, nothing else is left
    for i in range(f.dropped[0]):
        row, total, terms = f.dropped[1 + i], 0.0, 0.0
        for side in range(2):
            b, at = graph.sides[row, side], 16 * i + 8 * side
            for part in range(0, 8 if b < graph.bodies.shape[0] and is_rate(graph, row) else 0, 4):
                for c in range(part, part + 3):
                    total += f.redundant.H[at + c] * Z[8 * b + c]
                terms += length(f.redundant.H, at + part) * (length(Z, 8 * b + part) + rounding)
        if not abs(total) <= HALF_DIGITS * terms:
            return False
    return True


@kernel
def _leave_pair(f, H, e, kept):
    """H = 0 of a pair of sides, kept in the place `kept`."""
    for c in range(0, 16, 4):
        if f.redundant.H.size > 0:
            put(f.redundant.H, 16 * kept + c, four(H, 16 * e + c))
        put(H, 16 * e + c, splat(0.0))


@kernel
def _position_terms(graph, f, H, row):
    """Size of the terms of a row at the poses: |H_r| |r| + |H_pi'|."""
    terms = _terms_of_pair(graph, f, H, row)
    for j in range(graph.tails.shape[0]):
        if graph.tails[j] == row:
            terms += _terms_of_pair(graph, f, H, graph.row.shape[0] + j)
    return terms


@kernel
def _terms_of_pair(graph, f, H, e):
    """The same of a pair of sides."""
    terms = 0.0
    for side in range(2):
        # |H_r| |r| + |H_pi'|
        b, at = graph.sides[e, side], 16 * e + 8 * side
        if b < graph.bodies.shape[0]:
            terms += math.sqrt(square(H, at) * square(f.poses, b * POSE + R)) + length(H, at + 4)
    return terms


@kernel
def square(x, i):
    """|x[i : i + 3]|^2."""
    return x[i] * x[i] + x[i + 1] * x[i + 1] + x[i + 2] * x[i + 2]


@kernel
def length(x, i):
    """|x[i : i + 3]|."""
    return math.sqrt(square(x, i))


@kernel
def set_redundant_diagonal(graph, f, values):
    """Set ones on the diagonal of S, or of one of the parts of N, at redundant rows."""
    for i in range(f.dropped[0]):
        values[graph.diagonal[f.dropped[1 + i]]] = 1.0


@kernel
def keep_every_row(f):
    """Drop no row for now; returns what `restore_selection` takes."""
    count = f.dropped[0]
    f.dropped[0] = 0
    return count


@kernel
def restore_selection(f, count):
    """Drop the redundant rows again, after `keep_every_row`."""
    f.dropped[0] = count


@kernel
def save_selection(f):
    """Save the selection of redundant rows before a passing one."""
    for i in range(f.dropped[0] + 1):
        f.saved[i] = f.dropped[i]
    copy(f.best, f.saved_best)


@kernel
def return_to_selection(f):
    """Return to the saved selection of redundant rows."""
    for i in range(f.saved[0] + 1):
        f.dropped[i] = f.saved[i]
    copy(f.saved_best, f.best)


@kernel
def note_selection(f, out):
    """Write the redundant rows to out, -1 if it holds another number of them."""
    known = f.dropped[0] == out.size
    for i in range(out.size):
        out[i] = f.dropped[1 + i] if known else -1.0


@kernel
def take_noted_selection(f, given):
    """Select the rows of `note_selection`, which no others are to replace now."""
    if given.size == 0 or given[0] < 0.0:
        return
    f.dropped[0] = given.size
    for i in range(given.size):
        f.dropped[1 + i] = int(given[i])
    f.best[:] = 0.0


@kernel
def list_redundant(graph, f, out):
    """out[0] = number of redundant rows, then their places among the rows of Phi."""
    out[0] = f.dropped[0]
    for i in range(f.dropped[0]):
        out[1 + i] = graph.row[f.dropped[1 + i]]


@kernel
def mark_redundant(graph, f, value, out):
    """out[i] = value for the redundant rows i of Phi."""
    for i in range(f.dropped[0]):
        out[graph.row[f.dropped[1 + i]]] = value
