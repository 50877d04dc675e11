"""Translational joint: displacement along one axis is free.

    f_a.b = 0,  g_a.b = 0                           (1)  two rows, Parallel
    f_a.g_b = 0                                     (2)  Dot1: no rotation about the axis
    f_a.(x_b - x_a) = 0,  g_a.(x_b - x_a) = 0       (3)  two rows, PointOnLine: x_b on the axis of a

f_a and f_b are the references, made perpendicular to the axes; g = axis x f. The rows also admit half a turn; such a
start is refused. Never singular.
"""

from ..plugins import Displacement, FramedJoint
from .dot1 import Dot1
from .parallel import Parallel
from .point_on_line import PointOnLine


class Translational(FramedJoint):
    """Translation along a common axis without rotation: a prismatic joint, or slider.

    Parameters
    ----------
    reference_a, reference_b : array_like (3,), optional
        Directions not parallel to the axis, in the body frames, which the joint keeps parallel; missing directions
        follow from the present poses.

    Notes
    -----
    The points lie on the axis. Rows: axis[0], axis[1], turn, line[0], line[1]. `Translational.at(a, b, point=, axis=)`
    takes a point and the direction of the axis in the ground frame.

    Examples
    --------
    A block slides down a guide at 45 degrees:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> block = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    >>> guide = scene.add(ts.constraints.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, -1)))
    >>> state = ts.simulate(scene, (0, 1)).state
    >>> print(f"{state.displacement(guide):.4f} m, {state.displacement_rate(guide):.4f} m/s")
    3.5355 m, 7.0711 m/s
    """

    joint_coordinates = (Displacement(),)

    def compose(self):
        """Eqs. (1) to (3)."""
        (f_a, _), (_, g_b) = self.frames
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield "turn", Dot1(self.a, self.b, axis_a=f_a, axis_b=g_b)
        yield "line", PointOnLine(self.b, self.a, point_a=self.point_b, point_b=self.point_a, axis_b=self.axis_a)
