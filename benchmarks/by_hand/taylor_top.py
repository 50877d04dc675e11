"""Taylor series of the sliding top in minimal coordinates (p, omega'), n = A(p)^T e_z carried along.

The tip's row gives the height, r_z = n_z; x and y stay, and so does omega'_z = c. With lam the force at the tip,

    nd = n x omega,  m nz'' = lam - m g
    ad = G b c + lam ny / Jx,  bd = -G a c - lam nx / Jx,  G = (Jx - Jz) / Jx

and at order k everything but lam_k is known in (k + 1)(k + 2) m nz_{k+2} = lam_k - m g [k = 0], which is linear in it.
Order and step from the tolerance: Jorba and Zou, Exp. Math. 14 (2005), sections 3.1 and 3.2.
"""

import math

import numba
import numpy as np

from .options import ALONE

MASS, GRAVITY, JX, JZ = 30.0, 9.6, 90.0, 30.0
SPIN, END = 12.0, 10.0
G = (JX - JZ) / JX
E0, E1, E2, E3, NX, NY, NZ, WA, WB, LAM = range(10)


@numba.njit(**ALONE)
def series(y, K):
    """Coefficients 1 to K, y (K + 2, 10); those of order 0 are given but for lam."""
    c = SPIN
    # nz leads by one order
    y[1, NZ] = y[0, NX] * y[0, WB] - y[0, NY] * y[0, WA]
    for k in range(K):
        p0a, p1a, p2a, p3a, p0b, p1b, p2b, p3b = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        za, zb, lx, ly = 0.0, 0.0, 0.0, 0.0
        for j in range(k + 1):
            a, b = y[k - j, WA], y[k - j, WB]
            p0a += y[j, E0] * a
            p1a += y[j, E1] * a
            p2a += y[j, E2] * a
            p3a += y[j, E3] * a
            p0b += y[j, E0] * b
            p1b += y[j, E1] * b
            p2b += y[j, E2] * b
            p3b += y[j, E3] * b
            za += y[j, NZ] * a
            zb += y[j, NZ] * b
        for j in range(k):
            lx += y[j, LAM] * y[k - j, NX]
            ly += y[j, LAM] * y[k - j, NY]
        d = 1.0 / (k + 1)
        y[k + 1, E0] = 0.5 * d * (-p1a - p2b - y[k, E3] * c)
        y[k + 1, E1] = 0.5 * d * (p0a - p3b + y[k, E2] * c)
        y[k + 1, E2] = 0.5 * d * (p3a + p0b - y[k, E1] * c)
        y[k + 1, E3] = 0.5 * d * (-p2a + p1b + y[k, E0] * c)
        y[k + 1, NX] = d * (y[k, NY] * c - zb)
        y[k + 1, NY] = d * (za - y[k, NX] * c)
        a, b = d * (G * y[k, WB] * c + ly / JX), -d * (G * y[k, WA] * c + lx / JX)  # without lam_k
        s = y[0, NX] * b - y[0, NY] * a
        for j in range(1, k + 2):
            s += y[j, NX] * y[k + 1 - j, WB] - y[j, NY] * y[k + 1 - j, WA]
        r = y[0, NX] * y[0, NX] + y[0, NY] * y[0, NY]
        lam = (MASS * (k + 1) * s + (MASS * GRAVITY if k == 0 else 0.0)) / (1.0 + MASS * r / JX)
        y[k, LAM] = lam
        y[k + 1, WA], y[k + 1, WB] = a + d * lam * y[0, NY] / JX, b - d * lam * y[0, NX] / JX
        y[k + 2, NZ] = (s - d * lam * r / JX) / (k + 2)


@numba.njit(**ALONE)
def length(y, K, tol):
    """The step for which the last two terms are below the tolerance."""
    h = np.inf
    for k in range(K - 1, K + 1):
        size = 0.0
        for i in range(4):
            size = max(size, abs(y[k, i]))
        size = max(size, abs(y[k, WA]) / SPIN, abs(y[k, WB]) / SPIN)
        h = min(h, (tol / size) ** (1.0 / k))
    return h


@numba.njit(**ALONE)
def run(x, end, K, tol):
    """Move x = (p, omega'_x, omega'_y) from its start to `end` s; returns the steps."""
    y = np.zeros((K + 2, 10))
    t, steps = 0.0, 0
    while t < end:
        e0, e1, e2, e3 = x[0], x[1], x[2], x[3]
        y[0, :4], y[0, WA], y[0, WB] = x[:4], x[4], x[5]
        y[0, NX], y[0, NY] = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1)
        y[0, NZ] = e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3
        series(y, K)
        h = length(y, K, tol)
        last = t + 1.0000001 * h >= end
        if last:
            h = end - t
        for i in range(6):
            c = i if i < 4 else i + 3
            s = y[K, c]
            for k in range(K - 1, -1, -1):
                s = s * h + y[k, c]
            x[i] = s
        x[:4] *= 1.0 / math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
        t = end if last else t + h
        steps += 1
    return steps


def solve(tol):
    """(r (1, 3), p (1, 4)) after 10 s, and the steps taken."""
    x = np.array([1.0, 0.0, 0.0, 0.0, 0.5, 0.0])
    steps = run(x, END, math.ceil(1.0 - 0.5 * math.log(tol)), tol)
    r = np.array([[0.0, 0.0, x[0] ** 2 - x[1] ** 2 - x[2] ** 2 + x[3] ** 2]])
    return r, x[None, :4], steps
