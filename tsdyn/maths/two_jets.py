"""Second-order Taylor numbers (2-jets) x + x' t + x'' t^2 / 2: value and two derivatives through any formula.

The phi of a primitive, evaluated on 2-jets, gives Phi and its two time derivatives without jacobian and gamma, so
constraint errors of a solution are independent of the solver.
"""

import operator

import numpy as np


class Jet:
    """Value and first two time derivatives; each an array over the outputs."""

    __slots__ = ("x", "xd", "xdd")

    def __init__(self, x, xd=0.0, xdd=0.0):
        self.x, self.xd, self.xdd = x, xd, xdd

    @staticmethod
    def of(value):
        """The value itself, or a constant as a Jet."""
        return value if isinstance(value, Jet) else Jet(value)

    @property
    def real(self):
        """The value without derivatives, by analogy with complex numbers."""
        return self.x

    def __add__(self, other):
        o = Jet.of(other)
        return Jet(self.x + o.x, self.xd + o.xd, self.xdd + o.xdd)

    def __neg__(self):
        return Jet(-self.x, -self.xd, -self.xdd)

    def __sub__(self, other):
        return self + (-Jet.of(other))

    def __rsub__(self, other):
        return Jet.of(other) - self

    def __mul__(self, other):
        o = Jet.of(other)
        return Jet(self.x * o.x, self.xd * o.x + self.x * o.xd, self.xdd * o.x + 2.0 * self.xd * o.xd + self.x * o.xdd)

    def _chain(self, f, fd, fdd):
        return Jet(f, fd * self.xd, fdd * self.xd * self.xd + fd * self.xdd)

    def __truediv__(self, other):
        return self * Jet.of(other) ** -1

    def __rtruediv__(self, other):
        return Jet.of(other) / self

    def __pow__(self, n):
        x = self.x
        if isinstance(n, int) and n >= 0:
            return self._chain(x**n, n * x ** max(n - 1, 0), n * (n - 1) * x ** max(n - 2, 0))
        return self._chain(1.0 * x**n, n * x ** (n - 1.0), n * (n - 1.0) * x ** (n - 2.0))

    def _root(self):
        """The square root; a length through zero has the rate sqrt(x'' / 2) just after."""
        root = self._chain(*_root(self.x))
        at_zero = (self.x == 0.0) & (self.xd == 0.0)
        return Jet(root.x, np.where(at_zero, np.sqrt(np.where(at_zero, 0.5 * self.xdd, 0.0)), root.xd), root.xdd)

    __radd__, __rmul__ = __add__, __mul__

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        """NumPy's functions of a Jet, and its arithmetic with one on the right."""
        if method == "__call__" and not keywords:
            if ufunc is np.sqrt:
                return self._root()
            if len(inputs) == 1 and ufunc.__name__ in _FUNCTIONS:
                return self._chain(*_FUNCTIONS[ufunc.__name__](self.x))
            if len(inputs) == 2 and ufunc.__name__ in _OPERATORS:
                return _OPERATORS[ufunc.__name__](Jet.of(inputs[0]), inputs[1])
        raise TypeError(f"np.{ufunc.__name__} has no Taylor series here; there are {', '.join(_FUNCTIONS)}.")


_OPERATORS = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
}


def _sine(x):
    s = np.sin(x)
    return s, np.cos(x), -s


def _cosine(x):
    c = np.cos(x)
    return c, -np.sin(x), -c


def _tangent(x):
    t = np.tan(x)
    return t, 1.0 + t * t, 2.0 * t * (1.0 + t * t)


def _root(x):
    r = np.sqrt(x)
    return r, 0.5 / r, -0.25 / (r * x)


def _hyperbolic_tangent(x):
    t = np.tanh(x)
    return t, 1.0 - t * t, -2.0 * t * (1.0 - t * t)


# f, its derivative and its second derivative
_FUNCTIONS = {
    "sin": _sine,
    "cos": _cosine,
    "tan": _tangent,
    "sqrt": _root,
    "exp": lambda x: (np.exp(x),) * 3,
    "log": lambda x: (np.log(x), 1.0 / x, -1.0 / x**2),
    "sinh": lambda x: (np.sinh(x), np.cosh(x), np.sinh(x)),
    "cosh": lambda x: (np.cosh(x), np.sinh(x), np.cosh(x)),
    "tanh": _hyperbolic_tangent,
    "arctan": lambda x: (np.arctan(x), 1.0 / (1.0 + x * x), -2.0 * x / (1.0 + x * x) ** 2),
    "square": lambda x: (x * x, 2.0 * x, 2.0),
    "negative": lambda x: (-x, -1.0, 0.0),
}
