"""Constraint rows from body poses, one loop a kind: rows of H = [Phi_r, Phi_pi'], 2 x 8 floats, in place of Phi_q."""

from ...jit.kernels import ANY, caller, integers, kernel, part, stack, stack2, vector
from ...jit.simd import add, cross, fma, four, get, lanes, let, put, splat, times
from ..markers import PARAMETERS, POINT
from .template import (
    CODES,
    MARKERS,
    OTHERS,
    OTHERS_AT,
    OWNERS,
    ROOM,
    ROWS,
    SIZE,
    STARTS,
    SUMMED,
    acceleration_bias,
    differentiate,
    kernel_phi,
    kernel_value,
)

# Body poses of the basis-free form, one row of floats a body, and markers in terms of them.
#
#     A      12   the columns of A(p), four floats each, the fourth 0
#     r       4   centroid
#     rd      4
#     omega   4   omega', body frame
#     p       4   Euler parameters
#
# The ground is the last row, with A = I and zeros, so kernels need no special case for it. Point masses don't rotate,
# nor do rigid bodies with locked orientation (length STILL in the graph), whose orientation is kept when bodies are
# placed.

A, R, RD, OMEGA, P, POSE = 0, 12, 16, 20, 24, 28
STILL = 4  # in place of a body's length, 7 or 3: a rigid body that never turns


@kernel
def largest_coordinate(bodies, q, size):
    """The largest coordinate of bodies, m: p counts as that of points at the distance `size`, of 1 m at most."""
    largest, lever = 0.0, min(size, 1.0)
    for b in range(bodies.shape[0]):
        at = bodies[b, 0]
        for i in range(at, at + 3):
            largest = max(largest, abs(q[i]))
        if bodies[b, 1] != 3:
            for i in range(at + 3, at + 7):
                largest = max(largest, lever * abs(q[i]))
    return largest


@kernel
def orient(poses, at, e0, e1, e2, e3):
    """A(p) and p = (e0, e1, e2, e3) of the pose that begins at poses[at]."""
    # A = (e0^2 - e.e) I + 2 e e^T + 2 e0 e~, column by column
    a = e0 * e0 - e1 * e1 - e2 * e2 - e3 * e3
    e, twice = lanes(e1, e2, e3), 2.0 * e0
    put(poses, at, fma(e, splat(2.0 * e1), lanes(a, twice * e3, -twice * e2)))
    put(poses, at + 4, fma(e, splat(2.0 * e2), lanes(-twice * e3, a, twice * e1)))
    put(poses, at + 8, fma(e, splat(2.0 * e3), lanes(twice * e2, -twice * e1, a)))
    let(poses, at + P, e0)
    let(poses, at + P + 1, e1)
    let(poses, at + P + 2, e2)
    let(poses, at + P + 3, e3)


@kernel
def add_torque(p, at, Q, i, out, o):
    """out[o : o + 3] += G(p) Q_p / 2, the body torque; p is p[at : at + 4], Q_p is Q[i : i + 4]."""
    # G(p) Q_p / 2
    e0, e1, e2, e3 = 0.5 * p[at], 0.5 * p[at + 1], 0.5 * p[at + 2], 0.5 * p[at + 3]
    q0, q1, q2, q3 = Q[i], Q[i + 1], Q[i + 2], Q[i + 3]
    out[o] += -e1 * q0 + e0 * q1 + e3 * q2 - e2 * q3
    out[o + 1] += -e2 * q0 - e3 * q1 + e0 * q2 + e1 * q3
    out[o + 2] += -e3 * q0 + e2 * q1 - e1 * q2 + e0 * q3


@kernel
def take_loads(bodies, q, r, Z):
    """Z = generalised forces r (n,) as forces and body torques."""
    for b in range(bodies.shape[0]):
        i, o = bodies[b, 0], 8 * b
        put(Z, o, lanes(r[i], r[i + 1], r[i + 2]))
        put(Z, o + 4, splat(0.0))
        if bodies[b, 1] == 7:
            add_torque(q, i + 3, r, i + 3, Z, o + 4)


@kernel
def place_bodies(bodies, q, poses):
    """The poses at q (n,)."""
    for b in range(bodies.shape[0]):
        at, i = b * POSE, bodies[b, 0]
        put(poses, at + R, lanes(get(q, i), get(q, i + 1), get(q, i + 2)))
        # A body that never turns keeps this orientation
        if bodies[b, 1] == 7 or bodies[b, 1] == STILL:
            orient(poses, at, get(q, i + 3), get(q, i + 4), get(q, i + 5), get(q, i + 6))
        if bodies[b, 1] == STILL:
            put(poses, at + OMEGA, splat(0.0))


@kernel
def move_bodies(bodies, q, qd, poses):
    """rd and omega' = 2 G(p) pd of the poses."""
    for b in range(bodies.shape[0]):
        at, i = b * POSE, bodies[b, 0]
        put(poses, at + RD, lanes(qd[i], qd[i + 1], qd[i + 2]))
        if bodies[b, 1] == 7:
            # omega' = 2 G(p) pd
            e0, e1, e2, e3 = 2.0 * q[i + 3], 2.0 * q[i + 4], 2.0 * q[i + 5], 2.0 * q[i + 6]
            d0, d1, d2, d3 = qd[i + 3], qd[i + 4], qd[i + 5], qd[i + 6]
            x = -e1 * d0 + e0 * d1 + e3 * d2 - e2 * d3
            y = -e2 * d0 - e3 * d1 + e0 * d2 + e1 * d3
            z = -e3 * d0 + e2 * d1 - e1 * d2 + e0 * d3
            put(poses, at + OMEGA, lanes(x, y, z))


@kernel
def write_positions(bodies, poses, q):
    """q (n,) of the poses."""
    for b in range(bodies.shape[0]):
        at, i = b * POSE, bodies[b, 0]
        for c in range(3):
            let(q, i + c, get(poses, at + R + c))
        if bodies[b, 1] == 7:
            put(q, i + 3, four(poses, at + P))


@kernel
def write_velocities(bodies, poses, qd):
    """qd (n,) of the poses: rd, and pd = G^T omega' / 2."""
    for b in range(bodies.shape[0]):
        at, i = b * POSE, bodies[b, 0]
        for c in range(3):
            let(qd, i + c, get(poses, at + RD + c))
        if bodies[b, 1] == 7:
            x, y, z = get(poses, at + OMEGA), get(poses, at + OMEGA + 1), get(poses, at + OMEGA + 2)
            _turn(poses, at, 0.5 * x, 0.5 * y, 0.5 * z, qd, i + 3)


@kernel
def write_accelerations(bodies, poses, accelerations, qdd):
    """qdd (n,) of accelerations (b, 8): r'', and pdd = G^T omega'' / 2 - |omega'|^2 p / 4."""
    for b in range(bodies.shape[0]):
        at, i, k = b * POSE, bodies[b, 0], 8 * b
        for c in range(3):
            let(qdd, i + c, get(accelerations, k + c))
        if bodies[b, 1] == 7:
            # pdd = G^T omega'd / 2 - |omega'|^2 p / 4
            x, y, z = get(accelerations, k + 4), get(accelerations, k + 5), get(accelerations, k + 6)
            _turn(poses, at, 0.5 * x, 0.5 * y, 0.5 * z, qdd, i + 3)
            x, y, z = get(poses, at + OMEGA), get(poses, at + OMEGA + 1), get(poses, at + OMEGA + 2)
            f = 0.25 * (x * x + y * y + z * z)
            for c in range(4):
                let(qdd, i + 3 + c, get(qdd, i + 3 + c) - f * get(poses, at + P + c))


@kernel
def _turn(poses, at, x, y, z, out, i):
    """out[i : i + 4] = G(p)^T (x, y, z)."""
    e0, e1, e2, e3 = get(poses, at + P), get(poses, at + P + 1), get(poses, at + P + 2), get(poses, at + P + 3)
    let(out, i, -e1 * x - e2 * y - e3 * z)
    let(out, i + 1, e0 * x - e3 * y + e2 * z)
    let(out, i + 2, e3 * x + e0 * y - e1 * z)
    let(out, i + 3, -e2 * x + e1 * y + e0 * z)


@kernel
def turned(poses, at, s0, s1, s2):
    """A s."""
    f = times(four(poses, at), splat(s0))
    return fma(four(poses, at + 8), splat(s2), fma(four(poses, at + 4), splat(s1), f))


@kernel
def marker_position(code, poses, at, reals, s, x, i):
    """x[i : i + 3] of a marker (of Parameters 4) with coordinates at reals[s], and whatever is after it."""
    if code == PARAMETERS:
        put(x, i, four(poses, at + P))
        return
    f = turned(poses, at, get(reals, s), get(reals, s + 1), get(reals, s + 2))
    if code == POINT:
        f = add(f, four(poses, at + R))
    put(x, i, f)


@kernel
def marker_motion(code, poses, at, reals, s, x, xd, xdd, i):  # nine: the pose, the marker, what it is written to
    """x, xd, and xdd at r'' = omega'' = 0, of a marker with coordinates at reals[s]."""
    if code == PARAMETERS:
        # Parameters: x = p,  xd = G^T omega' / 2,  xdd = -|omega'|^2 p / 4
        p, w = poses[at + P : at + P + 4], poses[at + OMEGA : at + OMEGA + 3]
        square = -0.25 * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        for c in range(4):
            x[i + c], xdd[i + c] = p[c], square * p[c]
        _turn(poses, at, 0.5 * w[0], 0.5 * w[1], 0.5 * w[2], xd, i)
        return
    # Others: b = A s,  bd = w x b,  bdd = w x (w x b), with w = A omega'
    b = turned(poses, at, get(reals, s), get(reals, s + 1), get(reals, s + 2))
    w0, w1, w2 = get(poses, at + OMEGA), get(poses, at + OMEGA + 1), get(poses, at + OMEGA + 2)
    w = turned(poses, at, w0, w1, w2)
    bd = cross(w, b)
    put(xdd, i, cross(w, bd))
    if code == POINT:
        b, bd = add(b, four(poses, at + R)), add(bd, four(poses, at + RD))
    put(x, i, b)
    put(xd, i, bd)


@kernel
def marker_frame(code, poses, at, reals, s, out):
    """out (16,): what `gradient` needs of a marker with coordinates at reals[s], the rows of A and s; or p."""
    if code == PARAMETERS:
        put(out, 0, four(poses, at + P))
        return
    for i in range(3):
        put(out, 4 * i, lanes(get(poses, at + i), get(poses, at + 4 + i), get(poses, at + 8 + i)))
    put(out, 12, lanes(get(reals, s), get(reals, s + 1), get(reals, s + 2)))


@kernel
def gradient(code, frame, f, i):
    """f x_(r, pi') of a marker: a force, and a body torque; f is f[i : i + 3], of Parameters 4."""
    f0, f1, f2 = f[i], f[i + 1], f[i + 2]
    if code == PARAMETERS:
        # Parameters: the body torque G(p) f / 2
        e0, e1, e2, e3, f3 = 0.5 * frame[0], 0.5 * frame[1], 0.5 * frame[2], 0.5 * frame[3], f[i + 3]
        x = -e1 * f0 + e0 * f1 + e3 * f2 - e2 * f3
        y = -e2 * f0 - e3 * f1 + e0 * f2 + e1 * f3
        return splat(0.0), lanes(x, y, -e3 * f0 + e2 * f1 - e1 * f2 + e0 * f3)
    # Others: force f of a point, body torque s x A^T f
    turned = add(times(four(frame, 0), splat(f0)), times(four(frame, 4), splat(f1)))
    turned = add(turned, times(four(frame, 8), splat(f2)))
    return (lanes(f0, f1, f2) if code == POINT else splat(0.0)), cross(four(frame, 12), turned)


# Constraint rows from body poses, one loop a kind: rows of H = [Phi_r, Phi_pi'], 2 x 8 floats, in place of Phi_q.
#
# A virtual displacement of a body is (dr, dpi') with dpi' = 2 G dp in the body frame: six numbers and no normalisation
# row. A row of H holds the entries of body a, then of body b, each as (force, 0, body torque, 0).

SIGNATURE = "iippppdpp"  # count, reals per instance, table, reals, poses, unused, t, out, H
call_body_loop = caller(SIGNATURE)
# of the graph's table for each instance: places of its two bodies among the poses, its first row, a mask of markers,
# and its first pair of sides in H, which is the row's unless several instances add to one row
BODY, ROW, MASK, PAIR, INTS = 0, 2, 3, 4, 5


@part
def pose_of(table, own, reals, real, k):
    """Place of body k of an instance among the poses."""
    if OTHERS > 0 and k > 1:
        return int(get(reals, real + 3 * MARKERS + OTHERS_AT + 3 * (k - 2) + 2))
    return get(table, own + k)


@part
def _place_markers(table, own, reals, real, poses, x):
    """Set x (ROOM,) from the poses."""
    for j in range(MARKERS):
        at = pose_of(table, own, reals, real, OWNERS[j]) * POSE
        marker_position(CODES[j], poses, at, reals, real + 3 * j, x, STARTS[j])


def values(count, stride, table, reals, poses, unused, t, out, H):
    """out = Phi, or Phi_t."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    x, f = stack(ROOM), stack(ROWS)
    for i in range(count):
        own, real = i * INTS, i * stride
        _place_markers(table, own, reals, real, poses, x)
        kernel_value(x, reals[real + 3 * MARKERS :], t, f)
        row = get(table, own + ROW)
        for r in range(ROWS):
            let(out, row + r, get(out, row + r) + f[r] if SUMMED else f[r])
    return 0


def reduced(count, stride, table, reals, poses, unused, t, out, H):
    """out = Phi, and H = [Phi_r, Phi_pi'] = Phi_x [x_r, x_pi'] of bodies a and b."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    H = vector(H, ANY)
    x, f, g, frames = stack(ROOM), stack(ROWS), stack2(ROWS, SIZE), stack2(MARKERS, 16)
    for i in range(count):
        own, real = i * INTS, i * stride
        _place_markers(table, own, reals, real, poses, x)
        for j in range(MARKERS):
            at = pose_of(table, own, reals, real, OWNERS[j]) * POSE
            marker_frame(CODES[j], poses, at, reals, real + 3 * j, frames[j])
        par = reals[real + 3 * MARKERS :]
        # Phi and Phi_x of the primitive
        kernel_phi(x, par, t, f)
        differentiate(x, par, t, g)
        row, pair = get(table, own + ROW), get(table, own + (PAIR if SUMMED else ROW))
        for r in range(ROWS):
            let(out, row + r, get(out, row + r) + f[r] if SUMMED else f[r])
            # H = Phi_x x_(r, pi'), marker by marker
            a = b = na = nb = splat(0.0)
            for j in range(MARKERS):
                if OWNERS[j] > 1:
                    continue
                force, torque = gradient(CODES[j], frames[j], g[r], STARTS[j])
                if OWNERS[j] == 0:
                    a, na = add(a, force), add(na, torque)
                else:
                    b, nb = add(b, force), add(nb, torque)
            h = 16 * (pair + r)
            put(H, h, a)
            put(H, h + 4, na)
            put(H, h + 8, b)
            put(H, h + 12, nb)
    return 0


def bias(count, stride, table, reals, poses, unused, t, out, H):
    """out: the bias of Phi_r r'' + Phi_pi' omega'' + out = 0, Eq. 3 in these terms."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    x, xd, xdd = stack(ROOM), stack(ROOM), stack(ROOM)
    f, g = stack2(ROWS, SIZE), stack(ROWS)
    for i in range(count):
        own, real = i * INTS, i * stride
        for j in range(MARKERS):
            # gamma + Phi_x xdd at (rdd, omega'd) = 0
            at = pose_of(table, own, reals, real, OWNERS[j]) * POSE
            marker_motion(CODES[j], poses, at, reals, real + 3 * j, x, xd, xdd, STARTS[j])
        row = get(table, own + ROW)
        acceleration_bias(x, xd, xdd, reals[real + 3 * MARKERS :], t, f, g, out[row:])
    return 0
