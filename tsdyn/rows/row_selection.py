"""Selection of independent rows among redundant ones, at the start and along a run; whether the others hold."""

import math
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import POSE, R
from ..jit.kernels import ANY, DEBUG, callback, caller, image_of, kernel, loader, long_kernel, stack, vector
from ..jit.predicates import below, choose, either, every, most
from ..jit.simd import get
from ..maths.tolerances import PIVOT_ROUNDING
from . import tolerances as limits
from .block_operations import eliminate, subtract_products
from .constraint_graph import ConstraintGraph, no_graph
from .evaluation import Rows, TangentWorkspace, evaluate_all, evaluate_every_row, no_tangent_workspace
from .factorisation import keep_diagonal, update_later_blocks
from .redundant_rows import is_rate, keep_every_row, leave_redundant_rows, length, square
from .schur_complement import (
    factorise_selected_rows,
    form_schur_complement,
    inner,
    leave_axes_out,
    multiply_rows,
    solve_rows,
    weigh,
    weigh_rows,
)

# Selection of independent rows of H among redundant ones, by rank-revealing elimination of S.
#
# Rows are ordered by diagonally pivoted Cholesky, pivots relative to the diagonal entry; rows with negligible pivots
# are dropped. Rows on positions go first: rows on velocities in their place would let positions drift. In large scenes
# pivoting is confined to the blocks of the fill-reducing order: the selection is independent, but not the best
# conditioned.


@kernel
def weakest(graph, values):
    """Return the smallest pivot relative to its diagonal entry, axis rows excluded.

    values are factors of S, of one case or of lanes.
    """
    first, least = graph.pattern.shape[1], 1.0
    for e in range(graph.diagonal.size):
        # Reciprocal pivot times diagonal entry; not a number counts as a vanishing pivot
        kept = get(values, first + e)
        share = get(values, graph.diagonal[e]) * kept
        strong = either(below(share * least, 1.0), below(kept, 0.0))
        if not every(strong):
            least = choose(strong, least, 1.0 / share)
    return least


@long_kernel
def _choose_of_all(graph, H, Y, wanted, least, dropped, A, order):
    """Select rows by global pivoting, A (m, m) scratch; return the number of rows with pivots below `least`."""
    m, count = graph.row.size, 0
    # Rows on positions first, by pivots that are one larger: their residuals can't drift
    lift = 1.0 if graph.rates.size > 0 else 0.0
    dropped[1:] = 1
    for i in range(graph.rates.size):
        dropped[1 + graph.rates[i]] = 0
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
    _add_tails(graph, H, Y, A)
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
            part = A[order[i] * m + order[i]]
            if part > least and dropped[1 + order[i]] == 1:
                part += lift
            if part > best:
                best, pivot = part, i
        best = A[order[pivot] * m + order[pivot]]
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
def _add_tails(graph, H, Y, A):
    """The products of the later terms of sums, added to the lower triangle A of H W H^T."""
    m = graph.row.size
    for t in range(graph.tails.size):
        for j in range(m + t + 1):
            x, e, o = 0.0, graph.tails[t], graph.tails[j - m] if j >= m else j
            for k in range(2):
                for l in range(2):
                    body = graph.sides[m + t, k]
                    if body == graph.sides[j, l] and body < graph.bodies.shape[0]:
                        x += inner(H, 16 * (m + t) + 8 * k, Y, 16 * j + 8 * l)
            # Two terms of one sum count both ways
            A[max(e, o) * m + min(e, o)] += 2.0 * x if e == o and j != m + t else x


@kernel
def _choose(graph, first, size, width, panel, kept, share, A, order):
    """Order the rows of a block by pivoting, kept rows first, A (size, size) scratch; return the number of kept rows.

    Rows that are no rows of Phi, the welds of a hub and the rows of axes, are kept in any case.
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
            if graph.row[first + row] < 0:
                part += 2.0
            elif graph.rates.size > 0 and part > share and not is_rate(graph, first + row):
                part += 1.0
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
        rank = _choose(graph, first, size, width, panel, kept[first:], share, A, order)
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
        share = PIVOT_ROUNDING if wanted >= 0 else least
        count = _choose_of_all(graph, rows.H, rows.Y, wanted, share, f.chosen, f.block, f.order)
        return _accept(f, count, wanted)
    # Many rows: within the blocks of the elimination order, with an ever smaller share until the number is right
    share = limits.FIRST_SHARE if wanted >= 0 else least
    while True:
        weigh_rows(graph, rows.H, rows.Y)
        form_schur_complement(graph, rows.H, rows.Y, rows.S)
        leave_axes_out(graph, rows.S)
        count = _eliminate_choosing(graph, rows.S, share, f.chosen, f.block, f.order)
        if _accept(f, count, wanted):
            return True
        share *= limits.FEWER
        if count < wanted or share < least:
            return False


# Singularity indicator: the smallest pivot of S relative to its diagonal entry.
#
# The indicator falls as the square of the distance to a singular configuration. It is compared with its largest value
# in the run.


@kernel
def singularity_indicator(graph, rows):
    """Return the singularity indicator of rows that are factorised."""
    return weakest(graph, rows.S)


@kernel
def note_indicator(graph, f, rows):
    """Record the singularity indicator at a chart or the end of a step."""
    note = f.indicator
    note.start = singularity_indicator(graph, rows)
    note.largest = max(note.start, note.largest)


@kernel
def is_near_singular(f, share):
    """Return True if a configuration with this indicator is near a singular one."""
    return share < limits.NEAR * f.indicator.largest


@kernel
def refinements(indicator):
    """How often multipliers are refined for the condition of S."""
    # S loses digits in proportion to the reciprocal of the indicator
    if indicator > limits.WORST_CONDITIONED:
        return 0 if indicator > limits.ILL_CONDITIONED else 1
    return 2 if indicator > limits.HARDLY_CONDITIONED else 4


@kernel
def is_next_to_singular(f):
    """Return True if the recorded indicator says that a step method can't go on."""
    return f.indicator.start < limits.NEXT_TO * f.indicator.largest


@kernel
def is_singular_within_a_step(f):
    """Return True if a singular configuration may be within a fixed step."""
    return f.indicator.start < limits.WITHIN_A_STEP * f.indicator.largest


# Whether redundant rows hold: their residuals at three levels, relative to the sizes of their terms.
#
#     position        |Phi|               |H_r| |r| + |H_pi'|
#     velocity        |H y + Phi_t|       sum_i |H_i y_i| + |Phi_t|
#     acceleration    |H yd + gamma|      sum_i |H_i yd_i| + |H_pi'| |2 p.pdd| + |gamma|
#
# 2 p.pdd is the centripetal part of 2 pdd, which cancels in gamma.
#
# A row that depends on others wherever these hold is satisfied by them. If it depends on them at some configurations
# only, or nearly, the motion violates it, however well the other rows hold.


@kernel
def has_redundant_rows(f):
    """Return True if rows are dropped."""
    return f.dropped[0] > 0


@kernel
def redundant_rows_hold(graph, f, floor):
    """Return True if the redundant rows hold on the manifold, by the residuals of the last evaluation."""
    return f.dropped[0] == 0 or f.selection.excess <= floor + limits.HELD * limits.LEAST_SHARE * _extent(graph, f)


@kernel
def rates_hold(graph, f, q, qd, size):
    """Return True if they hold for velocities, by H and Phi_t of the last evaluation; size that of the scene, m."""
    if f.dropped[0] == 0 or f.redundant.H.size == 0:
        return True
    # Velocities of a scene at rest are compared with those of a fall through its extent
    speed, spin = _largest(graph, qd)
    far = _reach(graph, f, size)
    speed = max(speed, limits.RESTING * math.sqrt(f.selection.push * far) + limits.NO_RATE * far)
    return _hold(graph, f, f.redundant.drift, q, qd, speed + far * spin, spin + speed / far)


@kernel
def accelerations_hold(graph, f, q, qd, qdd, size):
    """Return True if they hold for accelerations, as `rates_hold`, by gamma of the last evaluation.

    Near a singular configuration accelerations have too few digits to judge the redundant rows.
    """
    if f.dropped[0] == 0 or f.redundant.H.size == 0 or is_near_singular(f, f.indicator.start):
        return True
    # Terms: accelerations of bodies, of free fall, and centripetal ones
    push, twist = _largest(graph, qdd)
    speed, spin = _largest(graph, qd)
    far = _reach(graph, f, size)
    push = max(push, f.selection.push) + spin * (speed + far * spin) + limits.NO_RATE * far
    twist = max(twist, f.selection.twist) + spin * spin
    return _hold(graph, f, f.redundant.gamma, q, qdd, push + far * twist, twist + push / far)


@kernel
def note_loads(f):
    """Record the largest |W F| of a body, in Z; only redundant rows are judged by it."""
    if f.dropped[0] == 0:
        return
    push = twist = 0.0  # squares
    for i in range(0, f.Z.size, 8):
        push, twist = max(push, square(f.Z, i)), max(twist, square(f.Z, i + 4))
    f.selection.push, f.selection.twist = math.sqrt(most(push)), math.sqrt(most(twist))


@kernel
def _extent(graph, f):
    """The largest distance of a body from the first one, m."""
    most = 0.0
    for b in range(1, graph.bodies.shape[0]):
        at, distance = b * POSE + R, 0.0
        for c in range(3):
            distance += (f.poses[at + c] - f.poses[R + c]) ** 2
        most = max(most, distance)
    return math.sqrt(most)


@kernel
def _reach(graph, f, size):
    """The same, or else the size of the numbers in the constraints, or one: what rates are made comparable by."""
    far = _extent(graph, f)
    if far > 0.0:
        return far
    return size if size > 0.0 else 1.0


@kernel
def _largest(graph, rates):
    """The largest |rd| and |omega'| of a body, or |rdd| and 2 |pdd|."""
    speed = spin = 0.0  # squares
    for b in range(graph.bodies.shape[0]):
        i = graph.bodies[b, 0]
        speed = max(speed, square(rates, i))
        if graph.bodies[b, 1] == 7:
            spin = max(spin, rates[i + 3] ** 2 + square(rates, i + 4))
    return math.sqrt(speed), 2.0 * math.sqrt(spin)


@kernel
def _terms(H, at, x, y, z):
    """Sum of the absolute terms of a row of H times a vector."""
    return abs(H[at] * x) + abs(H[at + 1] * y) + abs(H[at + 2] * z)


@kernel
def _hold(graph, f, known, q, rates, most, fastest):
    """Return True if H (rd, omega') + known of all redundant rows is small; `rates` are qd, or qdd.

    A body whose rates are below FAINT of the largest, `most` and `fastest`, counts as one with these.
    """
    for i in range(f.dropped[0]):
        # |H (rd, omega') + known| against the sum of its absolute terms
        row, residual, terms = f.dropped[1 + i], known[i], abs(known[i])
        more, size = _pair_terms(graph, f, row, i, q, rates, most, fastest)
        residual, terms = residual + more, terms + size
        for j in range(graph.tails.shape[0]):
            if graph.tails[j] == row:
                e = graph.row.shape[0] + j
                more, size = _pair_terms(graph, f, e, e, q, rates, most, fastest)
                residual, terms = residual + more, terms + size
        if not abs(residual) <= limits.HELD * terms:
            return False
    return True


@kernel
def _pair_terms(graph, f, e, place, q, rates, most, fastest):
    """H (rd, omega') of a pair of sides, kept in a place of RedundantRows.H, and the sum of its absolute terms."""
    H, residual, terms = f.redundant.H, 0.0, 0.0
    for side in range(2):
        b, at = graph.sides[e, side], 16 * place + 8 * side
        if b == graph.bodies.shape[0]:
            continue
        # H_r rd
        k = graph.bodies[b, 0]
        residual += H[at] * rates[k] + H[at + 1] * rates[k + 1] + H[at + 2] * rates[k + 2]
        terms += _terms(H, at, rates[k], rates[k + 1], rates[k + 2]) + limits.LEAST_SHARE * most * length(H, at)
        if graph.bodies[b, 1] == 7:
            # H_pi' omega'
            e0, e1, e2, e3 = q[k + 3], q[k + 4], q[k + 5], q[k + 6]
            d0, d1, d2, d3 = rates[k + 3], rates[k + 4], rates[k + 5], rates[k + 6]
            x = -e1 * d0 + e0 * d1 + e3 * d2 - e2 * d3  # 2 (x, y, z) = omega'
            y = -e2 * d0 - e3 * d1 + e0 * d2 + e1 * d3
            z = -e3 * d0 + e2 * d1 - e1 * d2 + e0 * d3
            residual += 2.0 * (H[at + 4] * x + H[at + 5] * y + H[at + 6] * z)
            spin = 2.0 * math.sqrt(d0 * d0 + square(rates, k + 4))
            terms += length(H, at + 4) * (spin + limits.LEAST_SHARE * fastest)
    return residual, terms


# Selection of redundant rows during a run: renewed where the kept rows come close to dependence.


class Choice(NamedTuple):
    """What `reselect_rows` gets by one address."""

    graph: ConstraintGraph
    tangent: TangentWorkspace


def with_reselection(graph, tangent):
    """The `TangentWorkspace` of a graph with which kernels can reselect rows."""
    if DEBUG:
        tangent.reselection[0] = 1
        return tangent
    words = len(image_of(Choice(graph, tangent)))
    whole = np.zeros(words + 2, np.int64)  # kept alive by its view `reselection`
    tangent = tangent._replace(reselection=whole[words:])
    whole[:words] = image_of(Choice(graph, tangent))
    tangent.reselection[0], tangent.reselection[1] = reselect_rows.address, whole.ctypes.data
    return tangent


load_choice = loader(Choice(no_graph(), no_tangent_workspace()))
CHOOSE = "ppdpppi"
call_choose = caller(CHOOSE)


@kernel
def _choose_again(graph, reals, f, rows, t, metric):
    """Renew the selection of rows; f.b, H, Y and the factors of S follow it. True if S is nonsingular."""
    # Every row, the dropped ones included, competes
    evaluate_all(graph, reals, f, rows, t)
    found = select(graph, f, rows, f.dropped[0], PIVOT_ROUNDING)
    leave_redundant_rows(graph, f, f.b, rows.H)
    regular = factorise_selected_rows(graph, f, rows, metric) < 0
    # The new pivots are what later ones are measured by
    if found and regular:
        for e in range(f.best.size):
            f.best[e] = _share(graph, rows.S, e)
    return regular


@callback(CHOOSE)
def reselect_rows(choice, reals, t, H, Y, S, metric):
    """Call `_choose` by address, 1 or 0: few scenes need it, and its code is as long as all other row code."""
    c = load_choice(choice)
    graph, f = c.graph, c.tangent
    pairs, size = 16 * graph.sides.shape[0], graph.pattern.shape[2]
    rows = Rows(vector(H, pairs), vector(Y, pairs), vector(S, size), f.rows.h)
    return 1 if _choose_again(graph, vector(reals, ANY), f, rows, t, metric) else 0


if DEBUG:
    _reselect_by_address = _choose_again
else:

    @kernel
    def _reselect_by_address(graph, reals, f, rows, t, metric):
        return call_choose(f.reselection[0], f.reselection[1], reals, t, rows.H, rows.Y, rows.S, metric) != 0


@kernel
def doubt_selection(f):
    """Request a new selection of rows at the next chart."""
    f.best[:] = math.inf


@kernel
def selection_serves(graph, f, rows):
    """Return True if the selected rows are nearly as independent as at their best, judged by the factors of S.

    The smallest share of all isn't enough: another row may fall by orders of magnitude before it is the smallest.
    """
    if f.dropped[0] == 0:
        return True
    serves = True
    for e in range(f.best.size):
        # A pivot may grow: its largest value is the measure
        share = _share(graph, rows.S, e)
        f.best[e] = max(f.best[e], share)  # a selection next to a singular configuration is no measure
        serves = serves and share >= limits.ONE_DIGIT * f.best[e]
    return serves


@kernel
def _share(graph, values, e):
    """The pivot of row e over its diagonal entry; values are factors of S, with reciprocals of pivots."""
    return 1.0 / abs(values[graph.diagonal[e]] * values[graph.pattern.shape[1] + e])


@long_kernel
def factorise_rows(graph, system, f, rows, t, metric):
    """Y = W H^T and the factors of S = H W H^T, after `evaluate_rows`; return True if S is nonsingular.

    metric is DYNAMICS or METRIC. Where the kept rows come close to dependence, the selection of redundant rows is
    renewed, and f.b and H are those of the new one.
    """
    regular = factorise_selected_rows(graph, f, rows, metric) < 0
    if f.dropped[0] == 0 or f.reselection[0] == 0 or (regular and selection_serves(graph, f, rows)):
        return regular  # rows may be left out for a moment of a scene that has no redundant ones
    return _reselect_by_address(graph, system.reals, f, rows, t, metric)


@kernel
def select_rows(graph, system, f, t, least):
    """Select redundant rows at the poses: those whose pivots of S, as a share of the diagonal, are below `least`.

    Returns their number, or -1 if no independent selection was found. H is without them.
    """
    evaluate_every_row(graph, system, f, f.rows, t)
    keep_every_row(f)
    found = select(graph, f, f.rows, -1, least)
    leave_redundant_rows(graph, f, f.b, f.rows.H)
    return f.dropped[0] if found else -1


# Self-stresses: multipliers z with H^T z = 0, one for each redundant row.
#
# z = 1 for the redundant row h, and -(H W H^T)^-1 H W h^T for the kept rows H.


@kernel
def count_self_stresses(f):
    """Return the number of self-stresses."""
    return f.dropped[0]


@kernel
def _weigh_tails(graph, H, row, Z):
    """Z += W h^T of the later terms of a row."""
    w = stack(8)
    for j in range(graph.tails.shape[0]):
        for side in range(2 if graph.tails[j] == row else 0):
            e = graph.row.shape[0] + j
            body = graph.sides[e, side]
            if body < graph.bodies.shape[0]:
                weigh(graph.inverse, body, H, 16 * e + 8 * side, w, 0)
                for c in range(8):
                    Z[8 * body + c] += w[c]


@kernel
def self_stress(graph, f, H, i):
    """b = z of redundant row i, H being of every row; return the largest |z|. f.rows are factorised."""
    row = f.dropped[1 + i]
    for c in range(f.Z.size):
        f.Z[c] = 0.0
    # W h^T of the dropped row h
    for side in range(2):
        body = graph.sides[row, side]
        if body < graph.bodies.shape[0]:
            weigh(graph.inverse, body, H, 16 * row + 8 * side, f.Z, 8 * body)
    if graph.tails.shape[0] > 0:
        _weigh_tails(graph, H, row, f.Z)
    # z = -S^-1 H W h^T for the kept rows
    multiply_rows(graph, f.rows, f.Z, f.b)
    solve_rows(graph, f.rows, f.b)
    largest = 1.0
    for e in range(f.b.size):
        f.b[e] = -f.b[e]
        largest = max(largest, abs(f.b[e]))
    f.b[row] = 1.0
    return largest
