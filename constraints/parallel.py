"""Parallel axes: one direction of each body; three displacements and one rotation are free.

    f_a.b = 0,  g_a.b = 0     (1)  two Dot1; f, g, a a right-handed orthonormal frame of body a

The two rows are orthonormal in terms of small relative rotations. They also admit a and b opposed; such a start is
refused. Never singular.
"""

from ..plugins import Angle, Joint, Vector, across
from .dot1 import Dot1


class Parallel(Joint):
    """Directions of two bodies parallel, with the same sense.

    Notes
    -----
    Rows: axis[0], axis[1]. `Parallel.at(a, b, axis=)` takes one direction in the ground frame.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> disc = scene.add_body(mass=1.0, inertia=(1, 1, 2), angular_velocity=(0, 0, 4))
    >>> upright = scene.add(ts.constraints.Parallel.at(scene.ground, disc, axis=(0, 0, 1)))
    >>> state = ts.simulate(scene, (0, 2)).state
    >>> print(f"{state.angle(upright):.4f} rad")
    8.0000 rad
    """

    markers = (Vector("a"), Vector("b"))
    joint_coordinates = (Angle(),)

    def compose(self):
        """Eq. (1)."""
        for direction in across(self.axis_a):
            yield "axis", Dot1(self.a, self.b, axis_a=direction, axis_b=self.axis_b)

    def aligned(self):
        """The axes."""
        return ((self.axis_a, self.axis_b),)
