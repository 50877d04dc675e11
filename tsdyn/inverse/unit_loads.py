"""Generalised forces of unit loads along a motion q (k, n): each as columns (c,) of q and values (k, c).

A force F at a point s is F on r and (A s)_p^T F on p, a torque n is 2 E^T n on p, both in the ground frame.
"""

import numpy as np

from ..elements.bodies import IDENTITY, rotation_matrix
from ..statics.variations import arm_by_parameters, transform_e


class UnitLoads:
    """Unit loads on the bodies and joints of `handles` at positions q (k, n)."""

    def __init__(self, handles, q):
        self.handles, self.q = handles, q

    def angle(self, geometry):
        """A torque along an angle: on the other body about the axis f x g, the opposite on the own one."""
        axis = self._direction(geometry.own, np.cross(geometry.f, geometry.g))
        return _joined(self.torque(geometry.other, axis), self.torque(geometry.own, -axis))

    def displacement(self, geometry):
        """A force along a displacement: on the other body's point, the opposite on the own one's, and its moment."""
        own, other = geometry.own, geometry.other
        e = self._direction(own, geometry.e)
        ends = self._position(own, geometry.s_own), self._position(other, geometry.s_other)
        moment = self.torque(own, np.cross(e, ends[1] - ends[0]))
        return _joined(self.force(other, geometry.s_other, e), self.force(own, geometry.s_own, -e), moment)

    def tension(self, spring):
        """A pull between the points of a spring."""
        (s_a, s_b), (a, b) = spring.coordinates, (spring.a, spring.b)
        d = self._position(b, s_b) - self._position(a, s_a)
        d = d / np.linalg.norm(d, axis=1)[:, None]
        return _joined(self.force(a, s_a, d), self.force(b, s_b, -d))

    def component(self, item, e):
        """A force or torque of PointForce or Torque along an axis e of its frame; torques have no point."""
        e = np.tile(e, (len(self.q), 1)) if item.frame == "ground" else self._direction(item.a, e)
        point = getattr(item, "point_a", None)
        return self.torque(item.a, e) if point is None else self.force(item.a, point, e)

    def force(self, body, s, F):
        """F (k, 3) at a point s."""
        at, dimension = self.handles.where(body)
        arm = arm_by_parameters(self._parameters(body), np.asarray(s, float))
        values = np.concatenate((F, np.einsum("ki,kij->kj", F, arm)), axis=1)
        return np.arange(at, at + dimension), values[:, :dimension]

    def torque(self, body, n):
        """A torque (k, 3)."""
        at, dimension = self.handles.where(body)
        if dimension != 7:
            return np.zeros(0, int), np.zeros((len(n), 0))
        return np.arange(at + 3, at + 7), 2.0 * np.einsum("ki,kij->kj", n, transform_e(self._parameters(body)))

    def _parameters(self, body):
        at, dimension = self.handles.where(body)
        return self.q[:, at + 3 : at + 7] if dimension == 7 else np.tile(IDENTITY, (len(self.q), 1))

    def _direction(self, body, s):
        return rotation_matrix(self._parameters(body)) @ np.asarray(s, float)

    def _position(self, body, s):
        at, dimension = self.handles.where(body)
        if dimension == 3:
            return self.q[:, at : at + 3]
        return self._direction(body, s) + (self.q[:, at : at + 3] if dimension else 0.0)


def _joined(*loads):
    columns, values = zip(*loads, strict=True)
    return np.concatenate(columns), np.concatenate(values, axis=1)
