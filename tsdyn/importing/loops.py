"""Loops that a file doesn't close by its joints: those given to `ts.load`, <loop_joint> and Drake's ball constraints.

weld     the frames coincide                    Fixed
ball     their origins coincide                 Spherical
hinge    so do their z axes, or a given axis    Revolute
"""

import numpy as np

from ..errors import InvalidArgument
from ..validation import floats, nearest, sequence, shown
from .description import GROUND, HERE, Frame, JointItem, fresh, turned
from .drawn_shapes import placed

KINDS = {"weld": "fixed", "ball": "spherical", "hinge": "revolute"}
EXAMPLE = '("link_a", "link_b", "weld"), of weld, ball and hinge'
DRAKE = "{http://drake.mit.edu}"
ENDS = "link1", "link2"
TYPES = {  # of <loop_joint>, as Drake, RigidBodyDynamics.jl and Isaac Sim write it; Drake's first files have none
    None: "hinge",
    "revolute": "hinge",
    "continuous": "hinge",
    "spherical": "ball",
    "ball": "ball",
    "fixed": "weld",
}


def close(found, name, kind, ends, frames):
    """Add a loop to a description: names of two links, and the frames on them that are held together (ground frame)."""
    taken = {joint.name for joint in found.joints}
    loop = JointItem(fresh(name, taken), KINDS[kind], *ends, loop=True, frame_a=frames[0], frame_b=frames[1])
    found.joints.append(loop)


def add_given(found, loops):
    """Add the loops (frame_a, frame_b, kind) of `ts.load`; hinges may name their axis, in both frames."""
    for loop in loops:
        parts = sequence(loop, f"loops: each is such as {EXAMPLE}", InvalidArgument)
        if not (len(parts) == 3 or (len(parts) == 4 and parts[2] == "hinge")) or parts[2] not in KINDS:
            raise InvalidArgument(
                f"loops: each is such as {EXAMPLE}; a hinge turns about the z axes of its frames, or about the axis in "
                f"a fourth entry, such as (0, 1, 0). Got {loop!r}."
            )
        turn = _towards(parts[3]) if len(parts) == 4 else HERE
        (one, at), (other, there) = (_frame(found, name) for name in parts[:2])
        if one == other:
            raise InvalidArgument(f"loops: {parts[0]!r} and {parts[1]!r} are on the same link, {one or 'the ground'}.")
        close(found, f"{parts[0]} to {parts[1]}", parts[2], (one, other), (at @ turn, there @ turn))


def _frame(found, name):
    """The link that a frame of the file is on, and the frame, in the ground frame; links first, then sites, joints."""
    if name in ("ground", "world") and name not in found.links:
        return GROUND, HERE
    if name in found.links:
        return name, found.frame_of(name)
    if name in found.frames:
        link, at = found.frames[name]
        return link, found.frame_of(link) @ at
    joints = {joint.name: joint for joint in found.joints if not joint.loop}
    if name in joints:
        link, point = joints[name].b, joints[name].point
        at = found.frame_of(link)
        return link, at if point is None else Frame(point, at.R)
    near = nearest(str(name), [*found.links, *found.frames, *joints])
    raise InvalidArgument(f"loops: the file has no link, frame, site or joint {name!r}{near}")


def _towards(given):
    """A rotation that takes z to an axis."""
    axis = floats(given)
    length = np.linalg.norm(axis)
    if axis.shape != (3,) or not 0.0 < length < np.inf:
        raise InvalidArgument(
            f"loops: the axis of a hinge must be three numbers, not all zero, such as (0, 1, 0); got {shown(given)}."
        )
    u = axis / length
    across = np.cross((0.0, 0.0, 1.0), u)
    sine = np.linalg.norm(across)
    if not sine:
        across = np.array([1.0, 0.0, 0.0])
    return turned(np.arctan2(sine, u[2]) * across / (sine or 1.0))


def read(found, node, names):
    """Add the <loop_joint>s and ball constraints in an element; names: of links, by those in the file."""
    for one in node.all("loop_joint", f"{DRAKE}loop_joint"):
        _read_joint(found, one, names)
    for one in node.all(f"{DRAKE}ball_constraint", "ball_constraint"):
        _read_ball(found, one, names)


def _read_joint(found, node, names):
    name, kind, axis = node.demand("name"), node.get("type"), node.one("axis")
    ends = node.all(*ENDS)
    if kind not in TYPES:
        node.wrong(f"loop joint {name!r}: unknown type {kind!r}; there are {', '.join(filter(None, TYPES))}.")
    elif len(ends) != 2:
        node.wrong(f"loop joint {name!r} needs <link1 link=... xyz=... rpy=...> and <link2 ...>.")
    else:
        links = [_link(found, end, end.demand("link"), names) for end in ends]
        u = np.array([1.0, 0.0, 0.0]) if axis is None else axis.attribute("xyz", 3, [1.0, 0.0, 0.0])
        if not np.linalg.norm(u) > 0.0:
            axis.wrong(f"loop joint {name!r}: the axis has length zero.")
        elif None not in links:
            turn = _towards(u) if TYPES[kind] == "hinge" else HERE
            frames = [found.frame_of(link) @ placed(end) @ turn for link, end in zip(links, ends, strict=True)]
            close(found, name, TYPES[kind], links, frames)


def _read_ball(found, node, names):
    """Text in SDF, attributes in URDF."""
    links, frames = [], []
    for body, point in (("body_A", "p_AP"), ("body_B", "p_BQ")):
        one, at = (_part(node, f"ball_constraint_{tag}") for tag in (body, point))
        if one is None or at is None:
            node.wrong(f"<drake:ball_constraint> lacks <drake:ball_constraint_{body if one is None else point}>.")
            return
        links.append(_link(found, one, one.text or one.get("name") or "", names))
        p = at.numbers(at.text or at.get("value"), 3, np.zeros(3), "<drake:ball_constraint_p>")
        frames.append(None if links[-1] is None else found.frame_of(links[-1]) @ Frame(p, np.eye(3)))
    if None not in links:
        close(found, f"ball {links[0]}-{links[1]}", "ball", links, frames)


def _part(node, tag):
    return next(iter(node.all(f"{DRAKE}{tag}", tag)), None)


def _link(found, node, name, names):
    """The link of a name in the file; None where there is none, which is a mistake."""
    if name == "world" and name not in names:
        return GROUND
    if name not in names:
        node.wrong(f"there is no link {name!r}.")
    return names.get(name)
