"""Joints of SDF: in the frame of the joint, or in that which an axis is expressed in."""

import numpy as np

from .description import GROUND, JointItem, Link
from .names import fresh
from .tolerances import ORTHOGONAL

KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "ball": "spherical",
    "fixed": "fixed",
    "screw": "screw",
    "universal": "universal",
    "revolute2": "universal",
}
UNLIMITED = 1e16  # of a limit, by the specification


def add_joints(found, model, frames, names, prefix, report):
    """Add the joints of a model."""
    taken = {joint.name for joint in found.joints}
    for node in model.all("joint"):
        name, kind = prefix + node.demand("name"), node.demand("type")
        ends = [_end(node, tag, frames, names) for tag in ("parent", "child")]
        if name in taken:
            node.wrong(f"there are two joints named {name!r}; rename one.")
        taken.add(name)
        if None in ends:
            continue
        if kind not in KINDS:
            known = kind in ("gearbox",)
            node.skip()
            if known:
                report.leave("gearbox", name)
            else:
                node.wrong(f"joint {name!r}: unknown type {kind!r}; there are {', '.join(KINDS)}.")
            continue
        if ends[0] == ends[1]:
            node.wrong(f"joint {name!r} joins {ends[0]!r} to itself.")
            continue
        _add(found, node, JointItem(name, KINDS[kind], *ends), frames, report)


def _end(node, tag, frames, names):
    """The link that a joint is on; None where there is none."""
    child = node.one(tag)
    name = "" if child is None else frames.link_of(child.text)
    if name == "world":
        return GROUND
    if name not in names:
        (child or node).wrong(f"joint {node.get('name')!r}: there is no link {name!r} for <{tag}>.")
        return None
    return names[name]


def _add(found, node, joint, frames, report):
    at = frames.resolve(node.get("name"))
    joint.point = at.p
    axes = [_axis(node, tag, at, frames) for tag in ("axis", "axis2")]
    if joint.kind in ("revolute", "prismatic", "screw", "universal") and axes[0] is None:
        node.wrong(f"joint {joint.name!r} lacks <axis>.")
        return
    joint.axis, joint.axis_b = axes[0], axes[1]
    if joint.kind == "universal" and axes[1] is None:
        node.wrong(f"joint {joint.name!r} lacks <axis2>.")
        return
    for tag in ("axis", "axis2"):
        _dynamics(node.one(tag), joint, tag, report)
    if joint.kind == "screw":
        joint.lead = _lead(node)
    if joint.kind == "universal" and abs(joint.axis @ joint.axis_b) > ORTHOGONAL:
        _two_hinges(found, joint)
    else:
        found.joints.append(joint)


def _two_hinges(found, joint):
    """Axes that aren't perpendicular: two hinges, with a link without mass between them."""
    between = fresh(f"{joint.name}/1", found.links)
    frame = found.frame_of(joint.b)
    found.links[between] = Link(between, frame)
    found.joints += [
        JointItem(joint.name, "revolute", joint.a, between, joint.point, joint.axis),
        JointItem(f"{joint.name} 2", "revolute", between, joint.b, joint.point, joint.axis_b),
    ]


def _axis(node, tag, at, frames):
    """The direction of an axis in the ground frame; None if there is none."""
    axis = node.one(tag)
    if axis is None:
        return None
    xyz = axis.one("xyz")
    u = np.array([0.0, 0.0, 1.0]) if xyz is None else xyz.numbers(xyz.text, 3, [0.0, 0.0, 1.0], "<xyz>")
    frame, named = at, None if xyz is None else xyz.get("expressed_in")
    if axis.flag("use_parent_model_frame"):
        frame = frames.resolve("__model__")
    elif named:
        frame = frames.resolve(named, axis)
    if not np.linalg.norm(u) > 0.0:
        axis.wrong(f"<{tag}> has length zero.")
        u = np.array([0.0, 0.0, 1.0])
    return frame.R @ (u / np.linalg.norm(u))


def _dynamics(axis, joint, tag, report):
    """Springs and dampers; limits and friction are listed."""
    if axis is None:
        return
    dynamics, limit = axis.one("dynamics"), axis.one("limit")
    if dynamics is not None:
        stiffness, damping = dynamics.scalar("spring_stiffness"), dynamics.scalar("damping")
        if friction := dynamics.scalar("friction"):
            report.leave("friction of a joint", joint.name, f"{friction:g}")
        if joint.kind in ("revolute", "prismatic") and tag == "axis":
            joint.stiffness, joint.damping = stiffness, damping
            joint.free = dynamics.scalar("spring_reference")
        elif stiffness or damping:
            report.leave(f"spring and damper of a {joint.kind} joint", joint.name, f"{stiffness:g}, {damping:g}")
    if limit is not None:
        given = {what: limit.scalar(what, UNLIMITED) for what in ("lower", "upper")}
        given |= {what: value for what in ("effort", "velocity") if (value := limit.scalar(what, UNLIMITED)) != -1.0}
        found = [f"{what} {value:g}" for what, value in given.items() if abs(value) < UNLIMITED]
        for what in ("stiffness", "dissipation"):
            limit.all(what)
        if found:
            report.leave("limits of a joint", joint.name, f"[{', '.join(found)}]")


def _lead(node):
    """m/rad, of the pitch, m per revolution; the older thread_pitch is -2 pi over it."""
    pitch, old = node.scalar("screw_thread_pitch"), node.scalar("thread_pitch")
    lead = pitch / (2.0 * np.pi) if pitch else (-1.0 / old if old else 0.0)
    if not lead:
        node.wrong(f"joint {node.get('name')!r}: a screw needs <screw_thread_pitch>, m per revolution, not zero.")
    return lead
