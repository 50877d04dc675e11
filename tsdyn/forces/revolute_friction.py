"""Friction of a revolute joint (a pin in a bearing), in proportion to the reaction of the joint.

    n      axis, w = n.(omega_a - omega_b),  v = R w
    N      = N_0 + |F - n n.F| + (R_c / R) |n.F| + (2 / L) |T - n n.T|      (1)
    torque = -mu(v) R N n     on a, the opposite on b                       (2)
           = -mu(|v|) s R N n of the exact law, s the sign of w while it slides
    dissipation = mu(v) N v                                                 (3)

F and T are the force and the torque that the joint exerts at its point; mu is given by friction.coefficient. A
tilting torque on the pin is carried by a couple of two forces, L apart.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

from ..constraints.revolute import Revolute
from ..plugins import (
    AXIS,
    BEARING_ROWS,
    PIN,
    Force,
    JointFriction,
    along_and_across,
    bearing_series,
    coefficient,
    coefficient_series,
    dot,
    not_negative,
    optional,
    positive,
    product,
    scaled,
    sliding,
    sliding_series,
    square,
)

SIGN = -1 - PIN.count  # in par, of w while it slides


class RevoluteFriction(JointFriction, Force):
    """Coulomb friction with Stribeck effect in a revolute joint, proportional to the joint reaction.

    Parameters
    ----------
    joint : Revolute
        Of the scene.
    radius : float, m
        Of the pin.
    collar_radius : float, m
        Radius at which the axial force causes friction; 0: none.
    length : float, m, optional
        Length of the bearing, over which tilting torques are carried by a couple; None: they cause no friction.

    Examples
    --------
    A flywheel of 0.5 kg m^2 and 10 kg runs down in a journal bearing of 20 mm radius:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> wheel = scene.add_body(mass=10.0, inertia=(0.3, 0.5, 0.3), angular_velocity=(0, 8, 0))
    >>> bearing = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 1, 0)))
    >>> friction = scene.add(ts.forces.RevoluteFriction(bearing, radius=0.02, kinetic=0.1))
    >>> print(f"{ts.simulate(scene, (0, 1)).state.angle_rate(bearing):.3f} rad/s")
    7.600 rad/s
    """

    joints = (Revolute,)
    markers = AXIS
    slots = 15 + BEARING_ROWS
    place = PIN
    quantities = MappingProxyType(
        {
            **JointFriction.quantities,
            "radius": positive,
            "collar_radius": not_negative,
            "length": optional(positive),
        }
    )

    def __init__(
        self,
        joint: Revolute,
        *,
        radius: float,
        kinetic: float,
        collar_radius: float = 0.0,
        length: float | None = None,
        **given: Any,
    ) -> None:
        super().__init__(joint, kinetic=kinetic, radius=radius, collar_radius=collar_radius, length=length, **given)

    def geometry(self):
        """(R, R_c / R, 2 / L)."""
        return self.radius, self.collar_radius / self.radius, 0.0 if self.length is None else 2.0 / self.length

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (2)."""
        n0, n1, n2 = x[12], x[13], x[14]
        v = par[5] * (n0 * (xd[3] - xd[9]) + n1 * (xd[4] - xd[10]) + n2 * (xd[5] - xd[11]))
        if par[3] == 0.0:
            torque = -par[-1] * par[5] * sliding(v * v, par) * par[SIGN]
        else:
            torque = -par[-1] * par[5] * coefficient(v * v, par) * v
        out[3], out[4], out[5] = torque * n0, torque * n1, torque * n2
        out[9], out[10], out[11] = -torque * n0, -torque * n1, -torque * n2

    @staticmethod
    def normal_load(x, f, par):
        """Eq. (1)."""
        along, _, across, tilt = along_and_across(x, f)
        return par[4] + across + par[6] * along + par[7] * tilt

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (2) for a load of one; rows of n, omega_a - omega_b, v, v^2, five, mu / v, -R mu."""
        for i in range(3):
            s[i, k], s[3 + i, k] = x[12 + i], xd[3 + i] - xd[9 + i]
        s[6, k] = par[5] * dot(s, 0, 3, k)
        s[7, k] = square(s[6], k)
        if par[3] == 0.0:
            s[14, k] = -par[5] * sliding_series(s, 7, 8, par, k) * par[SIGN]
        else:
            s[13, k] = coefficient_series(s, 7, 8, par, k)
            s[14, k] = -par[5] * product(s[13], s[6], k)
        n0, n1, n2 = scaled(s, 0, 14, k)
        out[3], out[4], out[5] = n0, n1, n2
        out[9], out[10], out[11] = -n0, -n1, -n2

    @staticmethod
    def normal_series(x, f, par, k, s):
        """Of Eq. (1)."""
        for i in range(3):
            s[i, k] = x[12 + i]
        return bearing_series(f, k, s, 0, 15, par[4], False, par[6], par[7])

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (3)."""
        v = par[5] * (x[12] * (xd[3] - xd[9]) + x[13] * (xd[4] - xd[10]) + x[14] * (xd[5] - xd[11]))
        if par[3] == 0.0:
            return par[-1] * sliding(v * v, par) * par[SIGN] * v
        return par[-1] * coefficient(v * v, par) * v * v

    @classmethod
    def sizes(cls, rng):
        """Random arguments of the geometry, for tests."""
        return dict(zip(("radius", "collar_radius", "length"), rng.uniform(0.5, 1.0, 3), strict=True))
