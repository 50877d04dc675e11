"""Linearisation of the tangent-space ODE for implicit methods: exact derivatives of vdd = f(t, v, vd), Eq. 26.

With dq = D dv and, from Eqs. 2 and 3, Phi_q dqd = -G1 dq and Phi_q dqdd = -G2 dq - 2 G1 dqd (G1, G2 as in
constraint_hessians.py), Eq. 4 gives (multipliers drop out because Phi_q D = 0)

    A f_v = -D^T K* D,    A f_vd = D^T C* D,    A = D^T M D
    C* = Q_A,qd + Q_v,qd + 2 M Y,                             Y = U B G1
    K* = (M qdd - Q_v - Q_A)_q + (Phi_q^T lam)_q - M Z + C* Y,  Z = U B G2

One evaluation serves many steps and charts: K* and C* without Q_A,q and Q_A,qd are stored in body frames, the
derivatives of the force laws in corotated frames (corotated_frames.py). At the current configuration, `reduce` and
`factorise` form P = A - g C_hat + g^2 K_hat, the iteration matrix of a stage with g = h a_ii.
"""

from ..jit.kernels import callback, kernel, stack, stack2, vector
from ..maths.dense_linalg import lu, lu_solve, transposed_times
from ..maths.euler_parameters import matrix_a, matrix_g
from ..model.equations import applied_forces, constraint_curvature, force_jacobian
from ..workspaces.workspace import ITERATION_MATRICES, JACOBIANS, load
from .newton_iterations import NOT_FINITE, OK, SINGULAR
from .tolerances import HUGE


@kernel
def _transposed_product(G, J, X, f, out):
    """out += f G^T J X (4, 4); G and X (3, 4), J (9,)."""
    for i in range(4):
        for j in range(4):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += G[a, i] * J[3 * a + b] * X[b, j]
            out[i, j] += f * total


@kernel
def _crossed(h, f, out):
    """out += f H, where H p = G(p)^T h."""
    for i in range(3):
        out[0, 1 + i] -= f * h[i]
        out[1 + i, 0] += f * h[i]
    out[1, 2] += f * h[2]
    out[1, 3] -= f * h[1]
    out[2, 1] -= f * h[2]
    out[2, 3] += f * h[0]
    out[3, 1] += f * h[1]
    out[3, 2] -= f * h[0]


@kernel
def _moment(G, J, p, out):
    """out = J G p (3,)."""
    x = stack(3)
    for a in range(3):
        x[a] = G[a, 0] * p[0] + G[a, 1] * p[1] + G[a, 2] * p[2] + G[a, 3] * p[3]
    for a in range(3):
        out[a] = J[3 * a] * x[0] + J[3 * a + 1] * x[1] + J[3 * a + 2] * x[2]


@kernel
def _inertia_terms(s, w, l):
    """l.r += gravity + S - M qdd, K += (M qdd - S)_q, C += S_qd; S_p = 8 Gd^T J' Gd p, M_p = 4 G^T J' G."""
    G, Gd, Gdd, h, g = stack2(3, 4), stack2(3, 4), stack2(3, 4), stack(3), stack(3)
    for b in range(s.mass.size):
        at = s.bodies[b, 0]
        for c in range(3):
            l.r[at + c] += s.mass[b] * (s.gravity[c] - w.qdd[at + c])
        if s.bodies[b, 1] == 7:
            p, pd, pdd, J = w.q[at + 3 : at + 7], w.qd[at + 3 : at + 7], w.qdd[at + 3 : at + 7], s.inertia[b]
            matrix_g(p, G)
            matrix_g(pd, Gd)
            matrix_g(pdd, Gdd)
            _moment(G, J, pdd, h)
            _moment(Gd, J, p, g)
            for i in range(4):
                total = 0.0
                for a in range(3):
                    total += 8.0 * Gd[a, i] * g[a] - 4.0 * G[a, i] * h[a]
                l.r[at + 3 + i] += total
            K, C = l.K[at + 3 : at + 7, at + 3 : at + 7], l.C[at + 3 : at + 7, at + 3 : at + 7]
            _crossed(h, 4.0, K)
            _transposed_product(G, J, Gdd, -4.0, K)
            _transposed_product(Gd, J, Gd, -8.0, K)
            _crossed(g, 8.0, C)
            _transposed_product(Gd, J, G, -8.0, C)


@kernel
def _add_mass_times(s, q, f, X, out):
    """out += f M X; X and out (n, n)."""
    G, a = stack2(3, 4), stack(3)
    n = q.size
    for b in range(s.mass.size):
        at = s.bodies[b, 0]
        for c in range(at, at + 3):
            for j in range(n):
                out[c, j] += f * s.mass[b] * X[c, j]
        if s.bodies[b, 1] == 7:
            matrix_g(q[at + 3 : at + 7], G)
            J = s.inertia[b]
            for j in range(n):
                for i in range(3):
                    a[i] = 0.0
                    for c in range(4):
                        a[i] += G[i, c] * X[at + 3 + c, j]
                x = J[0] * a[0] + J[1] * a[1] + J[2] * a[2]
                y = J[3] * a[0] + J[4] * a[1] + J[5] * a[2]
                z = J[6] * a[0] + J[7] * a[1] + J[8] * a[2]
                for c in range(4):
                    out[at + 3 + c, j] += 4.0 * f * (G[0, c] * x + G[1, c] * y + G[2, c] * z)


@kernel
def _multiply(A, B, out):
    """out = A B."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            out[i, j] = 0.0
        for c in range(A.shape[1]):
            f = A[i, c]
            if f != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += f * B[c, j]


@kernel
def _to_body_frames(s, q, X, scratch, out):
    """out (l, l) = T^T X T, X (n, n): dr = A dr', dp = G^T dpi' / 2."""
    n, G, A = q.size, stack2(3, 4), stack2(3, 3)
    to = 0
    for b in range(s.mass.size):  # X T
        at = s.bodies[b, 0]
        if s.bodies[b, 1] == 7:
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
    width, to = to, 0
    for b in range(s.mass.size):
        at = s.bodies[b, 0]
        if s.bodies[b, 1] == 7:
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


@callback("pd")
def linearise(context, t):
    """Set K_body and C_body at the last completed state. Status."""
    c = load(context)
    s, w, l = c.system, c.work, c.linear
    n = w.q.size
    for i in range(n):
        for j in range(n):
            l.K[i, j] = 0.0
            l.C[i, j] = 0.0
        l.r[i] = 0.0
    if s.forces.shape[0] > 0:
        applied_forces(s, w.q, w.qd, t, l.r)
        _forces(s, w, l, t, 1)  # the laws' derivatives are kept; `reduce` takes the rest anew
    _inertia_terms(s, w, l)
    _multiply(w.U, w.B, l.UB)
    transposed_times(l.UB, l.r, l.lam)  # Phi_q^T lam = r
    constraint_curvature(s, w.q, w.qd, w.qdd, t, l.lam, l.K, l.G1, l.G2)
    _multiply(l.UB, l.G1, l.Y)
    _multiply(l.UB, l.G2, l.Z)
    _add_mass_times(s, w.q, 2.0, l.Y, l.C)
    _add_mass_times(s, w.q, -1.0, l.Z, l.K)
    total = 0.0
    for i in range(n):
        for d in range(n):
            f = l.C[i, d]
            for j in range(n):
                l.K[i, j] += f * l.Y[d, j]
        for j in range(n):
            total += abs(l.K[i, j]) + abs(l.C[i, j])
    _to_body_frames(s, w.q, l.K, l.Z, l.K_body)
    _to_body_frames(s, w.q, l.C, l.Z, l.C_body)
    w.counters[JACOBIANS] += 1
    return OK if total < HUGE else NOT_FINITE


@kernel
def _add_product(factor, F, X, out):
    """out += factor F^T X."""
    for c in range(F.shape[0]):
        for i in range(F.shape[1]):
            f = factor * F[c, i]
            if f != 0.0:
                for j in range(F.shape[1]):
                    out[i, j] += f * X[c, j]


@kernel
def _forces(s, w, l, t, anew):
    """Q_q and Q_qd of the forces."""
    for i in range(w.q.size):
        for j in range(w.q.size):
            l.Q_q[i, j] = 0.0
            l.Q_qd[i, j] = 0.0
    force_jacobian(s, w.q, w.qd, t, l.Q_q, l.Q_qd, anew, l.kept)


@callback("pd")
def reduce(context, t):
    """Set K_hat and C_hat at the current state."""
    c = load(context)
    s, w, l = c.system, c.work, c.linear
    k, to, A = w.v.size, 0, stack2(3, 3)
    for b in range(s.mass.size):
        at = s.bodies[b, 0]
        if s.bodies[b, 1] == 7:
            matrix_a(w.q[at + 3 : at + 7], A)
            for i in range(3):
                for j in range(k):
                    l.F[to + i, j] = A[0, i] * w.D[at, j] + A[1, i] * w.D[at + 1, j] + A[2, i] * w.D[at + 2, j]
                    l.F[to + 3 + i, j] = w.E[3 * b + i, j]
            to += 6
        else:
            for i in range(3):
                for j in range(k):
                    l.F[to + i, j] = w.D[at + i, j]
            to += 3
    for i in range(k):
        for j in range(k):
            l.K_hat[i, j] = 0.0
            l.C_hat[i, j] = 0.0
    _multiply(l.K_body, l.F, l.X)
    _add_product(1.0, l.F, l.X, l.K_hat)
    _multiply(l.C_body, l.F, l.X)
    _add_product(1.0, l.F, l.X, l.C_hat)
    if s.forces.shape[0] > 0:
        _forces(s, w, l, t, 0)
        _multiply(l.Q_q, w.D, l.X)
        _add_product(-1.0, w.D, l.X, l.K_hat)
        _multiply(l.Q_qd, w.D, l.X)
        _add_product(1.0, w.D, l.X, l.C_hat)
        _multiply(l.Y, w.D, l.X)  # Q_qd Y with the Q_qd of now: what a stale one points to may be soft by now
        _multiply(l.Q_qd, l.X, l.X2)
        _add_product(1.0, w.D, l.X2, l.K_hat)
    return OK


@callback("pd")
def factorise(context, g):
    """LU factors of P = D^T M D - g C_hat + g^2 K_hat. Status."""
    c = load(context)
    w, l = c.work, c.linear
    k = w.v.size
    for i in range(k):
        for j in range(i + 1):
            x = 0.0  # A = L L^T, the diagonal holding reciprocals
            for d in range(j):
                x += w.A[i, d] * w.A[j, d]
            x += (w.A[i, j] if i != j else 1.0 / w.A[i, i]) / w.A[j, j]
            l.P[i, j] = x
            l.P[j, i] = x
    for i in range(k):
        for j in range(k):
            l.P[i, j] += g * (g * l.K_hat[i, j] - l.C_hat[i, j])
    w.counters[ITERATION_MATRICES] += 1
    return OK if lu(l.P, l.pivots, k) else SINGULAR


@kernel
def _times_mass(w, l, rho):
    """rho <- A rho, by the Cholesky factor of A, whose diagonal holds reciprocals."""
    k = rho.size
    for j in range(k):
        x = rho[j] / w.A[j, j]
        for i in range(j + 1, k):
            x += w.A[i, j] * rho[i]
        l.b[j] = x
    for i in range(k - 1, -1, -1):
        x = l.b[i] / w.A[i, i]
        for j in range(i):
            x += w.A[i, j] * l.b[j]
        rho[i] = x


@callback("pp")
def solve(context, rho):
    """rho <- P^-1 A rho."""
    c = load(context)
    w, l = c.work, c.linear
    rho = vector(rho, w.v.size)
    _times_mass(w, l, rho)
    lu_solve(l.P, l.pivots, rho, rho.size)
    return OK


@callback("ppdp")
def soften(context, ex, g, ey):
    """(ex, ey) <- (I - g J)^-1 (ex, ey), J the Jacobian of (vd, f): an estimate freed of what stiff modes add to it.

    Hosea and Shampine, Appl. Numer. Math. 20, 21-37 (1996).
    """
    c = load(context)
    w, l = c.work, c.linear
    k = w.v.size
    ex, ey = vector(ex, k), vector(ey, k)
    _times_mass(w, l, ey)
    for i in range(k):
        for j in range(k):
            ey[i] -= g * l.K_hat[i, j] * ex[j]
    lu_solve(l.P, l.pivots, ey, k)
    for i in range(k):
        ex[i] += g * ey[i]
    return OK
