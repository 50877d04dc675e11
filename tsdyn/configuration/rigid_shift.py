"""Rigid displacement of one part of a scene relative to the other, across the only joint between them.

A point x moves to c + R (x - c) + d, with R a rotation about the axis of the joint through c and d a translation along
its direction. Velocities v - v_F and omega - omega_F relative to the fixed body F are rotated by R.
"""

import numpy as np

from ..elements.bodies import IDENTITY, rotation_matrix
from ..maths.vectors import cross


class RigidShift:
    """Moves the bodies on one side of a joint; their velocities relative to the other side are preserved.

    Parameters
    ----------
    joint : joint
    stays, goes : Body or ground
        Its two bodies.
    bodies : list of Body
        The moving bodies: `goes`, and all bodies beyond it.
    """

    def __init__(self, joint, stays, goes, bodies):
        self.joint, self.stays, self.goes, self.bodies = joint, stays, goes, bodies

    @classmethod
    def of(cls, scene, joint):
        """Return the shift across a joint; None if the joint is in a loop."""
        for stays, goes in ((joint.a, joint.b), (joint.b, joint.a)):
            found = _beyond(scene, stays, goes)
            if not any(body is stays or body is scene.ground for body in found):
                return cls(joint, stays, goes, found)
        return None

    def gain(self, goals):
        """Set the rates of the goals' coordinates."""
        for goal in goals:
            axis, centre, sense = self._line(goal)
            gain = sense * (goal.new_rate - goal.rate) * axis
            for body in self.bodies:
                if not goal.turns:
                    body.velocity = body.velocity + gain
                    continue
                body.velocity = body.velocity + np.cross(gain, body.position - centre)
                if body.dimension == 7:
                    body.angular_velocity = body.angular_velocity + rotation_matrix(body.orientation).T @ gain

    def move(self, goals, share):
        """Move by a share of the goals' increments."""
        for goal in goals:
            axis, centre, sense = self._line(goal)
            way = sense * share * (goal.new_value - goal.value)
            turn, travel = (way, 0.0 * axis) if goal.turns else (0.0, way * axis)
            half = np.append(np.cos(0.5 * turn), np.sin(0.5 * turn) * axis)
            R = rotation_matrix(half)
            r, v, omega = _motion(self.stays)
            for body in self.bodies:
                x, xd, w = _motion(body)
                place = centre + R @ (x - centre) + travel
                body.velocity = v + np.cross(omega, place - r) + R @ (xd - v - np.cross(omega, x - r))
                body.position = place
                if body.dimension == 7:
                    body.orientation = _product(half, body.orientation)
                    body.angular_velocity = rotation_matrix(body.orientation).T @ (omega + R @ (w - omega))

    def _line(self, goal):
        """Return the axis of a goal's coordinate (ground frame), a point on it, and the sign for the moving side."""
        geometry, point = goal.geometry, "point_a" if self.goes is self.joint.a else "point_b"
        direction = cross(geometry.f, geometry.g) if goal.turns else geometry.e
        axis = rotation_matrix(_orientation(geometry.own)) @ direction
        s = getattr(self.joint, point, np.zeros(3))
        centre = self.goes.position + rotation_matrix(_orientation(self.goes)) @ s
        return axis, centre, 1.0 if self.goes is geometry.other else -1.0


def _beyond(scene, stays, goes):
    """Return the bodies on one side when the links between two are cut; in a loop, the other is among them."""
    links = {}
    for constraint in scene.constraints:
        a, b = constraint.a, constraint.b
        if b is not None and {a, b} != {stays, goes}:
            links.setdefault(a, []).append(b)
            links.setdefault(b, []).append(a)
    found, waiting = {goes}, [goes]
    while waiting:
        for body in links.get(waiting.pop(), ()):
            if body not in found:
                found.add(body)
                waiting.append(body)
    return list(found)


def _orientation(body):
    return IDENTITY if body.dimension == 3 else body.orientation


def _motion(body):
    """Position, velocity and angular velocity of a body at the start, ground frame."""
    if body.dimension == 0:
        return np.zeros((3, 3))
    omega = rotation_matrix(body.orientation) @ body.angular_velocity if body.dimension == 7 else np.zeros(3)
    return body.position, body.velocity, omega


def _product(p, o):
    """The Euler parameters of A(p) A(o)."""
    return np.append(p[0] * o[0] - p[1:] @ o[1:], p[0] * o[1:] + o[0] * p[1:] + np.cross(p[1:], o[1:]))
