"""Elementary motions, their arithmetic and functions: polynomials of time, piecewise data, sines, exponentials."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument
from ..maths.power_series import Jet, Truncated
from ..validation import floats, number, shown
from . import program as code
from .tables import Table, is_data, pieces_of

# Smooth motions: functions of time with exact derivatives and Taylor series, without compilation.
#
#     Polynomial, Constant, Ramp, Sine, Exponential, and time itself
#     Piecewise, of data: tables and SciPy's splines
#     + - * / of them and of numbers, powers, and np.sin, cos, tan, exp, log, sqrt, sinh, cosh, tanh, arctan of them
#
# A motion is a graph of operations. `jet` evaluates value and two derivatives in Python, `run_program` the series in a
# run, independently.

if TYPE_CHECKING:
    from typing import TypeAlias

    from ..hints import ArrayLike, Callable, Data, Floats, Value

    Operator: TypeAlias = Callable[["Smooth", "Smooth | float"], "Smooth"]


class Operation(NamedTuple):
    """One kind of node: its code in a program, and its effect on numbers."""

    code: int
    rows: int  # written
    result: int  # index of the result
    apply: object  # of the operands' values and the numbers; of time, without operands


def _horner(t, c):
    total = 0.0 * t + c[-1]
    for coefficient in reversed(c[:-1]):
        total = total * t + coefficient
    return total


OPERATIONS = {
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
    "gate": Operation(code.GATE, 1, 0, lambda a, b: _gated(a, b)),
}


def _gated(a, b):
    """b where a is positive, else zero; of numbers or graphs."""
    if isinstance(a, Smooth) or isinstance(b, Smooth):
        return _binary("gate", a, b)
    return np.where(a > 0.0, b, 0.0)[()]


PLAIN = frozenset(("polynomial", "piecewise", "add", "subtract", "multiply", "sin", "cos"))  # operations


def _operators(operation: str) -> tuple[Operator, Operator]:
    """Return a binary operator of motions, and the same with a number on the left."""
    return lambda self, other: _binary(operation, self, other), lambda self, other: _binary(operation, other, self)


class Smooth:
    """Base of all smooth motions: an operation on others, or a (piecewise) polynomial of time.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> t = ts.motions.time
    >>> chirp = 0.1 * np.sin(3.0 * t + t**2)
    >>> print(f"{chirp(0.0):.3f}, rate {chirp.rate(0.0):.3f}, acceleration {chirp.acceleration(0.0):.3f}")
    0.000, rate 0.300, acceleration 0.200
    """

    @fitting
    def __init__(self, operation: str, operands: tuple[Smooth, ...] = (), numbers: Any = ()) -> None:
        self._operation, self._operands, self._numbers = operation, operands, numbers

    def _become(self, other):
        Smooth.__init__(self, other._operation, other._operands, other._numbers)

    def __call__(self, t: ArrayLike) -> Value:
        """The value at a time or times, s."""
        return self._on(t)

    def rate(self, t: ArrayLike) -> Value:
        """The first derivative at a time or times."""
        return self._jet(t).xd + 0.0 * t

    def acceleration(self, t: ArrayLike) -> Value:
        """The second derivative at a time or times."""
        return self._jet(t).xdd + 0.0 * t

    def jerk(self, t: ArrayLike) -> Value:
        """The third derivative at a time or times."""
        series = [self._on(Truncated([time, 1.0, 0.0, 0.0])) for time in np.ravel(t).tolist()]
        return 6.0 * np.reshape([x.c[3] for x in series], np.shape(t))[()]

    @property
    def pieces(self) -> list[Any]:
        """The `Pieces` among its nodes."""
        return [node._numbers for node in self._order() if node._operation == "piecewise"]

    @property
    def may_change(self) -> bool:
        """Whether it may change shortly within a piece, as polynomials and sines don't."""
        return not PLAIN.issuperset(node._operation for node in self._order())

    def sides(self, t: ArrayLike) -> Floats:
        """Value and rate at times t (k,), by the pieces that end there and by those that begin: (2, 2, k)."""
        found = [Jet.of(self._on(Jet(t, 1.0), left)) for left in (True, False)]
        return np.array([[x.x + 0.0 * t, x.xd + 0.0 * t] for x in found])

    def _jet(self, t):
        return Jet.of(self._on(Jet(t, 1.0)))

    def _on(self, t, left=False):
        """The value for time of any numeric type; left: at a knot, of the piece that ends there."""
        found = {}
        for node in self._order():
            operation = OPERATIONS[node._operation]
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
        return ordered([self])

    def program(self) -> list[float]:
        """The numbers that `run_program` interprets, with space for its rows."""
        row, constants, instructions, rows = {}, [], [], 0
        for node in self._order():
            operation = OPERATIONS[node._operation]
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

    __add__, __radd__ = _operators("add")
    __sub__, __rsub__ = _operators("subtract")
    __mul__, __rmul__ = _operators("multiply")
    __truediv__, __rtruediv__ = _operators("divide")

    def __neg__(self) -> Smooth:
        return _binary("multiply", -1.0, self)

    def __pos__(self) -> Smooth:
        return self

    def __pow__(self, n: float) -> Smooth:
        n = _plain(n)
        if n != int(n) or n < 0:
            return Smooth("power", (self,), (n,))
        if n < 2:
            return self if n else constant(1.0)
        half = self ** (n // 2)
        return half * half * self if n % 2 else half * half

    def __bool__(self) -> bool:
        raise TypeError("a motion is neither true nor false: it has no branches.")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **keywords: Any) -> Any:
        """NumPy's functions of a motion, and its arithmetic with one on the right."""
        if method == "__call__" and not keywords:
            if len(inputs) == 1 and ufunc.__name__ in FUNCTIONS:
                return FUNCTIONS[ufunc.__name__](self)
            if ufunc.__name__ == "power" and inputs[0] is self:
                return self ** inputs[1]
            if len(inputs) == 2 and ufunc.__name__ in ("add", "subtract", "multiply", "divide"):
                return _binary(ufunc.__name__, *inputs)
        raise TypeError(f"np.{ufunc.__name__} of a motion is not supported; there are {', '.join(FUNCTIONS)}.")

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self(0.0):g} at t = 0>"


def ordered(results: list[Smooth]) -> list[Smooth]:
    """All nodes of some graphs, operands first, each once."""
    done, ready, waiting = set(), [], [(node, False) for node in reversed(results)]
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


def evaluate(results: list[Smooth], inputs: Any) -> list[Any]:
    """The values of graphs of inputs, of any numeric type."""
    found: dict[int, Any] = {}
    for node in ordered(results):
        given = [found[id(operand)] for operand in node._operands]
        if node._operation == "input":
            found[id(node)] = inputs[int(node._numbers[0])]
        elif node._operation == "polynomial":
            found[id(node)] = node._numbers[0]
        else:
            numbers = (node._numbers,) if node._numbers else ()
            found[id(node)] = OPERATIONS[node._operation].apply(*given, *numbers)
    return [found[id(node)] for node in results]


def constant(value: float) -> Smooth:
    """Constant value."""
    return Smooth("polynomial", (), (value,))


def _binary(operation, x, y):
    return Smooth(operation, tuple(v if isinstance(v, Smooth) else constant(_plain(v)) for v in (x, y)))


def _plain(value):
    """Return a number to be combined with a motion."""
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


class Polynomial(Smooth):
    """c_0 + c_1 t + c_2 t^2 + ...

    Parameters
    ----------
    coefficients : array_like (n,)
        c_0 first; unit of the moved quantity over s^k.

    Raises
    ------
    InvalidArgument
        If a coefficient is not a finite number.

    Examples
    --------
    >>> import tsdyn as ts
    >>> start_up = ts.motions.Polynomial((0.0, 1.0, 0.5))
    >>> float(start_up(2.0)), float(start_up.rate(2.0))
    (4.0, 3.0)
    """

    @fitting
    def __init__(self, coefficients: ArrayLike) -> None:
        c = floats(coefficients)
        if c.ndim == 0 and np.isfinite(c):
            raise InvalidArgument(
                f"{type(self).__name__}: coefficients must be a list of finite numbers, c_0 first: "
                f"Polynomial([{coefficients!r}]), got {coefficients!r}."
            )
        if c.ndim != 1 or not c.size or not np.isfinite(c).all():
            raise InvalidArgument(
                f"{type(self).__name__}: coefficients must be finite numbers, c_0 first, got {coefficients!r}."
            )
        super().__init__("polynomial", (), tuple(c.tolist()))


class Constant(Polynomial):
    """Constant value.

    Examples
    --------
    >>> import tsdyn as ts
    >>> float(ts.motions.Constant(2.5)(1.0))
    2.5
    """

    @fitting
    def __init__(self, value: float) -> None:
        super().__init__(_demand(self, value=value))


class Ramp(Polynomial):
    """start + rate t: uniform motion.

    Examples
    --------
    >>> import tsdyn as ts
    >>> float(ts.motions.Ramp(start=1.0, rate=2.0)(3.0))
    7.0
    """

    @fitting
    def __init__(self, start: float = 0.0, rate: float = 1.0) -> None:
        super().__init__(_demand(self, start=start, rate=rate))


class Piecewise(Smooth):
    """A motion from data: a spline or another piecewise polynomial of time.

    Parameters
    ----------
    source : ts.Table, (times, values), or SciPy's PPoly (CubicSpline, PchipInterpolator, ...), BPoly or BSpline
        Of numbers. Outside its times it is extrapolated if the SciPy object has `extrapolate`; otherwise a run beyond
        them is refused.

    Raises
    ------
    InvalidArgument
        If the source is none of these, the times don't increase, or a value is not a real number.

    Notes
    -----
    Steps of a run end at the knots, so every method keeps its order. Constraints can't follow jumps of value or rate:
    a run across one is refused. Jumps of acceleration are allowed.

    Examples
    --------
    >>> from scipy.interpolate import PchipInterpolator
    >>> import tsdyn as ts
    >>> lift = ts.motions.Piecewise(PchipInterpolator((0.0, 1.0, 2.0), (0.0, 0.3, 0.3)))
    >>> print(f"{lift(1.0):.2f}, rate {lift.rate(1.5):.2f}")
    0.30, rate 0.00
    """

    @fitting
    def __init__(self, source: Data) -> None:
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
    def each(cls, source: Data) -> tuple[Piecewise, ...]:
        """One motion for each component of a source of vectors."""
        if not isinstance(source, Table):
            return tuple(cls._of(pieces) for pieces in pieces_of(source))
        if source.motions is None:  # motions of one table share its numbers
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
    """offset + amplitude sin(frequency t + phase), frequency in rad/s and phase in rad.

    Examples
    --------
    >>> import tsdyn as ts
    >>> wave = ts.motions.Sine(amplitude=0.1, frequency=2.0)
    >>> print(f"{wave(0.0):.2f}, rate {wave.rate(0.0):.2f}")
    0.00, rate 0.20
    """

    @fitting
    def __init__(self, amplitude: float, frequency: float, phase: float = 0.0, offset: float = 0.0) -> None:
        a, w, phi, c = _demand(self, amplitude=amplitude, frequency=frequency, phase=phase, offset=offset)
        wave = a * np.sin(Ramp(phi, w))
        self._become(c + wave if c else wave)


class Exponential(Smooth):
    """offset + amplitude exp(rate t), rate in 1/s.

    Examples
    --------
    >>> import tsdyn as ts
    >>> decay = ts.motions.Exponential(amplitude=2.0, rate=-1.0)
    >>> print(f"{decay(1.0):.4f}")
    0.7358
    """

    @fitting
    def __init__(self, amplitude: float, rate: float, offset: float = 0.0) -> None:
        a, r, c = _demand(self, amplitude=amplitude, rate=rate, offset=offset)
        growth = a * np.exp(Ramp(0.0, r))
        self._become(c + growth if c else growth)


def _demand(motion, **given):
    """Return the numbers; refuse, by name, a value that is not a finite number."""
    for name, value in given.items():
        if not math.isfinite(number(value)):
            raise InvalidArgument(f"{type(motion).__name__}: {name} must be a finite number, got {shown(value)}.")
    return [number(value) for value in given.values()]


time: Smooth = Ramp(0.0, 1.0)
