"""The angle of a point (x, y), analytic: also of complex numbers, truncated Taylor series and arrays."""

import numpy as np

from ..jit.kernels import kernel

TURN_ROUND = 2.0 * np.pi


@kernel
def angle(y, x):
    """The angle atan2(y, x) in (-pi, pi], exact to first order in an imaginary part and to second order of a series.

    The point is turned back by its real angle, so that what is left, atan(s / c) with s = 0, is s / c to second order.
    """
    real = np.arctan2(y.real, x.real)
    cosine, sine = np.cos(real), np.sin(real)
    return real + (y * cosine - x * sine) / (x * cosine + y * sine)


@kernel
def angle_near(y, x, near):
    """The angle of (x, y) on the turn that lies nearest to a real angle."""
    principal = angle(y, x)
    return principal + TURN_ROUND * np.floor((near - principal.real) / TURN_ROUND + 0.5)
