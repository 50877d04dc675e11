"""Angle function term: a function of an angle between two bodies, over any number of turns; a term of a sum.

    Phi   = ratio f(theta) + offset                          (1)  theta as of AngleTerm
    Phi_x = ratio f'(theta) theta_x                          (2)
    gamma = ratio (f'(theta) thetadd + f''(theta) thetad^2)  (3)

Singular where h is along the axis; where f' = 0 the row doesn't hold the angle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    COORDINATE_SLOPE_ROWS,
    CoordinateFunction,
    angle,
    angle_near,
    coordinate_function,
    dot,
    product,
    quotient,
    scaled,
    slope_series,
    square,
)
from .angle_driver import sine_cosine_rates
from .angle_term import AngleTerm

if TYPE_CHECKING:
    from ..hints import BodyLike


class AngleFunctionTerm(AngleTerm):
    """A multiple of a function of the angle from a direction of a to a direction of b, about an axis of a.

    `Coupler` adds up terms of several joints and derives the directions.

    Parameters
    ----------
    function : CoordinateFunction
        Of the angle, rad.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.AngleFunctionTerm.rows
    1
    """

    slots = 16 + COORDINATE_SLOPE_ROWS

    def __init__(self, a: BodyLike, b: BodyLike, *, function: CoordinateFunction, **others: Any) -> None:
        self.__dict__["function"] = function
        super().__init__(a, b, **others)

    def parameters(self):
        """(ratio, offset, f); what is remembered is theta."""
        return *super().parameters(), self.function

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        out[0] = par[0] * coordinate_function(par, 2, angle_near(F, E, par[6]), 0) + par[1]

    @staticmethod
    def jacobian(x, par, t, out):
        """By Eq. (2)."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        factor = par[0] * coordinate_function(par, 2, angle_near(F, E, par[6]), 1) / (E * E + F * F)
        E, F = factor * E, factor * F
        for i in range(3):
            out[0, i] = -F * x[6 + i]
            out[0, 3 + i] = E * x[6 + i]
            out[0, 6 + i] = E * x[3 + i] - F * x[i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """By Eq. (3)."""
        E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x, xd, 6)
        S, theta = E * E + F * F, angle_near(F, E, par[6])
        rate = (E * Fd - F * Ed) / S
        second = (E * Fdd - F * Edd) / S - 2.0 * (E * Ed + F * Fd) * rate / S
        slope, bend = coordinate_function(par, 2, theta, 1), coordinate_function(par, 2, theta, 2)
        out[0] = par[0] * (slope * second + bend * rate * rate)

    @staticmethod
    def remember(x, par, t):
        """theta."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        return angle_near(F, E, par[6])

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows of f, g, h, E, F, S, E / S, F / S, their products with the slope, theta, and its slope."""
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

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, its directions nearly at right angles."""
        f, g, h = rng.normal(size=(3, 3))
        function = CoordinateFunction.example(np.exp, rng.normal())
        return cls(a, b, reference_a=f, across_a=g, reference_b=h, ratio=rng.uniform(0.5, 2.0), function=function)
