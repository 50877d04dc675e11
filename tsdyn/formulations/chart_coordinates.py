"""Chart coordinates to body poses and velocities (the retraction), and accelerations back to chart coordinates.

omega'  = C etad,                           C = d0 I - d~ + d d^T / d0
etadd   = (d0 I + d~) omega'd - |omega'|^2 d / 2
N       = H(q) C Y0                         derivative of Phi with respect to -u
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, RD, R, orient
from ..jit.kernels import kernel, long_kernel, stack
from ..jit.simd import add, cross, first, fma, four, lanes, put, second, splat, sub, third, times, total
from ..rows.axis_rows import leave_axes_out
from ..rows.independent_rows import drop_diagonal
from ..rows.schur_complement import inner, more, multiply_both
from ..sparse.constraint_graph import (
    H_BODY,
    H_COLUMNS,
    H_KIND,
    H_LEFT,
    H_RIGHT,
    H_ROWS,
    H_STRIDE,
    H_TARGET,
    ROWS,
    ROWS_WELD,
    W_MASS,
    W_ROTATION,
    WEIGHTS,
    WELDS,
)
from ..sparse.factorisation import factor_lu
from ..workspaces.workspace import FACTORIZATIONS

FARTHEST = 0.9  # |d|^2: a body that has turned further is out of the chart's reach
PIVOT_LIMIT = 1e-13  # of N: less of a diagonal entry than this is rounding


@kernel
def displace(network, l, poses):
    """The poses at l.x; False where a body has turned too far."""
    for b in range(network.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        put(poses, at + R, fma(four(l.x, o), splat(1.0), four(l.base, o)))
        if network.bodies[b, 1] == 7:
            x, y, z = 0.5 * l.x[o + 4], 0.5 * l.x[o + 5], 0.5 * l.x[o + 6]
            square = x * x + y * y + z * z
            if not square < FARTHEST:
                return False
            w = -square / (
                1.0 + math.sqrt(1.0 - square)
            )  # d0 - 1, not d0: its rounding would be the same in every step
            put(l.d, 4 * b, lanes(x, y, z))
            l.d[4 * b + 3] = w
            e0, e1, e2, e3 = l.base[o + 4], l.base[o + 5], l.base[o + 6], l.base[o + 7]
            p0 = e0 + (w * e0 - e1 * x - e2 * y - e3 * z)
            p1 = e1 + (w * e1 + e0 * x - e3 * y + e2 * z)
            p2 = e2 + (w * e2 + e3 * x + e0 * y - e1 * z)
            p3 = e3 + (w * e3 - e2 * x + e1 * y + e0 * z)
            f = 1.5 - 0.5 * (p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)  # rounding of many charts would add up
            orient(poses, at, f * p0, f * p1, f * p2, f * p3)
    return True


@kernel
def _turn_by(l, b, y):
    """C y of body b, y in four lanes."""
    x, e, z, w = l.d[4 * b], l.d[4 * b + 1], l.d[4 * b + 2], l.d[4 * b + 3]
    d = lanes(x, e, z)
    along = total(times(d, y)) / (1.0 + w)
    return add(y, sub(fma(d, splat(along), times(y, splat(w))), cross(d, y)))


@kernel
def turn_rates(network, l, rates, poses):
    """rd and omega' of the poses, of rates in chart coordinates."""
    for b in range(network.bodies.shape[0]):
        put(poses, b * POSE + RD, four(rates, 8 * b))
        if network.bodies[b, 1] == 7:
            put(poses, b * POSE + OMEGA, _turn_by(l, b, four(rates, 8 * b + 4)))


@kernel
def _multiply_parts_both(network, l, H, lower, upper):
    """The products at the parts of hubs: X as in `factorise_normal`, and of the welds W0 before and C W0 after."""
    t = stack(12)
    for i in range(network.parts.shape[0]):
        part, scale = network.parts[i], network.scales[i]
        left, rows, right, columns = part[H_LEFT], part[H_ROWS], part[H_RIGHT], part[H_COLUMNS]
        target, stride, kind, b = part[H_TARGET], part[H_STRIDE], part[H_KIND], part[H_BODY]
        light, w = network.inverse[WEIGHTS * b + W_MASS], WEIGHTS * b + W_ROTATION
        if kind != ROWS and network.bodies[b, 1] == 7:
            for c in range(3):
                put(t, 4 * c, _turn_by(l, b, four(network.inverse, w + 4 * c)))
        for r in range(rows):
            for c in range(columns):
                at, h = target + r * stride + c, left + 16 * r
                if kind == ROWS:
                    other = right + 16 * c
                    if left != right or c >= r:
                        more(upper, at, scale * inner(H, h, l.X, other))
                    if left != right or c > r:
                        more(lower, at, scale * inner(H, other, l.X, h))
                elif kind == WELDS:
                    if r < 3 and r == c:
                        more(upper, at, scale * light)
                        more(lower, at, scale * light)
                    elif r >= 3 and c >= 3:
                        more(upper, at, scale * t[4 * (c - 3) + r - 3])
                        more(lower, at, scale * t[4 * (r - 3) + c - 3])
                else:
                    turned = light * H[h + c]
                    if c >= 3:
                        o = 4 * (c - 3)
                        turned = H[h + 4] * t[o] + H[h + 5] * t[o + 1] + H[h + 6] * t[o + 2]
                    placed = l.X[h + c + c // 3]
                    if kind == ROWS_WELD:
                        more(upper, at, scale * turned)
                        more(lower, at, scale * placed)
                    else:
                        more(upper, target + c * stride + r, scale * placed)
                        more(lower, target + c * stride + r, scale * turned)


@long_kernel
def factorise_normal(network, w, f, l):
    """Factors of N = H C Y0, H being that of the present place; whether there are any."""
    for e in range(network.sides.shape[0]):
        for k in range(2):
            at = 16 * e + 8 * k
            put(l.X, at, four(l.Y0, at))
            put(l.X, at + 4, _turn_by(l, network.sides[e, k], four(l.Y0, at + 4)))
    multiply_both(network, f.H, l.X, l.lower, l.upper)
    if network.parts.shape[0] > 0:
        _multiply_parts_both(network, l, f.H, l.lower, l.upper)
    for values in (l.lower, l.upper):
        drop_diagonal(network, f.dropped, values)
        leave_axes_out(network, values)
    w.counters[FACTORIZATIONS] += 1
    return factor_lu(network.pattern, l.lower, l.upper, PIVOT_LIMIT) < 0


@kernel
def gather_rates(network, H, poses, out):
    """out = H (rd, omega') of the poses."""
    for e in range(network.sides.shape[0]):
        at, a, b = 16 * e, network.sides[e, 0] * POSE + RD, network.sides[e, 1] * POSE + RD
        g = fma(four(H, at), four(poses, a), times(four(H, at + 4), four(poses, a + 4)))
        g = fma(four(H, at + 8), four(poses, b), fma(four(H, at + 12), four(poses, b + 4), g))
        out[e] = total(g)


@kernel
def write_back(network, l, poses, Z, out):
    """Accelerations (rhodd, etadd) of (rdd, omega'd); out (8 b,)."""
    for b in range(network.bodies.shape[0]):
        o, at = 8 * b, b * POSE
        put(out, o, four(Z, o))
        if network.bodies[b, 1] == 7:
            x, y, z, w = l.d[4 * b], l.d[4 * b + 1], l.d[4 * b + 2], l.d[4 * b + 3]
            d, omega, change = lanes(x, y, z), four(poses, at + OMEGA), four(Z, o + 4)
            square = -0.5 * total(times(omega, omega))
            put(out, o + 4, add(change, fma(d, splat(square), fma(change, splat(w), cross(d, change)))))


@kernel
def largest_rates(network, poses):
    """The largest |rd| and |omega'| entries."""
    r, w = 0.0, 0.0
    for b in range(network.bodies.shape[0]):
        f, g = four(poses, b * POSE + RD), four(poses, b * POSE + OMEGA)
        r = max(r, max(abs(first(f)), max(abs(second(f)), abs(third(f)))))
        w = max(w, max(abs(first(g)), max(abs(second(g)), abs(third(g)))))
    return r, w


@kernel
def turned_most(l):
    """The largest |d| of a body: the sine of half the angle."""
    most = 0.0
    for i in range(0, l.d.size, 4):
        most = max(most, l.d[i] * l.d[i] + l.d[i + 1] * l.d[i + 1] + l.d[i + 2] * l.d[i + 2])
    return math.sqrt(most)
