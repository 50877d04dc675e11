"""The two-body pendulum in absolute coordinates, x = (p1, omega1', p2, omega2', r2, v2), 20 numbers; r1 stays zero.

d = P1 - P2, P1 = -A1 k, P2 = r2 + A2 k; the rod's row is (d.d - 1)/2, T its force density: T d pulls on P2, -T d on
P1. Both are spheres: J omegad_i = T k x A_i^T d, m vd2 = T d - m g k. With a_i = A_i k,

    T G = dd.dd + d.(P1'' - P2'') at T = 0,    G = d.d / m + (2 d.d - (a1.d)^2 - (a2.d)^2) / J
"""

import numba
import numpy as np

from .dop853 import driver
from .options import PART

MASS, GRAVITY, J = 75.0, 9.6, 30.0
END = 10.0


@numba.njit(**PART)
def columns(x, i):
    """A(p), column after column, p at x[i:]."""
    e0, e1, e2, e3 = x[i], x[i + 1], x[i + 2], x[i + 3]
    s, t, u, v = e0 * e0, e1 * e1, e2 * e2, e3 * e3
    return (
        (s + t - u - v, 2.0 * (e1 * e2 + e0 * e3), 2.0 * (e1 * e3 - e0 * e2)),
        (2.0 * (e1 * e2 - e0 * e3), s - t + u - v, 2.0 * (e2 * e3 + e0 * e1)),
        (2.0 * (e1 * e3 + e0 * e2), 2.0 * (e2 * e3 - e0 * e1), s - t - u + v),
    )


@numba.njit(**PART)
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(**PART)
def rod(x):
    """Axes of both bodies, d, dd and G."""
    A1, A2 = columns(x, 0), columns(x, 7)
    a, b = A1[2], A2[2]
    d = (-a[0] - x[14] - b[0], -a[1] - x[15] - b[1], -a[2] - x[16] - b[2])
    # ad = A (omega x k) = omega_y A_x - omega_x A_y
    p, q, r, s = x[5], x[4], x[12], x[11]
    dd = (
        -(p * A1[0][0] - q * A1[1][0]) - x[17] - (r * A2[0][0] - s * A2[1][0]),
        -(p * A1[0][1] - q * A1[1][1]) - x[18] - (r * A2[0][1] - s * A2[1][1]),
        -(p * A1[0][2] - q * A1[1][2]) - x[19] - (r * A2[0][2] - s * A2[1][2]),
    )
    dd2 = dot(d, d)
    return A1, A2, d, dd, dd2 / MASS + (2.0 * dd2 - dot(a, d) ** 2 - dot(b, d) ** 2) / J


@numba.njit(**PART)
def turning(A, d, w):
    """d.(A (omega x (omega x k)))."""
    x, y, z = dot(A[0], d), dot(A[1], d), dot(A[2], d)
    return (x * w[0] + y * w[1]) * w[2] - z * (w[0] * w[0] + w[1] * w[1])


@numba.njit(**PART)
def half(x, i, f):
    """f = pd of the body whose p and omega' are at x[i:]."""
    e0, e1, e2, e3, a, b, c = x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5], x[i + 6]
    f[i] = 0.5 * (-e1 * a - e2 * b - e3 * c)
    f[i + 1] = 0.5 * (e0 * a - e3 * b + e2 * c)
    f[i + 2] = 0.5 * (e3 * a + e0 * b - e1 * c)
    f[i + 3] = 0.5 * (-e2 * a + e1 * b + e0 * c)


@numba.njit(**PART)
def evaluate(x, work, f):
    """The right-hand side."""
    A1, A2, d, dd, G = rod(x)
    w1, w2 = (x[4], x[5], x[6]), (x[11], x[12], x[13])
    T = (dot(dd, dd) - turning(A1, d, w1) - turning(A2, d, w2) + GRAVITY * d[2]) / G
    half(x, 0, f)
    half(x, 7, f)
    f[4], f[5], f[6] = -T / J * dot(A1[1], d), T / J * dot(A1[0], d), 0.0
    f[11], f[12], f[13] = -T / J * dot(A2[1], d), T / J * dot(A2[0], d), 0.0
    f[14], f[15], f[16] = x[17], x[18], x[19]
    f[17], f[18], f[19] = T / MASS * d[0], T / MASS * d[1], T / MASS * d[2] - GRAVITY


@numba.njit(**PART)
def turn(x, i, a, b):
    """p turned by the small body vector (a, b, 0), and made a unit again."""
    e0, e1, e2, e3 = x[i], x[i + 1], x[i + 2], x[i + 3]
    e0, e1, e2, e3 = (
        e0 - 0.5 * (e1 * a + e2 * b), e1 + 0.5 * (e0 * a - e3 * b),
        e2 + 0.5 * (e3 * a + e0 * b), e3 + 0.5 * (e1 * b - e2 * a),
    )  # fmt: skip
    s = 1.0 / np.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    x[i], x[i + 1], x[i + 2], x[i + 3] = s * e0, s * e1, s * e2, s * e3


@numba.njit(**PART)
def project(x, work):
    """The rod's length and its rate put right by an impulse along it, Newton's method for the length."""
    turn(x, 0, 0.0, 0.0)
    turn(x, 7, 0.0, 0.0)
    for _ in range(4):
        A1, A2, d, dd, G = rod(x)
        mu = 0.5 * (dot(d, d) - 1.0) / G
        if abs(mu) * G < 1e-15:
            break
        turn(x, 0, -mu / J * dot(A1[1], d), mu / J * dot(A1[0], d))
        turn(x, 7, -mu / J * dot(A2[1], d), mu / J * dot(A2[0], d))
        for i in range(3):
            x[14 + i] += mu / MASS * d[i]
    A1, A2, d, dd, G = rod(x)
    mu = dot(d, dd) / G
    x[4] -= mu / J * dot(A1[1], d)
    x[5] += mu / J * dot(A1[0], d)
    x[11] -= mu / J * dot(A2[1], d)
    x[12] += mu / J * dot(A2[0], d)
    for i in range(3):
        x[17 + i] += mu / MASS * d[i]


run = driver(evaluate, project)


def solve(tol, start=((0.0, 0.0, 0.0), (0.0, 5.0, 0.0))):
    """(r (2, 3), p (2, 4)) after 10 s from omega1', omega2' (rad/s), and the steps taken."""
    x = np.zeros(20)
    x[0], x[4:7], x[7], x[11:14], x[16] = 1.0, start[0], 1.0, start[1], -3.0
    steps, _ = run(x, np.zeros((1, 1)), END, tol)
    return np.array([[0.0, 0.0, 0.0], x[14:17]]), np.array([x[0:4], x[7:11]]), steps
