"""Links that are fixed to each other become one body: the one nearest to the root, with the mass of all.

m = sum m_i,  r = sum m_i r_i / m,  J = sum (J_i + m_i (d.d I - d d^T)),  d = r_i - r
"""

import numpy as np

from .description import GROUND


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


def steiner(d):
    """d.d I - d d^T."""
    return (d @ d) * np.eye(3) - np.outer(d, d)


def _rename(description, top, report):
    kept = []
    for joint in description.joints:
        joint.a, joint.b = top(joint.a), top(joint.b)
        if joint.a != joint.b:
            kept.append(joint)
        elif joint.kind != "free":
            report.leave("joint between links that are fixed to each other", joint.name)
    description.joints = kept
    for spring in description.springs:
        spring.a, spring.b = top(spring.a), top(spring.b)
