"""Time-dependent inputs: a function of t, a motion or data, evaluated once for each time of a run."""

import math
from functools import partial
from types import FunctionType

import numpy as np

from ..errors import InvalidArgument
from ..jit.compiled import compiled_once
from ..jit.kernels import Callback, NumbaError, caller, entry, kernel, specialised, vector
from ..validation import floats, number, shown
from .elementary import Constant, Piecewise, Polynomial, Smooth
from .knots import demand_covered
from .program import run_program
from .tables import is_data
from .tracing import Untraceable, of_time

# Users' functions with numbers that may vary: keyword arguments with defaults, `def lift(t, *, height=0.1): ...`.


def numbers_of(function):
    """The keyword-only arguments of a plain function whose defaults are numbers, by name, in their order."""
    plain = getattr(function, "py_func", function)
    if not isinstance(plain, FunctionType) or not plain.__kwdefaults__:
        return {}
    code, given = plain.__code__, plain.__kwdefaults__
    names = code.co_varnames[code.co_argcount : code.co_argcount + code.co_kwonlyargcount]
    return {name: float(given[name]) for name in names if _is_number(given.get(name))}


def starred(function):
    """The end of a message on a plain function with defaults and no star, `lambda t, f=f: ...`; "" for any other."""
    plain = getattr(function, "py_func", function)
    defaults = plain.__defaults__ or () if isinstance(plain, FunctionType) else ()
    if all(default is None for default in defaults):
        return ""
    names = plain.__code__.co_varnames[: plain.__code__.co_argcount]
    first, given = names[: -len(defaults)], names[-len(defaults) :]
    written = ", ".join([*first, "*", *(f"{name}={name}" for name in given)])
    return f"; defaults stand behind a star: lambda {written}: ..."


def demand_time_alone(function, what, error):
    """Raise an error unless a function is a plain one of the time alone, but for numbers by keyword."""
    plain, said = getattr(function, "py_func", function), starred(function)
    if said or not isinstance(plain, FunctionType) or plain.__code__.co_argcount != 1:
        raise error(
            f"{what}: {function!r} is no plain Python function of one argument, the time"
            f"{said or '; wrap it in one: lambda t: ...'}"
        )


def positional(function):
    """The function with its keyword-only arguments after the others, by position, for code that is compiled once."""
    plain = getattr(function, "py_func", function)
    code = plain.__code__
    code = code.replace(co_argcount=code.co_argcount + code.co_kwonlyargcount, co_kwonlyargcount=0)
    return _like(plain, FunctionType(code, plain.__globals__, plain.__name__, None, plain.__closure__))


def _like(function, twin):
    twin.__dict__.update(vars(function))
    twin.__qualname__, twin.__module__, twin.__doc__ = function.__qualname__, function.__module__, function.__doc__
    return twin


def _is_number(value):
    return not isinstance(value, bool) and math.isfinite(number(value))


def with_number(function, name, value, what):
    """The same function with another default of a keyword argument.

    Raises
    ------
    InvalidArgument
        If the value is no finite number; `what` it is in the message.
    """
    if not math.isfinite(number(value)):
        raise InvalidArgument(f"{what} must be a finite number, got {shown(value)}.")
    plain = getattr(function, "py_func", function)
    twin = FunctionType(plain.__code__, plain.__globals__, plain.__name__, plain.__defaults__, plain.__closure__)
    twin.__kwdefaults__ = {**plain.__kwdefaults__, name: number(value)}
    return _like(plain, twin)


SIGNATURE = "dp"  # t, where the values go
call_signal = caller(SIGNATURE)


@entry("ivm")
def sample_signal(address, t, out):
    """The values (k, width) of a compiled function at times t (k,)."""
    for i in range(t.size):
        call_signal(address, t[i], out[i])


class Signal:
    """`width` numbers, 1 or 3, as a function of time.

    Parameters
    ----------
    source : callable, tuple of Smooth, Table, SciPy's PPoly, BPoly or BSpline, or (times, values)
        A plain function of one float, the time in s, that Numba can compile and that returns a number (a tuple of
        three for width 3); compiled code is cached on disk by all the code and constants it depends on. Or as many of
        `ts.motions`, or data, for which nothing is compiled.
    width : int
    what : str
        Name in error messages.
    error : type
        Class of errors raised.
    """

    def __init__(self, source, width, what, error):
        self.source, self.width, self.what, self.error = source, width, what, error
        self._callback, self._smooth = None, None
        self.motions = source if isinstance(source, tuple) and isinstance(source[0], Smooth) else ()
        if is_data(source):
            try:
                self.motions = Piecewise.each(source)
            except InvalidArgument as reason:
                raise error(f"{what}: {reason}") from reason
            if len(self.motions) != width:
                raise error(f"{what}: the table has {len(self.motions)} values a time and must have {width}.")
        if self.motions:
            if not any(motion.pieces for motion in self.motions):
                self.value(0.0)
            return
        demand_time_alone(source, what, error)
        self.value(0.0)
        self._trace_numbers()

    def _trace_numbers(self):
        """A function with keyword arguments is run as motions: other numbers compile nothing."""
        if not numbers_of(self.source):
            return
        try:
            self.motions = of_time(self.source, self.width)
        except Untraceable as reason:
            raise self.error(
                f"{self.what}: keyword arguments are numbers that may vary, so the function must consist of arithmetic "
                f"and functions of NumPy, without branches ({reason}). Write the numbers into the function instead."
            ) from None

    @classmethod
    def wrap(cls, value, width, what, error):
        """Return a Signal for a function, data or Signal; a finite float or an array (3,) for numbers."""
        if isinstance(value, Signal):
            value = value.source
        if is_data(value):
            return cls(value, width, what, error)
        if isinstance(value, Smooth):
            value = (value,)
        if isinstance(value, (tuple, list)) and any(isinstance(part, Smooth) or is_data(part) for part in value):
            value = [Piecewise(part) if is_data(part) else part for part in value]
            parts = [part if isinstance(part, Smooth) else number(part) for part in value]
            if len(parts) == width and all(isinstance(part, Smooth) or math.isfinite(part) for part in parts):
                parts = tuple(part if isinstance(part, Smooth) else Constant(part) for part in parts)
                return cls(parts, width, what, error)
            raise error(f"{what} must be {width} of ts.motions or finite numbers, got {shown(value)}.")
        if callable(value):
            return cls(value, width, what, error)
        result = number(value) if width == 1 else floats(value)
        if np.shape(result) != (() if width == 1 else (3,)) or not np.isfinite(result).all():
            kind = "a finite number" if width == 1 else "three finite numbers"
            raise error(f"{what} must be {kind}, a function of time or a ts.Table, got {shown(value)}.")
        if width == 3:
            result.setflags(write=False)
        return result

    @staticmethod
    def places(value):
        """Return the entries of a load in `parameters()`."""
        return tuple(value) if isinstance(value, np.ndarray) else (value,)

    @staticmethod
    def is_zero(value):
        """Return True if a load is zero at all times."""
        return not isinstance(value, Signal) and not np.any(value)

    def value(self, t):
        """The values at t, an array (width,), by the plain Python function."""
        try:
            with np.errstate(all="ignore"):
                result = floats([f(np.float64(t)) for f in self.motions] if self.motions else self.source(t))
        except Exception as error:
            raise self.error(f"{self.what}: the function can't be evaluated at t = {t:g}: {error!r}") from error
        if result.shape not in ((self.width,), ()) or (result.shape == () and self.width != 1):
            raise self.error(
                f"{self.what}: the function must return {'a number' if self.width == 1 else 'three numbers'}, it "
                f"gave {result!r} at t = {t:g}."
            )
        result = np.atleast_1d(result)
        if not np.isfinite(result).all():
            raise self.error(f"{self.what}: the function is not finite at t = {t:g}: {result}.")
        return result

    @property
    def smooth(self):
        """The values as motions, (width,), of which there are Taylor series; of a user's function, by tracing it.

        Raises
        ------
        Untraceable
            If the function can't be traced.
        """
        if self.motions:
            return self.motions
        if self._smooth is None:
            try:
                self._smooth = of_time(self.source, self.width)
            except Untraceable as reason:
                self._smooth = reason
        if isinstance(self._smooth, Untraceable):
            raise self._smooth
        return self._smooth

    @property
    def is_function(self):
        """Whether it is a user's function."""
        return isinstance(getattr(self.source, "py_func", self.source), FunctionType)

    @property
    def entire(self):
        """Whether the values are piecewise polynomials of time, which a series can't be short of."""
        return bool(self.motions) and all(isinstance(motion, (Piecewise, Polynomial)) for motion in self.motions)

    def over(self, t):
        """The values at times t (k,): `width` arrays (k,)."""
        if self.motions:
            return [f(t) for f in self.motions]
        with np.errstate(all="ignore"):
            values = np.array([self.source(time) for time in t], dtype=float).reshape(t.size, self.width)
        return list(values.T)

    @property
    def may_change(self):
        """Whether the values may change shortly, but at knots."""
        try:
            return any(f.may_change for f in self.smooth)
        except Untraceable:
            return True

    def sampled(self, t):
        """The values that may change shortly at times t: a list of arrays (k,)."""
        try:
            return [f(t) for f in self.smooth if f.may_change]
        except Untraceable:
            out = np.full((t.size, self.width), math.nan)  # a function that raises sets the first value alone
            sample_signal(self.address, t, out)
            return [*out.T]

    def check(self, t0, t1):
        """Refuse an interval that data don't cover."""
        for motion in self.motions:
            demand_covered(motion, t0, t1, self.what, self.error)

    def forget(self):
        """Drop the compiled function and what it was traced to; both are made again on demand."""
        self._callback = self._smooth = None
        self._trace_numbers()

    @property
    def address(self):
        """The address of the compiled function, or of the interpreter of motions."""
        if self.motions:
            return run_program.address
        try:
            if self._callback is None:
                make = partial(_callback, self.source, self.width)
                self._callback = compiled_once(f"signal{self.width}", self.source, make)
            return self._callback.address
        except NumbaError as error:
            raise self.error(
                f"{self.what}: Numba can't compile the function; use plain arithmetic, NumPy functions and constants "
                f"in it{', and return a tuple of three' if self.width == 3 else ''}."
            ) from error

    def __getstate__(self):
        return {**self.__dict__, "_callback": None}  # machine code can't be pickled


def _one(t, out):
    """Call the function; NaN if it raises, since an error must not pass for zero."""
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
