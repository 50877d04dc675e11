"""Functions of joint coordinates, for couplers: one function of one coordinate each, as programs of numbers."""

from __future__ import annotations

import inspect
from functools import cached_property
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidConstraint
from ..jit.kernels import kernel, stack, twin
from ..maths.power_series import Jet
from ..validation import shown
from .elementary import time
from .expressions import Smooth, evaluate, ordered
from .prescribed import Motion
from .program import call_smooth, run_program
from .tables import is_data
from .tracing import Symbol, Untraceable, Writer, call_order, demand_same, nodes, retold, run_order, run_rows, traced

if TYPE_CHECKING:
    from ..hints import Function

PLACES = 4  # floats of a function among the parameters of a term: addresses of its programs' kernels, and distances
ROWS = 48  # of scratch memory, at most, that its slope fills in a Taylor series


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


def functions_of(given: Function | Any, count: int, what: str) -> list[CoordinateFunction]:
    """The functions whose sum over `count` coordinates is given.

    Raises
    ------
    InvalidConstraint
        If it is no function of so many coordinates, can't be traced, or is no sum of functions of one coordinate each.
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
            f"{what} must be a plain function of {count} coordinates, one of ts.motions, a ts.Table or a spline of "
            f"SciPy's, got {shown(given)}."
        )
    try:
        inspect.signature(plain).bind(*range(count))
    except TypeError as error:
        raise InvalidConstraint(f"{what} is called with {count} coordinates, one of each joint: {error}.") from error
    try:
        own = retold(plain)
        found = traced(lambda q: [own(*q)], (count,), 1)
        demand_same(found, lambda q: [plain(*q)], (count,))
    except Untraceable as reason:
        raise InvalidConstraint(
            f"{what} can't be differentiated, {reason}. Write it with arithmetic and functions of NumPy, without "
            "branches; for data give a ts.Table or a spline."
        ) from reason
    parts = [0.0] * count
    for i, part in _separated(found[0], what):
        parts[i] = part + parts[i]
    return [CoordinateFunction(part if isinstance(part, Smooth) else time * 0.0 + part) for part in parts]


def _inputs(node):
    return {int(each._numbers[0]) for each in ordered([node]) if each._operation == "input"}


def _separated(node, what):
    """Yield (coordinate, function of it alone) whose sum a graph is; constants with the first coordinate."""
    used = _inputs(node)
    if len(used) < 2:
        (value,) = evaluate([node], [time] * (max(used, default=0) + 1))
        yield min(used, default=0), value
        return
    operation, operands = node._operation, node._operands
    factor = [i for i, operand in enumerate(operands) if not _inputs(operand)]
    if operation in ("add", "subtract"):
        yield from _separated(operands[0], what)
        for i, part in _separated(operands[1], what):
            yield i, part if operation == "add" else -1.0 * part
    elif factor and (operation == "multiply" or (operation == "divide" and factor == [1])):
        (scale,) = evaluate([operands[factor[0]]], [])
        for i, part in _separated(operands[1 - factor[0]], what):
            yield i, part * scale if operation == "multiply" else part / scale
    else:
        raise InvalidConstraint(
            f"{what} must be a sum of functions of one coordinate each, such as a * q1 + np.sin(q2); this one has a "
            f"product, or another function, of several ({operation})."
        )
