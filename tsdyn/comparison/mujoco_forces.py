"""Forces of a scene in MuJoCo: springs as tendons, springs and dampers of joints, constant loads."""

import numpy as np

from ..elements.bodies import rotation_matrix
from ..elements.joint_coordinates import angles
from .loads import is_constant

ALONG = 1e-9  # sine between the axis of a spring and that of its joint


def add_forces(made):
    """Add the forces of a `MujocoScene`; return the constant loads: (body, force, torque)."""
    loads = []
    for item in made.scene.forces:
        kind = item._kind()
        if kind == "Spring":
            _spring(made, item)
        elif kind == "TorsionalSpring":
            joint, sign = _hinge_of(made, item)
            joint.stiffness = _first(joint.stiffness, item.stiffness)
            joint.damping = _first(joint.damping, item.damping)
            if item.stiffness:
                joint.springref = sign * (item.free_angle - angle_now(item))
        elif kind == "ViscousFriction":
            joint = _only_joint(made, item)
            joint.damping = _first(joint.damping, item.damping or item.torsional_damping)
        else:
            loads.append(_load(item, kind))
    return loads


def _first(before, value):
    """A coefficient, or the first of several, raised by a value."""
    if np.ndim(before) == 0:
        return float(before) + value
    return [float(before[0]) + value, *list(before)[1:]]


def _spring(made, item):
    tendon = made.spec.add_tendon(name=item.name, springlength=(item.free_length, item.free_length))
    tendon.stiffness, tendon.damping = (
        _first(getattr(tendon, name), getattr(item, name)) for name in ("stiffness", "damping")
    )
    for side, body, place in zip("ab", (item.a, item.b), item.coordinates, strict=True):
        tendon.wrap_site(made.site(body, place, f"{item.name} {side}").name)


def _load(item, kind):
    zero = np.zeros(3)
    if kind == "Torque":
        return item.a, zero, np.asarray(item.torque, float)
    return item.a, np.asarray(item.force, float), zero


def angle_now(spring):
    """The angle of a torsional spring in the present poses."""
    found = angles(spring)[0]
    A, B = (rotation_matrix(np.asarray(body.orientation)) for body in (found.own, found.other))
    v = A.T @ B @ np.array(found.h)
    return float(np.arctan2(np.dot(found.g, v), np.dot(found.f, v)))


def _link_between(links, item):
    """The link of the tree whose joint is between the two bodies of an item, or None."""
    return next((link for link in links if {link.body, link.parent} == {item.a, item.b}), None)


def _hinge_of(made, item):
    """The hinge that a torsional spring acts on; 1 if it turns b, -1 if it turns a."""
    link = _link_between(made.links, item)
    own = item.axis_b if link.body is item.b else item.axis_a
    for move, joint in zip(link.moves, made.joints[link.body], strict=True):
        if move.kind == "hinge" and np.linalg.norm(np.cross(move.axis, own)) < ALONG:
            along = np.sign(move.axis @ own)
            return joint, along if link.body is item.b else -along
    return None


def _only_joint(made, item):
    link = _link_between(made.links, item)
    return made.joints[link.body][0]


def refused(scene, links):
    """Forces that have no counterpart, with the reason."""
    return [(item, reason) for item in scene.forces if (reason := _reason(item, links))]


def _reason(item, links):
    kind = item._kind()
    if kind in ("Torque", "PointForce"):
        given = getattr(item, "torque" if kind == "Torque" else "force")
        if item.frame != "ground" or not is_constant(given):
            return f"{kind} must be constant, in ground axes"
        return "PointForce must act at the centroid" if kind == "PointForce" and np.any(item.coordinates[0]) else ""
    if kind in ("Spring", "TorsionalSpring") and not (is_constant(item.actuator) and not item.actuator):
        return "an actuator has no counterpart"
    if kind == "Spring":
        return ""
    link = _link_between(links, item) if kind in ("TorsionalSpring", "ViscousFriction") else None
    if link is None:
        return f"{kind} has no counterpart" + (
            " but at a joint of the tree" if kind in ("TorsionalSpring", "ViscousFriction") else ""
        )
    if kind == "TorsionalSpring":
        own = item.axis_b if link.body is item.b else item.axis_a
        fits = any(move.kind == "hinge" and np.linalg.norm(np.cross(move.axis, own)) < ALONG for move in link.moves)
        return "" if fits else "no hinge of the tree is along its axis"
    kinds = [move.kind for move in link.moves]
    fits = (kinds in (["hinge"], ["ball"]) and not item.damping) or (kinds == ["slide"] and item.damping)
    return "" if fits else "it damps more than one joint"
