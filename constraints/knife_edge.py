"""Knife edge: a skate, or a wheel seen as a blade, on a plane: no velocity of the contact point across the blade.

    rate  of Blade: the velocity of the point relative to b, within the plane, along axis_a     (1)  [m/s]

The row is on velocities and follows from no row on positions: with it the positions keep their degrees of freedom, and
the velocities lose one. It keeps no height; PlaneContact does. Singular if axis_a is along the normal.
"""

from ..plugins import Joint, Point, Vector, across
from .blade import Blade


class KnifeEdge(Joint):
    """No velocity of a point across a blade, within a plane of another body: a skate on ice.

    Notes
    -----
    The point point_a of body a is on the blade, axis_a is the direction across it, normal_b the normal of the plane,
    at any height. One row: across. It takes a degree of freedom from the velocities, none from the positions. The
    velocity is that relative to b, so the plane may move.

    Examples
    --------
    A skate that turns, on a slope down x, is back at its height after half a turn and has gone sideways by
    pi g / (2 w^2):

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(5, 0, 0))
    >>> skate = scene.add_body(mass=1.0, inertia=(1, 1, 1), angular_velocity=(0, 0, 1))
    >>> edge = scene.add(ts.constraints.KnifeEdge(skate, scene.ground, axis_a=(0, 1, 0), normal_b=(0, 0, 1)))
    >>> solution = ts.simulate(scene, (0, np.pi))
    >>> print(solution.position(skate)[-1].round(3) + 0.0)
    [0.    7.854 0.   ]
    """

    markers = (Point("a"), Vector("a"), Vector("b", "normal_b"))

    def compose(self):
        """Eq. (1)."""
        along, beside = across(self.normal_b)
        places = {"point_a": self.point_a, "axis_a": self.axis_a}
        yield "across", Blade(self.a, self.b, **places, along_b=along, across_b=beside)
