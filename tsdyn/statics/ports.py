"""Inputs and outputs of the linearised system: generalised forces of unit inputs, rows of outputs."""

from typing import NamedTuple

import numpy as np

from ..elements.bodies import PointMass
from ..elements.force import Force
from ..elements.joint_coordinates import AngleGeometry
from ..elements.joint_load import JointLoad
from ..elements.names import named
from ..elements.primitive import Primitive
from ..errors import InvalidArgument
from ..forces.point_force import PointForce
from ..forces.spring import Spring
from ..forces.torque import Torque
from ..validation import vector3
from .tolerances import NO_EFFECT
from .variations import stacked

RATE = " rate"
AXES = ".x", ".y", ".z"


class Input(NamedTuple):
    """A load of unit size."""

    name: str
    columns: np.ndarray  # of q
    load: np.ndarray  # generalised force, N or N m
    whole: str = ""  # the load of which it is a component, where all of them were asked for


def inputs_of(scene, variations, given):
    """The `Input`s of handles and names: motors, forces and joints."""
    found = []
    for one in given:
        same = [Input(joint.name, joint.columns, joint.jet[0]) for joint in variations.joints if joint.name == one]
        if not same:
            item, axis = item_of(scene, one, [*scene.forces, *scene.constraints], "force or joint")
            loads = _loads_of(variations, item)
            same = [load for load in loads if axis is None or load.name.endswith(axis)]
            if not same:
                names = ", ".join(repr(load.name) for load in loads)
                raise InvalidArgument(f"{item.name!r} has no component {axis[1:]!r}: its input is {names}.")
            same = [load._replace(whole=item.name) for load in same] if len(same) > 1 else same
        found += same
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise InvalidArgument(f"the input {name} is given twice; give it once.")
    return found


def demand_effective(inputs, F):
    """Refuse inputs that constraints take up: columns of F (k, inputs) that are zero, but for some of a vector's."""
    works = np.abs(F).max(axis=0, initial=0.0) > [NO_EFFECT * np.abs(one.load).max(initial=0.0) for one in inputs]
    vectors = {one.whole for one, moves in zip(inputs, works, strict=True) if moves}
    for one, moves in zip(inputs, works, strict=True):
        if not moves and not (one.whole and one.whole in vectors):
            raise InvalidArgument(
                f"the input {one.whole or one.name} does no work on any motion that the constraints admit. Where a "
                "motor drives its coordinate, replace the motor by a JointTorque or JointForce."
            )


def item_of(scene, given, things, what):
    """The thing that a handle or a name means, and an axis ".x" at the end of the name, or None."""
    if not isinstance(given, str):
        if not any(given is thing for thing in things):
            raise InvalidArgument(f"{given!r} is no {what} of this scene: give a handle or a name.")
        return given, None
    axis = given[-2:] if given[-2:] in AXES and given not in {thing.name for thing in things} else None
    return named(things, given[:-2] if axis else given, what), axis


def _loads_of(variations, item):
    if isinstance(item, JointLoad):
        geometry = item.geometry
        make = variations.angle if isinstance(geometry, AngleGeometry) else variations.displacement
        columns, jet = make(geometry)
        return [Input(item.name, columns, jet[0])]
    if isinstance(item, Spring):
        columns, row = variations.elongation(item.a, item.coordinates[0], item.b, item.coordinates[1])
        return [Input(item.name, columns, -row)]
    if isinstance(item, (PointForce, Torque)):
        point = item.coordinates[0] if isinstance(item, PointForce) else None
        return [
            Input(item.name + axis, *variations.load(item.a, point, e, item.frame))
            for axis, e in zip(AXES, np.eye(3), strict=True)
        ]
    rows = [row for row in variations.handles.rows if row.item is item and not isinstance(item, Force)]
    found = [Input(one.name, one.columns, one.jet[0]) for row in rows for one in variations.of_row(row)]
    if not found:
        raise InvalidArgument(
            f"{item.name}: a {type(item).__name__} has no input. Inputs are JointTorque and JointForce, PointForce and "
            "Torque (three components), the actuator of a Spring, and joints with an angle or a displacement, for the "
            "torque or force along it. A motor that prescribes a motion has none: use a JointTorque or JointForce."
        )
    return found


class Outputs(NamedTuple):
    """Names, and y = Y dx + Yd dxd."""

    names: tuple
    Y: np.ndarray  # (p, k)
    Yd: np.ndarray


def outputs_of(scene, variations, given, coordinates, reduced):
    """The `Outputs` of handles and names; of none, the coordinates and their rates."""
    k, n = len(coordinates), variations.motion.q.size
    if not len(given):
        names = [one.name for one in coordinates]
        names += [name + RATE for name in names]
        return Outputs(tuple(names), np.eye(2 * k, k), np.eye(2 * k, k, -k))
    rows, rates = [], []
    for one in given:
        rate = isinstance(one, str) and one.endswith(RATE)
        found = _of(scene, variations, one[: -len(RATE)] if rate else one, coordinates)
        rows += found
        rates += [rate] * len(found)
    Z, Zd, _ = stacked(rows, n)
    rates = np.array(rates)[:, None]
    places, speeds = Z @ reduced.T, Z @ reduced.T1 + Zd @ reduced.T
    names = tuple(one.name + RATE * bool(rate) for one, rate in zip(rows, rates, strict=True))
    return Outputs(names, np.where(rates, speeds, places), np.where(rates, places, 0.0))


def _of(scene, variations, given, coordinates):
    """The `Variation`s that an output means."""
    if isinstance(given, str):
        same = [one for one in coordinates if one.name == given]
        every = same or [one for one in (*variations.joints, *variations.bodies) if one.name == given]
        if every:
            return every[:1]
    if isinstance(given, (tuple, list)) and len(given) == 2:
        body, _ = item_of(scene, given[0], scene.bodies, "body")
        point = vector3(given[1], f"{body.name}: point (m, body frame)", InvalidArgument)
        return variations.point(body, point, f"{body.name}{tuple(point.tolist())}")
    joints = [item for item in scene.constraints if not (isinstance(item, Primitive) and item.normalises)]
    item, axis = item_of(scene, given, [*scene.bodies, *joints], "body or joint")
    if isinstance(item, PointMass):
        found = variations.of_body(item)[:3]
    else:
        found = [one for row in variations.handles.rows if row.item is item for one in variations.of_row(row)]
    if not found:
        raise InvalidArgument(
            f"{item.name} has no coordinate: give a joint with an angle or a displacement, or a body."
        )
    return [one for one in found if axis is None or one.name.endswith(axis)]
