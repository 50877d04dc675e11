"""Functions of joint coordinates, for couplers: of one coordinate each, or of several, as programs of numbers."""

from __future__ import annotations

import inspect
from functools import cached_property
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidConstraint
from ..jit.kernels import kernel, stack, stack2, twin
from ..maths.power_series import Jet
from ..validation import counted, shown
from .elementary import FUNCTIONS, Smooth, constant, evaluate, ordered, time
from .prescribed import Motion
from .program import call_smooth, run_program
from .tables import is_data
from .tracing import Symbol, Untraceable, Writer, call_order, demand_same, nodes, retold, run_order, run_rows, traced

if TYPE_CHECKING:
    from ..hints import Function

PLACES = 4  # floats of a function among the parameters of a term: addresses of its programs' kernels, and distances
ROWS = 48  # of scratch memory, at most, that its slope fills in a Taylor series
MOST = 5  # coordinates of a function of several
EVALUATED = 160  # rows, at most, of such a function and its derivatives


class CoordinateFunction:
    """A function of one joint coordinate, among the parameters of a term.

    Parameters
    ----------
    smooth : Smooth
        The function, of a coordinate in place of time.

    Attributes
    ----------
    no_series : str
        Why it has no Taylor series; "" where it has them.
    """

    def __init__(self, smooth: Smooth) -> None:
        self.smooth = smooth

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CoordinateFunction) and self.smooth is other.smooth

    def __hash__(self) -> int:
        return id(self.smooth)

    @property
    def places(self) -> tuple[Any, ...]:
        """What it is among the parameters of a term: itself, and room for the other PLACES."""
        return (self, *[0.0] * (PLACES - 1))

    def numbers(self) -> list[float]:
        """The program of the function, then that of its slope along a series."""
        return [*self.smooth.program(), *(self.slope or ())]

    def addresses(self, at: int, program: int) -> list[float]:
        """The numbers in its PLACES; the parameters begin at `at` in an array, the programs at `program`."""
        slope = program + len(self.smooth.program())
        return [float(x) for x in (run_program.address, program - at, run_order.address, slope - at)]

    @cached_property
    def slope(self) -> list[float] | None:
        """The program of the first derivative, whose argument is row 0 and result the row behind; None without one."""
        if self.smooth.pieces:
            return None
        try:
            found = Jet.of(self.smooth._on(Jet(Symbol(Smooth("input", (), (0.0,))), 1.0))).xd
            writer = Writer(nodes([found]), 2, (), 0, 1)
        except (TypeError, ValueError):
            return None
        return None if writer.rows > ROWS else writer.numbers()

    @property
    def no_series(self) -> str:
        """Why there is no Taylor series."""
        if self.smooth.pieces:
            return "its function is data, which change from piece to piece"
        return "" if self.slope else "its function has too many operations"


@kernel
def coordinate_function(par, at, x, order):
    """The function whose PLACES begin at par[at], or its derivative of an order, at a real or complex x."""
    out, real, factor = stack(5), x.real, 1.0
    call_smooth(int(par[at]), par[int(par[at + 1]) :], real, order + 2, out)
    for i in range(2, order + 1):
        factor *= i
    return factor * (out[order] + (order + 1.0) * out[order + 1] * (x - real))


@kernel
def slope_series(par, at, s, first, k):
    """Coefficient k of the function's slope along the series in row `first` of s, whose last rows are scratch."""
    for i in range(1, ROWS if k == 0 else 0):  # constants are written at order zero alone
        for j in range(s.shape[1]):
            s[first + i, j] = 0.0
    call_order(int(par[at + 2]), par[int(par[at + 3]) :], s[first:], ROWS, s.shape[1], k)
    return s[first + 1, k]


def _plain_function(par, at, x, order):
    """`coordinate_function` of jets and arrays."""
    smooth = par[at].smooth
    return (smooth, smooth.rate, smooth.acceleration)[order](x) if order else smooth._on(x)


def _plain_slope(par, at, s, first, k):
    """`slope_series` in Python."""
    if k == 0:
        s[first + 1 : first + ROWS] = 0.0
    twin(run_rows)(np.array(par[at].slope), s[first:], k)
    return s[first + 1, k]


coordinate_function.plain, slope_series.plain = _plain_function, _plain_slope


class JointFunction(CoordinateFunction):
    """The share of one coordinate in a function of several, among the parameters of a term.

    Parameters
    ----------
    graph : Smooth
        The function, of inputs.
    order : list of int
        The inputs, the coordinate's own first.
    whole : bool
        Whether the term has the value of the function.
    """

    def __init__(self, graph: Smooth, order: list[int], whole: bool) -> None:
        inputs = [Smooth("input", (), (float(order.index(i)),)) for i in range(len(order))]
        (smooth,) = evaluate([graph], inputs)
        super().__init__(smooth)
        self._slope = _derivative(smooth, 0)
        bends = [_derivative(self._slope, j) for j in range(len(order))]
        self.order = order
        self.results = [smooth if whole else constant(0.0), self._slope, *bends]
        self._program, self._series = (
            Writer(self.results, MOST + len(self.results), (), 0, MOST),
            Writer([self._slope], len(order) + 1, (), 0, len(order)),
        )

    __eq__, __hash__ = object.__eq__, object.__hash__

    @property
    def rows(self) -> int:
        """Of scratch memory of an evaluation."""
        return self._program.rows

    def numbers(self) -> list[float]:
        """The program of value, slope and second derivatives, then that of the slope along a series."""
        return [*self._program.numbers(), *self._series.numbers()]

    def addresses(self, at: int, program: int) -> list[float]:
        """The numbers in its PLACES."""
        slope = program + len(self._program.numbers())
        return [float(x) for x in (run_order.address, program - at, run_order.address, slope - at)]

    @property
    def no_series(self) -> str:
        """Why there is no Taylor series."""
        return "its function has too many operations" if self._series.rows > ROWS else ""


def _derivative(node, j):
    """The derivative of a graph of inputs by input j, as a graph."""
    known = {}
    for each in ordered([node]):
        x = each._operands
        slopes = [known[id(operand)] for operand in x]
        known[id(each)] = _slope(each, x, slopes, j)
    found = known[id(node)]
    return constant(0.0) if found is None else found


def _slope(node, x, slopes, j):
    """The derivative of an operation on x with these derivatives, None for zero."""
    what = node._operation
    if what == "input":
        return constant(1.0) if int(node._numbers[0]) == j else None
    if all(slope is None for slope in slopes):
        return None
    one, two = (*slopes, None)[:2]
    if what in ("add", "subtract"):
        if one is None or two is None:
            return one if two is None else two if what == "add" else -1.0 * two
        return one + two if what == "add" else one - two
    if what == "multiply":
        parts = [slope * other for slope, other in ((one, x[1]), (two, x[0])) if slope is not None]
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]
    if what == "divide":
        top = one if two is None else -1.0 * node * two if one is None else one - node * two
        return top / x[1]
    if what == "gate":
        return None if two is None else Smooth("gate", (x[0], two))
    c = node._numbers[0] if what == "power" else 0.0
    outer = {
        "power": lambda: c * x[0] ** (c - 1.0),
        "sin": lambda: FUNCTIONS["cos"](x[0]),
        "cos": lambda: -1.0 * FUNCTIONS["sin"](x[0]),
        "exp": lambda: node,
        "log": lambda: 1.0 / x[0],
        "tanh": lambda: 1.0 - node * node,
        "arctan": lambda: 1.0 / (1.0 + x[0] * x[0]),
    }
    return outer[what]() * one


@kernel
def joint_function(par, at, q):
    """(f, f_i, f_i0, ..., f_i4) at real or complex coordinates q, MOST of them; PLACES of the function from par[at]."""
    rows = stack2(EVALUATED, 2)
    for i in range(EVALUATED):  # constants are written at order zero alone
        rows[i, 1] = 0.0
    # f along the imaginary part of q, to first order
    program, d, step = par[int(par[at + 1]) :], q[0] - q[0].real, q[0].imag
    for j in range(MOST):
        rows[j, 0], rows[j, 1] = q[j].real, q[j].imag
        if abs(q[j].imag) > abs(step):
            d, step = q[j] - q[j].real, q[j].imag
    for k in range(2):
        call_order(int(par[at]), program, rows, EVALUATED, 2, k)
    d = d / step if step != 0.0 else 0.0 * d
    a, b = rows[MOST:, 0], rows[MOST:, 1]
    return (
        a[0] + b[0] * d, a[1] + b[1] * d, a[2] + b[2] * d, a[3] + b[3] * d, a[4] + b[4] * d, a[5] + b[5] * d,
        a[6] + b[6] * d,
    )  # fmt: skip


@kernel
def joint_slope(par, at, s, first, count, k):
    """Coefficient k of f_i along the series of `count` coordinates in the rows from `first` of s; the row it is in."""
    for i in range(count, ROWS if k == 0 else 0):
        for j in range(s.shape[1]):
            s[first + i, j] = 0.0
    call_order(int(par[at + 2]), par[int(par[at + 3]) :], s[first:], ROWS, s.shape[1], k)
    return first + count


def _plain_joint_function(par, at, q):
    """`joint_function` of jets and arrays."""
    results = par[at].results
    return [*evaluate(results, q), *[0.0] * (2 + MOST - len(results))]


def _plain_joint_slope(par, at, s, first, count, k):
    """`joint_slope` in Python."""
    if k == 0:
        s[first + count : first + ROWS] = 0.0
    twin(run_rows)(np.array(par[at]._series.numbers()), s[first:], k)
    return first + count


joint_function.plain, joint_slope.plain = _plain_joint_function, _plain_joint_slope


def functions_of(given: Function | Any, count: int, what: str) -> list[CoordinateFunction]:
    """The functions of `count` coordinates that are given: one of each whose sum it is, or the share of each.

    Raises
    ------
    InvalidConstraint
        If it is no function of so many coordinates, can't be traced, or has too many operations or coordinates.
    """
    if is_data(given) or isinstance(given, Smooth):
        if count != 1:
            raise InvalidConstraint(
                f"{what} is data, or one of ts.motions, of one coordinate; {count} joints are given."
            )
        motion = Motion.always(given, what)
        return [CoordinateFunction(motion.smooth)]
    plain = getattr(given, "py_func", given)
    if not isinstance(plain, FunctionType):
        raise InvalidConstraint(
            f"{what} must be a plain function of {counted(count, 'coordinate')}, one of ts.motions, a ts.Table or a "
            f"spline of SciPy's, got {shown(given)}."
        )
    try:
        inspect.signature(plain).bind(*range(count))
    except TypeError as error:
        raise InvalidConstraint(
            f"{what} is called with {counted(count, 'coordinate')}, one of each joint: {error}."
        ) from error
    try:
        own = retold(plain)
        found = traced(lambda q: [own(*q)], (count,), 1)
        demand_same(found, lambda q: [plain(*q)], (count,))
    except Untraceable as reason:
        raise InvalidConstraint(
            f"{what} can't be differentiated, {reason}. Write it with arithmetic and functions of NumPy, without "
            "branches; for data give a ts.Table or a spline."
        ) from reason
    parts, separated = [0.0] * count, _separated(found[0])
    if separated is None:
        return _shares(found[0], count, what)
    for i, part in separated:
        parts[i] = part + parts[i]
    return [CoordinateFunction(part if isinstance(part, Smooth) else time * 0.0 + part) for part in parts]


def _inputs(node):
    return {int(each._numbers[0]) for each in ordered([node]) if each._operation == "input"}


def _shares(graph, count, what):
    """The `JointFunction` of each coordinate of a function of several."""
    if count > MOST:
        raise InvalidConstraint(f"{what} is a function of {count} coordinates together; at most {MOST} are possible.")
    orders = [[i, *(j for j in range(count) if j != i)] for i in range(count)]
    shares = [JointFunction(graph, order, i == 0) for i, order in enumerate(orders)]
    if max(share.rows for share in shares) > EVALUATED:
        raise InvalidConstraint(
            f"{what} has too many operations to be differentiated twice; write it as a sum of functions of one "
            "coordinate each, or with fewer operations."
        )
    return shares


def _separated(node):
    """Pairs (coordinate, function of it alone) whose sum a graph is, constants with the first; None if it is none."""
    used = _inputs(node)
    if len(used) < 2:
        (value,) = evaluate([node], [time] * (max(used, default=0) + 1))
        return [(min(used, default=0), value)]
    operation, operands = node._operation, node._operands
    factor = [i for i, operand in enumerate(operands) if not _inputs(operand)]
    if operation in ("add", "subtract"):
        one, two = map(_separated, operands)
        if one is None or two is None:
            return None
        return one + [(i, part if operation == "add" else -1.0 * part) for i, part in two]
    if factor and (operation == "multiply" or (operation == "divide" and factor == [1])):
        (scale,), found = evaluate([operands[factor[0]]], []), _separated(operands[1 - factor[0]])
        return found and [(i, part * scale if operation == "multiply" else part / scale) for i, part in found]
    return None
