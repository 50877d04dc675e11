"""From a description to a scene: links are merged, massless ones get a share, slides in a row join, loops close."""

import numpy as np

from ..errors import InvalidArgument
from ..maths.tolerances import HALF_DIGITS, TYPED
from ..shapes import steiner
from ..validation import floats, nearest, sequence, shown
from .description import GROUND, HERE, Frame, JointItem, Slide, fresh, turned
from .drawn_shapes import placed
from .tolerances import HALVINGS, NO_INERTIA, NO_MASS, REACH, SHARE, SLIGHT

# Links that are fixed to each other become one body: the one nearest to the root, with the mass of all.
#
# m = sum m_i,  r = sum m_i r_i / m,  J = sum (J_i + m_i (d.d I - d d^T)),  d = r_i - r


def merge(description, report):
    """Merge links along fixed joints that are no loops; joints, springs and frames then name what they belong to."""
    head = {name: name for name in (GROUND, *description.links)}

    def top(name):
        while head[name] != name:
            head[name] = head[head[name]]
            name = head[name]
        return name

    kept = []
    for joint in description.joints:
        one, other = top(joint.a), top(joint.b)
        if joint.kind == "fixed" and not joint.loop:
            head[one if other == GROUND else other] = other if other == GROUND else one
        else:
            kept.append(joint)
    description.joints = kept
    groups = {}
    for name in description.links:
        groups.setdefault(top(name), []).append(name)
    frames = {name: (top(name), inside(description, name, top(name))) for name in description.links}
    for name, (link, frame) in description.frames.items():
        owner, at = (GROUND, frame) if link == GROUND else (frames[link][0], frames[link][1] @ frame)
        frames[name if name not in frames else f"{name} (site)"] = owner, at
    for name, members in groups.items():
        _join(description, name, members, report)
    description.frames = frames
    _rename(description, top, report)
    description.links = {name: link for name, link in description.links.items() if top(name) == name}


def inside(description, name, outer):
    """The frame of a link in that of another one, or of the ground."""
    return description.frame_of(outer).inverse @ description.frame_of(name)


def _join(description, name, members, report):
    """Give the mass and the shapes of links to the one that they are fixed to."""
    others = [member for member in members if member != name]
    if name == GROUND:
        for member in others:
            frame = description.links[member].frame
            description.ground_shapes += [shape.within(frame) for shape in description.links[member].shapes]
        if others:
            report.note(f"fixed to the ground: {', '.join(others)}")
        return
    if not others:
        return
    link = description.links[name]
    parts = [(description.links[member], inside(description, member, name)) for member in members]
    link.shapes = [shape.within(frame) for part, frame in parts for shape in part.shapes]
    link.mass, link.centroid, link.inertia = together(
        [(part.mass, frame.point(part.centroid), frame.R @ part.inertia @ frame.R.T) for part, frame in parts]
    )
    report.note(f"merged into {name}, to which they are fixed: {', '.join(others)}")


def together(parts):
    """(mass, centroid, inertia) of several (mass, centroid, inertia) in one frame."""
    mass = sum(m for m, _, _ in parts)
    if len([m for m, _, _ in parts if m > 0.0]) == 1 and not any(J.any() for m, _, J in parts if m == 0.0):
        return next(part for part in parts if part[0] > 0.0)  # to the bit
    centroid = sum(m * r for m, r, _ in parts) / mass if mass > 0.0 else np.zeros(3)
    inertia = sum(J + m * steiner(r - centroid) for m, r, J in parts)
    return mass, centroid, inertia


def _rename(description, top, report):
    kept = []
    for joint in description.joints:
        joint.a, joint.b = top(joint.a), top(joint.b)
        if joint.a != joint.b:
            kept.append(joint)
        elif joint.kind != "free":
            report.leave("joint between links that are fixed to each other", joint.name)
    description.joints = kept
    for tendon in description.tendons:
        tendon.points = [(top(link), point) for link, point in tendon.points]


# Links without mass or inertia between joints: a share of a neighbour's mass is moved to them, exactly.
#
# Both bodies of a revolute joint move alike on its axis, those of a spherical joint at its point, and those of a
# prismatic joint turn alike. Mass that is moved from one to the other there changes no motion:
#
#     S = [[J_2, m r], [m r^T, m]],  J_2 = tr(J) I / 2 - J + m r r^T       the second moments of a body, (4, 4)
#     S_donor - x L,  S_link + x L                                         (1)  L: of the points that both have
#     x = SHARE / max eig(S_donor^-1/2 L S_donor^-1/2)                     (2)  what is left is the inertia of a body
#
# Links that only frames hang from don't move on their own: their joint is held, and listed. Links that no neighbour can
# share with, as in chains of particles, are given a trifle, which is listed, too. Whether all of it has enough inertia
# is checked when a run starts.


def complete(description, report):
    """Hold joints of leaves without mass, then give mass to the links between joints that have none."""
    if _hold_idle_joints(description, report):
        frames = description.frames
        merge(description, report)
        description.frames = frames | _deeper(frames, description.frames)
    joints = description.joints_by_link()
    for link in [link for link in description.links.values() if link.mass <= 0.0 and not joints[link.name]]:
        report.leave("link without mass", link.name)
        del description.links[link.name]
    masses = [link.mass for link in description.links.values() if link.mass > NO_MASS]
    usual = float(np.median(masses)) if masses else 1.0
    all_poor = poor = [link for link in reversed(description.links.values()) if is_poor(link, SLIGHT * usual)]
    for link in all_poor:
        link.helps = link.mass <= SLIGHT * usual
    waiting = None
    while poor != waiting:  # one may have to wait for its neighbour
        waiting = poor
        poor = [link for link in poor if not _endow(description, joints[link.name], link, usual)]
    poor = [link for link in poor if is_poor(link)]
    given = [link.name for link in all_poor if link not in poor]
    if given:
        report.note(
            f"without mass or inertia, given a share of what their neighbours carry for them: {', '.join(given)}"
        )
    for link in poor:
        mass, inertia = max(link.mass, HALF_DIGITS * usual), HALF_DIGITS * usual * REACH**2
        link.mass, link.inertia = mass, link.inertia + inertia * np.eye(3)
        report.leave("link without mass or inertia, given a trifle", link.name, f"{mass:.2g} kg, {inertia:.2g} kg m^2")


def _deeper(before, now):
    """Frames that were on a link that has been merged in the meantime."""
    return {name: (now[link][0], now[link][1] @ at) for name, (link, at) in before.items() if link in now}


def is_poor(link, least=NO_MASS):
    """Whether a link lacks mass or inertia."""
    return link.mass <= least or not np.abs(link.inertia).max() > NO_INERTIA


def _hold_idle_joints(description, report):
    """Fix joints that nothing with mass hangs from on one side; whether there are any."""
    joints, found = description.joints_by_link(), False
    ahead = [link for link in description.links.values() if link.mass <= NO_MASS]
    while ahead:
        link = ahead.pop()
        joint = next(iter(joints[link.name]), None)
        if link.mass > NO_MASS or len(joints[link.name]) != 1 or joint.kind in ("free", "fixed"):
            continue
        report.leave("joint of a link without mass, held", joint.name)
        joint.kind, joint.loop, found = "fixed", False, True
        for name in (joint.a, joint.b):
            del joints[name][joint]
            if name not in (GROUND, link.name):
                ahead.append(description.links[name])
    return found


def _endow(description, joints, link, usual):
    """Move mass to a link from its neighbours at its joints; whether it has enough then."""
    least = SLIGHT * usual
    for joint in joints:
        if joint.loop:
            continue  # its sides may be apart
        name = joint.a if joint.b == link.name else joint.b
        donor = None if name == GROUND else description.links[name]
        if donor is not None and is_poor(donor, least):
            continue
        common = _common(joint, link, donor)
        if common is None:
            continue
        if donor is None:
            share, size = common, usual
        else:
            there = moments(donor)
            moved = _between(link, donor, common)
            size = SHARE * _largest(there, moved)
            if not size:
                continue
            take(donor, there - size * moved)
            share = common
        take(link, moments(link) + size * share)
    return not is_poor(link, least)


def _common(joint, link, donor):
    """Second moments (4, 4) of points that both bodies of a joint have, in the frame of the link, of mass 1 kg."""
    if joint.kind in ("revolute", "universal", "spherical"):
        at, reach = link.frame.seen(joint.point), _reach(link, donor, joint)
        directions = [link.frame.R.T @ joint.axis] if joint.kind == "revolute" else []
        points = [at + sign * reach * u for u in directions for sign in (-1.0, 1.0)] or [at]
        rows = np.array([[*point, 1.0] for point in points])
        return rows.T @ rows / len(rows)
    return None


def _reach(link, donor, joint):
    """Half the length of a rod on the axis: as far as the donor extends, m."""
    if donor is None:
        return REACH
    extent = np.sqrt(max(np.trace(donor.inertia), 0.0) / donor.mass)
    return max(float(extent), 1e-3)


def moments(link):
    """Second moments S (4, 4) of a link in its own frame."""
    second = (
        0.5 * np.trace(link.inertia) * np.eye(3) - link.inertia + link.mass * np.outer(link.centroid, link.centroid)
    )
    first = link.mass * link.centroid[:, None]
    return np.block([[second, first], [first.T, np.array([[link.mass]])]])


def take(link, S):
    """Give a link the mass, centroid and inertia of second moments."""
    link.mass = float(S[3, 3])
    link.centroid = S[:3, 3] / link.mass
    second = S[:3, :3] - link.mass * np.outer(link.centroid, link.centroid)
    inertia = np.trace(second) * np.eye(3) - second
    link.inertia = (inertia + inertia.T) / 2.0


def _between(link, donor, S):
    """Second moments in the frame of the donor."""
    at = donor.frame.inverse @ link.frame
    T = np.block([[at.R, at.p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
    return T @ S @ T.T


def _largest(there, moved):
    """The largest x for which there - x moved is the inertia of a body, by (2).

    Where `there` is that of no solid: as far as its mass and its principal moments remain positive.
    """
    values, vectors = np.linalg.eigh(there)
    if values[0] > TYPED * values[-1]:
        root = vectors / np.sqrt(values)
        return 1.0 / float(np.linalg.eigvalsh(root.T @ moved @ root)[-1])
    x, least = there[3, 3] / moved[3, 3], _least_moment(there)
    for _ in range(HALVINGS if least > 0.0 else 0):
        x /= 2.0
        if _least_moment(there - x * moved) > SHARE * least:
            return x
    return 0.0


def _least_moment(S):
    """The least principal moment of inertia about the centroid."""
    second = S[:3, :3] - np.outer(S[:3, 3], S[:3, 3]) / S[3, 3]
    return float(np.linalg.eigvalsh(np.trace(second) * np.eye(3) - second)[0])


# Prismatic joints one after another, with nothing but massless links between them, become one joint.
#
# two                        two displacements, no rotation      rows: Parallel, Dot1, Dot2
# two, and a hinge across    Planar                              of the hinge's name, with its angle
# three                      three displacements, no rotation    rows: Parallel, Dot1
# three, and a ball or three hinges                              the link is free


def gather(description, report):
    """Replace chains of prismatic joints."""
    joints = description.joints_by_link()
    coupled = {name for each in description.couplings for name, _ in (each.follower, *each.drivers)}

    def joins(first, second):
        alone = coupled.isdisjoint((first.name, second.name)) and not (first.armature or second.armature)
        alone = alone and not (first.servos or second.servos)
        return alone and _joins(first, second) and _act_apart(first, second, description.frame_of(first.a).R)

    for first, link, second in _pairs(description, joints, joins):
        slides = [*_slides(first), *_slides(second)]
        second.kind, second.slides = "translations", slides
        second.stiffness = second.damping = second.free = second.load = 0.0
        second.name = ", ".join(slide.name for slide in slides)
        _drop(description, joints, first, link)
    for first, link, second in _pairs(description, joints, _is_planar):
        second.kind, second.slides = "planar", first.slides
        _drop(description, joints, first, link)
        report.note(f"{first.name}, {second.name}: one planar joint")
    for joint in [joint for joint in description.joints if len(joint.slides) == 3]:
        _free(description, joints, joint, report)
    description.joints = [joint for joint in description.joints if joint in joints[joint.a]]
    description.frames = {
        name: (owner, at) for name, (owner, at) in description.frames.items() if owner in joints
    }  # fmt: skip


def _pairs(description, joints, fits):
    """(joint, massless link, next joint), of which `fits` is true; each is dropped before the next one."""
    for link in list(description.links.values()):
        pair = sorted(joints[link.name], key=lambda joint: joint.a == link.name)
        if len(pair) == 2 and is_poor(link) and link.mass <= 0.0:
            first, second = pair
            if first.b == link.name and second.a == link.name and fits(first, second):
                yield first, link, second


def _joins(first, second):
    """Whether two joints slide along independent axes."""
    if {first.kind, second.kind} - {"prismatic", "translations"} or first.loop or second.loop:
        return False
    axes = np.array([slide.axis for slide in (*_slides(first), *_slides(second))])
    return len(axes) <= 3 and np.linalg.svd(axes, compute_uv=False)[-1] > TYPED


def _act_apart(first, second, axes):
    """Whether springs, dampers and loads of slides act as those of a Bushing: along axes of the body, (3, 3)."""
    slides = [*_slides(first), *_slides(second)]
    acting = [slide for slide in slides if slide.stiffness or slide.damping or slide.load]
    return all(
        not slide.load
        and min(slide.stiffness, slide.damping) >= 0.0
        and abs(np.abs(slide.axis @ axes).max() - 1.0) < TYPED
        and all(abs(slide.axis @ other.axis) < TYPED for other in slides if other is not slide)
        for slide in acting
    )


def _slides(joint):
    return joint.slides or [Slide(joint.name, joint.axis, joint.stiffness, joint.damping, joint.free, joint.load)]


def _drop(description, joints, joint, link):
    """Drop a joint and the link beyond it; what hangs from the link hangs from the one before."""
    del joints[joint.a][joint], joints[link.name][joint]
    for following in joints.pop(link.name):
        following.a = joint.a
        joints[joint.a][following] = None
    del description.links[link.name]


def _is_planar(first, second):
    """Whether a hinge is across two slides."""
    if first.kind != "translations" or len(first.slides) != 2 or second.kind != "revolute" or second.loop:
        return False
    return abs(abs(first.normal() @ second.axis) - 1.0) < TYPED


def _free(description, joints, joint, report):
    """Three slides, then a ball or three hinges, hold nothing."""
    chain = [joint]
    while chain[-1].b != GROUND and sum(3 if one.kind == "spherical" else 1 for one in chain[1:]) < 3:
        link = description.links[chain[-1].b]
        following = [one for one in joints[link.name] if one.a == link.name]
        if not is_poor(link) or len(following) != 1 or following[0].loop:
            return
        if following[0].kind not in ("revolute", "spherical"):
            return
        chain.append(following[0])
    axes = [one.axis for one in chain[1:] if one.kind == "revolute"]
    plain = not any(one.stiffness or one.damping or one.load or one.armature for one in chain)
    plain = plain and not any(slide.stiffness or slide.damping or slide.load for slide in joint.slides)
    if not plain or (axes and (len(axes) != 3 or abs(np.linalg.det(axes)) < TYPED)):
        return
    for one in chain:
        report.note(f"{one.name}: the link {chain[-1].b} is free")
    for one in chain[:-1]:
        _drop(description, joints, one, description.links[one.b])
    chain[-1].kind = "free"


# Loops that a file doesn't close by its joints: those given to `ts.load`, <loop_joint> and Drake's ball constraints.
#
# weld     the frames coincide                    Fixed
# ball     their origins coincide                 Spherical
# hinge    so do their z axes, or a given axis    Revolute

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


def read_loops(found, node, names):
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
