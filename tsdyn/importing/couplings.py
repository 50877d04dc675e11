"""Joints that mimic others: gear pairs, where the wheels are hinged to a common carrier on parallel axes."""

import numpy as np

from ..constraints.gear import Gear
from ..errors import InvalidConstraint
from .tolerances import PARALLEL

WHAT = "joint that mimics another one"


def couple(scene, description, bodies, report):
    """Add what can be a gear pair; list the rest."""
    joints = {joint.name: joint for joint in description.joints if not joint.loop}
    for coupling in description.couplings:
        one, other = joints.get(coupling.driver), joints.get(coupling.follower)
        reason = _reason(one, other, coupling)
        if not reason:
            parallel = float(np.sign(one.axis @ other.axis))
            try:
                gear = Gear.at(
                    bodies[one.b], bodies[other.b], point_a=one.point, point_b=other.point, axis_a=one.axis,
                    ratio=coupling.ratio * parallel, name=coupling.name,
                )  # fmt: skip
                gear.offset += coupling.offset * parallel
                scene.add(gear)
            except InvalidConstraint as error:
                reason = str(error)
        if reason:
            report.leave(WHAT, coupling.name, f"(ratio {coupling.ratio:g}, offset {coupling.offset:g}: {reason})")


def _reason(one, other, coupling):
    """Why two joints can't be a gear pair; empty if they can."""
    if one is None or other is None:
        return "one of them is held"
    if one.kind != "revolute" or other.kind != "revolute":
        return "a gear pair needs two hinges"
    if one.a != other.a:
        return "a gear pair needs hinges on one body"
    if np.linalg.norm(np.cross(one.axis, other.axis)) > PARALLEL:
        return "a gear pair needs parallel axes"
    if not coupling.ratio:
        return "a gear pair needs a ratio"
    return ""
