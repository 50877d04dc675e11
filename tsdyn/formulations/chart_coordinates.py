"""Chart coordinates to body poses and velocities (the retraction), and accelerations back to chart coordinates.

omega'  = C etad,                           C = d0 I - d~ + d d^T / d0
etadd   = (d0 I + d~) omega'd - |omega'|^2 d / 2
N       = H(q) C Y0                         derivative of Phi with respect to -u
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, RD, R, orient
from ..jit.kernels import kernel
from ..jit.simd import add, cross, first, fma, four, get, lanes, larger, let, put, second, splat, third, times, total
from ..rows.interface import factorise_chart_matrix, rotate_rate
from .tolerances import FARTHEST


@kernel
def displace(graph, l, poses):
    """Set the poses at chart coordinates l.x; False if a body has rotated too far for the chart."""
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        # r = r0 + rho
        put(poses, at + R, fma(four(l.x, o), splat(1.0), four(l.base, o)))
        if graph.bodies[b, 1] == 7:
            # d = eta / 2,  d0 = sqrt(1 - |d|^2)
            x, y, z = 0.5 * get(l.x, o + 4), 0.5 * get(l.x, o + 5), 0.5 * get(l.x, o + 6)
            square = x * x + y * y + z * z
            if not square < FARTHEST:
                return False
            w = -square / (
                1.0 + math.sqrt(1.0 - square)
            )  # d0 - 1, not d0: its rounding would be the same in every step
            put(l.d, 4 * b, lanes(x, y, z))
            let(l.d, 4 * b + 3, w)
            # p = p0 o (d0, d)
            e0, e1, e2, e3 = get(l.base, o + 4), get(l.base, o + 5), get(l.base, o + 6), get(l.base, o + 7)
            p0 = e0 + (w * e0 - e1 * x - e2 * y - e3 * z)
            p1 = e1 + (w * e1 + e0 * x - e3 * y + e2 * z)
            p2 = e2 + (w * e2 + e3 * x + e0 * y - e1 * z)
            p3 = e3 + (w * e3 - e2 * x + e1 * y + e0 * z)
            f = 1.5 - 0.5 * (p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)  # rounding of many charts would add up
            orient(poses, at, f * p0, f * p1, f * p2, f * p3)
    return True


@kernel
def turn_rates(graph, l, rates, poses):
    """Set rd and omega' of the poses from rates of chart coordinates."""
    for b in range(graph.bodies.shape[0]):
        put(poses, b * POSE + RD, four(rates, 8 * b))
        if graph.bodies[b, 1] == 7:
            put(poses, b * POSE + OMEGA, rotate_rate(l, b, four(rates, 8 * b + 4)))


@kernel
def factorise_normal(graph, w, f, l):
    """Factorise N = H C Y0 at the present H; False if N is singular."""
    w.counters.factorizations += 1
    l.state.made = 1
    return factorise_chart_matrix(graph, f, l)


@kernel
def write_back(graph, l, poses, Z, out):
    """Set accelerations of chart coordinates (rhodd, etadd) from (rdd, omega'd); out (8 b,)."""
    for b in range(graph.bodies.shape[0]):
        o, at = 8 * b, b * POSE
        put(out, o, four(Z, o))
        if graph.bodies[b, 1] == 7:
            # etadd = (d0 I + d~) omega'd - |omega'|^2 d / 2
            x, y, z, w = get(l.d, 4 * b), get(l.d, 4 * b + 1), get(l.d, 4 * b + 2), get(l.d, 4 * b + 3)
            d, omega, change = lanes(x, y, z), four(poses, at + OMEGA), four(Z, o + 4)
            square = -0.5 * total(times(omega, omega))
            put(out, o + 4, add(change, fma(d, splat(square), fma(change, splat(w), cross(d, change)))))


@kernel
def turn_accelerations(graph, l, poses, yd, Z):
    """Set Z = (rdd, omega'd) from accelerations of chart coordinates: omega'd = C (etadd + |omega'|^2 d / 2)."""
    for b in range(graph.bodies.shape[0]):
        o, at = 8 * b, b * POSE + OMEGA
        put(Z, o, four(yd, o))
        if graph.bodies[b, 1] == 7:
            # omega'd = C (etadd + |omega'|^2 d / 2)
            omega = four(poses, at)
            d = lanes(l.d[4 * b], l.d[4 * b + 1], l.d[4 * b + 2])
            put(Z, o + 4, rotate_rate(l, b, fma(d, splat(0.5 * total(times(omega, omega))), four(yd, o + 4))))


@kernel
def to_bodies(graph, l, x, Z):
    """Z = (rho, C eta) of x = (rho, eta)."""
    for b in range(graph.bodies.shape[0]):
        put(Z, 8 * b, four(x, 8 * b))
        put(Z, 8 * b + 4, rotate_rate(l, b, four(x, 8 * b + 4)) if graph.bodies[b, 1] == 7 else splat(0.0))


@kernel
def largest_rates(graph, poses):
    """Return the largest entries of |rd| and |omega'|."""
    r, w = splat(0.0), splat(0.0)
    for b in range(graph.bodies.shape[0]):
        r, w = larger(four(poses, b * POSE + RD), r), larger(four(poses, b * POSE + OMEGA), w)
    return max(first(r), max(second(r), third(r))), max(first(w), max(second(w), third(w)))


@kernel
def turned_most(l):
    """Return the largest |d| of a body, the sine of half its rotation angle since q0."""
    most = 0.0
    for i in range(0, l.d.size, 4):
        most = max(most, l.d[i] * l.d[i] + l.d[i + 1] * l.d[i + 1] + l.d[i + 2] * l.d[i + 2])
    return math.sqrt(most)
