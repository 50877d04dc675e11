"""The table `run` of a scene file: the arguments of a run, by the signature of `simulate`."""

import math

import numpy as np

from ..errors import InvalidArgument, TsdynError
from ..methods.integrator import registered
from ..validation import close
from . import types
from .expressions import Misread
from .reading import known_keys
from .values import decode_number

DATA = (types.NUMBER, types.WHOLE, types.FLAG, types.TEXT, types.ARRAY)  # kinds of arguments that are data
OWN = ("start", "end", "method", "every")
END = 10.0  # s
MOST = 10_000_000  # outputs


def arguments(simulate):
    """The arguments that a table may have besides its own keys: all that are data, but for those of a store."""
    known = types.arguments_of(simulate)
    return {name: argument for name, argument in known.items() if argument.kind in DATA and name != "checkpoint"}


def options(table, simulate, mistakes, names):
    """The arguments of `simulate` that a table asks for: t_span, and others by name."""
    path, known = ("run",), arguments(simulate)
    if not isinstance(table, dict):
        mistakes.add_value(path, "run", table, "it must be a table: [run].")
        return {}
    known_keys(path, table, (*OWN, *known), mistakes)
    found, times = {}, {"start": 0.0, "end": END, "every": None}
    for key, value in table.items():
        try:
            if key in times:
                times[key] = decode_number(value, names)
            elif key == "method":
                found["integrator"] = _method(value, (*path, key), mistakes, names)
            elif key in known:
                found[key] = known[key].decode(value, names)
        except Misread as error:
            mistakes.add_value((*path, key), f"run: {key}", value, str(error))
    found["t_span"] = span = times["start"], times["end"]
    if not -math.inf < span[0] < span[1] < math.inf:
        mistakes.add(path, f"run: the end, {span[1]:g} s, must be after the start, {span[0]:g} s.")
    elif times["every"] is not None:
        if "t_eval" in table:
            mistakes.add((*path, "every"), "run: every beside t_eval; give one of them.")
        try:
            found["t_eval"] = output_times(*span, times["every"])
        except InvalidArgument as error:
            mistakes.add((*path, "every"), str(error))
    return found


def output_times(start, end, every):
    """Output times at an interval, with both ends; raises InvalidArgument."""
    if not every > 0.0 or (end - start) / every > MOST:
        raise InvalidArgument(f"every must be an interval in s, with at most {MOST} outputs in a run, got {every:g}.")
    near = max(1e-9 * every, 4.0 * np.finfo(float).eps * max(abs(start), abs(end)))  # s: rounding of the times
    times = start + every * np.arange(math.floor((end - start) / every * (1.0 + 1e-12)) + 1)
    return np.append(times[times < end - near], end)


def _method(value, path, mistakes, names):
    """A method: its name, or a table with its type and arguments."""
    known = {cls.__name__: cls for cls in registered().values()}
    kind = value.get("type") if isinstance(value, dict) else value
    lower = {name.lower(): name for name in known}
    name = lower.get(str(kind).lower().replace("-", "").replace("_", ""))
    if name is None:
        near = close(str(kind).lower(), lower)
        hint = " or ".join(f'"{lower[word]}"' for word in near) or ", ".join(known)
        raise Misread(f'unknown method; write {hint}, or a table such as {{ type = "RK45", rtol = 1e-9 }}.')
    if not isinstance(value, dict):
        return name.lower()
    arguments = types.arguments_of(known[name])
    known_keys(path, value, ("type", *arguments), mistakes)
    given = {key: arguments[key].decode(part, names) for key, part in value.items() if key in arguments}
    try:
        return known[name](**given)
    except TsdynError as error:
        raise Misread(str(error)) from error
