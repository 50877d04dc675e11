"""The null-space form of the tangent-space ODE, with U, V, B and D (Haug 2018, Eqs. 19-29); coupled friction."""

import math

from ..elements.loops.constraint_rows import move_bodies, place_bodies
from ..elements.loops.friction import DERIVE, HERE
from ..errors import Status
from ..jit.kernels import callback, kernel, stack, vector
from ..maths.dense_linalg import (
    cholesky,
    cholesky_solve,
    copy,
    is_finite,
    largest,
    lu,
    lu_solve,
    transposed_times,
)
from ..maths.tolerances import LAST_PLACE, SUM_ROUNDING
from ..maths.vectors import multiply_g
from ..methods.explicit import ACCELERATE, NORM, NORMAL, PLACE
from ..model.equations import (
    add_inertia_row,
    applied_forces,
    inertia_bias,
    inertia_rows,
    is_rheonomic,
    multiply_inertia_row,
    set_time,
)
from ..rows.interface import evaluate_bias, evaluate_drift, evaluate_rows, has_redundant_rows, redundant_rows_hold
from ..workspaces import load
from .accelerations import (
    SOLVE_FRICTION,
    body_of,
    call_friction,
    forget_loads,
    has_converged,
    normal_load,
    step_share,
    unit_friction,
)
from .charts import every_level_holds, measure_turns, reason_to_leave
from .null_space_chart import (
    NOT_FINITE,
    OK,
    correct,
    evaluate_dense_bias,
    evaluate_dense_drift,
    multiply_dense_row,
    new_chart,
    solve_positions,
    tangent_map,
)
from .tolerances import LOAD_SWEEPS

# Coupled friction and reactions in the null-space form: accelerations and multipliers are linear in the normal loads.
#
#     vdd = vdd_0 + sum_i a_i F_n,i    a_i = (D^T M D)^-1 D^T g_i
#     lam = lam_0 + sum_i l_i F_n,i    l_i = B^T U^T (g_i - M D a_i),   lam_0 = B^T U^T (Q_A + Q_v - M qdd_0)
#     F_n,i = F_n,i(lam)               Newton's method, started from the loads of the previous evaluation
#
# g_i is the generalised friction force for unit normal load; index 0 marks the solution without friction.

JAMMED = int(Status.JAMMED)


@kernel
def _add_momentum(system, b, p, x, y, scale, out):
    """out += scale G(p)^T J' G(x) y of body b; out (4,)."""
    w, J = stack(3), system.inertia[b]
    # h = scale J' G(x) y, then G(p)^T h
    multiply_g(x, y, w)
    h0 = scale * (J[0] * w[0] + J[1] * w[1] + J[2] * w[2])
    h1 = scale * (J[3] * w[0] + J[4] * w[1] + J[5] * w[2])
    h2 = scale * (J[6] * w[0] + J[7] * w[1] + J[8] * w[2])
    out[0] += -p[1] * h0 - p[2] * h1 - p[3] * h2
    out[1] += p[0] * h0 - p[3] * h1 + p[2] * h2
    out[2] += p[3] * h0 + p[0] * h1 - p[1] * h2
    out[3] += -p[2] * h0 + p[1] * h1 + p[0] * h2


@kernel
def _subtract_inertia(system, w, x, moving, out):
    """out -= M x, and h^T (h x + gamma_h) of inertia rows, gamma_h where x are accelerations (1) and none (0)."""
    for e in range(w.inertia_bias.size):
        f = moving * w.inertia_bias[e] + multiply_inertia_row(system, w.inertia, e, x)
        add_inertia_row(system, w.inertia, e, -f, out)
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        # m x on r, 4 G^T J' G x on p
        for c in range(at, at + 3):
            out[c] -= system.mass[b] * x[c]
        if system.bodies[b, 1] == 7:
            p = w.q[at + 3 : at + 7]
            _add_momentum(system, b, p, p, x[at + 3 : at + 7], -4.0, out[at + 3 : at + 7])


@kernel
def _multipliers(w, r, out):
    """out = B^T U^T r."""
    m = out.size
    # z = U^T r
    for i in range(m):
        x = 0.0
        for c in range(r.size):
            x += w.U[c, i] * r[c]
        w.z[i] = x
    # B^T z
    for j in range(m):
        x = 0.0
        for i in range(m):
            x += w.B[i, j] * w.z[i]
        out[j] = x


@kernel
def _expand(w, vdd, out):
    """out += D vdd."""
    for c in range(out.size):
        for j in range(vdd.size):
            out[c] += w.D[c, j] * vdd[j]


@kernel
def _find_bases(graph, system, w, f, t, vdd):
    """lam_0 without friction; a_i and l_i, accelerations and multipliers by a unit normal load of friction i."""
    r, n, m, k = f.friction, w.q.size, w.Phi.size, vdd.size
    lam, left, x, Q = r.numbers[:m], r.numbers[2 * m : 2 * m + n], r.numbers[2 * m + n : 2 * m + 2 * n], stack(14)
    # lam_0 = B^T U^T (Q_A + Q_v - M qdd_0),    qdd_0 = D vdd - U B gamma
    copy(w.h, x)
    _expand(w, vdd, x)
    copy(w.Q, left)
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        for c in range(3):
            left[at + c] += system.mass[b] * system.gravity[c]
        if system.bodies[b, 1] == 7:
            pd = w.qd[at + 3 : at + 7]
            _add_momentum(system, b, pd, pd, w.q[at + 3 : at + 7], 8.0, left[at + 3 : at + 7])
    _subtract_inertia(system, w, x, 1.0, left)
    _multipliers(w, left, lam)
    # a_i = (D^T M D)^-1 D^T g_i,    l_i = B^T U^T (g_i - M D a_i)
    for i in range(graph.frictions.shape[0]):
        friction, a = graph.frictions[i], r.basis[i, :k]
        unit_friction(system, friction, w.q, w.qd, t, Q)
        for c in range(n):
            left[c] = x[c] = 0.0
        for j in range(k):
            a[j] = 0.0
        for side in range(2):
            body = body_of(friction, side)
            if body < system.mass.size:
                at = system.bodies[body, 0]
                for c in range(system.bodies[body, 1]):
                    g = Q[7 * side + c]
                    left[at + c] = g
                    for j in range(k):
                        a[j] += w.D[at + c, j] * g
        cholesky_solve(w.A, a, k)
        _expand(w, a, x)
        _subtract_inertia(system, w, x, 0.0, left)
        _multipliers(w, left, r.basis[i, n : n + m])


@kernel
def _find_load(graph, system, w, f, friction, lam, out, by_row):  # eight: as `normal_load`, and the rows
    """out (7,) as of accelerations.normal_load, and by_row (m,) its derivative by the multipliers, of its own rows."""
    body = body_of(friction, friction.on)
    at, turns = system.bodies[body, 0], system.bodies[body, 1] == 7
    reaction, half, torque = stack(6), stack(4), stack(3)
    for c in range(6):
        reaction[c] = 0.0
    # The normal load needs the whole reaction, its derivative the normal load: two passes over the joint's rows
    for only_sum in range(2):
        for j in range(friction.first, friction.first + friction.count):
            e = graph.row[graph.friction_rows[j, 0]]
            # A unit multiplier exerts -(Phi_r, G Phi_p^T / 2) on the body
            row = w.Phi_q[e]
            for c in range(3):
                torque[c] = 0.0
            if turns:
                for c in range(4):
                    half[c] = 0.5 * row[at + 3 + c]
                multiply_g(w.q[at + 3 : at + 7], half, torque)
            if only_sum == 0:
                for c in range(3):
                    reaction[c] -= row[at + c] * lam[e]
                    reaction[3 + c] -= torque[c] * lam[e]
            else:
                # dF_n / dlam_e = -(F_n,F . Phi_r + F_n,T . G Phi_p^T / 2)
                x = 0.0
                for c in range(3):
                    x -= row[at + c] * out[1 + c] + torque[c] * out[4 + c]
                by_row[e] = x
        if only_sum == 0:
            normal_load(system, f, friction, w.q, DERIVE | HERE, reaction, out)


@kernel
def add_friction(graph, system, w, f, t, vdd):
    """Add joint friction to vdd. Status."""
    r, n, m, frictions = f.friction, w.q.size, w.Phi.size, graph.frictions.shape[0]
    k = w.v.size
    # lam is linear in the loads: lam_0 + sum_j l_j F_n,j
    _find_bases(graph, system, w, f, t, vdd)
    lam_0, lam, by_row = r.numbers[:m], r.numbers[m : 2 * m], w.z
    b, loads = r.numbers[2 * (m + n) :], r.numbers[2 * (m + n) + frictions :]
    # Start: the loads of the last evaluation
    for i in range(frictions):
        loads[i] = r.load[7 * i] if abs(r.load[7 * i]) < math.inf else 0.0
    done, before = False, math.inf
    for sweep in range(LOAD_SWEEPS):
        copy(lam_0, lam)
        for j in range(frictions):
            for e in range(m):
                lam[e] += r.basis[j, n + e] * loads[j]
        if done:
            break
        # Residual F_n,i(lam) - F_n,i;  J_ij = delta_ij - F_n,i,lam . l_j
        for i in range(frictions):
            friction = graph.frictions[i]
            _find_load(graph, system, w, f, friction, lam, r.load[7 * i :], by_row)
            b[i] = r.load[7 * i] - loads[i]
            for j in range(frictions):
                x = 1.0 if i == j else 0.0
                for h in range(friction.first, friction.first + friction.count):
                    row = graph.row[graph.friction_rows[h, 0]]
                    x -= by_row[row] * r.basis[j, n + row]
                r.J[i, j] = x
        if not lu(r.J, r.pivots, frictions):
            return JAMMED
        lu_solve(r.J, r.pivots, b, frictions)
        # A load whose sign alternates is found by half steps
        change, share, size = largest(b[:frictions]), step_share(sweep), 0.0
        if not change < math.inf:
            return JAMMED
        # Converged where the correction is rounding of the largest load
        for i in range(frictions):
            loads[i] += share * b[i]
            size = max(size, abs(loads[i]))
        done = has_converged(change, before, share, sweep, 2.0 * LAST_PLACE * size)
        before = change
    # vdd += sum_i a_i F_n,i
    for i in range(frictions):
        N = loads[i]
        r.load[7 * i] = system.reals[system.normals[i]] = N
        for j in range(k):
            vdd[j] += r.basis[i, j] * N
    return OK if done else JAMMED


@callback(SOLVE_FRICTION)
def solve_friction(context, t, vdd):
    """As `add_friction`."""
    c = load(context)
    return add_friction(c.graph, c.system, c.work, c.tangent, t, vector(vdd, c.work.v.size))


# The null-space form of the tangent-space ODE, with U, V, B and D (Haug 2018, Eqs. 19-29).
#
#     q   = q0 + V v - U u                                             Eq. 19
#     qd  = D vd - U B Phi_t                                           Eq. 23
#     D^T M D vdd = D^T (M U B gamma + Q_A + Q_v)                      Eq. 26
#     qdd = D vdd - U B gamma                                          Eq. 24
#
# M_r = m I and M_p = 4 G^T J' G give D^T M D = sum m D_r^T D_r + E^T J' E with E = 2 G D_p, the body's angular velocity
# per vd; Q_v = 8 Gd^T J' Gd p on p (S in the paper).

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
    # D^T M D += (h D)^T h D of the inertia rows h
    inertia_rows(system, w.q, w.inertia)
    for e in range(w.inertia_bias.size):
        for j in range(k):
            w.inertia_D[e, j] = multiply_inertia_row(system, w.inertia, e, w.D[:, j])
        for i in range(k):
            for j in range(i + 1):
                w.A[i, j] += w.inertia_D[e, i] * w.inertia_D[e, j]
    w.counters.factorizations += 1
    return OK if cholesky(w.A, k, SUM_ROUNDING) else MASS_SINGULAR


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
def refine_velocities(system, w):
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
    # vdd -= (h D)^T (h h_0 + gamma_h), h_0 = -U B gamma
    inertia_bias(system, w.q, w.qd, w.inertia_bias)
    for e in range(w.inertia_bias.size):
        f = w.inertia_bias[e] + multiply_inertia_row(system, w.inertia, e, w.h)
        for j in range(k):
            vdd[j] -= w.inertia_D[e, j] * f
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
def frictional_acceleration(context, c, w, t, vdd):
    """`reduced_acceleration`, then what the frictions of joints change. Status."""
    system, graph = c.system, c.graph
    frictions = graph.frictions.shape[0] > 0
    if frictions:
        forget_loads(system)
    status = reduced_acceleration(system, w, t, vdd)
    return call_friction(graph.friction_solver[0], context, t, vdd) if frictions and status == OK else status


@callback(PLACE)
def place(context, t, v):
    """Set positions from v: q, Phi_q, B, D and the factor of D^T M D. Status."""
    c = load(context)
    status = set_positions(c, t, v)
    return reduced_mass(c.system, c.work) if status == OK else status


@kernel
def set_positions(c, t, v):
    """Set q, Phi_q, B and D from v. Status."""
    system, w = c.system, c.work
    w.counters.placements += 1
    c.chart.state.time = t
    if not set_time(system, t):
        return NOT_FINITE
    # Eqs. 19, 20 and 29
    status = solve_positions(system, w, t, vector(v, w.v.size))
    # Eqs. 7, 9 and 28 at the new q
    return tangent_map(system, w, t) if status == OK else status


@callback(NORMAL)
def normal(context, t, vd, out):
    """out (2 m,) = u and ud at the present q, which dense output starts from."""
    c = load(context)
    put_normal(c, t, vector(vd, c.work.v.size), vector(out, 2 * c.work.u.size))
    return OK


@kernel
def put_normal(c, t, vd, out):
    """u, then ud = T vd + B Phi_t, from Phi(q0 + V v - U u, t) = 0."""
    w, m = c.work, c.work.u.size
    copy(w.u, out)
    if is_rheonomic(c.system):
        evaluate_dense_drift(c.system, w, t)
    for i in range(m):
        x = 0.0
        for j in range(vd.size):
            x += w.T[i, j] * vd[j]
        if is_rheonomic(c.system):
            for j in range(m):
                x += w.B[i, j] * w.Phi_t[j]
        out[m + i] = x


@callback(ACCELERATE)
def accelerate(context, t, vd, vdd, unused):
    """Set velocities from vd at the current position: qd and vdd. Status."""
    c = load(context)
    system, w = c.system, c.work
    velocities(system, w, t, vector(vd, w.v.size))
    refine_velocities(system, w)
    return frictional_acceleration(context, c, w, t, vector(vdd, w.v.size))


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
