"""Users' functions as graphs of operations: a function is called once with symbols, which record what is done to them.

A function that compares its arguments, converts them to numbers or hands them to compiled code can't be traced.
"""

from __future__ import annotations

import math
from types import CellType, CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from .elementary import time
from .expressions import FUNCTIONS, Smooth, constant, evaluate
from .tolerances import SAME_VALUE, TIMES


class Untraceable(TypeError):
    """Why a function can't be traced."""


def _refuse(reason):
    def method(self, *others):
        raise Untraceable(reason)

    return method


def _operator(name):
    """An operator of symbols and numbers; arrays take it element by element."""

    def method(self, other):
        if isinstance(other, np.ndarray):
            return NotImplemented
        return Symbol(getattr(self.node, name)(other.node if isinstance(other, Symbol) else other))

    return method


class Symbol:
    """An argument of a function, or what has been made of some; NumPy's functions of object arrays call its methods."""

    __slots__ = ("node",)
    __hash__ = None

    def __init__(self, node: Smooth) -> None:
        self.node = node

    __add__, __radd__ = _operator("__add__"), _operator("__radd__")
    __sub__, __rsub__ = _operator("__sub__"), _operator("__rsub__")
    __mul__, __rmul__ = _operator("__mul__"), _operator("__rmul__")
    __truediv__, __rtruediv__ = _operator("__truediv__"), _operator("__rtruediv__")
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __bool__ = _refuse("it compares values")
    __float__ = __int__ = __index__ = __complex__ = _refuse("it needs the number of a value")
    __abs__ = _refuse("it takes an absolute value")
    __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = _refuse("it rounds a value")

    def __neg__(self) -> Symbol:
        return Symbol(-self.node)

    def __pos__(self) -> Symbol:
        return self

    def __pow__(self, n: float) -> Symbol:
        if isinstance(n, Symbol):
            raise Untraceable("an exponent is no constant")
        return NotImplemented if isinstance(n, np.ndarray) else Symbol(self.node**n)

    def __rpow__(self, base: float) -> Symbol:
        return Symbol(FUNCTIONS["exp"](math.log(base) * self.node))

    def hypot(self, other: Symbol | float) -> Symbol:
        """Sqrt(x^2 + y^2)."""
        return (self * self + other * other).sqrt()

    def log10(self) -> Symbol:
        """Of base 10."""
        return self.log() / math.log(10.0)

    def __getattr__(self, name: str) -> Any:
        """A function of `ts.motions`."""
        if name in FUNCTIONS:
            return lambda: Symbol(FUNCTIONS[name](self.node))
        raise AttributeError(name)


def symbols(first: int, count: int) -> np.ndarray:
    """An array of the inputs from `first` on."""
    found = np.empty(count, object)
    found[:] = [Symbol(Smooth("input", (), (float(first + i),))) for i in range(count)]
    return found


def nodes(values: Any) -> list[Smooth]:
    """The graphs of what a function has made of symbols; numbers become constants."""
    return [value.node if isinstance(value, Symbol) else constant(float(value)) for value in values]


def of_time(function: Any, width: int) -> tuple[Smooth, ...]:
    """The `width` values of a user's function of time as motions.

    Raises
    ------
    Untraceable
        As of `traced`.
    """
    twin, plain = retold(function), getattr(function, "py_func", function)
    found = traced(lambda: np.reshape(np.array(twin(Symbol(time)), object), width), (), width)
    for t in TIMES:
        expected = _tried(plain, t)
        if expected is not None:
            with np.errstate(all="ignore"):
                _demand_near([motion(t) for motion in found], np.reshape(expected, width))
    return tuple(found)


def traced(call: Any, counts: tuple[int, ...], count: int) -> list[Smooth]:
    """The graphs of the `count` results of `call(*arguments)`, its arguments being arrays of so many inputs.

    Raises
    ------
    Untraceable
        If it is no composition of arithmetic and the functions of `ts.motions`, the same for all values.
    """
    begins = np.cumsum([0, *counts])
    try:
        found = nodes(call(*(symbols(int(at), n) for at, n in zip(begins, counts, strict=False))))
    except Untraceable:
        raise
    except Exception as error:
        raise Untraceable(f"{type(error).__name__}: {error}") from error
    if len(found) != count:
        raise Untraceable(f"it gives {len(found)} values in place of {count}")
    return found


def demand_same(results: list[Smooth], call: Any, counts: tuple[int, ...]) -> None:
    """Refuse graphs whose values are not those of the function they were traced from: it has hidden inputs."""
    rng = np.random.default_rng(0)
    for _ in range(2):
        given = [rng.uniform(0.5, 1.5, n) for n in counts]
        expected = _tried(call, *given)
        if expected is not None:
            with np.errstate(all="ignore"):
                _demand_near(evaluate(results, np.concatenate(given)), expected)


def _tried(call, *arguments):
    """The values of a user's function, an array; None where it raises."""
    try:
        with np.errstate(all="ignore"):
            return np.array(call(*arguments), float)
    except Exception:
        return None


def _demand_near(values, expected):
    for one, other in zip(values, expected, strict=True):
        if math.isfinite(other) and not abs(one - other) <= SAME_VALUE * (1.0 + abs(other)):
            raise Untraceable("it depends on more than its arguments")


def retold(function: Any, known: dict[int, Any] | None = None) -> Any:
    """A copy of a plain function for symbols: `math`, and NumPy where it makes arrays of floats, are replaced.

    So are the functions that it calls by a name of its module.
    """
    plain, known = getattr(function, "py_func", function), {} if known is None else known
    if id(plain) in known:
        return known[id(plain)]
    names = _names(plain.__code__)
    own = dict(plain.__globals__)
    copy = FunctionType(plain.__code__, own, plain.__name__, plain.__defaults__, _cells(plain, known))
    copy.__kwdefaults__ = plain.__kwdefaults__
    known[id(plain)] = copy
    own.update({name: _replaced(own[name], known) for name in names if name in own})
    return copy


def _cells(plain, known):
    closure = plain.__closure__
    return None if closure is None else tuple(CellType(_replaced(cell.cell_contents, known)) for cell in closure)


def _names(code):
    """The names that a function and those inside it look up."""
    inner = (_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*inner)


def _replaced(value, known):
    """What stands for a global of a traced function."""
    if value is math:
        return _MATH
    if value is np:
        return _NUMPY
    for module in (math, np, np.linalg):
        name = getattr(value, "__name__", None)
        if name and getattr(module, name, None) is value:
            return getattr({math: _MATH, np: _NUMPY, np.linalg: _NUMPY.linalg}[module], name, value)
    plain = getattr(value, "py_func", value)
    if isinstance(plain, FunctionType) and not plain.__module__.startswith("numpy"):
        return retold(plain, known)
    return value


def _norm(x):
    """The 2-norm of a vector."""
    return np.sqrt(np.dot(x, x))


def _filled(value):
    """What makes arrays of a value, for any numbers."""

    def make(shape, dtype=None):
        return np.full(shape, value, dtype=object)

    return make


class _Module:
    """A module with some of its functions replaced."""

    def __init__(self, module: ModuleType, **others: Any) -> None:
        self._module = module
        self.__dict__.update(others)

    def __getattr__(self, name: str) -> Any:
        """What is not replaced."""
        return getattr(self._module, name)


_NUMPY = _Module(
    np,
    zeros=_filled(0.0),
    empty=_filled(0.0),
    ones=_filled(1.0),
    linalg=_Module(np.linalg, norm=_norm),
)
_SAME = ("sin", "cos", "tan", "exp", "log", "log10", "sqrt", "sinh", "cosh", "tanh", "hypot", "pi", "e", "tau")
_MATH = SimpleNamespace(
    **{name: getattr(np if hasattr(np, name) else math, name) for name in _SAME},
    atan=np.arctan,
    pow=lambda x, y: x**y,
    fabs=abs,
)
