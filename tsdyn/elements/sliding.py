"""Friction of a contact that slides: in proportion to its normal reaction, against the slip; a part of a phase.

    n      normal towards a: z of the plane of b, or s (x_a - x_b) / |x_a - x_b| between balls, s = -1 within b
    k      = sum c_j e_j - R n,  c_j = -a_j^2 (e_j.n) / sqrt(sum a_i^2 (e_i.n)^2)                (1)
    v      = xd_a + omega_a x k - xd_b - omega_b x (x_a - x_b + k), less its part along n        (2)
    force  = -mu N e,  e along u - n n.u,  u of friction.heading with D = |d|                    (3)
    dissipation = mu N e.v                                                                       (4)

k is the contact point from x_a: an ellipsoid of semi-axes a_j along e_j, thickened by R. The force acts on a there, the
opposite on b. N is the normal reaction, with its sign: a step beyond an opening is regular. e is v / |v| while v is
within 90 degrees of d, a slow slip that a run sets, and has its direction in the tangent plane where |v| is far below
|d|: so the force is analytic where the slip begins and ends.

Where rows of contacts between the same bodies depend on each other, those of some hold the gaps, and all carry: N is a
share of the force F and the torque T about x_a that these rows exert on a,

    N = n.(c F + T x h),  h fixed in a                                                            (5)
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np

from ..jit.kernels import kernel
from ..jit.predicates import some
from ..maths.recurrences import cross, dot, inverse_root, product, scaled
from .force import Force
from .friction import HEADING_ROWS, TANGENTIAL_ROWS, heading, heading_series, tangential, tangential_series
from .markers import TURN, Point, Turn, Vector

MU, SIDE, AXES, TYRE, BALLS, WAY = 0, 1, 2, 5, 6, 7  # where these begin in par; then N
SHARE, LEVER = 3, 4  # c and |h| of Eq. (5), in place of semi-axes
A, B, Z, E = 0, 6, 12, 15  # where x_a, x_b, z and e_1 begin in x; a Turn follows each point


class _Sliding(Force):
    """Friction on a contact's row, of a phase in which it slides: of a ball or a point.

    Parameters
    ----------
    row : Primitive
        Of the closed gap; its reaction is N.
    kinetic : float
        mu.
    sign : float
        Of the gap over Phi.
    semi_axes, tyre_radius : array_like (3,), float, m
        a_j and R; zero semi-axes for a ball or a point.
    balls : float
        s of two balls, 0 for a plane.
    """

    markers = (Point("a"), Turn("a"), Point("b"), Turn("b"), Vector("b", "normal_b"))
    particles = True
    taken = 3
    slots = 52 + HEADING_ROWS + TANGENTIAL_ROWS
    positive = (53, 64)
    sharp = True
    quantities: MappingProxyType[str, Any] = MappingProxyType({})

    def __init__(self, row, *, kinetic, semi_axes=(0.0, 0.0, 0.0), tyre_radius=0.0, balls=0.0, **places):
        self.__dict__["joint"] = row
        super().__init__(row.a, row.b, **places)
        self.kinetic, self.semi_axes, self.tyre_radius, self.balls = kinetic, semi_axes, tyre_radius, balls

    def parameters(self):
        """(mu, side of the reaction, a_j^2, R, s); a run sets d."""
        side = 1.0 if self.on is self.a else -1.0
        squares = (np.asarray(self.semi_axes, float) ** 2).tolist()
        return self.kinetic, side, *squares, self.tyre_radius, self.balls

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (3)."""
        n0, n1, n2 = normal(x, par)
        k0, k1, k2 = arm(x, par, n0, n1, n2)
        l0, l1, l2 = x[0] - x[6] + k0, x[1] - x[7] + k1, x[2] - x[8] + k2
        v0, v1, v2 = slip_velocity(x, xd, par)
        e0, e1, e2 = tangential(n0, n1, n2, *heading(v0, v1, v2, par[WAY : WAY + 3], 1.0))
        f = -par[-1] * par[MU]
        F0, F1, F2 = f * e0, f * e1, f * e2
        out[0], out[1], out[2] = F0, F1, F2
        out[3], out[4], out[5] = k1 * F2 - k2 * F1, k2 * F0 - k0 * F2, k0 * F1 - k1 * F0
        out[6], out[7], out[8] = -F0, -F1, -F2
        out[9], out[10], out[11] = l2 * F1 - l1 * F2, l0 * F2 - l2 * F0, l1 * F0 - l0 * F1

    @staticmethod
    def normal_load(x, f, par):
        """N."""
        n0, n1, n2 = normal(x, par)
        return par[SIDE] * (n0 * f[0] + n1 * f[1] + n2 * f[2])

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (3) for N = 1."""
        # x_a - x_b, n (3), omega_a (6), omega_b (9), k (12), l (15), v (18), n.v, v less its part along n (22), F (27)
        for i in range(3):
            s[i, k] = x[i] - x[6 + i]
            s[6 + i, k], s[9 + i, k] = xd[3 + i], xd[9 + i]
        normal_rows(x, par, k, s)
        arm_rows(x, par, k, s)
        for i in range(3):
            s[15 + i, k] = s[i, k] + s[12 + i, k]
        u0, u1, u2 = cross(s, 6, 12, k)
        w0, w1, w2 = cross(s, 9, 15, k)
        s[18, k] = xd[0] - xd[6] + u0 - w0
        s[19, k] = xd[1] - xd[7] + u1 - w1
        s[20, k] = xd[2] - xd[8] + u2 - w2
        s[21, k] = dot(s, 3, 18, k)
        off = scaled(s, 3, 21, k)
        for i in range(3):
            s[22 + i, k] = s[18 + i, k] - off[i]
        u0, u1, u2 = heading_series(s, 22, 52, par[WAY : WAY + 3], 1.0, k)
        e0, e1, e2 = tangential_series(s, 3, u0, u1, u2, 52 + HEADING_ROWS, k)
        s[27, k], s[28, k], s[29, k] = -par[MU] * e0, -par[MU] * e1, -par[MU] * e2
        n0, n1, n2 = cross(s, 12, 27, k)
        m0, m1, m2 = cross(s, 15, 27, k)
        for i in range(3):
            out[i], out[6 + i] = s[27 + i, k], -s[27 + i, k]
        out[3], out[4], out[5] = n0, n1, n2
        out[9], out[10], out[11] = -m0, -m1, -m2

    @staticmethod
    def normal_series(x, f, par, k, s):
        """Of N."""
        for i in range(3):
            s[i, k], s[49 + i, k] = x[i] - x[6 + i], f[i]
        normal_rows(x, par, k, s)
        return par[SIDE] * dot(s, 3, 49, k)

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (4)."""
        v0, v1, v2 = slip_velocity(x, xd, par)
        e0, e1, e2 = tangential(*normal(x, par), *heading(v0, v1, v2, par[WAY : WAY + 3], 1.0))
        return par[-1] * par[MU] * (e0 * v0 + e1 * v1 + e2 * v2)


class _SlidingSurface(_Sliding):
    """The same of an ellipsoid, or a disc or torus."""

    markers = (*_Sliding.markers, *(Vector("a", name) for name in ("first_a", "second_a", "third_a")))


class _SlidingTogether(_Sliding):
    """The same of a point that shares its load with others.

    Parameters
    ----------
    of : _Sliding
        Its friction by a row of its own.
    reads : tuple of Primitive
        The rows that hold the gaps.
    share : float
        c of Eq. (5).
    lever : ndarray (3,), 1/m
        h, frame of a.
    """

    markers = (*_Sliding.markers, Vector("a", "lever_a"))

    def __init__(self, of, reads, share, lever):
        size = float(np.linalg.norm(lever))
        places = {marker.argument: getattr(of, marker.argument) for marker in of.markers if marker.code != TURN}
        places["lever_a"] = lever if size > 0.0 else (1.0, 0.0, 0.0)
        super().__init__(of.joint, kinetic=of.kinetic, tyre_radius=of.tyre_radius, **places, name=of.name)
        self.__dict__.update(of=of, reads=reads, share=share, size=size)

    def parameters(self):
        """As of `_Sliding`, with c and |h|; it is on a."""
        return self.kinetic, 1.0, 0.0, self.share, self.size, self.tyre_radius, 0.0

    @staticmethod
    def normal_load(x, f, par):
        """Eq. (5)."""
        c, h = par[SHARE], par[LEVER]
        N = x[Z] * (c * f[0] + h * (f[4] * x[E + 2] - f[5] * x[E + 1]))
        N += x[Z + 1] * (c * f[1] + h * (f[5] * x[E] - f[3] * x[E + 2]))
        return N + x[Z + 2] * (c * f[2] + h * (f[3] * x[E + 1] - f[4] * x[E]))

    series = staticmethod(_Sliding.series)

    @staticmethod
    def normal_series(x, f, par, k, s):
        """Of Eq. (5)."""
        # n (3), T (32), direction of h (35), c F + T x h (49)
        for i in range(3):
            s[3 + i, k], s[32 + i, k], s[35 + i, k] = x[Z + i], f[3 + i], x[E + i]
        u0, u1, u2 = cross(s, 32, 35, k)
        s[49, k] = par[SHARE] * f[0] + par[LEVER] * u0
        s[50, k] = par[SHARE] * f[1] + par[LEVER] * u1
        s[51, k] = par[SHARE] * f[2] + par[LEVER] * u2
        return dot(s, 3, 49, k)


@kernel
def normal(x, par):
    """n, a tuple of three."""
    if some(par[BALLS]):
        d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
        u = par[BALLS] / np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        return u * d0, u * d1, u * d2
    return x[12] + 0.0 * x[0], x[13] + 0.0 * x[0], x[14] + 0.0 * x[0]


@kernel
def arm(x, par, n0, n1, n2):
    """k of Eq. (1), a tuple of three."""
    k0, k1, k2 = -par[TYRE] * n0, -par[TYRE] * n1, -par[TYRE] * n2
    if some(par[AXES]):
        square = 0.0 * n0
        for j in range(3):
            z = x[E + 3 * j] * n0 + x[E + 3 * j + 1] * n1 + x[E + 3 * j + 2] * n2
            square += par[AXES + j] * z * z
        u = 1.0 / np.sqrt(square)
        for j in range(3):
            e = E + 3 * j
            c = -par[AXES + j] * (x[e] * n0 + x[e + 1] * n1 + x[e + 2] * n2) * u
            k0, k1, k2 = k0 + c * x[e], k1 + c * x[e + 1], k2 + c * x[e + 2]
    return k0, k1, k2


@kernel
def slip_velocity(x, xd, par):
    """v of Eq. (2), a tuple of three."""
    n0, n1, n2 = normal(x, par)
    k0, k1, k2 = arm(x, par, n0, n1, n2)
    l0, l1, l2 = x[0] - x[6] + k0, x[1] - x[7] + k1, x[2] - x[8] + k2
    v0 = xd[0] - xd[6] + xd[4] * k2 - xd[5] * k1 - (xd[10] * l2 - xd[11] * l1)
    v1 = xd[1] - xd[7] + xd[5] * k0 - xd[3] * k2 - (xd[11] * l0 - xd[9] * l2)
    v2 = xd[2] - xd[8] + xd[3] * k1 - xd[4] * k0 - (xd[9] * l1 - xd[10] * l0)
    off = n0 * v0 + n1 * v1 + n2 * v2
    return v0 - off * n0, v1 - off * n1, v2 - off * n2


@kernel
def normal_rows(x, par, k, s):
    """Coefficient k of n in rows 3 to 5; x_a - x_b is in rows 0 to 2, two rows from 30 on are its own."""
    if some(par[BALLS]):
        s[30, k] = dot(s, 0, 0, k)
        s[31, k] = inverse_root(s[30], s[31], k)
        n0, n1, n2 = scaled(s, 0, 31, k)
        s[3, k], s[4, k], s[5, k] = par[BALLS] * n0, par[BALLS] * n1, par[BALLS] * n2
    else:
        for i in range(3):
            s[3 + i, k] = x[Z + i]


@kernel
def arm_rows(x, par, k, s):
    """Coefficient k of Eq. (1) in rows 12 to 14; rows of e_j (32), e_j.n (41), c_j (44), sum, 1 / root (47, 48)."""
    for i in range(3):
        s[12 + i, k] = -par[TYRE] * s[3 + i, k]
    if some(par[AXES]):
        s[47, k] = 0.0
        for j in range(3):
            for i in range(3):
                s[32 + 3 * j + i, k] = x[E + 3 * j + i]
            s[41 + j, k] = dot(s, 32 + 3 * j, 3, k)
            s[47, k] += par[AXES + j] * product(s[41 + j], s[41 + j], k)
        s[48, k] = inverse_root(s[47], s[48], k)
        for j in range(3):
            s[44 + j, k] = -par[AXES + j] * product(s[41 + j], s[48], k)
            c0, c1, c2 = scaled(s, 32 + 3 * j, 44 + j, k)
            s[12, k] += c0
            s[13, k] += c1
            s[14, k] += c2
