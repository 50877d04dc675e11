"""Displacement term: a multiple of the offset between points of two bodies; a term of a row that is a sum.

    d     = x_b - x_a
    Phi   = ratio a.d + offset            (1)  [m, or that of the sum]
    Phi_x = ratio [ d^T, -a^T, a^T ]      (2)  for (a, x_a, x_b)
    gamma = 2 ratio ad.dd                 (3)
    Phi   = ratio f(s) + offset           (4)  of a function, s = a.d
    Phi_x = ratio f'(s) [ d^T, -a^T, a^T ]                      (5)
    gamma = ratio (2 f'(s) ad.dd + f''(s) sd^2)                 (6)

Never singular by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import (
    COORDINATE_SLOPE_ROWS,
    CoordinateFunction,
    Point,
    Primitive,
    Vector,
    coordinate_function,
    dot,
    finite,
    scaled,
    slope_series,
)
from .dot2 import write_offset_gradient

if TYPE_CHECKING:
    from ..hints import BodyLike


class DisplacementTerm(Primitive):
    """A multiple of the offset of a point of b from a point of a, along an axis of a.

    `Coupler` adds up terms of several joints. By itself the row holds the offset.

    Parameters
    ----------
    ratio : float
        Factor of the offset.
    offset : float
        What is added; zero by default.

    Examples
    --------
    A point mass is kept 0.5 m above the plane z = 0:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> particle = scene.add_point_mass(mass=1.0, position=(1, 0, 0.4))
    >>> scene.add(ts.constraints.DisplacementTerm(scene.ground, particle, axis_a=(0, 0, 1), offset=-0.5))
    <DisplacementTerm 'DisplacementTerm(ground, body1)'>
    >>> report = scene.assemble()
    >>> print(particle.position)
    [1.  0.  0.5]
    """

    rows = 1
    markers = (Vector("a"), Point("a"), Point("b"))
    summed = True

    def __init__(self, a: BodyLike, b: BodyLike, *, ratio: float = 1.0, offset: float = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.ratio, self.offset = ratio, offset

    def check(self):
        """Finite numbers."""
        for word in ("ratio", "offset"):
            finite(getattr(self, word), f"{self.name}: {word}", self.error)

    def parameters(self):
        """(ratio, offset)."""
        return float(self.ratio), float(self.offset)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        out[0] = par[0] * (x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5])) + par[1]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        write_offset_gradient(x, par[0], out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (3)."""
        out[0] = 2.0 * par[0] * (xd[0] * (xd[6] - xd[3]) + xd[1] * (xd[7] - xd[4]) + xd[2] * (xd[8] - xd[5]))

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2), which is linear in x."""
        write_offset_gradient(x, par[0], out)

    @classmethod
    def example(cls, rng, a, b):
        """A random instance."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, ratio=rng.uniform(0.5, 2.0), offset=rng.normal())


class _DisplacementFunctionTerm(DisplacementTerm):
    """The same of a function of the offset, a CoordinateFunction; made by Coupler."""

    slots = 6 + COORDINATE_SLOPE_ROWS

    def __init__(self, a: BodyLike, b: BodyLike, *, function: CoordinateFunction, **others: Any) -> None:
        self.__dict__["function"] = function
        super().__init__(a, b, **others)

    def parameters(self):
        """(ratio, offset, f)."""
        return *super().parameters(), *self.function.places

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (4)."""
        s = x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5])
        out[0] = par[0] * coordinate_function(par, 2, s, 0) + par[1]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (5)."""
        s = x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5])
        slope = par[0] * coordinate_function(par, 2, s, 1)
        write_offset_gradient(x, slope, out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (6)."""
        s, sd, sdd = 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[6 + i] - x[3 + i], xd[6 + i] - xd[3 + i]
            s += x[i] * d
            sd += xd[i] * d + x[i] * dd
            sdd += 2.0 * xd[i] * dd
        out[0] = par[0] * (coordinate_function(par, 2, s, 1) * sdd + coordinate_function(par, 2, s, 2) * sd * sd)

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (5); rows of e, d, s, and its slope."""
        for i in range(3):
            s[i, k], s[3 + i, k] = x[i], x[6 + i] - x[3 + i]
        s[6, k] = dot(s, 0, 3, k)
        slope_series(par, 2, s, 6, k)
        f0, f1, f2 = scaled(s, 3, 7, k)
        e0, e1, e2 = scaled(s, 0, 7, k)
        out[0, 0], out[0, 1], out[0, 2] = par[0] * f0, par[0] * f1, par[0] * f2
        out[0, 3], out[0, 4], out[0, 5] = -par[0] * e0, -par[0] * e1, -par[0] * e2
        out[0, 6], out[0, 7], out[0, 8] = par[0] * e0, par[0] * e1, par[0] * e2
