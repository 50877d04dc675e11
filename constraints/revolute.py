"""Revolute joint: a common point and a common axis; one rotation is free.

    x_a - x_b = 0            (1)  three rows, Spherical
    f_a.b = 0,  g_a.b = 0    (2)  two rows, Parallel

The rows also admit opposed axes; such a start is refused. Never singular.
"""

from ..plugins import Angle, Joint, Point, Vector
from .parallel import Parallel
from .spherical import Spherical


class Revolute(Joint):
    """Rotation about a common axis: a revolute joint, or hinge.

    Notes
    -----
    The points lie on the axis. Rows: point[0] to point[2], axis[0], axis[1]. `Revolute.at(a, b, point=, axis=)` takes
    a point and the direction of the axis in the ground frame, in the present poses.

    Examples
    --------
    A bar of 1 m, released from the horizontal:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> bar = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0)))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(f"{solution.angle(hinge)[-1]:.6f} rad")
    3.133418 rad
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"))
    joint_coordinates = (Angle(),)

    def compose(self):
        """Eqs. (1), (2)."""
        yield "point", Spherical(self.a, self.b, point_a=self.point_a, point_b=self.point_b)
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
