"""Linearisation of the tangent-space ODE for implicit methods: exact derivatives of vdd = f(t, v, vd), Eq. 26.

With dq = D dv and, from Eqs. 2 and 3, Phi_q dqd = -G1 dq and Phi_q dqdd = -G2 dq - 2 G1 dqd (G1, G2 as in
constraint_hessians.py), Eq. 4 gives (multipliers drop out because Phi_q D = 0)

    A f_v = -D^T K* D,    A f_vd = D^T C* D,    A = D^T M D
    C* = Q_A,qd + Q_v,qd + 2 M Y,                             Y = U B G1
    K* = (M qdd - Q_v - Q_A)_q + (Phi_q^T lam)_q - M Z + C* Y,  Z = U B G2

One evaluation serves many steps and charts: K* and C* without Q_A,q and Q_A,qd are stored in body frames, the
derivatives of the force laws in corotated frames (forces.py). At the current configuration, `reduce` and
`factorise` form P = A - g C_hat + g^2 K_hat, the iteration matrix of a stage with g = h a_ii.
"""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import callback, kernel, stack, stack2, vector
from ..maths.dense_linalg import (
    add_product,
    add_transposed_product,
    clear_matrix,
    lu,
    lu_solve,
    multiply,
    transposed_times,
)
from ..maths.tolerances import TINY
from ..maths.vectors import matrix_a, matrix_g
from ..model.equations import (
    add_inertia_row,
    applied_forces,
    clear_rows,
    constraint_curvature,
    force_jacobian,
    multiply_inertia_row,
)
from ..workspaces import load
from .null_space import find_accelerations
from .null_space_chart import NOT_FINITE, OK, SINGULAR


class Displacements(NamedTuple):
    """Displacements D dv, and what `project_derivatives` makes of them."""

    D: np.ndarray  # (n, k)
    F: np.ndarray  # (l, k)  in body frames
    X: np.ndarray  # (n, k)  scratch
    X2: np.ndarray  # (n, k)  scratch
    K_hat: np.ndarray  # (velocities, k)


@kernel
def _transposed_product(G, J, X, scale, out):
    """out += scale G^T J X (4, 4); G and X (3, 4), J (9,)."""
    for i in range(4):
        for j in range(4):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += G[a, i] * J[3 * a + b] * X[b, j]
            out[i, j] += scale * total


@kernel
def _crossed(h, scale, out):
    """out += scale H, where H p = G(p)^T h."""
    # H = [0, -h^T; h, -h~]
    for i in range(3):
        out[0, 1 + i] -= scale * h[i]
        out[1 + i, 0] += scale * h[i]
    out[1, 2] += scale * h[2]
    out[1, 3] -= scale * h[1]
    out[2, 1] -= scale * h[2]
    out[2, 3] += scale * h[0]
    out[3, 1] += scale * h[1]
    out[3, 2] -= scale * h[0]


@kernel
def _moment(G, J, p, out):
    """out = J G p (3,)."""
    x = stack(3)
    for a in range(3):
        x[a] = G[a, 0] * p[0] + G[a, 1] * p[1] + G[a, 2] * p[2] + G[a, 3] * p[3]
    for a in range(3):
        out[a] = J[3 * a] * x[0] + J[3 * a + 1] * x[1] + J[3 * a + 2] * x[2]


@kernel
def _inertia_terms(system, w, linear):
    """Add gravity + Q_v - M qdd to r, (M qdd - Q_v)_q to K, Q_v,qd to C; on p, Q_v = 8 Gd^T J' Gd p, M = 4 G^T J' G."""
    G, Gd, Gdd, h, g = stack2(3, 4), stack2(3, 4), stack2(3, 4), stack(3), stack(3)
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        # m (g - rdd)
        for c in range(3):
            linear.r[at + c] += system.mass[b] * (system.gravity[c] - w.qdd[at + c])
        if system.bodies[b, 1] == 7:
            p, pd, pdd, J = w.q[at + 3 : at + 7], w.qd[at + 3 : at + 7], w.qdd[at + 3 : at + 7], system.inertia[b]
            # 8 Gd^T J' Gd p - 4 G^T J' G pdd
            matrix_g(p, G)
            matrix_g(pd, Gd)
            matrix_g(pdd, Gdd)
            _moment(G, J, pdd, h)
            _moment(Gd, J, p, g)
            for i in range(4):
                total = 0.0
                for a in range(3):
                    total += 8.0 * Gd[a, i] * g[a] - 4.0 * G[a, i] * h[a]
                linear.r[at + 3 + i] += total
            # By p, with h = J' G pdd and G pdd = -Gdd p:  4 (G^T h)_p - 8 Gd^T J' Gd
            K, C = linear.K[at + 3 : at + 7, at + 3 : at + 7], linear.C[at + 3 : at + 7, at + 3 : at + 7]
            _crossed(h, 4.0, K)
            _transposed_product(G, J, Gdd, -4.0, K)
            _transposed_product(Gd, J, Gd, -8.0, K)
            # By pd, with g = J' Gd p and Gd p = -G pd:  8 (Gd^T g)_pd
            _crossed(g, 8.0, C)
            _transposed_product(Gd, J, G, -8.0, C)


@kernel
def _inertia_rows(system, w, linear):
    """Subtract h^T (h qdd + gamma_h) of the inertia rows from r; its change with h and gamma_h is neglected."""
    for e in range(w.inertia_bias.size):
        f = w.inertia_bias[e] + multiply_inertia_row(system, w.inertia, e, w.qdd)
        add_inertia_row(system, w.inertia, e, -f, linear.r)


@kernel
def add_mass_times(system, w, scale, X, out):
    """out += scale M X; X and out (n, n)."""
    G, a = stack2(3, 4), stack(3)
    n = w.q.size
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        # m X on r
        for c in range(at, at + 3):
            for j in range(n):
                out[c, j] += scale * system.mass[b] * X[c, j]
        if system.bodies[b, 1] == 7:
            # 4 G^T J' G X on p
            matrix_g(w.q[at + 3 : at + 7], G)
            J = system.inertia[b]
            for j in range(n):
                for i in range(3):
                    a[i] = 0.0
                    for c in range(4):
                        a[i] += G[i, c] * X[at + 3 + c, j]
                x = J[0] * a[0] + J[1] * a[1] + J[2] * a[2]
                y = J[3] * a[0] + J[4] * a[1] + J[5] * a[2]
                z = J[6] * a[0] + J[7] * a[1] + J[8] * a[2]
                for c in range(4):
                    out[at + 3 + c, j] += 4.0 * scale * (G[0, c] * x + G[1, c] * y + G[2, c] * z)
    # h^T h X
    for e in range(w.inertia_bias.size):
        for j in range(n):
            f = scale * multiply_inertia_row(system, w.inertia, e, X[:, j])
            add_inertia_row(system, w.inertia, e, f, out[:, j])


@kernel
def _to_body_frames(system, q, X, scratch, out):
    """out (l, l) = T^T X T, X (n, n): dr = A dr', dp = G^T dpi' / 2."""
    n, G, A = q.size, stack2(3, 4), stack2(3, 3)
    to = 0
    # X T
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        if system.bodies[b, 1] == 7:
            matrix_g(q[at + 3 : at + 7], G)
            matrix_a(q[at + 3 : at + 7], A)
            for i in range(n):
                for c in range(3):
                    scratch[i, to + c] = X[i, at] * A[0, c] + X[i, at + 1] * A[1, c] + X[i, at + 2] * A[2, c]
                    total = 0.0
                    for d in range(4):
                        total += X[i, at + 3 + d] * G[c, d]
                    scratch[i, to + 3 + c] = 0.5 * total
            to += 6
        else:
            for i in range(n):
                for c in range(3):
                    scratch[i, to + c] = X[i, at + c]
            to += 3
    # T^T (X T)
    width, to = to, 0
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        if system.bodies[b, 1] == 7:
            matrix_g(q[at + 3 : at + 7], G)
            matrix_a(q[at + 3 : at + 7], A)
            for j in range(width):
                for c in range(3):
                    total = 0.0
                    for d in range(3):
                        total += A[d, c] * scratch[at + d, j]
                    out[to + c, j] = total
                    total = 0.0
                    for d in range(4):
                        total += G[c, d] * scratch[at + 3 + d, j]
                    out[to + 3 + c, j] = 0.5 * total
            to += 6
        else:
            for j in range(width):
                for c in range(3):
                    out[to + c, j] = scratch[at + c, j]
            to += 3


@kernel
def curvatures(system, w, linear, t, vdd):
    """K and C of forces, inertia and reactions at the last accelerations vdd; G1, G2, Y and Z."""
    find_accelerations(system, w, vdd)
    n = w.q.size
    clear_matrix(linear.K)
    clear_matrix(linear.C)
    for i in range(n):
        linear.r[i] = 0.0
    # r = Q_A + Q_v - M qdd is what the multipliers balance
    if system.forces.shape[0] > 0:
        applied_forces(system, w.q, w.qd, t, linear.r)
        _forces(system, w, linear, t, 1)  # stores derivatives of the laws; `reduce` evaluates the rest
    _inertia_terms(system, w, linear)
    _inertia_rows(system, w, linear)
    # Phi_q^T lam = r;    Y = U B G1,    Z = U B G2
    multiply(w.U, w.B, linear.UB)
    transposed_times(linear.UB, linear.r, linear.lam)
    clear_rows(system, linear.G1)
    clear_rows(system, linear.G2)
    constraint_curvature(system, w.q, w.qd, w.qdd, t, linear.lam, linear.K, linear.G1, linear.G2)
    multiply(linear.UB, linear.G1, linear.Y)
    multiply(linear.UB, linear.G2, linear.Z)


@kernel
def keep_in_body_frames(system, w, linear):
    """K_body and C_body. Status."""
    # C* += 2 M Y,    K* += C* Y - M Z
    add_mass_times(system, w, 2.0, linear.Y, linear.C)
    add_mass_times(system, w, -1.0, linear.Z, linear.K)
    add_product(1.0, linear.C, linear.Y, linear.K)
    # An overflow shows in the sum of all entries
    total = 0.0
    for i in range(w.q.size):
        for j in range(w.q.size):
            total += abs(linear.K[i, j]) + abs(linear.C[i, j])
    _to_body_frames(system, w.q, linear.K, linear.Z, linear.K_body)
    _to_body_frames(system, w.q, linear.C, linear.Z, linear.C_body)
    w.counters.jacobians += 1
    return OK if total < 1.0 / TINY else NOT_FINITE


@callback("pdp")
def linearise(context, t, vdd):
    """Set K_body and C_body at the last accelerations vdd. Status."""
    c = load(context)
    curvatures(c.system, c.work, c.linear, t, vector(vdd, c.work.v.size))
    return keep_in_body_frames(c.system, c.work, c.linear)


@kernel
def _forces(system, w, linear, t, renew):
    """Q_q and Q_qd of the forces."""
    clear_matrix(linear.Q_q)
    clear_matrix(linear.Q_qd)
    force_jacobian(system, w.q, w.qd, t, linear.Q_q, linear.Q_qd, renew, linear.kept)


@kernel
def in_body_frames(system, q, D, out):
    """out = [A^T D_r; 2 G D_p]: tangent velocities as velocities in body frames."""
    to, A = 0, stack2(3, 3)
    for b in range(system.mass.size):
        at = system.bodies[b, 0]
        if system.bodies[b, 1] == 7:
            matrix_a(q[at + 3 : at + 7], A)
            e0, e1, e2, e3 = 2.0 * q[at + 3], 2.0 * q[at + 4], 2.0 * q[at + 5], 2.0 * q[at + 6]
            d0, d1, d2, d3 = D[at + 3], D[at + 4], D[at + 5], D[at + 6]
            for j in range(D.shape[1]):
                for i in range(3):
                    out[to + i, j] = A[0, i] * D[at, j] + A[1, i] * D[at + 1, j] + A[2, i] * D[at + 2, j]
                out[to + 3, j] = -e1 * d0[j] + e0 * d1[j] + e3 * d2[j] - e2 * d3[j]
                out[to + 4, j] = -e2 * d0[j] - e3 * d1[j] + e0 * d2[j] + e1 * d3[j]
                out[to + 5, j] = -e3 * d0[j] + e2 * d1[j] - e1 * d2[j] + e0 * d3[j]
            to += 6
        else:
            for i in range(3):
                for j in range(D.shape[1]):
                    out[to + i, j] = D[at + i, j]
            to += 3


@kernel
def project_derivatives(system, w, linear, t, moved):
    """C_hat, and moved.K_hat by displacements moved.D dv, moved.F in body frames; w.D are the velocities."""
    clear_matrix(moved.K_hat)
    clear_matrix(linear.C_hat)
    # K_hat = F^T K_body F,    C_hat = F^T C_body F
    multiply(linear.K_body, moved.F, moved.X)
    add_transposed_product(1.0, linear.F, moved.X, moved.K_hat)
    multiply(linear.C_body, linear.F, linear.X)
    add_transposed_product(1.0, linear.F, linear.X, linear.C_hat)
    if system.forces.shape[0] > 0:
        # K_hat += D^T (Q_qd Y - Q_q) D,    C_hat += D^T Q_qd D
        _forces(system, w, linear, t, 0)
        multiply(linear.Q_q, moved.D, moved.X)
        add_transposed_product(-1.0, w.D, moved.X, moved.K_hat)
        multiply(linear.Q_qd, w.D, linear.X)
        add_transposed_product(1.0, w.D, linear.X, linear.C_hat)
        # Q_qd Y with the Q_qd of now: what a stale one points to may be soft by now
        multiply(linear.Y, moved.D, moved.X)
        multiply(linear.Q_qd, moved.X, moved.X2)
        add_transposed_product(1.0, w.D, moved.X2, moved.K_hat)


@callback("pd")
def reduce(context, t):
    """Set K_hat and C_hat at the current state."""
    c = load(context)
    w, linear = c.work, c.linear
    in_body_frames(c.system, w.q, w.D, linear.F)
    project_derivatives(c.system, w, linear, t, Displacements(w.D, linear.F, linear.X, linear.X2, linear.K_hat))
    return OK


@kernel
def mass_matrix(w, P):
    """P = D^T M D, formed again from its Cholesky factor."""
    for i in range(w.v.size):
        for j in range(i + 1):
            x = 0.0  # A = L L^T, the diagonal holding reciprocals
            for d in range(j):
                x += w.A[i, d] * w.A[j, d]
            x += (w.A[i, j] if i != j else 1.0 / w.A[i, i]) / w.A[j, j]
            P[i, j] = x
            P[j, i] = x


@callback("pd")
def factorise(context, g):
    """LU factors of P = D^T M D - g C_hat + g^2 K_hat. Status."""
    c = load(context)
    w, linear = c.work, c.linear
    k = w.v.size
    mass_matrix(w, linear.P)
    # P = A - g C_hat + g^2 K_hat
    for i in range(k):
        for j in range(k):
            linear.P[i, j] += g * (g * linear.K_hat[i, j] - linear.C_hat[i, j])
    w.counters.iteration_matrices += 1
    return OK if lu(linear.P, linear.pivots, k) else SINGULAR


@kernel
def times_mass(w, linear, rho):
    """rho <- A rho, by the Cholesky factor of A, whose diagonal holds reciprocals."""
    k = rho.size
    # b = L^T rho
    for j in range(k):
        x = rho[j] / w.A[j, j]
        for i in range(j + 1, k):
            x += w.A[i, j] * rho[i]
        linear.b[j] = x
    # rho = L b
    for i in range(k - 1, -1, -1):
        x = linear.b[i] / w.A[i, i]
        for j in range(i):
            x += w.A[i, j] * linear.b[j]
        rho[i] = x


@callback("ppp")
def recall(context, vd, vdd):
    """vd and vdd in this chart at the point before: v = L^T (q - q0) wherever q is."""
    c = load(context)
    w, before = c.work, c.linear.before
    transposed_times(w.L, before[1], vector(vd, w.v.size))
    transposed_times(w.L, before[2], vector(vdd, w.v.size))
    return OK


@callback("pp")
def solve(context, rho):
    """rho <- P^-1 A rho."""
    c = load(context)
    w, linear = c.work, c.linear
    rho = vector(rho, w.v.size)
    times_mass(w, linear, rho)
    lu_solve(linear.P, linear.pivots, rho, rho.size)
    return OK


@callback("ppdp")
def soften(context, ex, g, ey):
    """(ex, ey) <- (I - g J)^-1 (ex, ey), J the Jacobian of (vd, f): an estimate freed of what stiff modes add to it.

    Hosea and Shampine, Appl. Numer. Math. 20, 21-37 (1996).
    """
    c = load(context)
    w, linear = c.work, c.linear
    k = w.v.size
    ex, ey = vector(ex, k), vector(ey, k)
    # P y = A ey - g K_hat ex,  x = ex + g y
    times_mass(w, linear, ey)
    for i in range(k):
        for j in range(k):
            ey[i] -= g * linear.K_hat[i, j] * ex[j]
    lu_solve(linear.P, linear.pivots, ey, k)
    for i in range(k):
        ex[i] += g * ey[i]
    return OK
