"""SDF: models of links, joints and frames, each posed in another one; loops are joints as any other."""

import numpy as np

from ..maths.tolerances import TYPED
from . import description
from .drawn_shapes import add_sdf_shapes
from .reduction import read_loops

# Frames of an SDF model: links, joints, frames and inner models, each given in another one.

MODEL = "__model__"


class Frames:
    """The frames of a model by name.

    Parameters
    ----------
    model : Node
    outer : Frame
        In which the model is given, in the ground frame.
    report : ImportReport
    """

    def __init__(self, model, outer, report):
        self.report, self._known, self._parents = report, {}, {}
        self._owners = {}  # of frames that have been asked for
        for node in (*model.all("link"), *model.all("model")):
            self._add(node, MODEL)
        for node in model.all("frame"):
            self._add(node, node.get("attached_to") or MODEL)
        for node in model.all("joint"):
            child = node.one("child")
            self._add(node, child.text if child is not None else MODEL)
        self.node = model
        if model.get("placement_frame"):
            model.wrong("<model placement_frame>: write the pose of the model itself.")
        self._at = {MODEL: outer @ self.pose(model)}

    def _add(self, node, parent):
        name = node.get("name")
        if name:
            self._known.setdefault(name, node)
            self._parents.setdefault(name, parent)

    def pose(self, node):
        """The frame of a child <pose>, in that which it is relative to."""
        child = node.one("pose")
        if child is None or not child.text:
            if child is not None:
                _ = child.get("frame"), child.get("relative_to")
            return description.HERE
        _ = child.get("frame"), child.get("relative_to")
        degrees = (child.get("degrees") or "").lower() in ("1", "true")
        if child.get("rotation_format") == "quat_xyzw":
            values = child.numbers(child.text, 7, [0, 0, 0, 0, 0, 0, 1], "<pose>")
            return description.Frame(values[:3], description.of_quaternion(np.roll(values[3:], 1)))
        values = child.numbers(child.text, 6, np.zeros(6), "<pose>")
        return description.Frame(values[:3], description.roll_pitch_yaw(values[3:], degrees=degrees))

    def resolve(self, name, node=None):
        """A frame, by name, in the ground frame."""
        name = name or ""  # of what lacks one, which is a mistake already
        waiting, at = {}, None
        while at is None and (at := self._at.get(name)) is None:
            if name in ("world", ""):
                at = description.HERE
            elif name not in self._known and "::" in name:
                at = self._inner(name, node)
            elif name not in self._known or name in waiting:
                what = "there is no frame" if name not in self._known else "poses form a circle at"
                (node or self.node).wrong(f"{what} {name!r}.")
                at = description.HERE
            else:
                node = waiting[name] = self._known[name]
                child = node.one("pose")
                named = None if child is None else child.get("relative_to") or child.get("frame")
                name = named or self._parents[name]
        for name, node in reversed(waiting.items()):
            at = self._at[name] = at @ self.pose(node)
        return at

    def _inner(self, name, node):
        (node or self.node).wrong(f"the frame {name!r} of an inner model can't be referred to; give the pose itself.")
        return description.HERE

    def link_of(self, name):
        """The link that a frame is attached to; the name itself where it is none."""
        seen = {}
        while name in self._known and self._known[name].tag in ("frame", "joint") and name not in seen:
            seen[name] = None
            name = self._owners.get(name) or self._parents[name]
        self._owners.update(dict.fromkeys(seen, name))
        return name


# Joints of SDF: in the frame of the joint, or in that which an axis is expressed in.

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
UNLIMITED = {"lower": -description.UNLIMITED, "upper": description.UNLIMITED}
MIMIC = ("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0)


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
        _add(found, node, description.JointItem(name, KINDS[kind], *ends), frames, report)


def _end(node, tag, frames, names):
    """The link that a joint is on; None where there is none."""
    child = node.one(tag)
    name = "" if child is None else frames.link_of(child.text)
    if name == "world":
        return description.GROUND
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
        _mimic(found, node.one(tag), joint, tag, report)
    if joint.kind == "screw":
        joint.lead = _lead(node)
    if joint.kind == "universal" and abs(joint.axis @ joint.axis_b) > TYPED:
        _two_hinges(found, joint)
    else:
        found.joints.append(joint)


def _two_hinges(found, joint):
    """Axes that aren't perpendicular: two hinges, with a link without mass between them."""
    between = description.fresh(f"{joint.name}/1", found.links)
    frame = found.frame_of(joint.b)
    found.links[between] = description.Link(between, frame)
    found.joints += [
        description.JointItem(joint.name, "revolute", joint.a, between, joint.point, joint.axis),
        description.JointItem(f"{joint.name} 2", "revolute", between, joint.b, joint.point, joint.axis_b),
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
        given = {what: limit.scalar(what, bound) for what, bound in UNLIMITED.items()}
        given |= {what: value for what in ("effort", "velocity") if (value := limit.scalar(what, -1.0)) != -1.0}
        found = [f"{what} {value:g}" for what, value in given.items() if abs(value) < description.UNLIMITED]
        for what in ("stiffness", "dissipation"):
            limit.all(what)
        if found:
            report.leave_limits(
                joint.name, given["lower"], given["upper"], f"[{', '.join(found)}]", int(tag == "axis2")
            )


def _mimic(found, axis, joint, tag, report):
    """Couple a joint to the one that it mimics: q = multiplier (q' - reference) + offset, zero as posed."""
    mimic = None if axis is None else axis.one("mimic")
    if mimic is None:
        return
    leader, index = mimic.demand("joint"), int((mimic.get("axis") or "axis") == "axis2")
    ratio, offset, reference = (mimic.scalar(what, value) for what, value in MIMIC)
    prefix = joint.name[: joint.name.rfind("::") + 2] if "::" in joint.name else ""
    name, offset = f"{joint.name} mimics {leader}", offset - ratio * reference
    follower = (joint.name, int(tag == "axis2"))
    found.couplings.append(description.Coupling(name, follower, ((prefix + leader, index),), (ratio,), offset))
    if offset:
        report.note(f"{name}: it starts {offset:g} off; scene.assemble() takes it there")


def _lead(node):
    """m/rad, of the pitch, m per revolution; the older thread_pitch is -2 pi over it."""
    pitch, old = node.scalar("screw_thread_pitch"), node.scalar("thread_pitch")
    lead = pitch / (2.0 * np.pi) if pitch else (-1.0 / old if old else 0.0)
    if not lead:
        node.wrong(f"joint {node.get('name')!r}: a screw needs <screw_thread_pitch>, m per revolution, not zero.")
    return lead


# SDF: models of links, joints and frames, each posed in another one; loops are joints as any other.
#
# The specification is at http://sdformat.org/spec. Poses of links are those of the start, so a joint needs its place in
# the ground frame alone.


def describe(root, outside, report):
    """The `Description` of a root element <sdf>."""
    root.get("version")
    worlds = root.all("world")
    models = [*root.all("model"), *(model for world in worlds for model in world.all("model"))]
    found = description.Description(models[0].get("name") or "model" if models else "model")
    for world in worlds[:1]:
        world.get("name")
        physics = world.one("physics")
        if world.one("gravity") is not None:
            found.gravity = world.value("gravity", 3, found.gravity)
        elif physics is not None and physics.one("gravity") is not None:
            found.gravity = physics.value("gravity", 3, found.gravity)
    if not models:
        root.wrong("<sdf> has no <model>.")
    for model in models:
        prefix = f"{model.get('name')}::" if len(models) > 1 else ""
        _add_model(found, model, description.HERE, prefix, outside, report)
    report.leave_unread(root)
    return found


def _add_model(found, model, outer, prefix, outside, report):
    """Add links and joints of a model, and of the models in it."""
    frames = Frames(model, outer, report)
    model.get("canonical_link")
    static, names = model.flag("static"), {}
    for node in model.all("link"):
        name = prefix + node.demand("name")
        if name in found.links:
            node.wrong(f"there are two links named {name!r}; rename one.")
        found.links[name] = _link(node, name, frames, outside, report)
        names[node.get("name")] = name
    for inner in model.all("model"):
        here = f"{inner.demand('name')}::"
        within = _add_model(found, inner, frames.resolve(inner.get("name")), prefix + here, outside, report)
        names |= {here + one: name for one, name in within.items()}
    for node in model.all("frame"):
        name, owner = node.get("name"), frames.link_of(node.get("name"))
        if owner in names and name not in found.links:
            found.frames[prefix + name] = names[owner], found.links[names[owner]].frame.inverse @ frames.resolve(name)
    add_joints(found, model, frames, names, prefix, report)
    read_loops(found, model, names)
    if static:
        found.joints += [
            description.JointItem(f"{name} static", "fixed", description.GROUND, name) for name in names.values()
        ]
    return names


def _link(node, name, frames, outside, report):
    """A link at the start."""
    link = description.Link(name, frames.resolve(node.get("name")), line=node.line)
    inertial = node.one("inertial")
    if inertial is None:
        link.mass, link.inertia = 1.0, np.eye(3)  # what the specification says
        report.note(f"{name}: mass 1 kg and inertia 1 kg m^2, the defaults of SDF")
    else:
        _set_mass(link, inertial, frames, name, report)
    add_sdf_shapes(link, node, frames, outside, report)
    return link


def _set_mass(link, node, frames, name, report):
    if node.get("auto", "false").lower() in ("1", "true"):
        report.leave("inertia of the densities of contact shapes", name)
    at, inertia = frames.pose(node), node.one("inertia")
    link.mass = node.scalar("mass", 1.0)
    if link.mass < 0.0:
        node.wrong(f"link {name!r}: the mass {link.mass:g} kg is negative.")
    J = np.eye(3)
    if inertia is not None:
        terms = ("xx", "xy", "xz", "yy", "yz", "zz")
        xx, xy, xz, yy, yz, zz = (inertia.scalar(f"i{axes}", float(axes[0] == axes[1])) for axes in terms)
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    link.centroid, link.inertia = at.p, at.R @ J @ at.R.T
