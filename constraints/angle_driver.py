"""Prescribed angle: the row of a motor, valid over any number of turns without counting.

    E = f.h,  F = g.h              f, g of body a, h of body b: at an angle theta, E = cos(theta), F = sin(theta)
    Phi   = cos(c) F - sin(c) E                             (1)  sin(theta - c); c(t) is the angle prescribed
    Phi_x = [ -sin(c) h^T, cos(c) h^T, (cos(c) g - sin(c) f)^T ]        (2)  for (f, g, h)
    Phi_t = -cd (sin(c) F + cos(c) E)                       (3)
    gamma = 2 cos(c) gd.hd - 2 sin(c) fd.hd - 2 cd (sin(c) Fd + cos(c) Ed)
            - cdd (sin(c) F + cos(c) E) - cd^2 Phi          (4)

The row also admits the angle half a turn away; such a start is refused. Singular if h is along the axis f x g.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Motion, Primitive, Vector, dot, kernel, product, scaled, sine_cosine

if TYPE_CHECKING:
    from ..hints import BodyLike, Prescribed


class AngleDriver(Primitive):
    """Prescribe the angle from a direction of a to a direction of b, about an axis of a, as a function of time.

    `RotationMotor` is the joint that uses it and derives the directions.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene, held on a common axis by a joint.
    reference_a, across_a : array_like (3,)
        Directions of a at the angles 0 and pi/2, perpendicular to the axis; scaled to unit length.
    reference_b : array_like (3,)
        The direction of b whose angle is prescribed.
    angle : one of ts.motions, function(s) of time, or float, rad
        The prescribed angle, over any number of turns.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2), angular_velocity=(0, 0, 3))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> directions = {"reference_a": (1, 0, 0), "across_a": (0, 1, 0), "reference_b": (1, 0, 0)}
    >>> scene.add(ts.constraints.AngleDriver(scene.ground, wheel, **directions, angle=ts.motions.Ramp(0.0, 3.0)))
    <AngleDriver 'AngleDriver(ground, body1)'>
    >>> print(f"{ts.simulate(scene, (0, 5)).state.angle(hinge):.6f} rad")
    15.000000 rad
    """

    rows = 1
    markers = (Vector("a", "reference_a"), Vector("a", "across_a"), Vector("b", "reference_b"))
    prescribed = "angle"
    slots = 14

    def __init__(self, a: BodyLike, b: BodyLike, *, angle: Prescribed = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.angle = angle

    def __setattr__(self, name, value):
        """Set a checked attribute; an angle is always a motion."""
        super().__setattr__(name, Motion.always(value, f"{self.name}: angle") if name == "angle" else value)

    @property
    def opposed(self) -> tuple[Any, ...]:
        """The pair of directions that must not be opposed: the one at the prescribed angle, and reference_b."""
        return (((self.a, Turned(self.reference_a, self.across_a, self.angle)), (self.b, self.reference_b)),)

    def parameters(self):
        """(c, cd, cdd)."""
        return Motion.places(self.angle)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        out[0] = np.cos(par[0]) * F - np.sin(par[0]) * E

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        sine, cosine = np.sin(par[0]), np.cos(par[0])
        for i in range(3):
            out[0, i] = -sine * x[6 + i]
            out[0, 3 + i] = cosine * x[6 + i]
            out[0, 6 + i] = cosine * x[3 + i] - sine * x[i]

    @staticmethod
    def phi_t(x, par, t, out):
        """Eq. (3)."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        out[0] = -par[1] * (np.sin(par[0]) * F + np.cos(par[0]) * E)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (4)."""
        sine, cosine = np.sin(par[0]), np.cos(par[0])
        E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x, xd, 6)
        along = sine * F + cosine * E
        beside = cosine * F - sine * E
        drift = 2.0 * par[1] * (sine * Fd + cosine * Ed) + par[2] * along + par[1] * par[1] * beside
        out[0] = cosine * Fdd - sine * Edd - drift

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows of sin(c), cos(c), f, g, h."""
        s[0, k], s[1, k] = sine_cosine(s[14], s[0], s[1], k)
        for i in range(9):
            s[2 + i, k] = x[i]
        f0, f1, f2 = scaled(s, 8, 0, k)
        g0, g1, g2 = scaled(s, 8, 1, k)
        out[0, 0], out[0, 1], out[0, 2] = -f0, -f1, -f2
        out[0, 3], out[0, 4], out[0, 5] = g0, g1, g2
        f0, f1, f2 = scaled(s, 2, 0, k)
        g0, g1, g2 = scaled(s, 5, 1, k)
        out[0, 6], out[0, 7], out[0, 8] = g0 - f0, g1 - f1, g2 - f2

    @staticmethod
    def series_t(x, par, k, s, out):
        """Of Eq. (3); rows of E, F, sin(c) F + cos(c) E."""
        s[11, k], s[12, k] = dot(s, 2, 8, k), dot(s, 5, 8, k)
        s[13, k] = product(s[0], s[12], k) + product(s[1], s[11], k)
        total = 0.0
        for j in range(k + 1):
            total += (j + 1.0) * s[14, j + 1] * s[13, k - j]
        out[0] = -total

    @classmethod
    def example(cls, rng, a, b):
        """A random instance with constant angle."""
        f, g, h = rng.normal(size=(3, 3))
        return cls(a, b, reference_a=f, across_a=g, reference_b=h, angle=rng.normal())


@kernel
def sine_cosine_rates(x, xd, h):
    """E = f.h and F = g.h with their first two derivatives at xdd = 0; f, g and h begin at 0, 3 and h of x."""
    E, F, Ed, Fd, Edd, Fdd = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        E += x[i] * x[h + i]
        F += x[3 + i] * x[h + i]
        Ed += xd[i] * x[h + i] + x[i] * xd[h + i]
        Fd += xd[3 + i] * x[h + i] + x[3 + i] * xd[h + i]
        Edd += 2.0 * xd[i] * xd[h + i]
        Fdd += 2.0 * xd[3 + i] * xd[h + i]
    return E, F, Ed, Fd, Edd, Fdd


class Turned:
    """The direction at a prescribed angle in the plane of two perpendicular directions: a function of time."""

    def __init__(self, f: float, g: float, angle: Prescribed) -> None:
        self.f, self.g, self.angle = f, g, angle

    def __call__(self, t):
        """The direction (3,) at t."""
        c = self.angle.value(t)[0]
        return np.cos(c) * self.f + np.sin(c) * self.g
