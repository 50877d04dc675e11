"""URDF: links, joints between them in a tree, and what ROS adds.

The joint's frame is the child's at zero; it turns or slides by q about its axis, in this frame. The specification is at
https://wiki.ros.org/urdf/XML.
"""

import numpy as np

from .description import GROUND, HERE, Coupling, Description, JointItem, Link, shifted, turned
from .drawn_shapes import add_visuals, colours, placed
from .reduction import read_loops

KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "floating": "free",
    "planar": "planar",
    "spherical": "spherical",
    "ball": "spherical",
}
WORLD = "world"  # a root link of this name is the ground


def describe(root, outside, report, free_base):
    """The `Description` of a root element <robot>.

    Parameters
    ----------
    root : Node
    outside : OutsideFiles
        For meshes.
    report : ImportReport
    free_base : bool
        Whether the root link is free to move.
    """
    found = Description(root.get("name") or "robot")
    root.get("version")
    materials = colours(root)
    nodes = {}
    for node in root.all("link"):
        _add_link(found, nodes, node, outside, report, materials)
    joints = _joints(root, found, report)
    _couple(found, [(joint, mimic) for joint, _, _, mimic in joints], report)
    _placed(found, [entry[:3] for entry in joints], root)
    children = {joint.b for joint in found.joints}
    base = [name for name in found.links if name not in children]
    if base and (not free_base or base[0] == WORLD):
        found.joints.insert(0, JointItem("base", "fixed", GROUND, base[0]))
    read_loops(found, root, {name: name for name in found.links})
    report.leave_unread(root)
    return found


def _add_link(found, nodes, node, outside, report, materials):
    name = node.demand("name")
    if name in found.links:
        node.wrong(f"there are two links named {name!r}; rename one.")
        return
    link = found.links[name] = Link(name, line=node.line)
    nodes[name] = node
    node.get("type")
    inertial = node.one("inertial")
    if inertial is not None:
        link.mass, link.centroid, link.inertia = mass_of(inertial, name)
    add_visuals(link, node, outside, report, materials)


def mass_of(node, name):
    """Mass, centroid and inertia in the frame of the link, of an element <inertial>."""
    at = origin(node)
    mass, inertia = node.one("mass"), node.one("inertia")
    if mass is None:
        node.wrong(f"link {name!r}: <inertial> lacks <mass value=...>.")
    m = 0.0 if mass is None else mass.number("value")
    if m < 0.0:
        mass.wrong(f"link {name!r}: the mass {m:g} kg is negative.")
    J = np.zeros((3, 3))
    if inertia is not None:
        xx, xy, xz, yy, yz, zz = (inertia.number(f"i{axes}") for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return m, at.p, at.R @ J @ at.R.T


def origin(node):
    """The frame of a child <origin>."""
    child = node.one("origin")
    if child is None:
        return HERE
    if child.get("quat_xyzw") is not None:
        child.wrong("<origin quat_xyzw>: write rpy.")
    return placed(child)


def _joints(root, found, report):
    """(JointItem, frame in that of the parent, axis, what it mimics) of each joint."""
    joints, names = [], set()
    for node in root.all("joint"):
        name, kind = node.demand("name"), node.demand("type")
        if name in names:
            node.wrong(f"there are two joints named {name!r}; rename one.")
        names.add(name)
        if kind not in KINDS:
            node.wrong(f"joint {name!r}: unknown type {kind!r}; there are {', '.join(KINDS)}.")
        ends = [_end(node, tag, name, found) for tag in ("parent", "child")]
        if None in ends or kind not in KINDS:
            continue
        joint, axis = JointItem(name, KINDS[kind], *ends), node.one("axis")
        u = np.array([1.0, 0.0, 0.0]) if axis is None else axis.attribute("xyz", 3, [1.0, 0.0, 0.0])
        if kind not in ("fixed", "floating", "spherical", "ball") and not np.linalg.norm(u) > 0.0:
            axis.wrong(f"joint {name!r}: the axis has length zero.")
            u = np.array([1.0, 0.0, 0.0])
        _dynamics(node, joint, kind, report)
        joints.append((joint, origin(node), u, _mimic(node)))
    return joints


def _end(node, tag, name, found):
    """The name of a link of a joint; None if there is none."""
    child = node.one(tag)
    link = None if child is None else child.demand("link")
    if child is None:
        node.wrong(f"joint {name!r} lacks <{tag} link=...>.")
    elif link not in found.links:
        child.wrong(f"joint {name!r}: there is no link {link!r}.")
        link = None
    return link


def _dynamics(node, joint, kind, report):
    """Damping; friction and limits are left out."""
    dynamics, limit = node.one("dynamics"), node.one("limit")
    if dynamics is not None and joint.kind != "fixed":
        joint.damping = dynamics.number("damping")
        if joint.damping < 0.0:
            dynamics.wrong(f"joint {joint.name!r}: the damping is negative.")
        if friction := dynamics.number("friction"):
            report.leave("friction of a joint", joint.name, f"{friction:g}")
    elif dynamics is not None:
        dynamics.skip()  # of no joint that moves
    if limit is not None:
        lower, upper = limit.number("lower"), limit.number("upper")
        if kind in ("revolute", "prismatic"):
            report.leave_limits(joint.name, lower, upper)
        for what in ("effort", "velocity"):
            if largest := limit.number(what):
                report.leave(f"limit of {what}", joint.name, f"{largest:g}")
    for tag in ("calibration", "safety_controller"):
        for one in node.all(tag):
            one.skip()
            report.leave(f"<{tag}>", joint.name)


def _mimic(node):
    """(joint, multiplier, offset); None if it mimics none."""
    mimic = node.one("mimic")
    return None if mimic is None else (mimic.demand("joint"), mimic.number("multiplier", 1.0), mimic.number("offset"))


def _placed(found, joints, root):
    """Place links from the root on, at zero coordinates and at the start; the joints that are reached."""
    parents, beyond = {}, {}
    for entry in joints:
        joint = entry[0]
        if joint.b in parents:
            root.wrong(f"link {joint.b!r} has two parents, by the joints {parents[joint.b]!r} and {joint.name!r}.")
        parents[joint.b] = joint.name
        beyond.setdefault(joint.a, []).append(entry)
    roots = [name for name in found.links if name not in parents]
    if not found.links:
        root.wrong("<robot> has no links.")
    elif len(roots) != 1:
        root.wrong(
            f"a robot has one root link, this one has {len(roots)}: {', '.join(roots[:5])}."
            if roots else "the joints form a circle: no link is without a parent."
        )  # fmt: skip
    placed, ahead = set(), roots
    while ahead:
        name = ahead.pop()
        for joint, at, u in beyond.pop(name, ()):
            one, other = found.links[joint.a], found.links[joint.b]
            axis = u / (np.linalg.norm(u) or 1.0)
            moved = {"revolute": turned, "prismatic": shifted}.get(joint.kind, lambda _: HERE)(joint.start * axis)
            other.frame, other.start = one.frame @ at, one.start @ at @ moved
            joint.point, joint.axis = other.frame.p, other.frame.R @ axis
            placed.add(joint)
            ahead.append(joint.b)
    if beyond:
        root.wrong(f"the joints form a circle at {next(iter(beyond.values()))[0][0].name!r}.")
    found.joints = [joint for joint, *_ in joints if joint in placed]


def _couple(found, joints, report):
    """Couple joints that mimic others to the first of their chain, and start them there.

    q = c q' + d,  q' = c' q'' + d'  ->  q = c c' q'' + c d' + d
    """
    mimics = {joint.name: mimic for joint, mimic in joints}
    chains = {name: (name, 1.0, 0.0) for name, mimic in mimics.items() if mimic is None}
    for joint, mimic in joints:
        path, name = {}, joint.name
        while name in mimics and name not in chains and name not in path:
            path[name] = None
            name = mimics[name][0]
        end = chains.get(name)
        for name in reversed(path):
            _, ratio, offset = mimics[name]
            end = chains[name] = end and (end[0], ratio * end[1], ratio * end[2] + offset)
        if mimic is None:
            continue
        if end := chains[joint.name]:
            joint.start = end[2]
            name = f"{joint.name} mimics {mimic[0]}"
            found.couplings.append(Coupling(name, (joint.name, 0), ((end[0], 0),), (end[1],), end[2]))
        else:
            reason = "it follows joints that mimic each other in a circle, or one that isn't there"
            reason = reason if mimic[0] in mimics else f"there is no other joint {mimic[0]!r}"
            report.leave("joint that mimics another one", joint.name, reason)
