"""Cylindrical joint: a common axis; rotation about it and displacement along it are free.

    f_a.b = 0,  g_a.b = 0                           (1)  two rows, Parallel
    f_a.(x_b - x_a) = 0,  g_a.(x_b - x_a) = 0       (2)  two rows, PointOnLine: x_b on the axis of a

The rows also admit opposed axes; such a start is refused. Never singular.
"""

from ..plugins import Angle, Displacement, Joint, Point, Vector
from .parallel import Parallel
from .point_on_line import PointOnLine


class Cylindrical(Joint):
    """Rotation about a common axis and translation along it: a cylindrical joint.

    Notes
    -----
    The points lie on the axis. Rows: axis[0], axis[1], line[0], line[1]. `Cylindrical.at(a, b, point=, axis=)` takes a
    point and the direction of the axis in the ground frame.

    Examples
    --------
    A sleeve spins on a vertical shaft and falls along it:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> sleeve = scene.add_body(mass=1.0, inertia=(1, 1, 1), angular_velocity=(0, 0, 3))
    >>> joint = scene.add(ts.constraints.Cylindrical.at(scene.ground, sleeve, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> state = ts.simulate(scene, (0, 1)).state
    >>> print(f"{state.angle(joint):.3f} rad, {state.displacement(joint):.3f} m")
    3.000 rad, -5.000 m
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"))
    joint_coordinates = (Angle(), Displacement())

    def compose(self):
        """Eqs. (1), (2)."""
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield "line", PointOnLine(self.b, self.a, point_a=self.point_b, point_b=self.point_a, axis_b=self.axis_a)
