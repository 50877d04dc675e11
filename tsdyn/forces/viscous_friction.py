"""Viscous friction between two bodies, in translation and rotation.

v = xd_a - xd_b - omega_b x (x_a - x_b)    velocity of a's point relative to the material point of b there
w = omega_a - omega_b
F = -c v     on a at x_a, the opposite on b at the same point     (1)
N = -c_t w   on a, the opposite on b                              (2)
dissipation = c v.v + c_t w.w                                     (3)
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..plugins import BodyFriction, Force, act, act_series, not_negative, slip, slip_series, some

if TYPE_CHECKING:
    from ..hints import BodyLike


class ViscousFriction(BodyFriction, Force):
    """Friction force and torque proportional to the velocity of a relative to b.

    Parameters
    ----------
    damping : float, N s/m
    torsional_damping : float, N m s/rad

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> boat = scene.add_point_mass(mass=2.0, velocity=(1, 0, 0))
    >>> drag = scene.add(ts.forces.ViscousFriction(boat, scene.ground, damping=4.0))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(f"{solution.velocity(boat)[-1, 0]:.6f} m/s, {solution.dissipation[0]:.4f} W at the start")
    0.135335 m/s, 4.0000 W at the start
    """

    sources = ("damping", "torsional_damping")
    slots, positive = 9, ()
    quantities = MappingProxyType(dict.fromkeys(sources, not_negative))

    def __init__(
        self, a: BodyLike, b: BodyLike, *, damping: float = 0.0, torsional_damping: float = 0.0, **given: Any
    ) -> None:
        super().__init__(a, b, damping=damping, torsional_damping=torsional_damping, **given)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (2)."""
        v0, v1, v2 = slip(x, xd)
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        act(x, -par[0] * v0, -par[0] * v1, -par[0] * v2, -par[1] * w0, -par[1] * w1, -par[1] * w2, out)

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eqs. (1), (2); rows of x_a - x_b, omega_b and, in place of v, F."""
        for i in range(3):
            out[3 + i] = -par[1] * (xd[3 + i] - xd[9 + i])
            out[9 + i] = -out[3 + i]
        if some(par[0]):
            slip_series(x, xd, k, s)
            for i in range(3):
                s[6 + i, k] *= -par[0]
            act_series(s, 6, k, out)

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (3)."""
        v0, v1, v2 = slip(x, xd)
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        return par[0] * (v0 * v0 + v1 * v1 + v2 * v2) + par[1] * (w0 * w0 + w1 * w1 + w2 * w2)

    @classmethod
    def example(cls, rng, a, b):
        """A random instance."""
        c, c_t = rng.uniform(0.5, 2.0, 2)
        return cls(a, b, point_a=rng.normal(size=3), damping=c, torsional_damping=c_t)
