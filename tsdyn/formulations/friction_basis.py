"""Coupled friction and reactions in the null-space form: accelerations and multipliers are linear in the normal loads.

    vdd = vdd_0 + sum_i a_i F_n,i    a_i = (D^T M D)^-1 D^T g_i
    lam = lam_0 + sum_i l_i F_n,i    l_i = B^T U^T (g_i - M D a_i),   lam_0 = B^T U^T (Q_A + Q_v - M qdd_0)
    F_n,i = F_n,i(lam)               Newton's method, started from the loads of the previous evaluation

g_i is the generalised friction force for unit normal load; index 0 marks the solution without friction.
"""

import math

from ..errors import Status
from ..jit.kernels import callback, kernel, stack, vector
from ..maths.dense_linalg import cholesky_solve, copy, largest, lu, lu_solve
from ..maths.euler_parameters import multiply_g
from ..workspaces.workspace import load
from .friction_loads import SOLVE_FRICTION, body_of, has_converged, normal_load, step_share, unit_friction
from .tolerances import BASIS_LOAD_ROUNDING, LOAD_SWEEPS

OK, JAMMED = int(Status.SUCCESS), int(Status.JAMMED)


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
def _subtract_inertia(system, q, x, out):
    """out -= M x."""
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        # m x on r, 4 G^T J' G x on p
        for c in range(at, at + 3):
            out[c] -= system.mass[b] * x[c]
        if system.bodies[b, 1] == 7:
            p = q[at + 3 : at + 7]
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
    """lam_0 and, for each friction, a_i and l_i."""
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
    _subtract_inertia(system, w.q, x, left)
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
        _subtract_inertia(system, w.q, x, left)
        _multipliers(w, left, r.basis[i, n : n + m])


@kernel
def _find_load(graph, system, w, friction, lam, t, out, by_row):
    """out (7,) as of friction_solve.normal_load, and by_row (m,) its derivative by the multipliers, of its own rows."""
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
            normal_load(system, friction, w.q, w.qd, t, 1, reaction, out)


@callback(SOLVE_FRICTION)
def solve_friction(context, t, vdd):
    """Add joint friction to vdd. Status."""
    c = load(context)
    system, w, f, graph = c.system, c.work, c.tangent, c.graph
    r, n, m, frictions = f.friction, w.q.size, w.Phi.size, c.graph.frictions.shape[0]
    k = w.v.size
    vdd = vector(vdd, k)
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
            _find_load(graph, system, w, friction, lam, t, r.load[7 * i :], by_row)
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
        done = has_converged(change, before, share, sweep, BASIS_LOAD_ROUNDING * size)
        before = change
    # vdd += sum_i a_i F_n,i
    for i in range(frictions):
        N = loads[i]
        r.load[7 * i] = system.reals[system.normals[i]] = N
        for j in range(k):
            vdd[j] += r.basis[i, j] * N
    return OK if done else JAMMED
