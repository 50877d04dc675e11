"""Vectors of three components, Euler parameters p = (e0, e), and rotations by them, body to ground."""

import math

from ..jit.kernels import kernel

# Euler parameters p = (e0, e) and the rotation matrix A(p), body to ground, homogeneous of degree two in p.
#
#     A(p) s  = (e0^2 - e.e) s + 2 e (e.s) + 2 e0 e x s                                (1)
#     d(A s)  = 2 (e0 s + e x s) de0 + 2 ((e.s) de + e (s.de) - s (e.de) - e0 s x de)  (2)
#     G(p)    = [-e, -e~ + e0 I],   omega' = 2 G(p) pd,   pd = G(p)^T omega' / 2       (3)
#
# Haug, Computer-Aided Kinematics and Dynamics of Mechanical Systems, chapter 9; see docs/notation.md.


@kernel
def rotate(p, s, out):
    """out = A(p) s, Eq. (1); p (4,), s (3,), out (3,)."""
    e0, e1, e2, e3 = p[0], p[1], p[2], p[3]
    a = e0 * e0 - e1 * e1 - e2 * e2 - e3 * e3
    b = 2.0 * (e1 * s[0] + e2 * s[1] + e3 * s[2])
    c = 2.0 * e0
    out[0] = a * s[0] + b * e1 + c * (e2 * s[2] - e3 * s[1])
    out[1] = a * s[1] + b * e2 + c * (e3 * s[0] - e1 * s[2])
    out[2] = a * s[2] + b * e3 + c * (e1 * s[1] - e2 * s[0])


@kernel
def rotate_rate(p, pd, s, out):
    """out = (A(p) s)_p pd, Eq. (2)."""
    e0, e1, e2, e3 = p[0], p[1], p[2], p[3]
    es = 2.0 * (e1 * s[0] + e2 * s[1] + e3 * s[2])
    sd = 2.0 * (s[0] * pd[1] + s[1] * pd[2] + s[2] * pd[3])
    a = 2.0 * (e0 * pd[0] - e1 * pd[1] - e2 * pd[2] - e3 * pd[3])
    b0, b1, b2 = pd[0] * e1 + e0 * pd[1], pd[0] * e2 + e0 * pd[2], pd[0] * e3 + e0 * pd[3]
    out[0] = a * s[0] + es * pd[1] + sd * e1 + 2.0 * (b1 * s[2] - b2 * s[1])
    out[1] = a * s[1] + es * pd[2] + sd * e2 + 2.0 * (b2 * s[0] - b0 * s[2])
    out[2] = a * s[2] + es * pd[3] + sd * e3 + 2.0 * (b0 * s[1] - b1 * s[0])


@kernel
def rotate_gradient(p, s, f0, f1, f2, out):
    """out = f^T (A(p) s)_p, Eq. (2); f (3,) by components, out (4,)."""
    e0, e1, e2, e3 = p[0], p[1], p[2], p[3]
    es = 2.0 * (e1 * s[0] + e2 * s[1] + e3 * s[2])
    fe = 2.0 * (f0 * e1 + f1 * e2 + f2 * e3)
    fs = 2.0 * (f0 * s[0] + f1 * s[1] + f2 * s[2])
    x0 = 2.0 * (s[1] * f2 - s[2] * f1)  # 2 s x f
    x1 = 2.0 * (s[2] * f0 - s[0] * f2)
    x2 = 2.0 * (s[0] * f1 - s[1] * f0)
    out[0] = e0 * fs + e1 * x0 + e2 * x1 + e3 * x2
    out[1] = es * f0 + fe * s[0] - fs * e1 + e0 * x0
    out[2] = es * f1 + fe * s[1] - fs * e2 + e0 * x1
    out[3] = es * f2 + fe * s[2] - fs * e3 + e0 * x2


@kernel
def matrix_a(p, A):
    """A(p) (3, 3)."""
    e0, e1, e2, e3 = p[0], p[1], p[2], p[3]
    a = e0 * e0 - e1 * e1 - e2 * e2 - e3 * e3
    A[0, 0], A[0, 1], A[0, 2] = a + 2.0 * e1 * e1, 2.0 * (e1 * e2 - e0 * e3), 2.0 * (e1 * e3 + e0 * e2)
    A[1, 0], A[1, 1], A[1, 2] = 2.0 * (e1 * e2 + e0 * e3), a + 2.0 * e2 * e2, 2.0 * (e2 * e3 - e0 * e1)
    A[2, 0], A[2, 1], A[2, 2] = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), a + 2.0 * e3 * e3


@kernel
def matrix_g(p, G):
    """G(p) (3, 4), Eq. (3)."""
    e0, e1, e2, e3 = p[0], p[1], p[2], p[3]
    G[0, 0], G[0, 1], G[0, 2], G[0, 3] = -e1, e0, e3, -e2
    G[1, 0], G[1, 1], G[1, 2], G[1, 3] = -e2, -e3, e0, e1
    G[2, 0], G[2, 1], G[2, 2], G[2, 3] = -e3, e2, -e1, e0


@kernel
def multiply_g(p, x, out):
    """out = G(p) x, Eq. (3); p, x (4,), out (3,)."""
    out[0] = -p[1] * x[0] + p[0] * x[1] + p[3] * x[2] - p[2] * x[3]
    out[1] = -p[2] * x[0] - p[3] * x[1] + p[0] * x[2] + p[1] * x[3]
    out[2] = -p[3] * x[0] + p[2] * x[1] - p[1] * x[2] + p[0] * x[3]


# Vectors of three components and rotations by Euler parameters: tuples of numbers, or of arrays over outputs.
#
#     A(p) v   = v + 2 e x (e x v + e0 v),  A(p)^T v = v + 2 e x (e x v - e0 v)      p of unit length
#     omega'   = 2 G(p) pd                                                            body frame
#
# The functions are kernels; Python code calls their `twin`.

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
