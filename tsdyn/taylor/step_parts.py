"""The parts of a Taylor step as callbacks, each compiled once and loaded only if a run needs it."""

import math

from ..elements.loops.constraint_rows import largest_coordinate, write_accelerations, write_positions, write_velocities
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..elements.loops.law_check import ATOL, LENGTH, LIMITS, MOST, RTOL, TAU, TIME, call_check, call_margin
from ..elements.tolerances import OFF, OFF_SELDOM
from ..errors import Status
from ..formulations.accelerations import accelerate_bodies
from ..formulations.chart_validity import ROUNDING
from ..formulations.projection import find_drift, land
from ..jit.kernels import callback, caller, kernel, stack
from ..jit.simd import fma, four, put, splat, times
from ..maths.dense_linalg import copy, is_finite
from ..model.equations import is_rheonomic, set_time
from ..motions.program import call_smooth
from ..rows.interface import (
    accelerations_hold,
    evaluate_bias,
    has_redundant_rows,
    is_near_singular,
    rates_hold,
    refinements,
    return_to_selection,
    save_selection,
    select_rows,
    singularity_indicator,
)
from ..rows.tolerances import UNEQUAL_MASSES
from .coefficients import begin, expand
from .layout import load_series
from .step_end import keep_start, project_rates, sum_series, tops_of
from .tolerances import GONE, ILL_ORDERS, NEXT_TO_SINGULAR, PLACES, STIFF_RATES, STILL

# Taylor series of prescribed motions and of loads, for Taylor runs of driven scenes.


@kernel
def _expand_motion(system, x, rows, values):
    """The series of some motions, onto values."""
    for i in range(rows.shape[0]):
        row = rows[i]
        call_smooth(row.run, system.reals[row.program :], x.order.time, x.order.room, values[row.values :])


@kernel
def expand_motions(system, x):
    """The series of all motions and loads about the time of the expansion."""
    _expand_motion(system, x, x.motions, x.constraints)
    _expand_motion(system, x, x.drives, x.loads)


# The parts of a Taylor step as callbacks, each compiled once and loaded only if a run needs it.
#
# Their argument is the address of a `SeriesContext`.

NOT_FINITE, SINGULAR, UNHELD = int(Status.NOT_FINITE), int(Status.SINGULAR), int(Status.UNHELD)
LAWS = "pdddd"
call_expand, call_reach, call_laws = caller("pii"), caller("pdd"), caller(LAWS)


@callback("pii")
def expand_series(context, start, end):
    """Orders from start to end - 1 of everything; order zero begins the series at the poses, and gives qdd."""
    return _expand(context, start, end, False)


@callback("pii")
def expand_far_series(context, start, end):
    """The same for series that are too long for the caches near by."""
    return _expand(context, start, end, True)


@kernel
def _expand(context, start, end, ahead):
    c = load_series(context)
    x, refine = c.expansion, begin_orders(c, start)
    for k in range(start, end):
        expand(c.graph, c.system, k, k > 0 and k + 1 == x.order.top, ahead, refine, x, c.tangent)
    if start == 0:
        write_qdd(c)
    return 0


@kernel
def begin_orders(c, start):
    """Begin the series where `start` is zero; how many orders of lam are refined."""
    x, f = c.expansion, c.tangent
    orders = x.order.room
    # Series of functions of time are complete before the first order
    if start == 0:
        expand_motions(c.system, x)
        keep_start(c.graph, f.poses, x.start)
        begin(c.graph, c.system, f.poses, orders, x.bodies, f.Z)
    near = is_near_singular(f, f.indicator.start)  # there rounding of lam grows from order to order
    # An ill-conditioned S: the first orders, refined more than once
    sweeps = refinements(f.indicator.start)
    refine, x.order.sweeps = orders if near or sweeps > 1 else x.order.refined, 1
    if sweeps > 0 and not near:
        refine, x.order.sweeps = max(refine, ILL_ORDERS), sweeps
    return refine


@kernel
def write_qdd(c):
    """Qdd of the series at order zero."""
    x, f, orders = c.expansion, c.tangent, c.expansion.order.room
    for b in range(c.graph.bodies.shape[0]):
        # (rdd, omega'd) = (2 r_2, omega'_1)
        at = b * orders * BODY_ROW
        put(f.a, 8 * b, times(four(x.bodies, at + S_R * orders + 8), splat(2.0)))
        put(f.a, 8 * b + 4, four(x.bodies, at + S_OMEGA * orders + 4))
    write_accelerations(c.graph.bodies, f.poses, f.a, c.work.qdd)


@kernel
def _land_rates(c, t):
    drifting = is_rheonomic(c.system)
    if drifting:
        find_drift(c.graph, c.system, c.tangent, t)
    project_rates(c.graph, c.tangent, c.expansion.low_end, drifting)


@callback("pdd")
def reach(context, t, h):
    """The state at t, h after the series' origin, on the manifold, but for qdd; h < 0 takes the poses. Status."""
    c = load_series(context)
    w, x, f = c.work, c.expansion, c.tangent
    x.order.time = t
    if not set_time(c.system, t):
        return NOT_FINITE
    # Sums of the series at h, or the poses as they are
    if h >= 0.0:
        sum_series(c.graph, x, h, tops_of(x), f.poses, f.p)
    else:
        copy(x.low, x.low_end)
    # Positions, then velocities, onto the manifold
    status = land(c.graph, c.system, w, f, t)
    if status == 0:
        _land_rates(c, t)
        write_positions(c.graph.bodies, f.poses, w.q)
        write_velocities(c.graph.bodies, f.poses, w.qd)
        if not (is_finite(w.q) and is_finite(w.qd)):
            return NOT_FINITE
        if not rates_hold(c.graph, f, w.q, w.qd, w.control.size):
            return UNHELD
    return status


@callback(LAWS)
def check_laws(context, t, h, atol, rtol):
    """Compare the series of forces with their laws at times from t to t + h; sets `Trial.good`."""
    c = load_series(context)
    limits = stack(LIMITS)
    limits[LENGTH], limits[ATOL], limits[RTOL] = h, atol, rtol
    c.trial.good = 1.0
    if not _may_differ(c, t, limits):
        return 0
    every = _places_of_users(c, h)
    places = every * PLACES
    for j in range(places):
        _set_place(c, t, h * (j + 1) / places, limits)
        for i in range(c.expansion.forces.shape[0]):
            kind = c.expansion.forces[i]
            if kind.near != 0 and (kind.users == 1 or (j + 1) % every == 0) and _is_off(c, i, limits):
                c.trial.good = j / places
                return 1
    return 0


@kernel
def _places_of_users(c, h):
    """Places of laws of users in a step of h, over PLACES: no further apart than `spacing`."""
    for i in range(c.expansion.forces.shape[0]):
        if c.expansion.forces[i].users == 1:
            return max(1, math.ceil(h / (PLACES * c.trial.spacing)))
    return 1


@kernel
def _set_place(c, t, tau, limits):
    """Set time and limits for a comparison with laws at t + tau."""
    limits[TAU], limits[TIME] = tau, t + tau
    set_time(c.system, limits[TIME])


@kernel
def _is_off(c, i, limits):
    """Whether the series of a kind of force are not its laws at a place of the step."""
    x, kind = c.expansion, c.expansion.forces[i]
    limits[MOST] = OFF if kind.sharp == 1 else OFF_SELDOM
    off = call_check(
        kind.check, kind.run, x.order.top, kind, limits, x.table[kind.table :], c.system.reals[kind.reals :],
        x.bodies, x.loads[kind.values :], c.graph.inverse,
    )  # fmt: skip
    return off != 0


@kernel
def _may_differ(c, t, limits):
    """Set which kinds of forces are to be compared with their laws within the step; whether there are any.

    Sharp ones always; those with a margin of analyticity where it is used up; others if they differ at the step's end.
    """
    x, left, found = c.expansion, stack(1), False
    c.trial.left = 1.0
    # a step this short is limited by velocities of fast modes, which position coefficients don't show: STILL is
    # required
    is_short = STIFF_RATES * c.trial.rate * limits[LENGTH] < x.order.top + 2
    for i in range(x.forces.shape[0]):
        kind = x.forces[i]
        kind.near = kind.sharp
        # sum_{k>0} |a_k| h^k < a_0 leaves a share of a_0: none of what the law divides by vanishes
        if kind.margin != 0:
            left[0] = 1.0
            call_margin(kind.margin, x.order.top, kind, limits[LENGTH:], x.loads[kind.values :], left)
            kind.near = 0 if left[0] > (STILL if is_short else 0.0) else 1
            if not left[0] >= c.trial.left:
                c.trial.left = left[0]
        # No such bound: compare at the end of the step
        elif kind.check != 0 and kind.sharp == 0:
            _set_place(c, t, limits[LENGTH], limits)
            kind.near = 1 if _is_off(c, i, limits) else 0
        found = found or kind.near != 0
    return found


@callback("pdd")
def accelerate_here(context, t, h):
    """Qdd at the state of `reach`, between the steps; nothing of it is kept for the next step."""
    c = load_series(context)
    accelerate_bodies(c.graph, c.system, c.work, c.tangent, t)
    return 0


@kernel
def hold_accelerations(c, t):
    """Whether the redundant rows hold for qdd of the series. Status."""
    w, f = c.work, c.tangent
    if not has_redundant_rows(f):
        return 0
    evaluate_bias(c.graph, c.system, f, t)
    return 0 if accelerations_hold(c.graph, f, w.q, w.qd, w.qdd, w.control.size) else UNHELD


@callback("pdd")
def pass_singular(context, t, h):
    """The state at t next to a singular configuration, between the steps: qdd is that of the series. Status.

    Nearly dependent rows aren't projected: the series satisfies them to the tolerance.
    """
    c = load_series(context)
    w, x, f, graph = c.work, c.expansion, c.tangent, c.graph
    orders, top = x.order.room, x.order.top
    # A selection of rows for this configuration only
    save_selection(f)
    sum_series(graph, x, h, tops_of(x), f.poses, f.p)
    status = land(graph, c.system, w, f, t)
    # Rows whose pivots are lost are left out of the projection
    if status == SINGULAR or (status == 0 and singularity_indicator(graph, f.rows) < GONE):
        sum_series(graph, x, h, tops_of(x), f.poses, f.p)
        if select_rows(graph, c.system, f, t, GONE) >= 0:
            status = land(graph, c.system, w, f, t)
    if status == 0:
        _land_rates(c, t)
        for b in range(graph.bodies.shape[0]):
            # qdd = sum_k (k + 1) k r_{k+1} h^(k-1), and likewise omega'd
            at, r, omega = b * orders * BODY_ROW, splat(0.0), splat(0.0)
            for k in range(top, 0, -1):
                r = fma(r, splat(h), times(four(x.bodies, at + S_R * orders + 4 * (k + 1)), splat((k + 1.0) * k)))
                omega = fma(omega, splat(h), times(four(x.bodies, at + S_OMEGA * orders + 4 * k), splat(float(k))))
            put(f.Z, 8 * b, r)
            put(f.Z, 8 * b + 4, omega)
        write_positions(graph.bodies, f.poses, w.q)
        write_velocities(graph.bodies, f.poses, w.qd)
        write_accelerations(graph.bodies, f.poses, f.Z, w.qdd)
    return_to_selection(f)
    return status


@kernel
def is_singular(c, status):
    """Whether the state of `reach`, or the one that it failed to reach, is near a singular configuration."""
    limit = NEXT_TO_SINGULAR * min(1.0, c.tangent.indicator.largest * UNEQUAL_MASSES)
    return status == SINGULAR or (status == 0 and singularity_indicator(c.graph, c.tangent.rows) < limit)


@kernel
def state_within(context, c, kernels, t, h):
    """q, qd, qdd at t, h after the series' origin, which leaves the selection of rows as it is. Status."""
    f = c.tangent
    save_selection(f)
    # Next to a singular configuration accelerations are those of the series
    status = call_reach(kernels.reach, context, t, h)
    if is_singular(c, status):
        return_to_selection(f)
        status = call_reach(kernels.pass_singular, context, t, h)
    elif status == 0:
        status = call_reach(kernels.accelerate_here, context, t, h)
    return_to_selection(f)
    return status


@kernel
def set_floor(c, q):
    """The |Phi| that rounding of positions q leaves."""
    control = c.work.control
    control.floor = ROUNDING * (control.size + largest_coordinate(c.graph.bodies, q, control.size))
