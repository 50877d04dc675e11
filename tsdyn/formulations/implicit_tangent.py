"""The tangent form for implicit methods: Newton's method for a stage."""

import math

from ..elements.loops.constraint_rows import write_positions, write_velocities
from ..elements.loops.friction import DERIVE, HERE
from ..errors import Status
from ..jit.kernels import ANY, callback, complex_vector, data_of, kernel, stack, vector
from ..jit.simd import add, cross, fma, four, lanes, put, splat, times, total
from ..maths.dense_linalg import copy, largest
from ..maths.tolerances import ROUNDING_AT_MOST
from ..maths.vectors import spin
from ..methods.collocation import parts_of
from ..methods.explicit import NORM
from ..model.equations import is_rheonomic, set_time
from ..rows.interface import (
    DYNAMICS,
    apply_multipliers,
    clear_rates,
    clear_redundant,
    evaluate_bias,
    evaluate_drift,
    evaluate_rows,
    factorise_complex_saddle,
    factorise_saddle,
    factorise_selected_rows,
    is_raised,
    multiply_inertia_rows,
    multiply_rates,
    multiply_rows,
    solve_complex_saddle,
    solve_product,
    solve_rows,
    solve_saddle,
    take_reactions,
    unbalance_inertia_rows,
    weigh,
    weigh_bodies,
    weigh_selected_rows,
)
from ..workspaces import load
from . import tolerances as limits
from .accelerations import body_forces, body_of, factorise_loads, find_loads, forget_loads, keep_loads, weigh_units
from .charts import (
    add_rate_residuals,
    displace,
    factorise_normal,
    measure_turns,
    to_bodies,
    turn_accelerations,
    turn_rates,
)
from .projection import largest_residual, velocity_floor
from .saddle_point import (
    add_blocks,
    degrees,
    factorise,
    linearise,
    reduce,
    soften,
    take_solution,
    turned_back,
    write_rows,
)
from .tangent import COLUMNS, accelerate, check_chart, error_norm, place, start_chart, weighted_square, write_state

# Right-hand side of a Newton correction of a stage: the normal part of accelerations, and the unbalanced loads.


@kernel
def add_to(x, out):
    """Add x to out."""
    for i in range(x.size):
        out[i] += x[i]


@kernel
def solve_normal(c):
    """f.b <- N^-1 f.b, by factors that may be of an older configuration, such as q0."""
    l = c.chart
    lower, upper = (l.lower, l.upper) if l.state.made == 1 else (l.rows0.S, l.rows0.S)
    solve_product(c.graph, lower, upper, c.tangent.b)


@kernel
def find_normal_part(c):
    """s.r = n for the accelerations s.a; f.b are its multipliers, n = -Y0 f.b."""
    f, s = c.tangent, c.saddle
    # N^-1 (H a + gamma)
    if f.b.size > 0:
        multiply_rows(c.graph, f.rows, s.a, f.b)
        add_to(f.gamma, f.b)
        solve_normal(c)
    spread_normal(c, f.b)
    if c.graph.rates.size > 0:
        _refine_normal_part(c)


@kernel
def _refine_normal_part(c):
    """The rest of f.b and s.r, which factors of an older configuration leave: it moves bodies along rows on velocities.

    l.drift is scratch.
    """
    f, l, s = c.tangent, c.chart, c.saddle
    for _ in range(limits.NORMAL_SWEEPS):
        copy(f.b, l.drift)
        # H (a + C n) + gamma
        to_bodies(c.graph, l, s.r, f.Z)
        add_to(s.a, f.Z)
        multiply_rows(c.graph, f.rows, f.Z, f.b)
        add_to(f.gamma, f.b)
        solve_normal(c)
        add_to(l.drift, f.b)
        spread_normal(c, f.b)


@kernel
def spread_normal(c, b):
    """s.r = -Y0 b."""
    s = c.saddle
    for i in range(s.r.size):
        s.r[i] = 0.0
    apply_multipliers(c.graph, c.chart.rows0, b, s.r)


@kernel
def find_imbalance(c, left):
    """s.x = F - M (a + C n) - H^T lam, n = s.r, and zero for rows of Phi. False if S is singular.

    left: the fraction of the imbalance along the rows that may remain.
    """
    f, l, s, graph = c.tangent, c.chart, c.saddle, c.graph
    # M (a + C n)
    to_bodies(graph, l, s.r, f.Z)
    add_to(s.a, f.Z)
    # In the order of elimination: mu - (h (a + C n) + gamma_h) of inertia rows
    for i in range(s.x.size):
        s.x[i] = 0.0
    multiply_inertia_rows(graph, f.rows, s.graph.row_at, f.Z, s.x)
    unbalance_inertia_rows(graph, f.rows, s.graph.row_at, s.multipliers, s.x)
    for b in range(graph.bodies.shape[0]):
        weigh(graph.mass, b, f.Z, 8 * b, f.Z, 8 * b)
    # e = F - M (a + C n) - H^T lam, F with the friction of the joints
    for i in range(s.e.size):
        s.e[i] = s.loads[i] - f.Z[i]
    take_reactions(graph, f.rows, s.multipliers, s.e)
    for i in range(graph.frictions.shape[0]):
        _add_friction(graph, f, i, f.friction.load[7 * i], s.e)
    if f.b.size > 0 and not _correct_multipliers(c, left):
        return False
    for b in range(graph.bodies.shape[0]):
        at, o = s.graph.body_at[b], 8 * b
        for i in range(degrees(graph, b)):
            s.x[at + i] = s.e[o + i + i // 3]
    return True


@kernel
def _add_friction(graph, f, i, N, out):
    """Add g_i N, the friction i for a normal load N, to the loads on its two bodies."""
    g, scale = stack(8), splat(N)
    for k in range(2):
        # M times W g_i
        b = body_of(graph.frictions[i], k)
        if b < graph.bodies.shape[0]:
            weigh(graph.mass, b, f.friction.g, 16 * i + 8 * k, g, 0)
            put(out, 8 * b, fma(four(g, 0), scale, four(out, 8 * b)))
            put(out, 8 * b + 4, fma(four(g, 4), scale, four(out, 8 * b + 4)))


@kernel
def _change_friction(c):
    """Find the normal loads of the multipliers, and what they change of s.e."""
    f, s, graph = c.tangent, c.saddle, c.graph
    for i in range(graph.frictions.shape[0]):
        _add_friction(graph, f, i, -f.friction.load[7 * i], s.e)
    find_loads(graph, c.system, f, c.work.q, s.multipliers, 0)
    for i in range(graph.frictions.shape[0]):
        _add_friction(graph, f, i, f.friction.load[7 * i], s.e)


@kernel
def _renew_reactions(c):
    """Factors of S, or with friction of N~, at the present H. False if singular."""
    f, graph = c.tangent, c.graph
    c.work.counters.factorizations += 1
    if graph.frictions.shape[0] == 0:
        return factorise_selected_rows(graph, f, f.rows, DYNAMICS) < 0
    find_loads(graph, c.system, f, c.work.q, c.saddle.multipliers, DERIVE)
    weigh_selected_rows(graph, f.rows)
    return factorise_loads(graph, f, False)


@kernel
def _solve_reactions(c):
    """f.b <- S^-1 f.b, or with friction N~^-1 f.b, by factors that may be of an older configuration."""
    f, graph = c.tangent, c.graph
    if graph.frictions.shape[0] == 0:
        solve_rows(graph, f.rows, f.b)
    else:
        solve_product(graph, f.friction.lower, f.friction.upper, f.b)


@kernel
def _correct_multipliers(c, left):
    """Correct lam by S^-1 H W e until `left` of H W e is left, e = F - M (a + C n) - H^T lam = s.e. False: S singular.

    Where friction depends on lam, N~ of accelerations.py takes the place of S.

    The saddle-point matrix was formed with an older H, so the residual normal to the constraints is eliminated with the
    present one. S may be older, too, as long as corrections contract: at first it is that of the step's start.
    """
    w, f, s, graph, least, before, renewed = c.work, c.tangent, c.saddle, c.graph, 0.0, math.inf, False
    raised = is_raised(graph)  # S is of another metric than W
    for sweep in range(limits.REACTION_SWEEPS):
        # H W e, the part of the imbalance that multipliers can balance
        copy(s.e, f.Z)
        put(f.Z, 8 * graph.bodies.shape[0], splat(0.0))  # the ground
        put(f.Z, 8 * graph.bodies.shape[0] + 4, splat(0.0))
        weigh_bodies(graph, f.Z)
        multiply_rows(graph, f.rows, f.Z, f.b)
        worst = largest_residual(graph, f, w.control.floor)
        if sweep == 0:
            least = left * worst
        if worst <= least:
            return True
        # There N of the chart takes the place of S
        if raised:
            solve_normal(c)
        else:
            # S of an older configuration contracts no more
            if worst > limits.SLOW * before and not renewed:
                if not _renew_reactions(c):
                    return False
                renewed = True
            _solve_reactions(c)
            clear_redundant(f, f.b)  # which others may have been when S was made
        # lam <- lam + dlam,  e <- e - H^T dlam
        add_to(f.b, s.multipliers)
        take_reactions(graph, f.rows, f.b, s.e)
        _change_friction(c)
        before = worst
    return True


# Newton's method for a stage of an implicit method in the tangent form, its multipliers unknowns as well.
#
#     Phi(q) = 0                         q  at x - Y0 u
#     H C (xd - Y0 z) + Phi_t = 0        qd at xd - Y0 z
#     H a + gamma = 0                    a = (rdd, omega'd), the accelerations k of chart coordinates
#     M a + H^T lam = F
#
# x and xd are those of k. `residual` solves the first two for u and z, to well below the tolerance of the stage, and
# evaluates the others. `correct` takes n = -Y0 N^-1 (H a + gamma) for the normal part of the correction of k; the
# tangent part e follows with the multipliers from the saddle-point matrix (saddle_point.py):
#
#     [ M - g C_b - g^2 K_b    H^T ] [ C e  ]     [ F - M (a + C n) - H^T lam ]
#     [ H                      0   ] [ dlam ]  =  [ 0                         ]
#
# Before, lam is corrected by S^-1 H W times the right-hand side, at the present H. The factors of N and S are those of
# an older configuration as long as corrections contract: at first of the step's start.

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
    status = _solve_positions(c, t, g, vector(x, n))
    if status == OK:
        status = _solve_rates(c, t)
    if status != OK:
        return status
    if system.forces.shape[0] > 0:
        write_positions(graph.bodies, f.poses, w.q)
        write_velocities(graph.bodies, f.poses, w.qd)
    if f.b.size > 0:
        evaluate_bias(graph, system, f, t)
    # F at the stage, but for friction by reactions; that of unit loads, and loads at the predicted reactions; a of k
    forget_loads(system)
    body_forces(graph, system, w, f, t)
    copy(f.Z, s.loads)
    if graph.frictions.shape[0] > 0:
        weigh_units(graph, system, f, w.q, w.qd, t)
        find_loads(graph, system, f, w.q, s.multipliers, HERE)
        keep_loads(system, f)
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
        numbers.rates_of, numbers.lag = charts, limits.LAG
        for e in range(s.z.size):
            s.z[e] = 0.0
    if t == numbers.time:
        return
    # Multipliers along the line through the last two stages
    span, ratio = numbers.time - numbers.time_before, 0.0
    if 0.0 < abs(span) < math.inf:
        ratio = min(max((t - numbers.time) / span, -limits.FARTHEST_AHEAD), limits.FARTHEST_AHEAD)
    for e in range(s.multipliers.size):
        last = s.multipliers[e]
        s.multipliers[e] += ratio * (last - s.before[e])
        s.before[e] = last
    numbers.time_before, numbers.time = numbers.time, t


@kernel
def _renew_normal(c):
    """Factors of N at the present configuration; False if it is singular."""
    c.linear.numbers.lag = limits.LEAST_LAG
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
def _solve_positions(c, t, g, x):
    """Newton's method for u: poses and H. Status.

    Stops when the position error over g is a velocity well below the tolerance of the stage.
    """
    system, w, f, l, s, graph, numbers = c.system, c.work, c.tangent, c.chart, c.saddle, c.graph, c.linear.numbers
    floor, before, renewed = w.control.floor, math.inf, False
    for _ in range(limits.SWEEPS):
        if not displace(graph, l, f.poses):
            return CHART_LOST
        if f.b.size == 0:
            return OK
        evaluate_rows(graph, system, f, f.rows, t)
        add_rate_residuals(graph, f, l, x)
        worst = largest_residual(graph, f, w.control.floor)
        if not worst < math.inf:
            return NOT_FINITE
        # Rounding, or a residual near it that falls no more
        if worst <= floor or (worst > limits.SLOW * before and worst <= ROUNDING_AT_MOST * floor):
            return OK
        if before < math.inf:
            # Contraction by factors of an older configuration
            numbers.lag = max(worst / before, limits.LEAST_LAG)
            if numbers.lag > limits.SLOW and renewed:
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
        if numbers.lag * _rate_size(c, s.r) <= g * limits.LEFT:
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
    for sweep in range(limits.SWEEPS):
        turn_rates(graph, l, l.y, f.poses)
        if f.b.size == 0:
            return OK
        # H (rd, omega') + Phi_t, and the size of its rounding
        if sweep == 0:
            floor = velocity_floor(graph, w, f)
        multiply_rates(graph, f.rows, f.poses, f.b)
        if rheonomic:
            add_to(l.drift, f.b)
        worst = largest_residual(graph, f, w.control.floor)
        if not worst < math.inf:
            return NOT_FINITE
        if worst <= floor or (worst > limits.STALLED * before and worst <= ROUNDING_AT_MOST * floor):
            return OK
        # Factors at the present H, once
        if worst > limits.SLOW * before:
            if renewed:
                return NEWTON_FAILED
            if not _renew_normal(c):
                return SINGULAR
            renewed = True
        # xd <- xd - Y0 N^-1 (H (rd, omega') + Phi_t),  z likewise
        _take_off(c, l.y)
        add_to(f.b, s.z)
        # Rows on velocities turn with bodies, so their contraction is not that of positions: it is measured here
        lag = numbers.lag if graph.rates.size == 0 else worst / before if sweep > 0 else 1.0
        if lag * _rate_size(c, s.r) <= limits.LEFT:
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
    # Rows on velocities don't take off what it moves along them: its change counts
    square = 0.0
    if graph.rates.size > 0:
        square = weighted_square(graph, l, s.r, w.q, c.linear.now[0], 0, numbers.rtol, numbers.atol)
    # [e, dlam] of the saddle-point matrix
    if not find_imbalance(c, limits.REACTIONS_LEFT):
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
    square += weighted_square(graph, l, s.r, w.q, c.linear.now[0], 0, numbers.rtol, numbers.atol)
    return g * math.sqrt(square * g * g / (2 * n) + _rate_size(c, s.r) ** 2)


@kernel
def _correct_normal_part(c, g, k):
    """k += n; s.r = n. A change n moves x and xd by g^2 n and g n, which u and z take off again."""
    w, f, s = c.work, c.tangent, c.saddle
    find_normal_part(c)
    for i in range(k.size):
        k[i] += s.r[i]
    for e in range(f.b.size):
        s.z[e] -= g * f.b[e]
    clear_rates(c.graph, f.b)  # u takes off what rows on positions forbid
    for e in range(f.b.size):
        w.u[e] -= g * g * f.b[e]


@callback(NORM, "d")
def distance(context, ex, ey, old, rtol, atol):
    """As `error_norm`, of changes that are tangent to the constraints already."""
    c = load(context)
    w, l, graph, n = c.work, c.chart, c.graph, c.work.q.size
    old = vector(old, 3 * n)
    total = weighted_square(graph, l, vector(ex, l.x.size - 8), w.q, old, 0, rtol, atol)
    total += weighted_square(graph, l, vector(ey, l.x.size - 8), w.qd, old, n, rtol, atol)
    return math.sqrt(total / (2 * n))


# The tangent form for implicit methods: accelerations of a stage, and rates of another configuration, in a chart.
#
# Newton's method for a stage stands above, that for all stages of a collocation method in collocation_stages.py; the
# matrices are those of saddle_point.py.


@callback("p")
def check(context):
    """As tangent.check; N is factorised at the present configuration: the stages of the next step begin with it."""
    c = load(context)
    c.chart.state.factored = 0
    return check_chart(c)


@callback("pp")
def complete(context, yd):
    """Write q, qd and qdd after `accelerate`, yd being accelerations of chart coordinates.

    They are projected onto H (rdd, omega'd) + gamma = 0.
    """
    c = load(context)
    f, l, graph = c.tangent, c.chart, c.graph
    yd = vector(yd, l.x.size - 8)
    turn_accelerations(graph, l, f.poses, yd, f.Z)
    write_state(graph, c.work, f)
    return OK


@callback("ppp")
def recall(context, y, yd):
    """Rates and accelerations of chart coordinates (8 b,) at the point before, in this chart; moves l.d."""
    c = load(context)
    l, graph, before = c.chart, c.graph, c.linear.before
    y, yd = vector(y, l.x.size - 8), vector(yd, l.x.size - 8)
    measure_turns(graph, l, before[0])
    for b in range(graph.bodies.shape[0]):
        i, o = graph.bodies[b, 0], 8 * b
        put(y, o, lanes(before[1, i], before[1, i + 1], before[1, i + 2]))
        put(yd, o, lanes(before[2, i], before[2, i + 1], before[2, i + 2]))
        put(y, o + 4, splat(0.0))
        put(yd, o + 4, splat(0.0))
        if graph.bodies[b, 1] == 7:
            # omega' = 2 G pd of the point before, and omega'd likewise
            p, d = before[0, i + 3 : i + 7], lanes(l.d[4 * b], l.d[4 * b + 1], l.d[4 * b + 2])
            wx, wy, wz = spin(p, before[1, i + 3 : i + 7])
            omega, d0 = lanes(wx, wy, wz), splat(1.0 + l.d[4 * b + 3])
            wx, wy, wz = spin(p, before[2, i + 3 : i + 7])
            change = lanes(wx, wy, wz)
            # etad = (d0 I + d~) omega'
            put(y, o + 4, fma(omega, d0, cross(d, omega)))
            # etadd = (d0 I + d~) omega'd - |omega'|^2 d / 2
            square = splat(-0.5 * total(times(omega, omega)))
            put(yd, o + 4, add(fma(change, d0, cross(d, change)), times(d, square)))
    return OK
