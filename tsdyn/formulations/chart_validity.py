"""Chart validity in the tangent form, by the two criteria that every form uses.

A chart is abandoned at the end of a step when one of two dimensionless criteria is met. In the mass metric they depend
neither on units nor on the scaling of constraint rows or lever arms:

    contraction    max |1 - n / s|, with n and s the pivots of N = H C Y0 and of S0 = H0 W0 H0^T: the relative loss of a
                   pivot since q0; 1 where a normal direction of q0 is tangent to the manifold
    turn           |d|, the sine of half the angle by which a body has rotated since q0
"""

import math

from ..elements.loops.constraint_rows import POSE, P, R, place_bodies
from ..jit.kernels import kernel
from ..maths.dense_linalg import copy
from ..maths.tolerances import ROUNDING, TINY
from ..rows.interface import (
    METRIC,
    accelerations_hold,
    evaluate_rows,
    factorise_rows,
    has_redundant_rows,
    is_raised,
    pivot_loss,
    rates_hold,
    redundant_rows_hold,
    selection_serves,
)
from .chart_coordinates import factorise_normal, turned_most
from .tolerances import CONTRACTION_LIMIT, NO_SIZE, SAME, TURN_SHARE

# reasons to leave a chart, as stored; REASONS names them
STAY, BY_CONTRACTION, BY_TURN, BY_INTERVAL, BY_FAILURE, AT_START, BY_SERIES = range(7)
REASONS = (
    "",
    "contraction",
    "turn of a body",
    "chart_interval",
    "failed step",
    "start",
    "step of a series",
)


@kernel
def extent(w):
    """How large the scene is, m."""
    return max(w.control.floor / ROUNDING, NO_SIZE if w.control.size == 0.0 else 0.0)


@kernel
def set_base_point(graph, system, w, f, l, t, largest):
    """Make the chart at w.q: base, H0, Y0, factors of S0. True if the rows of H0 are independent.

    largest is the largest coordinate that enters Phi, m, as the form has it.
    """
    regular = True
    # H, Y and S of the last position solve serve, unless S is of another metric
    same = l.state.placement > 0 and l.state.placement == w.counters.placements
    if same and not is_raised(graph) and selection_serves(graph, f, f.rows):
        copy(f.rows.H, l.rows0.H)
        copy(f.rows.Y, l.rows0.Y)
        copy(f.rows.S, l.rows0.S)
        w.counters.kept += 1 if f.b.size > 0 else 0
    else:
        # H0, Y0 = W0 H0^T and S0 = H0 W0 H0^T
        place_bodies(graph.bodies, w.q, f.poses)
        evaluate_rows(graph, system, f, l.rows0, t)
        if f.b.size > 0:
            w.counters.factorizations += 1
            regular = factorise_rows(graph, system, f, l.rows0, t, METRIC)
    # Base point (r0, p0), where d = 0
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        for c in range(3):
            l.base[o + c] = f.poses[at + R + c]
            l.d[4 * b + c] = 0.0
        for c in range(4):
            l.base[o + 4 + c] = f.poses[at + P + c]
        l.d[4 * b + 3] = 0.0
    w.counters.charts += 1
    w.control.floor = ROUNDING * (w.control.size + largest)
    w.control.contraction, w.control.condition = 0.0, 1.0
    l.state.time, l.state.factored, l.state.placement, l.state.made = t, 0, 0, 0
    return regular


@kernel
def measure_turns(graph, l, q):
    """l.d of positions q; (d0, d) = p0* o p."""
    for b in range(graph.bodies.shape[0]):
        # d0 - 1, not d0, is kept: it is small
        if graph.bodies[b, 1] == 7:
            i, o = graph.bodies[b, 0] + 3, 8 * b + 4
            e0, e1, e2, e3 = l.base[o], l.base[o + 1], l.base[o + 2], l.base[o + 3]
            p0, p1, p2, p3 = q[i], q[i + 1], q[i + 2], q[i + 3]
            l.d[4 * b] = -e1 * p0 + e0 * p1 + e3 * p2 - e2 * p3
            l.d[4 * b + 1] = -e2 * p0 - e3 * p1 + e0 * p2 + e1 * p3
            l.d[4 * b + 2] = -e3 * p0 + e2 * p1 - e1 * p2 + e0 * p3
            l.d[4 * b + 3] = e0 * p0 + e1 * p1 + e2 * p2 + e3 * p3 - 1.0


@kernel
def reason_to_leave(graph, w, f, l):
    """Return the reason to abandon the chart at l.d and f.rows, or STAY; records contraction and condition."""
    turn, contraction = turned_most(l), 0.0
    # max |1 - n / s|, by the factors of the last position solve if they are those of the present H
    if f.b.size > 0:
        known = l.state.factored == 1 and l.state.off < SAME
        w.counters.kept += 1 if known else 0
        contraction = pivot_loss(graph, l) if known or factorise_normal(graph, w, f, l) else math.inf
    l.state.factored = 0  # dense output may change the factors before the next step
    w.control.contraction = max(contraction, TURN_SHARE * turn)
    w.control.condition = (1.0 + w.control.contraction) / max(1.0 - w.control.contraction, TINY)
    if not contraction < CONTRACTION_LIMIT:
        return BY_CONTRACTION
    return STAY if turn < l.state.turn_limit else BY_TURN


@kernel
def every_level_holds(c):
    """Return True if the redundant rows hold at q, qd and qdd, where all rows have been evaluated."""
    w, f, graph = c.work, c.tangent, c.graph
    if not has_redundant_rows(f):
        return True
    # Phi, Phi_q qd + Phi_t and Phi_q qdd + gamma of the dropped rows, against the sizes of their terms
    size = w.control.size
    held = redundant_rows_hold(graph, f, w.control.floor) and rates_hold(graph, f, w.q, w.qd, size)
    return held and accelerations_hold(graph, f, w.q, w.qd, w.qdd, size)
