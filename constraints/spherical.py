"""Spherical joint: a point of each body coincides.

    Phi   = x_a - x_b         (1)  [m], 3 rows, ground frame
    Phi_x = [ I, -I ]         (2)
    gamma = 0                 (3)  the acceleration of the markers is added by the core

Never singular by itself.
"""

from ..plugins import Point, Primitive


class Spherical(Primitive):
    """Coincident points of two bodies: a ball joint; three rotations are free.

    Notes
    -----
    The force on b is the multiplier itself, in the ground frame: -Phi_r^T lam = lam.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> pendulum = scene.add_body(mass=2.0, inertia=(1, 1, 1), position=(0, 0, -1))
    >>> pivot = scene.add(ts.constraints.Spherical(pendulum, scene.ground, point_a=(0, 0, 1)))
    >>> force, torque = ts.simulate(scene, (0, 1)).reaction(pivot)
    >>> print(f"{force[0, 2]:.3f} N")
    20.000 N
    """

    rows = 3
    markers = (Point("a"), Point("b"))

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        for i in range(3):
            out[i] = x[i] - x[3 + i]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        for i in range(3):
            out[i, i] = 1.0
            out[i, 3 + i] = -1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (3)."""
        for i in range(3):
            out[i] = 0.0

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2)."""
        if k == 0:
            for i in range(3):
                out[i, i] = 1.0
                out[i, 3 + i] = -1.0
