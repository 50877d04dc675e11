"""Common parts of friction laws: slip velocity of a's point over b, reaction on both bodies, friction coefficient.

Markers: Point a, Turn a, Point b, Turn b.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..jit.kernels import kernel
from ..maths.recurrences import cross, dot, inverse_root, scaled
from .markers import Point, Turn
from .tolerances import LEAST_SLIP, SLIP

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike


@kernel
def coefficient(vv, par):
    """mu(|v|) / |v| of Coulomb's law with Stribeck's peak, smooth at rest; vv = |v|^2, par = (mu, mu_s, v_s, v_0, ...).

    mu(v) = (mu + (mu_s - mu) exp(-(v / v_s)^2)) v / sqrt(v^2 + v_0^2)
    """
    return (par[0] + (par[1] - par[0]) * np.exp(-vv / (par[2] * par[2]))) / np.sqrt(vv + par[3] * par[3])


@kernel
def slip(x, xd):
    """xd_a - xd_b - omega_b x (x_a - x_b)."""
    d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
    return (
        xd[0] - xd[6] - (xd[10] * d2 - xd[11] * d1),
        xd[1] - xd[7] - (xd[11] * d0 - xd[9] * d2),
        xd[2] - xd[8] - (xd[9] * d1 - xd[10] * d0),
    )


@kernel
def act(x, F0, F1, F2, N0, N1, N2, out):
    """F at x_a and N on a, the opposite on b at the same place."""
    d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
    out[0], out[1], out[2], out[3], out[4], out[5] = F0, F1, F2, N0, N1, N2
    out[6], out[7], out[8] = -F0, -F1, -F2
    out[9] = -N0 - (d1 * F2 - d2 * F1)
    out[10] = -N1 - (d2 * F0 - d0 * F2)
    out[11] = -N2 - (d0 * F1 - d1 * F0)


@kernel
def slip_series(x, xd, k, s):
    """Coefficient k of x_a - x_b, omega_b and the slip velocity, in rows 0 to 8 of s."""
    for i in range(3):
        s[i, k] = x[i] - x[6 + i]
        s[3 + i, k] = xd[9 + i]
    w0, w1, w2 = cross(s, 3, 0, k)
    s[6, k] = -(w0 - xd[0] + xd[6])
    s[7, k] = -(w1 - xd[1] + xd[7])
    s[8, k] = -(w2 - xd[2] + xd[8])


@kernel
def direction_series(s, v, first, v_0, k):
    """Coefficient k, a tuple of three, of v / sqrt(v.v + v_0^2); v in rows v to v + 2 of s, two rows are its own."""
    s[first, k] = dot(s, v, v, k) + (v_0 * v_0 if k == 0 else 0.0)
    s[first + 1, k] = inverse_root(s[first], s[first + 1], k)
    return scaled(s, v, first + 1, k)


@kernel
def act_series(s, f, k, out):
    """Coefficient k of what the force F in rows f to f + 2 of s is to a and b; x_a - x_b is in rows 0 to 2."""
    n0, n1, n2 = cross(s, 0, f, k)
    for i in range(3):
        out[i] = s[f + i, k]
        out[6 + i] = -s[f + i, k]
    out[9] -= n0
    out[10] -= n1
    out[11] -= n2


@kernel
def along_and_across(x, f):
    """Of a force f[0:3] and a torque f[3:6] the parts along the axis x[12:15], and the sizes of those across it."""
    n0, n1, n2 = x[12], x[13], x[14]
    along, turn = n0 * f[0] + n1 * f[1] + n2 * f[2], n0 * f[3] + n1 * f[4] + n2 * f[5]
    f0, f1, f2 = f[0] - along * n0, f[1] - along * n1, f[2] - along * n2
    t0, t1, t2 = f[3] - turn * n0, f[4] - turn * n1, f[5] - turn * n2
    return along, turn, np.sqrt(f0 * f0 + f1 * f1 + f2 * f2), np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)


def optional(check):
    """The check of a value that may be None."""
    return lambda value, what, error: None if value is None else check(value, what, error)


def slip_of(given):
    """The slip velocity of a law, m/s or rad/s: as given, no less than rounding resolves; None is the default."""
    return SLIP if given is None else max(given, LEAST_SLIP)


class BodyFriction:
    """Mixed in before `Force`: friction between two bodies, by a force at a point of a and by a torque.

    The first of `sources` scales the force, the second the torque.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene. b is the ground or a rigid body, a may be a point mass.
    point_a : array_like (3,), m
        Where the force acts, body frame of a.

    Raises
    ------
    InvalidForce
        If a number is negative or not finite, a velocity of regularisation is zero, both force and torque are zero, or
        a torque would act on a point mass.
    """

    markers = (Point("a"), Turn("a"), Point("b"), Turn("b"))
    particles = True
    sources: tuple[str, ...] = ()

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = (0.0, 0.0, 0.0),
        name: str = "",
        **quantities: Any,
    ) -> None:
        for unknown in quantities.keys() - self.quantities.keys():
            raise TypeError(f"unknown argument {unknown}")  # answered with the arguments that there are, see calls.py
        super().__init__(a, b, point_a=point_a, name=name)
        for key, value in quantities.items():
            setattr(self, key, value)
        self.check()

    def parameters(self) -> tuple[Any, ...]:
        """The quantities, in their order."""
        return tuple(getattr(self, key) for key in self.quantities)

    def check(self) -> None:
        """Refuse a friction without effect, and a torque on a point mass."""
        super().check()
        torque = self.sources[1]
        if self.b.dimension == 3 or (self.a.dimension == 3 and getattr(self, torque) != 0.0):
            body = self.b if self.b.dimension == 3 else self.a
            hint = "make it a, and the other body b" if body is self.b else f"set {torque}=0"
            raise self.error(f"{self.name}: the point mass {body.name!r} can't take the torque of it; {hint}.")
