"""Drivers of a given motion: a copy of the scene in which some coordinates follow functions of time.

Coordinates are joints, names such as "pin.angle", "slide.displacement" and "ball.x", bodies and points of bodies.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..constraints.angle_driver import AngleDriver
from ..constraints.dot2 import Dot2
from ..constraints.point_driver import PointDriver
from ..elements.bodies import PointMass
from ..elements.element import AngleGeometry
from ..elements.force import Force
from ..errors import InvalidArgument
from ..maths.tolerances import NEGLIGIBLE
from ..model import handles as joint_motion
from ..model.handles import handles_of
from ..motions.elementary import Polynomial, Smooth
from ..motions.prescribed import Motion
from ..validation import nearest, vector3
from .coordinates import named_coordinates
from .linearise import AXES, item_of

WHO = "inverse_dynamics"
MOST_NAMED = 10  # coordinates and bodies in a message


class Driven(NamedTuple):
    """One coordinate, or the three of a point, and its motions."""

    name: str
    geometry: object  # AngleGeometry or DisplacementGeometry; or the body
    point: np.ndarray  # body frame; None for an axis of the ground, or a joint
    axis: np.ndarray  # of the ground; None for a point, or a joint
    motions: tuple  # Motion each

    def present(self, handles, q, near):
        """Its values (1,) or (3,) at q, an angle on the turn nearest to `near`."""
        if isinstance(self.geometry, PointMass):
            at, dimension = handles.where(self.geometry)
            body = joint_motion.BodyMotion(at, dimension, (q,))
            place = np.array(body.point((0.0, 0.0, 0.0) if self.point is None else self.point.tolist(), 0))
            return place if self.axis is None else np.array([self.axis @ place])
        bodies = handles.motions(self.geometry, (q,))
        if isinstance(self.geometry, AngleGeometry):
            return np.array([joint_motion.counted(joint_motion.angle(self.geometry, *bodies, 0), near)])
        return np.array([joint_motion.displacement(self.geometry, *bodies, 0)])

    def constraint(self, scene, motions):
        """What prescribes it."""
        g, name = self.geometry, f"motion of {self.name}"
        if isinstance(g, AngleGeometry):
            (motion,) = motions
            return AngleDriver(g.own, g.other, reference_a=g.f, across_a=g.g, reference_b=g.h, angle=motion, name=name)
        if not isinstance(g, PointMass):
            points = {"point_a": g.s_own, "point_b": g.s_other}
            return Dot2(g.own, g.other, axis_a=g.e, **points, value=motions[0], name=name)
        if self.axis is None:
            return PointDriver(scene.ground, g, point_b=self.point, path=motions, name=name)
        return Dot2(scene.ground, g, axis_a=self.axis, value=motions[0], name=name)


def driven_copy(scene, motion):
    """A copy of the scene, and what is `Driven` in it by a dict of coordinates and motions."""
    if not isinstance(motion, Mapping):
        raise InvalidArgument(
            f"{WHO}: motion must be a dict of joints or coordinates and their motions, such as "
            f"{{hinge: ts.motions.Sine(0.5, 2.0)}}, or have t, q, qd and qdd, as a Solution or a State has, "
            f"got {motion!r}."
        )
    if not motion:
        raise InvalidArgument(f"{WHO}: motion is empty: give the motion of one coordinate at least.")
    twin = scene.copy()
    handles = handles_of(twin.packed)
    named = named_coordinates(handles)
    joints = [named[id(row.item)] for row in handles.rows if not isinstance(row.item, Force)]
    by_name = {name: geometry for own in joints for name, geometry in own}
    driven = [_driven(scene, twin, by_name, named, key, value) for key, value in motion.items()]
    names = [one.name for one in driven]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidArgument(f"{WHO}: the motion of {twice} is given twice; give it once.")
    return twin, driven


def _driven(scene, twin, by_name, named, key, value):
    """What one entry of the dict drives, in the copy."""
    if isinstance(key, str) and key in by_name:
        return Driven(key, by_name[key], None, None, (_motion(value, key),))
    if isinstance(key, tuple) and len(key) == 2:
        key, point = key[0], key[1]
        item, _ = item_of(scene, key, scene.bodies, "body")
        point = vector3(point, f"{WHO}: point of {item.name} (m, body frame)", InvalidArgument)
        return Driven(f"{item.name}{tuple(point.tolist())}", twin[item], point, None, _path(value, item.name))
    things = [*scene.bodies, *scene.constraints]
    if isinstance(key, str) and key.removesuffix(key[-2:] if key[-2:] in AXES else "") not in {x.name for x in things}:
        known = [*by_name, *(body.name for body in scene.bodies)]
        said = f"there are {', '.join(map(repr, known[:MOST_NAMED]))}{', ...' * (len(known) > MOST_NAMED)}"
        raise InvalidArgument(f"{WHO}: no coordinate, joint or body is named {key!r}; {said}{nearest(key, known)}")
    item, axis = item_of(scene, key, things, "joint, body or coordinate")
    if isinstance(item, PointMass):
        if axis is None:
            return Driven(item.name, twin[item], np.zeros(3), None, _path(value, item.name))
        e = np.eye(3)[AXES.index(axis)]
        return Driven(item.name + axis, twin[item], None, e, (_motion(value, item.name + axis),))
    found = named.get(id(twin[item]), [])
    if len(found) != 1:
        names = ", ".join(name for name, _ in found)
        raise InvalidArgument(
            f"{WHO}: {item.name} has several coordinates: {names}; give one by its name."
            if found
            else f"{WHO}: {item.name} has no coordinate to be moved: give a joint with an angle or a displacement."
        )
    ((name, geometry),) = found
    return Driven(name, geometry, None, None, (_motion(value, name),))


def _motion(value, name):
    return Motion.always(value, f"motion of {name}")


def _path(value, name):
    """Three motions of a point."""
    what = f"motion of {name} (x, y, z)"
    if isinstance(value, (tuple, list)) and len(value) == 3:
        return tuple(Motion.always(each, what) for each in value)
    if isinstance(value, Smooth):
        raise InvalidArgument(
            f"{WHO}: the {what} must be three motions, such as (ts.motions.Sine(0.1, 2.0), 0.0, 0.0), a ts.Table or a "
            f"function of time with three values, got one, {value!r}. For one component give {name + '.x'!r}."
        )
    return tuple(Motion.always(each, what) for each in Motion.components(value, 3, what))


def drive(twin, driven):
    """Add the drivers to the copy."""
    for one in driven:
        twin.add(one.constraint(twin, one.motions))


def way_to_start(twin, driven, t):
    """The drivers of a motion over the time (0, 1) s from the present pose to the start; None where it is there."""
    handles, q = handles_of(twin.packed), twin.start[0]
    near = handles.angles_at_start(t, q)
    angles = {geometry: near[row.first + i] for row in handles.rows for i, geometry in enumerate(row.angles)}
    size, away, ways = twin.packed.size or 1.0, 0.0, []
    for one in driven:
        here = one.present(handles, q, angles.get(one.geometry, 0.0))
        there = np.array([motion.value(t)[0] for motion in one.motions])
        away = max(away, np.abs(there - here).max() / (1.0 if isinstance(one.geometry, AngleGeometry) else size))
        ways.append(tuple(Polynomial((a, b - a)) for a, b in zip(here.tolist(), there.tolist(), strict=True)))
    if away <= NEGLIGIBLE:
        return None
    return [one.constraint(twin, way) for one, way in zip(driven, ways, strict=True)]
