"""Elementary motions: polynomials of time, piecewise data, sines and exponentials."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument
from ..validation import floats, number, shown
from .expressions import Smooth
from .tables import Table, is_data, pieces_of

if TYPE_CHECKING:
    from ..hints import ArrayLike, Data


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
