"""A prescribed function of time with its two derivatives, compiled, cached and reached by address."""

import math

import numpy as np
from numba.core.errors import NumbaError

from ._kernel import Callback, caller
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
        self.functions = (f, fd, fdd)
        for function in self.functions:
            if not callable(function):
                raise InvalidConstraint(f"{what}: a motion is three functions of time (f, fd, fdd), got {function!r}.")
        self._callbacks = tuple(Callback(f, SIGNATURE, "d", allocates=True) for f in self.functions)
        self.what = what
        self.value(0.0)

    @classmethod
    def wrap(cls, value, what):
        """Return a Motion for a triple of functions or a Motion, a finite float for a number."""
        if isinstance(value, Motion):
            return value
        if isinstance(value, (tuple, list)) and len(value) == 3 and all(callable(f) for f in value):
            return cls(*value, what=what)
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not math.isfinite(number):
            raise InvalidConstraint(
                f"{what} must be a finite number or three functions of time (f, fd, fdd), got {value!r}."
            )
        return number

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
        f, fd, fdd = self.functions
        times = t0 + (t1 - t0) * np.array([0.11, 0.29, 0.53, 0.71, 0.89])
        for function, derivative, names in ((f, fd, ("f", "fd")), (fd, fdd, ("fd", "fdd"))):
            given = np.array([derivative(t) for t in times])
            values = np.array([function(t) for t in times])
            off = np.full(times.size, np.inf)
            for h in min(1.0, t1 - t0) * np.array([1e-2, 1e-3, 1e-4, 1e-5]):
                near = [[function(t + k * h) for t in times] for k in (-2, -1, 1, 2)]
                quotient = (np.array([1.0, -8.0, 8.0, -1.0]) @ near) / (12.0 * h)
                off = np.minimum(off, np.abs(quotient - given) - 1e-9 * np.abs(values) / h)
            if (off > 1e-3 * (np.abs(given).max() + np.abs(values).max())).sum() > times.size // 2:
                raise InvalidConstraint(
                    f"{self.what}: {names[1]} is not the derivative of {names[0]}: at t = {times[0]:g} it gives "
                    f"{given[0]:g}, and a difference quotient of {names[0]} does not. Correct the derivatives."
                )

    @property
    def addresses(self):
        """The addresses of the three compiled functions."""
        try:
            return tuple(callback.address for callback in self._callbacks)
        except NumbaError as error:
            raise InvalidConstraint(
                f"{self.what}: Numba can't compile the motion; use plain arithmetic, NumPy functions and constants "
                f"in it.\n{error}"
            ) from error
