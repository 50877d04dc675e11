"""Universal joint (Hooke, Cardan): a common point and a cross of two arms; two rotations are free.

    x_a - x_b = 0     (1)  three rows, Spherical
    a.b = 0           (2)  Dot1: a is the arm of the cross that turns in body a, b the one that turns in body b

Never singular. Shafts at an angle beta have equal mean speeds only: w_b / w_a = cos(beta) / (1 - sin(beta)^2
sin(theta)^2), with theta the rotation of shaft a from where its arm is perpendicular to both shafts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..plugins import Angle, InvalidConstraint, Joint, Placing, Point, Vector, in_frame
from .dot1 import Dot1
from .spherical import Spherical

if TYPE_CHECKING:
    from ..hints import BodyLike

ALONG = 1e-6  # sine of an angle: below it the arm would be along the shaft


class Universal(Joint):
    """Rotation about two perpendicular axes, one fixed in each body: a universal (Hooke, Cardan) joint.

    Parameters
    ----------
    axis_a, axis_b : array_like (3,)
        The arm of the cross that is fixed in each body, body frame; scaled to unit length. Both are perpendicular to
        the shafts and to each other.

    Notes
    -----
    The points are where the axes meet. Rows: point[0] to point[2], cross. `Universal.at(a, b, point=, axis=, axis_b=)`
    takes them in the ground frame.

    Examples
    --------
    The second axis of the cross follows from the centroid of the second shaft:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> one = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    >>> other = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0))
    >>> cross = scene.add(ts.constraints.Universal.at(one, other, point=(0.5, 0, 0), axis=(0, 1, 0)))
    >>> print(cross, cross.axis_b + 0.0)
    <Universal(body1, body2): 4 rows> [ 0.  0. -1.]
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"))
    joint_coordinates = (Angle(direction="axis_b"), Angle("axis_b", direction="axis_a"))

    @Placing
    def at(cls, a: BodyLike, b: BodyLike | None = None, **arguments: Any) -> Self:
        """Make the joint from its point and axes in the ground frame, in the present poses.

        Parameters
        ----------
        point : array_like (3,), m
        axis : array_like (3,)
            The axis fixed in a.
        axis_b : array_like (3,), optional
            The axis fixed in b; None takes the normal of `axis` and the line from the point to the centroid of b (of a,
            if b is the ground), which is right for a shaft with its centroid on its axis.
        """
        axis, axis_b = arguments.pop("axis", None), arguments.pop("axis_b", None)
        axis = arguments.pop("axis_a", axis)
        joint = super().at(a, b, axis_a=axis, axis_b=axis if axis_b is None else axis_b, **arguments)
        if axis_b is None:
            if arguments.get("point") is None:
                raise InvalidConstraint(f"{joint.name}: axis_b follows from point and axis; give point, or axis_b.")
            body, marker = b if b.dimension else a, joint.markers[3]
            shaft = body.position - arguments["point"]
            arm = np.cross(axis, shaft)
            if not np.linalg.norm(arm) > ALONG * np.linalg.norm(axis) * np.linalg.norm(shaft):
                raise InvalidConstraint(
                    f"{joint.name}: the axis fixed in b doesn't follow from the centroid of {body.name!r}, which is on "
                    "the line through the point along axis; give axis_b, at a right angle to axis."
                )
            joint.axis_b = in_frame(b, marker, arm)
        return joint

    def compose(self):
        """Eqs. (1), (2)."""
        yield "point", Spherical(self.a, self.b, point_a=self.point_a, point_b=self.point_b)
        yield "cross", Dot1(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
