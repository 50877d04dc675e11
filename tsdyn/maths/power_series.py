"""Truncated power series as numbers: of any order, and of second order (2-jets)."""

import operator
from types import MappingProxyType

import numpy as np

# Truncated power series of any order as numbers: a kernel evaluated on them gives the series of its result.
#
# The module is independent of `recurrences`, which it checks: functions are composed from their Taylor coefficients at
# the value of the argument, f(x_0 + d) = sum_n f_n d^n, where d^n vanishes beyond the order.


ARITHMETIC = MappingProxyType(
    {"add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv}
)


class _Series:
    """Arithmetic that follows from + * ** and -x, and NumPy's functions by name."""

    __slots__ = ()
    functions, operators = MappingProxyType({}), ARITHMETIC

    def __sub__(self, other):
        return self + (-self.of(other))

    def __rsub__(self, other):
        return self.of(other) - self

    def __radd__(self, other):
        return self + other

    def __rmul__(self, other):
        return self * other

    def __rtruediv__(self, other):
        return self.of(other) / self

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        """NumPy's functions, and its arithmetic with one on the right."""
        if method == "__call__" and not keywords:
            if len(inputs) == 1 and ufunc.__name__ in self.functions:
                return self.functions[ufunc.__name__](self)
            if len(inputs) == 2 and ufunc.__name__ in self.operators:
                return self.operators[ufunc.__name__](self.of(inputs[0]), self.of(inputs[1]))
        raise TypeError(f"np.{ufunc.__name__} has no Taylor series here; there are {', '.join(self.functions)}.")


class Truncated(_Series):
    """A power series in t, c[k] (K,) being the coefficient of t^k; operands have the same K, or are constants."""

    __slots__ = ("c",)

    def __init__(self, c):
        self.c = np.asarray(c, float)

    def of(self, value):
        """Return a series, or a constant as a series of the same length."""
        return value if isinstance(value, Truncated) else Truncated([value, *[0.0] * (self.c.size - 1)])

    @property
    def real(self):
        """The series itself, which is real."""
        return self

    @property
    def rate(self):
        """The derivative; its last coefficient, which is unknown, is zero."""
        return Truncated(np.append(np.arange(1, self.c.size) * self.c[1:], 0.0))

    def integral(self, value):
        """The integral from 0, plus a value."""
        return Truncated(np.append(value, self.c[:-1] / np.arange(1, self.c.size)))

    def composed(self, f):
        """sum_n f_n (self - value)^n."""
        d, total = Truncated([0.0, *self.c[1:]]), self.of(0.0)
        for coefficient in reversed(f):
            total = total * d + coefficient
        return total

    def power(self, n):
        """The n-th power, by the binomial series."""
        x, f = self.c[0], [self.c[0] ** n]
        for i in range(self.c.size - 1):
            f.append(f[-1] * (n - i) / ((i + 1) * x))
        return self.composed(f)

    def __add__(self, other):
        return Truncated(self.c + self.of(other).c)

    def __neg__(self):
        return Truncated(-self.c)

    def __mul__(self, other):
        return Truncated(np.convolve(self.c, self.of(other).c)[: self.c.size])

    def __truediv__(self, other):
        return self * self.of(other).power(-1.0)

    def __pow__(self, n):
        if isinstance(n, int) and n >= 0:
            result = self.of(1.0)
            for _ in range(n):
                result = result * self
            return result
        return self.power(n)


def _circular(x, values):
    """The values, which repeat after four derivatives, over n!."""
    n = np.arange(x.c.size)
    return x.composed(np.resize(values, n.size) / np.cumprod(np.maximum(n, 1)))


def _sine(x):
    s, c = np.sin(x.c[0]), np.cos(x.c[0])
    return _circular(x, [s, c, -s, -c])


def _cosine(x):
    s, c = np.sin(x.c[0]), np.cos(x.c[0])
    return _circular(x, [c, -s, -c, s])


def _exponential(x):
    return _circular(x, [np.exp(x.c[0])])


def _hyperbolic(x, sign):
    return (_exponential(x) + sign * _exponential(-x)) * 0.5


def _angle(y, x):
    return ((x * y.rate - y * x.rate) / (x * x + y * y)).integral(np.arctan2(y.c[0], x.c[0]))


Truncated.functions = {
    "sin": _sine,
    "cos": _cosine,
    "tan": lambda x: _sine(x) / _cosine(x),
    "sqrt": lambda x: x.power(0.5),
    "exp": _exponential,
    "log": lambda x: (x.rate / x).integral(np.log(x.c[0])),
    "sinh": lambda x: _hyperbolic(x, -1.0),
    "cosh": lambda x: _hyperbolic(x, 1.0),
    "tanh": lambda x: _hyperbolic(x, -1.0) / _hyperbolic(x, 1.0),
    "arctan": lambda x: (x.rate / (1.0 + x * x)).integral(np.arctan(x.c[0])),
    "square": lambda x: x * x,
    "negative": lambda x: -x,
    "floor": lambda x: x.of(np.floor(x.c[0])),  # of turns of an angle: piecewise constant
}
Truncated.operators = {**ARITHMETIC, "power": lambda x, y: x.power(y.c[0]), "arctan2": _angle}


# Second-order Taylor numbers (2-jets) x + x' t + x'' t^2 / 2: value and two derivatives through any formula.
#
# The phi of a primitive, evaluated on 2-jets, gives Phi and its two time derivatives without jacobian and gamma, so
# constraint errors of a solution are independent of the solver.


class Jet(_Series):
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

    def __mul__(self, other):
        o = Jet.of(other)
        return Jet(self.x * o.x, self.xd * o.x + self.x * o.xd, self.xdd * o.x + 2.0 * self.xd * o.xd + self.x * o.xdd)

    def _chain(self, f, fd, fdd):
        return Jet(f, fd * self.xd, fdd * self.xd * self.xd + fd * self.xdd)

    def __truediv__(self, other):
        return self * Jet.of(other) ** -1

    def __pow__(self, n):
        x = self.x
        if isinstance(n, int) and n >= 0:
            return self._chain(x**n, n * x ** max(n - 1, 0), n * (n - 1) * x ** max(n - 2, 0))
        return self._chain(1.0 * x**n, n * x ** (n - 1.0), n * (n - 1.0) * x ** (n - 2.0))

    def _root(self):
        """The square root; a length through zero has the rate sqrt(x'' / 2) just after."""
        r = np.sqrt(self.x)
        root = self._chain(r, 0.5 / r, -0.25 / (r * self.x))
        at_zero = (self.x == 0.0) & (self.xd == 0.0)
        return Jet(root.x, np.where(at_zero, np.sqrt(np.where(at_zero, 0.5 * self.xdd, 0.0)), root.xd), root.xdd)


def _jet_sine(x):
    s = np.sin(x)
    return s, np.cos(x), -s


def _jet_cosine(x):
    c = np.cos(x)
    return c, -np.sin(x), -c


def _tangent(x):
    t = np.tan(x)
    return t, 1.0 + t * t, 2.0 * t * (1.0 + t * t)


def _hyperbolic_tangent(x):
    t = np.tanh(x)
    return t, 1.0 - t * t, -2.0 * t * (1.0 - t * t)


_DERIVATIVES = {  # f, its derivative and its second derivative
    "sin": _jet_sine,
    "cos": _jet_cosine,
    "tan": _tangent,
    "exp": lambda x: (np.exp(x),) * 3,
    "log": lambda x: (np.log(x), 1.0 / x, -1.0 / x**2),
    "sinh": lambda x: (np.sinh(x), np.cosh(x), np.sinh(x)),
    "cosh": lambda x: (np.cosh(x), np.sinh(x), np.cosh(x)),
    "tanh": _hyperbolic_tangent,
    "arctan": lambda x: (np.arctan(x), 1.0 / (1.0 + x * x), -2.0 * x / (1.0 + x * x) ** 2),
    "square": lambda x: (x * x, 2.0 * x, 2.0),
    "negative": lambda x: (-x, -1.0, 0.0),
}
Jet.functions = {name: lambda jet, f=f: jet._chain(*f(jet.x)) for name, f in _DERIVATIVES.items()}
Jet.functions["sqrt"] = Jet._root
Jet.operators = {**ARITHMETIC, "power": lambda x, y: x**y.x}
