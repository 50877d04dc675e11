"""The parts of a Taylor step as callbacks, each compiled once and loaded only if a run needs it."""

import math
from typing import NamedTuple

from ..elements.loops.constraint_rows import (
    OMEGA,
    POSE,
    RD,
    P,
    R,
    largest_coordinate,
    orient,
    write_accelerations,
    write_positions,
    write_velocities,
)
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..elements.loops.law_check import ATOL, EXCESS, LENGTH, LIMITS, MOST, RTOL, TAU, TIME, call_check, call_margin
from ..elements.tolerances import OFF, OFF_SELDOM
from ..errors import Status
from ..formulations.accelerations import accelerate_bodies
from ..formulations.charts import ROUNDING
from ..formulations.projection import find_drift, land
from ..jit.kernels import callback, caller, kernel, long_kernel, stack
from ..jit.predicates import any_of, below, both, choose, every, floor, within
from ..jit.simd import add, fma, four, get, let, put, splat, sub, times, total
from ..maths.dense_linalg import copy, is_finite
from ..model.equations import is_rheonomic, set_time
from ..motions.program import call_smooth
from ..rows.interface import (
    accelerations_hold,
    evaluate_bias,
    find_correction,
    has_redundant_rows,
    is_near_singular,
    multiply_rates,
    rates_hold,
    refinements,
    return_to_selection,
    save_selection,
    select_rows,
    singularity_indicator,
)
from ..rows.tolerances import UNEQUAL_MASSES
from .coefficients import begin, expand, put_sum
from .layout import L_OMEGA, L_P, L_R, L_RD, LOW, load_series
from .tolerances import GONE, ILL_ORDERS, MOST_PARTS, NEXT_TO_SINGULAR, PLACES, STIFF_RATES, STILL, WIDE, WITHIN

# State at the end of a Taylor step: sums of the series, projected velocities, both with compensated summation.
#
# A step changes r, rd, omega' and p by increments that are smaller than the state. What the additions lose to rounding
# is kept from step to step in `Expansion.low`, a row a body: the state is (r, rd, omega', p) + low. The series of the
# next step begin at the rounded state. Increments of p follow from the rotation since the start of the step,
#
#     A_0^T A(h) = I + A_0^T sum_{k>0} A_k h^k,
#
# whose rounding errors are in proportion to its angle; after more than about a radian p is read off A(h).


@kernel
def keep_start(graph, poses, start):
    """Keep p of the poses, those at the start of a step."""
    for b in range(graph.bodies.shape[0]):
        put(start, 4 * b, four(poses, b * POSE + P))


class Tops(NamedTuple):
    """Highest orders of omega' in a step; those of r and A are one more."""

    least: int  # of all lanes
    most: int
    own: int  # of each lane; of one case all three are the same


@kernel
def tops_of(x):
    """Those of one case."""
    return Tops(x.order.top, x.order.top, x.order.top)


@kernel
def _coefficient(array, i, k, tops):
    """Coefficient k of r or A, at array[i]: zero in lanes of a lower order."""
    f = four(array, i)
    return f if k <= tops.least + 1 else choose(within(k - 1, tops.own), f, splat(0.0))


@kernel
def sum_series(graph, x, h, tops, poses, p):
    """The poses at h: A and r from coefficients up to top + 1, omega' up to top. A is made orthogonal by way of p.

    What the sums lose to rounding is x.low_end. x is an `Expansion`; h and tops are of one case or of lanes.
    """
    s, bodies, low, orders, most = splat(h), x.bodies, x.low, x.order.room, tops.most
    for b in range(graph.bodies.shape[0]):
        # Horner's scheme for r and rd together
        first, at, l = b * orders * BODY_ROW, b * POSE, LOW * b
        o = first + S_R * orders
        v, f, fd = four(bodies, o + 4), _coefficient(bodies, o + 4 * (most + 1), most + 1, tops), splat(0.0)
        for k in range(most, 1, -1):  # r = r_0 + h (v + h f),  rd = v + h (2 f + h fd)
            fd = fma(fd, s, f)
            f = fma(f, s, _coefficient(bodies, o + 4 * k, k, tops))
        # What the state lacks to rounding moves with it
        rest = fma(four(x.low_r2, 4 * b), s, four(low, l + L_RD))
        change = times(add(v, fma(f, s, rest)), s)
        put_sum(poses, at + R, four(bodies, o), add(change, four(low, l + L_R)), x.low_end, l + L_R)
        change = times(fma(fd, s, add(f, f)), s)
        put_sum(poses, at + RD, v, add(change, fma(four(x.low_r2, 4 * b), s, rest)), x.low_end, l + L_RD)
        if graph.bodies[b, 1] == 7:
            # omega'
            w, o = splat(0.0), first + S_OMEGA * orders
            for k in range(most, 0, -1):
                w = fma(w, s, _coefficient(bodies, o + 4 * k, k + 1, tops))
            change = fma(w, s, four(low, l + L_OMEGA))
            put_sum(poses, at + OMEGA, four(bodies, o), change, x.low_end, l + L_OMEGA)
            # Angle of the step, rad; in parts of one radian p can't change its sign unnoticed
            fast = 0.0
            for i in range(3):
                fast = max(fast, max(abs(get(bodies, o + i)), abs(get(poses, at + OMEGA + i))))
            _turn(x, b, h, floor(min(fast * abs(h), MOST_PARTS)) + 1.0, tops, poses, p)


@kernel
def _turn(x, b, h, parts, tops, poses, p):
    """A and p of body b at h: from the rotation of the step where it is narrow, else from A(h)."""
    at, l = b * POSE, LOW * b + L_P
    narrow = below(parts, 1.5)
    if any_of(narrow):
        # A_0^T A(h) = I + h A_0^T sum_{k>0} A_k h^(k-1)
        first = b * x.order.room * BODY_ROW
        u, v, w = _sum_columns(x, b, 1, h, tops)
        i, j, k = four(x.bodies, first), four(x.bodies, first + 4), four(x.bodies, first + 8)
        square = 1.0 + 0.25 * h * total(fma(i, u, fma(j, v, times(k, w))))  # d0^2
        narrow = both(narrow, below(WIDE, square))
        if any_of(narrow):
            # d0^2 from the trace, d from the skew part
            d0 = math.sqrt(max(square, WIDE))
            f = 0.25 * h / d0
            d1, d2 = f * total(sub(times(k, v), times(j, w))), f * total(sub(times(i, w), times(k, u)))
            d3 = f * total(sub(times(j, u), times(i, v)))
            d0 = -(d1 * d1 + d2 * d2 + d3 * d3) / (1.0 + d0)  # d0 - 1
            _compose(x, b, d0, d1, d2, d3, poses, p)
    # Wide rotations: p from A at the end of each part, on the side of the one before; p and -p are the same A
    if not every(narrow):
        e0, e1, e2, e3 = _follow(x, b, h, parts, tops, p)
        let(poses, at + P, choose(narrow, get(poses, at + P), e0))
        let(poses, at + P + 1, choose(narrow, get(poses, at + P + 1), e1))
        let(poses, at + P + 2, choose(narrow, get(poses, at + P + 2), e2))
        let(poses, at + P + 3, choose(narrow, get(poses, at + P + 3), e3))
        put(x.low_end, l, choose(narrow, four(x.low_end, l), splat(0.0)))
    orient(poses, at, get(poses, at + P), get(poses, at + P + 1), get(poses, at + P + 2), get(poses, at + P + 3))


@kernel
def project_rates(graph, f, low, drifting):
    """Project the velocities of the poses onto the tangent space, twice: the second projection removes rounding.

    H, Y and S are those of the poses; with `drifting`, gamma is Phi_t. low is what the velocities lack to rounding.
    """
    for _ in range(2):
        # y <- y - Y^T S^-1 (H y + Phi_t)
        multiply_rates(graph, f.rows, f.poses, f.b)
        if drifting:
            for e in range(f.b.size):
                f.b[e] += f.gamma[e]
        find_correction(graph, f.rows, f.b, f.Z)
        for b in range(graph.bodies.shape[0]):
            # Corrections and rounding errors are added with compensation
            at, l, z = b * POSE, LOW * b, 8 * b
            change = add(four(f.Z, z), four(low, l + L_RD))
            put_sum(f.poses, at + RD, four(f.poses, at + RD), change, low, l + L_RD)
            change = add(four(f.Z, z + 4), four(low, l + L_OMEGA))
            put_sum(f.poses, at + OMEGA, four(f.poses, at + OMEGA), change, low, l + L_OMEGA)


@kernel
def _sum_columns(x, b, until, h, tops):
    """Columns of sum_{k >= until} A_k h^(k - until) of body b."""
    s, bodies, first = splat(h), x.bodies, b * x.order.room * BODY_ROW
    top = tops.most + 1
    c = first + 12 * top
    u, v = _coefficient(bodies, c, top, tops), _coefficient(bodies, c + 4, top, tops)
    w = _coefficient(bodies, c + 8, top, tops)
    for k in range(tops.most, until - 1, -1):
        c = first + 12 * k
        u = fma(u, s, _coefficient(bodies, c, k, tops))
        v = fma(v, s, _coefficient(bodies, c + 4, k, tops))
        w = fma(w, s, _coefficient(bodies, c + 8, k, tops))
    return u, v, w


@kernel
def _compose(x, b, d0, d1, d2, d3, poses, p):
    """p + low = p_0 o (1 + d0, d) of body b, of unit length."""
    at, l = b * POSE, LOW * b + L_P
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    # p = p_0 + p_0 o (d0, d), added with compensation
    let(p, 0, e0 * d0 - e1 * d1 - e2 * d2 - e3 * d3)
    let(p, 1, e1 * d0 + e0 * d1 - e3 * d2 + e2 * d3)
    let(p, 2, e2 * d0 + e3 * d1 + e0 * d2 - e1 * d3)
    let(p, 3, e3 * d0 - e2 * d1 + e1 * d2 + e0 * d3)
    put_sum(poses, at + P, four(x.start, 4 * b), add(four(p, 0), four(x.low, l)), x.low_end, l)
    # Of unit length again: (1 - p.p) / 2 of p
    off = 1.0
    for n in range(4):
        off -= get(poses, at + P + n) * get(poses, at + P + n)
    change = fma(four(poses, at + P), splat(0.5 * off), four(x.low_end, l))
    put_sum(poses, at + P, four(poses, at + P), change, x.low_end, l)


@long_kernel
def _follow(x, b, h, parts, tops, p):
    """p of body b at h, followed in so many parts of the step."""
    i = 1
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    while True:
        # Lanes with fewer parts stay at their end
        on = below(i - 0.5, parts)
        if not any_of(on):
            return e0, e1, e2, e3
        u, v, w = _sum_columns(x, b, 0, h * i / parts, tops)
        f0, f1, f2, f3 = _parameters(u, v, w, p, e0, e1, e2, e3)
        e0, e1, e2, e3 = choose(on, f0, e0), choose(on, f1, e1), choose(on, f2, e2), choose(on, f3, e3)
        i += 1


@kernel
def _parameters(u, v, w, p, e0, e1, e2, e3):
    """Euler parameters of the matrix with columns u, v, w, on the side of e0 to e3; from the largest of the four."""
    # Entries of the matrix
    put(p, 0, u)
    a, u1, u2 = get(p, 0), get(p, 1), get(p, 2)
    put(p, 0, v)
    v0, b, v2 = get(p, 0), get(p, 1), get(p, 2)
    put(p, 0, w)
    w0, w1, c = get(p, 0), get(p, 1), get(p, 2)
    # 4 e0 e, 4 e_i e_j and 4 e_i^2
    x, y, z = v2 - w1, w0 - u2, u1 - v0
    d, e, f = w1 + v2, u2 + w0, v0 + u1
    f0, f1, f2, f3 = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    largest = max(max(f0, f1), max(f2, f3))
    # The first of the largest ones
    m0, m1, m2 = below(f0, largest), below(f1, largest), below(f2, largest)
    p0 = choose(m0, choose(m1, choose(m2, z, y), x), f0)
    p1 = choose(m0, choose(m1, choose(m2, e, f), f1), x)
    p2 = choose(m0, choose(m1, choose(m2, d, f2), f), y)
    p3 = choose(m0, choose(m1, choose(m2, f3, d), e), z)
    # Of unit length; p and -p are the same orientation
    scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    p0, p1, p2, p3 = p0 * scale, p1 * scale, p2 * scale, p3 * scale
    other = below(p0 * e0 + p1 * e1 + p2 * e2 + p3 * e3, 0.0)
    return choose(other, -p0, p0), choose(other, -p1, p1), choose(other, -p2, p2), choose(other, -p3, p3)


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
                # A series errs by tau^top, its velocity by h besides: where that is what it may be
                if kind.sharp == 1 and limits[EXCESS] > 1.0:
                    share = WITHIN * limits[EXCESS] ** (-1.0 / (c.expansion.order.top + 1))
                    c.trial.good = max(c.trial.good, share * (j + 1) / places)
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
    limits[MOST], limits[EXCESS] = OFF if kind.sharp == 1 else OFF_SELDOM, 0.0
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
def state_within(context, c, kernels, t, h, whole):
    """q, qd, qdd at t, h after the series' origin, which leaves the selection of rows as it is. Status.

    whole: whether accelerations are asked for; else they are those of another state.
    """
    f = c.tangent
    save_selection(f)
    # Next to a singular configuration accelerations are those of the series
    status = call_reach(kernels.reach, context, t, h)
    if is_singular(c, status):
        return_to_selection(f)
        status = call_reach(kernels.pass_singular, context, t, h)
    elif status == 0 and whole:
        status = call_reach(kernels.accelerate_here, context, t, h)
    return_to_selection(f)
    return status


@kernel
def set_floor(c, q):
    """The |Phi| that rounding of positions q leaves."""
    control = c.work.control
    control.floor = ROUNDING * (control.size + largest_coordinate(c.graph.bodies, q, control.size))
