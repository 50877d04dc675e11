"""Angle term: a multiple of an angle between two bodies, over any number of turns; a term of a row that is a sum.

    E = f.h,  F = g.h              f, g of body a, h of body b: at an angle theta, E = cos(theta), F = sin(theta)
    theta  = atan2(F, E)                                                (1)  counted over turns
    Phi    = ratio theta + offset                                       (2)  [rad, or that of the sum]
    theta_f = -F h / S,  theta_g = E h / S,  theta_h = (E g - F f) / S,  S = E^2 + F^2                  (3)
    thetadd = (E Fdd - F Edd) / S - 2 (E Ed + F Fd) (E Fd - F Ed) / S^2                                 (4)
              with Edd = 2 fd.hd, Fdd = 2 gd.hd
    Phi    = ratio f(theta) + offset                                    (5)  of a function
    Phi_x  = ratio f'(theta) theta_x                                    (6)
    gamma  = ratio (f'(theta) thetadd + f''(theta) thetad^2)            (7)

Turns are counted from the last accepted step, so a step must rotate by less than half a turn. Singular if h is along
the axis f x g.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import (
    COORDINATE_SLOPE_ROWS,
    CoordinateFunction,
    Primitive,
    Vector,
    angle,
    angle_near,
    coordinate_function,
    dot,
    finite,
    kernel,
    product,
    quotient,
    scaled,
    slope_series,
    square,
)
from .angle_driver import sine_cosine_rates

if TYPE_CHECKING:
    from ..hints import BodyLike


@kernel
def _sine_cosine(x):
    """E = f.h and F = g.h."""
    return x[0] * x[6] + x[1] * x[7] + x[2] * x[8], x[3] * x[6] + x[4] * x[7] + x[5] * x[8]


@kernel
def _write_gradient(x, E, F, factor, out):
    """out = factor S theta_(f, g, h), Eq. (3)."""
    E, F = factor * E, factor * F
    for i in range(3):
        out[0, i] = -F * x[6 + i]
        out[0, 3 + i] = E * x[6 + i]
        out[0, 6 + i] = E * x[3 + i] - F * x[i]


class AngleTerm(Primitive):
    """A multiple of the angle from a direction of a to a direction of b, about an axis of a.

    `Coupler` adds up terms of several joints and derives the directions. By itself the row holds the angle.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene, held on a common axis by a joint.
    reference_a, across_a : array_like (3,)
        Directions of a at the angles 0 and pi/2, perpendicular to the axis; scaled to unit length.
    reference_b : array_like (3,)
        The direction of b whose angle it is.
    ratio : float
        Factor of the angle.
    offset : float
        What is added; zero by default.

    Examples
    --------
    A wheel is held at 0.5 rad:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> directions = {"reference_a": (1, 0, 0), "across_a": (0, 1, 0), "reference_b": (1, 0, 0)}
    >>> scene.add(ts.constraints.AngleTerm(scene.ground, wheel, **directions, offset=-0.5))
    <AngleTerm 'AngleTerm(ground, body1)'>
    >>> report = scene.assemble()
    >>> print(f"{ts.simulate(scene, (0, 1)).state.angle(hinge):.6f} rad")
    0.500000 rad
    """

    rows = 1
    markers = (Vector("a", "reference_a"), Vector("a", "across_a"), Vector("b", "reference_b"))
    slots = 14
    memory = 1
    summed = True

    def __init__(self, a: BodyLike, b: BodyLike, *, ratio: float = 1.0, offset: float = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.ratio, self.offset = ratio, offset

    def check(self):
        """Finite numbers."""
        for word in ("ratio", "offset"):
            finite(getattr(self, word), f"{self.name}: {word}", self.error)

    def parameters(self):
        """(ratio, offset); what is remembered is theta."""
        return float(self.ratio), float(self.offset)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (2)."""
        E, F = _sine_cosine(x)
        out[0] = par[0] * angle_near(F, E, par[2]) + par[1]

    @staticmethod
    def jacobian(x, par, t, out):
        """By Eq. (3)."""
        E, F = _sine_cosine(x)
        _write_gradient(x, E, F, par[0] / (E * E + F * F), out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """By Eq. (4)."""
        E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x, xd, 6)
        S = E * E + F * F
        out[0] = par[0] * ((E * Fdd - F * Edd) / S - 2.0 * (E * Ed + F * Fd) * (E * Fd - F * Ed) / (S * S))

    @staticmethod
    def remember(x, par, t):
        """theta."""
        E, F = _sine_cosine(x)
        return angle_near(F, E, par[2])

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (3); rows of f, g, h, E, F, S, E / S, F / S."""
        for i in range(9):
            s[i, k] = x[i]
        s[9, k], s[10, k] = dot(s, 0, 6, k), dot(s, 3, 6, k)
        s[11, k] = square(s[9], k) + square(s[10], k)
        s[12, k] = quotient(s[9], s[11], s[12], k)
        s[13, k] = quotient(s[10], s[11], s[13], k)
        f0, f1, f2 = scaled(s, 6, 13, k)
        g0, g1, g2 = scaled(s, 6, 12, k)
        out[0, 0], out[0, 1], out[0, 2] = -par[0] * f0, -par[0] * f1, -par[0] * f2
        out[0, 3], out[0, 4], out[0, 5] = par[0] * g0, par[0] * g1, par[0] * g2
        for i in range(3):
            out[0, 6 + i] = par[0] * (product(s[3 + i], s[12], k) - product(s[i], s[13], k))

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, its directions nearly at right angles."""
        f, g, h = rng.normal(size=(3, 3))
        return cls(a, b, reference_a=f, across_a=g, reference_b=h, ratio=rng.uniform(0.5, 2.0), offset=rng.normal())


class _AngleFunctionTerm(AngleTerm):
    """The same of a function of the angle, a CoordinateFunction; made by Coupler."""

    slots = 16 + COORDINATE_SLOPE_ROWS

    def __init__(self, a: BodyLike, b: BodyLike, *, function: CoordinateFunction, **others: Any) -> None:
        self.__dict__["function"] = function
        super().__init__(a, b, **others)

    def parameters(self):
        """(ratio, offset, f); what is remembered is theta."""
        return *super().parameters(), *self.function.places

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (5)."""
        E, F = _sine_cosine(x)
        out[0] = par[0] * coordinate_function(par, 2, angle_near(F, E, par[6]), 0) + par[1]

    @staticmethod
    def jacobian(x, par, t, out):
        """By Eq. (6)."""
        E, F = _sine_cosine(x)
        factor = par[0] * coordinate_function(par, 2, angle_near(F, E, par[6]), 1) / (E * E + F * F)
        _write_gradient(x, E, F, factor, out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """By Eq. (7)."""
        E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x, xd, 6)
        S, theta = E * E + F * F, angle_near(F, E, par[6])
        rate = (E * Fd - F * Ed) / S
        second = (E * Fdd - F * Edd) / S - 2.0 * (E * Ed + F * Fd) * rate / S
        slope, bend = coordinate_function(par, 2, theta, 1), coordinate_function(par, 2, theta, 2)
        out[0] = par[0] * (slope * second + bend * rate * rate)

    @staticmethod
    def remember(x, par, t):
        """theta."""
        E, F = _sine_cosine(x)
        return angle_near(F, E, par[6])

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (6); rows of f, g, h, E, F, S, E / S, F / S, their products with the slope, theta, and its slope."""
        for i in range(9):
            s[i, k] = x[i]
        s[9, k], s[10, k] = dot(s, 0, 6, k), dot(s, 3, 6, k)
        s[11, k] = square(s[9], k) + square(s[10], k)
        s[16, k] = angle_near(s[10, 0], s[9, 0], par[6]) if k == 0 else angle(s[10], s[9], s[11], s[16], k)
        slope_series(par, 2, s, 16, k)
        s[12, k] = quotient(s[9], s[11], s[12], k)
        s[13, k] = quotient(s[10], s[11], s[13], k)
        s[14, k], s[15, k] = product(s[12], s[17], k), product(s[13], s[17], k)
        f0, f1, f2 = scaled(s, 6, 15, k)
        g0, g1, g2 = scaled(s, 6, 14, k)
        out[0, 0], out[0, 1], out[0, 2] = -par[0] * f0, -par[0] * f1, -par[0] * f2
        out[0, 3], out[0, 4], out[0, 5] = par[0] * g0, par[0] * g1, par[0] * g2
        for i in range(3):
            out[0, 6 + i] = par[0] * (product(s[3 + i], s[14], k) - product(s[i], s[15], k))
