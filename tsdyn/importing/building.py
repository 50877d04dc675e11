"""A scene of a description: bodies at their centroids in the axes of their links, joints, springs and couplings."""

import numpy as np
from scipy.spatial.transform import Rotation

from ..constraints.cylindrical import Cylindrical
from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..constraints.fixed import Fixed
from ..constraints.parallel import Parallel
from ..constraints.planar import Planar
from ..constraints.revolute import Revolute
from ..constraints.screw import Screw
from ..constraints.spherical import Spherical
from ..constraints.translational import Translational
from ..constraints.universal import Universal
from ..elements.joint import across
from ..forces.spring import Spring
from .couplings import couple
from .description import GROUND
from .joint_forces import add_joint_forces, unused
from .report import FrameOn
from .tolerances import TRIANGLE

ONE_AXIS = {"revolute": Revolute, "prismatic": Translational, "planar": Planar, "cylindrical": Cylindrical}


def build(description, make, report):
    """The scene; `make` makes an empty one."""
    scene = make(gravity=description.gravity)
    bodies = {GROUND: scene.ground}
    for name, link in description.links.items():
        bodies[name] = _add_body(scene, link, report)
    for joint in description.joints:
        if joint.kind != "free":
            _add_joint(scene, joint, bodies)
        add_joint_forces(scene, joint, bodies, report)
    for spring in description.springs:
        scene.add(
            Spring.at(
                bodies[spring.a], bodies[spring.b], point_a=spring.point_a, point_b=spring.point_b,
                stiffness=spring.stiffness, damping=spring.damping, free_length=spring.free_length,
                name=unused(scene, spring.name),
            )
        )  # fmt: skip
    couple(scene, description, bodies, report)
    if any(joint.start for joint in description.joints):
        _start(description, bodies)
    for name, (owner, at) in description.frames.items():
        body = bodies[owner]
        centroid = np.zeros(3) if owner == GROUND else description.links[owner].centroid
        report.frames[name] = FrameOn(body.name, at.p - centroid, at.R)
    scene.imported = report
    vars(scene)["_drawn"] = {
        bodies[name].name: (shapes, np.zeros(3) if name == GROUND else description.links[name].centroid)
        for name, shapes in [
            (GROUND, description.ground_shapes),
            *((n, li.shapes) for n, li in description.links.items()),
        ]
        if shapes
    }
    return scene


def _add_body(scene, link, report):
    """A body; its inertia may be one that no solid has, which is noted."""
    values, named = np.linalg.eigvalsh(link.inertia), link.name if link.name != "ground" else "ground link"
    placed = {
        "position": link.frame.point(link.centroid),
        "orientation": Rotation.from_matrix(link.frame.R),
        "name": named,
    }
    if values[2] <= (values[0] + values[1]) * (1.0 + TRIANGLE):
        return scene.add_body(link.mass, link.inertia, **placed)
    report.note(
        f"{named}: no solid has the principal moments of inertia {', '.join(f'{x:.4g}' for x in values)} kg m^2, as "
        "the largest exceeds the sum of the others; they are carried over as they are"
    )
    body = scene.add_body(link.mass, np.full(3, values[2]), **placed)
    inertia = (link.inertia + link.inertia.T) / 2.0
    inertia.setflags(write=False)
    body.values["inertia"] = inertia
    scene.touch()
    return body


def _start(description, bodies):
    """Move bodies to where they start; joints count their coordinates from where they were added."""
    for name, link in description.links.items():
        bodies[name].position = link.start.point(link.centroid)
        bodies[name].orientation = Rotation.from_matrix(link.start.R)


def _add_joint(scene, joint, bodies):
    """Add the constraints of a joint; a force or another constraint may have its name."""
    a, b = bodies[joint.a], bodies[joint.b]
    name = joint.name = unused(scene, joint.name)
    if joint.kind in ONE_AXIS:
        made = scene.add(ONE_AXIS[joint.kind].at(a, b, point=joint.point, axis=joint.axis, name=name))
        if joint.start and joint.kind == "revolute":
            made.__dict__["angle_near"] = (joint.start,)  # near which turns are counted
    elif joint.kind == "screw":
        scene.add(Screw.at(a, b, point=joint.point, axis=joint.axis, lead=joint.lead, name=name))
    elif joint.kind == "universal":
        scene.add(Universal.at(a, b, point=joint.point, axis=joint.axis, axis_b=joint.axis_b, name=name))
    elif joint.kind == "spherical" and joint.frame_b is not None:
        scene.add(Spherical.at(a, b, point_a=joint.frame_a.p, point_b=joint.frame_b.p, name=name))
    elif joint.kind == "spherical":
        scene.add(Spherical.at(a, b, point=joint.point, name=name))
    elif joint.kind == "translations":
        _add_translations(scene, joint, a, b)
    else:
        one, other = joint.frame_a, joint.frame_b
        scene.add(
            Fixed.at(
                a, b, point_a=one.p, point_b=other.p, axis_a=one.R[:, 2], axis_b=other.R[:, 2],
                reference_a=one.R[:, 0], reference_b=other.R[:, 0], name=name,
            )
        )  # fmt: skip


def _add_translations(scene, joint, a, b):
    """No rotation; and no displacement across two slides."""
    n = joint.normal()
    f, g = across(n)
    scene.add(Parallel.at(a, b, axis=n, name=f"{joint.name}: axis"))
    scene.add(Dot1.at(a, b, axis_a=f, axis_b=g, name=f"{joint.name}: turn"))
    if len(joint.slides) == 2:
        scene.add(Dot2.at(a, b, axis_a=n, point=joint.point, name=f"{joint.name}: plane"))
