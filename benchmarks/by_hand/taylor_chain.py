"""Taylor series of a chain of N rods: rotation matrices, body rates, centroids and joint forces as series, O(N).

Rods as in chain.py, whose P, Q, c, s and lam are meant. At order k, with everything known up to A_k, omega_k, r_{k+1},
lam_{k-1}, the next coefficients follow from

    (k+1) A_{k+1} = [A omega~]_k,   (k+1)(k+2) m r_{k+2} = F_k + lam_k - lam_{k+1 of the next rod}
    (k+1) J' omega_{k+1} = [(J' omega) x omega]_k + s e_z x [A^T (lam + lam next)]_k

and lam_k from the joints' rows at order k + 2: the same block tridiagonal matrix, of order 0, at every order, factored
once a step. Series lie in memory order last, so that the sums of products run along it.
"""

import math

import numba
import numpy as np

from .options import ALONE

FAST = ALONE | {"fastmath": {"contract", "reassoc", "nsz"}}  # sums of products, in any order
MASS, GRAVITY, JX, JZ, S = 1.0, 9.81, 0.1, 0.02, 0.5
SIDE, END = 0.1, 1.0
C, Q = S * S / JX, S * S / JX - 1.0 / MASS


@numba.njit(**FAST)
def factor(R, D):
    """Inverse pivots D (N, 3, 3) of the matrix with P_{i-1} + P_i on its diagonal and Q_i beside it."""
    M, u = np.empty((3, 3)), np.empty(3)
    for i in range(R.shape[0]):
        for a in range(3):
            for b in range(3):
                M[a, b] = -C * R[i, 3 * a + 2, 0] * R[i, 3 * b + 2, 0] + (C + 1.0 / MASS if a == b else 0.0)
        if i > 0:
            k = 0.0
            for a in range(3):
                u[a] = 0.0
                for b in range(3):
                    u[a] += D[i - 1, a, b] * R[i - 1, 3 * b + 2, 0]
                k += R[i - 1, 3 * a + 2, 0] * u[a]
            for a in range(3):
                x = R[i - 1, 3 * a + 2, 0]
                for b in range(3):
                    y = R[i - 1, 3 * b + 2, 0]
                    M[a, b] += (C + 1.0 / MASS if a == b else 0.0) - C * x * y  # P_{i-1}
                    M[a, b] -= Q * Q * D[i - 1, a, b] - Q * C * (x * u[b] + u[a] * y) + C * C * k * x * y
        c0 = M[1, 1] * M[2, 2] - M[1, 2] * M[1, 2]
        c1 = M[0, 2] * M[1, 2] - M[0, 1] * M[2, 2]
        c2 = M[0, 1] * M[1, 2] - M[0, 2] * M[1, 1]
        r = 1.0 / (M[0, 0] * c0 + M[0, 1] * c1 + M[0, 2] * c2)
        D[i, 0, 0], D[i, 1, 1] = c0 * r, (M[0, 0] * M[2, 2] - M[0, 2] * M[0, 2]) * r
        D[i, 2, 2] = (M[0, 0] * M[1, 1] - M[0, 1] * M[0, 1]) * r
        D[i, 0, 1], D[i, 0, 2], D[i, 1, 2] = c1 * r, c2 * r, (M[0, 1] * M[0, 2] - M[0, 0] * M[1, 2]) * r
        D[i, 1, 0], D[i, 2, 0], D[i, 2, 1] = D[i, 0, 1], D[i, 0, 2], D[i, 1, 2]


@numba.njit(**FAST)
def coupled(R, i, D, b, out):
    """out = Q_i D_i b."""
    t0 = D[i, 0, 0] * b[0] + D[i, 0, 1] * b[1] + D[i, 0, 2] * b[2]
    t1 = D[i, 1, 0] * b[0] + D[i, 1, 1] * b[1] + D[i, 1, 2] * b[2]
    t2 = D[i, 2, 0] * b[0] + D[i, 2, 1] * b[1] + D[i, 2, 2] * b[2]
    k = C * (R[i, 2, 0] * t0 + R[i, 5, 0] * t1 + R[i, 8, 0] * t2)
    out[0], out[1], out[2] = Q * t0 - k * R[i, 2, 0], Q * t1 - k * R[i, 5, 0], Q * t2 - k * R[i, 8, 0]


@numba.njit(**FAST)
def known(R, W, L, i, k, near):
    """A_{k+1}; omega_{k+1} and s a'' (into near) of order k without lam_k."""
    d = 1.0 / (k + 1)
    for a in range(3):
        x, y, z = 0.0, 0.0, 0.0
        for j in range(k + 1):
            w0, w1, w2 = W[i, 0, k - j], W[i, 1, k - j], W[i, 2, k - j]
            x += R[i, 3 * a + 1, j] * w2 - R[i, 3 * a + 2, j] * w1
            y += R[i, 3 * a + 2, j] * w0 - R[i, 3 * a, j] * w2
            z += R[i, 3 * a, j] * w1 - R[i, 3 * a + 1, j] * w0
        R[i, 3 * a, k + 1], R[i, 3 * a + 1, k + 1], R[i, 3 * a + 2, k + 1] = x * d, y * d, z * d
    g0, g1 = 0.0, 0.0
    for j in range(k + 1):
        g0 += W[i, 1, j] * W[i, 2, k - j]
        g1 += W[i, 2, j] * W[i, 0, k - j]
    y0, y1 = 0.0, 0.0
    for a in range(3):
        for j in range(k):
            y0 += R[i, 3 * a, k - j] * L[i, a, j]
            y1 += R[i, 3 * a + 1, k - j] * L[i, a, j]
    W[i, 0, k + 1] = d * ((JX - JZ) * g0 - S * y1) / JX
    W[i, 1, k + 1] = d * ((JZ - JX) * g1 + S * y0) / JX
    W[i, 2, k + 1] = 0.0
    for a in range(3):  # (k + 1) [A (omega x e_z)]_{k+1}
        x = 0.0
        for j in range(k + 2):
            x += R[i, 3 * a, j] * W[i, 1, k + 1 - j] - R[i, 3 * a + 1, j] * W[i, 0, k + 1 - j]
        near[a] = (k + 1) * S * x


@numba.njit(**FAST)
def series(R, W, r, L, D, b, K):
    """Coefficients up to A_K, omega_K, r_{K+1}; L (N, 3, K) holds lam + lam next, b (N + 1, 4, 3) is workspace."""
    N = R.shape[0]
    factor(R, D)
    for k in range(K):
        for i in range(N):
            now, far, w = b[i, 0], b[i, 1], b[i, 2]
            known(R, W, L, i, k, w)
            for a in range(3):
                f = 0.0
                if k == 0 and a == 1 and i == N - 1:
                    f = SIDE / MASS
                elif k == 0 and a == 2:
                    f = -GRAVITY
                now[a], far[a] = -f - w[a], f - w[a]
                r[i, a, k + 2] = f
            if i > 0:
                coupled(R, i - 1, D, b[i - 1, 0], w)
                for a in range(3):
                    now[a] += b[i - 1, 1, a] - w[a]
        n0, n1, n2 = 0.0, 0.0, 0.0  # lam_k of the next rod
        d = 1.0 / (k + 1)
        for i in range(N - 1, -1, -1):
            now = b[i, 0]
            e = C * (R[i, 2, 0] * n0 + R[i, 5, 0] * n1 + R[i, 8, 0] * n2)
            x, y, z = (
                now[0] - Q * n0 + e * R[i, 2, 0],
                now[1] - Q * n1 + e * R[i, 5, 0],
                now[2] - Q * n2 + e * R[i, 8, 0],
            )
            l0 = D[i, 0, 0] * x + D[i, 0, 1] * y + D[i, 0, 2] * z
            l1 = D[i, 1, 0] * x + D[i, 1, 1] * y + D[i, 1, 2] * z
            l2 = D[i, 2, 0] * x + D[i, 2, 1] * y + D[i, 2, 2] * z
            s0, s1, s2 = l0 + n0, l1 + n1, l2 + n2
            L[i, 0, k], L[i, 1, k], L[i, 2, k] = s0, s1, s2
            W[i, 0, k + 1] -= d * S / JX * (R[i, 1, 0] * s0 + R[i, 4, 0] * s1 + R[i, 7, 0] * s2)
            W[i, 1, k + 1] += d * S / JX * (R[i, 0, 0] * s0 + R[i, 3, 0] * s1 + R[i, 6, 0] * s2)
            r[i, 0, k + 2] = d / (k + 2) * (r[i, 0, k + 2] + (l0 - n0) / MASS)
            r[i, 1, k + 2] = d / (k + 2) * (r[i, 1, k + 2] + (l1 - n1) / MASS)
            r[i, 2, k + 2] = d / (k + 2) * (r[i, 2, k + 2] + (l2 - n2) / MASS)
            n0, n1, n2 = l0, l1, l2


@numba.njit(**FAST)
def length(R, W, K, tol):
    """The step for which the last two terms are below the tolerance."""
    size = 1.0
    for i in range(R.shape[0]):
        for a in range(3):
            size = max(size, abs(W[i, a, 0]))
    h = np.inf
    for k in range(K - 1, K + 1):
        term = 0.0
        for i in range(R.shape[0]):
            for a in range(9):
                term = max(term, abs(R[i, a, k]))
            for a in range(3):
                term = max(term, abs(W[i, a, k]) / size)
        h = min(h, (tol / term) ** (1.0 / k))
    return h


@numba.njit(**FAST)
def advance(x, K, h):
    """Every row of x (rows, K + 1 or more) becomes its sum at h."""
    for i in range(x.shape[0]):
        s = x[i, K]
        for k in range(K - 1, -1, -1):
            s = s * h + x[i, k]
        x[i, 0] = s


@numba.njit(**FAST)
def project(R, W, r):
    """Orthonormal axes by one step of Newton's method; centroids and their velocities from the joints, outwards."""
    M, at, rate = np.empty((3, 3)), np.zeros(3), np.zeros(3)
    for i in range(R.shape[0]):
        for a in range(3):
            for b in range(3):
                g = R[i, a, 0] * R[i, b, 0] + R[i, 3 + a, 0] * R[i, 3 + b, 0] + R[i, 6 + a, 0] * R[i, 6 + b, 0]
                M[a, b] = (1.5 if a == b else 0.0) - 0.5 * g
        for a in range(3):
            x, y, z = R[i, 3 * a, 0], R[i, 3 * a + 1, 0], R[i, 3 * a + 2, 0]
            for b in range(3):
                R[i, 3 * a + b, 0] = x * M[0, b] + y * M[1, b] + z * M[2, b]
            s = S * R[i, 3 * a + 2, 0]
            v = S * (R[i, 3 * a, 0] * W[i, 1, 0] - R[i, 3 * a + 1, 0] * W[i, 0, 0])
            r[i, a, 0], r[i, a, 1] = at[a] - s, rate[a] - v
            at[a] -= 2.0 * s
            rate[a] -= 2.0 * v


@numba.njit(**FAST)
def run(R, W, r, end, K, tol):
    """Move R (N, 9, K + 1), W (N, 3, K + 1), r (N, 3, K + 2), whose first entries count, to `end` s; the steps."""
    N = R.shape[0]
    L, D, b = np.zeros((N, 3, K)), np.zeros((N, 3, 3)), np.zeros((N + 1, 4, 3))
    t, steps = 0.0, 0
    while t < end:
        series(R, W, r, L, D, b, K)
        h = length(R, W, K, tol)
        last = t + 1.0000001 * h >= end
        if last:
            h = end - t
        advance(R.reshape(9 * N, K + 1), K, h)
        advance(W.reshape(3 * N, K + 1), K, h)
        project(R, W, r)
        t = end if last else t + h
        steps += 1
    return steps


def solve(links, tol):
    """(r (N, 3), A (N, 3, 3)) after 1 s, and the steps taken."""
    K = math.ceil(1.0 - 0.5 * math.log(tol))
    R, W, r = np.zeros((links, 9, K + 1)), np.zeros((links, 3, K + 1)), np.zeros((links, 3, K + 2))
    R[:, 2, 0], R[:, 4, 0], R[:, 6, 0] = -1.0, 1.0, 1.0
    r[:, 0, 0] = np.arange(links) + 0.5
    steps = run(R, W, r, END, K, tol)
    return r[:, :, 0].copy(), R[:, :, 0].reshape(links, 3, 3), steps
