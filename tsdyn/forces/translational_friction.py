"""Friction of a translational joint (a slide in a guide), in proportion to the reaction of the joint.

    n      axis, v = n.(velocity of a's point over b)
    N      = N_0 + |F - n n.F| + |n.T| / W + (2 / L) |T - n n.T|     (1)
    force  = -mu(v) N n     on a along the axis, the opposite on b   (2)
           = -mu(|v|) s N n of the exact law, s the sign of v while it slides
    dissipation = mu(v) N v                                          (3)

F and T are the force and the torque that the joint exerts at its point on a (on b if a is the ground); mu is given by
friction.coefficient. A tilting torque on the slide is carried by a couple of two forces, L apart; a torque about
the axis by a force with lever arm W.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

from ..constraints.translational import Translational
from ..plugins import (
    AXIS,
    BEARING_ROWS,
    GUIDE,
    Force,
    JointFriction,
    act,
    act_series,
    along_and_across,
    bearing_series,
    coefficient,
    coefficient_series,
    dot,
    optional,
    positive,
    product,
    scaled,
    sliding,
    sliding_series,
    slip,
    slip_series,
    square,
)

SIGN = -1 - GUIDE.count  # in par, of v while it slides


class TranslationalFriction(JointFriction, Force):
    """Coulomb friction with Stribeck effect in a translational joint, proportional to the joint reaction.

    Parameters
    ----------
    joint : Translational
        Of the scene.
    length : float, m, optional
        Length of the slide `joint.on`, centred at the joint's point, over which tilting torques are carried by a
        couple; None: they cause no friction.
    width : float, m, optional
        Lever arm at which the guide carries the torque about the axis; None: it causes no friction.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> slider = scene.add_body(mass=1.0, inertia=(1, 1, 1), velocity=(3, 0, 0))
    >>> guide = scene.add(ts.constraints.Translational.at(scene.ground, slider, point=(0, 0, 0), axis=(1, 0, 0)))
    >>> friction = scene.add(ts.forces.TranslationalFriction(guide, kinetic=0.2))
    >>> print(f"{ts.simulate(scene, (0, 1)).state.displacement_rate(guide):.3f} m/s")
    1.000 m/s
    """

    joints = (Translational,)
    markers = AXIS
    slots = 24 + BEARING_ROWS
    place = GUIDE
    quantities = MappingProxyType(
        {**JointFriction.quantities, "length": optional(positive), "width": optional(positive)}
    )

    def __init__(
        self,
        joint: Translational,
        *,
        kinetic: float,
        length: float | None = None,
        width: float | None = None,
        **given: Any,
    ) -> None:
        super().__init__(joint, kinetic=kinetic, length=length, width=width, **given)

    def geometry(self):
        """(1 / W, 2 / L)."""
        return 0.0 if self.width is None else 1.0 / self.width, 0.0 if self.length is None else 2.0 / self.length

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (2)."""
        v0, v1, v2 = slip(x, xd)
        v = x[12] * v0 + x[13] * v1 + x[14] * v2
        if par[3] == 0.0:
            force = -par[-1] * sliding(v * v, par) * par[SIGN]
        else:
            force = -par[-1] * coefficient(v * v, par) * v
        act(x, force * x[12], force * x[13], force * x[14], 0.0, 0.0, 0.0, out)

    @staticmethod
    def normal_load(x, f, par):
        """Eq. (1)."""
        _, turn, across, tilt = along_and_across(x, f)
        return par[4] + across + par[5] * turn + par[6] * tilt

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (2) for a load of one; rows of x_a - x_b, omega_b, slip, n, v, v^2, five, mu / v, -mu, F."""
        slip_series(x, xd, k, s)
        for i in range(3):
            s[9 + i, k] = x[12 + i]
        s[12, k] = dot(s, 9, 6, k)
        s[13, k] = square(s[12], k)
        if par[3] == 0.0:
            s[20, k] = -sliding_series(s, 13, 14, par, k) * par[SIGN]
        else:
            s[19, k] = coefficient_series(s, 13, 14, par, k)
            s[20, k] = -product(s[19], s[12], k)
        s[21, k], s[22, k], s[23, k] = scaled(s, 9, 20, k)
        act_series(s, 21, k, out)

    @staticmethod
    def normal_series(x, f, par, k, s):
        """Of Eq. (1)."""
        for i in range(3):
            s[9 + i, k] = x[12 + i]
        return bearing_series(f, k, s, 9, 24, par[4], True, par[5], par[6])

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (3)."""
        v0, v1, v2 = slip(x, xd)
        v = x[12] * v0 + x[13] * v1 + x[14] * v2
        if par[3] == 0.0:
            return par[-1] * sliding(v * v, par) * par[SIGN] * v
        return par[-1] * coefficient(v * v, par) * v * v

    @classmethod
    def sizes(cls, rng):
        """Random arguments of the geometry, for tests."""
        return dict(zip(("length", "width"), rng.uniform(0.5, 1.0, 2), strict=True))
