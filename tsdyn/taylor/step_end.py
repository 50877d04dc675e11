"""State at the end of a Taylor step: sums of the series, projected velocities, both with compensated summation.

A step changes r, rd, omega' and p by increments that are smaller than the state. What the additions lose to rounding is
kept from step to step in `Expansion.low`, a row a body: the state is (r, rd, omega', p) + low. The series of the next
step begin at the rounded state. Increments of p follow from the rotation since the start of the step,

    A_0^T A(h) = I + A_0^T sum_{k>0} A_k h^k,

whose rounding errors are in proportion to its angle; after more than about a radian p is read off A(h).
"""

import math
from typing import NamedTuple

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, P, R, orient
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..jit.kernels import kernel, long_kernel
from ..jit.predicates import any_of, below, both, choose, every, floor, within
from ..jit.simd import add, fma, four, get, let, put, splat, sub, times, total
from ..rows.interface import find_correction, multiply_rates
from .coefficients import put_sum
from .layout import L_OMEGA, L_P, L_R, L_RD, LOW
from .tolerances import MOST_PARTS, WIDE


@kernel
def keep_start(graph, poses, start):
    """Keep p of the poses, those at the start of a step."""
    for b in range(graph.bodies.shape[0]):
        put(start, 4 * b, four(poses, b * POSE + P))


class Tops(NamedTuple):
    """Highest orders of omega' in a step; those of r and A are one more."""

    least: int  # of all lanes
    most: int
    own: int  # of each lane; of one case all three are the same


@kernel
def tops_of(x):
    """Those of one case."""
    return Tops(x.order.top, x.order.top, x.order.top)


@kernel
def _coefficient(array, i, k, tops):
    """Coefficient k of r or A, at array[i]: zero in lanes of a lower order."""
    f = four(array, i)
    return f if k <= tops.least + 1 else choose(within(k - 1, tops.own), f, splat(0.0))


@kernel
def sum_series(graph, x, h, tops, poses, p):
    """The poses at h: A and r from coefficients up to top + 1, omega' up to top. A is made orthogonal by way of p.

    What the sums lose to rounding is x.low_end. x is an `Expansion`; h and tops are of one case or of lanes.
    """
    s, bodies, low, orders, most = splat(h), x.bodies, x.low, x.order.room, tops.most
    for b in range(graph.bodies.shape[0]):
        # Horner's scheme for r and rd together
        first, at, l = b * orders * BODY_ROW, b * POSE, LOW * b
        o = first + S_R * orders
        v, f, fd = four(bodies, o + 4), _coefficient(bodies, o + 4 * (most + 1), most + 1, tops), splat(0.0)
        for k in range(most, 1, -1):  # r = r_0 + h (v + h f),  rd = v + h (2 f + h fd)
            fd = fma(fd, s, f)
            f = fma(f, s, _coefficient(bodies, o + 4 * k, k, tops))
        # What the state lacks to rounding moves with it
        rest = fma(four(x.low_r2, 4 * b), s, four(low, l + L_RD))
        change = times(add(v, fma(f, s, rest)), s)
        put_sum(poses, at + R, four(bodies, o), add(change, four(low, l + L_R)), x.low_end, l + L_R)
        change = times(fma(fd, s, add(f, f)), s)
        put_sum(poses, at + RD, v, add(change, fma(four(x.low_r2, 4 * b), s, rest)), x.low_end, l + L_RD)
        if graph.bodies[b, 1] == 7:
            # omega'
            w, o = splat(0.0), first + S_OMEGA * orders
            for k in range(most, 0, -1):
                w = fma(w, s, _coefficient(bodies, o + 4 * k, k + 1, tops))
            change = fma(w, s, four(low, l + L_OMEGA))
            put_sum(poses, at + OMEGA, four(bodies, o), change, x.low_end, l + L_OMEGA)
            # Angle of the step, rad; in parts of one radian p can't change its sign unnoticed
            fast = 0.0
            for i in range(3):
                fast = max(fast, max(abs(get(bodies, o + i)), abs(get(poses, at + OMEGA + i))))
            _turn(x, b, h, floor(min(fast * abs(h), MOST_PARTS)) + 1.0, tops, poses, p)


@kernel
def _turn(x, b, h, parts, tops, poses, p):
    """A and p of body b at h: from the rotation of the step where it is narrow, else from A(h)."""
    at, l = b * POSE, LOW * b + L_P
    narrow = below(parts, 1.5)
    if any_of(narrow):
        # A_0^T A(h) = I + h A_0^T sum_{k>0} A_k h^(k-1)
        first = b * x.order.room * BODY_ROW
        u, v, w = _sum_columns(x, b, 1, h, tops)
        i, j, k = four(x.bodies, first), four(x.bodies, first + 4), four(x.bodies, first + 8)
        square = 1.0 + 0.25 * h * total(fma(i, u, fma(j, v, times(k, w))))  # d0^2
        narrow = both(narrow, below(WIDE, square))
        if any_of(narrow):
            # d0^2 from the trace, d from the skew part
            d0 = math.sqrt(max(square, WIDE))
            f = 0.25 * h / d0
            d1, d2 = f * total(sub(times(k, v), times(j, w))), f * total(sub(times(i, w), times(k, u)))
            d3 = f * total(sub(times(j, u), times(i, v)))
            d0 = -(d1 * d1 + d2 * d2 + d3 * d3) / (1.0 + d0)  # d0 - 1
            _compose(x, b, d0, d1, d2, d3, poses, p)
    # Wide rotations: p from A at the end of each part, on the side of the one before; p and -p are the same A
    if not every(narrow):
        e0, e1, e2, e3 = _follow(x, b, h, parts, tops, p)
        let(poses, at + P, choose(narrow, get(poses, at + P), e0))
        let(poses, at + P + 1, choose(narrow, get(poses, at + P + 1), e1))
        let(poses, at + P + 2, choose(narrow, get(poses, at + P + 2), e2))
        let(poses, at + P + 3, choose(narrow, get(poses, at + P + 3), e3))
        put(x.low_end, l, choose(narrow, four(x.low_end, l), splat(0.0)))
    orient(poses, at, get(poses, at + P), get(poses, at + P + 1), get(poses, at + P + 2), get(poses, at + P + 3))


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
def _sum_columns(x, b, until, h, tops):
    """Columns of sum_{k >= until} A_k h^(k - until) of body b."""
    s, bodies, first = splat(h), x.bodies, b * x.order.room * BODY_ROW
    top = tops.most + 1
    c = first + 12 * top
    u, v = _coefficient(bodies, c, top, tops), _coefficient(bodies, c + 4, top, tops)
    w = _coefficient(bodies, c + 8, top, tops)
    for k in range(tops.most, until - 1, -1):
        c = first + 12 * k
        u = fma(u, s, _coefficient(bodies, c, k, tops))
        v = fma(v, s, _coefficient(bodies, c + 4, k, tops))
        w = fma(w, s, _coefficient(bodies, c + 8, k, tops))
    return u, v, w


@kernel
def _compose(x, b, d0, d1, d2, d3, poses, p):
    """p + low = p_0 o (1 + d0, d) of body b, of unit length."""
    at, l = b * POSE, LOW * b + L_P
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    # p = p_0 + p_0 o (d0, d), added with compensation
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
def _follow(x, b, h, parts, tops, p):
    """p of body b at h, followed in so many parts of the step."""
    i = 1
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    while True:
        # Lanes with fewer parts stay at their end
        on = below(i - 0.5, parts)
        if not any_of(on):
            return e0, e1, e2, e3
        u, v, w = _sum_columns(x, b, 0, h * i / parts, tops)
        f0, f1, f2, f3 = _parameters(u, v, w, p, e0, e1, e2, e3)
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
    m0, m1, m2 = below(f0, largest), below(f1, largest), below(f2, largest)
    p0 = choose(m0, choose(m1, choose(m2, z, y), x), f0)
    p1 = choose(m0, choose(m1, choose(m2, e, f), f1), x)
    p2 = choose(m0, choose(m1, choose(m2, d, f2), f), y)
    p3 = choose(m0, choose(m1, choose(m2, f3, d), e), z)
    # Of unit length; p and -p are the same orientation
    scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    p0, p1, p2, p3 = p0 * scale, p1 * scale, p2 * scale, p3 * scale
    other = below(p0 * e0 + p1 * e1 + p2 * e2 + p3 * e3, 0.0)
    return choose(other, -p0, p0), choose(other, -p1, p1), choose(other, -p2, p2), choose(other, -p3, p3)
