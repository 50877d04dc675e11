"""Vectors of three components and rotations by Euler parameters, as tuples of numbers or of arrays over outputs."""

import math


def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def sum_of(*vectors):
    """The sum of some vectors."""
    return tuple(map(sum, zip(*vectors, strict=True)))


def difference(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def unit(a):
    """A vector of numbers, scaled to unit length."""
    x, y, z = (float(entry) for entry in a)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def to_ground(p, v):
    """A(p) v; p of unit length, None for a body that never turns."""
    return v if p is None else _turned(p[0], p[1:], v)


def to_body(p, v):
    """A(p)^T v."""
    return v if p is None else _turned(-p[0], p[1:], v)


def _turned(e0, e, v):
    """v + 2 e x (e x v + e0 v)."""
    t = cross(e, v)
    t = t[0] + e0 * v[0], t[1] + e0 * v[1], t[2] + e0 * v[2]
    t = cross(e, t)
    return v[0] + 2.0 * t[0], v[1] + 2.0 * t[1], v[2] + 2.0 * t[2]
