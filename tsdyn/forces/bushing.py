"""A bushing: linear springs and dampers in all six directions between two frames, in axes of body a.

    D = x_b - x_a,  d = A_a^T D,  dd = A_a^T (Dd - omega_a x D)
    (e0, e) = p_a^* p_b,  phi = 2 e,  w = A_a^T (omega_b - omega_a)              phi: the rotation vector to 3rd order
    F = A_a (K d + C dd)                          on a at x_b, -F on b           (1)
    N = A_a (e0 K_t phi + e x K_t phi + C_t w)    on a, -N on b                  (2)
    U = (d.K d + phi.K_t phi) / 2                                                (3)
    dissipation = dd.C dd + w.C_t w                                              (4)

(1) and (2) are minus the derivatives of U, since phid = e0 w + w x e. U has its maximum at half a turn; beyond it the
restoring torque acts towards the full turn.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    Force,
    Parameters,
    Point,
    Turn,
    cross,
    floats,
    kernel,
    rotated,
    rotated_back,
    rotation,
    shown,
    some,
)

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike


def _three(value, what, error):
    """Three finite numbers that are not negative, from one or three."""
    result = floats(value)
    if result.shape == ():
        result = np.full(3, float(result))
    if result.shape != (3,) or not np.isfinite(result).all() or (result < 0.0).any():
        raise error(f"{what} must be a number or three numbers, finite and not negative, got {shown(value)}.")
    result.setflags(write=False)
    return result


class Bushing(Force):
    """Springs and dampers between two frames, along and about the three axes of body a.

    Parameters
    ----------
    a, b : Body or ground
        Two different rigid bodies of one scene.
    point_a, point_b : array_like (3,), m
        The frames' origins, body frames; their axes are those of the bodies.
    stiffness, damping : float or array_like (3,), N/m and N s/m
        Along the axes of a.
    torsional_stiffness, torsional_damping : float or array_like (3,), N m/rad and N m s/rad
        About the axes of a; the energy is that of angles phi, twice the vector part of the relative Euler parameters.
        About one axis the torque is the stiffness times the sine of the angle: 1 % less than linear at 14 degrees,
        largest at a quarter of a turn, zero at half a turn. `TorsionalSpring` is linear, over many turns.

    Raises
    ------
    InvalidForce
        If a number is negative or not finite, or all are zero.

    Examples
    --------
    A machine of 100 kg on a rubber mount settles under its weight:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> machine = scene.add_body(mass=100.0, inertia=(8, 8, 8))
    >>> mount = {"stiffness": 1e5, "damping": 4e3, "torsional_stiffness": 1e3, "torsional_damping": 1e2}
    >>> bushing = scene.add(ts.forces.Bushing(machine, scene.ground, **mount))
    >>> print(f"{ts.simulate(scene, (0, 2)).state.position(machine)[2]:.4f} m")
    -0.0100 m
    """

    markers = (Point("a"), Point("b"), Parameters("a"), Parameters("b"), Turn("a"), Turn("b"))
    slots, positive = 45, ()
    sources = ("stiffness", "damping", "torsional_stiffness", "torsional_damping")
    quantities = MappingProxyType(dict.fromkeys(sources, _three))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        stiffness: ArrayLike = 0.0,
        damping: ArrayLike = 0.0,
        torsional_stiffness: ArrayLike = 0.0,
        torsional_damping: ArrayLike = 0.0,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.stiffness, self.damping = stiffness, damping
        self.torsional_stiffness, self.torsional_damping = torsional_stiffness, torsional_damping

    def parameters(self):
        """K, C, K_t, C_t."""
        return (*self.stiffness, *self.damping, *self.torsional_stiffness, *self.torsional_damping)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (2)."""
        D0, D1, D2 = x[3] - x[0], x[4] - x[1], x[5] - x[2]
        d0, d1, d2 = to_body(x[6], x[7], x[8], x[9], D0, D1, D2)
        v0, v1, v2 = separation_rate(x, xd)
        f0, f1, f2 = par[0] * d0 + par[3] * v0, par[1] * d1 + par[4] * v1, par[2] * d2 + par[5] * v2
        F0, F1, F2 = to_ground(x[6], x[7], x[8], x[9], f0, f1, f2)
        e0, e1, e2, e3 = relative(x)
        k1, k2, k3 = 2.0 * par[6] * e1, 2.0 * par[7] * e2, 2.0 * par[8] * e3
        w0, w1, w2 = to_body(x[6], x[7], x[8], x[9], xd[17] - xd[14], xd[18] - xd[15], xd[19] - xd[16])
        n0 = e0 * k1 + e2 * k3 - e3 * k2 + par[9] * w0
        n1 = e0 * k2 + e3 * k1 - e1 * k3 + par[10] * w1
        n2 = e0 * k3 + e1 * k2 - e2 * k1 + par[11] * w2
        N0, N1, N2 = to_ground(x[6], x[7], x[8], x[9], n0, n1, n2)
        out[0], out[1], out[2], out[3], out[4], out[5] = F0, F1, F2, -F0, -F1, -F2
        for i in range(6, 14):
            out[i] = 0.0 * x[i]
        out[14] = N0 + D1 * F2 - D2 * F1  # F acts on a at x_b
        out[15] = N1 + D2 * F0 - D0 * F2
        out[16] = N2 + D0 * F1 - D1 * F0
        out[17], out[18], out[19] = -N0, -N1, -N2

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eqs. (1), (2), each part where it has a coefficient."""
        for i in range(8):
            s[i, k] = x[6 + i]
        rotation(s, 0, 8, k)
        for i in range(3):
            s[42 + i, k] = xd[17 + i] - xd[14 + i]
        N0, N1, N2 = torque_series(s, par, k)
        for i in range(3):
            s[17 + i, k] = x[3 + i] - x[i]
            s[20 + i, k] = xd[14 + i]
            s[23 + i, k] = xd[3 + i] - xd[i]
        F0, F1, F2 = force_series(s, par, k)
        s[29, k], s[30, k], s[31, k] = F0, F1, F2
        M0, M1, M2 = cross(s, 17, 29, k)
        out[0], out[1], out[2], out[3], out[4], out[5] = F0, F1, F2, -F0, -F1, -F2
        out[14], out[15], out[16] = N0 + M0, N1 + M1, N2 + M2
        out[17], out[18], out[19] = -N0, -N1, -N2

    @staticmethod
    def potential(x, par, t):
        """Eq. (3)."""
        d0, d1, d2 = to_body(x[6], x[7], x[8], x[9], x[3] - x[0], x[4] - x[1], x[5] - x[2])
        _, e1, e2, e3 = relative(x)
        translation = par[0] * d0 * d0 + par[1] * d1 * d1 + par[2] * d2 * d2
        return 0.5 * translation + 2.0 * (par[6] * e1 * e1 + par[7] * e2 * e2 + par[8] * e3 * e3)

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (4)."""
        v0, v1, v2 = separation_rate(x, xd)
        w0, w1, w2 = to_body(x[6], x[7], x[8], x[9], xd[17] - xd[14], xd[18] - xd[15], xd[19] - xd[16])
        translation = par[3] * v0 * v0 + par[4] * v1 * v1 + par[5] * v2 * v2
        return translation + par[9] * w0 * w0 + par[10] * w1 * w1 + par[11] * w2 * w2

    @classmethod
    def example(cls, rng, a, b):
        """A random bushing, different along every axis."""
        numbers = dict(zip(cls.quantities, rng.uniform(0.5, 2.0, size=(4, 3)), strict=True))
        return cls(a, b, point_a=rng.normal(size=3), point_b=rng.normal(size=3), **numbers)


@kernel
def to_ground(e0, e1, e2, e3, s0, s1, s2):
    """A(p) s."""
    a = e0 * e0 - e1 * e1 - e2 * e2 - e3 * e3
    b, c = 2.0 * (e1 * s0 + e2 * s1 + e3 * s2), 2.0 * e0
    return (
        a * s0 + b * e1 + c * (e2 * s2 - e3 * s1),
        a * s1 + b * e2 + c * (e3 * s0 - e1 * s2),
        a * s2 + b * e3 + c * (e1 * s1 - e2 * s0),
    )


@kernel
def to_body(e0, e1, e2, e3, s0, s1, s2):
    """A(p)^T s."""
    return to_ground(e0, -e1, -e2, -e3, s0, s1, s2)


@kernel
def relative(x):
    """p_a^* p_b."""
    a0, a1, a2, a3, b0, b1, b2, b3 = x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13]
    return (
        a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3,
        a0 * b1 - a1 * b0 - a2 * b3 + a3 * b2,
        a0 * b2 - a2 * b0 - a3 * b1 + a1 * b3,
        a0 * b3 - a3 * b0 - a1 * b2 + a2 * b1,
    )


@kernel
def separation_rate(x, xd):
    """A_a^T (Dd - omega_a x D)."""
    D0, D1, D2 = x[3] - x[0], x[4] - x[1], x[5] - x[2]
    v0 = xd[3] - xd[0] - (xd[15] * D2 - xd[16] * D1)
    v1 = xd[4] - xd[1] - (xd[16] * D0 - xd[14] * D2)
    v2 = xd[5] - xd[2] - (xd[14] * D1 - xd[15] * D0)
    return to_body(x[6], x[7], x[8], x[9], v0, v1, v2)


# rows of the series: p_a 0, p_b 4, A_a 8, D 17, omega_a 20, Dd - omega_a x D 23, f 26 and F 29 with F = A_a f of
# Eq. (1), (e0, e) 32, K_t phi 36, the bracket of Eq. (2) 39, omega_b - omega_a 42


@kernel
def force_series(s, par, k):
    """Order k of F, Eq. (1); row 23 has Dd."""
    stiff = some(par[0]) or some(par[1]) or some(par[2])
    damped = some(par[3]) or some(par[4]) or some(par[5])
    f0, f1, f2 = 0.0 * par[0], 0.0 * par[1], 0.0 * par[2]  # of lanes, too
    if not (stiff or damped):
        return f0, f1, f2
    if stiff:
        d0, d1, d2 = rotated_back(s, 8, 17, k)
        f0, f1, f2 = par[0] * d0, par[1] * d1, par[2] * d2
    if damped:
        w0, w1, w2 = cross(s, 20, 17, k)
        s[23, k] -= w0
        s[24, k] -= w1
        s[25, k] -= w2
        v0, v1, v2 = rotated_back(s, 8, 23, k)
        f0, f1, f2 = f0 + par[3] * v0, f1 + par[4] * v1, f2 + par[5] * v2
    s[26, k], s[27, k], s[28, k] = f0, f1, f2
    return rotated(s, 8, 26, k)


@kernel
def torque_series(s, par, k):
    """Order k of N, Eq. (2)."""
    stiff = some(par[6]) or some(par[7]) or some(par[8])
    damped = some(par[9]) or some(par[10]) or some(par[11])
    n0, n1, n2 = 0.0 * par[6], 0.0 * par[7], 0.0 * par[8]
    if not (stiff or damped):
        return n0, n1, n2
    if damped:
        w0, w1, w2 = rotated_back(s, 8, 42, k)
        n0, n1, n2 = par[9] * w0, par[10] * w1, par[11] * w2
    if stiff:
        relative_series(0.0 * par[6], k, s)
        for i in range(3):
            s[36 + i, k] = 2.0 * par[6 + i] * s[33 + i, k]
        for l in range(k + 1):
            e0, e1, e2, e3 = s[32, l], s[33, l], s[34, l], s[35, l]
            k1, k2, k3 = s[36, k - l], s[37, k - l], s[38, k - l]
            n0 += e0 * k1 + e2 * k3 - e3 * k2
            n1 += e0 * k2 + e3 * k1 - e1 * k3
            n2 += e0 * k3 + e1 * k2 - e2 * k1
    s[39, k], s[40, k], s[41, k] = n0, n1, n2
    return rotated(s, 8, 39, k)


@kernel
def relative_series(zero, k, s):
    """Rows 32 to 35 = order k of p_a^* p_b; zero: of all lanes."""
    e0, e1, e2, e3 = zero, zero, zero, zero
    for l in range(k + 1):
        a0, a1, a2, a3 = s[0, l], s[1, l], s[2, l], s[3, l]
        b0, b1, b2, b3 = s[4, k - l], s[5, k - l], s[6, k - l], s[7, k - l]
        e0 += a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
        e1 += a0 * b1 - a1 * b0 - a2 * b3 + a3 * b2
        e2 += a0 * b2 - a2 * b0 - a3 * b1 + a1 * b3
        e3 += a0 * b3 - a3 * b0 - a1 * b2 + a2 * b1
    s[32, k], s[33, k], s[34, k], s[35, k] = e0, e1, e2, e3
