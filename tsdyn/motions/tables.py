"""Motions and loads from data: tables and SciPy's piecewise polynomials."""

from __future__ import annotations

import math
import reprlib
import sys
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting, line_of_user
from ..errors import InvalidArgument
from ..maths.power_series import Truncated
from ..validation import floats, one_of
from .tolerances import EXTREMUM, OVERSHOOT, SAME_VALUE

if TYPE_CHECKING:
    from ..hints import ArrayLike, TableKind, Value


# Piecewise polynomials in time: data of splines, and their values in Python.
#
# On piece i the value is sum_k c[i, k] (t - knots[i])^k. At a knot the piece to its right holds, as in SciPy.
# `run_program` evaluates the same data in a run.

HEAD = 7  # numbers before the knots: pieces, coefficients of each, period, beyond, piece, shift, held
NEXT_AFTER = 4  # neighbours tried where a knot of a later period is rounded into the piece before


class Pieces:
    """A piecewise polynomial of time.

    Parameters
    ----------
    knots : ndarray (n + 1,), s
        Increasing.
    c : ndarray (n, k)
        Coefficients of each piece about its first knot, the constant one first.
    beyond : bool or "periodic"
        Outside the knots: no value, extrapolation of the end pieces, or periodic continuation.
    """

    def __init__(self, knots, c, beyond=False):
        self.knots, self.c, self.beyond = np.ascontiguousarray(knots), np.ascontiguousarray(c), beyond
        if not (np.isfinite(self.knots).all() and np.isfinite(self.c).all()):
            raise InvalidArgument("a piecewise motion needs finite times and coefficients.")
        if not (np.diff(self.knots) > 0.0).all():
            raise InvalidArgument("a piecewise motion needs times that increase.")

    @property
    def period(self):
        """The period, s; 0 if there is none."""
        return self.knots[-1] - self.knots[0] if self.beyond == "periodic" else 0.0

    @property
    def covers(self):
        """First and last time with a value, s."""
        return (self.knots[0], self.knots[-1]) if self.beyond is False else (-np.inf, np.inf)

    def find(self, t, left=False):
        """Return the piece at times t, and the shift of its knots; left: at a knot, the piece that ends there."""
        first, last, period = self.knots[0], self.knots.size - 2, self.period
        shift = np.floor((t - first) / period) * period if period else np.zeros_like(t)
        if left and period:
            shift = np.where(t - shift <= first, shift - period, shift)
        i = np.searchsorted(self.knots, t - shift, side="left" if left else "right") - 1
        return np.clip(i, 0, last), shift

    def value(self, t, left=False):
        """Return the value for time of any numeric type."""
        at = np.asarray((t.c[0] if isinstance(t, Truncated) else t).real, float)
        i, shift = self.find(at, left)
        x, c = (t - shift) - self.knots[i], self.c[i]
        low, high = self.covers
        total = 0.0 * x + np.where((at >= low) & (at <= high), c[..., -1], np.nan)
        for k in range(self.c.shape[1] - 2, -1, -1):
            total = total * x + c[..., k]
        return total

    def joints(self, t0, t1):
        """The knots in (t0, t1] at which a piece ends and another begins."""
        if not self.period:
            inner = self.knots[1:-1]
            return inner[(inner > t0) & (inner <= t1)]
        turns = np.arange(np.floor((t0 - self.knots[0]) / self.period), (t1 - self.knots[0]) / self.period + 1.0)
        times = (self.knots[:-1] + (turns * self.period)[:, None]).ravel()
        piece = np.tile(np.arange(self.knots.size - 1), turns.size)
        for _ in range(NEXT_AFTER):
            times = np.where(self.find(times)[0] == piece, times, np.nextafter(times, np.inf))
        return times[(times > t0) & (times <= t1)]

    def numbers(self):
        """Return the numbers of the piece for `run_program`, a list of floats."""
        head = [self.c.shape[0], self.c.shape[1], self.period, self.beyond is not False, 0, 0, 0]
        return [*map(float, head), *self.knots.tolist(), *self.c.ravel().tolist()]

    def __repr__(self):
        return f"<{len(self.c)} pieces, {self.knots[0]:g} to {self.knots[-1]:g} s>"


class Table:
    """Values at given times, interpolated: a load or a motion.

    Parameters
    ----------
    times : array_like (k,), s
        Two or more, in order. A time that is given twice is a jump, from its first value to its second.
    values : array_like (k,) or (k, 3)
        Numbers or vectors, in the unit of the load or motion.
    kind : {"cubic", "linear", "previous", "pchip"}
        Between the times, and from jump to jump: a cubic spline (SciPy's CubicSpline, not-a-knot), which is smooth and
        may overshoot; straight lines; the value of the time before; a monotone cubic (SciPy's PchipInterpolator), which
        never leaves the range of neighbouring values.

    Raises
    ------
    InvalidArgument
        If a time is before the one before or given more than twice, a number is not finite, the shapes don't match, or
        the kind is unknown.

    Warns
    -----
    UserWarning
        If a cubic spline overshoots its values.

    Notes
    -----
    Steps of a run end at the times, so every method keeps its order. A run must stay within the times. For other
    interpolation, or for extrapolation, give a SciPy object instead: CubicSpline, make_interp_spline(...), any PPoly or
    BSpline. Constraints follow motions "cubic" and "pchip" without jumps; "linear" and "previous" are for loads.

    Examples
    --------
    >>> import tsdyn as ts
    >>> table = ts.Table(times=(0, 1, 2, 3), values=(0, 1, 4, 9))
    >>> print(f"{table(1.5):.4f}")
    2.2500
    >>> pulse = ts.Table((0, 1, 1, 1.5, 1.5, 9), (0, 0, 8, 8, 0, 0), kind="linear")
    >>> print(pulse((0.9, 1.0, 1.2, 1.5)))
    [0. 8. 8. 0.]
    """

    @fitting
    def __init__(self, times: ArrayLike, values: ArrayLike, kind: TableKind = "cubic") -> None:
        self.times, self.values = floats(times), floats(values)
        self.kind = one_of(kind, tuple(MAKERS), "Table: kind")
        k = self.times.size
        if self.times.ndim != 1 or k < 2 or not np.isfinite(self.times).all() or not _increase(self.times):
            raise InvalidArgument(
                "Table: times must be two or more finite times in s, each after the one before; two that are the same "
                "are a jump."
            )
        if self.values.shape not in ((k,), (k, 3)) or not np.isfinite(self.values).all():
            raise InvalidArgument(
                f"Table: values must be {k} finite numbers or {k} vectors of three, one for each time, got "
                f"{reprlib.repr(values)}."
            )
        self._spline, said = _interpolated(self.times, self.values, self.kind)
        self.motions = None  # of `ts.motions`, on demand
        self.times.setflags(write=False)
        self.values.setflags(write=False)
        if said:
            warnings.warn(said, UserWarning, stacklevel=line_of_user())

    def __call__(self, t: ArrayLike) -> Value:
        """The values at a time or times; NaN outside the table."""
        found, end = self._spline(t), self.times[-1]
        if self.kind == "previous" or self.times[-2] == end:  # no piece begins at the end
            at_end = np.asarray(t) == end
            found = np.where(at_end[..., None] if self.values.ndim == 2 else at_end, self.values[-1], found)
        return found

    def pieces(self) -> list[Any]:
        """A `Pieces` for each component."""
        return pieces_of(self._spline)

    def demand_motion(self) -> None:
        """Refuse interpolation that no constraint can follow."""
        if self.kind in ("linear", "previous"):
            raise InvalidArgument(
                f"a {self!r} is no motion, as its accelerations are infinite; give kind='cubic' or 'pchip'. As a load "
                "it is admissible."
            )

    def __repr__(self) -> str:
        kind = "" if self.kind == "cubic" else f"{self.kind}, "
        return f"<Table of {self.times.size} values, {kind}{self.times[0]:g} to {self.times[-1]:g} s>"


def _increase(times):
    """Whether times increase but for jumps, at each of which one is given twice."""
    return times[-1] > times[0] and (np.diff(times) >= 0.0).all() and (times[2:] > times[:-2]).all()


def _interpolated(times, values, kind):
    """A piecewise polynomial of SciPy's, and what there is to warn of."""
    jumps, said = np.flatnonzero(np.diff(times) == 0.0) + 1, ""
    parts = []
    for t, v in zip(np.split(times, jumps), np.split(values, jumps), strict=True):
        if t.size > 1:
            parts.append(MAKERS[kind](t, v))
            said = said or (_overshoot(parts[-1], v) if kind == "cubic" else "")
    if len(parts) == 1:
        return parts[0], said
    from scipy.interpolate import PPoly

    size = max(len(part.c) for part in parts)
    c = [np.concatenate((np.zeros((size - len(part.c), *part.c.shape[1:])), part.c)) for part in parts]
    knots = np.concatenate([parts[0].x[:1], *(part.x[1:] for part in parts)])
    return PPoly(np.concatenate(c, axis=1), knots, extrapolate=False), said


def _cubic(times, values):
    from scipy.interpolate import CubicSpline  # slow to import

    return CubicSpline(times, values, extrapolate=False)


def _pchip(times, values):
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(times, values, extrapolate=False)


def _linear(times, values):
    return _lines(times, values, np.diff(values, axis=0) / _column(np.diff(times), values))


def _previous(times, values):
    return _lines(times, values, np.zeros_like(values[1:]))


def _lines(times, values, slopes):
    from scipy.interpolate import PPoly

    return PPoly(np.stack((slopes, values[:-1])), times, extrapolate=False)


MAKERS = {"cubic": _cubic, "linear": _linear, "previous": _previous, "pchip": _pchip}  # by kind


def _column(numbers, values):
    """Numbers (k,), one for each row of values."""
    return numbers.reshape(-1, *[1] * (values.ndim - 1))


def _overshoot(spline, values):
    """Say where a cubic spline leaves the range of its values; "" where it doesn't.

    Between two values it may have an extremum where the values have one. Where they are monotone, and beyond a part of
    their whole range, the curve is not that of the values.
    """
    a, b, c, _ = spline.c
    h, rise = _column(np.diff(spline.x), values), np.diff(values, axis=0)
    low, high = np.minimum(values[1:], values[:-1]), np.maximum(values[1:], values[:-1])
    with np.errstate(all="ignore"):  # 3 a x^2 + 2 b x + c = 0
        q = -(b + np.copysign(np.sqrt(b * b - 3.0 * a * c), b))
        places = np.stack([q / (3.0 * a), c / q])
        peaks = ((a * places + b) * places + c) * places + values[:-1]
        beyond = np.maximum(peaks - high, low - peaks)
    excess = np.where((places > 0.0) & (places < h) & np.isfinite(peaks), beyond, 0.0)
    still = np.zeros((1, *rise.shape[1:]))
    before, after = np.concatenate((still, rise[:-1])), np.concatenate((rise[1:], still))
    monotone = (before * rise >= 0.0) & (rise * after >= 0.0) & (before * after >= 0.0)
    allowed = np.where(monotone, OVERSHOOT, EXTREMUM) * np.ptp(values, axis=0) + SAME_VALUE * np.abs(values).max()
    worst = np.unravel_index(int(np.argmax(excess - allowed)), excess.shape)
    if not (excess - allowed)[worst] > 0.0:
        return ""
    i, at = worst[1], spline.x[worst[1]] + places[worst]
    return (
        f"Table: the cubic spline overshoots: it reaches {peaks[worst]:.4g} at t = {at:.6g} s, between the values "
        f"{values[i][worst[2:]]:.4g} and {values[i + 1][worst[2:]]:.4g}. Give kind='pchip', which stays within the "
        "values, 'linear' or 'previous', and a time twice for a jump; a CubicSpline of SciPy's is taken as it is."
    )


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
