"""Springs, dampers and constant loads of joints.

A hinge has a TorsionalSpring; a slide a Bushing of equal stiffness in all directions, of which the joint leaves one; a
ball viscous friction in rotation.
"""

from dataclasses import replace

import numpy as np

from ..elements.bodies import rotation_matrix
from ..forces.bushing import Bushing
from ..forces.torsional_spring import TorsionalSpring
from ..forces.viscous_friction import ViscousFriction
from .names import fresh
from .tolerances import ORTHOGONAL

SUFFIX = " spring"  # of names


def unused(scene, name):
    """The name, or with a number behind it where the scene has it already."""
    return fresh(name, scene._titles or ())


def add_joint_forces(scene, joint, bodies, report):
    """Add what acts along a joint; what has no counterpart is listed."""
    if joint.slides:
        _slides(scene, joint, bodies[joint.a], bodies[joint.b], report)
    _add(scene, joint, bodies, report, SUFFIX)
    for servo in joint.servos:
        _add(scene, replace(joint, **servo._asdict()), bodies, report, "")


def _add(scene, joint, bodies, report, suffix):
    """Add spring, damper and constant load, named after the joint."""
    a, b, name = bodies[joint.a], bodies[joint.b], unused(scene, joint.name + suffix)
    if not (joint.stiffness or joint.damping or joint.load):
        return
    if min(joint.stiffness, joint.damping) < 0.0:
        report.leave("negative stiffness or damping", joint.name, f"{joint.stiffness:g}, {joint.damping:g}")
        return
    if joint.kind in ("revolute", "planar"):
        _hinge(scene, joint, a, b, name)
    elif joint.kind == "prismatic":
        _slide(scene, joint, a, b, name, report)
    elif joint.kind in ("spherical", "free"):
        if joint.stiffness:
            report.leave(f"stiffness of a {joint.kind} joint", joint.name, f"{joint.stiffness:g}")
        if joint.damping:
            places = {} if joint.point is None else {"point_a": joint.point}
            linear = {"damping": joint.damping} if joint.kind == "free" else {}
            scene.add(ViscousFriction.at(b, a, torsional_damping=joint.damping, **linear, **places, name=name))
    else:
        report.leave(f"stiffness and damping of a {joint.kind} joint", joint.name)


def _hinge(scene, joint, a, b, name):
    scene.add(
        TorsionalSpring.at(
            a, b, axis=joint.axis, stiffness=joint.stiffness, damping=joint.damping, free_angle=joint.free,
            actuator=joint.load, name=name,
        )
    )  # fmt: skip


def _slide(scene, joint, a, b, name, report):
    """A constant load is a shift of the spring; without stiffness it is listed."""
    free = joint.free
    if joint.load and joint.stiffness:
        free += joint.load / joint.stiffness
    elif joint.load:
        report.leave("constant force along a joint", joint.name, f"{joint.load:g} N")
    if not (joint.stiffness or joint.damping):
        return
    point_a = joint.point + free * joint.axis
    scene.add(
        Bushing.at(
            a, b, point_a=point_a, point_b=joint.point, stiffness=joint.stiffness, damping=joint.damping,
            name=name,
        )
    )  # fmt: skip


def _slides(scene, joint, a, b, report):
    """Springs of several slides along axes of body a; others are listed."""
    stiffness, damping, shift = np.zeros(3), np.zeros(3), np.zeros(3)
    A = rotation_matrix(np.asarray(a.orientation))
    for slide in joint.slides:
        if not (slide.stiffness or slide.damping or slide.load):
            continue
        along = np.abs(A.T @ slide.axis)
        i = int(along.argmax())
        if abs(along[i] - 1.0) > ORTHOGONAL or slide.load or min(slide.stiffness, slide.damping) < 0.0:
            report.leave("spring or load of a slide in a plane", slide.name)
            continue
        stiffness[i], damping[i] = slide.stiffness, slide.damping
        shift += slide.free * slide.axis
    if stiffness.any() or damping.any():
        scene.add(
            Bushing.at(
                a, b, point_a=joint.point + shift, point_b=joint.point, stiffness=stiffness, damping=damping,
                name=unused(scene, f"{joint.name} springs"),
            )
        )  # fmt: skip
