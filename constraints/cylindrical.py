"""Cylindrical joint: a common axis; one rotation about it and one displacement along it stay free.

    f_a.b = 0,  g_a.b = 0                           (1)  two rows, Parallel
    f_a.(x_b - x_a) = 0,  g_a.(x_b - x_a) = 0       (2)  two rows, PointOnLine: x_b on the axis of a

Holds with the axes opposed, too: a start there is refused. Never singular.
"""

from ..plugins import Angle, Displacement, Joint, Point, Vector
from .parallel import Parallel
from .point_on_line import PointOnLine


class Cylindrical(Joint):
    """Let one body turn about an axis of another and slide along it.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene.
    point_a, point_b : array_like (3,), m
        A point of the axis on each body, in its own frame.
    axis_a, axis_b : array_like (3,)
        The axis, in the bodies' own frames; scaled to unit length.
    name : str, optional

    Raises
    ------
    InvalidConstraint
        If an axis is missing or zero, or a point or body is wrong.

    Notes
    -----
    Rows: axis[0], axis[1], line[0], line[1]. `Cylindrical.at(a, b, point=, axis=)` takes a point and the direction of
    the axis in the ground frame.
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"))
    joint_coordinates = (Angle(), Displacement())

    def __init__(self, a, b, *, point_a=(0.0, 0.0, 0.0), point_b=(0.0, 0.0, 0.0), axis_a=None, axis_b=None, name=""):
        super().__init__(a, b, (point_a, point_b, axis_a, axis_b), name)

    def compose(self):
        """Eqs. (1), (2)."""
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield "line", PointOnLine(self.b, self.a, point_a=self.point_b, point_b=self.point_a, axis_b=self.axis_a)
