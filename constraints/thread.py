"""Rotation in proportion to displacement: the thread of a screw, the teeth of a rack.

    E = f.h,  F = g.h,  d = x_b - x_a         f, g, e of body a, h of body b: E = cos(theta), F = sin(theta)
    s     = e.d / L                                                 (1)  L is the lead, m/rad
    Phi   = L (cos(s) F - sin(s) E)                                 (2)  [m]  L sin(theta - e.d / L)
    C     = cos(s) E + sin(s) F                                     (3)  1 or -1 where Phi = 0
    Phi_x = [ -L sin(s) h^T, L cos(s) h^T, -C d^T, L (cos(s) g - sin(s) f)^T, C e^T, -C e^T ]     (4)
            for (f, g, e, h, x_a, x_b)
    gamma = L cos(s) (Fdd - sd^2 F - sdd E - 2 sd Ed) - L sin(s) (Edd - sd^2 E + sdd F + 2 sd Fd)
            with Edd = 2 fd.hd, Fdd = 2 gd.hd, sdd = 2 ed.dd / L    (5)

The row is periodic, so no turns are counted; the neighbouring solutions are half a turn or half a pitch away. Singular
if h is along f x g.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    InvalidConstraint,
    Point,
    Primitive,
    Vector,
    dot,
    ground_point,
    kernel,
    number,
    product,
    rotation_matrix,
    scaled,
    shown,
    sine_cosine,
)
from .angle_driver import sine_cosine_rates

if TYPE_CHECKING:
    from ..hints import BodyLike


class Thread(Primitive):
    """Rotation of b relative to a in proportion to its travel: the row of `Screw` and `RackAndPinion`.

    Other joints must leave rotation of b about f x g alone.

    Parameters
    ----------
    reference_a, across_a : array_like (3,)
        Directions of a at the angles 0 and pi/2, perpendicular to the axis of rotation; scaled to unit length.
    axis_a : array_like (3,)
        The direction of the travel.
    reference_b : array_like (3,)
        The direction of b whose angle is measured.
    point_a, point_b : array_like (3,), m
        The points whose distance along axis_a is the travel.
    lead : float, m/rad
        Travel over rotation, not zero; negative for a left-handed thread.

    Examples
    --------
    One row; a `Screw` also keeps the axes aligned:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> nut = scene.add_body(mass=1.0, inertia=(1, 1, 1), velocity=(0, 0, 0.2), angular_velocity=(0, 0, 2))
    >>> directions = {"reference_a": (1, 0, 0), "across_a": (0, 1, 0), "axis_a": (0, 0, 1), "reference_b": (1, 0, 0)}
    >>> thread = scene.add(ts.constraints.Thread(scene.ground, nut, **directions, lead=0.1))
    >>> print(thread.rows, scene.mobility().degrees_of_freedom)
    1 5
    """

    rows = 1
    markers = (
        Vector("a", "reference_a"),
        Vector("a", "across_a"),
        Vector("a"),
        Vector("b", "reference_b"),
        Point("a"),
        Point("b"),
    )
    slots = 21

    def __init__(self, a: BodyLike, b: BodyLike, *, lead: float | None = None, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.lead = lead

    def check(self):
        """Refuse a lead of zero."""
        demand_lead(self, "lead", self.lead)

    def parameters(self):
        """(L,)."""
        return (number(self.lead),)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (2)."""
        E, F, s = turn_and_travel(x, par[0])
        out[0] = par[0] * (np.cos(s) * F - np.sin(s) * E)

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (4)."""
        E, F, s = turn_and_travel(x, par[0])
        sine, cosine = np.sin(s), np.cos(s)
        C = cosine * E + sine * F
        sine, cosine = par[0] * sine, par[0] * cosine
        for i in range(3):
            out[0, i] = -sine * x[9 + i]
            out[0, 3 + i] = cosine * x[9 + i]
            out[0, 6 + i] = -C * (x[15 + i] - x[12 + i])
            out[0, 9 + i] = cosine * x[3 + i] - sine * x[i]
            out[0, 12 + i] = C * x[6 + i]
            out[0, 15 + i] = -C * x[6 + i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (5)."""
        E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x, xd, 9)
        s, sd, sdd = 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[15 + i] - x[12 + i], xd[15 + i] - xd[12 + i]
            s += x[6 + i] * d
            sd += xd[6 + i] * d + x[6 + i] * dd
            sdd += 2.0 * xd[6 + i] * dd
        s, sd, sdd = s / par[0], sd / par[0], sdd / par[0]
        one = Fdd - sd * sd * F - sdd * E - 2.0 * sd * Ed
        two = Edd - sd * sd * E + sdd * F + 2.0 * sd * Fd
        out[0] = par[0] * (np.cos(s) * one - np.sin(s) * two)

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (4); rows of f, g, e, h, d, s, sin(s), cos(s), E, F, C."""
        for i in range(12):
            s[i, k] = x[i]
        for i in range(3):
            s[12 + i, k] = x[15 + i] - x[12 + i]
        s[15, k] = dot(s, 6, 12, k) / par[0]
        s[16, k], s[17, k] = sine_cosine(s[15], s[16], s[17], k)
        s[18, k], s[19, k] = dot(s, 0, 9, k), dot(s, 3, 9, k)
        s[20, k] = product(s[17], s[18], k) + product(s[16], s[19], k)
        f0, f1, f2 = scaled(s, 9, 16, k)
        g0, g1, g2 = scaled(s, 9, 17, k)
        out[0, 0], out[0, 1], out[0, 2] = -par[0] * f0, -par[0] * f1, -par[0] * f2
        out[0, 3], out[0, 4], out[0, 5] = par[0] * g0, par[0] * g1, par[0] * g2
        f0, f1, f2 = scaled(s, 12, 20, k)
        out[0, 6], out[0, 7], out[0, 8] = -f0, -f1, -f2
        f0, f1, f2 = scaled(s, 0, 16, k)
        g0, g1, g2 = scaled(s, 3, 17, k)
        out[0, 9], out[0, 10], out[0, 11] = par[0] * (g0 - f0), par[0] * (g1 - f1), par[0] * (g2 - f2)
        f0, f1, f2 = scaled(s, 6, 20, k)
        out[0, 12], out[0, 13], out[0, 14] = f0, f1, f2
        out[0, 15], out[0, 16], out[0, 17] = -f0, -f1, -f2

    @classmethod
    def example(cls, rng, a, b):
        """A random instance."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, lead=rng.uniform(0.5, 2.0))


@kernel
def turn_and_travel(x, lead):
    """E, F of Eq. (1) and the travel over the lead, rad."""
    E, F, s = 0.0, 0.0, 0.0
    for i in range(3):
        E += x[i] * x[9 + i]
        F += x[3 + i] * x[9 + i]
        s += x[6 + i] * (x[15 + i] - x[12 + i])
    return E, F, s / lead


def demand_lead(constraint, word, value):
    """Return the lead or radius; refuse zero."""
    result = number(value)
    if not (np.isfinite(result) and result != 0.0):
        raise InvalidConstraint(
            f"{constraint.name}: {word} is the travel over the rotation (m/rad) and must be a finite number other than "
            f"zero, got {shown(value)}; a screw without travel is a Revolute joint."
        )
    return result


def travel(a, b, direction, point_a, point_b):
    """Return the offset of the point of b from that of a along a direction of a, in the present poses."""
    return float((rotation_matrix(a.orientation) @ direction) @ (ground_point(b, point_b) - ground_point(a, point_a)))
