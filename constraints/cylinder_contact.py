"""Contact of a ball with a cylinder, from outside or inside: one row, without friction.

The frame of the cylinder is f, g, u, fixed to b, u along the axis; S is the distance of the ball's centre from it.

    d     = x_a - x_b,  X = d.f,  Y = d.g        (1)
    Phi   = (X^2 + Y^2 - S^2) / (2 S)            (2)  [m]
    Phi_x = [ (X f + Y g)^T, -(X f + Y g)^T, X d^T, Y d^T ] / S     (3)  for (x_a, x_b, f, g)
    gamma = (Xd^2 + Yd^2 + 2 X dd.fd + 2 Y dd.gd) / S               (4)

Never singular: S > 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Point, Primitive, Vector, dot, kernel, positive, scaled, shown

if TYPE_CHECKING:
    from ..hints import BodyLike

B, F, G = 3, 6, 9  # where x_b, f and g begin in x


class CylinderContact(Primitive):
    """A ball of a touches a cylinder of b and slides on it: the contact row of `RollingBallOnCylinder`.

    Parameters
    ----------
    first_b, second_b : array_like (3,)
        Directions at right angles to each other and to the axis of the cylinder.
    radius : float, m
        Of the ball.
    cylinder_radius : float, m
    inside : bool
        True for a ball in a hollow cylinder.

    Raises
    ------
    InvalidConstraint
        If a radius is not positive, the ball doesn't fit into the cylinder, or a place or body is wrong.

    Examples
    --------
    One row; `RollingBallOnCylinder` with `slip=True` has it, too:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1.5))
    >>> directions = {"first_b": (0, 1, 0), "second_b": (0, 0, 1)}
    >>> contact = ts.constraints.CylinderContact(ball, scene.ground, **directions, radius=0.5, cylinder_radius=1.0)
    >>> print(scene.add(contact).rows, scene.mobility().degrees_of_freedom)
    1 5
    """

    rows = 1
    markers = (Point("a", "center_a"), Point("b"), Vector("b", "first_b"), Vector("b", "second_b"))
    slots = 11

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        radius: float | None = None,
        cylinder_radius: float | None = None,
        inside: bool = False,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.radius = radius
        self.cylinder_radius = cylinder_radius
        self.inside = inside

    def check(self):
        """Refuse a ball that doesn't fit."""
        demand_fit(self)

    def parameters(self):
        """(S, R, c): the distance of the centre from the axis; radii of ball, negative outside, and cylinder."""
        ball = float(self.radius) if self.inside else -float(self.radius)
        return (float(self.cylinder_radius) - ball, ball, float(self.cylinder_radius))

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (2)."""
        X, Y = across_axis(x)
        out[0] = (X * X + Y * Y - par[0] * par[0]) / (2.0 * par[0])

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (3)."""
        X, Y = across_axis(x)
        X, Y = X / par[0], Y / par[0]
        for i in range(3):
            n = X * x[F + i] + Y * x[G + i]
            out[0, i], out[0, B + i] = n, -n
            out[0, F + i] = X * (x[i] - x[B + i])
            out[0, G + i] = Y * (x[i] - x[B + i])

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (4)."""
        X, Y = across_axis(x)
        Xd, Yd, bias = 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[i] - x[B + i], xd[i] - xd[B + i]
            Xd += xd[F + i] * d + x[F + i] * dd
            Yd += xd[G + i] * d + x[G + i] * dd
            bias += 2.0 * dd * (X * xd[F + i] + Y * xd[G + i])
        out[0] = (Xd * Xd + Yd * Yd + bias) / par[0]

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (3)."""
        cylinder_series(x, par, k, s, out)

    @staticmethod
    def contact(x, par):
        """Contact point and normal, (3, k) each, of marker coordinates x (len(x), k)."""
        X, Y = across_axis(x)
        outward = (X * x[F : F + 3] + Y * x[G : G + 3]) / par[0]
        return x[:3] + par[1] * outward, -np.sign(par[1]) * outward

    @classmethod
    def example(cls, rng, a, b):
        """A random ball in or on a cylinder."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        radius, inside = rng.uniform(0.5, 2.0), bool(rng.integers(2))
        return cls(a, b, **places, radius=radius, cylinder_radius=radius + rng.uniform(0.5, 2.0), inside=inside)


def demand_fit(constraint):
    """Refuse radii that are not positive, and a ball that doesn't fit into its cylinder."""
    for word in ("radius", "cylinder_radius"):
        positive(getattr(constraint, word), f"{constraint.name}: {word} (m)", constraint.error)
    if not isinstance(constraint.inside, bool):
        raise constraint.error(f"{constraint.name}: inside must be True or False, got {shown(constraint.inside)}.")
    if constraint.inside and not constraint.radius < constraint.cylinder_radius:
        raise constraint.error(
            f"{constraint.name}: a ball of radius {constraint.radius:g} m doesn't fit into a cylinder of radius "
            f"{constraint.cylinder_radius:g} m."
        )


@kernel
def across_axis(x):
    """X and Y of Eq. (1)."""
    X, Y = 0.0, 0.0
    for i in range(3):
        d = x[i] - x[B + i]
        X += x[F + i] * d
        Y += x[G + i] * d
    return X, Y


@kernel
def cylinder_series(x, par, k, s, out):
    """Coefficient k of Eq. (3), out[0]; rows of f, g, d, X / S, Y / S."""
    for i in range(3):
        s[i, k], s[3 + i, k], s[6 + i, k] = x[F + i], x[G + i], x[i] - x[B + i]
    s[9, k], s[10, k] = dot(s, 0, 6, k) / par[0], dot(s, 3, 6, k) / par[0]
    f0, f1, f2 = scaled(s, 0, 9, k)
    g0, g1, g2 = scaled(s, 3, 10, k)
    out[0, 0], out[0, 1], out[0, 2] = f0 + g0, f1 + g1, f2 + g2
    out[0, B], out[0, B + 1], out[0, B + 2] = -f0 - g0, -f1 - g1, -f2 - g2
    out[0, F], out[0, F + 1], out[0, F + 2] = scaled(s, 6, 9, k)
    out[0, G], out[0, G + 1], out[0, G + 2] = scaled(s, 6, 10, k)
