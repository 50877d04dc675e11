"""Planar joint: a face of each body in a common plane; two displacements and one rotation are free.

    f_a.b = 0,  g_a.b = 0    (1)  two rows, Parallel: a and b are the normals
    a.(x_b - x_a) = 0        (2)  Dot2

The rows also admit opposed normals; such a start is refused. Never singular.
"""

from ..plugins import Angle, Joint, Point, Vector
from .dot2 import Dot2
from .parallel import Parallel


class Planar(Joint):
    """Translation in a common plane and rotation about its normal: a planar joint.

    Notes
    -----
    The points lie in the plane, the axes are its normals. Rows: axis[0], axis[1], plane. `Planar.at(a, b, point=,
    axis=)` takes a point and the normal of the plane in the ground frame. A single point on a plane is a PlaneContact.

    Examples
    --------
    A plate slides over a table and spins on it:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> plate = scene.add_body(mass=1.0, inertia=(1, 1, 2), velocity=(1, 2, 0), angular_velocity=(0, 0, 1))
    >>> table = scene.add(ts.constraints.Planar.at(scene.ground, plate, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> state = ts.simulate(scene, (0, 2)).state
    >>> print(state.position(plate).round(6) + 0.0)
    [2. 4. 0.]
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"))
    joint_coordinates = (Angle(),)

    def compose(self):
        """Eqs. (1), (2)."""
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield "plane", Dot2(self.a, self.b, axis_a=self.axis_a, point_a=self.point_a, point_b=self.point_b)
