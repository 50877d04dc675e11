"""Armature: inertia of a joint coordinate, such as that of the rotor of a geared motor.

    T = I (ratio cd)^2 / 2                           (1)  [J]  c: the angle or the displacement of the joint
    load on the coordinate = -I ratio^2 cdd          (2)  [N m] or [N]
    theta = atan2(F, E),  E = f.h,  F = g.h          (3)  f, g of the own body, h of the other one
    s     = e.(x_other - x_own)                      (4)

The rotor turns about the axis of the joint, carried by none of the bodies: (1) has no gyroscopic terms, and is no
momentum of the bodies. The rows sqrt(I) |ratio| c of (3) and (4) are the inertia rows of the solver.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ..constraints.angle_driver import sine_cosine_rates
from ..constraints.revolute import Revolute
from ..plugins import (
    Force,
    InvalidForce,
    JointLoad,
    Point,
    Primitive,
    Turn,
    Vector,
    angles,
    displacements,
    dot,
    finite,
    not_negative,
    quotient,
    scaled,
    square,
    stop_waiting,
)

if TYPE_CHECKING:
    from ..hints import Joint


class _AngleInertia(Primitive):
    """The row of an angle, scaled."""

    rows, slots = 1, 14
    markers = (Vector("a", "f"), Vector("a", "g"), Vector("b", "h"))

    def __init__(self, a, b, scale, **places):
        super().__init__(a, b, **places)
        self.scale = scale

    def parameters(self):
        return (self.scale,)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (3)."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        out[0] = par[0] * np.arctan2(F, E)

    @staticmethod
    def jacobian(x, par, t, out):
        """(E dF - F dE) / (E^2 + F^2)."""
        E = x[0] * x[6] + x[1] * x[7] + x[2] * x[8]
        F = x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
        size = E * E + F * F
        sine, cosine = par[0] * F / size, par[0] * E / size
        for i in range(3):
            out[0, i], out[0, 3 + i] = -sine * x[6 + i], cosine * x[6 + i]
            out[0, 6 + i] = cosine * x[3 + i] - sine * x[i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """(E Fdd - F Edd - 2 thetad (E Ed + F Fd)) / (E^2 + F^2)."""
        E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x, xd, 6)
        size = E * E + F * F
        rate = (E * Fd - F * Ed) / size
        out[0] = par[0] * (E * Fdd - F * Edd - 2.0 * rate * (E * Ed + F * Fd)) / size

    @staticmethod
    def series(x, par, k, s, out):
        """Of Phi_x; rows of f, g, h, then E, F, E^2 + F^2, and E and F over that."""
        for i in range(9):
            s[i, k] = x[i]
        s[9, k], s[10, k] = dot(s, 0, 6, k), dot(s, 3, 6, k)
        s[11, k] = square(s[9], k) + square(s[10], k)
        s[12, k], s[13, k] = quotient(s[9], s[11], s[12], k), quotient(s[10], s[11], s[13], k)
        f0, f1, f2 = scaled(s, 6, 13, k)
        g0, g1, g2 = scaled(s, 6, 12, k)
        c = par[0]
        out[0, 0], out[0, 1], out[0, 2] = -c * f0, -c * f1, -c * f2
        out[0, 3], out[0, 4], out[0, 5] = c * g0, c * g1, c * g2
        f0, f1, f2 = scaled(s, 0, 13, k)
        g0, g1, g2 = scaled(s, 3, 12, k)
        out[0, 6], out[0, 7], out[0, 8] = c * (g0 - f0), c * (g1 - f1), c * (g2 - f2)


class _TravelInertia(Primitive):
    """The row of a displacement, scaled."""

    rows = 1
    markers = (Vector("a", "e"), Point("a", "own_point"), Point("b", "other_point"))

    def __init__(self, a, b, scale, **places):
        super().__init__(a, b, **places)
        self.scale = scale

    def parameters(self):
        return (self.scale,)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (4)."""
        out[0] = par[0] * (x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5]))

    @staticmethod
    def jacobian(x, par, t, out):
        """For (e, x_own, x_other)."""
        for i in range(3):
            out[0, i], out[0, 3 + i], out[0, 6 + i] = par[0] * (x[6 + i] - x[3 + i]), -par[0] * x[i], par[0] * x[i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """2 ed.(xd_other - xd_own)."""
        out[0] = 2.0 * par[0] * (xd[0] * (xd[6] - xd[3]) + xd[1] * (xd[7] - xd[4]) + xd[2] * (xd[8] - xd[5]))

    @staticmethod
    def series(x, par, k, s, out):
        """Of Phi_x."""
        for i in range(3):
            out[0, i], out[0, 3 + i], out[0, 6 + i] = par[0] * (x[6 + i] - x[3 + i]), -par[0] * x[i], par[0] * x[i]


class Armature(JointLoad, Force):
    """Inertia of a joint coordinate: the rotor of a geared motor, or the mass of a linear drive.

    Parameters
    ----------
    joint : Joint
        Of the scene, with an angle or a displacement: Revolute, Translational, Cylindrical, Screw, Universal, ...
    inertia : float, kg m^2, or kg for a displacement
        Of the rotor, about its own axis.
    ratio : float
        Turns of the rotor for one of the joint; the inertia felt at the joint is inertia ratio^2.
    which : int
        Index of the coordinate, of a joint with several: angles first, then displacements.

    Raises
    ------
    InvalidForce
        If the joint has no such coordinate or isn't in the scene, the inertia is negative, or the ratio is zero.

    Notes
    -----
    Its kinetic energy inertia (ratio rate)^2 / 2 counts in `solution.kinetic_energy`. It is the `armature` of MuJoCo and
    of Pinocchio: the rotor has no gyroscopic effect, and no part in momentum. `solution.reaction(armature, on=b)` is the
    load -inertia ratio^2 (acceleration of the coordinate) that it exerts. Statics is free of it.

    Examples
    --------
    A torque of 6 N m accelerates a wheel of 2 kg m^2 through a gear of 10 to 1, with a rotor of 0.01 kg m^2:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> rotor = scene.add(ts.forces.Armature(hinge, inertia=0.01, ratio=10.0))
    >>> torque = scene.add(ts.forces.Torque(wheel, torque=(0, 0, 6.0)))
    >>> print(f"{ts.simulate(scene, (0, 1)).state.angle_rate(hinge):.6f} rad/s")
    2.000000 rad/s
    """

    markers = (Turn("a"), Turn("b"))
    particles = True
    memory, remember = 0, None
    adds_inertia = True
    loads = ()
    quantities = MappingProxyType({"inertia": not_negative, "ratio": finite})
    coordinate = "an angle or a displacement"
    kind_of_example = Revolute

    def __init__(
        self, joint: Joint, *, inertia: float, ratio: float = 1.0, which: int = 0, name: str = ""
    ) -> None:
        self._join(joint, which, name)
        self.inertia, self.ratio = inertia, ratio
        self.check()

    @staticmethod
    def geometries(joint):
        """Angles, then displacements."""
        return [*angles(joint), *displacements(joint)]

    @staticmethod
    def directions(geometry):
        """None."""
        return ()

    def check(self):
        """A joint that the scene has, and a ratio."""
        self._demand_joint()
        if self.ratio == 0.0:
            raise InvalidForce(f"{self.name}: ratio must not be zero; leave the armature out, or set inertia=0.")

    def parameters(self):
        """None: it is no force."""
        return ()

    @property
    def inertia_row(self) -> Primitive:
        """Eq. (3) or (4) times sqrt(I) |ratio|."""
        own, other, *places = self.geometry
        kind = _AngleInertia if self.which < len(angles(self.joint)) else _TravelInertia
        given = dict(zip((marker.argument for marker in kind.markers), places, strict=True))
        row = kind(own, other, float(np.sqrt(self.inertia) * abs(self.ratio)), **given, name=self.name)
        stop_waiting(row)
        return row

    @staticmethod
    def law(x, xd, par, t, out):
        """None: the inertia is in the mass matrix."""
        for i in range(6):
            out[i] = 0.0 * xd[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """None."""

    @classmethod
    def example(cls, rng, a, b):
        """On a hinge that is added to the scene."""
        joint = Revolute(a, b, axis_a=rng.normal(size=3), axis_b=rng.normal(size=3))
        return cls(a.scene.add(joint), inertia=rng.uniform(0.5, 2.0), ratio=rng.uniform(1.0, 2.0))
