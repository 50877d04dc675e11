"""A timing anchor: Eq. 26 with Nystrom4, written by hand for the sliding top alone.

Seven coordinates, two constraints and five degrees of freedom are constants here, the 2 x 2 inverse B is a formula and
every loop is unrolled by the compiler. Nothing of it serves another scene; it says what the same mathematics costs
when generality is not asked for. Every stage is a full evaluation: positions, B, D, D^T M D, its factor, vdd.
"""

import math

import numba
import numpy as np

OPTIONS = {"error_model": "numpy", "cache": True}
MASS, GRAVITY = 30.0, 9.6
JX, JY, JZ = 90.0, 90.0, 30.0
N, M, K = 7, 2, 5


@numba.njit(**OPTIONS)
def jacobian(q, P):
    """Rows of Phi_q: the tip on the plane, the normalisation."""
    P[0, 2] = 1.0
    P[0, 3], P[0, 4], P[0, 5], P[0, 6] = -2.0 * q[3], 2.0 * q[4], 2.0 * q[5], -2.0 * q[6]
    P[1, 3], P[1, 4], P[1, 5], P[1, 6] = q[3], q[4], q[5], q[6]


@numba.njit(**OPTIONS)
def place(v, tol, chart, B, u, q, P):
    """q and Phi_q at v, with B = (Phi_q U)^-1; returns the number of Newton sweeps."""
    q0, V, U = chart
    sweeps = 0
    while True:
        for i in range(N):
            s = q0[i]
            for j in range(K):
                s += V[i, j] * v[j]
            for j in range(M):
                s -= U[i, j] * u[j]
            q[i] = s
        e0, e1, e2, e3 = q[3], q[4], q[5], q[6]
        f0 = q[2] - (e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3)
        f1 = 0.5 * (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3 - 1.0)
        sweeps += 1
        if (abs(f0) < tol and abs(f1) < tol) or sweeps > 20:
            break
        u[0] += B[0, 0] * f0 + B[0, 1] * f1
        u[1] += B[1, 0] * f0 + B[1, 1] * f1
    jacobian(q, P)
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(2, N):
        a += P[0, i] * U[i, 0]
        b += P[0, i] * U[i, 1]
        c += P[1, i] * U[i, 0]
        d += P[1, i] * U[i, 1]
    r = 1.0 / (a * d - b * c)
    B[0, 0], B[0, 1], B[1, 0], B[1, 1] = d * r, -b * r, -c * r, a * r
    return sweeps


@numba.njit(**OPTIONS)
def evaluate(v, vd, tol, chart, work, vdd):
    """vdd of Eq. 26; returns the number of Newton sweeps."""
    _, V, U = chart
    B, u, q, qd, P, D, E, A = work
    sweeps = place(v, tol, chart, B, u, q, P)
    e0, e1, e2, e3 = q[3], q[4], q[5], q[6]
    for j in range(K):
        x, y = 0.0, 0.0
        for i in range(2, N):
            x += P[0, i] * V[i, j]
            y += P[1, i] * V[i, j]
        s, t = B[0, 0] * x + B[0, 1] * y, B[1, 0] * x + B[1, 1] * y
        for i in range(N):
            D[i, j] = V[i, j] - U[i, 0] * s - U[i, 1] * t
    for i in range(N):
        s = 0.0
        for j in range(K):
            s += D[i, j] * vd[j]
        qd[i] = s
    d0, d1, d2, d3 = qd[3], qd[4], qd[5], qd[6]
    g0 = -2.0 * (d0 * d0 - d1 * d1 - d2 * d2 + d3 * d3)
    g1 = d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3
    s, t = B[0, 0] * g0 + B[0, 1] * g1, B[1, 0] * g0 + B[1, 1] * g1
    h0, h1, h2 = U[0, 0] * s + U[0, 1] * t, U[1, 0] * s + U[1, 1] * t, U[2, 0] * s + U[2, 1] * t
    a0, a1 = U[3, 0] * s + U[3, 1] * t, U[4, 0] * s + U[4, 1] * t
    a2, a3 = U[5, 0] * s + U[5, 1] * t, U[6, 0] * s + U[6, 1] * t
    tx = 2.0 * JX * (-e1 * a0 + e0 * a1 + e3 * a2 - e2 * a3)
    ty = 2.0 * JY * (-e2 * a0 - e3 * a1 + e0 * a2 + e1 * a3)
    tz = 2.0 * JZ * (-e3 * a0 + e2 * a1 - e1 * a2 + e0 * a3)
    gx = 8.0 * JX * (-d1 * e0 + d0 * e1 + d3 * e2 - d2 * e3)
    gy = 8.0 * JY * (-d2 * e0 - d3 * e1 + d0 * e2 + d1 * e3)
    gz = 8.0 * JZ * (-d3 * e0 + d2 * e1 - d1 * e2 + d0 * e3)
    s0, s1 = -d1 * gx - d2 * gy - d3 * gz, d0 * gx - d3 * gy + d2 * gz
    s2, s3 = d3 * gx + d0 * gy - d1 * gz, -d2 * gx + d1 * gy + d0 * gz
    for j in range(K):
        p0, p1, p2, p3 = 2.0 * D[3, j], 2.0 * D[4, j], 2.0 * D[5, j], 2.0 * D[6, j]
        E[0, j] = -e1 * p0 + e0 * p1 + e3 * p2 - e2 * p3
        E[1, j] = -e2 * p0 - e3 * p1 + e0 * p2 + e1 * p3
        E[2, j] = -e3 * p0 + e2 * p1 - e1 * p2 + e0 * p3
        vdd[j] = (
            MASS * (h0 * D[0, j] + h1 * D[1, j] + (h2 - GRAVITY) * D[2, j])
            + (tx * E[0, j] + ty * E[1, j] + tz * E[2, j])
            + (s0 * D[3, j] + s1 * D[4, j] + s2 * D[5, j] + s3 * D[6, j])
        )
    for i in range(K):
        for j in range(i + 1):
            A[i, j] = MASS * (D[0, i] * D[0, j] + D[1, i] * D[1, j] + D[2, i] * D[2, j]) + (
                JX * E[0, i] * E[0, j] + JY * E[1, i] * E[1, j] + JZ * E[2, i] * E[2, j]
            )
    solve(A, vdd)
    return sweeps


@numba.njit(**OPTIONS)
def solve(A, x):
    """x = A^-1 x by Cholesky, of the lower half of A."""
    for j in range(K):
        s = A[j, j]
        for k in range(j):
            s -= A[j, k] * A[j, k]
        s = 1.0 / math.sqrt(s)
        A[j, j] = s
        for i in range(j + 1, K):
            t = A[i, j]
            for k in range(j):
                t -= A[i, k] * A[j, k]
            A[i, j] = t * s
    for i in range(K):
        s = x[i]
        for k in range(i):
            s -= A[i, k] * x[k]
        x[i] = s * A[i, i]
    for i in range(K - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, K):
            s -= A[k, i] * x[k]
        x[i] = s * A[i, i]


@numba.njit(**OPTIONS)
def simulate(q, qd, end, steps, tol, interval):
    """Run to `end` s with a new chart every `interval` steps; q and qd are taken and returned. Returns the sweeps."""
    h = end / steps
    P, D, E, A = np.zeros((M, N)), np.zeros((N, K)), np.zeros((3, K)), np.zeros((K, K))
    k1, k2, k3, k4 = np.zeros(K), np.zeros(K), np.zeros(K), np.zeros(K)
    v, vd, vs, ws, u = np.zeros(K), np.zeros(K), np.zeros(K), np.zeros(K), np.zeros(M)
    V, U, B, q0 = np.zeros((N, K)), np.zeros((N, M)), np.zeros((M, M)), np.zeros(N)
    chart, work, sweeps = (q0, V, U), (B, u, q, qd, P, D, E, A), 0
    for step in range(steps):
        if step % interval == 0:
            if step:
                sweeps += evaluate(v, vd, tol, chart, work, k1)
            jacobian(q, P)
            U = np.ascontiguousarray(P.T)
            V = np.ascontiguousarray(np.linalg.svd(P)[2][M:].T)
            B = np.linalg.inv(P @ U)
            chart, work = (q0, V, U), (B, u, q, qd, P, D, E, A)
            q0[:] = q
            v[:], u[:] = 0.0, 0.0
            vd = V.T @ qd
        sweeps += evaluate(v, vd, tol, chart, work, k1)
        for i in range(K):
            vs[i] = v[i] + h / 2 * vd[i] + h * h / 8 * k1[i]
            ws[i] = vd[i] + h / 2 * k1[i]
        sweeps += evaluate(vs, ws, tol, chart, work, k2)
        for i in range(K):
            ws[i] = vd[i] + h / 2 * k2[i]
        sweeps += evaluate(vs, ws, tol, chart, work, k3)
        for i in range(K):
            vs[i] = v[i] + h * vd[i] + h * h / 2 * k3[i]
            ws[i] = vd[i] + h * k3[i]
        sweeps += evaluate(vs, ws, tol, chart, work, k4)
        for i in range(K):
            v[i] += h * vd[i] + h * h / 6 * (k1[i] + k2[i] + k3[i])
            vd[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])
    return sweeps + evaluate(v, vd, tol, chart, work, k1)


def start():
    """Upright, omega' = (0.5, 0, 12) rad/s: q and qd."""
    return np.array([0, 0, 1.0, 1, 0, 0, 0]), np.array([0, 0, 0, 0, 0.25, 0, 6.0])
