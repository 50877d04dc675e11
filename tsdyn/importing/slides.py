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
    joints = description.joints_by_link()
    for first, link, second in _pairs(description, joints, _joins):
        slides = [*_slides(first), *_slides(second)]
        second.kind, second.slides = "translations", slides
        second.servos = first.servos + second.servos  # without counterpart there, so listed
        second.stiffness = second.damping = second.free = second.load = 0.0
        second.name = ", ".join(slide.name for slide in slides)
        _drop(description, joints, first, link)
    for first, link, second in _pairs(description, joints, _is_planar):
        second.kind, second.slides = "planar", first.slides
        for servo in first.servos:
            report.leave("actuator", servo.name)
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
    return len(axes) <= 3 and np.linalg.svd(axes, compute_uv=False)[-1] > PARALLEL


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
    return abs(abs(first.normal() @ second.axis) - 1.0) < ORTHOGONAL


def _free(description, joints, joint, report):
    """Three slides, then a ball or three hinges, hold nothing."""
    chain = [joint]
    while chain[-1].b != GROUND and sum(3 if one.kind == "spherical" else 1 for one in chain[1:]) < 3:
        link = description.links[chain[-1].b]
        following = [one for one in joints[link.name] if one.a == link.name]
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
    for one in chain[:-1]:
        _drop(description, joints, one, description.links[one.b])
    chain[-1].kind = "free"
