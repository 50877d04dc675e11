"""Smooth motions: functions of time that know their derivatives and their Taylor series, and compile nothing.

    Polynomial, Constant, Ramp, Sine, Exponential, and time itself
    Piecewise, of data: tables and SciPy's splines
    + - * / of them and of numbers, powers, and np.sin, cos, tan, exp, log, sqrt, sinh, cosh, tanh, arctan of them

A motion is a graph of operations. Its value and two derivatives follow in Python by `jet`, its series in a run by
`motion_program`; neither knows of the other.
"""

import math
import operator
from typing import NamedTuple

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument
from ..maths.power_series import Truncated
from ..maths.two_jets import Jet
from ..validation import floats, number
from . import program as code
from .tables import Table, is_data, pieces_of


class Operation(NamedTuple):
    """One kind of node: what it does in a program, and to numbers."""

    code: int
    rows: int  # that it writes
    result: int  # which of them is its own
    apply: object  # of the values of its operands, and of its numbers; of the time, where it has no operands


def _horner(t, c):
    total = 0.0 * t + c[-1]
    for coefficient in reversed(c[:-1]):
        total = total * t + coefficient
    return total


_OPERATIONS = {
    "polynomial": Operation(code.POLYNOMIAL, 1, 0, _horner),
    "piecewise": Operation(code.PIECEWISE, 1, 0, None),
    "add": Operation(code.ADD, 1, 0, operator.add),
    "subtract": Operation(code.SUBTRACT, 1, 0, operator.sub),
    "multiply": Operation(code.MULTIPLY, 1, 0, operator.mul),
    "divide": Operation(code.DIVIDE, 1, 0, operator.truediv),
    "power": Operation(code.POWER, 1, 0, lambda x, c: x ** c[0]),
    "sin": Operation(code.SINE, 2, 0, np.sin),
    "cos": Operation(code.SINE, 2, 1, np.cos),
    "exp": Operation(code.EXP, 1, 0, np.exp),
    "log": Operation(code.LOG, 1, 0, np.log),
    "tanh": Operation(code.TANH, 2, 0, np.tanh),
    "arctan": Operation(code.ARCTAN, 2, 0, np.arctan),
}


class Smooth:
    """Base of all smooth motions: one operation on others, or a polynomial of the time, whole or in pieces."""

    @fitting
    def __init__(self, operation, operands=(), numbers=()):
        self._operation, self._operands, self._numbers = operation, operands, numbers

    def _become(self, other):
        Smooth.__init__(self, other._operation, other._operands, other._numbers)

    def __call__(self, t):
        """The value at a time or times, s."""
        return self._on(t)

    def rate(self, t):
        """The first derivative at a time or times."""
        return self._jet(t).xd + 0.0 * t

    def acceleration(self, t):
        """The second derivative at a time or times."""
        return self._jet(t).xdd + 0.0 * t

    def jerk(self, t):
        """The third derivative at a time or times."""
        series = [self._on(Truncated([time, 1.0, 0.0, 0.0])) for time in np.ravel(t).tolist()]
        return 6.0 * np.reshape([x.c[3] for x in series], np.shape(t))[()]

    @property
    def pieces(self):
        """The `Pieces` that it is made of."""
        return [node._numbers for node in self._order() if node._operation == "piecewise"]

    def sides(self, t):
        """Value and rate at times t (k,), by the pieces that end there and by those that begin: (2, 2, k)."""
        found = [Jet.of(self._on(Jet(t, 1.0), left)) for left in (True, False)]
        return np.array([[x.x + 0.0 * t, x.xd + 0.0 * t] for x in found])

    def _jet(self, t):
        return Jet.of(self._on(Jet(t, 1.0)))

    def _on(self, t, left=False):
        """The value where the time is any kind of number; left: at a knot that of the piece which ends there."""
        found = {}
        for node in self._order():
            operation = _OPERATIONS[node._operation]
            if node._operation == "piecewise":
                found[id(node)] = node._numbers.value(t, left)
                continue
            if node._operation == "polynomial":
                found[id(node)] = operation.apply(t, node._numbers)
                continue
            given = [found[id(operand)] for operand in node._operands]
            found[id(node)] = operation.apply(*given, node._numbers) if node._numbers else operation.apply(*given)
        return found[id(self)]

    def _order(self):
        """All nodes, operands first, each once."""
        done, ready, waiting = set(), [], [(self, False)]
        while waiting:
            node, open_ = waiting.pop()
            if id(node) in done:
                continue
            if open_:
                done.add(id(node))
                ready.append(node)
            else:
                waiting.append((node, True))
                waiting += [(operand, False) for operand in node._operands]
        return ready

    def program(self):
        """The numbers that `motion_program` runs, with room for its rows."""
        row, constants, instructions, rows = {}, [], [], 0
        for node in self._order():
            operation = _OPERATIONS[node._operation]
            operands = [row[id(operand)] for operand in node._operands]
            if node._numbers:
                operands.append(len(constants))
                pieces = node._operation == "piecewise"
                constants += node._numbers.numbers() if pieces else node._numbers
            if node._operation == "polynomial":
                operands.append(len(node._numbers))
            instructions += [operation.code, rows, *operands, *[0] * (2 - len(operands))]
            row[id(node)] = rows + operation.result
            rows += operation.rows
        places = code.HEAD + len(instructions), code.HEAD + len(instructions) + len(constants)
        head = [0.0, len(instructions) // code.STEP, *places, rows, row[id(self)]]
        return [float(x) for x in (*head, *instructions, *constants)] + [0.0] * (rows * code.WIDTH)

    def __add__(self, other):
        return _binary("add", self, other)

    def __radd__(self, other):
        return _binary("add", other, self)

    def __sub__(self, other):
        return _binary("subtract", self, other)

    def __rsub__(self, other):
        return _binary("subtract", other, self)

    def __mul__(self, other):
        return _binary("multiply", self, other)

    def __rmul__(self, other):
        return _binary("multiply", other, self)

    def __truediv__(self, other):
        return _binary("divide", self, other)

    def __rtruediv__(self, other):
        return _binary("divide", other, self)

    def __neg__(self):
        return _binary("multiply", -1.0, self)

    def __pos__(self):
        return self

    def __pow__(self, n):
        n = _plain(n)
        if n != int(n) or n < 0:
            return Smooth("power", (self,), (n,))
        if n < 2:
            return self if n else Constant(1.0)
        half = self ** (n // 2)
        return half * half * self if n % 2 else half * half

    def __bool__(self):
        raise TypeError("a motion is neither true nor false: it has no branches.")

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        """NumPy's functions of a motion, and its arithmetic with one on the right."""
        if method == "__call__" and not keywords:
            if len(inputs) == 1 and ufunc.__name__ in FUNCTIONS:
                return FUNCTIONS[ufunc.__name__](self)
            if ufunc.__name__ == "power" and inputs[0] is self:
                return self ** inputs[1]
            if len(inputs) == 2 and ufunc.__name__ in ("add", "subtract", "multiply", "divide"):
                return _binary(ufunc.__name__, *inputs)
        raise TypeError(f"np.{ufunc.__name__} of a motion is not known here; there are {', '.join(FUNCTIONS)}.")

    def __repr__(self):
        return f"<{type(self).__name__}: {self(0.0):g} at t = 0>"


class Polynomial(Smooth):
    """c_0 + c_1 t + c_2 t^2 + ...

    Parameters
    ----------
    coefficients : array_like (n,)
        c_0 first; in the unit of what is moved, over s^k.

    Raises
    ------
    InvalidArgument
        If they are no finite numbers.
    """

    @fitting
    def __init__(self, coefficients):
        c = floats(coefficients)
        if c.ndim != 1 or not c.size or not np.isfinite(c).all():
            raise InvalidArgument(
                f"{type(self).__name__}: coefficients must be finite numbers, c_0 first, got {coefficients!r}."
            )
        super().__init__("polynomial", (), tuple(c.tolist()))


class Constant(Polynomial):
    """A value that stays."""

    @fitting
    def __init__(self, value):
        super().__init__(_demand(self, value=value))


class Ramp(Polynomial):
    """start + rate t: uniform motion."""

    @fitting
    def __init__(self, start=0.0, rate=1.0):
        super().__init__(_demand(self, start=start, rate=rate))


class Piecewise(Smooth):
    """A motion from data: a spline or another piecewise polynomial of the time.

    Parameters
    ----------
    source : ts.Table, (times, values), or SciPy's PPoly (CubicSpline, PchipInterpolator, ...), BPoly or BSpline
        Of numbers. Outside its times it goes on where SciPy's object says so by `extrapolate`; else a run that leaves
        them is refused.

    Raises
    ------
    InvalidArgument
        If it is none of these, its times don't increase, or its values are not real numbers.

    Notes
    -----
    Steps of a run end at the knots, so a method keeps its order. A constraint follows no jump of value or rate, and a
    run over one is refused; jumps of acceleration are followed.
    """

    @fitting
    def __init__(self, source):
        if not is_data(source):
            raise InvalidArgument(
                f"Piecewise: source must be a ts.Table, (times, values), or SciPy's CubicSpline, PPoly, BPoly or "
                f"BSpline, got {source!r}."
            )
        parts = pieces_of(source)
        if len(parts) != 1:
            raise InvalidArgument(f"Piecewise: source must have one value a time, it has {len(parts)}.")
        super().__init__("piecewise", (), parts[0])

    @classmethod
    def each(cls, source):
        """One motion for each component of a source of vectors."""
        if not isinstance(source, Table):
            return tuple(cls._of(pieces) for pieces in pieces_of(source))
        if source.motions is None:  # many may share a table's numbers
            source.motions = tuple(cls._of(pieces) for pieces in source.pieces())
        return source.motions

    @classmethod
    def _of(cls, pieces):
        motion = cls.__new__(cls)
        Smooth.__init__(motion, "piecewise", (), pieces)
        return motion

    def __repr__(self):
        return f"<Piecewise: {self._numbers!r}>"


class Sine(Smooth):
    """offset + amplitude sin(frequency t + phase), frequency in rad/s and phase in rad."""

    @fitting
    def __init__(self, amplitude, frequency, phase=0.0, offset=0.0):
        a, w, phi, c = _demand(self, amplitude=amplitude, frequency=frequency, phase=phase, offset=offset)
        wave = a * np.sin(Ramp(phi, w))
        self._become(c + wave if c else wave)


class Exponential(Smooth):
    """offset + amplitude exp(rate t), rate in 1/s."""

    @fitting
    def __init__(self, amplitude, rate, offset=0.0):
        a, r, c = _demand(self, amplitude=amplitude, rate=rate, offset=offset)
        growth = a * np.exp(Ramp(0.0, r))
        self._become(c + growth if c else growth)


def _demand(motion, **given):
    """The numbers, or an error that names the one that is none."""
    for name, value in given.items():
        if not math.isfinite(number(value)):
            raise InvalidArgument(f"{type(motion).__name__}: {name} must be a finite number, got {value!r}.")
    return [number(value) for value in given.values()]


def _binary(operation, x, y):
    return Smooth(operation, tuple(v if isinstance(v, Smooth) else Constant(_plain(v)) for v in (x, y)))


def _plain(value):
    """A number that a motion is combined with."""
    result = number(value)
    if not math.isfinite(result):
        raise InvalidArgument(f"a motion can be combined with motions and finite numbers, not with {value!r}.")
    return result


def _function(name):
    return lambda x: Smooth(name, (x,))


def _hyperbolic(x, sign):
    e = Smooth("exp", (x,))
    return 0.5 * e + (0.5 * sign) / e


FUNCTIONS = {
    **{name: _function(name) for name in ("sin", "cos", "exp", "log", "tanh", "arctan")},
    "tan": lambda x: Smooth("sin", (x,)) / Smooth("cos", (x,)),
    "sqrt": lambda x: Smooth("power", (x,), (0.5,)),
    "sinh": lambda x: _hyperbolic(x, -1.0),
    "cosh": lambda x: _hyperbolic(x, 1.0),
    "square": lambda x: x * x,
    "negative": lambda x: -x,
    "positive": lambda x: x,
}
time = Ramp(0.0, 1.0)
