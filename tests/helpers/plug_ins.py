"""A constraint and a force that give their series, written as a user would."""

import numpy as np

import tsdyn as ts
from tsdyn.plugins import dot, exponential, inverse_root, product, quotient, scaled, square


class Rod(ts.Primitive):
    """A plug-in: |x_a - x_b| - L, not squared."""

    rows, slots = 1, 5
    markers = (ts.Point("a"), ts.Point("b"))

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), length=1.0, name=""):
        super().__init__(a, b, (point_a, point_b), name)
        self.length = float(length)

    def parameters(self):
        return (self.length,)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = np.sqrt((x[0] - x[3]) ** 2 + (x[1] - x[4]) ** 2 + (x[2] - x[5]) ** 2) - par[0]

    @staticmethod
    def jacobian(x, par, t, out):
        l = np.sqrt((x[0] - x[3]) ** 2 + (x[1] - x[4]) ** 2 + (x[2] - x[5]) ** 2)
        for i in range(3):
            out[0, i] = (x[i] - x[3 + i]) / l
            out[0, 3 + i] = -out[0, i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        dd, dv, vv = 0.0, 0.0, 0.0
        for i in range(3):
            d, v = x[i] - x[3 + i], xd[i] - xd[3 + i]
            dd, dv, vv = dd + d * d, dv + d * v, vv + v * v
        out[0] = (vv - dv * dv / dd) / np.sqrt(dd)

    @staticmethod
    def series(x, par, k, s, out):
        for i in range(3):
            s[i, k] = x[i] - x[3 + i]
        s[3, k] = dot(s, 0, 0, k)
        s[4, k] = inverse_root(s[3], s[4], k)
        out[0, 0], out[0, 1], out[0, 2] = scaled(s, 0, 4, k)
        for i in range(3):
            out[0, 3 + i] = -out[0, i]


class Soft(ts.Force):
    """A plug-in on everything: friction of the point, the parameters and the turning, less of it further out."""

    markers = (ts.Point("a"), ts.Parameters("a"), ts.Turn("a"))
    loads = ("name",)
    slots = 17

    def __init__(self, a, *, point_a=(0, 0, 0), name=""):
        super().__init__(a, None, (point_a, None, None), name)

    @staticmethod
    def law(x, xd, par, t, out):
        size = np.exp(-0.3 * (x[0] * x[0] + x[1] * x[1])) / (2.0 + x[2] * x[2])
        for i in range(10):
            out[i] = -size * xd[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        for i in range(3):
            s[i, k] = x[i]
        s[3, k] = -0.3 * (square(s[0], k) + square(s[1], k))
        s[4, k] = exponential(s[3], s[4], k)
        s[5, k] = square(s[2], k) + (2.0 if k == 0 else 0.0)
        s[6, k] = quotient(s[4], s[5], s[6], k)
        for i in range(10):
            s[7 + i, k] = xd[i]
            out[i] = -product(s[6], s[7 + i], k)
