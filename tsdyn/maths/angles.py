"""The polar angle of (x, y) as an analytic function: also for complex numbers, truncated Taylor series and arrays."""

import numpy as np

from ..jit.kernels import kernel

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
