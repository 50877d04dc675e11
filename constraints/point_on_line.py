"""Point on line: a point of a stays on a line of b; one displacement and three rotations are free.

    f_b.(x_a - x_b) = 0,  g_b.(x_a - x_b) = 0     (1)  two Dot2; f, g, b a right-handed orthonormal frame of body b

Never singular.
"""

from ..plugins import Displacement, Joint, Point, Vector, across
from .dot2 import Dot2


class PointOnLine(Joint):
    """A point of one body on a line fixed to another.

    Notes
    -----
    Body a carries the point point_a, b the line through point_b along axis_b. Rows: line[0], line[1].
    `PointOnLine.at(a, b, point=, axis=)` takes the point and the direction in the ground frame.

    Examples
    --------
    A bead on a straight wire at 45 degrees:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bead = scene.add_point_mass(mass=1.0)
    >>> wire = scene.add(ts.constraints.PointOnLine(bead, scene.ground, axis_b=(1, 0, -1)))
    >>> state = ts.simulate(scene, (0, 1)).state
    >>> print(state.position(bead).round(6) + 0.0)
    [ 2.5  0.  -2.5]
    """

    markers = (Point("a"), Point("b"), Vector("b"))
    joint_coordinates = (Displacement("axis_b"),)

    def compose(self):
        """Eq. (1)."""
        for direction in across(self.axis_b):
            yield "line", Dot2(self.b, self.a, axis_a=direction, point_a=self.point_b, point_b=self.point_a)
