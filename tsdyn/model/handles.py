"""Handles of a packed scene: bodies, constraints, forces, their coordinates, and the angles that runs count."""

import threading
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..elements.bodies import PointMass
from ..elements.element import Attachment
from ..elements.force import Force
from ..elements.joint_coordinates import angles, displacements
from ..elements.names import named
from ..elements.tolerances import SAME_COORDINATE
from ..errors import InvalidBody, InvalidConstraint
from .joint_motion import BodyMotion, displacement

_lock = threading.Lock()  # of aliases, which scenes of a family share


class Row(NamedTuple):
    """The joint coordinates of one constraint or force."""

    item: object
    angles: tuple  # AngleGeometry each
    displacements: tuple  # DisplacementGeometry each
    first: int  # of its angles among all


class Driven(NamedTuple):
    """A coordinate of a joint that a motor prescribes."""

    motor: Row
    joint: Row
    geometry: object  # of the joint
    place: int  # of an angle among all; -1 for a displacement


class Handles:
    """What positions of bodies and coordinates of joints are looked up by.

    Attributes
    ----------
    bodies, items : tuple
        Items are the constraints and forces that have been added, joints whole.
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

    def __init__(self, packed):
        places = packed.system.bodies.tolist()
        self.bodies = packed.bodies
        constraints = [member.constraint for member in packed.members]
        constraints = [each for each in constraints if not getattr(each, "normalises", False)]
        self.items = (*constraints, *(load.force for load in packed.loads))
        self._where = {body: tuple(place) for body, place in zip(self.bodies, places, strict=True)}
        self._by_item, self._aliases = None, WeakKeyDictionary()
        rows, joints, frames = [], [], []
        for item in self.items:
            if item.joint_coordinates:
                rows.append(Row(item, tuple(angles(item)), tuple(displacements(item)), len(joints)))
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

    def where(self, body):
        """Where the coordinates of a body begin, and how many they are; (0, 0) for the ground."""
        return self._where.get(body, (0, 0))

    def body(self, body):
        """A body of the scene, by handle or name."""
        if isinstance(body, str):
            return named(self.bodies, body, "body", InvalidBody)
        body = self.own(body)
        if not isinstance(body, PointMass) or body not in self._where:
            raise InvalidBody(f"{body!r} is not a body of this solution's scene{self._elsewhere(body)}.")
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
            return named(self.items, item, "constraint or force", InvalidConstraint)
        return self.own(item)

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
        """The `Row` of a joint that has some of a kind of coordinates: "angle" or "displacement"."""
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
        if same and np.allclose(geometry[2:], own[2:], rtol=SAME_COORDINATE, atol=SAME_COORDINATE):
            yield Driven(motor, joint, geometry, joint.first + i if kind == "angles" else -1)


def counts(item):
    """Whether an item says itself where counting begins: its displacement counts turns, or its motor does."""
    return type(item).counted_from is not Attachment.counted_from


def _begins(item):
    """Return True if the angles of an item may begin elsewhere than near zero."""
    return counts(item) or np.any(item.angle_near)


def handles_of(packed):
    """The `Handles` of a packed scene, made once."""
    if packed.derived.handles is None:
        packed.derived.handles = Handles(packed)
    return packed.derived.handles
