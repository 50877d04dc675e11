"""Friction of a plane contact (a point sliding on a plane), in proportion to the reaction of the contact.

    n      normal, v = velocity of a's point over b, less its part along n
    N      = N_0 + |n.F|                                                 (1)
    force  = -mu(|v|) N v / |v|     on a at its point, the opposite on b (2)
           = -mu(|v|) N e           of the exact law, e of friction.heading in the plane
    dissipation = mu(|v|) N |v|                                          (3)

F is the force that the contact exerts; mu is given by friction.coefficient.
"""

import numpy as np

from ..constraints.plane_contact import PlaneContact
from ..plugins import (
    HEADING_ROWS,
    PLANE,
    SLIP,
    TANGENTIAL_ROWS,
    Force,
    JointFriction,
    Point,
    Turn,
    Vector,
    act,
    act_series,
    coefficient,
    coefficient_series,
    dot,
    heading,
    heading_series,
    magnitude,
    scaled,
    sliding,
    sliding_series,
    slip,
    slip_series,
    tangential,
    tangential_series,
)

WAY = -1 - PLANE.count  # in par, the direction near which it slides


class ContactFriction(JointFriction, Force):
    """Coulomb friction with Stribeck effect in a plane contact, proportional to the contact reaction.

    The contact is bilateral: friction acts under tension, too.

    Parameters
    ----------
    joint : PlaneContact
        Of the scene.

    Examples
    --------
    A block on a table, 10 N of normal load, slows down with 2 m/s^2:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> block = scene.add_point_mass(mass=1.0, velocity=(3, 0, 0))
    >>> table = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    >>> friction = scene.add(ts.forces.ContactFriction(table, kinetic=0.2))
    >>> print(f"{ts.simulate(scene, (0, 1)).state.velocity(block)[0]:.3f} m/s")
    1.000 m/s
    """

    joints = (PlaneContact,)
    markers = (Point("a"), Turn("a"), Point("b"), Turn("b"), Vector("b", "normal_b"))
    slots = 30 + HEADING_ROWS + TANGENTIAL_ROWS
    place = PLANE

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (2)."""
        v0, v1, v2 = slip(x, xd)
        off = x[12] * v0 + x[13] * v1 + x[14] * v2
        v0, v1, v2 = v0 - off * x[12], v1 - off * x[13], v2 - off * x[14]
        if par[3] == 0.0:
            f = -par[-1] * sliding(v0 * v0 + v1 * v1 + v2 * v2, par)
            v0, v1, v2 = tangential(x[12], x[13], x[14], *heading(v0, v1, v2, par[WAY : WAY + 3], SLIP))
        else:
            f = -par[-1] * coefficient(v0 * v0 + v1 * v1 + v2 * v2, par)
        act(x, f * v0, f * v1, f * v2, 0.0, 0.0, 0.0, out)

    @staticmethod
    def normal_load(x, f, par):
        """Eq. (1)."""
        along = x[12] * f[0] + x[13] * f[1] + x[14] * f[2]
        return par[4] + np.sqrt(along * along)

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (2) for a load of one; rows of x_a - x_b, omega_b, slip, n, n.v, v, v^2, five, -mu / v, F."""
        slip_series(x, xd, k, s)
        for i in range(3):
            s[9 + i, k] = x[12 + i]
        s[12, k] = dot(s, 9, 6, k)
        off = scaled(s, 9, 12, k)
        for i in range(3):
            s[13 + i, k] = s[6 + i, k] - off[i]
        s[16, k] = dot(s, 13, 13, k)
        way = 13
        if par[3] == 0.0:
            s[22, k], way = -sliding_series(s, 16, 17, par, k), 19
            u0, u1, u2 = heading_series(s, 13, 30, par[WAY : WAY + 3], SLIP, k)
            s[19, k], s[20, k], s[21, k] = tangential_series(s, 9, u0, u1, u2, 30 + HEADING_ROWS, k)
        else:
            s[22, k] = -coefficient_series(s, 16, 17, par, k)
        s[23, k], s[24, k], s[25, k] = scaled(s, way, 22, k)
        act_series(s, 23, k, out)

    @staticmethod
    def normal_series(x, f, par, k, s):
        """Of Eq. (1)."""
        for i in range(3):
            s[9 + i, k], s[26 + i, k] = x[12 + i], f[i]
        s[29, k] = dot(s, 9, 26, k)
        return magnitude(s, 29, k, abs(s[29, 0]) > 0.0) + (par[4] if k == 0 else 0.0)

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (3)."""
        v0, v1, v2 = slip(x, xd)
        off = x[12] * v0 + x[13] * v1 + x[14] * v2
        v0, v1, v2 = v0 - off * x[12], v1 - off * x[13], v2 - off * x[14]
        vv = v0 * v0 + v1 * v1 + v2 * v2
        if par[3] == 0.0:
            e0, e1, e2 = tangential(x[12], x[13], x[14], *heading(v0, v1, v2, par[WAY : WAY + 3], SLIP))
            return par[-1] * sliding(vv, par) * (e0 * v0 + e1 * v1 + e2 * v2)
        return par[-1] * coefficient(vv, par) * vv
