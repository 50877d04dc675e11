"""The polar angle of (x, y) as an analytic function: also for complex numbers, truncated Taylor series and arrays."""

import numpy as np

from ..jit.kernels import kernel
from .recurrences import angle as recurrence
from .recurrences import cross, dot, square

TURN_ROUND = 2.0 * np.pi


@kernel
def angle(y, x):
    """The angle atan2(y, x) in (-pi, pi], exact to first order in an imaginary part and to second order of a series.

    The point is rotated back by its real angle; the remainder atan(s / c) with s = 0 is s / c to second order.
    """
    real = np.arctan2(y.real, x.real)
    cosine, sine = np.cos(real), np.sin(real)
    return real + (y * cosine - x * sine) / (x * cosine + y * sine)


@kernel
def angle_near(y, x, near):
    """The angle of (x, y) on the turn that lies nearest to a real angle."""
    principal = angle(y, x)
    return principal + TURN_ROUND * np.floor((near - principal.real) / TURN_ROUND + 0.5)


@kernel
def angle_about(x, near):
    """The angle from f = x[3:6] to g = x[6:9] about u = x[:3], perpendicular to f, on the turn nearest to `near`."""
    w0, w1, w2 = x[1] * x[5] - x[2] * x[4], x[2] * x[3] - x[0] * x[5], x[0] * x[4] - x[1] * x[3]  # u x f
    y = x[6] * w0 + x[7] * w1 + x[8] * w2
    return angle_near(y, x[6] * x[3] + x[7] * x[4] + x[8] * x[5], near)


@kernel
def angle_series(near, k, s):
    """Coefficient k of `angle_about`, in row 18 of s; u, f, g are in rows 0 to 8; 9 to 11 and 15 to 17 are its own."""
    s[9, k], s[10, k], s[11, k] = cross(s, 0, 3, k)
    s[15, k] = dot(s, 6, 9, k)
    s[16, k] = dot(s, 6, 3, k)
    s[17, k] = square(s[15], k) + square(s[16], k)
    if k == 0:
        s[18, 0] = angle_near(s[15, 0], s[16, 0], near)
    else:
        s[18, k] = recurrence(s[15], s[16], s[17], s[18], k)
