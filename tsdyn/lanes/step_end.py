"""State at the end of each lane's step: sums of the series, as taylor/step_end.py has them for one case.

Each lane has its own order and length of step: coefficients above its order count as zero.
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, RD, P, R, orient
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..jit.kernels import kernel, long_kernel
from ..jit.lane_masks import any_of, below, both, choose, every, floor, opposite
from ..jit.simd import add, fma, four, get, let, put, splat, sub, times, total
from ..taylor.compensation import put_sum
from ..taylor.tolerances import MOST_PARTS, WIDE
from ..taylor.workspace import L_OMEGA, L_P, L_R, L_RD, LOW
from .context import TOP


@kernel
def _coefficient(array, i, k, least, top):
    """Coefficient k of a series, at array[i]: zero in the lanes whose top is below k; least is the lowest top."""
    f = four(array, i)
    return f if k <= least else choose(below(k - 0.5, top), f, splat(0.0 * top))


@long_kernel
def sum_series(c, h, least, most):
    """The poses at h, of lanes, after orders up to TOP; least and most are those of all lanes."""
    graph, x, poses, s = c.graph, c.expansion, c.tangent.poses, splat(h)
    bodies, low, orders, top = x.bodies, x.low, x.order.room, get(c.state, TOP)
    for b in range(graph.bodies.shape[0]):
        # Horner's scheme for r and rd together; orders above a lane's own count as zero
        first, at, l = b * orders * BODY_ROW, b * POSE, LOW * b
        o, zero = first + S_R * orders, splat(0.0 * h)
        v, f, fd = four(bodies, o + 4), zero, zero
        for k in range(most + 1, 1, -1):  # r = r_0 + h (v + h f),  rd = v + h (2 f + h fd)
            fd = fma(fd, s, f)
            f = fma(f, s, _coefficient(bodies, o + 4 * k, k, least + 1, top + 1.0))
        # What the state lacks to rounding moves with it
        rest = fma(four(x.low_r2, 4 * b), s, four(low, l + L_RD))
        change = times(add(v, fma(f, s, rest)), s)
        put_sum(poses, at + R, four(bodies, o), add(change, four(low, l + L_R)), x.low_end, l + L_R)
        change = times(fma(fd, s, add(f, f)), s)
        put_sum(poses, at + RD, v, add(change, fma(four(x.low_r2, 4 * b), s, rest)), x.low_end, l + L_RD)
        if graph.bodies[b, 1] == 7:
            # omega'
            w, o = zero, first + S_OMEGA * orders
            for k in range(most, 0, -1):
                w = fma(w, s, _coefficient(bodies, o + 4 * k, k, least, top))
            change = fma(w, s, four(low, l + L_OMEGA))
            put_sum(poses, at + OMEGA, four(bodies, o), change, x.low_end, l + L_OMEGA)
            # Angle of the step, rad
            fast = 0.0 * h
            for i in range(3):
                fast = max(fast, max(abs(get(bodies, o + i)), abs(get(poses, at + OMEGA + i))))
            parts = floor(min(fast * abs(h), MOST_PARTS)) + 1.0  # in which p is followed: it and -p are the same A
            _turn(c, b, h, parts, least, most)


@kernel
def _sum_columns(c, first, until, h, least, most):
    """Columns of sum_{k >= until} A_k h^(k - until), of the body whose series begins at `first`."""
    x, top = c.expansion, get(c.state, TOP) + 1.0
    bodies, s = x.bodies, splat(h)
    u = v = w = splat(0.0 * h)
    for k in range(most + 1, until - 1, -1):
        i = first + 12 * k
        u = fma(u, s, _coefficient(bodies, i, k, least + 1, top))
        v = fma(v, s, _coefficient(bodies, i + 4, k, least + 1, top))
        w = fma(w, s, _coefficient(bodies, i + 8, k, least + 1, top))
    return u, v, w


@kernel
def _turn(c, b, h, parts, least, most):
    """A and p of body b at h: from the rotation of the step where it is narrow, else from A(h)."""
    x, poses, at = c.expansion, c.tangent.poses, b * POSE
    first, l = b * x.order.room * BODY_ROW, LOW * b + L_P
    # A_0^T A(h) = I + h A_0^T sum_{k>0} A_k h^(k-1)
    u, v, w = _sum_columns(c, first, 1, h, least, most)
    i, j, k = four(x.bodies, first), four(x.bodies, first + 4), four(x.bodies, first + 8)
    square = 1.0 + 0.25 * h * total(fma(i, u, fma(j, v, times(k, w))))  # d0^2
    narrow = both(below(WIDE, square), below(parts, 1.5))
    # d0^2 from the trace, d from the skew part
    if any_of(narrow):
        d0 = math.sqrt(max(square, WIDE))
        f = 0.25 * h / d0
        d1, d2 = f * total(sub(times(k, v), times(j, w))), f * total(sub(times(i, w), times(k, u)))
        d3 = f * total(sub(times(j, u), times(i, v)))
        d0 = -(d1 * d1 + d2 * d2 + d3 * d3) / (1.0 + d0)  # d0 - 1
        _compose(c, b, d0, d1, d2, d3)
    # Wide rotations: p from A(h), followed on the way
    if not every(narrow):
        e0, e1, e2, e3 = _follow(c, first, b, h, parts, least, most)
        let(poses, at + P, choose(narrow, get(poses, at + P), e0))
        let(poses, at + P + 1, choose(narrow, get(poses, at + P + 1), e1))
        let(poses, at + P + 2, choose(narrow, get(poses, at + P + 2), e2))
        let(poses, at + P + 3, choose(narrow, get(poses, at + P + 3), e3))
        for n in range(4):
            let(x.low_end, l + n, choose(narrow, get(x.low_end, l + n), 0.0))
    orient(poses, at, get(poses, at + P), get(poses, at + P + 1), get(poses, at + P + 2), get(poses, at + P + 3))


@long_kernel
def _compose(c, b, d0, d1, d2, d3):
    """p + low = p_0 o (1 + d0, d) of body b, of unit length."""
    x, poses, p, at, l = c.expansion, c.tangent.poses, c.tangent.p, b * POSE, LOW * b + L_P
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    # p = p_0 + p_0 o (d0 - 1, d), added with compensation
    let(p, 0, e0 * d0 - e1 * d1 - e2 * d2 - e3 * d3)
    let(p, 1, e1 * d0 + e0 * d1 - e3 * d2 + e2 * d3)
    let(p, 2, e2 * d0 + e3 * d1 + e0 * d2 - e1 * d3)
    let(p, 3, e3 * d0 - e2 * d1 + e1 * d2 + e0 * d3)
    put_sum(poses, at + P, four(x.start, 4 * b), add(four(p, 0), four(x.low, l)), x.low_end, l)
    # Of unit length again: (1 - p.p) / 2 of p
    off = 1.0
    for n in range(4):
        off -= get(poses, at + P + n) * get(poses, at + P + n)
    change = fma(four(poses, at + P), splat(0.5 * off), four(x.low_end, l))
    put_sum(poses, at + P, four(poses, at + P), change, x.low_end, l)


@long_kernel
def _follow(c, first, b, h, parts, least, most):
    """p of body b at h, followed in so many parts of the step."""
    x, i = c.expansion, 1
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    while True:
        # Lanes with fewer parts stay at their end
        on = below(i - 0.5, parts)
        if not any_of(on):
            return e0, e1, e2, e3
        u, v, w = _sum_columns(c, first, 0, h * i / parts, least, most)
        f0, f1, f2, f3 = _parameters(u, v, w, c.tangent.p, e0, e1, e2, e3)
        e0, e1, e2, e3 = choose(on, f0, e0), choose(on, f1, e1), choose(on, f2, e2), choose(on, f3, e3)
        i += 1


@kernel
def _parameters(u, v, w, p, e0, e1, e2, e3):
    """Euler parameters of the matrix with columns u, v, w, on the side of e0 to e3; from the largest of the four."""
    # Entries of the matrix
    put(p, 0, u)
    a, u1, u2 = get(p, 0), get(p, 1), get(p, 2)
    put(p, 0, v)
    v0, b, v2 = get(p, 0), get(p, 1), get(p, 2)
    put(p, 0, w)
    w0, w1, c = get(p, 0), get(p, 1), get(p, 2)
    # 4 e0 e, 4 e_i e_j and 4 e_i^2
    x, y, z = v2 - w1, w0 - u2, u1 - v0
    d, e, f = w1 + v2, u2 + w0, v0 + u1
    f0, f1, f2, f3 = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    largest = max(max(f0, f1), max(f2, f3))
    # The first of the largest ones
    m0, m1, m2 = opposite(below(f0, largest)), opposite(below(f1, largest)), opposite(below(f2, largest))
    p0 = choose(m0, f0, choose(m1, x, choose(m2, y, z)))
    p1 = choose(m0, x, choose(m1, f1, choose(m2, f, e)))
    p2 = choose(m0, y, choose(m1, f, choose(m2, f2, d)))
    p3 = choose(m0, z, choose(m1, e, choose(m2, d, f3)))
    scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    # p and -p are the same orientation
    scale = choose(below(p0 * e0 + p1 * e1 + p2 * e2 + p3 * e3, 0.0), -scale, scale)
    return p0 * scale, p1 * scale, p2 * scale, p3 * scale
