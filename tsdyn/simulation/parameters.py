"""Parameters of a scene: what may vary from run to run, by name and unit, and the packed numbers of other values."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..calls import SECTION
from ..drawing import aligned, html_table
from ..elements.bodies import Attribute, Ground, PointMass
from ..elements.element import Attachment, checked_parameters
from ..elements.joint import Joint, SumRow
from ..elements.laws import SceneLaw
from ..errors import InvalidArgument, UnknownParameter
from ..files.scene_text import TableNumbers
from ..files.types import Unwritable, encode
from ..jit.code_hash import is_ours
from ..model.handles import begins_of, handles_of
from ..model.packed import Derived, checked_motions, reaches_of, size_of_reaches
from ..motions.elementary import Constant
from ..motions.prescribed import Motion
from ..motions.signals import Signal, numbers_of, with_number
from ..validation import close, counted, floats, nearest, number
from .phase_scenes import has_contacts

if TYPE_CHECKING:
    from ..hints import Floats


# Units of attributes, read from where they are described: the docstrings of classes and attributes.

_UNIT = re.compile(r"(1|(kg|m|s|N|J|W|rad)(\^\d)?([ /](kg|m|s|N|J|W|rad)(\^\d)?)*|rad or m)$")
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


# The attributes of a scene that may vary from run to run, by stable names.

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
        if isinstance(value, (list, tuple)):  # as given: ratios, coefficients
            numbers = floats(value)
            numbers.flags.writeable = False
            return numbers
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
    """The `Field`s of a scene by name, "object.attribute"; names that stand for several are left out.

    Numbers of the table `parameters` of its file are first.
    """
    numbers = TableNumbers() if scene._named is None else scene._named.values
    found, several = {name: Field(numbers, name, "") for name in vars(numbers)}, set()
    found[GRAVITY] = Field(scene, GRAVITY, "m/s^2")
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
        return tuple(
            name for base in reversed(cls.__mro__) for name, it in vars(base).items() if isinstance(it, Attribute)
        )
    checked = getattr(cls, "quantities", ())
    checked = checked() if callable(checked) else checked
    known = dict.fromkeys([*inspect.signature(cls).parameters, *checked])
    return tuple(name for name in known if name not in ("a", "b", "name", *cls.permanent))


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


# The parameters of a scene: a mapping of names to values, with units.

DIGITS = 6  # shown


class ParameterList(Mapping[str, "float | Floats"]):
    """The parameters of a scene by name, "object.attribute": numbers and arrays in SI units.

    Attributes
    ----------
    units : dict
        Unit of each; "1" for pure numbers, "" where the class of a plug-in doesn't describe the attribute.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.5, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> parameters = scene.parameters()
    >>> parameters["rod.length"], parameters.units["rod.length"]
    (1.0, 'm')
    >>> print(parameters)
    gravity       [0, 0, -10]  m/s^2
    bob.mass              1.5  kg
    bob.position    [1, 0, 0]  m
    bob.velocity    [0, 0, 0]  m/s
    rod.point_b     [0, 0, 0]  m
    rod.length              1  m
    """

    def __init__(self, values: dict[str, Any], units: dict[str, str]) -> None:
        self._values, self.units = values, units

    def __getitem__(self, name: str) -> float | Floats:
        try:
            return self._values[name]
        except (KeyError, TypeError):
            known = nearest(name, self._values)
            raise UnknownParameter(f"the scene has no parameter {name!r}{known}") from None

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def get(self, name: str, default: Any = None) -> Any:
        """The value of a parameter, or a default where there is none."""
        return self._values.get(name, default)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def _rows(self):
        return [(name, shown(value), self.units[name]) for name, value in self._values.items()]

    def __str__(self) -> str:
        return "\n".join(aligned(self._rows(), (0, 2)))

    def __repr__(self) -> str:
        return f"<{counted(len(self), 'parameter')}>\n{self}"

    def _repr_html_(self) -> str:
        """Return a table, for notebooks."""
        return html_table(self._rows(), heads=("parameter", "value", "unit"))


def shown(value: Any) -> str:
    """Return a number or an array as short text; a matrix that is diagonal by its diagonal."""
    array = np.asarray(value, dtype=float)
    if array.ndim == 0:
        return f"{float(array):.{DIGITS}g}"
    if array.ndim == 2:
        diagonal = np.diag(np.diag(array))
        return f"diag {shown(np.diag(array))}" if (array == diagonal).all() else f"[{', '.join(map(shown, array))}]"
    return f"[{', '.join(f'{x + 0.0:.{DIGITS}g}' for x in array.tolist())}]"


# Numbers of scenes with other values, written into copies of the packed arrays.

# entries of `Derived` that numbers don't change
KEPT = ("handles", "body_indices", "members", "places_within", "coordinate_starts", "holonomic", "aligned")


class Edit:
    """Numbers of a `Family` with changes; arrays are copied when they are first written to."""

    def __init__(self, family):
        self.family, self.packed = family, family.packed
        self._arrays, self._start = {}, None
        self._coordinates = self._parameters = self._loads = self._members = self._constraints = self._reaches = None

    def _array(self, name):
        if name not in self._arrays:
            self._arrays[name] = getattr(self.packed.system, name).copy()
        return self._arrays[name]

    def enter(self, owner, changes):
        """Enter checked values of one owner, by attribute; False if numbers can't express them."""
        if isinstance(owner, TableNumbers):
            return False
        if owner is self.family.template:
            self._array("gravity")[:] = type(owner)(changes["gravity"]).gravity
            return True
        if isinstance(owner, PointMass):
            self._enter_body(owner, changes)
            return True
        if self.family.is_structural(owner, changes):
            return False
        if isinstance(owner, Joint):
            return self._enter_joint(self.family.members[id(owner)], owner, changes)
        other = with_attributes(owner, changes)
        if getattr(other, "taken", 0) != getattr(owner, "taken", 0):
            return False
        load = self.family.loads.get(id(owner))
        return self._enter_constraint(owner, other) if load is None else self._enter_force(load, owner, other)

    def _enter_body(self, body, changes):
        other, i = with_values(body, changes), body.index
        if "mass" in changes:
            self._array("mass")[i] = other.values["mass"]
        if "inertia" in changes:
            self._array("inertia")[i] = other.values["inertia"].ravel()
        if not changes.keys() <= {"mass", "inertia"}:
            if self._start is None:
                self._start = tuple(array.copy() for array in self.family.start)
            at, length = self.packed.system.bodies[i].tolist()
            self._start[0][at : at + length], self._start[1][at : at + length] = other.q, other.qd

    def _enter_constraint(self, owner, other):
        member = self.packed.members[self.family.members[id(owner)]]
        return self._enter_primitive(member.parts.start, owner, other)

    def _enter_joint(self, i, owner, changes):
        """Enter the parts of a joint, which are made again for the bodies of the packed scene."""
        other, member = sketch(owner), self.packed.members[i]
        vars(other).update(a=self.family.own_body(owner.a), b=self.family.own_body(owner.b))
        other = with_attributes(other, changes)
        if [type(part) for part in other.parts] != [type(part) for part in owner.parts]:
            return False
        first = member.parts.start
        if not all(
            self._enter_primitive(first + j, *pair) for j, pair in enumerate(zip(owner.parts, other.parts, strict=True))
        ):
            return False
        if self._members is None:
            self._members, self._constraints = list(self.packed.members), list(self.packed.constraints)
        self._members[i] = member._replace(constraint=other, coordinates=other.coordinates)
        self._constraints[member.parts] = other.parts
        return True

    def _enter_primitive(self, i, owner, other):
        """Enter a primitive, the i-th of the packed scene, as another one like it; False if it isn't like it."""
        given, before = checked_motions(other), self.packed.parameters[i]
        if other.rheonomic != owner.rheonomic or not _alike(given, before):
            return False
        self._write(self.family.begins[i], owner, other, given)
        if self._parameters is None:
            self._parameters, self._coordinates = list(self.packed.parameters), list(self.packed.coordinates)
            self._reaches = list(self.family.reaches)
        self._parameters[i] = tuple(old if isinstance(old, Motion) else new for old, new in _pairs(before, given))
        self._coordinates[i] = other.coordinates
        self._reaches[i] = reaches_of(other, other.coordinates)
        return True

    def _enter_force(self, i, owner, other):
        load = self.packed.loads[i]
        given = checked_parameters(other, Signal, "loads")
        if other.kernels is not owner.kernels or not _alike(given, load.parameters):
            return False
        self._write(int(load.alone[0].reals), owner, other, given)
        if self._loads is None:
            self._loads = list(self.packed.loads)
        kept = tuple(old if isinstance(old, Signal) else new for old, new in _pairs(load.parameters, given))
        self._loads[i] = load._replace(parameters=kept, coordinates=other.coordinates)
        return True

    def _write(self, at, owner, other, given):
        """Write coordinates and parameters where those of the owner are."""
        reals = self._array("reals")
        for old, new in zip(owner.coordinates, other.coordinates, strict=True):
            if new is not old:
                reals[at : at + 3] = new
            at += 3
        for value in given:
            if isinstance(value, (Motion, Signal)):
                at += 3 if isinstance(value, Motion) else value.width
            else:
                reals[at] = value
                at += 1

    def result(self):
        """As of `Family.numbers`."""
        packed, derived = self.packed, Derived()
        for name in KEPT:
            setattr(derived, name, getattr(packed.derived, name))
        derived.shared, derived.family = self.family.shared, self.family
        changes = {"derived": derived, "system": packed.system._replace(**self._arrays)}
        if self._coordinates is not None:
            coordinates = tuple(self._coordinates)
            changes |= {"parameters": tuple(self._parameters), "coordinates": coordinates}
            changes["size"] = size_of_reaches(self._reaches)
        if self._loads is not None:
            changes["loads"] = tuple(self._loads)
        if self._members is not None:
            changes |= {"members": tuple(self._members), "constraints": tuple(self._constraints)}
            derived.members = derived.aligned = derived.handles = None  # made of joints
        found = packed._replace(**changes)
        if self._members is not None:
            aliases = {old.constraint: new.constraint for old, new in zip(packed.members, self._members, strict=True)}
            known = [(alias, aliases.get(meant, meant)) for alias, meant in handles_of(packed).aliases()]
            handles_of(found).add_aliases([*known, *((old, new) for old, new in aliases.items() if new is not old)])
        return found, self._start or self.family.start


def _pairs(before, given):
    return zip(before, given, strict=True)


def _alike(given, before):
    """Whether parameters have functions where others have the same, and numbers where they have numbers."""
    if len(given) != len(before):
        return False
    return all(_same(*pair) for pair in _pairs(before, given))


def _same(old, new):
    if isinstance(old, Motion) and isinstance(new, Motion):
        return old.smooth is new.smooth and old.given == new.given
    if isinstance(old, Signal) and isinstance(new, Signal):
        return old is new or old.source is new.source
    return not isinstance(old, (Motion, Signal)) and not isinstance(new, (Motion, Signal))


def sketch(owner):
    """Return a copy of a body, constraint or force that shares all it refers to, in no scene's lists."""
    other = object.__new__(type(owner))
    vars(other).update(vars(owner))
    return other


def with_values(body, changes):
    """Return a sketch of a body with other values, checked."""
    other = sketch(body)
    checked = {name: getattr(type(body), name).check(value, body) for name, value in changes.items()}
    vars(other)["values"] = {**body.values, **checked}
    return other


def with_attributes(item, changes):
    """Return a sketch of a constraint or force with other attributes, checked."""
    other = sketch(item)
    vars(other)["added"] = False  # so that no scene is notified
    for name, value in changes.items():
        setattr(other, name, value)
    other.check()
    vars(other)["added"] = item.added
    return other


# A scene of a file with other numbers of its table `parameters`: made of the file again, then edited as the scene was.


def edits_of(scene):
    """What has been set since a scene was made of its file: owner, attribute and value; None if it has other parts."""
    base = scene._named.made(type(scene), {})
    if [(type(one), one.name) for one in _parts(scene)] != [(type(one), one.name) for one in _parts(base)]:
        return None
    before = fields_of(base)
    return [
        (field.owner, field.attribute, field.value)
        for name, field in fields_of(scene).items()
        if not isinstance(field.owner, TableNumbers) and not field.keyword
        if name not in before or not _equal(field.value, before[name].value)
    ]


def of_file(scene, numbers, edits):
    """Return the scene with other numbers of its file, in which its handles have counterparts, `twin[handle]`."""
    if edits is None:
        raise InvalidArgument(
            f"{', '.join(numbers)}: the scene has other parts than its file, so [parameters] of the file can't be set "
            "any more; set attributes of bodies, constraints and forces, or edit the file."
        )
    twin = scene._named.made(type(scene), numbers)
    twin._twins = WeakKeyDictionary(zip(_parts(scene), _parts(twin), strict=True))
    for owner, attribute, value in edits:
        setattr(twin if owner is scene else twin[owner], attribute, value)
    return twin


def _parts(scene):
    return (scene.ground, *scene.bodies, *scene.constraints, *scene.forces)


def _equal(one, other):
    """Whether values of an attribute are the same in two scenes; functions of time by what a file has of them."""
    try:
        return one is other or repr(_plain(one)) == repr(_plain(other))
    except Unwritable:
        return False


def _plain(value):
    """What a file has of a value; of a body or joint its name."""
    if isinstance(value, (Attachment, PointMass, Ground)):
        return value.name
    return [_plain(part) for part in value] if isinstance(value, (tuple, list)) else encode(value)


# Scenes that differ in numbers: one analysis, one packing, and the numbers of each.
#
# A value that only enters numbers of the packed arrays (mass, inertia, gravity, a start, what a force or a primitive
# gets as par, where their markers are, those of the parts of a joint) is written into a copy of those arrays. All else,
# such as functions of time, or a joint whose coordinate a force measures, requires the scene to be packed again.


class Family:
    """A scene as it was packed, and what scenes with other parameters share with it.

    Parameters
    ----------
    packed : Packed
    start : tuple of ndarray
        q and qd (n,) of the bodies.
    template : Scene
        A copy of the scene that nobody edits.
    """

    def __init__(self, packed, start, template):
        self.packed, self.start, self.template = packed, start, template
        self.fields, self.shared = fields_of(template), {}
        handles_of(packed)
        self.members = {id(item): i for i, item in enumerate(template.constraints)}
        bodies = zip((template.ground, *template.bodies), (packed.bodies[0].scene.ground, *packed.bodies), strict=True)
        self._bodies = {id(body): own for body, own in bodies}
        self.loads = {id(force): i for i, force in enumerate(template._forces)}
        self._structural, self._has_laws = {}, any(load.law is not None for load in packed.loads)
        self.begins = [*begins_of(self.packed).values()]
        self.reaches = [reaches_of(*pair) for pair in zip(packed.constraints, packed.coordinates, strict=True)]

    def field(self, name):
        """The `Field` of a name; raises InvalidArgument."""
        try:
            return self.fields[name]
        except (KeyError, TypeError):
            raise unknown_field(name, self.fields) from None

    def load_of(self, owner):
        """The `Load` of a force of the template; None for a constraint."""
        i = self.loads.get(id(owner))
        return None if i is None else self.packed.loads[i]

    def is_structural(self, owner, attributes):
        """Whether more than numbers may follow from some attributes of a constraint or force."""
        known = self._structural.get(id(owner))
        if known is None:
            items = (*self.template._added, *self.template._forces)
            known = self._structural[id(owner)] = (
                getattr(owner, "period", None) is not None
                or getattr(owner, "adds_inertia", False)
                or (isinstance(owner, Joint) and not is_ours(type(owner).__module__))
                or isinstance(owner, SumRow)  # its terms are where joints are
                or any(value is owner for item in items for value in item.referred)
                or (self._has_laws and bool(owner.joint_coordinates))
            )
        if isinstance(owner, Joint):
            return known
        if isinstance(owner, SceneLaw) and set(attributes) != {owner.given}:
            return True
        places = [marker.argument for marker in owner.markers] if owner.joint_coordinates else []
        return known or hasattr(owner, "opposed") or any(name in places for name in attributes)

    def own_body(self, body):
        """The body of the packed scene that one of the template stands for."""
        return self._bodies.get(id(body), body)

    @cached_property
    def _edits(self):
        return edits_of(self.template)

    def copied(self, values):
        """A copy of the template with those of some values, by name, that are numbers of its file; and the others."""
        numbers = {name: value for name, value in values.items() if isinstance(self.field(name).owner, TableNumbers)}
        if not numbers:
            return self.template.copy(), values
        others = {name: value for name, value in values.items() if name not in numbers}
        return of_file(self.template, numbers, self._edits), others

    def numbers(self, values):
        """The `Packed` and the start of a scene with other values, by name; None if it must be packed again.

        Raises
        ------
        TsdynError
            As the attribute does when it is set.
        """
        if has_contacts(self.template):  # scenes of its phases are packed of the scene's own rows
            return None
        edit, groups = Edit(self), {}
        for name, value in values.items():
            field = self.field(name)
            owner, changes = groups.setdefault(id(field.owner), (field.owner, {}))
            present = changes[field.attribute] if field.attribute in changes else getattr(owner, field.attribute)
            changes[field.attribute] = field.entered(value, present)
        for owner, changes in groups.values():
            if not edit.enter(owner, changes):
                return None
        return edit.result()
