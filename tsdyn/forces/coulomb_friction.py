"""Coulomb friction of constant magnitude between two bodies, in translation and rotation, regularised at rest.

    v, w as for ViscousFriction: relative velocity at a's point, relative angular velocity
    F = -R v / sqrt(v.v + v0^2)     on a at x_a, the opposite on b at the same point     (1)
    N = -N0 w / sqrt(w.w + w0^2)    on a, the opposite on b                              (2)
    dissipation = -F.v - N.w                                                             (3)

Below the slip velocity v0 the law is viscous: a body that should stick creeps.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    BodyFriction,
    Force,
    act,
    act_series,
    direction_series,
    not_negative,
    optional,
    positive,
    slip,
    slip_of,
    slip_series,
)

if TYPE_CHECKING:
    from ..hints import BodyLike


class CoulombFriction(BodyFriction, Force):
    """Friction force and torque of constant magnitude against the motion of a relative to b.

    Parameters
    ----------
    force : float, N
        Magnitude of the friction force: coefficient of friction times normal force.
    torque : float, N m
        Magnitude of the friction torque.
    slip_velocity : float, m/s, optional
        Regularisation: velocity at which the force is 71% of its magnitude; by default 1e-9 m/s, and less than
        1e-11 m/s acts as 1e-11 m/s. Explicit methods that are asked for by name, and the Maggi/Kane form, need steps in
        proportion to it where the bodies come to rest: give 1e-3 m/s for them.
    slip_rate : float, rad/s, optional
        The same of the torque.

    Examples
    --------
    A block of 2 kg comes to rest after 0.5 s:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> block = scene.add_point_mass(mass=2.0, velocity=(1, 0, 0))
    >>> friction = scene.add(ts.forces.CoulombFriction(block, scene.ground, force=4.0))
    >>> state = ts.simulate(scene, (0, 0.6)).state
    >>> print(f"{state.position(block)[0]:.3f} m, {abs(state.velocity(block)[0]):.3f} m/s")
    0.250 m, 0.000 m/s
    """

    sources = ("force", "torque")
    slots = 19
    slips = sharp = True  # at rest
    quantities = MappingProxyType(
        {
            "force": not_negative,
            "torque": not_negative,
            "slip_velocity": optional(positive),
            "slip_rate": optional(positive),
        }
    )

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        force: float = 0.0,
        torque: float = 0.0,
        slip_velocity: float | None = None,
        slip_rate: float | None = None,
        **given: Any,
    ) -> None:
        super().__init__(a, b, force=force, torque=torque, slip_velocity=slip_velocity, slip_rate=slip_rate, **given)

    def parameters(self):
        """(R, N0, v0, w0)."""
        return self.force, self.torque, slip_of(self.slip_velocity), slip_of(self.slip_rate)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (2)."""
        v0, v1, v2 = slip(x, xd)
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        f = -par[0] / np.sqrt(v0 * v0 + v1 * v1 + v2 * v2 + par[2] * par[2])
        n = -par[1] / np.sqrt(w0 * w0 + w1 * w1 + w2 * w2 + par[3] * par[3])
        act(x, f * v0, f * v1, f * v2, n * w0, n * w1, n * w2, out)

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eqs. (1), (2); rows of x_a - x_b, omega_b, v, F, w, then two for each root."""
        if par[1] != 0.0:
            for i in range(3):
                s[12 + i, k] = xd[3 + i] - xd[9 + i]
            n0, n1, n2 = direction_series(s, 12, 15, par[3], k)
            out[3], out[4], out[5] = -par[1] * n0, -par[1] * n1, -par[1] * n2
            out[9], out[10], out[11] = par[1] * n0, par[1] * n1, par[1] * n2
        if par[0] != 0.0:
            slip_series(x, xd, k, s)
            f0, f1, f2 = direction_series(s, 6, 17, par[2], k)
            s[9, k], s[10, k], s[11, k] = -par[0] * f0, -par[0] * f1, -par[0] * f2
            act_series(s, 9, k, out)

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (3)."""
        v0, v1, v2 = slip(x, xd)
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        vv, ww = v0 * v0 + v1 * v1 + v2 * v2, w0 * w0 + w1 * w1 + w2 * w2
        return par[0] * vv / np.sqrt(vv + par[2] * par[2]) + par[1] * ww / np.sqrt(ww + par[3] * par[3])

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, regularised over the velocities of a test."""
        R, N, v, w = rng.uniform(0.5, 2.0, 4)
        return cls(a, b, point_a=rng.normal(size=3), force=R, torque=N, slip_velocity=v, slip_rate=w)
