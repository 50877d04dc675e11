"""The null-space form of the tangent-space ODE, with U, V, B and D (Haug 2018, Eqs. 19-29).

    q   = q0 + V v - U u                                             Eq. 19
    qd  = D vd - U B Phi_t                                           Eq. 23
    D^T M D vdd = D^T (M U B gamma + Q_A + Q_v)                      Eq. 26
    qdd = D vdd - U B gamma                                          Eq. 24

M_r = m I and M_p = 4 G^T J' G give D^T M D = sum m D_r^T D_r + E^T J' E with E = 2 G D_p, the body's angular velocity
per vd; Q_v = 8 Gd^T J' Gd p on p (S in the paper).
"""

import math

from ..elements.loops.body_poses import move_bodies, place_bodies
from ..errors import Status
from ..jit.kernels import callback, kernel, vector
from ..maths.dense_linalg import cholesky, cholesky_solve, is_finite, transposed_times
from ..methods.explicit import ACCELERATE, NORM, PLACE
from ..model.equations import applied_forces, is_rheonomic, set_time
from ..rows.interface import evaluate_bias, evaluate_drift, evaluate_rows, has_redundant_rows, redundant_rows_hold
from ..workspaces.workspace import load
from .chart_validity import every_level_holds, measure_turns, reason_to_leave
from .dense_rows import correct, evaluate_dense_bias, evaluate_dense_drift, multiply_dense_row
from .friction_loads import call_friction, forget_loads
from .newton_iterations import NOT_FINITE, OK, solve_positions
from .null_space_chart import new_chart, tangent_map
from .tolerances import MASS_PIVOT

MASS_SINGULAR, UNHELD = int(Status.MASS_SINGULAR), int(Status.UNHELD)


@kernel
def reduced_mass(system, w):
    """E and the Cholesky factor of D^T M D at the present q. Status."""
    k = w.v.size
    for i in range(k):
        for j in range(i + 1):
            w.A[i, j] = 0.0
    for b in range(system.mass.size):
        at, mass = system.bodies[b, 0], system.mass[b]
        # D^T M D += m D_r^T D_r
        for c in range(at, at + 3):
            for i in range(k):
                f = mass * w.D[c, i]
                if f != 0.0:
                    for j in range(i + 1):
                        w.A[i, j] += f * w.D[c, j]
        if system.bodies[b, 1] == 7:
            e0, e1, e2, e3 = 2.0 * w.q[at + 3], 2.0 * w.q[at + 4], 2.0 * w.q[at + 5], 2.0 * w.q[at + 6]
            x, y, z = w.E[3 * b], w.E[3 * b + 1], w.E[3 * b + 2]
            d0, d1, d2, d3 = w.D[at + 3], w.D[at + 4], w.D[at + 5], w.D[at + 6]
            # E = 2 G D_p
            for j in range(k):
                x[j] = -e1 * d0[j] + e0 * d1[j] + e3 * d2[j] - e2 * d3[j]
                y[j] = -e2 * d0[j] - e3 * d1[j] + e0 * d2[j] + e1 * d3[j]
                z[j] = -e3 * d0[j] + e2 * d1[j] - e1 * d2[j] + e0 * d3[j]
            J = system.inertia[b]
            # D^T M D += E^T J' E
            for i in range(k):
                f = J[0] * x[i] + J[1] * y[i] + J[2] * z[i]
                g = J[3] * x[i] + J[4] * y[i] + J[5] * z[i]
                h = J[6] * x[i] + J[7] * y[i] + J[8] * z[i]
                for j in range(i + 1):
                    w.A[i, j] += f * x[j] + g * y[j] + h * z[j]
    w.counters.factorizations += 1
    return OK if cholesky(w.A, k, MASS_PIVOT) else MASS_SINGULAR


@kernel
def velocities(system, w, t, vd):
    """qd = D vd - U B Phi_t, Eq. 23."""
    n, k = w.q.size, vd.size
    for i in range(n):
        x = 0.0
        for j in range(k):
            x += w.D[i, j] * vd[j]
        w.qd[i] = x
    if is_rheonomic(system):
        evaluate_dense_drift(system, w, t)
        correct(w, w.Phi_t, w.qd)


@kernel
def _refine_velocities(system, w):
    """qd -= U B (Phi_q qd + Phi_t)."""
    driven = is_rheonomic(system)
    # B of Eq. 28 is exact to its tolerance: one correction leaves rounding of Eq. 2
    for i in range(w.Phi.size):
        w.Phi[i] = (w.Phi_t[i] if driven else 0.0) + multiply_dense_row(system, w, i, w.qd)
    correct(w, w.Phi, w.qd)


@kernel
def reduced_acceleration(system, w, t, vdd):
    """vdd of Eq. 26 at the present q and qd. Status."""
    n, k = w.q.size, vdd.size
    evaluate_dense_bias(system, w, t)
    for i in range(n):
        w.h[i] = 0.0
    # h = -U B gamma, what qdd is at vdd = 0
    correct(w, w.gamma, w.h)
    for j in range(k):
        vdd[j] = 0.0
    for b in range(system.mass.size):
        at, mass = system.bodies[b, 0], system.mass[b]
        # vdd += D_r^T m (g - h_r)
        for c in range(3):
            f = mass * (system.gravity[c] - w.h[at + c])
            for j in range(k):
                vdd[j] += f * w.D[at + c, j]
        if system.bodies[b, 1] == 7:
            e0, e1, e2, e3 = w.q[at + 3], w.q[at + 4], w.q[at + 5], w.q[at + 6]
            d0, d1, d2, d3 = w.qd[at + 3], w.qd[at + 4], w.qd[at + 5], w.qd[at + 6]
            a0, a1, a2, a3 = -2.0 * w.h[at + 3], -2.0 * w.h[at + 4], -2.0 * w.h[at + 5], -2.0 * w.h[at + 6]
            J = system.inertia[b]
            # 2 G (U B gamma)_p
            x = -e1 * a0 + e0 * a1 + e3 * a2 - e2 * a3
            y = -e2 * a0 - e3 * a1 + e0 * a2 + e1 * a3
            z = -e3 * a0 + e2 * a1 - e1 * a2 + e0 * a3
            f0 = J[0] * x + J[1] * y + J[2] * z
            f1 = J[3] * x + J[4] * y + J[5] * z
            f2 = J[6] * x + J[7] * y + J[8] * z
            # Gd p
            x = -d1 * e0 + d0 * e1 + d3 * e2 - d2 * e3
            y = -d2 * e0 - d3 * e1 + d0 * e2 + d1 * e3
            z = -d3 * e0 + d2 * e1 - d1 * e2 + d0 * e3
            g0 = 8.0 * (J[0] * x + J[1] * y + J[2] * z)
            g1 = 8.0 * (J[3] * x + J[4] * y + J[5] * z)
            g2 = 8.0 * (J[6] * x + J[7] * y + J[8] * z)
            # Q_v on p, 8 Gd^T J' Gd p
            s0 = -d1 * g0 - d2 * g1 - d3 * g2
            s1 = d0 * g0 - d3 * g1 + d2 * g2
            s2 = d3 * g0 + d0 * g1 - d1 * g2
            s3 = -d2 * g0 + d1 * g1 + d0 * g2
            # vdd += E^T J' 2 G (U B gamma)_p + D_p^T Q_v
            for j in range(k):
                vdd[j] += (
                    f0 * w.E[3 * b, j]
                    + f1 * w.E[3 * b + 1, j]
                    + f2 * w.E[3 * b + 2, j]
                    + s0 * w.D[at + 3, j]
                    + s1 * w.D[at + 4, j]
                    + s2 * w.D[at + 5, j]
                    + s3 * w.D[at + 6, j]
                )
    if system.forces.shape[0] > 0:
        for c in range(n):
            w.Q[c] = 0.0
        applied_forces(system, w.q, w.qd, t, w.Q)
        # vdd += D^T Q_A
        for c in range(n):
            f = w.Q[c]
            if f != 0.0:
                for j in range(k):
                    vdd[j] += f * w.D[c, j]
    # vdd <- (D^T M D)^-1 vdd
    cholesky_solve(w.A, vdd, k)
    w.counters.evaluations += 1
    return OK if is_finite(vdd[:k]) else NOT_FINITE


@kernel
def frictional_acceleration(context, c, t, vdd):
    """`reduced_acceleration`, then what the frictions of joints change. Status."""
    system, graph = c.system, c.graph
    frictions = graph.frictions.shape[0] > 0
    if frictions:
        forget_loads(system)
    status = reduced_acceleration(system, c.work, t, vdd)
    return call_friction(graph.friction_solver[0], context, t, vdd) if frictions and status == OK else status


@callback(PLACE)
def place(context, t, v):
    """Set positions from v: q, Phi_q, B, D and the factor of D^T M D. Status."""
    c = load(context)
    system, w = c.system, c.work
    w.counters.placements += 1
    c.chart.state.time = t
    if not set_time(system, t):
        return NOT_FINITE
    # Eqs. 19, 20 and 29
    status = solve_positions(system, w, t, vector(v, w.v.size))
    if status == OK:
        # Eqs. 7, 9 and 28 at the new q
        status = tangent_map(system, w, t)
    return reduced_mass(system, w) if status == OK else status


@callback(ACCELERATE)
def accelerate(context, t, vd, vdd, unused):
    """Set velocities from vd at the current position: qd and vdd. Status."""
    c = load(context)
    system, w = c.system, c.work
    velocities(system, w, t, vector(vd, w.v.size))
    _refine_velocities(system, w)
    return frictional_acceleration(context, c, t, vector(vdd, w.v.size))


@callback("pp")
def complete(context, vdd):
    """Accelerations qdd after `accelerate`."""
    c = load(context)
    find_accelerations(c.system, c.work, vector(vdd, c.work.v.size))
    return OK


@kernel
def find_accelerations(system, w, vdd):
    """Accelerations qdd = D vdd - U B gamma, Eq. 24, refined once by Phi_q qdd + gamma."""
    # Eq. 24, h = -U B gamma
    for i in range(w.q.size):
        x = w.h[i]
        for j in range(vdd.size):
            x += w.D[i, j] * vdd[j]
        w.qdd[i] = x
    # qdd <- qdd - U B (Phi_q qdd + gamma)
    for i in range(w.gamma.size):
        x = w.gamma[i]
        for part in range(0, 4, 2):
            begin = system.segments[i, part]
            for j in range(begin, begin + system.segments[i, part + 1]):
                x += w.Phi_q[i, j] * w.qdd[j]
        w.Phi[i] = x
    correct(w, w.Phi, w.qdd)


@callback("p")
def check(context):
    """Return the reason to abandon the chart, or zero; negative, a Status, where the state can't be taken."""
    c = load(context)
    w, f, graph = c.work, c.tangent, c.graph
    reason = check_validity(c)
    # The sparse rows of the basis-free form know which rows are dropped and judge them
    if has_redundant_rows(f):
        move_bodies(graph.bodies, w.q, w.qd, f.poses)
        evaluate_bias(graph, c.system, f, c.chart.state.time)
        if is_rheonomic(c.system):
            evaluate_drift(graph, c.system, f, c.chart.state.time, c.chart.drift)
        if not every_level_holds(c):
            return -UNHELD
    return reason


@kernel
def check_validity(c):
    """Return the reason to abandon the chart at the present q, or zero."""
    w, f, l, graph = c.work, c.tangent, c.chart, c.graph
    place_bodies(graph.bodies, w.q, f.poses)
    measure_turns(graph, l, w.q)
    evaluate_rows(graph, c.system, f, f.rows, l.state.time)
    return reason_to_leave(graph, w, f, l)


@kernel
def weighted_square(w, values, at, e, old, rtol, atol):
    """((V e)_i / (atol + rtol |value|))^2 summed over the coordinates; old begins at old[at]."""
    total = 0.0
    for i in range(values.size):
        # A change e of tangent coordinates displaces q by V e at the base point
        x = 0.0
        for j in range(e.size):
            x += w.V[i, j] * e[j]
        x /= atol + rtol * max(abs(values[i]), abs(old[at + i]))
        total += x * x
    return total


@callback(NORM, "d")
def error_norm(context, ev, evd, old, rtol, atol):
    """Root mean square of the errors V ev of q and V evd of qd, over atol + rtol times the larger end of the step."""
    w = load(context).work
    n, k = w.q.size, w.v.size
    old = vector(old, 3 * n)
    total = weighted_square(w, w.q, 0, vector(ev, k), old, rtol, atol)
    total += weighted_square(w, w.qd, n, vector(evd, k), old, rtol, atol)
    return math.sqrt(total / (2 * n))


@callback("pdpppp")
def start_chart(context, t, v, vd, vdd, unused):
    """Make a chart at the present q; v = 0, vd = V^T P0 qd, vdd = V^T P0 qdd, Eq. 27. Status."""
    c = load(context)
    system, w = c.system, c.work
    set_time(system, t)
    status = new_chart(c.graph, system, w, c.tangent, c.chart, t)
    k = w.v.size
    v = vector(v, k)
    for j in range(k):
        v[j] = 0.0
    project(w, vector(vd, k), vector(vdd, k))
    return UNHELD if status == OK and not redundant_rows_hold(c.graph, c.tangent, w.control.floor) else status


@kernel
def project(w, vd, vdd):
    """vd = V^T P0 qd and vdd = V^T P0 qdd."""
    transposed_times(w.L, w.qd, vd)
    transposed_times(w.L, w.qdd, vdd)
