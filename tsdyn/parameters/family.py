"""Scenes that differ in numbers: one analysis, one packing, and the numbers of each.

A value that only enters numbers of the packed arrays (mass, inertia, gravity, a start, what a force or a primitive gets
as par, where their markers are, those of the parts of a joint) is written into a copy of those arrays. All else, such
as functions of time, or a joint whose coordinate a force measures, asks for the scene to be packed anew.
"""

from ..elements.bodies import PointMass
from ..elements.element import checked_parameters
from ..elements.joint import Joint
from ..errors import InvalidArgument
from ..jit.code_hash import is_ours
from ..model.derived import Derived
from ..model.handles import handles_of
from ..model.lengths import size_of
from ..model.packed import checked_motions, classes
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..validation import nearest
from .fields import fields_of

KEPT = ("handles", "body_indices", "members", "places_within", "coordinate_starts", "holonomic", "aligned")


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
        self._members = {id(item): i for i, item in enumerate(template.constraints)}
        bodies = zip((template.ground, *template.bodies), (packed.bodies[0].scene.ground, *packed.bodies), strict=True)
        self._bodies = {id(body): own for body, own in bodies}
        self._loads = {id(force): i for i, force in enumerate(template._forces)}
        self._structural = {}
        self._begins = self._find_begins()

    def _find_begins(self):
        """Where the reals of each primitive begin."""
        taken, rows, found = {}, dict(zip(classes(self.packed), self.packed.system.kinds, strict=True)), []
        for primitive in self.packed.constraints:
            row, at = rows[type(primitive)], taken.get(type(primitive), 0)
            found.append(int(row.reals + at * row.stride))
            taken[type(primitive)] = at + 1
        return found

    def field(self, name):
        """The `Field` of a name; raises InvalidArgument."""
        try:
            return self.fields[name]
        except (KeyError, TypeError):
            raise InvalidArgument(
                f"the scene has no parameter {name!r}{nearest(name, self.fields)} scene.parameters() lists them."
            ) from None

    def load_of(self, owner):
        """The `Load` of a force of the template; None for a constraint."""
        i = self._loads.get(id(owner))
        return None if i is None else self.packed.loads[i]

    def is_structural(self, owner, attributes):
        """Whether more than numbers may follow from some attributes of a constraint or force."""
        known = self._structural.get(id(owner))
        if known is None:
            items = (*self.template._added, *self.template._forces)
            known = self._structural[id(owner)] = (
                getattr(owner, "period", None) is not None
                or (isinstance(owner, Joint) and not is_ours(type(owner).__module__))
                or any(value is owner for item in items for value in vars(item).values())
            )
        if isinstance(owner, Joint):
            return known
        places = [marker.argument for marker in owner.markers] if owner.joint_coordinates else []
        return known or hasattr(owner, "opposed") or any(name in places for name in attributes)

    def own_body(self, body):
        """The body of the packed scene that one of the template stands for."""
        return self._bodies.get(id(body), body)

    def numbers(self, values):
        """The `Packed` and the start of a scene with other values, by name; None if it must be packed anew.

        Raises
        ------
        TsdynError
            As the attribute does when it is set.
        """
        edit, groups = Edit(self), {}
        for name, value in values.items():
            field = self.field(name)
            groups.setdefault(id(field.owner), (field.owner, {}))[1][field.attribute] = value
        for owner, changes in groups.values():
            if not edit.enter(owner, changes):
                return None
        return edit.result()


class Edit:
    """Numbers of a `Family` with changes; arrays are copied when they are first written to."""

    def __init__(self, family):
        self.family, self.packed = family, family.packed
        self._arrays, self._start = {}, None
        self._coordinates = self._parameters = self._loads = self._members = self._constraints = None

    def _array(self, name):
        if name not in self._arrays:
            self._arrays[name] = getattr(self.packed.system, name).copy()
        return self._arrays[name]

    def enter(self, owner, changes):
        """Enter checked values of one owner, by attribute; False if numbers can't express them."""
        if owner is self.family.template:
            self._array("gravity")[:] = with_gravity(owner, changes)
            return True
        if isinstance(owner, PointMass):
            self._enter_body(owner, changes)
            return True
        if self.family.is_structural(owner, changes):
            return False
        if isinstance(owner, Joint):
            return self._enter_joint(self.family._members[id(owner)], owner, changes)
        other = with_attributes(owner, changes)
        load = self.family._loads.get(id(owner))
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
        member = self.packed.members[self.family._members[id(owner)]]
        return self._enter_primitive(member.parts.start, owner, other)

    def _enter_joint(self, i, owner, changes):
        """Enter the parts of a joint, which are made anew for the bodies of the packed scene."""
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
        self._write(self.family._begins[i], owner, other, given)
        if self._parameters is None:
            self._parameters, self._coordinates = list(self.packed.parameters), list(self.packed.coordinates)
        self._parameters[i] = tuple(old if isinstance(old, Motion) else new for old, new in _pairs(before, given))
        self._coordinates[i] = other.coordinates
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
            changes["size"] = size_of(packed.constraints, coordinates)
        if self._loads is not None:
            changes["loads"] = tuple(self._loads)
        if self._members is not None:
            changes |= {"members": tuple(self._members), "constraints": tuple(self._constraints)}
            derived.members = derived.aligned = derived.handles = None  # made of joints
        found = packed._replace(**changes)
        if self._members is not None:
            aliases = {old.constraint: new.constraint for old, new in zip(packed.members, self._members, strict=True)}
            known = handles_of(packed).aliases
            handles_of(found).aliases.update(
                [*((alias, aliases.get(meant, meant)) for alias, meant in known.items()),
                 *((old, new) for old, new in aliases.items() if new is not old)]
            )  # fmt: skip
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
    vars(other)["added"] = False  # so that it tells no scene
    for name, value in changes.items():
        setattr(other, name, value)
    other.check()
    return other


def with_gravity(scene, changes):
    """Return a checked acceleration of free fall."""
    return type(scene)(changes["gravity"]).gravity
