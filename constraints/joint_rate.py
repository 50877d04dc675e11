"""Rows of rates: an angle or a displacement between two bodies doesn't change.

    A xd  = ratio thetad = ratio (E Fd - F Ed) / S         (1)  [rad/s]  theta, E, F and S of AngleTerm
    A xd  = ratio (e.(xd_b - xd_a) + ed.(x_b - x_a))       (2)  [m/s]    the rate of DisplacementTerm

A and gamma are Phi_x and gamma of these terms, at a ratio of 1. (1) is singular where b's direction is along the axis,
which a joint keeps it from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Point, Primitive, Vector
from .angle_driver import sine_cosine_rates
from .angle_term import AngleTerm
from .displacement_term import DisplacementTerm

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
    slots = AngleTerm.slots

    def __init__(self, a: BodyLike, b: BodyLike, **places: Any) -> None:
        super().__init__(a, b, **places)

    def parameters(self):
        """The ratio."""
        return (1.0,)

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (1)."""
        E, F, Ed, Fd, _Edd, _Fdd = sine_cosine_rates(x, xd, 6)
        out[0] = par[0] * (E * Fd - F * Ed) / (E * E + F * F)

    rate_jacobian = staticmethod(AngleTerm.jacobian)
    rate_gamma = staticmethod(AngleTerm.gamma)
    series = staticmethod(AngleTerm.series)


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
    markers = (Vector("a"), Point("a"), Point("b"))

    def __init__(self, a: BodyLike, b: BodyLike, **places: Any) -> None:
        super().__init__(a, b, **places)

    def parameters(self):
        """The ratio."""
        return (1.0,)

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (2)."""
        out[0] = 0.0
        for i in range(3):
            out[0] += par[0] * (x[i] * (xd[6 + i] - xd[3 + i]) + xd[i] * (x[6 + i] - x[3 + i]))

    rate_jacobian = staticmethod(DisplacementTerm.jacobian)
    rate_gamma = staticmethod(DisplacementTerm.gamma)
    series = staticmethod(DisplacementTerm.series)
