"""Span: the distance of two points; a term of a row that is a sum.

    d     = x_b - x_a,  l = sqrt(d.d - least^2)
    Phi   = l + offset                    (1)  [m]
    Phi_x = [ -d^T, d^T ] / l             (2)  for (x_a, x_b)
    gamma = (dd.dd - (d.dd)^2 / l^2) / l  (3)

Singular where the points coincide: the span has no direction there. l is not a number below the least length, a share
of 1e-9 of the rope's; elsewhere least^2 is below rounding. Nor is it one where d has turned by more than a right angle
since the last accepted step, so no step leads through the singular place: the direction d0 there is remembered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Point, Primitive, dot, finite, inverse_root, not_negative, scaled

if TYPE_CHECKING:
    from ..hints import BodyLike

NO_LENGTH = 1e-20  # m^2, for the product of directions where none is remembered: its inverse powers are numbers


class Span(Primitive):
    """The distance of a point of b from a point of a.

    `Rope` adds up the spans between its points. By itself the row holds the distance; `Distance` holds it at any place.

    Parameters
    ----------
    offset : float, m
        What is added; zero by default.
    least : float, m
        A run ends where the distance is less; zero by default.

    Examples
    --------
    A point mass is kept 0.5 m away from the origin:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> particle = scene.add_point_mass(mass=1.0, position=(0, 0, -0.4))
    >>> scene.add(ts.constraints.Span(scene.ground, particle, offset=-0.5))
    <Span 'Span(ground, body1)'>
    >>> report = scene.assemble()
    >>> print(particle.position + 0.0)
    [ 0.   0.  -0.5]
    """

    rows = 1
    markers = (Point("a"), Point("b"))
    slots = 5
    memory = 3
    begins_anew = True
    summed = True

    def __init__(self, a: BodyLike, b: BodyLike, *, offset: float = 0.0, least: float = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.offset, self.least = offset, least

    def check(self):
        """Finite numbers."""
        finite(self.offset, f"{self.name}: offset", self.error)
        not_negative(self.least, f"{self.name}: least", self.error)

    def parameters(self):
        """(offset, least^2); what is remembered is d."""
        return float(self.offset), float(self.least) ** 2

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        d0, d1, d2 = x[3] - x[0], x[4] - x[1], x[5] - x[2]
        forward = 0.0 * np.sqrt(d0 * par[2] + d1 * par[3] + d2 * par[4] + NO_LENGTH)
        out[0] = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2 - par[1]) + forward + par[0]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        d0, d1, d2 = x[3] - x[0], x[4] - x[1], x[5] - x[2]
        over = 1.0 / np.sqrt(d0 * d0 + d1 * d1 + d2 * d2 - par[1])
        for i in range(3):
            d = (x[3 + i] - x[i]) * over
            out[0, i], out[0, 3 + i] = -d, d

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (3)."""
        square, along, fast = -par[1], 0.0, 0.0
        for i in range(3):
            d, dd = x[3 + i] - x[i], xd[3 + i] - xd[i]
            square, along, fast = square + d * d, along + d * dd, fast + dd * dd
        out[0] = (fast - along * along / square) / np.sqrt(square)

    @staticmethod
    def remember(x, par, t):
        """d."""
        par[2], par[3] = x[3] - x[0], x[4] - x[1]
        return x[5] - x[2]

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows of d, d.d, 1 / l."""
        for i in range(3):
            s[i, k] = x[3 + i] - x[i]
        s[3, k] = dot(s, 0, 0, k) - (par[1] if k == 0 else 0.0)
        s[4, k] = inverse_root(s[3], s[4], k)
        d0, d1, d2 = scaled(s, 0, 4, k)
        out[0, 0], out[0, 1], out[0, 2] = -d0, -d1, -d2
        out[0, 3], out[0, 4], out[0, 5] = d0, d1, d2

    @classmethod
    def example(cls, rng, a, b):
        """A random instance: a distance other than zero."""
        return cls(a, b, point_a=rng.normal(size=3), point_b=rng.normal(size=3), offset=-rng.uniform(0.5, 2.0))
