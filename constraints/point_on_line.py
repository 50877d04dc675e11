"""Point on line: a point of a stays on a line of b; one displacement and three rotations stay free.

    f_b.(x_a - x_b) = 0,  g_b.(x_a - x_b) = 0     (1)  two Dot2; f, g, b a right-handed orthonormal frame of body b

Never singular.
"""

from ..plugins import Displacement, Joint, Point, Vector, across
from .dot2 import Dot2


class PointOnLine(Joint):
    """Keep a point of one body on a line fixed to another.

    Parameters
    ----------
    a, b : Body or ground
        a carries the point, b the line.
    point_a : array_like (3,), m
        The point, in a's frame.
    point_b : array_like (3,), m
        A point of the line, in b's frame.
    axis_b : array_like (3,)
        The line's direction, in b's frame; scaled to unit length.
    name : str, optional

    Raises
    ------
    InvalidConstraint
        If the axis is missing or zero, or a point or body is wrong.

    Notes
    -----
    Rows: line[0], line[1]. `PointOnLine.at(a, b, point=, axis=)` takes the point and the direction in the ground frame.
    """

    markers = (Point("a"), Point("b"), Vector("b"))
    joint_coordinates = (Displacement("axis_b"),)

    def __init__(self, a, b, *, point_a=(0.0, 0.0, 0.0), point_b=(0.0, 0.0, 0.0), axis_b=None, name=""):
        super().__init__(a, b, (point_a, point_b, axis_b), name)

    def compose(self):
        """Eq. (1)."""
        for direction in across(self.axis_b):
            yield "line", Dot2(self.b, self.a, axis_a=direction, point_a=self.point_b, point_b=self.point_a)
