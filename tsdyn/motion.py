"""A prescribed function of time with its two derivatives, compiled, cached and reached by address."""

import math
from types import FunctionType

import numpy as np
from numba.core.errors import NumbaError

from ._kernel import Callback, caller, kernel, specialised
from .checks import number
from .errors import InvalidConstraint

SIGNATURE = "d"
call_motion = caller(SIGNATURE, "d")


class Motion:
    """f(t), fd(t), fdd(t): a length, an angle's cosine or another quantity that the user prescribes.

    Parameters
    ----------
    f, fd, fdd : callable
        Plain functions of one float, the time in s, that Numba can compile; fd and fdd are the exact first and second
        derivatives of f. The compiled code is cached on disk by all the code and constants it depends on.
    what : str
        What error messages call it.
    """

    def __init__(self, f, fd, fdd, what="motion"):
        self.functions, self.what = (f, fd, fdd), what
        for function in self.functions:
            if not callable(function):
                raise InvalidConstraint(f"{what}: a motion is three functions of time (f, fd, fdd), got {function!r}.")
            plain = getattr(function, "py_func", function)
            if not isinstance(plain, FunctionType) or plain.__code__.co_argcount != 1:
                raise InvalidConstraint(
                    f"{what}: {function!r} is no plain Python function of one argument, the time; "
                    "wrap it in one: lambda t: ..."
                )
        self._callbacks = None
        self.value(0.0)

    @classmethod
    def wrap(cls, value, what):
        """Return a Motion for a triple of functions or a Motion, a finite float for a number."""
        if isinstance(value, Motion):
            return cls(*value.functions, what=what)
        if isinstance(value, (tuple, list)) and len(value) == 3 and all(callable(f) for f in value):
            return cls(*value, what=what)
        result = number(value)
        if not math.isfinite(result):
            raise InvalidConstraint(
                f"{what} must be a finite number or three functions of time (f, fd, fdd), got {value!r}."
            )
        return result

    @staticmethod
    def places(value):
        """What a prescribed value contributes to `parameters()`: three places for value, rate and acceleration."""
        return (value,) if isinstance(value, Motion) else (value, 0.0, 0.0)

    @staticmethod
    def at_start(value):
        """The value itself, or that of a Motion at t = 0."""
        return value.value(0.0)[0] if isinstance(value, Motion) else value

    def value(self, t):
        """Return (f, fd, fdd) at t, by the plain Python functions."""
        try:
            with np.errstate(all="ignore"):
                result = tuple(float(f(t)) for f in self.functions)
        except Exception as error:
            raise InvalidConstraint(f"{self.what}: the motion can't be evaluated at t = {t:g}: {error!r}") from error
        if not all(map(math.isfinite, result)):
            raise InvalidConstraint(f"{self.what}: the motion is not finite at t = {t:g}: (f, fd, fdd) = {result}.")
        return result

    def check(self, t0, t1):
        """Refuse derivatives that are not those of f, by difference quotients at a few times of the interval.

        Several quotients are tried at each time, and most times must fail: a kink or a short wave is no error.
        """
        times = t0 + (t1 - t0) * np.array([0.11, 0.29, 0.53, 0.71, 0.89])
        for i, names in ((0, ("f", "fd")), (1, ("fd", "fdd"))):
            given, values = self._at(i + 1, times), self._at(i, times)
            off = np.full(times.size, np.inf)
            for h in min(1.0, t1 - t0) * np.array([1e-2, 1e-3, 1e-4, 1e-5]):
                near = [self._at(i, times + k * h) for k in (-2, -1, 1, 2)]
                with np.errstate(invalid="ignore"):
                    quotient = (near[0] - 8.0 * near[1] + 8.0 * near[2] - near[3]) / (12.0 * h)
                    off = np.fmin(off, np.abs(quotient - given) - 1e-9 * np.abs(values) / h)
            if not (np.isfinite(given).all() and np.isfinite(values).all()):
                continue  # the run ends there, and says so
            if (off > 1e-3 * (np.abs(given).max() + np.abs(values).max())).sum() > times.size // 2:
                raise InvalidConstraint(
                    f"{self.what}: {names[1]} is not the derivative of {names[0]}: at t = {times[0]:g} it gives "
                    f"{given[0]:g}, and a difference quotient of {names[0]} does not. Correct the derivatives."
                )

    def _at(self, i, times):
        try:
            with np.errstate(all="ignore"):
                return np.array([self.functions[i](t) for t in times], dtype=float)
        except Exception as error:
            raise InvalidConstraint(
                f"{self.what}: the motion can't be evaluated near t = {times[0]:g} ... {times[-1]:g}: {error!r}"
            ) from error

    def forget(self):
        """Drop the compiled functions; they are made again when asked for."""
        self._callbacks = None

    @property
    def addresses(self):
        """The addresses of the three compiled functions."""
        try:
            if self._callbacks is None:
                self._callbacks = tuple(_callback(function) for function in self.functions)
            return tuple(callback.address for callback in self._callbacks)
        except NumbaError as error:
            raise InvalidConstraint(
                f"{self.what}: Numba can't compile the motion; use plain arithmetic, NumPy functions and constants "
                f"in it.\n{error}"
            ) from error


def _guarded(t):
    """The function, or NaN where it raises: an error must not be taken for a zero."""
    try:
        return float(function(t))
    except Exception:
        return np.nan


function = None  # filled in by `_callback`


def _callback(f):
    plain = getattr(f, "py_func", f)
    guarded = specialised(_guarded, f"{plain.__qualname__}.guarded", plain, function=kernel(plain, allocates=True))
    return Callback(guarded, SIGNATURE, "d", allocates=True)
