"""Newton's method for a stage of an implicit method in the tangent form: the equations of all levels at once.

    Phi(q) = 0                         q  at x - Y0 u
    H C (xd - Y0 z) + Phi_t = 0        qd at xd - Y0 z
    H a + gamma = 0                    a = (rdd, omega'd), the accelerations k of chart coordinates
    M a + H^T lam = F

x and xd are those of k. An iteration evaluates the rows and the loads once and corrects u, z, k and lam. With N of an
older place, p = -Y0 N^-1 Phi, w = -Y0 N^-1 (H C (xd - Y0 z) + Phi_t) and n = -Y0 N^-1 (H a + gamma) are the normal
parts of the corrections of positions, velocities and accelerations; the tangent part e follows from the saddle-point
matrix (saddle_point.py), as bodies move by C p and C w:

    [ M - g C_b - g^2 K_b    H^T ] [ C e  ]     [ F - M (a + C n) - H^T lam + K_b C p + C_b C w ]
    [ H                      0   ] [ dlam ]  =  [ 0                                             ]

Neither factors of S nor, at every place, those of N are needed. What the iteration leaves of Phi is of the size of its
tolerance; the position solve at the end of a step removes it.
"""

import math

from ..elements.loops.body_poses import write_positions, write_velocities
from ..errors import Status
from ..jit.kernels import callback, kernel, vector
from ..jit.simd import add, fma, four, lanes, put, splat
from ..maths.dense_linalg import copy, largest
from ..methods.explicit import NORM
from ..methods.tolerances import KAPPA
from ..model.equations import is_rheonomic, set_time
from ..rows.interface import (
    apply_multipliers,
    correct_levels,
    evaluate_bias,
    evaluate_drift,
    evaluate_rows,
    level_residuals,
    solve_saddle,
    take_reactions,
)
from ..workspaces.workspace import load
from .accelerations import body_forces
from .chart_coordinates import displace, to_bodies, turn_accelerations, turn_rates
from .saddle_point import add_blocks, degrees, take_solution, turned_back, weigh_motion
from .tangent_error import weighted_square
from .tolerances import NEGLIGIBLE, ROUNDING_AT_MOST

OK, NOT_FINITE, CHART_LOST = int(Status.SUCCESS), int(Status.NOT_FINITE), int(Status.CHART_LOST)


@callback("pdppp")
def residual(context, t, x, y, k):
    """Evaluate rows and loads at chart coordinates x and rates y, and the accelerations of bodies that k is. Status."""
    c = load(context)
    system, w, f, l, s, graph = c.system, c.work, c.tangent, c.chart, c.saddle, c.graph
    n = l.x.size - 8
    l.state.time = t
    w.counters.evaluations += 1
    if not set_time(system, t):
        return NOT_FINITE
    if c.linear.numbers.rates_of != w.counters.charts:
        c.linear.numbers.rates_of = w.counters.charts
        for e in range(s.z.size):
            s.z[e] = 0.0
    copy(vector(x, n), l.x)
    copy(vector(y, n), l.y)
    apply_multipliers(graph, l.rows0, w.u, l.x)
    apply_multipliers(graph, l.rows0, s.z, l.y)
    if not displace(graph, l, f.poses):
        return CHART_LOST
    turn_rates(graph, l, l.y, f.poses)
    turn_accelerations(graph, l, f.poses, vector(k, n), s.a)
    if f.b.size > 0:
        _evaluate_levels(graph, system, f, l, s, t)
    if system.forces.shape[0] > 0:
        write_positions(graph.bodies, f.poses, w.q)
        write_velocities(graph.bodies, f.poses, w.qd)
    body_forces(graph, system, w, f, t)
    copy(f.Z, s.loads)
    return OK if largest(s.levels) + largest(s.loads) < math.inf else NOT_FINITE


@kernel
def _evaluate_levels(graph, system, f, l, s, t):
    """H, gamma and the residuals of the rows at the poses and the accelerations s.a."""
    evaluate_rows(graph, system, f, f.rows, t)
    if is_rheonomic(system):
        evaluate_drift(graph, system, f, t, l.drift)
    evaluate_bias(graph, system, f, t)
    level_residuals(graph, f, s.a, l.drift, s.levels)


@callback("pdppdd", "d")
def correct(context, g, k, old, rtol, atol):
    """Correct k (8 b,), u, z and the multipliers; the size of the change in the error norm, as `distance`."""
    c = load(context)
    w, f, l, s, graph = c.work, c.tangent, c.chart, c.saddle, c.graph
    k, old, n, step = vector(k, l.x.size - 8), vector(old, 3 * w.q.size), w.q.size, l.x.size
    p, v = s.motions[:step], s.motions[step : 2 * step]
    turn_accelerations(graph, l, f.poses, k, s.a)
    for i in range(s.motions.size):
        s.motions[i] = 0.0
    normal = 0.0
    if f.b.size > 0:
        far = _find_normal_parts(graph, w, l, s, g)
        rates = weighted_square(graph, l, p, w.qd, old, n, rtol, atol) / (g * g) if far else 0.0  # what p may change
        normal = rates + weighted_square(graph, l, p, w.q, old, 0, rtol, atol)
        normal += weighted_square(graph, l, v, w.qd, old, n, rtol, atol)
    _balance(graph, f, l, s)
    if normal > (NEGLIGIBLE * KAPPA) ** 2 * (2 * n):
        to_bodies(graph, l, p, f.Z)
        add_blocks(graph, s, s.K, 1.0, f.Z)
        to_bodies(graph, l, v, f.Z)
        add_blocks(graph, s, s.C, 1.0, f.Z)
    solve_saddle(s)
    take_solution(graph, s)
    _move(graph, l, s, g, k)
    size = weighted_square(graph, l, p, w.q, old, 0, rtol, atol)
    size += weighted_square(graph, l, v, w.qd, old, n, rtol, atol)
    return math.sqrt(max(size, normal) / (2 * n))


@kernel
def _find_normal_parts(graph, w, l, s, g):
    """Normal parts of the corrections s.motions, and u and z; True if Phi is more than rounding.

    A change of the accelerations by n moves x and xd by g^2 n and g n, which u and z take off again.
    """
    worst = 0.0
    for i in range(0, s.levels.size, 4):
        worst = max(worst, abs(s.levels[i]))
    if worst <= w.control.floor:
        for i in range(0, s.levels.size, 4):
            s.levels[i] = 0.0
    made = l.state.made == w.counters.charts
    lower, upper = l.lower if made else l.rows0.S, l.upper if made else l.rows0.S
    correct_levels(graph, l.rows0, lower, upper, s.levels, s.motions)
    for e in range(s.z.size):
        i = 4 * e
        w.u[e] += s.levels[i] - g * g * s.levels[i + 2]
        s.z[e] += s.levels[i + 1] - g * s.levels[i + 2]
    return worst > ROUNDING_AT_MOST * w.control.floor


@kernel
def _balance(graph, f, l, s):
    """s.x = F - M (a + C n) - H^T lam, and zero for the rows."""
    to_bodies(graph, l, s.motions[2 * l.x.size :], f.Z)
    for i in range(s.a.size):
        f.Z[i] += s.a[i]
    weigh_motion(graph, s, f.Z)
    copy(s.loads, s.e)
    take_reactions(graph, f.rows, s.multipliers, s.e)
    for b in range(graph.bodies.shape[0]):
        at, o = s.graph.body_at[b], 8 * b
        for i in range(degrees(graph, b)):
            s.x[at + i] = s.e[o + i + i // 3] - s.x[at + i]


@kernel
def _move(graph, l, s, g, k):
    """k += e + n; e is added to the corrections of positions and velocities, too."""
    for b in range(graph.bodies.shape[0]):
        at, o = s.graph.body_at[b], 8 * b
        _shift(s, l.x.size, g, k, o, lanes(s.x[at], s.x[at + 1], s.x[at + 2]))
        if graph.bodies[b, 1] == 7:
            _shift(s, l.x.size, g, k, o + 4, turned_back(l, b, s, at + 3))


@kernel
def _shift(s, step, g, k, i, e):
    put(k, i, add(four(k, i), add(e, four(s.motions, 2 * step + i))))
    put(s.motions, step + i, fma(e, splat(g), four(s.motions, step + i)))
    put(s.motions, i, fma(e, splat(g * g), four(s.motions, i)))


@callback(NORM, "d")
def distance(context, ex, ey, old, rtol, atol):
    """As `error_norm`, of changes that are tangent to the constraints already."""
    c = load(context)
    w, l, graph, n = c.work, c.chart, c.graph, c.work.q.size
    old = vector(old, 3 * n)
    total = weighted_square(graph, l, vector(ex, l.x.size - 8), w.q, old, 0, rtol, atol)
    total += weighted_square(graph, l, vector(ey, l.x.size - 8), w.qd, old, n, rtol, atol)
    return math.sqrt(total / (2 * n))
