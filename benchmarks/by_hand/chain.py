"""A chain of N rods in absolute coordinates, x = (r, p, v, omega') of each, 13 N numbers; multipliers in O(N).

With a_i = A_i e_z, s = 1/2 m, lam_i the force on rod i at its near end r_i + s a_i (and its opposite on rod i - 1):

    m vd_i = m g + F_i + lam_i - lam_{i+1}
    J' omegad_i = (J' omega_i) x omega_i + s e_z x A_i^T (lam_i + lam_{i+1})
    P_i = (1/m + c) I - c a_i a_i^T,    Q_i = (c - 1/m) I - c a_i a_i^T,    c = s^2 / J_x
    Q_{i-1} lam_{i-1} + (P_{i-1} + P_i) lam_i + Q_i lam_{i+1} = far_{i-1} - near_i

near, far: accelerations of the ends without lam. The symmetric block tridiagonal system is eliminated from the ground
out; with M a pivot's inverse and u = M a, Q M Q = q^2 M - q c (a u^T + u a^T) + c^2 (a.u) a a^T, q = c - 1/m.
"""

import numba
import numpy as np

from .dop853 import driver
from .options import PART

MASS, GRAVITY, JX, JZ, S = 1.0, 9.81, 0.1, 0.02, 0.5
SIDE = 0.1  # N, along y on the last rod
C, Q = S * S / JX, S * S / JX - 1.0 / MASS
WORK = 12  # a rod's own: a (3), inverse pivot (6), right-hand side or multiplier (3)
END = 1.0


@numba.njit(**PART)
def times(w, v0, v1, v2):
    """The inverse pivot of a rod's workspace, times a vector."""
    return (
        w[3] * v0 + w[4] * v1 + w[5] * v2,
        w[4] * v0 + w[6] * v1 + w[7] * v2,
        w[5] * v0 + w[7] * v1 + w[8] * v2,
    )


@numba.njit(**PART)
def pivot(w, d, e, a0, a1, a2, b0, b1, b2, last):  # vectors as numbers: the loops of three are unrolled by hand
    """The inverse of d I - e (a a^T + b b^T) less what elimination of the rod before, of workspace `last`, takes."""
    s00, s01, s02 = d - e * (a0 * a0 + b0 * b0), -e * (a0 * a1 + b0 * b1), -e * (a0 * a2 + b0 * b2)
    s11, s12, s22 = d - e * (a1 * a1 + b1 * b1), -e * (a1 * a2 + b1 * b2), d - e * (a2 * a2 + b2 * b2)
    u0, u1, u2 = times(last, b0, b1, b2)
    k = 0.5 * C * C * (b0 * u0 + b1 * u1 + b2 * u2)  # Q M Q = q^2 M + a x^T + x a^T, x = k a - q c u
    x0, x1, x2 = k * b0 - Q * C * u0, k * b1 - Q * C * u1, k * b2 - Q * C * u2
    s00 -= Q * Q * last[3] + 2.0 * b0 * x0
    s01 -= Q * Q * last[4] + b0 * x1 + b1 * x0
    s02 -= Q * Q * last[5] + b0 * x2 + b2 * x0
    s11 -= Q * Q * last[6] + 2.0 * b1 * x1
    s12 -= Q * Q * last[7] + b1 * x2 + b2 * x1
    s22 -= Q * Q * last[8] + 2.0 * b2 * x2
    c00, c01, c02 = s11 * s22 - s12 * s12, s02 * s12 - s01 * s22, s01 * s12 - s02 * s11
    r = 1.0 / (s00 * c00 + s01 * c01 + s02 * c02)
    w[3], w[4], w[5] = c00 * r, c01 * r, c02 * r
    w[6], w[7], w[8] = (s00 * s22 - s02 * s02) * r, (s01 * s02 - s00 * s12) * r, (s00 * s11 - s01 * s01) * r


@numba.njit(**PART)
def evaluate(x, work, f):
    """The right-hand side; work (N + 1, WORK), its last row zero."""
    N = work.shape[0] - 1
    p0, p1, p2 = 0.0, 0.0, 0.0  # the axis of the rod before
    h0, h1, h2 = 0.0, 0.0, 0.0  # its far end's acceleration without lam
    for i in range(N):
        j, w, last = 13 * i, work[i], work[i - 1]
        e0, e1, e2, e3 = x[j + 3], x[j + 4], x[j + 5], x[j + 6]
        a, b, c = x[j + 10], x[j + 11], x[j + 12]
        s, t, u, v = e0 * e0, e1 * e1, e2 * e2, e3 * e3
        x0, x1, x2 = s + t - u - v, 2.0 * (e1 * e2 + e0 * e3), 2.0 * (e1 * e3 - e0 * e2)
        y0, y1, y2 = 2.0 * (e1 * e2 - e0 * e3), s - t + u - v, 2.0 * (e2 * e3 + e0 * e1)
        z0, z1, z2 = 2.0 * (e1 * e3 + e0 * e2), 2.0 * (e2 * e3 - e0 * e1), s - t - u + v
        f[j], f[j + 1], f[j + 2] = x[j + 7], x[j + 8], x[j + 9]
        f[j + 3] = 0.5 * (-e1 * a - e2 * b - e3 * c)
        f[j + 4] = 0.5 * (e0 * a - e3 * b + e2 * c)
        f[j + 5] = 0.5 * (e3 * a + e0 * b - e1 * c)
        f[j + 6] = 0.5 * (-e2 * a + e1 * b + e0 * c)
        ga, gb = (JX - JZ) / JX * b * c, (JZ - JX) / JX * a * c
        f[j + 10], f[j + 11], f[j + 12] = ga, gb, 0.0
        # s a'' without lam, in the body: omegad x e_z + omega x (omega x e_z)
        k, l, m = S * (gb + a * c), S * (b * c - ga), -S * (a * a + b * b)
        n0, n1, n2 = x0 * k + y0 * l + z0 * m, x1 * k + y1 * l + z1 * m, x2 * k + y2 * l + z2 * m
        f1, f2 = SIDE / MASS if i == N - 1 else 0.0, -GRAVITY
        f[j + 7], f[j + 8], f[j + 9] = 0.0, f1, f2
        w[0], w[1], w[2] = z0, z1, z2
        pivot(w, (2.0 if i else 1.0) * (C + 1.0 / MASS), C, z0, z1, z2, p0, p1, p2, last)
        # right-hand side, less Q M b of the rod before
        t0, t1, t2 = times(last, last[9], last[10], last[11])
        t = C * (p0 * t0 + p1 * t1 + p2 * t2)
        w[9] = h0 - n0 - Q * t0 + t * p0
        w[10] = h1 - f1 - n1 - Q * t1 + t * p1
        w[11] = h2 - f2 - n2 - Q * t2 + t * p2
        p0, p1, p2 = z0, z1, z2
        h0, h1, h2 = -n0, f1 - n1, f2 - n2
    l0, l1, l2 = 0.0, 0.0, 0.0  # of the next rod
    for i in range(N - 1, -1, -1):
        j, w = 13 * i, work[i]
        t = C * (w[0] * l0 + w[1] * l1 + w[2] * l2)
        k0, k1, k2 = times(w, w[9] - Q * l0 + t * w[0], w[10] - Q * l1 + t * w[1], w[11] - Q * l2 + t * w[2])
        e0, e1, e2, e3 = x[j + 3], x[j + 4], x[j + 5], x[j + 6]
        s, t, u, v = e0 * e0, e1 * e1, e2 * e2, e3 * e3
        s0, s1, s2 = k0 + l0, k1 + l1, k2 + l2
        f[j + 7] += (k0 - l0) / MASS
        f[j + 8] += (k1 - l1) / MASS
        f[j + 9] += (k2 - l2) / MASS
        f[j + 10] -= S / JX * (2.0 * (e1 * e2 - e0 * e3) * s0 + (s - t + u - v) * s1 + 2.0 * (e2 * e3 + e0 * e1) * s2)
        f[j + 11] += S / JX * ((s + t - u - v) * s0 + 2.0 * (e1 * e2 + e0 * e3) * s1 + 2.0 * (e1 * e3 - e0 * e2) * s2)
        l0, l1, l2 = k0, k1, k2


@numba.njit(**PART)
def project(x, work):
    """Unit p; centroids and their velocities from the joints, outwards."""
    r0, r1, r2, v0, v1, v2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(work.shape[0] - 1):
        j = 13 * i
        e0, e1, e2, e3 = x[j + 3], x[j + 4], x[j + 5], x[j + 6]
        k = 1.0 / np.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
        e0, e1, e2, e3 = k * e0, k * e1, k * e2, k * e3
        x[j + 3], x[j + 4], x[j + 5], x[j + 6] = e0, e1, e2, e3
        s, t, u, v = e0 * e0, e1 * e1, e2 * e2, e3 * e3
        a, b = S * x[j + 10], S * x[j + 11]
        a0, a1, a2 = 2.0 * S * (e1 * e3 + e0 * e2), 2.0 * S * (e2 * e3 - e0 * e1), S * (s - t - u + v)
        d0 = b * (s + t - u - v) - 2.0 * a * (e1 * e2 - e0 * e3)
        d1 = 2.0 * b * (e1 * e2 + e0 * e3) - a * (s - t + u - v)
        d2 = 2.0 * b * (e1 * e3 - e0 * e2) - 2.0 * a * (e2 * e3 + e0 * e1)
        x[j], x[j + 1], x[j + 2] = r0 - a0, r1 - a1, r2 - a2
        x[j + 7], x[j + 8], x[j + 9] = v0 - d0, v1 - d1, v2 - d2
        r0, r1, r2, v0, v1, v2 = (
            r0 - 2.0 * a0,
            r1 - 2.0 * a1,
            r2 - 2.0 * a2,
            v0 - 2.0 * d0,
            v1 - 2.0 * d1,
            v2 - 2.0 * d2,
        )


run = driver(evaluate, project)


def start(links):
    """x of the chain along the ground's x axis, at rest, and its workspace."""
    x = np.zeros((links, 13))
    x[:, 0], x[:, 3], x[:, 5] = np.arange(links) + 0.5, np.sqrt(0.5), -np.sqrt(0.5)
    return x.ravel(), np.zeros((links + 1, WORK))


def solve(links, tol):
    """(r (N, 3), p (N, 4)) after 1 s, and the steps taken."""
    x, work = start(links)
    steps, _ = run(x, work, END, tol)
    x = x.reshape(links, 13)
    return x[:, :3], x[:, 3:7], steps
