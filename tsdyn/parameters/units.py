"""Units of attributes, read from where they are described: the docstrings of classes and attributes."""

import inspect
import re
from functools import cache

from ..docstrings import SECTION
from ..elements.bodies import Attribute

_UNIT = re.compile(r"(1|(kg|m|s|N|J|W|rad)(\^\d)?([ /](kg|m|s|N|J|W|rad)(\^\d)?)*)$")
_ENTRY = re.compile(r"(?m)^([\w, ]+) : (.*)$")


@cache
def units_of(cls):
    """Units of the described attributes of a class, by name; "1" for pure numbers."""
    found = {}
    for base in reversed(cls.__mro__):
        found |= _of_attributes(base) | _of_arguments(base)
    return found


def _of_attributes(cls):
    """Units of the `Attribute`s of a body class: "Mass, kg."."""
    known = {name: value.__doc__ for name, value in vars(cls).items() if isinstance(value, Attribute)}
    return {name: _units(text.rstrip("."), 1)[0] for name, text in known.items() if text}


def _of_arguments(cls):
    """Units of the arguments in a docstring: "stiffness, damping : float, N/m and N s/m"."""
    _, *parts = SECTION.split(inspect.cleandoc(vars(cls).get("__doc__") or ""))
    found = {}
    for names, text in _ENTRY.findall(dict(zip(parts[::2], parts[1::2], strict=True)).get("Parameters", "")):
        listed = names.split(", ")
        found |= dict(zip(listed, _units(text, len(listed)), strict=True))
    return found


def _units(text, count):
    """The units that a description names, for so many attributes."""
    for part in re.split("[,;]", text):
        units = [unit.strip() for unit in part.split(" and ")]
        if all(map(_UNIT.match, units)):
            return units * count if len(units) == 1 else units
    return ["1"] * count
