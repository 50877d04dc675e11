"""What the reading of a document has in common: decoded values, names, and mistakes at their places."""

import reprlib
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..errors import InvalidFile, TsdynError
from ..validation import close
from .expressions import Misread

# Mistakes in a file, gathered and reported at once, each with its line, the value and what to write instead.

SHOWN = 50
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class Mistakes:
    """What is wrong in a file.

    Parameters
    ----------
    name : str
        Of the file, in messages.
    places : Places
    """

    def __init__(self, name, places):
        self.name, self.places, self.found = name, places, {}

    def add(self, path, message):
        """Add a mistake at a path, once."""
        self.found.setdefault((path, message), (*self.places.line_and_column(path), message))

    def add_value(self, path, what, value, reason):
        """Add a value that is wrong, with the reason."""
        self.add(path, f"{what} = {_SHORT.repr(value)}: {reason}")

    def demand_none(self):
        """Raise InvalidFile if there are any, in the order of the file."""
        if not self.found:
            return
        found = sorted(self.found.values())
        more = f"\n  and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        lines = "\n".join(f"  {self.name}:{line}:{column}: {message}" for line, column, message in found[:SHOWN])
        count = f"{len(found)} mistake{'s' if len(found) > 1 else ''}"
        raise InvalidFile(f"{self.name} has {count}:\n{lines}{more}", tuple(found))


ROUNDING = 8.0 * np.finfo(float).eps  # of a direction of unit length, scaled again


class Reading(NamedTuple):
    """What is known while a document is read."""

    mistakes: Any
    names: dict  # parameters, by name
    allow_code: bool
    bodies: dict  # by name, None for one that is wrong
    items: dict  # constraints and forces, likewise


def known_keys(path, table, known, mistakes):
    """Add a mistake for each key that isn't known."""
    for key in table:
        if key not in known:
            near = close(key, known) or close(key.rstrip("s"), known)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}."
            mistakes.add((*path, key), f"unknown key {key!r}; {hint}")


def decoded(reading, path, value, decode):
    """A value by a decoder of types.py; None, and a mistake, where that fails."""
    try:
        return decode(value, reading.names)
    except Misread as error:
        reading.mistakes.add_value(path, str(path[-1]), value, str(error))
        return None


def made(reading, path, what, make, positions=(), given=MappingProxyType({})):
    """What a call makes; None, and a mistake at the argument that the message names, where that fails."""
    try:
        return make(*positions, **given)
    except TsdynError as error:
        message = str(error)
    except Exception as error:  # of a plug-in, too
        message = f"{type(error).__name__}: {error}"
    own = not what or what.partition(" ")[2].strip("'") in message
    reading.mistakes.add(_blamed(path, given, message), message if own else f"{what}: {message}")
    return None


def _blamed(path, given, message):
    """The path of the argument that a message names, or else of the table."""
    words = {word.strip(".,:;()'\"").partition("[")[0] for word in message.split()}
    for key in given:
        if words & {key, f"{key}_a", f"{key}_b"}:
            return (*path, key)
    return path


def name_of(reading, path, table, what, taken):
    """The name of a table, "" where there is none."""
    name = table.get("name", "")
    if not isinstance(name, str):
        reading.mistakes.add_value((*path, "name"), f"{what}: name", name, "it must be text in quotes.")
        return ""
    if name and name in taken:
        reading.mistakes.add((*path, "name"), f"{what}: the name {name!r} is in use; choose another one.")
    return name


def arguments_in(reading, path, table, known, what):
    """The decoded values of a table by argument; None where one is wrong."""
    found = {}
    for key, value in table.items():
        if key in known:
            try:
                found[key] = known[key].decode(value, reading.names)
            except Misread as error:
                reading.mistakes.add_value((*path, key), f"{what}: {key}", value, str(error))
    return found


def referred(reading, path, table, referred):
    """The body or constraint that a key names; None where there is none, or it is wrong itself."""
    what, key, kind, known = referred
    if key not in table:
        reading.mistakes.add(path, f"{what} lacks {key}, the name of a {kind}.")
        return None
    name = table[key]
    if not isinstance(name, str) or name not in known:
        near = close(str(name), known)
        there = ", ".join(list(known)[:10]) or "none"
        hint = f"did you mean {' or '.join(map(repr, near))}?" if near else f"there are {there}."
        reading.mistakes.add_value((*path, key), f"{what}: {key}", name, f"no {kind} before it has this name; {hint}")
        return None
    return known[name]


def keep_bits(values, name, given):
    """Where a value of unit length was scaled again, put that of the file in its place: the last bit stays."""
    given, kept = np.array(given, float), values[name]
    if given.shape == kept.shape and np.abs(given - kept).max() <= ROUNDING:
        given.setflags(write=False)
        values[name] = given
