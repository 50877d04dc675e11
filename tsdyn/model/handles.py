"""Handles of a packed scene: bodies, constraints, forces, joint coordinates and their motion; what it consists of."""

import threading
from collections import Counter
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..elements.bodies import PointMass, named
from ..elements.element import Attachment, angles, displacements
from ..elements.force import Force
from ..errors import InvalidBody, InvalidConstraint
from ..jit.kernels import twin
from ..maths import vectors
from ..maths.tolerances import TYPED
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from . import joint_turns

# Values, rates and accelerations of joint coordinates on a motion (q, qd, qdd), in plain Python.
#
#     u = A_own^T A_other omega_other',  w = u - omega_own'       the relative angular velocity, frame of the own body
#     wd = A_own^T A_other omegad_other' - omegad_own' - omega_own' x u,  vd = w x v,  vdd = wd x v + w x vd
#     thetadd = (E Fdd - F Edd) / (E^2 + F^2) - 2 thetad (E Ed + F Fd) / (E^2 + F^2)        (1)
#     d = x_other - x_own,  s = e.d,  sd = e.dd + ed.d,  sdd = e.ddd + 2 ed.dd + edd.d      (2)
#
# theta, thetad, E and F are defined in joint_turns.py. q, qd and qdd are (n,) for one instant or (k, n) for k instants;
# results are numbers or arrays (k,).

add, cross, dot, spin, subtract = map(twin, (vectors.add, vectors.cross, vectors.dot, vectors.spin, vectors.subtract))
to_body, to_ground, seen, rate_of = map(
    twin, (vectors.to_body, vectors.to_ground, joint_turns.seen, joint_turns.rate_of)
)
TURN_ROUND = 2.0 * np.pi
ZERO, IDENTITY = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


class BodyMotion:
    """The motion of one body: components of its coordinates, tuples of numbers or of arrays over outputs.

    Parameters
    ----------
    at, dimension : int
        Where its coordinates begin, and how many they are; 0 for the ground.
    levels : tuple of ndarray (n,) or (k, n)
        q, then qd and qdd where rates and accelerations are asked for.
    """

    __slots__ = ("at", "dimension", "levels")

    def __init__(self, at, dimension, levels):
        self.at, self.dimension, self.levels = at, dimension, levels

    def _part(self, level, first, size):
        array, first = self.levels[level], self.at + first
        if array.ndim == 1:
            return tuple(array[first : first + size].tolist())
        return tuple(array[:, i] for i in range(first, first + size))

    def centroid(self, level):
        """r, rd or rdd."""
        return self._part(level, 0, 3) if self.dimension else ZERO

    @property
    def p(self):
        """Euler parameters."""
        return self._part(0, 3, 4) if self.dimension == 7 else IDENTITY

    def turning(self, level):
        """omega' or omegad'."""
        return spin(self.p, self._part(level, 3, 4)) if self.dimension == 7 else ZERO

    def arm(self, s, level):
        """A s, or its first or second derivative, ground frame."""
        if self.dimension != 7:
            return s if level == 0 else ZERO
        if level > 0:
            omega, s0 = self.turning(1), s
            s = cross(omega, s)
            if level == 2:
                s = add(cross(self.turning(2), s0), cross(omega, s))
        return to_ground(self.p, s)

    def point(self, s, level):
        """x = r + A s, or its first or second derivative; the only point of a point mass is r."""
        return self.centroid(level) if self.dimension == 3 else add(self.centroid(level), self.arm(s, level))


def counted(value, near):
    """An angle on the turn that lies nearest to another."""
    return value + TURN_ROUND * np.round((near - value) / TURN_ROUND)


def angle(geometry, own, other, level):
    """The angle in (-pi, pi], its rate or its acceleration; own and other are the `BodyMotion` of its bodies."""
    f, g, v = geometry.f, geometry.g, seen(own.p, other.p, geometry.h)
    if level == 0:
        return np.arctan2(dot(g, v), dot(f, v))
    u, omega = seen(own.p, other.p, other.turning(1)), own.turning(1)
    w = subtract(u, omega)
    rate = rate_of(f, g, v, w)
    if level == 1:
        return rate
    gain = subtract(seen(own.p, other.p, other.turning(2)), own.turning(2))
    vd, wd = cross(w, v), subtract(gain, cross(omega, u))
    vdd = add(cross(wd, v), cross(w, vd))
    E, F = dot(f, v), dot(g, v)
    second = E * dot(g, vdd) - F * dot(f, vdd) - 2.0 * rate * (E * dot(f, vd) + F * dot(g, vd))
    return second / (E * E + F * F)


def all_angles(handles, q):
    """The angles (count,) of all joints of some `Handles` at q (n,), in (-pi, pi]."""
    parameters = []
    for at, dimension in (handles.joints[:, :2].T, handles.joints[:, 2:].T):
        p, turns = np.tile(IDENTITY, (handles.count, 1)), dimension == 7
        p[turns] = q[at[turns, None] + np.arange(3, 7)]
        parameters.append(tuple(p.T))
    f, g, h = (tuple(handles.frames[:, i : i + 3].T) for i in (0, 3, 6))
    v = seen(*parameters, h)
    return np.arctan2(dot(g, v), dot(f, v))


def displacement(geometry, own, other, level):
    """s of Eq. (2), its rate or its acceleration."""
    total = 0.0
    for i in range(level + 1):
        apart = subtract(other.point(geometry.s_other, level - i), own.point(geometry.s_own, level - i))
        total = total + (2.0 if (level, i) == (2, 1) else 1.0) * dot(own.arm(geometry.e, i), apart)
    return total


# Handles of a packed scene: bodies, constraints, forces, their coordinates, and the angles that runs count.

_lock = threading.Lock()  # of aliases, which scenes of a family share


class HandleCoordinates(NamedTuple):
    """The joint coordinates of one constraint or force."""

    item: object
    angles: tuple  # AngleGeometry each
    displacements: tuple  # DisplacementGeometry each
    first: int  # of its angles among all


class DrivenCoordinate(NamedTuple):
    """A coordinate of a joint that a motor prescribes."""

    motor: HandleCoordinates
    joint: HandleCoordinates
    geometry: object  # of the joint
    place: int  # of an angle among all; -1 for a displacement


class Handles:
    """What positions of bodies and coordinates of joints are looked up by.

    Attributes
    ----------
    bodies, items : tuple
        Items are the constraints and forces that have been added, joints whole.
    names : list of str
        Of bodies and items, as they were when these were packed.
    rows : tuple of Row
        Of the items that have joint coordinates.
    count : int
        Number of angles.
    joints : ndarray (count, 4)
        Where the coordinates of the own and of the other body begin, and how many they are.
    frames : ndarray (count, 9)
        f, g and h of each angle.
    driven : list of Driven
    """

    def __init__(self, bodies, places, members, forces):
        self.bodies = bodies
        constraints = [member.constraint for member in members]
        constraints = [each for each in constraints if not getattr(each, "normalises", False)]
        self.items = (*constraints, *forces)
        self.names = [each.name for each in (*bodies, *self.items)]
        self._where = {body: tuple(place) for body, place in zip(self.bodies, places, strict=True)}
        self._by_item, self._aliases = None, WeakKeyDictionary()
        rows, joints, frames = [], [], []
        for item in self.items:
            if item.joint_coordinates:
                rows.append(HandleCoordinates(item, tuple(angles(item)), tuple(displacements(item)), len(joints)))
                for angle in rows[-1].angles:
                    joints.append([*self.where(angle.own), *self.where(angle.other)])
                    frames.append([*angle.f, *angle.g, *angle.h])
        self.rows, self.count = tuple(rows), len(joints)
        motors = [row for row in rows if row.item.drives]
        joints_only = [row for row in rows if not row.item.drives and not isinstance(row.item, Force)]
        self.driven = [one for motor in motors for joint in joints_only for one in _driven(motor, joint)]
        self._begins = [row for row in rows if row.angles and _begins(row.item)]
        self.joints = np.array(joints, np.int64).reshape(-1, 4)
        self.frames = np.array(frames, float).reshape(-1, 9)

    def __getstate__(self):
        """An item is another object where this is unpickled."""
        return {**self.__dict__, "_by_item": None, "_aliases": None}

    def __setstate__(self, state):
        self.__dict__.update(state, _aliases=WeakKeyDictionary())

    def where_some_act(self, items):
        """The same handles where only some of the items take part in the equations: coordinates of all are counted."""
        other, acting = object.__new__(Handles), {id(item) for item in items}
        vars(other).update(vars(self))
        other.driven = [one for one in self.driven if {id(one.motor.item), id(one.joint.item)} <= acting]
        return other

    def where(self, body):
        """Where the coordinates of a body begin, and how many they are; (0, 0) for the ground."""
        return self._where.get(body, (0, 0))

    def body(self, body):
        """A body of the scene, by handle or name."""
        if isinstance(body, str):
            return self._known(self.bodies, body) or named(self.bodies, body, "body", InvalidBody)
        body = self.own(body)
        if not isinstance(body, PointMass) or body not in self._where:
            raise InvalidBody(f"{body!r} is not a body of this scene{self._elsewhere(body)}.")
        return body

    def _elsewhere(self, body):
        """The end of a sentence on a body of another scene."""
        if not isinstance(body, PointMass) or body.scene is self.bodies[0].scene:
            return ""
        same = any(own.name == body.name for own in self.bodies)
        return f"; it belongs to another scene{f'. The name {body.name!r} stands for the body here' if same else ''}"

    def item(self, item):
        """A constraint or force of the scene, by name; a handle as it is."""
        if isinstance(item, str):
            return self._known(self.items, item) or named(self.items, item, "constraint or force", InvalidConstraint)
        return self.own(item)

    def _known(self, things, name):
        """The one of bodies or items that had a name; None where none had, or several."""
        known = self.names[: len(self.bodies)] if things is self.bodies else self.names[len(self.bodies) :]
        return things[known.index(name)] if known.count(name) == 1 else None

    def names_of(self, things):
        """The names of bodies or items as they were."""
        known = dict(zip(map(id, (*self.bodies, *self.items)), self.names, strict=True))
        return [known[id(thing)] for thing in things]

    def own(self, handle):
        """A handle of this scene in place of one of another scene of the family."""
        return self._aliases.get(handle, handle) if isinstance(handle, (PointMass, Attachment)) else handle

    def add_aliases(self, pairs):
        """Let handles of other scenes of the family stand for handles of this one, in pairs."""
        with _lock:
            self._aliases.update(pairs)

    def aliases(self):
        """All such pairs, a list."""
        with _lock:
            return list(self._aliases.items())

    def row(self, joint, kind):
        """The `HandleCoordinates` of a joint that has some of a kind of coordinates: "angle" or "displacement"."""
        if self._by_item is None:
            self._by_item = {id(row.item): row for row in self.rows}
        joint = self.item(joint)
        row, declared = self._by_item.get(id(joint)), getattr(joint, "joint_coordinates", ())
        if row is None and declared:
            raise InvalidConstraint(f"{joint!r} is not a constraint or force of this solution's scene.")
        if row is None or not getattr(row, f"{kind}s"):
            other = "it has a displacement" if kind == "angle" else "it has an angle"
            raise InvalidConstraint(f"{joint!r} has no {kind}; {other if declared else 'it has no coordinate'}.")
        return row

    def motions(self, geometry, levels):
        """The `BodyMotion` of the two bodies of a geometry; levels are q, qd, qdd."""
        return [BodyMotion(*self.where(body), levels) for body in (geometry.own, geometry.other)]

    @property
    def begin_at_zero(self):
        """Whether counting begins at zero wherever the bodies are."""
        return not self._begins

    def angles_at_start(self, t, q):
        """The angles (count,) near which counting begins at q (n,)."""
        near = np.zeros(self.count)
        for row in self._begins:
            moved = [displacement(g, *self.motions(g, (q,)), 0) for g in row.displacements]
            near[row.first : row.first + len(row.angles)] = row.item.counted_from(t, *moved)
        for motor, joint, _, place in self.driven:
            if place >= 0 and not counts(joint.item):
                near[place] = near[motor.first]
        return near


def _driven(motor, joint):
    """Yield the coordinates of a joint that are those of a motor, to rounding."""
    kind = f"{motor.item.drives}s"
    (own,) = getattr(motor, kind)
    for i, geometry in enumerate(getattr(joint, kind)):
        same = geometry[:2] == own[:2]
        if same and np.allclose(geometry[2:], own[2:], rtol=TYPED, atol=TYPED):
            yield DrivenCoordinate(motor, joint, geometry, joint.first + i if kind == "angles" else -1)


def counts(item):
    """Whether an item says itself where counting begins: its displacement counts turns, or its motor does."""
    return type(item).counted_from is not Attachment.counted_from


def _begins(item):
    """Return True if the angles of an item may begin elsewhere than near zero."""
    return counts(item) or np.any(item.angle_near)


def handles_of(packed):
    """The `Handles` of a packed scene, made once."""
    if packed.derived.handles is None:
        forces = [load.force for load in packed.loads]
        packed.derived.handles = Handles(packed.bodies, packed.system.bodies.tolist(), packed.members, forces)
    return packed.derived.handles


def has_rates(scene):
    """Whether any constraint of a scene, or of a `Packed`, has rows on velocities."""
    return any(constraint.rate_rows for constraint in scene.constraints)


def of_rates(packed):
    """Which rows of Phi are rows on velocities, bool (m,)."""
    counts = [count for constraint in packed.constraints for count in (constraint.rows, constraint.rate_rows)]
    return np.repeat(np.arange(len(counts)) % 2 == 1, counts)


def classes(packed):
    """The classes of constraints, in the order of System.kinds."""
    return list(dict.fromkeys(type(constraint) for constraint in packed.constraints))


def begins_of(packed):
    """Where the reals of each primitive begin, by its id, in the order of their rows."""
    kinds, taken, found = dict(zip(classes(packed), packed.system.kinds, strict=True)), Counter(), {}
    for primitive in packed.constraints:
        row = kinds[type(primitive)]
        found[id(primitive)] = int(row.reals + taken[type(primitive)] * row.stride)
        taken[type(primitive)] += 1
    return found


def inertia_classes(packed):
    """The classes of rows that add inertia, in the order of System.inertias."""
    return list(dict.fromkeys(type(row) for row in packed.inertias))


def user_functions(packed):
    """Yield whatever holds compiled functions of a user's, and those functions."""
    for given in packed.parameters:
        for value in given:
            if isinstance(value, Motion) and value.given:
                yield value, value.given
    for load in packed.loads:
        for value in load.parameters:
            if isinstance(value, Signal) and value.is_function:
                yield value, (value.source,)
        if hasattr(load.force, "function_of_state") and (load.law is None or load.law.traced):
            yield load.force, (load.force.function_of_state,)


def called_functions(packed):
    """The functions that Python calls during a run: of sampled loads, and laws of the scene that aren't traced."""
    forces = [load.force for load in packed.loads if load.law is not None and not load.law.traced]
    sampled = [load.force for load in packed.loads if getattr(load.force, "period", None) is not None]
    return [getattr(force, force.given) for force in dict.fromkeys((*forces, *sampled))]


def instances_of_kinds(packed):
    """The primitives of each row of System.kinds, in its order."""
    groups = {kind: [] for kind in classes(packed)}
    for primitive in packed.constraints:
        groups[type(primitive)].append(primitive)
    return list(groups.values())


def first_rows(primitives):
    """Yield each primitive and the first of its rows; the terms of a sum have the same."""
    row = 0
    for primitive in primitives:
        yield primitive, row if primitive.all_rows else row - 1
        row += primitive.all_rows


def index_of(packed, body):
    """Where a body stood among the others when the scene was packed; None where it was not there."""
    known = packed.derived
    if known.body_indices is None:
        known.body_indices = {id(one): i for i, one in enumerate(packed.bodies)}
    return known.body_indices.get(id(body))
