"""Displacement function term: a function of the offset between points of two bodies; a term of a sum.

    s = e.d,  d = x_b - x_a
    Phi   = ratio f(s) + offset                          (1)
    Phi_x = ratio f'(s) [ d^T, -e^T, e^T ]               (2)  for (e, x_a, x_b)
    gamma = ratio (2 f'(s) ed.dd + f''(s) sd^2)          (3)

Where f' = 0 the row doesn't hold the offset.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    COORDINATE_SLOPE_ROWS,
    CoordinateFunction,
    coordinate_function,
    dot,
    scaled,
    slope_series,
)
from .displacement_term import DisplacementTerm

if TYPE_CHECKING:
    from ..hints import BodyLike


class DisplacementFunctionTerm(DisplacementTerm):
    """A multiple of a function of the offset of a point of b from a point of a, along an axis of a.

    `Coupler` adds up terms of several joints.

    Parameters
    ----------
    function : CoordinateFunction
        Of the offset, m.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.DisplacementFunctionTerm.rows
    1
    """

    slots = 6 + COORDINATE_SLOPE_ROWS

    def __init__(self, a: BodyLike, b: BodyLike, *, function: CoordinateFunction, **others: Any) -> None:
        self.__dict__["function"] = function
        super().__init__(a, b, **others)

    def parameters(self):
        """(ratio, offset, f)."""
        return *super().parameters(), self.function

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        s = x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5])
        out[0] = par[0] * coordinate_function(par, 2, s, 0) + par[1]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        s = x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5])
        slope = par[0] * coordinate_function(par, 2, s, 1)
        for i in range(3):
            out[0, i] = slope * (x[6 + i] - x[3 + i])
            out[0, 3 + i] = -slope * x[i]
            out[0, 6 + i] = slope * x[i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (3)."""
        s, sd, sdd = 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[6 + i] - x[3 + i], xd[6 + i] - xd[3 + i]
            s += x[i] * d
            sd += xd[i] * d + x[i] * dd
            sdd += 2.0 * xd[i] * dd
        out[0] = par[0] * (coordinate_function(par, 2, s, 1) * sdd + coordinate_function(par, 2, s, 2) * sd * sd)

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows of e, d, s, and its slope."""
        for i in range(3):
            s[i, k], s[3 + i, k] = x[i], x[6 + i] - x[3 + i]
        s[6, k] = dot(s, 0, 3, k)
        slope_series(par, 2, s, 6, k)
        f0, f1, f2 = scaled(s, 3, 7, k)
        e0, e1, e2 = scaled(s, 0, 7, k)
        out[0, 0], out[0, 1], out[0, 2] = par[0] * f0, par[0] * f1, par[0] * f2
        out[0, 3], out[0, 4], out[0, 5] = -par[0] * e0, -par[0] * e1, -par[0] * e2
        out[0, 6], out[0, 7], out[0, 8] = par[0] * e0, par[0] * e1, par[0] * e2

    @classmethod
    def example(cls, rng, a, b):
        """A random instance."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(
            a, b, **places, ratio=rng.uniform(0.5, 2.0), function=CoordinateFunction.example(np.exp, rng.normal())
        )
