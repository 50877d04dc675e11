"""Users' functions with numbers that may vary: keyword arguments with defaults, `def lift(t, *, height=0.1): ...`."""

import math
from types import FunctionType

from ..errors import InvalidArgument
from ..validation import number


def numbers_of(function):
    """The keyword-only arguments of a plain function whose defaults are numbers, by name."""
    plain = getattr(function, "py_func", function)
    given = (plain.__kwdefaults__ or {}) if isinstance(plain, FunctionType) else {}
    return {name: float(value) for name, value in given.items() if not isinstance(value, bool) and _is_number(value)}


def _is_number(value):
    return isinstance(value, (int, float)) or (hasattr(value, "dtype") and math.isfinite(number(value)))


def with_number(function, name, value, what):
    """The same function with another default of a keyword argument.

    Raises
    ------
    InvalidArgument
        If the value is no finite number; `what` it is in the message.
    """
    if not math.isfinite(number(value)):
        raise InvalidArgument(f"{what} must be a finite number, got {value!r}.")
    plain = getattr(function, "py_func", function)
    twin = FunctionType(plain.__code__, plain.__globals__, plain.__name__, plain.__defaults__, plain.__closure__)
    twin.__dict__.update(vars(plain), __wrapped__=plain)
    twin.__kwdefaults__ = {**plain.__kwdefaults__, name: number(value)}
    twin.__qualname__, twin.__module__, twin.__doc__ = plain.__qualname__, plain.__module__, plain.__doc__
    return twin
