"""Rows of rates: an angle or a displacement between two bodies doesn't change.

    E = f.h,  F = g.h                       f, g of body a, unit vectors across each other; h of body b
    A xd  = E (gd.h + g.hd) - F (fd.h + f.hd)            (1)  [rad/s]: the rate of atan2(F, E), where E^2 + F^2 = 1
    A     = [ -F h^T, E h^T, E g^T - F f^T ]             (2)  for (f, g, h)
    gamma = 2 E gd.hd - 2 F fd.hd                        (3)

    A xd  = e.(xd_b - xd_a) + ed.d,  d = x_b - x_a       (4)  [m/s]: the rate of e.d
    A     = [ -e^T, e^T, d^T ]                           (5)  for (x_a, x_b, e)
    gamma = 2 ed.dd                                      (6)

(1) is singular where h is along the axis, which a joint keeps it from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Point, Primitive, Vector, dot, scaled

if TYPE_CHECKING:
    from ..hints import BodyLike


class AngleRate(Primitive):
    """The angle of a direction of b about an axis of a, across which two directions of a are, doesn't change.

    `Ratchet` is the joint that uses it.

    Parameters
    ----------
    zero_a, quarter_a : array_like (3,)
        Directions of a at which the angle is zero, and a quarter of a turn; scaled to unit length.
    hand_b : array_like (3,)
        The direction of b.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> arm = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    >>> _ = scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> given = {"zero_a": (1, 0, 0), "quarter_a": (0, 1, 0), "hand_b": (1, 0, 0)}
    >>> scene.add(ts.constraints.AngleRate(scene.ground, arm, **given))
    <AngleRate 'AngleRate(ground, body1)'>
    >>> scene.mobility().degrees_of_freedom
    0
    """

    rate_rows, anywhere = 1, True
    markers = (Vector("a", "zero_a"), Vector("a", "quarter_a"), Vector("b", "hand_b"))
    slots = 11

    def __init__(self, a: BodyLike, b: BodyLike, **places: Any) -> None:
        super().__init__(a, b, **places)

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (1)."""
        E, F, Ed, Fd = 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            E += x[i] * x[6 + i]
            F += x[3 + i] * x[6 + i]
            Ed += xd[i] * x[6 + i] + x[i] * xd[6 + i]
            Fd += xd[3 + i] * x[6 + i] + x[3 + i] * xd[6 + i]
        out[0] = E * Fd - F * Ed

    @staticmethod
    def rate_jacobian(x, par, t, out):
        """Eq. (2)."""
        E, F = 0.0, 0.0
        for i in range(3):
            E += x[i] * x[6 + i]
            F += x[3 + i] * x[6 + i]
        for i in range(3):
            out[0, i], out[0, 3 + i] = -F * x[6 + i], E * x[6 + i]
            out[0, 6 + i] = E * x[3 + i] - F * x[i]

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        """Eq. (3)."""
        E, F, fast, slow = 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            E += x[i] * x[6 + i]
            F += x[3 + i] * x[6 + i]
            fast += xd[3 + i] * xd[6 + i]
            slow += xd[i] * xd[6 + i]
        out[0] = 2.0 * (E * fast - F * slow)

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows of f, g, h, E, F."""
        for i in range(3):
            s[i, k], s[3 + i, k], s[6 + i, k] = x[i], x[3 + i], x[6 + i]
        s[9, k], s[10, k] = dot(s, 0, 6, k), dot(s, 3, 6, k)
        first, second = scaled(s, 6, 10, k), scaled(s, 6, 9, k)
        across, along = scaled(s, 3, 9, k), scaled(s, 0, 10, k)
        for i in range(3):
            out[0, i], out[0, 3 + i] = -first[i], second[i]
            out[0, 6 + i] = across[i] - along[i]


class DisplacementRate(Primitive):
    """The displacement of a point of b from a point of a along a direction of a doesn't change.

    `Ratchet` is the joint that uses it.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> block = scene.add_point_mass(mass=1.0)
    >>> scene.add(ts.constraints.DisplacementRate(scene.ground, block, axis_a=(1, 0, 0)))
    <DisplacementRate 'DisplacementRate(ground, body1)'>
    >>> scene.mobility().degrees_of_freedom
    2
    """

    rate_rows, anywhere = 1, True
    markers = (Point("a"), Point("b"), Vector("a"))

    def __init__(self, a: BodyLike, b: BodyLike, **places: Any) -> None:
        super().__init__(a, b, **places)

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (4)."""
        out[0] = 0.0
        for i in range(3):
            out[0] += x[6 + i] * (xd[3 + i] - xd[i]) + xd[6 + i] * (x[3 + i] - x[i])

    @staticmethod
    def rate_jacobian(x, par, t, out):
        """Eq. (5)."""
        for i in range(3):
            out[0, i], out[0, 3 + i], out[0, 6 + i] = -x[6 + i], x[6 + i], x[3 + i] - x[i]

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        """Eq. (6)."""
        out[0] = 0.0
        for i in range(3):
            out[0] += 2.0 * xd[6 + i] * (xd[3 + i] - xd[i])

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (5)."""
        for i in range(3):
            out[0, i], out[0, 3 + i], out[0, 6 + i] = -x[6 + i], x[6 + i], x[3 + i] - x[i]
