"""A prescribed function of time with two derivatives: compiled and called by address, or a program of numbers."""

from __future__ import annotations

import math
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument, InvalidConstraint
from ..jit.compiled import compiled_once
from ..jit.kernels import Callback, NumbaError, caller, entry, kernel, specialised
from ..validation import number, shown
from .elementary import FUNCTIONS, Constant, Piecewise, Smooth, time
from .knots import demand_covered, demand_followed
from .program import run_program
from .signals import demand_time_alone
from .tables import Table, is_data
from .tolerances import QUOTIENT_ERROR, QUOTIENT_STEPS, SAME_VALUE, TIMES
from .tracing import Untraceable, of_time, retold

if TYPE_CHECKING:
    from ..hints import Callable, Data, Floats, Iterable, Prescribed, TimeFunction

SIGNATURE = "d"
UNNAMED = "motion"
call_motion = caller(SIGNATURE, "d")


@entry("ivv")
def sample_motion(address, t, out):
    """The values (k,) of a compiled function at times t (k,)."""
    for i in range(t.size):
        out[i] = call_motion(address, t[i])


class Motion:
    """A prescribed quantity f(t) with its derivatives fd(t), fdd(t): a length, an angle, ...

    Parameters
    ----------
    f, fd, fdd : callable
        Plain functions of one float, the time in s, that Numba can compile; fd and fdd are the exact first and second
        derivatives of f. The compiled code is cached on disk under all code and constants that it depends on. Without
        fd and fdd, f is differentiated: it may use arithmetic and the functions of `ts.motions`. For one of
        `ts.motions` nothing is compiled, and the Taylor integrator has its series.
    what : str
        Name in error messages.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> wave = ts.Motion(lambda t: 0.1 * np.sin(2.0 * t))
    >>> print(wave.value(0.0))  # f, fd, fdd
    (0.0, 0.2, 0.0)
    """

    @fitting
    def __init__(
        self,
        f: TimeFunction | Data,
        fd: TimeFunction | None = None,
        fdd: TimeFunction | None = None,
        what: str = UNNAMED,
    ) -> None:
        self.what, self.smooth, self.given = what, None, (f, fd, fdd)
        if is_data(f) and fd is fdd is None:
            (f,) = self.components(f, 1, what)
        if isinstance(f, Smooth) and fd is fdd is None:
            self.given, self.smooth = (), f
        elif fd is fdd is None:
            self.given = (_plain_function(f, what),)
            self.smooth = _derived(f, what)
        for function in self.given:
            _plain_function(function, what)
        self._callbacks = None
        self.value(self.origin)

    @property
    def functions(self) -> tuple[Callable[..., Any], ...]:
        """f, fd and fdd, for Python."""
        smooth = self.smooth
        return self.given if smooth is None else (smooth, smooth.rate, smooth.acceleration)

    @cached_property
    def series(self) -> Smooth | None:
        """The motion as one of `ts.motions`; None for functions that can't be traced, or have other derivatives."""
        if self.smooth is not None:
            return self.smooth
        try:
            (found,) = of_time(self.given[0], 1)
        except Untraceable:
            return None
        for t in TIMES:
            for value, rate in zip((found.rate(t), found.acceleration(t)), self.given[1:], strict=True):
                if not abs(value - rate(t)) <= SAME_VALUE * (1.0 + abs(value)):
                    return None
        return found

    @property
    def has_series(self) -> bool:
        """Whether there is a Taylor series."""
        return self.series is not None

    @property
    def motions(self) -> tuple[Smooth, ...]:
        """The motions of `ts.motions` in it."""
        return () if self.smooth is None else (self.smooth,)

    @property
    def origin(self) -> float:
        """The time nearest to t = 0 with a value, s."""
        covers = [pieces.covers for motion in self.motions for pieces in motion.pieces]
        return float(min([max([0.0, *(first for first, _ in covers)]), *(last for _, last in covers)]))

    @classmethod
    def always(cls, value: Prescribed, what: str) -> Motion:
        """Return a Motion, also for a number."""
        value = cls.wrap(value, what)
        return value if isinstance(value, Motion) else cls(Constant(value), what=what)

    @classmethod
    def wrap(cls, value: Prescribed, what: str) -> Motion | float:
        """Return a Motion for functions, one of `ts.motions`, data or a Motion; a finite float for a number."""
        if isinstance(value, Motion):
            what = what if value.what == UNNAMED else value.what  # parts share the motion of their joint
            return cls(*(value.given or (value.smooth,)), what=what)
        if is_data(value):
            return cls(value, what=what)
        if isinstance(value, (tuple, list)) and len(value) == 3 and all(callable(f) for f in value):
            return cls(*value, what=what)
        if callable(value):
            return cls(value, what=what)
        result = number(value)
        if not math.isfinite(result):
            raise InvalidConstraint(
                f"{what} must be a finite number, one of ts.motions, a ts.Table, a spline of SciPy's, arrays (t, x), a "
                f"function of time f or three functions of time (f, fd, fdd), got {shown(value)}."
            )
        return result

    @staticmethod
    def components(value: Data, count: int, what: str) -> tuple[Piecewise, ...]:
        """Return the motions of the components of data; each a `Piecewise`."""
        try:
            if isinstance(value, Table):
                value.demand_motion()
            motions = Piecewise.each(value)
        except InvalidArgument as reason:
            raise InvalidConstraint(f"{what}: {reason}") from reason
        if len(motions) != count:
            raise InvalidConstraint(f"{what}: the data have {len(motions)} values a time and must have {count}.")
        return motions

    @staticmethod
    def numbers(given: Iterable[Motion | float]) -> list[float]:
        """Parameters as kernels receive them: value, rate and acceleration of a Motion at its origin."""
        return [x for value in given for x in (value.value(value.origin) if isinstance(value, Motion) else (value,))]

    @staticmethod
    def places(value: Motion | float) -> tuple[Motion | float, ...]:
        """Return the entries of a prescribed value in `parameters()`: value, rate and acceleration."""
        return (value,) if isinstance(value, Motion) else (value, 0.0, 0.0)

    @staticmethod
    def at_start(value: Motion | float) -> float:
        """Return a number, or the value of a Motion at its origin: t = 0, or the time nearest to it that data cover."""
        return value.value(value.origin)[0] if isinstance(value, Motion) else value

    def value(self, t: float) -> tuple[float, ...]:
        """Return (f, fd, fdd) at t, by the plain Python functions."""
        t = t if self.smooth is None else np.float64(t)  # no division by zero raises
        try:
            with np.errstate(all="ignore"):
                result = tuple(float(f(t)) for f in self.functions)
        except Exception as error:
            raise InvalidConstraint(f"{self.what}: the motion can't be evaluated at t = {t:g}: {error!r}") from error
        if not all(map(math.isfinite, result)):
            raise InvalidConstraint(f"{self.what}: the motion is not finite at t = {t:g}: (f, fd, fdd) = {result}.")
        return result

    def check(self, t0: float, t1: float) -> None:
        """Refuse wrong derivatives, by difference quotients at a few times, and data with a jump.

        Several quotients are tried at each time, and most times must fail: kinks and short waves are no errors.
        """
        if self.smooth is not None:  # exact by construction
            demand_covered(self.smooth, t0, t1, self.what, InvalidConstraint)
            demand_followed(self.smooth, t0, t1, self.what)
            return
        times = t0 + (t1 - t0) * np.array([0.11, 0.29, 0.53, 0.71, 0.89])
        for i, names in ((0, ("f", "fd")), (1, ("fd", "fdd"))):
            given, values = self._at(i + 1, times), self._at(i, times)
            off = np.full(times.size, np.inf)
            for h in min(1.0, t1 - t0) * np.array(QUOTIENT_STEPS):
                near = [self._at(i, times + k * h) for k in (-2, -1, 1, 2)]
                with np.errstate(invalid="ignore"):
                    quotient = (near[0] - 8.0 * near[1] + 8.0 * near[2] - near[3]) / (12.0 * h)
                    off = np.fmin(off, np.abs(quotient - given) - SAME_VALUE * np.abs(values) / h)
            if not (np.isfinite(given).all() and np.isfinite(values).all()):
                continue  # the run ends there with a message
            if (off > QUOTIENT_ERROR * (np.abs(given).max() + np.abs(values).max())).sum() > times.size // 2:
                raise InvalidConstraint(
                    f"{self.what}: {names[1]} is not the derivative of {names[0]}: at t = {times[0]:g} it gives "
                    f"{given[0]:g}, and a difference quotient of {names[0]} does not. Correct the derivatives."
                )

    def over(self, times: Floats) -> Floats:
        """f, fd and fdd at times (k,), shape (3, k)."""
        if self.smooth is not None:
            return np.array([function(times) for function in self.functions])
        return np.array([[function(t) for t in times] for function in self.functions], dtype=float)

    @property
    def may_change(self) -> bool:
        """Whether it may change shortly, but at knots."""
        return self.series is None or self.series.may_change

    def sampled(self, t: Floats) -> list[Floats]:
        """Values and accelerations at times t: a list of arrays (k,)."""
        if self.series is not None:
            return [self.series(t), self.series.acceleration(t)]
        found = [np.empty(t.size), np.empty(t.size)]
        for address, out in zip(self.addresses[::2], found, strict=True):
            sample_motion(address, t, out)
        return found

    def _at(self, i, times):
        try:
            with np.errstate(all="ignore"):
                return np.array([self.functions[i](t) for t in times], dtype=float)
        except Exception as error:
            raise InvalidConstraint(
                f"{self.what}: the motion can't be evaluated near t = {times[0]:g} ... {times[-1]:g}: {error!r}"
            ) from error

    def __getstate__(self):
        return {**self.__dict__, "_callbacks": None}  # machine code can't be pickled

    def forget(self) -> None:
        """Drop compiled and derived functions; they are made again on demand."""
        self._callbacks = None
        self.__dict__.pop("series", None)
        if self.given and self.smooth is not None:
            self.smooth = _derived(self.given[0], self.what)

    @property
    def addresses(self) -> tuple[int, ...]:
        """The addresses of the three compiled functions; for a program, of its interpreter and two zeros."""
        if self.smooth is not None:
            return run_program.address, 0, 0
        try:
            if self._callbacks is None:
                self._callbacks = tuple(compiled_once("motion", f, partial(_callback, f)) for f in self.given)
            return tuple(callback.address for callback in self._callbacks)
        except NumbaError as error:
            raise InvalidConstraint(
                f"{self.what}: Numba can't compile the motion; use plain arithmetic, NumPy functions and constants "
                "in it."
            ) from error


def _plain_function(function, what):
    """Return a user's function; refuse all but plain functions of one argument."""
    if not callable(function):
        raise InvalidConstraint(f"{what}: a motion is three functions of time (f, fd, fdd), got {function!r}.")
    demand_time_alone(function, what, InvalidConstraint)
    return function


def _derived(f, what):
    """Return a user's function as a `Smooth`, by evaluation on time as a motion."""
    try:
        result = retold(f)(time)
    except Exception as error:
        raise InvalidConstraint(
            f"{what}: its derivatives can't be derived from f alone ({type(error).__name__}: {error}). Give three "
            "functions of time (f, fd, fdd), or write f with arithmetic and "
            f"{', '.join(FUNCTIONS)} of NumPy, without branches."
        ) from error
    if isinstance(result, Smooth):
        return result
    if not math.isfinite(number(result)):
        raise InvalidConstraint(f"{what}: the function must return a number, it gave {result!r} of the time.")
    return Constant(number(result))


def _guarded(t):
    """Call the function; NaN if it raises, since an error must not pass for zero."""
    try:
        return float(function(t))
    except Exception:
        return np.nan


function = None  # filled in by `_callback`


def _callback(f):
    plain = getattr(f, "py_func", f)
    guarded = specialised(_guarded, f"{plain.__qualname__}.guarded", plain, function=kernel(plain, allocates=True))
    return Callback(guarded, SIGNATURE, "d", allocates=True)
