"""Projection onto the constraint manifold: positions, then velocities (Eqs. 20, 23, 29).

Corrections lie in the normal space W H^T at the current configuration, so one factorisation of S = H W H^T serves
positions and velocities. It also serves the accelerations, unless positions have moved by more than rounding.
"""

import math

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, P, R, orient
from ..errors import Status
from ..jit.kernels import kernel, long_kernel
from ..jit.predicates import any_of, below, both, choose, either, opposite
from ..jit.simd import add, four, get, put
from ..maths.dense_linalg import largest, largest_of
from ..maths.tolerances import LAST_PLACE, ROUNDING, ROUNDING_AT_MOST
from ..rows.interface import (
    DYNAMICS,
    constrain,
    evaluate_drift,
    evaluate_residuals,
    evaluate_rows,
    factorise_rows,
    find_correction,
    is_near_singular,
    redundant_rows_hold,
    singularity_indicator,
)
from .charts import largest_rates
from .tolerances import LAND_SWEEPS, STALLED, WALK

OK, SINGULAR = int(Status.SUCCESS), int(Status.SINGULAR)
NOT_FINITE, NEWTON_FAILED = int(Status.NOT_FINITE), int(Status.NEWTON_FAILED)
UNHELD = int(Status.UNHELD)


@kernel
def lever(floor):
    """The arm of rotations in a small scene, m: the size of its numbers, which the floor of Phi is of."""
    return min(floor / ROUNDING, 1.0)


@kernel
def largest_residual(graph, f, floor):
    """The largest |f.b|, m; infinity if an entry is not finite. In small scenes pure numbers count times the lever."""
    return largest(f.b) if graph.turns.size == 0 else largest_of(f.b, graph.turns, lever(floor))


@kernel
def velocity_floor(graph, w, f):
    """|Phi_q qd + Phi_t| that rounding leaves at the velocities of the poses, m/s."""
    speed, spin = largest_rates(graph, f.poses)
    return LAST_PLACE * (speed + (w.control.size if graph.turns.size == 0 else lever(w.control.floor)) * spin)


@long_kernel
def factorise(graph, system, w, f, t):
    """b = Phi, and H, W H^T and the factors of S, at the present poses. Status."""
    evaluate_rows(graph, system, f, f.rows, t)
    w.counters.factorizations += 1
    return OK if factorise_rows(graph, system, f, f.rows, t, DYNAMICS) else SINGULAR


@long_kernel
def land(graph, system, w, f, t):
    """Project positions onto the manifold along W H^T; H, Y and the factors of S are those of the result. Status."""
    f.landing.residual = f.landing.moved = 0.0
    status = factorise(graph, system, w, f, t)
    if status == OK:
        status = _correct_positions(graph, system, w, f, t)
    # Bodies that have moved by more than rounding have another H
    if status == OK and f.landing.moved > ROUNDING * lever(w.control.floor):
        status = factorise(graph, system, w, f, t)
    elif status == OK and f.landing.moved == 0.0:
        w.counters.at_rounding += 1
    return _finish(graph, w, f) if status == OK else status


@kernel
def _correct_positions(graph, system, w, f, t):
    """Newton's method for Phi = 0 with H and S of the start, b being Phi on entry; b = Phi at the result. Status."""
    f.landing.residual, f.landing.moved, corrections, failed = correct_positions(graph, system, f, t, w.control.floor)
    w.counters.newton += corrections
    if failed:
        return NEWTON_FAILED if f.landing.residual < math.inf else NOT_FINITE
    return OK


@kernel
def correct_positions(graph, system, f, t, floor):
    """Newton's method for Phi = 0 with H and S of the start, of one case or of lanes; b is Phi on entry and exit.

    Returns the largest |Phi| met, the largest displacement, m, the number of corrections, and where it has failed. A
    lane that has landed is left as it is while others are still corrected, so none depends on its neighbours.
    """
    residual = moved = 0.0 * floor
    before, corrections = residual + math.inf, 0
    active, failed = below(residual, before), below(before, residual)
    for sweep in range(LAND_SWEEPS):
        if sweep > 0:
            evaluate_residuals(graph, system, f, t)
        worst = largest_residual(graph, f, floor)
        residual = choose(active, max(residual, worst), residual)
        # Rounding, or a residual that has stopped falling: rounding, too, if it is near its floor
        falls = both(below(worst, math.inf), opposite(below(STALLED * before, worst)))
        goes_on = both(active, both(below(floor, worst), falls))
        ends = both(active, opposite(goes_on))
        failed = either(failed, both(ends, below(ROUNDING_AT_MOST * floor, worst)))
        active = goes_on
        if not any_of(active):
            break
        # (r, pi') <- (r, pi') - Y^T S^-1 Phi
        before, corrections = worst, corrections + 1
        moved = choose(active, max(moved, displace(graph, f, active)), moved)
    return residual, moved, corrections, either(failed, active)


@long_kernel
def _finish(graph, w, f):
    """Finish the projection, b being Phi. Status.

    If |Phi| is close to its rounding floor, or the configuration is nearly singular, where an error in Phi moves bodies
    by Phi over the distance, apply one last correction.
    """
    floor = w.control.floor
    if not redundant_rows_hold(graph, f, floor):
        return UNHELD
    if largest_residual(graph, f, floor) > WALK * floor or is_near_singular(f, singularity_indicator(graph, f.rows)):
        displace(graph, f, True)
    return OK


@kernel
def displace(graph, f, mask):
    """Displace the bodies by the smallest correction of the residuals b; return the largest displacement."""
    find_correction(graph, f.rows, f.b, f.Z)
    move_by(graph, f, mask)
    return largest(f.Z)


@kernel
def move_by(graph, f, mask):
    """Displace the bodies by Z, to first order, in the lanes of the mask; of one case it is True."""
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        r = four(f.poses, at + R)
        put(f.poses, at + R, choose(mask, add(r, four(f.Z, o)), r))
        if graph.bodies[b, 1] == 7:
            x, y, z = 0.5 * get(f.Z, o + 4), 0.5 * get(f.Z, o + 5), 0.5 * get(f.Z, o + 6)
            e0, e1 = get(f.poses, at + P), get(f.poses, at + P + 1)
            e2, e3 = get(f.poses, at + P + 2), get(f.poses, at + P + 3)
            # p <- p o (1, dpi' / 2), of unit length
            p0 = e0 - e1 * x - e2 * y - e3 * z
            p1 = e1 + e0 * x - e3 * y + e2 * z
            p2 = e2 + e3 * x + e0 * y - e1 * z
            p3 = e3 - e2 * x + e1 * y + e0 * z
            scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
            e0, e1 = choose(mask, p0 * scale, e0), choose(mask, p1 * scale, e1)
            e2, e3 = choose(mask, p2 * scale, e2), choose(mask, p3 * scale, e3)
            orient(f.poses, at, e0, e1, e2, e3)


@kernel
def gather_speeds(graph, f):
    """Z = rd and omega' of the poses."""
    for b in range(graph.bodies.shape[0]):
        put(f.Z, 8 * b, four(f.poses, b * POSE + RD))
        put(f.Z, 8 * b + 4, four(f.poses, b * POSE + OMEGA))


@kernel
def find_drift(graph, system, f, t):
    """gamma = Phi_t, time being set."""
    evaluate_drift(graph, system, f, t, f.gamma)


@kernel
def land_velocities(graph, f):
    """Project the velocities of the poses onto the tangent space, twice: the second projection removes rounding.

    H, Y and S are those of the poses, gamma is Phi_t.
    """
    gather_speeds(graph, f)
    for _ in range(2):
        constrain(graph, f.rows, f.gamma, f.Z, f.b)
    for b in range(graph.bodies.shape[0]):
        put(f.poses, b * POSE + RD, four(f.Z, 8 * b))
        put(f.poses, b * POSE + OMEGA, four(f.Z, 8 * b + 4))
