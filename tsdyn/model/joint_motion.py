"""Values, rates and accelerations of joint coordinates on a motion (q, qd, qdd), in plain Python.

    u = A_own^T A_other omega_other',  w = u - omega_own'       the relative angular velocity, frame of the own body
    wd = A_own^T A_other omegad_other' - omegad_own' - omega_own' x u,  vd = w x v,  vdd = wd x v + w x vd
    thetadd = (E Fdd - F Edd) / (E^2 + F^2) - 2 thetad (E Ed + F Fd) / (E^2 + F^2)        (1)
    d = x_other - x_own,  s = e.d,  sd = e.dd + ed.d,  sdd = e.ddd + 2 ed.dd + edd.d      (2)

theta, thetad, E and F are defined in joint_turns.py. q, qd and qdd are (n,) for one instant or (k, n) for k instants;
results are numbers or arrays (k,).
"""

import numpy as np

from ..jit.kernels import twin
from ..maths import vectors
from . import joint_turns

add, cross, dot, spin, subtract = map(twin, (vectors.add, vectors.cross, vectors.dot, vectors.spin, vectors.subtract))
to_body, to_ground, seen, rate_of = map(
    twin, (vectors.to_body, vectors.to_ground, joint_turns.seen, joint_turns.rate_of)
)
TURN_ROUND = 2.0 * np.pi
ZERO, IDENTITY = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


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

    def __init__(self, at, dimension, levels):
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
        """Euler parameters."""
        return self._part(0, 3, 4) if self.dimension == 7 else IDENTITY

    def turning(self, level):
        """omega' or omegad'."""
        return spin(self.p, self._part(level, 3, 4)) if self.dimension == 7 else ZERO

    def arm(self, s, level):
        """A s, or its first or second derivative, ground frame."""
        if self.dimension != 7:
            return s if level == 0 else ZERO
        if level > 0:
            omega, s0 = self.turning(1), s
            s = cross(omega, s)
            if level == 2:
                s = add(cross(self.turning(2), s0), cross(omega, s))
        return to_ground(self.p, s)

    def point(self, s, level):
        """x = r + A s, or its first or second derivative; the only point of a point mass is r."""
        return self.centroid(level) if self.dimension == 3 else add(self.centroid(level), self.arm(s, level))


def counted(value, near):
    """An angle on the turn that lies nearest to another."""
    return value + TURN_ROUND * np.round((near - value) / TURN_ROUND)


def angle(geometry, own, other, level):
    """The angle in (-pi, pi], its rate or its acceleration; own and other are the `BodyMotion` of its bodies."""
    f, g, v = geometry.f, geometry.g, seen(own.p, other.p, geometry.h)
    if level == 0:
        return np.arctan2(dot(g, v), dot(f, v))
    u, omega = seen(own.p, other.p, other.turning(1)), own.turning(1)
    w = subtract(u, omega)
    rate = rate_of(f, g, v, w)
    if level == 1:
        return rate
    gain = subtract(seen(own.p, other.p, other.turning(2)), own.turning(2))
    vd, wd = cross(w, v), subtract(gain, cross(omega, u))
    vdd = add(cross(wd, v), cross(w, vd))
    E, F = dot(f, v), dot(g, v)
    second = E * dot(g, vdd) - F * dot(f, vdd) - 2.0 * rate * (E * dot(f, vd) + F * dot(g, vd))
    return second / (E * E + F * F)


def all_angles(handles, q):
    """The angles of all joints of some `Handles` at q (n,), in (-pi, pi], (count,)."""
    p = []
    for at, dimension in (handles.joints[:, :2].T, handles.joints[:, 2:].T):
        own = np.tile(IDENTITY, (handles.count, 1))
        turns = dimension == 7
        own[turns] = q[at[turns, None] + np.arange(3, 7)]
        p.append(tuple(own.T))
    f, g, h = (tuple(handles.frames[:, i : i + 3].T) for i in (0, 3, 6))
    v = seen(*p, h)
    return np.arctan2(dot(g, v), dot(f, v))


def displacement(geometry, own, other, level):
    """s of Eq. (2), its rate or its acceleration."""
    total = 0.0
    for i in range(level + 1):
        apart = subtract(other.point(geometry.s_other, level - i), own.point(geometry.s_own, level - i))
        total = total + (2.0 if (level, i) == (2, 1) else 1.0) * dot(own.arm(geometry.e, i), apart)
    return total
