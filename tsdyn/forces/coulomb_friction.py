"""Coulomb friction of constant magnitude between two bodies, in translation and rotation.

    v, w as for ViscousFriction: relative velocity at a's point, relative angular velocity
    F = -R v / sqrt(v.v + v0^2)     on a at x_a, the opposite on b at the same point     (1)
    N = -N0 w / sqrt(w.w + w0^2)    on a, the opposite on b                              (2)
    dissipation = -F.v - N.w                                                             (3)

By the exact law, v0 = 0 or w0 = 0, F = -R e or N = -N0 e with e of friction.heading. Below a slip velocity v0 the law
is viscous: a body that should stick creeps.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    HEADING_ROWS,
    ORIENTATION,
    POINT_OF_BODY,
    SLIP,
    BodyFriction,
    Force,
    act,
    act_series,
    direction_series,
    heading,
    heading_series,
    not_negative,
    optional,
    slip,
    slip_of,
    slip_series,
    slip_velocity,
)

if TYPE_CHECKING:
    from ..hints import BodyLike

WAY, TURN = 6, -ORIENTATION.count  # in par, the directions near which the bodies slide and turn


class CoulombFriction(BodyFriction, Force):
    """Friction force and torque of constant magnitude against the motion of a relative to b.

    Parameters
    ----------
    force : float, N
        Magnitude of the friction force: coefficient of friction times normal force.
    torque : float, N m
        Magnitude of the friction torque.
    static_force, static_torque : float, N and N m, optional
        The largest ones at rest, no less than those while sliding (default): the bodies stick up to them.
    slip_velocity : float, m/s
        0 (default) for the exact, set-valued law: the bodies stick or slide, and change at events. A velocity asks for
        the regularised law, with 71% of the force there, and creep in place of sticking; less than 1e-11 m/s acts as
        1e-11 m/s. Explicit methods that are asked for by name, and the Maggi/Kane form, need steps in proportion to it
        where the bodies come to rest: give 1e-3 m/s for them.
    slip_rate : float, rad/s
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
    slots = 19 + 2 * HEADING_ROWS
    sharp = True  # at rest
    quantities = MappingProxyType(
        {
            "force": not_negative,
            "torque": not_negative,
            "static_force": optional(not_negative),
            "static_torque": optional(not_negative),
            "slip_velocity": slip_velocity,
            "slip_rate": slip_velocity,
        }
    )

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        force: float = 0.0,
        torque: float = 0.0,
        static_force: float | None = None,
        static_torque: float | None = None,
        slip_velocity: float = 0.0,
        slip_rate: float = 0.0,
        **given: Any,
    ) -> None:
        statics = {"static_force": static_force, "static_torque": static_torque}
        slips = {"slip_velocity": slip_velocity, "slip_rate": slip_rate}
        super().__init__(a, b, force=force, torque=torque, **statics, **slips, **given)

    def check(self):
        """Refuse a static force or torque that is less than that of sliding."""
        super().check()
        for name in self.sources:
            static, value = getattr(self, f"static_{name}"), getattr(self, name)
            if static is not None and static < value:
                raise self.error(
                    f"{self.name}: static_{name} must be at least {name} = {value:g}, got {static:g}; leave it out "
                    "where they are the same."
                )

    def parameters(self):
        """(R, N0, v0, w0), then the largest force and torque at rest."""
        static_force = self.force if self.static_force is None else self.static_force
        static_torque = self.torque if self.static_torque is None else self.static_torque
        v0 = 0.0 if POINT_OF_BODY in self.slides else slip_of(self.slip_velocity)
        w0 = 0.0 if ORIENTATION in self.slides else slip_of(self.slip_rate)
        return self.force, self.torque, v0, w0, static_force, static_torque

    @property
    def slides(self) -> tuple[Any, ...]:
        """Where it sticks or slides by the exact law: at the point, and in rotation."""
        point = (POINT_OF_BODY,) if self._acts("force", self.slip_velocity) else ()
        return point + ((ORIENTATION,) if self._acts("torque", self.slip_rate) else ())

    def _acts(self, name, slip):
        return slip == 0.0 and bool(getattr(self, name) or getattr(self, f"static_{name}"))

    @property
    def taken(self) -> int:
        """Numbers of par that a run sets: those of its slides."""
        return sum(each.count for each in self.slides)

    @property
    def slips(self) -> bool:
        """Whether a law is regularised."""
        return (self.force > 0.0 and self.slip_velocity > 0.0) or (self.torque > 0.0 and self.slip_rate > 0.0)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (2)."""
        v0, v1, v2 = slip(x, xd)
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        if par[2] == 0.0:
            v0, v1, v2 = heading(v0, v1, v2, par[WAY : WAY + 3], SLIP)
            f = -par[0] + 0.0 * v0
        else:
            f = -par[0] / np.sqrt(v0 * v0 + v1 * v1 + v2 * v2 + par[2] * par[2])
        if par[3] == 0.0:
            w0, w1, w2 = heading(w0, w1, w2, par[TURN : TURN + 3], SLIP)
            n = -par[1] + 0.0 * w0
        else:
            n = -par[1] / np.sqrt(w0 * w0 + w1 * w1 + w2 * w2 + par[3] * par[3])
        act(x, f * v0, f * v1, f * v2, n * w0, n * w1, n * w2, out)

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eqs. (1), (2); rows of x_a - x_b, omega_b, v, F, w, then two for each root."""
        if par[1] != 0.0:
            for i in range(3):
                s[12 + i, k] = xd[3 + i] - xd[9 + i]
            if par[3] == 0.0:
                n0, n1, n2 = heading_series(s, 12, 19, par[TURN : TURN + 3], SLIP, k)
            else:
                n0, n1, n2 = direction_series(s, 12, 15, par[3], k)
            out[3], out[4], out[5] = -par[1] * n0, -par[1] * n1, -par[1] * n2
            out[9], out[10], out[11] = par[1] * n0, par[1] * n1, par[1] * n2
        if par[0] != 0.0:
            slip_series(x, xd, k, s)
            if par[2] == 0.0:
                f0, f1, f2 = heading_series(s, 6, 19 + HEADING_ROWS, par[WAY : WAY + 3], SLIP, k)
            else:
                f0, f1, f2 = direction_series(s, 6, 17, par[2], k)
            s[9, k], s[10, k], s[11, k] = -par[0] * f0, -par[0] * f1, -par[0] * f2
            act_series(s, 9, k, out)

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (3)."""
        v0, v1, v2 = slip(x, xd)
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        vv, ww = v0 * v0 + v1 * v1 + v2 * v2, w0 * w0 + w1 * w1 + w2 * w2
        if par[2] == 0.0:
            e0, e1, e2 = heading(v0, v1, v2, par[WAY : WAY + 3], SLIP)
            lost = par[0] * (e0 * v0 + e1 * v1 + e2 * v2)
        else:
            lost = par[0] * vv / np.sqrt(vv + par[2] * par[2])
        if par[3] == 0.0:
            e0, e1, e2 = heading(w0, w1, w2, par[TURN : TURN + 3], SLIP)
            return lost + par[1] * (e0 * w0 + e1 * w1 + e2 * w2)
        return lost + par[1] * ww / np.sqrt(ww + par[3] * par[3])

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, regularised over the velocities of a test."""
        R, N, v, w = rng.uniform(0.5, 2.0, 4)
        return cls(a, b, point_a=rng.normal(size=3), force=R, torque=N, slip_velocity=v, slip_rate=w)
