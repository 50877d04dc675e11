"""Prismatic joints one after another, with nothing but massless links between them, become one joint.

two                        two displacements, no rotation      rows: Parallel, Dot1, Dot2
two, and a hinge across    Planar                              of the hinge's name, with its angle
three                      three displacements, no rotation    rows: Parallel, Dot1
three, and a ball or three hinges                              the link is free
"""

import numpy as np

from .description import GROUND, Slide
from .massless import is_poor
from .tolerances import ORTHOGONAL, PARALLEL


def gather(description, report):
    """Replace chains of prismatic joints."""
    while (pair := _next(description, _joins)) is not None:
        _join(description, *pair)
    while (pair := _next(description, _is_planar)) is not None:
        first, link, second = pair
        second.kind, second.a, second.slides = "planar", first.a, first.slides
        for servo in first.servos:
            report.leave("actuator", servo.name)
        _drop(description, first, link)
        report.note(f"{first.name}, {second.name}: one planar joint")
    for joint in [joint for joint in description.joints if len(joint.slides) == 3]:
        _free(description, joint, report)


def _next(description, fits):
    """(joint, massless link, next joint), of which `fits` is true."""
    for link in description.links.values():
        joints = [joint for joint in description.joints if link.name in (joint.a, joint.b)]
        if len(joints) == 2 and is_poor(link) and link.mass <= 0.0:
            first, second = sorted(joints, key=lambda joint: joint.a == link.name)
            if first.b == link.name and second.a == link.name and fits(first, second):
                return first, link, second
    return None


def _joins(first, second):
    """Whether two joints slide along independent axes."""
    if {first.kind, second.kind} - {"prismatic", "translations"} or first.loop or second.loop:
        return False
    axes = np.array([slide.axis for slide in (*_slides(first), *_slides(second))])
    return len(axes) <= 3 and np.linalg.svd(axes, compute_uv=False)[-1] > PARALLEL


def _slides(joint):
    return joint.slides or [Slide(joint.name, joint.axis, joint.stiffness, joint.damping, joint.free, joint.load)]


def _join(description, first, link, second):
    slides = [*_slides(first), *_slides(second)]
    second.kind, second.a, second.slides = "translations", first.a, slides
    second.servos = first.servos + second.servos  # without counterpart there, so listed
    second.stiffness = second.damping = second.free = second.load = 0.0
    second.name = ", ".join(slide.name for slide in slides)
    _drop(description, first, link)


def _drop(description, joint, link):
    description.joints.remove(joint)
    del description.links[link.name]
    description.frames = {
        name: (owner, at) for name, (owner, at) in description.frames.items() if owner != link.name
    }  # fmt: skip


def _is_planar(first, second):
    """Whether a hinge is across two slides."""
    if first.kind != "translations" or len(first.slides) != 2 or second.kind != "revolute" or second.loop:
        return False
    return abs(abs(first.normal() @ second.axis) - 1.0) < ORTHOGONAL


def _free(description, joint, report):
    """Three slides, then a ball or three hinges, hold nothing."""
    chain = [joint]
    while chain[-1].b != GROUND and sum(3 if one.kind == "spherical" else 1 for one in chain[1:]) < 3:
        link = description.links[chain[-1].b]
        following = [one for one in description.joints if one.a == link.name]
        if not is_poor(link) or len(following) != 1 or following[0].kind not in ("revolute", "spherical"):
            return
        chain.append(following[0])
    axes = [one.axis for one in chain[1:] if one.kind == "revolute"]
    plain = not any(one.stiffness or one.damping or one.load for one in chain)
    plain = plain and not any(slide.stiffness or slide.damping or slide.load for slide in joint.slides)
    if not plain or (axes and (len(axes) != 3 or abs(np.linalg.det(axes)) < PARALLEL)):
        return
    for one in chain:
        report.note(f"{one.name}: the link {chain[-1].b} is free")
        if one is not chain[-1]:
            _drop(description, one, description.links[one.b])
    chain[-1].kind, chain[-1].a = "free", joint.a
