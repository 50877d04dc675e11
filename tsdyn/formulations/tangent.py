"""The tangent form: the tangent-space ODE without a basis of the tangent space, equivalent to Eq. 26, in O(N)."""

import math

from ..elements.loops.constraint_rows import largest_coordinate, write_accelerations, write_positions, write_velocities
from ..errors import Status
from ..jit.kernels import callback, kernel, long_kernel, vector
from ..maths.dense_linalg import copy, is_finite
from ..maths.tolerances import ROUNDING, ROUNDING_AT_MOST
from ..methods.explicit import ACCELERATE, NORM, PLACE
from ..model.equations import is_rheonomic, set_time
from ..rows.constraint_graph import BIAS, DRIFT, REDUCED, VALUES
from ..rows.interface import (
    DYNAMICS,
    apply_multipliers,
    clear_rates,
    evaluate_bias,
    evaluate_drift,
    evaluate_residuals,
    evaluate_rows,
    factorise_selected_rows,
    form_selected_rows,
    is_axis,
    is_raised,
    multiply_rates,
    multiply_rows,
    redundant_rows_hold,
    refinements,
    solve_product,
    solve_rows,
    weigh_selected_rows,
)
from ..workspaces import load
from .accelerations import call_friction, factorise_for_accelerations, refine_accelerations, solve_accelerations
from .charts import (
    add_rate_residuals,
    displace,
    every_level_holds,
    factorise_normal,
    largest_rates,
    reason_to_leave,
    set_base_point,
    turn_rates,
    write_back,
)
from .projection import largest_residual, velocity_floor
from .tolerances import CURVATURE, RENEWALS, ROUNDED, SLOW, SLOW_FACTORS, STALLED, SWEEPS

# Error norms of the tangent form: errors ex, ey of chart coordinates as errors of q and qd, their root mean square over
# atol + rtol times the larger end of the step.


@kernel
def _tangent_part(graph, f, l, e, of_positions):
    """f.Z = P0 e; of positions what their solve leaves of it."""
    copy(e, f.Z)
    for i in range(e.size, f.Z.size):
        f.Z[i] = 0.0
    if f.b.size > 0:
        _normal_part(graph, l, f.Z, f.b, of_positions)
        apply_multipliers(graph, l.rows0, f.b, f.Z)


@kernel
def _normal_part(graph, l, x, u, of_positions):
    """u = S0^-1 H0 x; of positions without the part of x that violates rows on velocities alone."""
    multiply_rows(graph, l.rows0, x, u)
    if of_positions:
        clear_rates(graph, u)
    solve_rows(graph, l.rows0, u)


@kernel
def weighted_square(graph, l, Z, values, old, at, rtol, atol):
    """(dq_i / (atol + rtol |value|))^2 summed, dq the change of coordinates (n,) that Z makes at q0.

    Eight arguments: the graph, the chart, the change Z, values at both ends of the step, and tolerances.
    """
    return _square(graph, l, Z, values, old, at, rtol, atol, atol)


@kernel
def _square(graph, l, Z, values, old, at, rtol, atol, turn_atol):
    """The same with another absolute tolerance of Euler parameters."""
    total = 0.0
    for b in range(graph.bodies.shape[0]):
        i, o = graph.bodies[b, 0], 8 * b
        # dr
        for c in range(3):
            x = Z[o + c] / (atol + rtol * max(abs(values[i + c]), abs(old[at + i + c])))
            total += x * x
        if graph.bodies[b, 1] == 7:
            # dp = G(p0)^T eta / 2
            i += 3
            e0, e1, e2, e3 = l.base[o + 4], l.base[o + 5], l.base[o + 6], l.base[o + 7]
            x, y, z = 0.5 * Z[o + 4], 0.5 * Z[o + 5], 0.5 * Z[o + 6]
            for c in range(4):
                if c == 0:
                    part = -e1 * x - e2 * y - e3 * z
                elif c == 1:
                    part = e0 * x - e3 * y + e2 * z
                elif c == 2:
                    part = e3 * x + e0 * y - e1 * z
                else:
                    part = -e2 * x + e1 * y + e0 * z
                part /= turn_atol + rtol * max(abs(values[i + c]), abs(old[at + i + c]))
                total += part * part
    return total


@kernel
def _tangent_size(c, ex, ey, old, rtol, atol):
    """The norm of P0 ex and P0 ey."""
    w, f, l, graph = c.work, c.tangent, c.chart, c.graph
    n, k = w.q.size, l.x.size - 8
    old = vector(old, 3 * n)
    _tangent_part(graph, f, l, vector(ex, k), True)
    total = weighted_square(graph, l, f.Z, w.q, old, 0, rtol, atol)
    _tangent_part(graph, f, l, vector(ey, k), False)
    total += weighted_square(graph, l, f.Z, w.qd, old, n, rtol, atol)
    return math.sqrt(total / (2 * n))


@callback(NORM, "d")
def error_norm(context, ex, ey, old, rtol, atol):
    """The norm of what placement leaves of the errors, which is their tangent part."""
    return _tangent_size(load(context), ex, ey, old, rtol, atol)


@callback(NORM, "d")
def stage_error_norm(context, ex, ey, old, rtol, atol):
    """The norm of the errors of a step whose stages aren't placed.

    The part that its placement takes off counts, too: of a mechanism with few degrees of freedom the tangent part
    vanishes now and then, where the step errs all the same. Rounding of the largest numbers, which is all there is of
    some constrained coordinates, doesn't count. What motions prescribe is exact, however long the step.
    """
    c = load(context)
    if is_rheonomic(c.system):
        return _tangent_size(c, ex, ey, old, rtol, atol)
    w, l, graph, n = c.work, c.chart, c.graph, c.work.q.size
    old, size = vector(old, 3 * n), w.control.floor / ROUNDING
    speed, spin = largest_rates(graph, c.tangent.poses)
    ex, ey = vector(ex, l.x.size - 8), vector(ey, l.x.size - 8)
    total = _square(graph, l, ex, w.q, old, 0, rtol, atol + ROUNDED * size, atol + ROUNDED)
    total += _square(graph, l, ey, w.qd, old, n, rtol, atol + ROUNDED * speed, atol + ROUNDED * spin)
    return math.sqrt(total / (2 * n))


# The tangent form: the tangent-space ODE without a basis of the tangent space, equivalent to Eq. 26, in O(N).
#
#     (rho, eta)      = x - Y0 u,         u from Phi = 0                           Eqs. 19-22, see workspaces.py
#     (rhod, etad)    = xd - Y0 z,        N z = H C xd + Phi_t                      Eq. 23
#     (rdd, omega'd)  = W (F - H^T lam),  (H W H^T) lam = H W F + gamma             Eqs. 3, 4
#     xdd             = (rhodd, etadd)
#
# H = [Phi_r, Phi_pi'] at q, Y0 = W0 H0^T at q0, N = H C Y0, F the applied and velocity forces. xdd keeps its component
# in the normal space, so x follows the curvature of the manifold; u and z are then of the size of the truncation error
# of a step, and Newton's method converges in one or two sweeps. The position solve removes the normal component again.
# Runge-Kutta steps are linear, so V^T x is the v of the null-space form.

__all__ = ["error_norm"]  # which is a part of the form, too
OK, SINGULAR, MASS_SINGULAR = int(Status.SUCCESS), int(Status.SINGULAR), int(Status.MASS_SINGULAR)
NOT_FINITE, NEWTON_FAILED = int(Status.NOT_FINITE), int(Status.NEWTON_FAILED)
CHART_LOST, UNHELD = int(Status.CHART_LOST), int(Status.UNHELD)
COLUMNS = REDUCED, VALUES, BIAS, DRIFT  # the loops of a graph that are called
SPLIT = 2.0**27 + 1.0  # splits a float in two halves


@callback(PLACE)
def place(context, t, x):
    """Set positions from x (8 b,): poses on the manifold, H, W H^T and the factors of S. Status."""
    c = load(context)
    system, w, f, l, graph = c.system, c.work, c.tangent, c.chart, c.graph
    w.counters.placements += 1
    l.state.time, l.state.free = t, 0
    if not set_time(system, t):
        return NOT_FINITE
    x, status = vector(x, l.x.size - 8), NEWTON_FAILED
    for attempt in range(2):
        # Start: x - Y0 u with u of the position before; if that fails, the step was long
        copy(x, l.x)
        if attempt == 1:  # a long step: from the tangent plane, P0 x
            _normal_part(graph, l, l.x, w.u, True)
        # x - Y0 u
        apply_multipliers(graph, l.rows0, w.u, l.x)
        status = _solve_positions(graph, system, w, f, l, t, x, RENEWALS * attempt)
        if status == OK or f.b.size == 0:
            break
    if status != OK or l.state.bare == 1:
        return status
    return _prepare_accelerations(graph, system, w, f, l, False)


@callback(PLACE)
def stage_place(context, t, x):
    """Set positions of an explicit stage from x (8 b,): poses where the sums put them, H, factors of S. Status."""
    c = load(context)
    system, w, f, l, graph = c.system, c.work, c.tangent, c.chart, c.graph
    w.counters.placements += 1
    l.state.time, l.state.factored, l.state.free = t, 0, 1
    if not set_time(system, t):
        return NOT_FINITE
    # (rho, eta) = x: u, of the order of truncation, stays; the end of the step takes it off
    copy(vector(x, l.x.size - 8), l.x)
    if not displace(graph, l, f.poses):
        return CHART_LOST
    # H there
    if f.b.size > 0:
        evaluate_rows(graph, system, f, f.rows, t)
    # With joint friction another matrix is factorised
    if graph.frictions.shape[0] > 0:
        weigh_selected_rows(graph, f.rows)
        write_positions(graph.bodies, f.poses, w.q)
        return OK
    return _prepare_accelerations(graph, system, w, f, l, f.b.size > 0)


@kernel
def _prepare_accelerations(graph, system, w, f, l, later):
    """Factors of S = H W H^T at the poses, or S alone, to be factored `later`; q for force laws. Status."""
    l.state.formed = 0
    w.counters.factorizations += 1 if f.b.size > 0 else 0
    if later:
        form_selected_rows(graph, f, f.rows, DYNAMICS)
        l.state.formed = 1
    elif f.b.size > 0:
        failed = factorise_selected_rows(graph, f, f.rows, DYNAMICS)
        if failed >= 0:
            return _singular(graph, f, failed)
    if system.forces.shape[0] > 0:
        write_positions(graph.bodies, f.poses, w.q)
    return OK


@kernel
def _singular(graph, f, failed):
    """The Status of a row of S that fails."""
    return MASS_SINGULAR if is_axis(graph, f.rows, failed) else SINGULAR


@kernel
def _solve_positions(graph, system, w, f, l, t, x, renewals):  # eight: as of `place`, its coordinates and a limit
    """Newton's method for u with N of the start, factorised again `renewals` times at most; poses and H there. Status.

    Stops when |Phi|, measured or extrapolated from the convergence rate, is below u_tol^(3/2) or rounding. H is
    evaluated with Phi in a sweep that is expected to be the last one.
    """
    floor = w.control.floor
    tol = max(w.control.u_tol, floor)
    goal = max(tol * math.sqrt(tol), floor)
    # |Phi| of the last sweep; contraction by the present factors of N, zero until it is measured
    before, rate, with_H = math.inf, 0.0, True
    l.state.factored = 0
    for sweep in range(SWEEPS):
        if not displace(graph, l, f.poses):
            return CHART_LOST
        if f.b.size == 0:
            return OK
        if with_H:
            evaluate_rows(graph, system, f, f.rows, t)
        else:
            evaluate_residuals(graph, system, f, t)
        add_rate_residuals(graph, f, l, x)
        worst = largest_residual(graph, f, w.control.floor)
        if not worst < math.inf:
            return NOT_FINITE
        slow = worst > SLOW * before
        # Solved, or as close as rounding allows
        if worst <= goal or (slow and worst <= ROUNDING_AT_MOST * floor):
            if not with_H:
                _add_rows(graph, system, f, l, t, x)
            elif sweep == 0:
                w.counters.at_rounding += 1
            else:
                w.counters.unverified += 1
            return OK
        if slow:
            # N is of a configuration too far away: factorise it here
            renewals -= 1
            if renewals < 0:
                return NEWTON_FAILED
            if not with_H:
                _add_rows(graph, system, f, l, t, x)
            l.state.factored = 0
        elif before < math.inf:
            # The first sweep with new factors measures the curvature |Phi| / |Phi before|^2, later sweeps measure the
            # rate
            if worst > ROUNDING_AT_MOST * floor and rate == 0.0:
                w.control.rate = worst / (before * before)
            rate = worst / before
        if l.state.factored == 0:
            if not factorise_normal(graph, w, f, l):
                return SINGULAR
            l.state.factored, l.state.off, rate = 1, w.control.rate * worst, 0.0
        # u <- u + N^-1 Phi,  x <- x - Y0 N^-1 Phi
        solve_product(graph, l.lower, l.upper, f.b)
        w.counters.newton += 1
        apply_multipliers(graph, l.rows0, f.b, l.x)
        for e in range(f.b.size):
            w.u[e] += f.b[e]
        expected = worst * (rate if rate > 0.0 else w.control.rate * worst)
        with_H, before = expected <= goal, worst
    return NEWTON_FAILED


@long_kernel
def _add_rows(graph, system, f, l, t, x):
    """H where only Phi was evaluated: seldom needed, so not inlined."""
    evaluate_rows(graph, system, f, f.rows, t)
    add_rate_residuals(graph, f, l, x)


@kernel
def solve_velocities(graph, system, w, f, l, t):
    """rd and omega' of the poses from the rates l.y, projected onto the tangent space. False if N is singular.

    The factors are those of N at the start of the position solve, or, where it needed none, those of S as long as they
    do.
    """
    # Residual of Eq. 2: H (rd, omega') + Phi_t
    rheonomic = is_rheonomic(system)
    if rheonomic:
        evaluate_drift(graph, system, f, t, l.drift)
    factored = l.state.factored == 1
    if not factored and is_raised(graph):  # S is of another metric than the chart
        if not factorise_normal(graph, w, f, l):
            return False
        factored, l.state.factored, l.state.off = True, 1, 0.0
    # N where the position solve has factorised it; otherwise S, which is close to N near the base point
    lower, upper = l.lower if factored else f.rows.S, l.upper if factored else f.rows.S
    floor, before = 0.0, math.inf
    for sweep in range(SWEEPS):
        turn_rates(graph, l, l.y, f.poses)
        if f.b.size == 0:
            return True
        # Rounding of Eq. 2 at these rates
        if sweep == 0:
            floor = velocity_floor(graph, w, f)
        multiply_rates(graph, f.rows, f.poses, f.b)
        if rheonomic:
            for e in range(f.b.size):
                f.b[e] += l.drift[e]
        worst = largest_residual(graph, f, w.control.floor)
        if not worst < math.inf:
            return False
        # Rounding; factors of S get no credit for a residual that has stopped falling
        if worst <= floor or (factored and worst > STALLED * before and worst <= ROUNDING_AT_MOST * floor):
            w.counters.kept += 0 if factored else 1
            return True
        # S is too far from N
        if not factored and worst > SLOW_FACTORS * before:
            if not factorise_normal(graph, w, f, l):
                return False
            lower, upper, factored = l.lower, l.upper, True
            l.state.factored, l.state.off = 1, 0.0
        # yd <- yd - Y0 N^-1 (H (rd, omega') + Phi_t)
        solve_product(graph, lower, upper, f.b)
        apply_multipliers(graph, l.rows0, f.b, l.y)
        before = worst
    return True


@callback(ACCELERATE)
def accelerate(context, t, y, yd, unused):
    """Set velocities from y (8 b,) at the current position: velocities, accelerations and y'. Status."""
    c = load(context)
    system, w, f, l, graph = c.system, c.work, c.tangent, c.chart, c.graph
    n = l.x.size - 8
    yd = vector(yd, n)
    copy(vector(y, n), l.y)
    if not solve_velocities(graph, system, w, f, l, t):
        return NOT_FINITE
    if l.state.bare == 0:
        return _accelerate(context, c, t, yd)
    if f.b.size > 0:
        evaluate_bias(graph, system, f, t)
    return OK


@callback(ACCELERATE)
def stage_accelerate(context, t, y, yd, unused):
    """As `accelerate`, with the velocities of an explicit stage where the sums put them."""
    c = load(context)
    n = c.chart.x.size - 8
    # (rhod, etad) = xd: z stays, as u does
    copy(vector(y, n), c.chart.y)
    turn_rates(c.graph, c.chart, c.chart.y, c.tangent.poses)
    return _accelerate(context, c, t, vector(yd, n))


@kernel
def _accelerate(context, c, t, yd):
    """Accelerations and y' at the present poses and their velocities. Status."""
    system, w, f, l, graph = c.system, c.work, c.tangent, c.chart, c.graph
    # Force laws read q and qd
    if system.forces.shape[0] > 0:
        write_velocities(graph.bodies, f.poses, w.qd)
    # Friction depends on reactions: solved for with them
    if graph.frictions.shape[0] > 0:
        status = call_friction(graph.friction_solver[0], context, t, yd)
        if status != OK:
            return status
    else:
        if l.state.formed == 1:
            l.state.formed = 0
            failed = factorise_for_accelerations(graph, system, w, f, t)
            if failed >= 0:
                return _singular(graph, f, failed)
        else:
            solve_accelerations(graph, system, w, f, t)
        if refinements(f.indicator.start) > 1:
            refine_accelerations(graph, f)
    # (rdd, omega'd) as xdd
    write_back(graph, l, f.poses, f.Z, yd)
    w.counters.evaluations += 1
    return OK if is_finite(yd) else NOT_FINITE


@callback("pp")
def complete(context, yd):
    """Write q, qd and qdd after `accelerate`, the accelerations refined by H (rdd, omega'd) + gamma."""
    c = load(context)
    write_state(c.graph, c.work, c.tangent)
    return OK


@kernel
def write_state(graph, w, f):
    """Write q, qd and qdd of the poses and of accelerations Z, projected onto H (rdd, omega'd) + gamma = 0."""
    refine_accelerations(graph, f)
    write_positions(graph.bodies, f.poses, w.q)
    write_velocities(graph.bodies, f.poses, w.qd)
    write_accelerations(graph.bodies, f.poses, f.Z, w.qdd)


@callback("p")
def check(context):
    """Return the reason to abandon the chart, or zero; negative, a Status, where the state can't be taken."""
    return check_chart(load(context))


@kernel
def check_chart(c):
    """As `check`."""
    w, f, l = c.work, c.tangent, c.chart
    reason = reason_to_leave(c.graph, w, f, l)
    return reason if every_level_holds(c) else -UNHELD


@callback("pdpppp")
def start_chart(context, t, x, y, yd, unused):
    """Make a chart at the present q: x = 0, y = (rd, omega'), y' = (rdd, omega'd). Status."""
    c = load(context)
    system, w, f, l, graph = c.system, c.work, c.tangent, c.chart, c.graph
    if not set_time(system, t):
        return NOT_FINITE
    # q0, H0, Y0, S0
    regular = set_base_point(graph, system, w, f, l, t, largest_coordinate(graph.bodies, w.q, w.control.size))
    # At q0 rates of chart coordinates are (rd, omega'), their derivatives (rdd, omega'd)
    x, y, yd = vector(x, l.x.size - 8), vector(y, l.x.size - 8), vector(yd, l.x.size - 8)
    for j in range(x.size):
        x[j] = 0.0
    for e in range(w.u.size):
        w.u[e] = 0.0
    w.control.rate = CURVATURE
    for b in range(graph.bodies.shape[0]):
        i, o = graph.bodies[b, 0], 8 * b
        for k in range(3):
            y[o + k], yd[o + k] = w.qd[i + k], w.qdd[i + k]
        if graph.bodies[b, 1] == 7:
            _spin(w.q, w.qd, i + 3, y, o + 4)
            _spin(w.q, w.qdd, i + 3, yd, o + 4)
    if not regular:
        return SINGULAR
    return OK if redundant_rows_hold(graph, f, w.control.floor) else UNHELD


@kernel
def _spin(q, qd, i, out, o):
    """out[o : o + 3] = 2 G pd / p.p, p.p - 1 being exact to rounding of itself: over many charts a bias adds up."""
    e0, e1, e2, e3 = q[i], q[i + 1], q[i + 2], q[i + 3]
    d0, d1, d2, d3 = qd[i], qd[i + 1], qd[i + 2], qd[i + 3]
    excess, low = -1.0, 0.0
    for c in range(4):
        e = q[i + c]
        wide = SPLIT * e  # Dekker: e in two halves, so that their products are exact
        high = wide - (wide - e)
        rest = e - high
        square = e * e
        low += ((high * high - square) + 2.0 * high * rest) + rest * rest
        total = excess + square
        part = total - excess
        low += (excess - (total - part)) + (square - part)
        excess = total
    f = 2.0 * (excess + low)
    # 2 G pd (2 - p.p), since 1 / p.p = 2 - p.p to first order
    x = -e1 * d0 + e0 * d1 + e3 * d2 - e2 * d3
    y = -e2 * d0 - e3 * d1 + e0 * d2 + e1 * d3
    z = -e3 * d0 + e2 * d1 - e1 * d2 + e0 * d3
    out[o], out[o + 1], out[o + 2] = 2.0 * x - f * x, 2.0 * y - f * y, 2.0 * z - f * z
