"""Vectors of three components and rotations by Euler parameters: tuples of numbers, or of arrays over outputs.

    A(p) v   = v + 2 e x (e x v + e0 v),  A(p)^T v = v + 2 e x (e x v - e0 v)      p of unit length
    omega'   = 2 G(p) pd                                                            body frame

The functions are kernels; Python code calls their `twin`.
"""

import math

from ..jit.kernels import kernel

IDENTITY = (1.0, 0.0, 0.0, 0.0)


@kernel
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def rotated(e0, e1, e2, e3, v):
    """A(p) v."""
    x, y, z = e2 * v[2] - e3 * v[1] + e0 * v[0], e3 * v[0] - e1 * v[2] + e0 * v[1], e1 * v[1] - e2 * v[0] + e0 * v[2]
    return v[0] + 2.0 * (e2 * z - e3 * y), v[1] + 2.0 * (e3 * x - e1 * z), v[2] + 2.0 * (e1 * y - e2 * x)


@kernel
def to_ground(p, v):
    """A(p) v."""
    return rotated(p[0], p[1], p[2], p[3], v)


@kernel
def to_body(p, v):
    """A(p)^T v."""
    return rotated(-p[0], p[1], p[2], p[3], v)


@kernel
def spin(p, pd):
    """Angular velocity omega'; of pdd it is the angular acceleration."""
    return (
        2.0 * (p[0] * pd[1] - p[1] * pd[0] + p[3] * pd[2] - p[2] * pd[3]),
        2.0 * (p[0] * pd[2] - p[2] * pd[0] - p[3] * pd[1] + p[1] * pd[3]),
        2.0 * (p[0] * pd[3] - p[3] * pd[0] + p[2] * pd[1] - p[1] * pd[2]),
    )


def unit(a):
    """A vector of numbers, scaled to unit length."""
    x, y, z = (float(entry) for entry in a)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
