"""State at the end of a Taylor step: sums of the series, projected velocities, both with compensated summation.

A step changes r, rd, omega' and p by increments that are smaller than the state. What the additions lose to rounding is
kept from step to step in `Expansion.low`, a row a body: the state is (r, rd, omega', p) + low. The series of the next
step begin at the rounded state. Increments of p follow from the rotation since the start of the step,

    A_0^T A(h) = I + A_0^T sum_{k>0} A_k h^k,

whose rounding errors are in proportion to its angle; after more than about a radian p is read off A(h).
"""

import math

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, P, R, orient, set_pose
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..formulations.projection import normalise
from ..jit.kernels import kernel
from ..jit.simd import add, fma, four, put, splat, sub, times, total
from ..rows.interface import find_correction, multiply_rates
from .coefficients import put_sum
from .layout import L_OMEGA, L_P, L_R, L_RD, LOW
from .tolerances import MOST_PARTS, WIDE


@kernel
def keep_start(graph, poses, start):
    """Keep p of the poses, those at the start of a step."""
    for b in range(graph.bodies.shape[0]):
        put(start, 4 * b, four(poses, b * POSE + P))


@kernel
def sum_series(graph, x, h, poses, p):
    """The poses at h: A and r from coefficients up to top + 1, omega' up to top. A is made orthogonal by way of p.

    What the sums lose to rounding is x.low_end. x is an `Expansion`.
    """
    s, bodies, low, orders, top = splat(h), x.bodies, x.low, x.order.room, x.order.top
    for b in range(graph.bodies.shape[0]):
        # Horner's scheme for r and rd together
        first, at, l = b * orders * BODY_ROW, b * POSE, LOW * b
        o = first + S_R * orders
        v, f, fd = four(bodies, o + 4), four(bodies, o + 4 * (top + 1)), splat(0.0)
        for k in range(top, 1, -1):  # r = r_0 + h (v + h f),  rd = v + h (2 f + h fd)
            fd = fma(fd, s, f)
            f = fma(f, s, four(bodies, o + 4 * k))
        # What the state lacks to rounding moves with it
        rest = fma(four(x.low_r2, 4 * b), s, four(low, l + L_RD))
        change = times(add(v, fma(f, s, rest)), s)
        put_sum(poses, at + R, four(bodies, o), add(change, four(low, l + L_R)), x.low_end, l + L_R)
        change = times(fma(fd, s, add(f, f)), s)
        put_sum(poses, at + RD, v, add(change, fma(four(x.low_r2, 4 * b), s, rest)), x.low_end, l + L_RD)
        if graph.bodies[b, 1] == 7:
            # omega'
            w, o = splat(0.0), first + S_OMEGA * orders
            for k in range(top, 0, -1):
                w = fma(w, s, four(bodies, o + 4 * k))
            change = fma(w, s, four(low, l + L_OMEGA))
            put_sum(poses, at + OMEGA, four(bodies, o), change, x.low_end, l + L_OMEGA)
            # Angle of the step, rad; in parts of one radian p can't change its sign unnoticed
            fast = 0.0  # where it may turn far, p is followed on the way: it and -p are the same A
            for i in range(3):
                fast = max(fast, max(abs(bodies[o + i]), abs(poses[at + OMEGA + i])))
            parts = int(min(fast * abs(h), MOST_PARTS)) + 1
            if parts == 1 and _rotate(bodies, first, top, h, poses, at, x, b, p):
                continue
            put(x.low_end, l + L_P, splat(0.0))
            # A at the end of each part, and p from it
            for i in range(1, parts + 1):
                _sum_rotation(bodies, first, top, h * i / parts, poses, at)
                _parameters(poses, at, p)
                for j in range(4):
                    poses[at + P + j] = p[j]
            set_pose(poses, at, p)


@kernel
def project_rates(graph, f, low, drifting):
    """Project the velocities of the poses onto the tangent space, twice: the second projection removes rounding.

    H, Y and S are those of the poses; with `drifting`, gamma is Phi_t. low is what the velocities lack to rounding.
    """
    for _ in range(2):
        # y <- y - Y^T S^-1 (H y + Phi_t)
        multiply_rates(graph, f.rows, f.poses, f.b)
        if drifting:
            for e in range(f.b.size):
                f.b[e] += f.gamma[e]
        find_correction(graph, f.rows, f.b, f.Z)
        for b in range(graph.bodies.shape[0]):
            # Corrections and rounding errors are added with compensation
            at, l, z = b * POSE, LOW * b, 8 * b
            change = add(four(f.Z, z), four(low, l + L_RD))
            put_sum(f.poses, at + RD, four(f.poses, at + RD), change, low, l + L_RD)
            change = add(four(f.Z, z + 4), four(low, l + L_OMEGA))
            put_sum(f.poses, at + OMEGA, four(f.poses, at + OMEGA), change, low, l + L_OMEGA)


@kernel
def _sum_columns(bodies, first, top, least, h):
    """Columns of sum_{k >= least} A_k h^(k - least)."""
    s, c = splat(h), first + 12 * (top + 1)
    x, y, z = four(bodies, c), four(bodies, c + 4), four(bodies, c + 8)
    for k in range(top, least - 1, -1):
        c = first + 12 * k
        x = fma(x, s, four(bodies, c))
        y = fma(y, s, four(bodies, c + 4))
        z = fma(z, s, four(bodies, c + 8))
    return x, y, z


@kernel
def _sum_rotation(bodies, first, top, h, poses, at):
    """A at h."""
    x, y, z = _sum_columns(bodies, first, top, 0, h)
    put(poses, at, x)
    put(poses, at + 4, y)
    put(poses, at + 8, z)


@kernel
def _rotate(bodies, first, top, h, poses, at, x, b, p):  # nine: the series, the pose, the body, scratch
    """A and p of body b at h, p + low = p_0 o (d0, d); False if the rotation since the start is too wide."""
    # A_0^T A(h) = I + h A_0^T sum_{k>0} A_k h^(k-1)
    u, v, w = _sum_columns(bodies, first, top, 1, h)
    i, j, k = four(bodies, first), four(bodies, first + 4), four(bodies, first + 8)
    square = 1.0 + 0.25 * h * total(fma(i, u, fma(j, v, times(k, w))))  # d0^2
    if not square > WIDE:
        return False
    # d0^2 from the trace, d from the skew part
    d0 = math.sqrt(square)
    f = 0.25 * h / d0
    d1, d2 = f * total(sub(times(k, v), times(j, w))), f * total(sub(times(i, w), times(k, u)))
    d3 = f * total(sub(times(j, u), times(i, v)))
    d0 = -(d1 * d1 + d2 * d2 + d3 * d3) / (1.0 + d0)  # d0 - 1
    # p = p_0 + p_0 o (d0 - 1, d)
    e0, e1, e2, e3 = x.start[4 * b], x.start[4 * b + 1], x.start[4 * b + 2], x.start[4 * b + 3]
    p[0] = e0 * d0 - e1 * d1 - e2 * d2 - e3 * d3
    p[1] = e1 * d0 + e0 * d1 - e3 * d2 + e2 * d3
    p[2] = e2 * d0 + e3 * d1 + e0 * d2 - e1 * d3
    p[3] = e3 * d0 - e2 * d1 + e1 * d2 + e0 * d3
    # added to p_0 with compensation
    l = LOW * b + L_P
    put_sum(poses, at + P, four(x.start, 4 * b), add(four(p, 0), four(x.low, l)), x.low_end, l)
    # Of unit length again: (1 - p.p) / 2 of p
    off = 1.0
    for n in range(4):
        off -= poses[at + P + n] * poses[at + P + n]
    change = fma(four(poses, at + P), splat(0.5 * off), four(x.low_end, l))
    put_sum(poses, at + P, four(poses, at + P), change, x.low_end, l)
    orient(poses, at, poses[at + P], poses[at + P + 1], poses[at + P + 2], poses[at + P + 3])
    return True


@kernel
def _parameters(poses, at, p):
    """Euler parameters of the matrix at poses[at], on the side of those there were; from the largest of the four."""
    # 4 e_i^2 from the diagonal, 4 e_i e_j from sums and differences beside it
    a, b, c = poses[at], poses[at + 5], poses[at + 10]  # the diagonal
    x, y, z = poses[at + 6] - poses[at + 9], poses[at + 8] - poses[at + 2], poses[at + 1] - poses[at + 4]
    u, v, w = poses[at + 9] + poses[at + 6], poses[at + 2] + poses[at + 8], poses[at + 4] + poses[at + 1]
    e0, e1, e2, e3 = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    largest = max(max(e0, e1), max(e2, e3))
    if largest == e0:
        p[0], p[1], p[2], p[3] = e0, x, y, z
    elif largest == e1:
        p[0], p[1], p[2], p[3] = x, e1, w, v
    elif largest == e2:
        p[0], p[1], p[2], p[3] = y, w, e2, u
    else:
        p[0], p[1], p[2], p[3] = z, v, u, e3
    normalise(p)
    # p and -p are the same orientation
    side = p[0] * poses[at + P] + p[1] * poses[at + P + 1] + p[2] * poses[at + P + 2] + p[3] * poses[at + P + 3]
    if side < 0.0:
        for i in range(4):
            p[i] = -p[i]
