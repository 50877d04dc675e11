"""Actuators: what their loads are called, their units, and their generalised forces along a motion.

They are the inputs of `scene.linearise`: JointTorque and JointForce, joints, PointForce, Torque, springs.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np

from ..elements.force import Force
from ..elements.joint_coordinates import AngleGeometry
from ..elements.joint_load import JointLoad
from ..errors import InvalidArgument
from ..forces.point_force import PointForce
from ..forces.spring import Spring
from ..forces.torque import Torque
from ..motions.signals import Signal
from ..statics.ports import AXES, item_of
from ..statics.variations import named_coordinates
from ..validation import sequence
from .unit_loads import UnitLoads

NEWTON, NEWTON_METRE = "N", "N m"


class Actuator(NamedTuple):
    """One unknown load, along a motion of k instants."""

    name: str
    unit: str
    item: object
    columns: np.ndarray  # (c,) of q
    loads: np.ndarray  # (k, c)  generalised forces of a unit of it

    def rate(self, qd):
        """What its power is the product with (k,): a velocity or an angular velocity."""
        return np.einsum("kc,kc->k", self.loads, qd[:, self.columns])


def actuators_of(scene, handles, given, q):
    """The `Actuator`s of handles and names along q (k, n); what has no load to give is refused."""
    given = sequence(given, "actuators must be a sequence of handles or names, such as [motor]", InvalidArgument)
    units, coordinates, found = UnitLoads(handles, q), named_coordinates(handles), []
    constraints = [row.item for row in handles.rows if not isinstance(row.item, Force)]
    by_name = {name: (item, geometry) for item in constraints for name, geometry in coordinates[id(item)]}
    for one in given:
        if isinstance(one, str) and one in by_name:
            item, geometry = by_name[one]
            found.append(_of_coordinate(units, one, item, geometry))
            continue
        item, axis = item_of(scene, one, [*scene.forces, *scene.constraints], "force or joint")
        found += [each for each in _of_item(units, coordinates, item) if axis is None or each.name.endswith(axis)]
    for name, count in Counter(each.name for each in found).items():
        if count > 1:
            raise InvalidArgument(f"actuators: {name} is given more than once, or several have this name.")
    if not found:
        raise InvalidArgument("actuators: give one at least: a force, or a joint with an angle or a displacement.")
    return found


def _of_coordinate(units, name, item, geometry):
    turns = isinstance(geometry, AngleGeometry)
    load = (units.angle if turns else units.displacement)(geometry)
    return Actuator(name, NEWTON_METRE if turns else NEWTON, item, *load)


def _of_item(units, coordinates, item):
    if isinstance(item, JointLoad):
        return [_of_coordinate(units, item.name, item, item.geometry)]
    if isinstance(item, Spring):
        return [Actuator(item.name, NEWTON, item, *units.tension(item))]
    if isinstance(item, (PointForce, Torque)):
        unit = NEWTON if isinstance(item, PointForce) else NEWTON_METRE
        axes = zip(AXES, np.eye(3), strict=True)
        return [Actuator(item.name + axis, unit, item, *units.component(item, e)) for axis, e in axes]
    found = [] if isinstance(item, Force) else coordinates.get(id(item), [])
    if not found:
        raise InvalidArgument(
            f"{item.name}: a {type(item).__name__} is no actuator. Actuators are JointTorque and JointForce, "
            "PointForce and Torque (three components), the actuator of a Spring, and joints with an angle or a "
            "displacement, for the torque or force along it."
        )
    return [_of_coordinate(units, name, item, geometry) for name, geometry in found]


def tension_given(load, t):
    """The tension of the actuator that a spring has by itself, (k,)."""
    given = load.parameters[3]
    return given.over(t)[0] if isinstance(given, Signal) else np.full(t.size, float(given))
