"""Links without mass or inertia between joints: a share of a neighbour's mass is moved to them, exactly.

Both bodies of a revolute joint move alike on its axis, those of a spherical joint at its point, and those of a
prismatic joint turn alike. Mass that is moved from one to the other there changes no motion:

    S = [[J_2, m r], [m r^T, m]],  J_2 = tr(J) I / 2 - J + m r r^T       the second moments of a body, (4, 4)
    S_donor - x L,  S_link + x L                                         (1)  L: of the points that both have
    x = SHARE / max eig(S_donor^-1/2 L S_donor^-1/2)                     (2)  what is left is the inertia of a body

Links that only frames hang from don't move on their own: their joint is held, and listed. Links that no neighbour can
share with, as in chains of particles, are given a trifle, which is listed, too. Whether all of it has enough inertia is
checked when a run starts.
"""

import numpy as np

from .description import GROUND
from .merging import merge
from .tolerances import HALVINGS, NO_INERTIA, NO_MASS, REACH, SHARE, SLIGHT, SOLID, TRIFLE


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
    usual = _usual_mass(description)
    all_poor = poor = [link for link in reversed(description.links.values()) if is_poor(link, SLIGHT * usual)]
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
        _add_trifle(link, usual, report)


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


def _add_trifle(link, usual, report):
    """Give a link that no neighbour can share with as little as rounding allows; that is no longer exact."""
    mass, inertia = max(link.mass, TRIFLE * usual), TRIFLE * usual * REACH**2
    link.mass, link.inertia = mass, link.inertia + inertia * np.eye(3)
    report.leave("link without mass or inertia, given a trifle", link.name, f"{mass:.2g} kg, {inertia:.2g} kg m^2")


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


def _usual_mass(description):
    masses = [link.mass for link in description.links.values() if link.mass > NO_MASS]
    return float(np.median(masses)) if masses else 1.0


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
    if values[0] > SOLID * values[-1]:
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
