"""Parallel axes: a direction of each body stay parallel; three displacements and one rotation stay free.

    f_a.b = 0,  g_a.b = 0     (1)  two Dot1; f, g, a a right-handed orthonormal frame of body a

The two rows are orthonormal in terms of small relative rotations. They hold with a and b opposed, too: a start there is
refused. Never singular.
"""

from ..plugins import Angle, Joint, Vector, across
from .dot1 import Dot1


class Parallel(Joint):
    """Keep a direction of one body parallel to a direction of another, both pointing the same way.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene.
    axis_a, axis_b : array_like (3,)
        The directions in the bodies' own frames; scaled to unit length.
    name : str, optional

    Raises
    ------
    InvalidConstraint
        If an axis is missing or zero, or a body is wrong.

    Notes
    -----
    Rows: axis[0], axis[1]. `Parallel.at(a, b, axis=)` takes one direction in the ground frame.
    """

    markers = (Vector("a"), Vector("b"))
    joint_coordinates = (Angle(),)

    def __init__(self, a, b, *, axis_a=None, axis_b=None, name=""):
        super().__init__(a, b, (axis_a, axis_b), name)

    def compose(self):
        """Eq. (1)."""
        for direction in across(self.axis_a):
            yield "axis", Dot1(self.a, self.b, axis_a=direction, axis_b=self.axis_b)

    def aligned(self):
        """The axes."""
        return ((self.axis_a, self.axis_b),)
