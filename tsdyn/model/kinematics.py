"""Kinematics of bodies, points and joints by handle or name: what states, solutions and laws of the state share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from ..calls import fitting_methods
from ..elements.bodies import rotation_matrix, transform_g
from ..errors import InvalidArgument
from ..validation import vector3
from . import handles as joint_motion

if TYPE_CHECKING:
    from ..hints import ArrayLike, Floats, Handles, ItemLike, PointMass


# Kinematics of bodies, points and joints at one instant or along a run: common to states and solutions.


class Anchor(NamedTuple):
    """An instant of the run in the same step at which the turns of the joint angles are known."""

    angles: np.ndarray  # (count,) or (k, count) there, correct to less than half a turn
    h: object = 0.0  # s since then, a number or (k,); may be negative
    levels: tuple = ()  # q, qd there, (n,) or (k, n); empty at the instant itself


Coordinate = TypeVar("Coordinate")  # of a joint: a number at one instant, an array along a run


@fitting_methods
class Kinematics(Generic[Coordinate]):
    """Mixed into classes with `handles`, q, qd and qdd, (n,) at an instant or (k, n) along a run, and an `anchor`.

    Bodies and joints are given by handle or name. Along a run every shape below has a leading k.
    """

    __slots__ = ()
    t: Any
    q: Floats
    qd: Floats
    qdd: Floats
    handles: Handles
    anchor: Anchor

    def position(self, body: PointMass | str, point: ArrayLike | None = None) -> Floats:
        """Position (3,) of the centroid, or of a point (3,) in the body frame; m, ground frame."""
        return self._place(body, point, 0)

    def velocity(self, body: PointMass | str, point: ArrayLike | None = None) -> Floats:
        """Velocity (3,) of the centroid, or of a point (3,) in the body frame; m/s, ground frame."""
        return self._place(body, point, 1)

    def acceleration(self, body: PointMass | str, point: ArrayLike | None = None) -> Floats:
        """Acceleration (3,) of the centroid, or of a point (3,) in the body frame; m/s^2, ground frame."""
        return self._place(body, point, 2)

    def orientation(self, body: PointMass | str) -> Floats:
        """Euler parameters (4,), body to ground, scalar first."""
        return self.q[..., self._parameters(body)]

    def rotation(self, body: PointMass | str) -> Floats:
        """Rotation matrix A(p) (3, 3), body to ground."""
        return rotation_matrix(self.orientation(body))

    def angular_velocity(self, body: PointMass | str) -> Floats:
        """Angular velocity (3,), rad/s, body frame."""
        return angular_velocity(self.orientation(body), self.qd[..., self._parameters(body)])

    def angular_acceleration(self, body: PointMass | str) -> Floats:
        """Angular acceleration (3,), rad/s^2, body frame."""
        return angular_velocity(self.orientation(body), self.qdd[..., self._parameters(body)])

    def angle(self, joint: ItemLike) -> Coordinate:
        """Angle of a joint, rad: of b relative to a about its axis (right-hand rule), counted over any number of turns.

        Zero as built, or when the references of the joint coincide. A run begins within half a turn of zero unless
        `scene.set`, a motor, a thread or the initial state determines the turn.

        Returns
        -------
        float, or ndarray (k,) along a run
            With a last axis for a joint of several angles: (2,) or (k, 2) for Universal, about axis_a and axis_b.

        Raises
        ------
        InvalidConstraint
            If the joint has no angle, or isn't in this scene.
        """
        row = self.handles.row(joint, "angle")
        return _one([self._counted(j, geometry) for j, geometry in enumerate(row.angles, row.first)])

    def angle_rate(self, joint: ItemLike) -> Coordinate:
        """Rate of the `angle` of a joint, rad/s."""
        return self._coordinate(joint, "angle", 1)

    def angle_acceleration(self, joint: ItemLike) -> Coordinate:
        """Second time derivative of the `angle` of a joint, rad/s^2."""
        return self._coordinate(joint, "angle", 2)

    def displacement(self, joint: ItemLike) -> Coordinate:
        """Displacement of a joint, m: of its point on b from that on a along the axis; a number, or (k,) along a run.

        Raises
        ------
        InvalidConstraint
            If the joint has no displacement, or isn't in this scene.
        """
        return self._coordinate(joint, "displacement", 0)

    def displacement_rate(self, joint: ItemLike) -> Coordinate:
        """Rate of the `displacement` of a joint, m/s."""
        return self._coordinate(joint, "displacement", 1)

    def displacement_acceleration(self, joint: ItemLike) -> Coordinate:
        """Second time derivative of the `displacement` of a joint, m/s^2."""
        return self._coordinate(joint, "displacement", 2)

    @property
    def angles(self) -> Floats:
        """All counted angles (count,), in the order of the joints."""
        counted = [self._counted(row.first + i, g) for row in self.handles.rows for i, g in enumerate(row.angles)]
        return np.stack(counted, axis=-1) if counted else np.zeros((*np.shape(self.q)[:-1], 0))

    def _coordinate(self, joint, kind, level):
        evaluate = getattr(joint_motion, kind)
        geometries = getattr(self.handles.row(joint, kind), f"{kind}s")
        return _one([evaluate(g, *self._motions(g), level) for g in geometries])

    def _counted(self, j, geometry):
        """Angle j, on the turn predicted from the anchor's angle and the rates at both instants."""
        bodies, anchor = self._motions(geometry), self.anchor
        near = anchor.angles[..., j]
        if anchor.levels:
            before = self.handles.motions(geometry, anchor.levels)
            rates = (joint_motion.angle(geometry, *pair, 1) for pair in (before, bodies))
            near = joint_motion.counted(joint_motion.angle(geometry, *before, 0), near) + 0.5 * anchor.h * sum(rates)
        return joint_motion.counted(joint_motion.angle(geometry, *bodies, 0), near)

    def _motions(self, geometry):
        return self.handles.motions(geometry, self._levels)

    @property
    def _levels(self):
        return self.q, self.qd, self.qdd

    def _place(self, body, point, level):
        """Position, velocity or acceleration of the centroid of a body, or of a point of it."""
        body, levels = self.handles.body(body), self._levels
        at, dimension = self.handles.where(body)
        if point is None:
            return levels[level][..., at : at + 3]
        s = vector3(point, f"{body.name}: point (m, body frame)", InvalidArgument)
        if dimension == 3 and s.any():
            raise InvalidArgument(f"{body.name}: a point mass has the point (0, 0, 0) only, got {point!r}.")
        return np.array(joint_motion.BodyMotion(at, dimension, levels).point(s.tolist(), level)).T

    def _parameters(self, body):
        """Return the slice of the Euler parameters of a body."""
        body = self.handles.body(body)
        body.orientation  # noqa: B018  a point mass says that it has none
        at, _ = self.handles.where(body)
        return slice(at + 3, at + 7)


def angular_velocity(p, pd):
    """omega' = 2 G(p) pd, shapes (..., 4) -> (..., 3); of pdd it gives the angular acceleration, as 2 Gd pd = 0."""
    return 2.0 * np.einsum("...ij,...j->...i", transform_g(p), pd)


def _one(values):
    return values[0] if len(values) == 1 else np.stack(values, axis=-1)
