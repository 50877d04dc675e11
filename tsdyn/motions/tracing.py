"""Users' functions as graphs of operations; programs of functions of time and state."""

from __future__ import annotations

import math
from types import CellType, CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from ..jit.kernels import ANY, callback, caller, kernel, matrix, vector
from ..maths.recurrences import square
from .elementary import FUNCTIONS, OPERATIONS, Smooth, constant, evaluate, ordered, time
from .program import ADD, DIVIDE, MULTIPLY, POLYNOMIAL, SINE, STEP, SUBTRACT, operate
from .tolerances import PLAIN_DEGREE, SAME_VALUE, TIMES

# Users' functions as graphs of operations: a function is called once with symbols, which record what is done to them.
#
# A function that compares its arguments, converts them to numbers or hands them to compiled code can't be traced.


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


def gate(a: Any, b: Any) -> Any:
    """b where a is positive, else zero; of numbers or symbols."""
    found = OPERATIONS["gate"].apply(*(value.node if isinstance(value, Symbol) else value for value in (a, b)))
    return Symbol(found) if isinstance(found, Smooth) else found


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
        expected = tried(plain, t)
        if expected is not None:
            with np.errstate(all="ignore"):
                demand_near([motion(t) for motion in found], np.reshape(expected, width))
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
        expected = tried(call, *given)
        if expected is not None:
            with np.errstate(all="ignore"):
                demand_near(evaluate(results, np.concatenate(given)), expected)


def tried(call: Any, *arguments: Any) -> np.ndarray | None:
    """The values of a user's function, an array; None where it raises."""
    try:
        with np.errstate(all="ignore"):
            return np.array(call(*arguments), float)
    except Exception:
        return None


def demand_near(values: Any, expected: Any) -> None:
    """Refuse values that are not those expected."""
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
    names = names_of(plain.__code__)
    own = dict(plain.__globals__)
    copy = FunctionType(plain.__code__, own, plain.__name__, plain.__defaults__, _cells(plain, known))
    copy.__kwdefaults__ = plain.__kwdefaults__
    known[id(plain)] = copy
    own.update({name: _replaced(own[name], known) for name in names if name in own})
    return copy


def _cells(plain, known):
    closure = plain.__closure__
    return None if closure is None else tuple(CellType(_replaced(cell.cell_contents, known)) for cell in closure)


def names_of(code: CodeType) -> set[str]:
    """The names that a function and those inside it look up."""
    inner = (names_of(constant) for constant in code.co_consts if isinstance(constant, CodeType))
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


_NUMPY = _Module(np, zeros=_filled(0.0), empty=_filled(0.0), ones=_filled(1.0), linalg=_Module(np.linalg, norm=_norm))
_SAME = ("sin", "cos", "tan", "exp", "log", "log10", "sqrt", "sinh", "cosh", "tanh", "hypot", "pi", "e", "tau")
_MATH = SimpleNamespace(
    **{name: getattr(np if hasattr(np, name) else math, name) for name in _SAME},
    atan=np.arctan,
    pow=lambda x, y: x**y,
    fabs=abs,
)


# Programs of functions of time and state: as those of motions, but run order by order, since the state follows so.
#
# A program begins with
#
#     t, instructions, offset of the constants, instructions of constants alone, offset of the rows of the results,
#     results, row where the results go, rows, numbers of the program
#
# followed by four numbers an instruction: operation, row of the result, two operands. Inputs have the first rows; they
# are written by the caller at each order. A row is a series, one for each instance of the function.

HEAD, ALIGNED = 9, 8  # numbers before the instructions; those of a program are a multiple of that
T, COUNT, CONSTANTS, FIXED, RESULTS, GIVEN, PLACE, ROWS, LENGTH = range(HEAD)
SCALE, DIVIDE_BY, SQUARE = 100, 101, 102  # a constant times a series, a series over a constant, a series squared
SIGNATURE = "ppiii"  # program, rows, how many, coefficients of a row, k
call_order = caller(SIGNATURE)


@kernel
def run_rows(p, s, k):
    """Order k of the rows after the inputs, then of the results, in rows from `place` on; p is the program."""
    constants, results, place = int(p[CONSTANTS]), int(p[RESULTS]), int(p[PLACE])
    for i in range(0 if k == 0 else int(p[FIXED]), int(p[COUNT])):
        at = HEAD + STEP * i
        what, y, a, b = int(p[at]), int(p[at + 1]), int(p[at + 2]), int(p[at + 3])
        if what == SCALE:
            s[y, k] = s[a, 0] * s[b, k]
        elif what == DIVIDE_BY:
            s[y, k] = s[a, k] / s[b, 0]
        elif what == SQUARE:
            s[y, k] = square(s[a], k)
        else:
            operate(p, at, constants, s, p[T], k)
    for i in range(int(p[GIVEN])):
        s[place + i, k] = s[int(p[results + i]), k]


@callback(SIGNATURE)
def run_order(program, rows, count, orders, k):
    """The same of rows (count, orders), all given by address."""
    run_rows(vector(program, ANY), matrix(rows, count, orders), k)
    return 0


def may_change(program):
    """Whether the function may change within any part of a step, as sums, sines and products of a few factors don't."""
    degree = [1] * int(program[ROWS])  # of rows in the arguments, a sine's being that of its own
    for i in range(int(program[COUNT])):
        what, y, a, b = (int(x) for x in program[HEAD + STEP * i :][:STEP])
        if i < int(program[FIXED]):
            degree[y] = 0
        elif what in (ADD, SUBTRACT):
            degree[y] = max(degree[a], degree[b])
        elif what in (MULTIPLY, SQUARE):
            degree[y] = degree[a] + degree[a if what == SQUARE else b]
        elif what in (SINE, SCALE, DIVIDE_BY):
            degree[y] = degree[b if what == SCALE else a]
            degree[y + (what == SINE)] = degree[y]
        else:
            return True
        if degree[y] > PLAIN_DEGREE:
            return True
    return False


class Writer:
    """The program of some graphs.

    Parameters
    ----------
    results : list of Smooth
    inputs : int
        How many there are; they are in rows from `first` on.
    fixed : container of int
        Those that never change.
    first, place : int
        Rows where the inputs and the results begin.
    """

    def __init__(self, results, inputs, fixed, first, place):
        self.rows, self.known, self.constants = first + inputs, {}, []
        self.still, self.moving = [], []  # instructions of constants alone, and the others
        self.fixed = {first + i for i in fixed}  # rows that are constant
        row = {}
        for node in ordered(results):
            if node._operation == "input":
                row[id(node)] = first + int(node._numbers[0])
            else:
                row[id(node)] = self._row(node, [row[id(operand)] for operand in node._operands])
        self.results, self.place = [row[id(node)] for node in results], place

    def _row(self, node, operands):
        """The row of a node; the same one for the same operation on the same rows."""
        operation = OPERATIONS[node._operation]
        key = operation.code, *operands, node._numbers
        if key not in self.known:
            still = self.fixed.issuperset(operands)
            written = range(self.rows, self.rows + operation.rows)
            (self.still if still else self.moving).append(self._instruction(operation.code, operands, node, still))
            self.fixed.update(written if still else ())
            self.known[key], self.rows = written[0], written.stop
        return self.known[key] + operation.result

    def _instruction(self, what, operands, node, still):
        """Four numbers."""
        operands = list(operands)
        if node._numbers:
            operands.append(len(self.constants))
            self.constants += node._numbers
        if what == POLYNOMIAL:
            operands.append(len(node._numbers))
        if what == MULTIPLY and not still:
            a, b = operands
            if a == b:
                what = SQUARE
            elif a in self.fixed or b in self.fixed:
                what, operands = SCALE, [a, b] if a in self.fixed else [b, a]
        if what == DIVIDE and operands[1] in self.fixed and not still:
            what = DIVIDE_BY
        return [what, self.rows, *operands, *[0] * (2 - len(operands))]

    def numbers(self):
        """The program, a list of floats."""
        instructions = self.still + self.moving
        constants = HEAD + STEP * len(instructions)
        results = constants + len(self.constants)
        length = -(-(results + len(self.results)) // ALIGNED) * ALIGNED
        counts = len(instructions), constants, len(self.still), results, len(self.results), self.place, self.rows
        found = [0, *counts, length, *(number for each in instructions for number in each)]
        found += [*self.constants, *self.results]
        return [float(number) for number in found] + [0.0] * (length - len(found))
