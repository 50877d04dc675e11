"""The sliding top in absolute coordinates, x = (r, p, v, omega'), 13 numbers.

With n = A^T e_z, the vertical in the body frame, the tip's row is Phi = r_z - n_z; its multiplier is the upward force
lam at the tip: m vd = (0, 0, lam - m g), J' omegad = (J' omega) x omega + lam (n_y, -n_x, 0), and nd = n x omega.
"""

import numba
import numpy as np

from .dop853 import driver
from .options import PART

MASS, GRAVITY, JX, JZ = 30.0, 9.6, 90.0, 30.0
END = 10.0


@numba.njit(**PART)
def vertical(x):
    """n = A(p)^T e_z, homogeneous in p."""
    e0, e1, e2, e3 = x[3], x[4], x[5], x[6]
    return 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3


@numba.njit(**PART)
def evaluate(x, work, f):
    """The right-hand side."""
    e0, e1, e2, e3, a, b, c = x[3], x[4], x[5], x[6], x[10], x[11], x[12]
    nx, ny, nz = vertical(x)
    ga, gb = (JX - JZ) / JX * b * c, (JZ - JX) / JX * a * c
    dx, dy = ny * c - nz * b, nz * a - nx * c
    bias = dx * b - dy * a + nx * gb - ny * ga  # n_z'' = bias - lam (n_x^2 + n_y^2) / JX = lam / m - g
    lam = (bias + GRAVITY) / (1.0 / MASS + (nx * nx + ny * ny) / JX)
    f[0], f[1], f[2] = x[7], x[8], x[9]
    f[3] = 0.5 * (-e1 * a - e2 * b - e3 * c)
    f[4] = 0.5 * (e0 * a - e3 * b + e2 * c)
    f[5] = 0.5 * (e3 * a + e0 * b - e1 * c)
    f[6] = 0.5 * (-e2 * a + e1 * b + e0 * c)
    f[7], f[8], f[9] = 0.0, 0.0, lam / MASS - GRAVITY
    f[10], f[11], f[12] = ga + lam / JX * ny, gb - lam / JX * nx, 0.0


@numba.njit(**PART)
def project(x, work):
    """Unit p; the height from the tilt, its rate from the turning."""
    s = 1.0 / np.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6])
    for i in range(3, 7):
        x[i] *= s
    nx, ny, nz = vertical(x)
    x[2], x[9] = nz, nx * x[11] - ny * x[10]


run = driver(evaluate, project)


def solve(tol):
    """(r (1, 3), p (1, 4)) after 10 s, and the steps taken."""
    x = np.zeros(13)
    x[2], x[3], x[10], x[12] = 1.0, 1.0, 0.5, 12.0
    steps, _ = run(x, np.zeros((1, 1)), END, tol)
    return x[None, :3], x[None, 3:7], steps
