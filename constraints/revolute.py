"""Revolute joint: a common point and a common axis; one rotation stays free.

    x_a - x_b = 0            (1)  three rows, Spherical
    f_a.b = 0,  g_a.b = 0    (2)  two rows, Parallel

Holds with the axes opposed, too: a start there is refused. Never singular.
"""

from ..plugins import Angle, Joint, Point, Vector
from .parallel import Parallel
from .spherical import Spherical


class Revolute(Joint):
    """Let one body turn about an axis of another, and do nothing else: a hinge.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene.
    point_a, point_b : array_like (3,), m
        A point of the axis, in the bodies' own frames.
    axis_a, axis_b : array_like (3,)
        The axis, in the bodies' own frames; scaled to unit length.
    name : str, optional

    Raises
    ------
    InvalidConstraint
        If an axis is missing or zero, or a point or body is wrong.

    Notes
    -----
    Rows: point[0] to point[2], axis[0], axis[1]. `Revolute.at(a, b, point=, axis=)` takes the point and the axis in the
    ground frame, the bodies being where they stand now.
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"))
    joint_coordinates = (Angle(),)

    def __init__(self, a, b, *, point_a=(0.0, 0.0, 0.0), point_b=(0.0, 0.0, 0.0), axis_a=None, axis_b=None, name=""):
        super().__init__(a, b, (point_a, point_b, axis_a, axis_b), name)

    def compose(self):
        """Eqs. (1), (2)."""
        yield "point", Spherical(self.a, self.b, point_a=self.point_a, point_b=self.point_b)
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
