"""Charts: coordinates to poses and velocities (the retraction), accelerations back, derivatives; their validity."""

import math

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, P, R, orient, place_bodies
from ..jit.kernels import kernel, long_kernel, stack, stack2
from ..jit.simd import add, cross, first, fma, four, get, lanes, larger, let, put, second, splat, third, times, total
from ..maths.tolerances import ROUNDING, TINY
from ..rows.interface import (
    METRIC,
    accelerations_hold,
    clear_redundant,
    evaluate_rows,
    factorise_chart_matrix,
    factorise_rows,
    has_redundant_rows,
    pivot_loss,
    rates_hold,
    redundant_rows_hold,
    rotate_rate,
)
from .tolerances import CONTRACTION_LIMIT, FARTHEST, NO_SIZE, SAME, TURN_SHARE

# Chart coordinates to body poses and velocities (the retraction), and accelerations back to chart coordinates.
#
# omega'  = C etad,                           C = d0 I - d~ + d d^T / d0
# etadd   = (d0 I + d~) omega'd - |omega'|^2 d / 2
# N       = H(q) C Y0                         derivative of Phi with respect to -u


@kernel
def displace(graph, l, poses):
    """Set the poses at chart coordinates l.x; False if a body has rotated too far for the chart.

    In two passes: the square roots of the next bodies don't wait for the poses of those before.
    """
    for b in range(graph.bodies.shape[0]):
        if graph.bodies[b, 1] == 7:
            # d = eta / 2,  d0 = sqrt(1 - |d|^2)
            x, y, z = 0.5 * get(l.x, 8 * b + 4), 0.5 * get(l.x, 8 * b + 5), 0.5 * get(l.x, 8 * b + 6)
            square = x * x + y * y + z * z
            if not square < FARTHEST:
                return False
            put(l.d, 4 * b, lanes(x, y, z))
            # d0 - 1, not d0: its rounding would be the same in every step
            let(l.d, 4 * b + 3, -square / (1.0 + math.sqrt(1.0 - square)))
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        # r = r0 + rho
        put(poses, at + R, fma(four(l.x, o), splat(1.0), four(l.base, o)))
        if graph.bodies[b, 1] == 7:
            # p = p0 o (d0, d)
            x, y, z, w = get(l.d, 4 * b), get(l.d, 4 * b + 1), get(l.d, 4 * b + 2), get(l.d, 4 * b + 3)
            e0, e1, e2, e3 = get(l.base, o + 4), get(l.base, o + 5), get(l.base, o + 6), get(l.base, o + 7)
            p0 = e0 + (w * e0 - e1 * x - e2 * y - e3 * z)
            p1 = e1 + (w * e1 + e0 * x - e3 * y + e2 * z)
            p2 = e2 + (w * e2 + e3 * x + e0 * y - e1 * z)
            p3 = e3 + (w * e3 - e2 * x + e1 * y + e0 * z)
            f = 1.5 - 0.5 * (p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)  # rounding of many charts would add up
            orient(poses, at, f * p0, f * p1, f * p2, f * p3)
    return True


@kernel
def add_rate_residuals(graph, f, l, x):
    """f.b = A0 (x' - x) of rows on velocities, x' being l.x: a position solve moves bodies as these rows admit at q0.

    It moves by x' - x = -Y0 u. Without a residual of their own these rows would leave u to the path of the iteration.
    """
    if graph.rates.size > 0:
        _add_rate_residuals(graph, f, l, x)


@long_kernel
def _add_rate_residuals(graph, f, l, x):
    """Where there are such rows: not inlined."""
    for i in range(graph.rates.size):
        e, total = graph.rates[i], 0.0
        for side in range(2):
            body = graph.sides[e, side]
            for c in range(8 if body < graph.bodies.shape[0] else 0):
                total += l.rows0.H[16 * e + 8 * side + c] * (l.x[8 * body + c] - x[8 * body + c])
        f.b[e] = total
    clear_redundant(f, f.b)


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


# How accelerations and velocities of a body depend on its chart coordinates, for implicit methods.
#
#     omega'  = C etad                                        C = d0 I - d~ + d d^T / d0, its inverse d0 I + d~
#     etadd   = C^-1 omega'd - |omega'|^2 d / 2
#
# With dpi' = C deta and d = eta / 2,
#
#     domega' = B dpi' + C detad                              B = C_d etad C^-1 / 2
#     C detadd = domega'd + E dpi' - (d / d0) omega'^T domega'
#     E       = -C (omega'd d^T / d0 + omega'd~ + |omega'|^2 I / 2) C^-1 / 2


@kernel
def _cross_matrix(v, i, scale, diagonal, out):
    """out (3, 3) = scale v~ + diagonal I, v being v[i : i + 3]."""
    x, y, z = scale * v[i], scale * v[i + 1], scale * v[i + 2]
    out[0, 0], out[0, 1], out[0, 2] = diagonal, -z, y
    out[1, 0], out[1, 1], out[1, 2] = z, diagonal, -x
    out[2, 0], out[2, 1], out[2, 2] = -y, x, diagonal


@kernel
def _multiply(A, B, scale, out):
    """out = scale A B, all (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = scale * (A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j])


@kernel
def rate_by_turn(d, i, etad, j, out):
    """out (3, 3) = B at d[i : i + 4] = (d, d0 - 1), etad[j : j + 3]."""
    X, inverse, d0 = stack2(3, 3), stack2(3, 3), 1.0 + d[i + 3]
    # C_d etad = etad~ + (d.etad / d0) I + (d (etad + (d.etad / d0^2) d)^T - etad d^T) / d0
    along = d[i] * etad[j] + d[i + 1] * etad[j + 1] + d[i + 2] * etad[j + 2]
    _cross_matrix(etad, j, 1.0, along / d0, X)
    for r in range(3):
        for c in range(3):
            X[r, c] += (d[i + r] * (etad[j + c] + along * d[i + c] / (d0 * d0)) - etad[j + r] * d[i + c]) / d0
    # C^-1 = d0 I + d~;  B = C_d etad C^-1 / 2
    _cross_matrix(d, i, 1.0, d0, inverse)
    _multiply(X, inverse, 0.5, out)


@kernel
def acceleration_by_turn(d, i, omega, j, omegad, k, out):
    """out (3, 3) = E at d[i : i + 4], omega'[j : j + 3], omega'd[k : k + 3]."""
    X, Y, C, d0 = stack2(3, 3), stack2(3, 3), stack2(3, 3), 1.0 + d[i + 3]
    # X = omega'd d^T / d0 + omega'd~ + |omega'|^2 I / 2
    square = omega[j] * omega[j] + omega[j + 1] * omega[j + 1] + omega[j + 2] * omega[j + 2]
    _cross_matrix(omegad, k, 1.0, 0.5 * square, X)
    for r in range(3):
        for c in range(3):
            X[r, c] += omegad[k + r] * d[i + c] / d0
    # C = d0 I - d~ + d d^T / d0
    _cross_matrix(d, i, -1.0, d0, C)
    for r in range(3):
        for c in range(3):
            C[r, c] += d[i + r] * d[i + c] / d0
    # E = -C X C^-1 / 2
    _multiply(C, X, 1.0, Y)
    _cross_matrix(d, i, 1.0, d0, C)
    _multiply(Y, C, -0.5, out)


@kernel
def _add_weighted(mass, i, X, out):
    """out[21 + 6 r + c] += J' X, the columns of J' being at mass[i + 4 c]."""
    for r in range(3):
        for c in range(3):
            total = 0.0
            for a in range(3):
                total += mass[i + 4 * a + r] * X[a, c]
            out[21 + 6 * r + c] += total


@kernel
def add_gyroscopic(mass, i, omega, j, C):
    """Add the derivative of -omega' x J' omega' to a block C."""
    momentum, turned, Jw, w = stack2(3, 3), stack2(3, 3), stack(3), stack2(3, 3)
    # (-omega' x J' omega')_omega' = (J' omega')~ - omega'~ J'
    for r in range(3):
        Jw[r] = mass[i + r] * omega[j] + mass[i + 4 + r] * omega[j + 1] + mass[i + 8 + r] * omega[j + 2]
    _cross_matrix(Jw, 0, 1.0, 0.0, momentum)
    _cross_matrix(omega, j, 1.0, 0.0, w)
    for r in range(3):
        for c in range(3):
            turned[r, c] = momentum[r, c]
            for a in range(3):
                turned[r, c] -= w[r, a] * mass[i + 4 * c + a]
            C[21 + 6 * r + c] += turned[r, c]


@kernel
def add_inertia(mass, i, E, B, d, j, omega, k, K, C):
    """Add J' times what a motion changes of C etadd at constant omega'd to the blocks K and C of a body.

    Ten arguments: where J', the two matrices, d and omega' are, and the blocks.
    """
    X, Y, d0 = stack2(3, 3), stack2(3, 3), 1.0 + d[j + 3]
    # X = -(d / d0) omega'^T, the derivative of C etadd by omega'
    for r in range(3):
        for c in range(3):
            X[r, c] = -d[j + r] * omega[k + c] / d0
    # K += J' (E + X B),  C += J' X
    _multiply(X, B, 1.0, Y)
    for r in range(3):
        for c in range(3):
            Y[r, c] += E[r, c]
    _add_weighted(mass, i, Y, K)
    _add_weighted(mass, i, X, C)


# Validity of a chart in the tangent form. It is abandoned at the end of a step when one of two criteria is met, the
# same in every form. In the mass metric they depend neither on units nor on the scaling of rows or lever arms:
#
#     contraction    max |1 - n / s|, with n and s the pivots of N = H C Y0 and of S0 = H0 W0 H0^T: the relative loss of
#                    a pivot since q0; 1 where a normal direction of q0 is tangent to the manifold
#     turn           |d|, the sine of half the angle by which a body has rotated since q0

# reasons to leave a chart, as stored; REASONS names them
STAY, BY_CONTRACTION, BY_TURN, BY_INTERVAL, BY_FAILURE, AT_START, BY_SERIES = range(7)
REASONS = (
    "",
    "contraction",
    "turn of a body",
    "chart_interval",
    "failed step",
    "start",
    "step of a series",
)


@kernel
def extent(w):
    """How large the scene is, m."""
    return max(w.control.floor / ROUNDING, NO_SIZE if w.control.size == 0.0 else 0.0)


@kernel
def set_base_point(graph, system, w, f, l, t, largest):
    """Make the chart at w.q: base, H0, Y0, factors of S0. True if the rows of H0 are independent.

    largest is the largest coordinate that enters Phi, m, as the form has it.
    """
    regular = True
    # H0, Y0 = W0 H0^T and S0 = H0 W0 H0^T
    place_bodies(graph.bodies, w.q, f.poses)
    evaluate_rows(graph, system, f, l.rows0, t)
    if f.b.size > 0:
        w.counters.factorizations += 1
        regular = factorise_rows(graph, system, f, l.rows0, t, METRIC)
    # Base point (r0, p0), where d = 0
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        for c in range(3):
            l.base[o + c] = f.poses[at + R + c]
            l.d[4 * b + c] = 0.0
        for c in range(4):
            l.base[o + 4 + c] = f.poses[at + P + c]
        l.d[4 * b + 3] = 0.0
    w.counters.charts += 1
    w.control.floor = ROUNDING * (w.control.size + largest)
    w.control.contraction, w.control.condition = 0.0, 1.0
    l.state.time, l.state.factored, l.state.made = t, 0, 0
    return regular


@kernel
def measure_turns(graph, l, q):
    """l.d of positions q; (d0, d) = p0* o p."""
    for b in range(graph.bodies.shape[0]):
        # d0 - 1, not d0, is kept: it is small
        if graph.bodies[b, 1] == 7:
            i, o = graph.bodies[b, 0] + 3, 8 * b + 4
            e0, e1, e2, e3 = l.base[o], l.base[o + 1], l.base[o + 2], l.base[o + 3]
            p0, p1, p2, p3 = q[i], q[i + 1], q[i + 2], q[i + 3]
            l.d[4 * b] = -e1 * p0 + e0 * p1 + e3 * p2 - e2 * p3
            l.d[4 * b + 1] = -e2 * p0 - e3 * p1 + e0 * p2 + e1 * p3
            l.d[4 * b + 2] = -e3 * p0 + e2 * p1 - e1 * p2 + e0 * p3
            l.d[4 * b + 3] = e0 * p0 + e1 * p1 + e2 * p2 + e3 * p3 - 1.0


@kernel
def reason_to_leave(graph, w, f, l):
    """Return the reason to abandon the chart at l.d and f.rows, or STAY; records contraction and condition."""
    turn, contraction = turned_most(l), 0.0
    # max |1 - n / s|, by the factors of the last position solve if they are those of the present H
    if f.b.size > 0:
        known = l.state.factored == 1 and l.state.off < SAME
        w.counters.kept += 1 if known else 0
        contraction = pivot_loss(graph, l) if known or factorise_normal(graph, w, f, l) else math.inf
    l.state.factored = 0  # dense output may change the factors before the next step
    w.control.contraction = max(contraction, TURN_SHARE * turn)
    w.control.condition = (1.0 + w.control.contraction) / max(1.0 - w.control.contraction, TINY)
    if not contraction < CONTRACTION_LIMIT:
        return BY_CONTRACTION
    return STAY if turn < l.state.turn_limit else BY_TURN


@kernel
def every_level_holds(c):
    """Return True if the redundant rows hold at q, qd and qdd, where all rows have been evaluated."""
    w, f, graph = c.work, c.tangent, c.graph
    if not has_redundant_rows(f):
        return True
    # Phi, Phi_q qd + Phi_t and Phi_q qdd + gamma of the dropped rows, against the sizes of their terms
    size = w.control.size
    held = redundant_rows_hold(graph, f, w.control.floor) and rates_hold(graph, f, w.q, w.qd, size)
    return held and accelerations_hold(graph, f, w.q, w.qd, w.qdd, size)
