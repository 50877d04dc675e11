"""Users' functions with numbers that may vary: keyword arguments with defaults, `def lift(t, *, height=0.1): ...`."""

import math
from types import FunctionType

from ..errors import InvalidArgument
from ..validation import number, shown


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
