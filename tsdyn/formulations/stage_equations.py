"""Newton's method for a stage of an implicit method in the tangent form, its multipliers unknowns as well.

    Phi(q) = 0                         q  at x - Y0 u
    H C (xd - Y0 z) + Phi_t = 0        qd at xd - Y0 z
    H a + gamma = 0                    a = (rdd, omega'd), the accelerations k of chart coordinates
    M a + H^T lam = F

x and xd are those of k. `residual` solves the first two for u and z, to well below the tolerance of the stage, and
evaluates the others. `correct` takes n = -Y0 N^-1 (H a + gamma) for the normal part of the correction of k; the tangent
part e follows with the multipliers from the saddle-point matrix (saddle_point.py):

    [ M - g C_b - g^2 K_b    H^T ] [ C e  ]     [ F - M (a + C n) - H^T lam ]
    [ H                      0   ] [ dlam ]  =  [ 0                         ]

Before, lam is corrected by S^-1 H W times the right-hand side, at the present H. The factors of N and S are those of an
older configuration as long as corrections contract: at first of the step's start.
"""

import math

from ..elements.loops.body_poses import write_positions, write_velocities
from ..errors import Status
from ..jit.kernels import callback, kernel, vector
from ..jit.simd import add, four, lanes, put
from ..maths.dense_linalg import copy, largest
from ..methods.explicit import NORM
from ..model.equations import is_rheonomic, set_time
from ..rows.interface import (
    apply_multipliers,
    clear_redundant,
    evaluate_bias,
    evaluate_drift,
    evaluate_rows,
    multiply_rates,
    solve_saddle,
)
from ..workspaces.workspace import load
from .accelerations import body_forces
from .chart_coordinates import displace, factorise_normal, turn_accelerations, turn_rates
from .projection import largest_residual, velocity_floor
from .saddle_point import take_solution, turned_back
from .stage_balance import add_to, find_imbalance, find_normal_part, solve_normal, spread_normal
from .tangent_error import weighted_square
from .tolerances import (
    FARTHEST_AHEAD,
    LAG,
    LEAST_LAG,
    LEFT,
    ROUNDING_AT_MOST,
    SLOW,
    STALLED,
    SWEEPS,
)

OK, NOT_FINITE, SINGULAR = int(Status.SUCCESS), int(Status.NOT_FINITE), int(Status.SINGULAR)
CHART_LOST, NEWTON_FAILED = int(Status.CHART_LOST), int(Status.NEWTON_FAILED)


@callback("pddppp")
def residual(context, t, g, x, y, k):
    """Place the stage at chart coordinates x and rates y; rows, loads and the accelerations of bodies there. Status."""
    c = load(context)
    system, w, f, l, s, graph = c.system, c.work, c.tangent, c.chart, c.saddle, c.graph
    numbers, n = c.linear.numbers, l.x.size - 8
    l.state.time = t
    w.counters.evaluations += 1
    if not set_time(system, t):
        return NOT_FINITE
    # Iterates u, z and lam go on from the stage before
    _begin(numbers, s, w.counters.charts, t)
    clear_redundant(f, s.multipliers)  # which no iteration corrects: extrapolation would amplify those of dropped rows
    copy(vector(x, n), l.x)
    copy(vector(y, n), l.y)
    # x - Y0 u and xd - Y0 z
    apply_multipliers(graph, l.rows0, w.u, l.x)
    apply_multipliers(graph, l.rows0, s.z, l.y)
    status = _solve_positions(c, t, g)
    if status == OK:
        status = _solve_rates(c, t)
    if status != OK:
        return status
    if system.forces.shape[0] > 0:
        write_positions(graph.bodies, f.poses, w.q)
        write_velocities(graph.bodies, f.poses, w.qd)
    if f.b.size > 0:
        evaluate_bias(graph, system, f, t)
    # F at the stage, and a of k
    body_forces(graph, system, w, f, t)
    copy(f.Z, s.loads)
    turn_accelerations(graph, l, f.poses, vector(k, n), s.a)
    return OK if largest(s.loads) < math.inf else NOT_FINITE


@kernel
def _begin(numbers, s, charts, t):
    """In a new stage, multipliers along the line through the last two; z and lag in a new chart."""
    if numbers.rates_of == 0:  # at the start, and where a stage has failed
        numbers.time = numbers.time_before = -math.inf
        for e in range(s.multipliers.size):
            s.multipliers[e] = s.before[e] = 0.0
    # Normal velocities belong to a chart
    if numbers.rates_of != charts:
        numbers.rates_of, numbers.lag = charts, LAG
        for e in range(s.z.size):
            s.z[e] = 0.0
    if t == numbers.time:
        return
    # Multipliers along the line through the last two stages
    span, ratio = numbers.time - numbers.time_before, 0.0
    if 0.0 < abs(span) < math.inf:
        ratio = min(max((t - numbers.time) / span, -FARTHEST_AHEAD), FARTHEST_AHEAD)
    for e in range(s.multipliers.size):
        last = s.multipliers[e]
        s.multipliers[e] += ratio * (last - s.before[e])
        s.before[e] = last
    numbers.time_before, numbers.time = numbers.time, t


@kernel
def _renew_normal(c):
    """Factors of N at the present configuration; False if it is singular."""
    c.linear.numbers.lag = LEAST_LAG
    return factorise_normal(c.graph, c.work, c.tangent, c.chart)


@kernel
def _take_off(c, x):
    """f.b <- N^-1 f.b and x -= Y0 f.b; s.r is the change of x."""
    solve_normal(c)
    spread_normal(c, c.tangent.b)
    for i in range(x.size):
        x[i] += c.saddle.r[i]


@kernel
def _rate_size(c, x):
    """The error norm of a change x of rates in chart coordinates."""
    numbers, n = c.linear.numbers, c.work.q.size
    square = weighted_square(c.graph, c.chart, x, c.work.qd, c.linear.now[1], 0, numbers.rtol, numbers.atol)
    return math.sqrt(square / (2 * n))


@kernel
def _solve_positions(c, t, g):
    """Newton's method for u: poses and H. Status.

    Stops when the position error over g is a velocity well below the tolerance of the stage.
    """
    system, w, f, l, s, graph, numbers = c.system, c.work, c.tangent, c.chart, c.saddle, c.graph, c.linear.numbers
    floor, before, renewed = w.control.floor, math.inf, False
    for _ in range(SWEEPS):
        if not displace(graph, l, f.poses):
            return CHART_LOST
        if f.b.size == 0:
            return OK
        evaluate_rows(graph, system, f, f.rows, t)
        worst = largest_residual(graph, w, f)
        if not worst < math.inf:
            return NOT_FINITE
        # Rounding, or a residual near it that falls no more
        if worst <= floor or (worst > SLOW * before and worst <= ROUNDING_AT_MOST * floor):
            return OK
        if before < math.inf:
            # Contraction by factors of an older configuration
            numbers.lag = max(worst / before, LEAST_LAG)
            if numbers.lag > SLOW and renewed:
                return NEWTON_FAILED
            # Factors at the present H, once
            if not renewed:  # one correction was not enough
                if not _renew_normal(c):
                    return SINGULAR
                renewed = True
        # x <- x - Y0 N^-1 Phi,  u <- u + N^-1 Phi
        _take_off(c, l.x)
        add_to(f.b, w.u)
        w.counters.newton += 1
        # The expected error over g is a velocity below what the stage notices
        if numbers.lag * _rate_size(c, s.r) <= g * LEFT:
            return OK if displace(graph, l, f.poses) else CHART_LOST
        before = worst
    return NEWTON_FAILED


@kernel
def _solve_rates(c, t):
    """rd and omega' of the poses from the rates l.y, tangent to well below the tolerance of the stage. Status."""
    system, w, f, l, s, graph, numbers = c.system, c.work, c.tangent, c.chart, c.saddle, c.graph, c.linear.numbers
    rheonomic, floor, before, renewed = is_rheonomic(system), 0.0, math.inf, False
    if rheonomic:
        evaluate_drift(graph, system, f, t, l.drift)
    for sweep in range(SWEEPS):
        turn_rates(graph, l, l.y, f.poses)
        if f.b.size == 0:
            return OK
        # H (rd, omega') + Phi_t, and the size of its rounding
        if sweep == 0:
            floor = velocity_floor(graph, w, f)
        multiply_rates(graph, f.rows, f.poses, f.b)
        if rheonomic:
            add_to(l.drift, f.b)
        worst = largest_residual(graph, w, f)
        if not worst < math.inf:
            return NOT_FINITE
        if worst <= floor or (worst > STALLED * before and worst <= ROUNDING_AT_MOST * floor):
            return OK
        # Factors at the present H, once
        if worst > SLOW * before:
            if renewed:
                return NEWTON_FAILED
            if not _renew_normal(c):
                return SINGULAR
            renewed = True
        # xd <- xd - Y0 N^-1 (H (rd, omega') + Phi_t),  z likewise
        _take_off(c, l.y)
        add_to(f.b, s.z)
        if numbers.lag * _rate_size(c, s.r) <= LEFT:
            turn_rates(graph, l, l.y, f.poses)
            return OK
        before = worst
    return NEWTON_FAILED


@callback("pdp", "d")
def correct(context, g, k):
    """Correct k (8 b,) and the multipliers; the size of the change of positions and velocities in the error norm."""
    c = load(context)
    w, f, l, s, graph, numbers = c.work, c.tangent, c.chart, c.saddle, c.graph, c.linear.numbers
    k, n = vector(k, l.x.size - 8), w.q.size
    # k += n, the normal part
    turn_accelerations(graph, l, f.poses, k, s.a)
    _correct_normal_part(c, g, k)
    # [e, dlam] of the saddle-point matrix
    if not find_imbalance(c):
        return math.inf
    solve_saddle(s)
    take_solution(graph, s)
    # k += e in chart coordinates
    for b in range(graph.bodies.shape[0]):
        at, o = s.graph.body_at[b], 8 * b
        put(s.r, o, lanes(s.x[at], s.x[at + 1], s.x[at + 2]))
        put(k, o, add(four(k, o), four(s.r, o)))
        if graph.bodies[b, 1] == 7:
            put(s.r, o + 4, turned_back(l, b, s, at + 3))
            put(k, o + 4, add(four(k, o + 4), four(s.r, o + 4)))
    # Positions move by g^2 e, velocities change by g e
    square = weighted_square(graph, l, s.r, w.q, c.linear.now[0], 0, numbers.rtol, numbers.atol)
    return g * math.sqrt(square * g * g / (2 * n) + _rate_size(c, s.r) ** 2)


@kernel
def _correct_normal_part(c, g, k):
    """k += n; s.r = n. A change n moves x and xd by g^2 n and g n, which u and z take off again."""
    w, f, s = c.work, c.tangent, c.saddle
    find_normal_part(c)
    for i in range(k.size):
        k[i] += s.r[i]
    for e in range(f.b.size):
        w.u[e] -= g * g * f.b[e]
        s.z[e] -= g * f.b[e]


@callback(NORM, "d")
def distance(context, ex, ey, old, rtol, atol):
    """As `error_norm`, of changes that are tangent to the constraints already."""
    c = load(context)
    w, l, graph, n = c.work, c.chart, c.graph, c.work.q.size
    old = vector(old, 3 * n)
    total = weighted_square(graph, l, vector(ex, l.x.size - 8), w.q, old, 0, rtol, atol)
    total += weighted_square(graph, l, vector(ey, l.x.size - 8), w.qd, old, n, rtol, atol)
    return math.sqrt(total / (2 * n))
