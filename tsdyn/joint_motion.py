"""Values, rates and accelerations of joint coordinates on a motion (q, qd, qdd).

    E = f.v,  F = g.v                                 v = A_own^T A_other h
    u = A_own^T A_other omega_other',  w = u - omega_own'     w: the relative angular velocity, frame of the own body
    wd = A_own^T A_other omegad_other' - omegad_own' - omega_own' x u,  vd = w x v,  vdd = wd x v + w x vd
    thetad  = (E Fd - F Ed) / (E^2 + F^2)                                                 (1)
    thetadd = (E Fdd - F Edd) / (E^2 + F^2) - 2 thetad (E Ed + F Fd) / (E^2 + F^2)        (2)
    d = x_other - x_own,  s = e.d,  sd = e.dd + ed.d,  sdd = e.ddd + 2 ed.dd + edd.d      (3)

q, qd and qdd are (n,) for one instant or (k, n) for k of them; what is returned is a number or an array (k,).
"""

import numpy as np

from .vectors import cross, difference, dot, sum_of, to_body, to_ground

ZERO = (0.0, 0.0, 0.0)
TURN_ROUND = 2.0 * np.pi


class BodyMotion:
    """The motion of one body: components of its coordinates, tuples of numbers or of arrays over outputs.

    Parameters
    ----------
    at, dimension : int
        Where its coordinates begin, and how many they are; 0 for the ground.
    levels : tuple of ndarray (n,) or (k, n)
        q, then qd and qdd where rates and accelerations are asked for.
    """

    __slots__ = ("at", "dimension", "levels")

    def __init__(self, at, dimension, *levels):
        self.at, self.dimension, self.levels = at, dimension, levels

    def _part(self, level, first, size):
        array, first = self.levels[level], self.at + first
        if array.ndim == 1:
            return tuple(array[first : first + size].tolist())
        return tuple(array[:, i] for i in range(first, first + size))

    def centroid(self, level):
        """r, rd or rdd."""
        return self._part(level, 0, 3) if self.dimension else ZERO

    @property
    def p(self):
        """Euler parameters; None without any."""
        return self._part(0, 3, 4) if self.dimension == 7 else None

    def turning(self, level):
        """omega' = 2 G(p) pd, or omegad' = 2 G(p) pdd."""
        if self.dimension != 7:
            return ZERO
        a, b, c, d = self.p
        w, x, y, z = self._part(level, 3, 4)
        return (
            2.0 * (a * x - b * w + d * y - c * z),
            2.0 * (a * y - c * w - d * x + b * z),
            2.0 * (a * z - d * w + c * x - b * y),
        )

    def arm(self, s, level):
        """A s, or its first or second derivative, ground frame."""
        if level == 0:
            return to_ground(self.p, s)
        omega = self.turning(1)
        moved = cross(omega, s)
        if level == 2:
            moved = sum_of(cross(self.turning(2), s), cross(omega, moved))
        return to_ground(self.p, moved)

    def point(self, s, level):
        """x = r + A s, or its first or second derivative."""
        return sum_of(self.centroid(level), self.arm(s, level))


def angle(geometry, own, other):
    """The angle in (-pi, pi]; own and other are the `BodyMotion` of the two bodies."""
    v = to_body(own.p, to_ground(other.p, geometry.h))
    return np.arctan2(dot(geometry.g, v), dot(geometry.f, v))


def counted(value, near):
    """The angle on the turn that lies nearest to another."""
    return value + TURN_ROUND * np.round((near - value) / TURN_ROUND)


def angle_rate(geometry, own, other):
    """Eq. (1)."""
    return _angle_derivatives(geometry, own, other, 1)


def angle_acceleration(geometry, own, other):
    """Eq. (2)."""
    return _angle_derivatives(geometry, own, other, 2)


def _angle_derivatives(geometry, own, other, level):
    p, o = own.p, other.p
    v = to_body(p, to_ground(o, geometry.h))
    u, omega = to_body(p, to_ground(o, other.turning(1))), own.turning(1)
    w = difference(u, omega)
    vd = cross(w, v)
    E, F, Ed, Fd = dot(geometry.f, v), dot(geometry.g, v), dot(geometry.f, vd), dot(geometry.g, vd)
    S = E * E + F * F
    rate = (E * Fd - F * Ed) / S
    if level == 1:
        return rate
    gain = difference(to_body(p, to_ground(o, other.turning(2))), own.turning(2))
    wd = difference(gain, cross(omega, u))
    vdd = sum_of(cross(wd, v), cross(w, vd))
    Edd, Fdd = dot(geometry.f, vdd), dot(geometry.g, vdd)
    return (E * Fdd - F * Edd - 2.0 * rate * (E * Ed + F * Fd)) / S


def displacement(geometry, own, other):
    """s of Eq. (3)."""
    return _displacement_derivatives(geometry, own, other, 0)


def displacement_rate(geometry, own, other):
    """sd of Eq. (3)."""
    return _displacement_derivatives(geometry, own, other, 1)


def displacement_acceleration(geometry, own, other):
    """sdd of Eq. (3)."""
    return _displacement_derivatives(geometry, own, other, 2)


def _displacement_derivatives(geometry, own, other, level):
    total = 0.0
    for i in range(level + 1):
        apart = difference(other.point(geometry.s_other, level - i), own.point(geometry.s_own, level - i))
        total = total + (2.0 if (level, i) == (2, 1) else 1.0) * dot(own.arm(geometry.e, i), apart)
    return total
