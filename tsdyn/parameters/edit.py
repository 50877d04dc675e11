"""Numbers of scenes with other values, written into copies of the packed arrays."""

from ..elements.bodies import PointMass
from ..elements.element import checked_parameters
from ..elements.joint import Joint
from ..model.derived import Derived
from ..model.handles import handles_of
from ..model.lengths import reaches_of, size_of_reaches
from ..model.packed import checked_motions
from ..motions.prescribed import Motion
from ..motions.signals import Signal

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
        if owner is self.family.template:
            self._array("gravity")[:] = with_gravity(owner, changes)
            return True
        if isinstance(owner, PointMass):
            self._enter_body(owner, changes)
            return True
        if self.family.is_structural(owner, changes):
            return False
        if isinstance(owner, Joint):
            return self._enter_joint(self.family.members[id(owner)], owner, changes)
        other = with_attributes(owner, changes)
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
    vars(other)["added"] = False  # so that it tells no scene
    for name, value in changes.items():
        setattr(other, name, value)
    other.check()
    vars(other)["added"] = item.added
    return other


def with_gravity(scene, changes):
    """Return a checked acceleration of free fall."""
    return type(scene)(changes["gravity"]).gravity
