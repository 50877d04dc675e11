"""Turn counts of joints: the angle of each joint is tracked from one accepted step to the next.

    v = A_own^T A_other h,  theta = atan2(g.v, f.v) + 2 pi turns                    see element.py
    thetad = (E Fd - F Ed) / (E^2 + F^2),  E = f.v,  F = g.v,  vd = w x v           (1)
             w = A_own^T A_other omega_other' - omega_own'
    theta(t + h) ~ theta(t) + h (thetad(t) + thetad(t + h)) / 2                     (2)

Eq. (2) predicts the turn after a long step. The tracked angle is accurate to a tenth of a radian, enough for counting:
results are computed from q, on the turn nearest to the tracked angle.
"""

import math

from ..jit.kernels import entry, kernel, long_kernel
from ..maths.vectors import cross, dot, spin, subtract, to_body, to_ground

HALF_PI, TURN_ROUND = 0.5 * math.pi, 2.0 * math.pi
SHORT = 0.1  # (h |pd|)^2 of both bodies together, up to which an angle changes by less than a radian


@kernel
def seen(p, o, v):
    """A(p)^T A(o) v: a direction of the body with o, from the body with p."""
    return to_body(p, to_ground(o, v))


@kernel
def rate_of(f, g, v, w):
    """Eq. (1)."""
    E, F, vd = dot(f, v), dot(g, v), cross(w, v)
    return (E * dot(g, vd) - F * dot(f, vd)) / (E * E + F * F)


@kernel
def _counted(angle, near):
    """An angle on the turn nearest to `near`."""
    return angle + TURN_ROUND * math.floor((near - angle) / TURN_ROUND + 0.5)


@kernel
def _roughly(E, F, near):
    """atan2(F, E) to 0.08 rad, on the turn nearest to `near`."""
    size = abs(E) + abs(F)
    if not size > 0.0:
        return near
    share = F / size
    if E < 0.0:
        share = 2.0 - share if F >= 0.0 else -2.0 - share
    return _counted(HALF_PI * share, near)


@kernel
def _four(x, at, dimension, still):
    """Euler parameters or their rates; those of the ground."""
    if dimension == 7:
        return x[at + 3], x[at + 4], x[at + 5], x[at + 6]
    return still, 0.0, 0.0, 0.0


@kernel
def _square(a, b):
    return dot(a, a) + a[3] * a[3] + dot(b, b) + b[3] * b[3]


@kernel
def _rate(f, g, v, p, pd, o, od):
    return rate_of(f, g, v, subtract(seen(p, o, spin(o, od)), spin(p, pd)))


@long_kernel
def angle_after(r, j, q, qd, h):
    """Angle j at q, qd, which is h after the last accepted point, or before it."""
    frame = r.frames[j]
    f, g, h_ = (frame[0], frame[1], frame[2]), (frame[3], frame[4], frame[5]), (frame[6], frame[7], frame[8])
    own, m, other, n = r.joints[j, 0], r.joints[j, 1], r.joints[j, 2], r.joints[j, 3]
    p, o = _four(q, own, m, 1.0), _four(q, other, n, 1.0)
    v, near = seen(p, o, h_), r.remembered[j]
    pd, od = _four(qd, own, m, 0.0), _four(qd, other, n, 0.0)
    before = r.now[1]
    qd0, od0 = _four(before, own, m, 0.0), _four(before, other, n, 0.0)
    if h * h * max(_square(pd, od), _square(qd0, od0)) > SHORT:
        p0, o0 = _four(r.now[0], own, m, 1.0), _four(r.now[0], other, n, 1.0)
        near += 0.5 * h * (_rate(f, g, seen(p0, o0, h_), p0, qd0, o0, od0) + _rate(f, g, v, p, pd, o, od))
    return _roughly(dot(f, v), dot(g, v), near)


@kernel
def count_turns(r, q, qd, h):
    """Follow the angles to q, qd, a step h from the last accepted point."""
    for j in range(r.joints.shape[0]):
        r.remembered[j] = angle_after(r, j, q, qd, h)


@kernel
def _angle_and_rate(place, frame, q, qd):
    """An angle in (-pi, pi] and its rate, Eq. (1)."""
    f, g, h = (frame[0], frame[1], frame[2]), (frame[3], frame[4], frame[5]), (frame[6], frame[7], frame[8])
    own, m, other, n = place[0], place[1], place[2], place[3]
    p, o = _four(q, own, m, 1.0), _four(q, other, n, 1.0)
    v = seen(p, o, h)
    return math.atan2(dot(g, v), dot(f, v)), _rate(f, g, v, p, _four(qd, own, m, 0.0), o, _four(qd, other, n, 0.0))


@kernel
def counted_angle(place, frame, before, near, h, q, qd):
    """The angle of a joint at q, qd, h after the state before (3, n), where it is roughly `near`, by Eq. (2)."""
    first, rate = _angle_and_rate(place, frame, before[0], before[1])
    angle, other = _angle_and_rate(place, frame, q, qd)
    return _counted(angle, _counted(first, near) + 0.5 * h * (rate + other))


@entry("wmmvvmm")
def find_counted_angles(joints, frames, before, near, h, states, out):
    """out (k, count): angles of joints at states (k, 3 n), h (k,) after the state before (3, n), by Eq. (2).

    near (count,): these angles there, roughly.
    """
    n = before.shape[1]
    for j in range(near.size):
        place = joints[4 * j : 4 * j + 4]
        for k in range(h.size):
            q, qd = states[k, :n], states[k, n : 2 * n]
            out[k, j] = counted_angle(place, frames[j], before, near[j], h[k], q, qd)
