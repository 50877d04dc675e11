"""A load as a function of time: a plain function of t, smooth motions, or a table, evaluated once a time of a run."""

import math
from types import FunctionType

import numpy as np
from numba.core.errors import NumbaError

from ._kernel import Callback, caller, kernel, specialised, vector
from .calls import fitting
from .checks import floats, number
from .errors import InvalidArgument
from .motion_program import run_program
from .motions import Constant, Smooth

SIGNATURE = "dp"  # t, where the values go
call_signal = caller(SIGNATURE)


class Table:
    """Values at given times, joined by a cubic spline (SciPy's CubicSpline, not-a-knot).

    Parameters
    ----------
    times : array_like (k,), s
        Increasing, at least two.
    values : array_like (k,) or (k, 3)
        Numbers or vectors, in the unit of what the table is given to.

    Raises
    ------
    InvalidArgument
        If the times don't increase, or a number is not finite, or the shapes don't match.
    """

    @fitting
    def __init__(self, times, values):
        self.times, self.values = floats(times), floats(values)
        k = self.times.size
        if self.times.ndim != 1 or k < 2 or not np.isfinite(self.times).all() or not (np.diff(self.times) > 0.0).all():
            raise InvalidArgument("Table: times must be two or more finite times in s, each after the one before.")
        if self.values.shape not in ((k,), (k, 3)) or not np.isfinite(self.values).all():
            raise InvalidArgument(
                f"Table: values must be {k} finite numbers or {k} vectors of three, one for each time; their shape is "
                f"{np.shape(values)}."
            )
        from scipy.interpolate import CubicSpline  # it takes long to import

        self._spline = CubicSpline(self.times, self.values, extrapolate=False)
        self.times.setflags(write=False)
        self.values.setflags(write=False)

    def __call__(self, t):
        """The values at a time or times; NaN outside the table."""
        return self._spline(t)

    def numbers(self):
        """What the kernels get: the times, then for each interval the coefficients, highest power first."""
        c = self._spline.c.reshape(4, self.times.size - 1, -1)
        return [*self.times.tolist(), *c.transpose(1, 0, 2).ravel().tolist()]

    def __repr__(self):
        return f"<Table of {self.times.size} values, {self.times[0]:g} to {self.times[-1]:g} s>"


class Signal:
    """`width` numbers, 1 or 3, as a function of time.

    Parameters
    ----------
    source : callable, Table, or tuple of Smooth
        A plain function of one float, the time in s, that Numba can compile and that returns a number (a tuple of
        three for width 3); compiled code is cached on disk by all the code and constants it depends on. Or a Table; or
        as many of `ts.motions`, for which nothing is compiled.
    width : int
    what : str
        What error messages call it.
    error : type
        What they raise.
    """

    def __init__(self, source, width, what, error):
        self.source, self.width, self.what, self.error = source, width, what, error
        self._callback = None
        if self.smooth:
            self.value(0.0)
            return
        if isinstance(source, Table):
            if source.values[0].size != width:
                raise error(f"{what}: the table has {source.values[0].size} values a time and must have {width}.")
            return
        plain = getattr(source, "py_func", source)
        if not isinstance(plain, FunctionType) or plain.__code__.co_argcount != 1:
            raise error(
                f"{what}: {source!r} is no plain Python function of one argument, the time; wrap it in one, "
                "lambda t: ..."
            )
        self.value(0.0)

    @classmethod
    def wrap(cls, value, width, what, error):
        """Return a Signal for a function, Table or Signal; a finite float or an array (3,) for numbers."""
        if isinstance(value, Signal):
            value = value.source
        if isinstance(value, Smooth):
            value = (value,)
        if isinstance(value, (tuple, list)) and any(isinstance(part, Smooth) for part in value):
            parts = [part if isinstance(part, Smooth) else number(part) for part in value]
            if len(parts) == width and all(isinstance(part, Smooth) or math.isfinite(part) for part in parts):
                parts = tuple(part if isinstance(part, Smooth) else Constant(part) for part in parts)
                return cls(parts, width, what, error)
            raise error(f"{what} must be {width} of ts.motions or finite numbers, got {value!r}.")
        if callable(value):
            return cls(value, width, what, error)
        result = number(value) if width == 1 else floats(value)
        if np.shape(result) != (() if width == 1 else (3,)) or not np.isfinite(result).all():
            kind = "a finite number" if width == 1 else "three finite numbers"
            raise error(f"{what} must be {kind}, a function of time or a ts.Table, got {value!r}.")
        if width == 3:
            result.setflags(write=False)
        return result

    @property
    def smooth(self):
        """The motions that it is made of; empty for a function or a table."""
        return self.source if isinstance(self.source, tuple) else ()

    @staticmethod
    def places(value):
        """What a load contributes to `parameters()`."""
        return tuple(value) if isinstance(value, np.ndarray) else (value,)

    @staticmethod
    def is_zero(value):
        """Whether a load is zero at all times."""
        return not isinstance(value, Signal) and not np.any(value)

    def value(self, t):
        """The values at t, an array (width,), by the plain Python function."""
        try:
            with np.errstate(all="ignore"):
                result = floats([f(np.float64(t)) for f in self.smooth] if self.smooth else self.source(t))
        except Exception as error:
            raise self.error(f"{self.what}: the function can't be evaluated at t = {t:g}: {error!r}") from error
        if result.shape not in ((self.width,), ()) or (result.shape == () and self.width != 1):
            raise self.error(
                f"{self.what}: the function must return {'a number' if self.width == 1 else 'three numbers'}, it "
                f"gave {result!r} at t = {t:g}."
            )
        result = np.atleast_1d(result)
        if not np.isfinite(result).all() and not isinstance(self.source, Table):
            raise self.error(f"{self.what}: the function is not finite at t = {t:g}: {result}.")
        return result

    def over(self, t):
        """The values at times t (k,): `width` arrays (k,)."""
        if isinstance(self.source, Table):
            values = np.asarray(self.source(t)).reshape(t.size, self.width)
        elif self.smooth:
            return [f(t) for f in self.smooth]
        else:
            with np.errstate(all="ignore"):
                values = np.array([self.source(time) for time in t], dtype=float).reshape(t.size, self.width)
        return list(values.T)

    def check(self, t0, t1):
        """Refuse an interval that a table doesn't cover."""
        if isinstance(self.source, Table):
            first, last = self.source.times[[0, -1]]
            if t0 < first or t1 > last:
                raise self.error(
                    f"{self.what}: the table covers {first:g} to {last:g} s and the run {t0:g} to {t1:g} s; extend the "
                    "table or shorten t_span."
                )

    def forget(self):
        """Drop the compiled function; it is made again when asked for."""
        self._callback = None

    @property
    def address(self):
        """The address of the compiled function, or of what runs motions; zero for a table."""
        if self.smooth:
            return run_program.address
        if isinstance(self.source, Table):
            return 0
        try:
            if self._callback is None:
                self._callback = _callback(self.source, self.width)
            return self._callback.address
        except NumbaError as error:
            raise self.error(
                f"{self.what}: Numba can't compile the function; use plain arithmetic, NumPy functions and constants "
                f"in it{', and return a tuple of three' if self.width == 3 else ''}.\n{error}"
            ) from error

    def __getstate__(self):
        return {**self.__dict__, "_callback": None}  # machine code is not for pickling


def _one(t, out):
    """The number, or NaN where the function raises: an error must not be taken for a zero."""
    out = vector(out, 1)
    out[0] = math.nan
    try:
        out[0] = float(function(t))
    except Exception:
        out[0] = math.nan
    return 0


def _three(t, out):
    out = vector(out, 3)
    try:
        value = function(t)
        out[0], out[1], out[2] = value[0], value[1], value[2]
    except Exception:
        out[0] = math.nan
    return 0


function = None  # filled in by `_callback`


def _callback(f, width):
    plain = getattr(f, "py_func", f)
    template = _one if width == 1 else _three
    name = f"{plain.__qualname__}.signal{width}"
    return Callback(
        specialised(template, name, plain, function=kernel(plain, allocates=True)), SIGNATURE, allocates=True
    )


@kernel
def spline(t, numbers, knots, width, out):
    """Write the values of a table at t to out; NaN outside."""
    if not (t >= numbers[0] and t <= numbers[knots - 1]):
        for j in range(width):
            out[j] = math.nan
        return
    low, high = 0, knots - 1
    while high - low > 1:
        middle = (low + high) // 2
        if t < numbers[middle]:
            high = middle
        else:
            low = middle
    x, at = t - numbers[low], knots + 4 * width * low
    for j in range(width):
        y = 0.0
        for i in range(4):
            y = y * x + numbers[at + i * width + j]
        out[j] = y
