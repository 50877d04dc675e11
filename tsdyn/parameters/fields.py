"""The attributes of a scene that may vary from run to run, by stable names."""

import inspect
import math
from functools import cache
from types import FunctionType
from typing import NamedTuple

import numpy as np

from ..elements.bodies import Attribute, PointMass
from ..errors import InvalidArgument
from ..motions.elementary import Constant
from ..motions.keywords import numbers_of, with_number
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..validation import close, nearest, number
from .units import units_of

GRAVITY = "gravity"


class Field(NamedTuple):
    """An attribute of the scene (gravity), a body, a constraint or a force; or a number of a function that it is."""

    owner: object
    attribute: str
    unit: str  # "" if it is described nowhere
    keyword: str = ""  # of the function

    @property
    def value(self):
        """The present value: a float, a read-only array, or what else the attribute is."""
        value = getattr(self.owner, self.attribute)
        if self.keyword:
            return numbers_of(function_of(value))[self.keyword]
        if isinstance(value, Motion) and isinstance(value.smooth, Constant):
            return value.value(0.0)[0]
        return float(value) if isinstance(value, np.floating) else value

    def entered(self, value, present):
        """The attribute with this value; `present`: what it is now."""
        if not self.keyword:
            return value
        what = f"{self.owner.name}.{self.attribute}.{self.keyword}"
        function = present if isinstance(present, FunctionType) else function_of(present)
        return with_number(function, self.keyword, value, what)

    @property
    def is_numeric(self):
        """Whether the present value is a number, or an array of numbers."""
        value = self.value
        if isinstance(value, np.ndarray):
            return value.dtype.kind == "f" and value.size > 0
        return not isinstance(value, (bool, str)) and math.isfinite(number(value))


def fields_of(scene):
    """The `Field`s of a scene by name, "object.attribute"; names that stand for several are left out."""
    found, several = {GRAVITY: Field(scene, GRAVITY, "m/s^2")}, set()
    for owner in (*scene.bodies, *scene._added, *scene._forces):
        units = units_of(type(owner))
        for attribute in attributes_of(type(owner)):
            if not _is_own(owner, attribute):
                continue
            name = f"{owner.name}.{attribute}"
            if name in found:
                several.add(name)
            found[name] = Field(owner, attribute, units.get(attribute, ""))
            for keyword in numbers_of(function_of(getattr(owner, attribute))):
                found[f"{name}.{keyword}"] = Field(owner, attribute, "", keyword)
    return {name: field for name, field in found.items() if name not in several}


def unknown_field(name, fields):
    """The error of a name that no field has: similar names, or what the object has that it begins with."""
    own = [known for known in fields if known.partition(".")[0] == str(name).partition(".")[0]]
    near = close(name, fields)
    said = nearest(name, fields) if near or not own else f"; there are {', '.join(own)}."
    return InvalidArgument(f"the scene has no parameter {name!r}{said} scene.parameters() lists them.")


def function_of(value):
    """The user's function that a motion or load is; None for anything else."""
    if isinstance(value, Motion):
        return value.given[0] if len(value.given) == 1 else None
    if isinstance(value, Signal):
        return value.source if value.is_function else None
    return value if isinstance(value, FunctionType) else None


@cache
def attributes_of(cls):
    """The names of the attributes of a class that may be set: those checked, and arguments that are kept."""
    if issubclass(cls, PointMass):
        return tuple(name for base in reversed(cls.__mro__) for name, it in vars(base).items() if _is_attribute(it))
    checked = getattr(cls, "quantities", ())
    checked = checked() if callable(checked) else checked
    known = dict.fromkeys([*inspect.signature(cls).parameters, *checked])
    return tuple(name for name in known if name not in ("a", "b", "name", *cls.permanent))


def _is_attribute(value):
    return isinstance(value, Attribute)


def _is_own(owner, attribute):
    """Whether an item keeps an argument: as an attribute, or as where a marker is."""
    if isinstance(owner, PointMass):
        return True
    placed = [marker.argument for marker in owner.markers if marker.placed and not _is_particle(owner, marker)]
    borrowed = isinstance(getattr(type(owner), "coordinates", None), property)  # markers are where those of a joint are
    return attribute in vars(owner) or (attribute in placed and not borrowed)


def _is_particle(owner, marker):
    """Whether a marker is on a point mass, which has no other point than itself."""
    return getattr(owner.body_of(marker), "dimension", 0) == 3
