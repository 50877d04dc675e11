"""Motions and loads from data: tables and SciPy's piecewise polynomials."""

from __future__ import annotations

import math
import reprlib
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument
from ..validation import floats
from .piecewise import Pieces

if TYPE_CHECKING:
    from ..hints import ArrayLike, Value


class Table:
    """Values at given times, interpolated by a cubic spline (SciPy's CubicSpline, not-a-knot): a load or a motion.

    Parameters
    ----------
    times : array_like (k,), s
        Increasing, at least two.
    values : array_like (k,) or (k, 3)
        Numbers or vectors, in the unit of the load or motion.

    Raises
    ------
    InvalidArgument
        If the times don't increase, or a number is not finite, or the shapes don't match.

    Notes
    -----
    A run must stay within the times. For other interpolation, or for extrapolation, give a SciPy
    object instead: CubicSpline, PchipInterpolator, make_interp_spline(...), any PPoly or BSpline.

    Examples
    --------
    >>> import tsdyn as ts
    >>> table = ts.Table(times=(0, 1, 2, 3), values=(0, 1, 4, 9))
    >>> print(f"{table(1.5):.4f}")
    2.2500
    """

    @fitting
    def __init__(self, times: ArrayLike, values: ArrayLike) -> None:
        self.times, self.values = floats(times), floats(values)
        k = self.times.size
        if self.times.ndim != 1 or k < 2 or not np.isfinite(self.times).all() or not (np.diff(self.times) > 0.0).all():
            raise InvalidArgument("Table: times must be two or more finite times in s, each after the one before.")
        if self.values.shape not in ((k,), (k, 3)) or not np.isfinite(self.values).all():
            raise InvalidArgument(
                f"Table: values must be {k} finite numbers or {k} vectors of three, one for each time, got "
                f"{reprlib.repr(values)}."
            )
        from scipy.interpolate import CubicSpline  # slow to import

        self._spline = CubicSpline(self.times, self.values, extrapolate=False)
        self.motions = None  # of `ts.motions`, on demand
        self.times.setflags(write=False)
        self.values.setflags(write=False)

    def __call__(self, t: ArrayLike) -> Value:
        """The values at a time or times; NaN outside the table."""
        return self._spline(t)

    def pieces(self) -> list[Any]:
        """A `Pieces` for each component."""
        return pieces_of(self._spline)

    def __repr__(self) -> str:
        return f"<Table of {self.times.size} values, {self.times[0]:g} to {self.times[-1]:g} s>"


def is_data(value):
    """Return True for data that `pieces_of` accepts: a Table, a SciPy object, or (times, values)."""
    if isinstance(value, (tuple, list)):
        return len(value) == 2 and all(isinstance(part, (np.ndarray, list, tuple)) for part in value)
    return isinstance(value, (Table, *_scipy()))


def pieces_of(value):
    """Return the `Pieces` of a Table, of SciPy's PPoly, BPoly or BSpline, or of (times, values), by components.

    Raises
    ------
    InvalidArgument
        If its times don't increase, it is not real, or it has more than one column of components.
    """
    if isinstance(value, (tuple, list)):
        value = Table(*value)
    if isinstance(value, Table):
        return value.pieces()
    from scipy.interpolate import BPoly, BSpline, PPoly

    name = type(value).__name__
    if isinstance(value, BPoly):
        value = PPoly.from_bernstein_basis(value)
    if np.iscomplexobj(value.c):
        raise InvalidArgument(f"{name}: its values must be real.")
    if isinstance(value, BSpline):
        knots = np.unique(value.t[value.k : value.t.size - value.k])
        places = range(value.k + 1)
        c = np.stack([value(knots[:-1], nu=i) / math.factorial(i) for i in places]) if knots.size > 1 else np.empty(0)
    else:
        knots, c = value.x, value.c[::-1]
    if knots.size < 2 or not (np.diff(knots) > 0.0).all():
        raise InvalidArgument(f"{name}: it needs two or more times, each after the one before.")
    if c.ndim not in (2, 3):
        raise InvalidArgument(f"{name}: its values must be numbers or vectors, their shape is {c.shape[2:]}.")
    beyond = "periodic" if isinstance(value.extrapolate, str) else bool(value.extrapolate)
    columns = c.reshape(*c.shape[:2], -1)
    return [Pieces(knots, columns[:, :, i].T, beyond) for i in range(columns.shape[2])]


def _scipy():
    """SciPy's classes of piecewise polynomials if SciPy is imported: otherwise nothing is an instance of them."""
    module = sys.modules.get("scipy.interpolate")
    return (module.PPoly, module.BPoly, module.BSpline) if module is not None else ()
