"""A scene of a file of another program; the root element of an .xml determines its kind."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..configuration.motor_starts import are_aligned
from ..configuration.tolerances import INITIAL_TOL
from ..constraints.coupler import Coupler
from ..constraints.cylindrical import Cylindrical
from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..constraints.fixed import Fixed
from ..constraints.parallel import Parallel
from ..constraints.planar import Planar
from ..constraints.revolute import Revolute
from ..constraints.rope import Rope
from ..constraints.rotation_motor import RotationMotor
from ..constraints.screw import Screw
from ..constraints.spherical import Spherical
from ..constraints.stop import Stop
from ..constraints.translation_motor import TranslationMotor
from ..constraints.translational import Translational
from ..constraints.universal import Universal
from ..elements.bodies import rotation_matrix
from ..elements.element import in_frame
from ..elements.joint import across
from ..elements.markers import Point
from ..errors import InvalidArgument, InvalidConstraint, InvalidForce, TsdynError
from ..forces.armature import Armature
from ..forces.bushing import Bushing
from ..forces.cable import Cable
from ..forces.spring import Spring
from ..forces.torsional_spring import TorsionalSpring
from ..forces.viscous_friction import ViscousFriction
from ..maths.tolerances import TYPED
from ..observables.diagnostics import constraint_error
from . import mjcf, sdf, urdf
from .description import GROUND, FrameOn, ImportReport, fresh
from .reduction import add_given, complete, gather, merge
from .tolerances import HUGE, NO_MASS
from .xml_file import OutsideFiles, read

if TYPE_CHECKING:
    from ..hints import Callable, Place, Scene

FORMATS = {"robot": "URDF", "mujoco": "MJCF", "sdf": "SDF", "gazebo": "SDF"}


def load(
    path: Place, make: Callable[..., Scene], free_base: bool, outside: bool, given: Any = (), limits: bool = False
) -> Scene:
    """The scene of a URDF, MJCF or SDF file; arguments and errors as of `ts.load`.

    Parameters
    ----------
    path : str or PathLike
    make : callable
        Of an empty scene: `Scene`.
    free_base : bool
        Whether the root link of a URDF is free.
    outside : bool
        Whether files outside the folder of this one may be read.
    given : sequence of (frame_a, frame_b, kind)
        Loops to be closed.
    limits : bool
        Whether limits of joints become stops, and those of tendons ropes.
    """
    root, mistakes = read(path)
    kind, path = FORMATS.get(root.tag), Path(path)
    files = OutsideFiles(path.parent, outside)
    if kind is None:
        known = "<robot> of URDF, <mujoco> of MJCF, <sdf> of SDF"
        root.wrong(f"the root element <{root.tag}> is of no known format; there are {known}.")
        mistakes.demand_none()
    if free_base and kind != "URDF":
        raise InvalidArgument(f"free_base is for URDF, where the file doesn't say it; {path} is {kind}.")
    report = ImportReport(str(path), kind)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            if kind == "URDF":
                description = urdf.describe(root, files, report, free_base)
            elif kind == "SDF":
                description = sdf.describe(root, files, report)
            else:
                description = mjcf.describe(root, path, report, files)
    except RecursionError:
        root.wrong("elements or files are nested too deeply.")
        mistakes.demand_none()
    for link in description.links.values():
        numbers = (link.mass, *link.centroid, *link.inertia.flat, *link.frame.p, *link.start.p)
        if not np.abs(numbers).max() < HUGE:
            mistakes.add((link.line or 1, 1), f"link {link.name!r}: mass, inertia or place is beyond {HUGE:g}.")
    for joint in description.joints:
        if not np.abs((joint.start, *(() if joint.point is None else joint.point))).max() < HUGE:
            mistakes.add((1, 1), f"joint {joint.name!r}: its place or its offset is beyond {HUGE:g}.")
    mistakes.demand_none()
    add_given(description, given)
    return _scene(description, make, report, mistakes, limits)


def _scene(description: Any, make: Any, report: ImportReport, mistakes: Any, limits: bool) -> Scene:
    """Merge, complete and build; a body or joint that can't be built is a mistake of the file."""
    merge(description, report)
    gather(description, report)
    complete(description, report)
    if not description.links or not any(link.mass > NO_MASS for link in description.links.values()):
        mistakes.add((1, 1), "no link moves: all are fixed to the ground, or have no mass.")
    mistakes.demand_none()
    try:
        scene = build(description, make, report, limits)
    except TsdynError as error:
        mistakes.add((1, 1), str(error))
        mistakes.demand_none()
    gap = _close(scene, report) if any(joint.loop for joint in description.joints) else 0.0
    if limits:
        joints = {joint.name: joint for joint in scene.constraints if joint.joint_coordinates}
        for (name, axis), (lower, upper) in report.stops.items():
            part, index = _axis_of(joints, name, axis)
            if part in joints:
                joint = (joints[part], "angle", index) if index else joints[part]
                try:
                    scene.add(Stop(joint, lower, upper, name=f"limits of {name}" + f" {axis + 1}" * bool(axis)))
                except TsdynError as error:
                    mistakes.add((1, 1), str(error))
                report.carry("limits of a joint", name)
        mistakes.demand_none()
    report.warn(gap)
    return scene


def _close(scene: Scene, report: ImportReport) -> float:
    """Assemble a scene whose loops are open, or mirrored, at the start; by how much they stay open."""
    q, qd = scene.start
    rest = np.zeros((1, q.size))
    gap = float(constraint_error(scene.packed, np.zeros(1), q[None], qd[None], rest).position[0])
    if gap <= INITIAL_TOL and are_aligned(scene.packed, q, 0.0):
        return 0.0
    try:
        scene.assemble()
        report.note(f"loops that were open by up to {gap:.2g} are closed by assembly")
        return 0.0
    except TsdynError as error:
        report.note(f"loops are open by up to {gap:.2g}, and can't be closed: {error}")
        return gap


# A scene of a description: bodies at their centroids in the axes of their links, joints, springs and couplings.

# Joints whose coordinates depend on those of others.

WHAT = "joint that mimics another one"
COORDINATES = {"revolute": "angle", "prismatic": "displacement", "screw": "angle", "universal": "angle"}
MOTORS = {"angle": RotationMotor, "displacement": TranslationMotor}


def couple(scene, description, made, report):
    """Add the couplers; list those of joints without a coordinate. `made` has the constraint of each joint."""
    for coupling in description.couplings:
        names = [_axis_of(made, *each) for each in (coupling.follower, *coupling.drivers)]
        reason = next(filter(None, (_reason(made.get(name)) for name, _ in names)), "")
        if not reason:
            joints = [(made[name][0], COORDINATES[made[name][1]], index) for name, index in names]
            given = {"polynomial": coupling.polynomial} if coupling.polynomial else {}
            given = given or {"ratio": _plain(coupling.ratios), "offset": coupling.offset}
            name = unused(scene, coupling.name)
            try:
                if coupling.drivers:
                    scene.add(Coupler(*joints, **given, name=name))
                else:
                    joint, coordinate, _ = joints[0]
                    scene.add(MOTORS[coordinate].of(joint, **{coordinate: coupling.offset}, name=name))
            except InvalidConstraint as error:
                reason = str(error)
        if reason:
            law = f"polynomial {coupling.polynomial}" if coupling.polynomial else f"ratio {_plain(coupling.ratios)}"
            report.leave(WHAT, coupling.name, f"({law}, offset {coupling.offset:g}: {reason})")


def _axis_of(made, name, index):
    """The joint and index of a coordinate: a universal joint whose axes are oblique is two hinges."""
    return (f"{name} 2", 0) if index and f"{name} 2" in made else (name, index)


def _plain(ratios):
    return ratios[0] if len(ratios) == 1 else ratios


def _reason(found):
    """Why a joint can't be coupled; empty if it can."""
    if found is None or found[1] == "fixed":
        return "one of them is held" if found else "one of them isn't there, or is held"
    return "" if found[1] in COORDINATES else f"a {found[1]} joint has no single coordinate"


# Springs, dampers and constant loads of joints.
#
# A hinge has a TorsionalSpring; a slide a Bushing of equal stiffness in all directions, of which the joint leaves one;
# a ball viscous friction in rotation.

SUFFIX = " spring"  # of names


def unused(scene, name):
    """The name, or with a number behind it where the scene has it already."""
    return fresh(name, scene._titles or ())


def add_joint_forces(scene, joint, bodies, report, added):
    """Add what acts along a joint, its constraint being `added`; what has no counterpart is listed."""
    if joint.slides:
        _slides(scene, joint, bodies[joint.a], bodies[joint.b], report)
    _add(scene, joint, bodies, report, SUFFIX)
    for servo in joint.servos:
        _add(scene, replace(joint, **servo._asdict()), bodies, report, "")
    if joint.armature < 0.0:
        report.leave("negative armature", joint.name, f"{joint.armature:g}")
    elif joint.armature and joint.kind in ONE_AXIS:
        name = unused(scene, joint.name + " armature")
        scene.add(Armature(added, inertia=joint.armature, name=name))


def _add(scene, joint, bodies, report, suffix):
    """Add spring, damper and constant load, named after the joint."""
    a, b, name = bodies[joint.a], bodies[joint.b], unused(scene, joint.name + suffix)
    if not (joint.stiffness or joint.damping or joint.load):
        return
    if min(joint.stiffness, joint.damping) < 0.0:
        report.leave("negative stiffness or damping", joint.name, f"{joint.stiffness:g}, {joint.damping:g}")
        return
    if joint.kind in ("revolute", "planar"):
        scene.add(
            TorsionalSpring.at(
                a, b, axis=joint.axis, stiffness=joint.stiffness, damping=joint.damping, free_angle=joint.free,
                actuator=joint.load, name=name,
            )
        )  # fmt: skip
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
        if abs(along[i] - 1.0) > TYPED or slide.load or min(slide.stiffness, slide.damping) < 0.0:
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


ONE_AXIS = {"revolute": Revolute, "prismatic": Translational, "planar": Planar, "cylindrical": Cylindrical}


def build(description, make, report, limits=False):
    """The scene; `make` makes an empty one, `limits` asks for those of tendons."""
    scene = make(gravity=description.gravity)
    bodies = {GROUND: scene.ground}
    for name, link in description.links.items():
        bodies[name] = _add_body(scene, link, report)
    made = {}
    for joint in description.joints:
        added = None
        if joint.kind != "free":
            _add_joint(scene, joint, bodies)
            added = scene._added[-1]
            if not (joint.loop and joint.frame_a is not None):
                made[joint.name] = added, joint.kind
        add_joint_forces(scene, joint, bodies, report, added)
    for tendon in description.tendons:
        if limits or tendon.kind != "limit":
            _add_tendon(scene, tendon, bodies, report)
    couple(scene, description, made, report)
    if any(joint.start for joint in description.joints):
        _start(description, bodies)
    for name, (owner, at) in description.frames.items():
        body = bodies[owner]
        centroid = np.zeros(3) if owner == GROUND else description.links[owner].centroid
        report.frames[name] = FrameOn(body.name, at.p - centroid, at.R)
    scene.imported = report
    scene.ground._shape = partial(_drawn, description.ground_shapes, np.zeros(3)) if description.ground_shapes else None
    for name, link in description.links.items():
        if link.shapes or link.helps:
            bodies[name]._shape = partial(_drawn, link.shapes, link.centroid)
    return scene


def _drawn(shapes, centroid):
    """The shapes of a link in the frame of its body."""
    return tuple(shape.make().moved(-centroid) for shape in shapes)


def _add_body(scene, link, report):
    """A body; its inertia may be one that no solid has, which is noted."""
    values, named = np.linalg.eigvalsh(link.inertia), link.name if link.name != "ground" else "ground link"
    placed = {
        "position": link.frame.point(link.centroid),
        "orientation": Rotation.from_matrix(link.frame.R),
        "name": named,
    }
    if values[2] <= (values[0] + values[1]) * (1.0 + TYPED):
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


def _add_tendon(scene, tendon, bodies, report):
    """Add a spring, a cable, or a rope; the limit of a length is a rope that goes slack."""
    given, name = {"stiffness": tendon.stiffness, "damping": tendon.damping}, unused(scene, tendon.name)
    (a, x), *_, (b, y) = [(bodies[link], point) for link, point in tendon.points]
    points = [(bodies[link], in_frame(bodies[link], Point("a"), point)) for link, point in tendon.points]
    try:
        if tendon.kind == "rope":
            scene.add(Rope(points, tendon.length, always_taut=True, name=name))
        elif tendon.kind == "limit":
            scene.add(Rope(points, tendon.length, name=unused(scene, f"limits of {tendon.name}")))
            report.carry("limits of a tendon", tendon.name)
        elif tendon.kind == "cable":
            scene.add(Cable(points, **given, free_length=tendon.length, name=name))
        else:
            scene.add(Spring.at(a, b, point_a=x, point_b=y, **given, free_length=tendon.length, name=name))
    except (InvalidForce, InvalidConstraint) as error:
        report.leave("tendon", tendon.name, f"({error})")


def _add_joint(scene, joint, bodies):
    """Add the constraints of a joint; a force or another constraint may have its name."""
    a, b = bodies[joint.a], bodies[joint.b]
    name = joint.name = unused(scene, joint.name)
    if joint.kind == "revolute" and joint.frame_b is not None:
        one, other = joint.frame_a, joint.frame_b
        axes = {"axis_a": one.R[:, 2], "axis_b": other.R[:, 2]}
        scene.add(Revolute.at(a, b, point_a=one.p, point_b=other.p, **axes, name=name))
    elif joint.kind in ONE_AXIS:
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
