"""Taylor coefficients of the motion of all bodies, order by order, from the state at order zero."""

from fractions import Fraction

import numpy as np

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, R
from ..elements.loops.constraint_series import ADVANCE, BODY_ROW, RESIDUAL, S_OMEGA, S_R, S_SPIN, call_series
from ..jit.kernels import kernel
from ..jit.simd import add, cross, fetch, first, fma, four, get, lanes, put, second, splat, sub, third, times
from ..maths.dense_linalg import copy
from ..rows.interface import add_products, clear_sums, note_loads, solve_series, weigh

# Sums with their rounding errors.


@kernel
def put_sum(out, at, high, change, low, i):
    """out[at : at + 4] = high + change, rounded; low[i : i + 4] is the rounding error (two-sum)."""
    # Knuth's two-sum: low is the rounding error of the sum, exactly
    rounded = add(high, change)
    taken = sub(rounded, high)
    put(out, at, rounded)
    put(low, i, add(sub(high, sub(rounded, taken)), sub(change, taken)))


# Taylor coefficients of the motion of all bodies, order by order, from the state at order zero.
#
#     (k+1) A_{k+1}           = sum_j A_j omega'~_{k-j}                                            (1)
#     (k+1)(k+2) m r_{k+2}    = F_k - [Phi_r^T lam]_k                                              (2)
#     (k+1) J' omega'_{k+1}   = tau'_k - sum_j omega'_j x (J' omega')_{k-j} - [Phi_pi'^T lam]_k    (3)
#     Phi_{k+2}               = 0                                                                  (4)
#
# (4) is linear in lam_k: S lam_k = (k+1)(k+2) Phi_{k+2}, the right-hand side evaluated by (1)-(3) with lam_k = 0. The
# Schur complement S = H W H^T is that of order zero for every k, so it is factorised once a step.

MOST_ORDERS = 64


def _inverse(n):
    """1 / n as the sum of two floats."""
    high = 1.0 / n
    return high, float(Fraction(1, n) - Fraction(high))


# What an integral, or two of them, divide order k by; in two floats
ONE_INTEGRAL = np.array([_inverse(k + 1) for k in range(MOST_ORDERS)])
TWO_INTEGRALS = np.array([_inverse((k + 1) * (k + 2)) for k in range(MOST_ORDERS)])


@kernel
def begin(graph, system, poses, orders, bodies, Z):
    """Order zero of all bodies, order one of their places, and the forces of order zero but those of a series."""
    for b in range(graph.bodies.shape[0]):
        # A_0, r_0, r_1 and omega'_0 of the pose; Z begins with gravity and the gyroscopic torque
        at, p, m = b * orders * BODY_ROW, b * POSE, graph.mass[16 * b]
        for c in range(3):
            put(bodies, at + 4 * c, four(poses, p + 4 * c))
        put(bodies, at + S_R * orders, four(poses, p + R))
        put(bodies, at + S_R * orders + 4, four(poses, p + RD))
        put(Z, 8 * b, lanes(m * system.gravity[0], m * system.gravity[1], m * system.gravity[2]))
        if graph.bodies[b, 1] == 7:
            put(bodies, at + S_OMEGA * orders, four(poses, p + OMEGA))
            # A_1 = A_0 omega'~_0, and A_2 but for omega'_1
            put(bodies, at + 12, splat(0.0))
            put(bodies, at + 16, splat(0.0))
            put(bodies, at + 20, splat(0.0))
            turn(bodies, at, 1, four(poses, p + OMEGA))
            turn_ahead(bodies, at, orders, 1, False)
            put(Z, 8 * b + 4, spin(graph, b, bodies, at, orders, 0))


@kernel
def put_momentum(graph, b, bodies, o, spins, k):
    """(J' omega')_k at bodies[spins + 4 k], from omega' at bodies[o]."""
    w = 16 * b + 4
    f = times(four(graph.mass, w), splat(get(bodies, o + 4 * k)))
    f = fma(four(graph.mass, w + 4), splat(get(bodies, o + 4 * k + 1)), f)
    put(bodies, spins + 4 * k, fma(four(graph.mass, w + 8), splat(get(bodies, o + 4 * k + 2)), f))


@kernel
def spin(graph, b, bodies, at, orders, k):
    """(J' omega')_k and the gyroscopic torque of order k; the body's series begins at bodies[at]."""
    torque = splat(0.0)
    if graph.spins[b] != 0:
        o, spins = at + S_OMEGA * orders, at + S_SPIN * orders
        # -sum_j omega'_j x (J' omega')_{k-j}
        put_momentum(graph, b, bodies, o, spins, k)
        for j in range(k + 1):
            torque = add(torque, cross(four(bodies, spins + 4 * (k - j)), four(bodies, o + 4 * j)))
    return torque


@kernel
def _fetch_next(bodies, at, orders, count, k):
    """Have the series of the body at bodies[at] brought into the cache: the beginning of A, and where order k goes."""
    fetch(bodies, at, count)
    fetch(bodies, at + 12 * k, 12)
    fetch(bodies, at + S_R * orders + 4 * k, 4)
    fetch(bodies, at + S_OMEGA * orders + 4 * (k - 1), 4)


@kernel
def turn(bodies, at, k, change):
    """A_k += A_0 change~, the part of (1) that is linear in the last omega'."""
    # Columns of A_0 change~ are differences of two columns of A_0
    w0, w1, w2, o = splat(first(change)), splat(second(change)), splat(third(change)), at + 12 * k
    a0, a1, a2 = four(bodies, at), four(bodies, at + 4), four(bodies, at + 8)
    put(bodies, o, add(four(bodies, o), sub(times(a1, w2), times(a2, w1))))
    put(bodies, o + 4, add(four(bodies, o + 4), sub(times(a2, w0), times(a0, w2))))
    put(bodies, o + 8, add(four(bodies, o + 8), sub(times(a0, w1), times(a1, w0))))


@kernel
def turn_ahead(bodies, at, orders, k, exact):
    """A_{k+1} of (1) but for omega'_k."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    u, v, w = splat(0.0), splat(0.0), splat(0.0)
    # sum_{j>0} A_j omega'~_{k-j}
    o = at + S_OMEGA * orders + 4 * (k - 1)
    for c in range(at + 12, at + 12 * (k + 1), 12):
        a0, a1, a2 = four(bodies, c), four(bodies, c + 4), four(bodies, c + 8)
        w0, w1, w2 = splat(get(bodies, o)), splat(get(bodies, o + 1)), splat(get(bodies, o + 2))
        x, u = fma(a1, w2, x), fma(a2, w1, u)  # six sums, since each waits for its last
        y, v = fma(a2, w0, y), fma(a0, w2, v)
        z, w = fma(a0, w1, z), fma(a1, w0, w)
        o -= 4
    o, (f, _, low, _) = at + 12 * (k + 1), inverses(k, exact)
    # over k + 1
    put_product(bodies, o, sub(x, u), f, low, exact)
    put_product(bodies, o + 4, sub(y, v), f, low, exact)
    put_product(bodies, o + 8, sub(z, w), f, low, exact)


@kernel
def exact_product(x, f, low):
    """x (f + low), rounded once where the processor can."""
    return fma(x, f, times(x, low))


@kernel
def put_product(array, o, x, f, low, exact):
    """array[o : o + 4] = x (f + low), low being zero unless `exact`."""
    if exact:
        put(array, o, exact_product(x, f, low))
    else:
        put(array, o, times(x, f))


@kernel
def inverses(k, exact):
    """g + g_low = 1 / (k + 1) and h + h_low = 1 / ((k + 1) (k + 2)) as g, h, g_low, h_low, low parts only if exact."""
    g, h, g_low, h_low = splat(ONE_INTEGRAL[k, 0]), splat(TWO_INTEGRALS[k, 0]), splat(0.0), splat(0.0)
    if exact:
        g_low, h_low = splat(ONE_INTEGRAL[k, 1]), splat(TWO_INTEGRALS[k, 1])
    return g, h, g_low, h_low


@kernel
def run_loops(graph, reals, mode, k, x, f):
    """One mode of the series loops of every kind; x is an `Expansion`, f a `TangentWorkspace`."""
    if mode == RESIDUAL:
        clear_sums(graph, f.b)
    for i in range(graph.kinds.shape[0]):
        kind, series = graph.kinds[i], x.places[i]
        call_series(
            series.loop, mode, k, series, graph.table[kind.table :], reals[kind.reals :],
            x.bodies, x.constraints[series.values :], f.b, f.Z,
        )  # fmt: skip


@kernel
def run_forces(reals, x, k, f):
    """Order k of all forces, onto Z; at k = 0 the poses are those of order zero."""
    for i in range(x.forces.shape[0]):
        kind = x.forces[i]
        if kind.run != 0:
            x.loads[kind.values] = x.order.time
        call_series(
            kind.loop, kind.run, k, kind, x.table[kind.table :], reals[kind.reals :],
            x.bodies, x.loads[kind.values :], f.poses, f.Z,
        )  # fmt: skip


@kernel
def expand(graph, system, k, last, ahead, refine, x, f):
    """Order k of the forces and multipliers, k + 1 of omega', k + 2 of r and A; k in turn from zero, after `begin`.

    On entry Z has the gyroscopic torques of order k, and A_{k+2} what (1) has without omega'_{k+1}; on exit both are
    of the next order, unless this is the last one. lam_k stays in b until then.

    low_r2 is the rounding error of r_2 where factors are exact: gravity is rounded to the last place of a larger
    acceleration, with an error of the same sign in many steps.

    The first `refine` orders of lam are refined, `order.sweeps` times each. If more than lam_0, factors 1 / n are exact
    as well: their rounding errors have the same sign in every step, and add up. With `ahead`, a constant, the next
    body's numbers are prefetched: that pays where the series don't fit into the cache. x is an `Expansion`, f a
    `TangentWorkspace`.
    """
    bodies, Z, orders = x.bodies, f.Z, x.order.room
    nb, size = graph.bodies.shape[0], orders * BODY_ROW
    # F_k and tau'_k without lam_k: reactions by earlier multipliers, then applied forces
    run_loops(graph, system.reals, ADVANCE, k, x, f)
    run_forces(system.reals, x, k, f)
    # Factors 1 / (k + 1) and 1 / ((k + 1) (k + 2))
    exact = refine > 1
    inverse = g, h, g_low, h_low = inverses(k, exact)
    for b in range(nb):
        # Eqs. (2), (3) and (1) with lam_k = 0
        at = b * size
        if ahead:
            _fetch_next(bodies, at + size, orders, 12, k + 2)
        weigh(graph.inverse, b, Z, 8 * b, Z, 8 * b)
        put_product(bodies, at + S_R * orders + 4 * (k + 2), four(Z, 8 * b), h, h_low, exact)
        if graph.bodies[b, 1] == 7:
            put_product(bodies, at + S_OMEGA * orders + 4 * (k + 1), four(Z, 8 * b + 4), g, g_low, exact)
            turn(bodies, at, k + 2, exact_product(four(Z, 8 * b + 4), h, h_low))
    # Rounding of r_2 begins at zero in every step
    if k == 0:
        x.low_r2[:] = 0.0
        note_loads(f)
    # Refinement: solve, apply, and solve again for what Phi_{k+2} still lacks
    refined = k < refine
    if refined:
        for sweep in range(x.order.sweeps):
            _solve(graph, system, k, x, f, sweep > 0, exact)
            if sweep == 0:
                copy(f.b, f.gamma)
            else:
                for e in range(f.b.size):
                    f.gamma[e] += f.b[e]
            for b in range(nb):
                change(graph, b, x, k, inverse, exact, Z)
    # Eq. (4) for lam_k, or for the last correction of it
    _solve(graph, system, k, x, f, refined, exact)
    if refined:
        for e in range(f.b.size):
            f.b[e] += f.gamma[e]
    for b in range(nb):
        # r_{k+2}, omega'_{k+1}, A_{k+2} with lam_k; then what order k + 1 begins with
        at = b * size
        if ahead:
            _fetch_next(bodies, at + size, orders, 12 * (k + 3), k + 2)
            fetch(bodies, at + size + S_OMEGA * orders, 4 * (k + 1))
            fetch(bodies, at + size + S_SPIN * orders, 4 * (k + 2))
        change(graph, b, x, k, inverse, exact, Z)
        put(Z, 8 * b, splat(0.0))
        if graph.bodies[b, 1] == 7 and not last:
            put(Z, 8 * b + 4, spin(graph, b, bodies, at, orders, k + 1))
            turn_ahead(bodies, at, orders, k + 2, exact)


@kernel
def _solve(graph, system, k, x, f, refined, exact):
    """b = lam_k, or if `refined` its correction of gamma, and Z = -W H^T lam_k.

    With `exact`, the residual of lam_0 includes low_r2.
    """
    orders = x.order.room
    # (k + 1)(k + 2) Phi_{k+2} of the coefficients so far
    run_loops(graph, system.reals, RESIDUAL, k, x, f)
    if k == 0 and refined and exact:
        for b in range(graph.bodies.shape[0]):
            # 2 r_2 is an acceleration: H of its rounding error
            put(f.Z, 8 * b, times(four(x.low_r2, 4 * b), splat(2.0)))
            put(f.Z, 8 * b + 4, splat(0.0))
        add_products(graph, f.rows, f.Z, f.b)
    # S lam_k = that
    solve_series(graph, f, x.bodies, S_OMEGA * orders + 4 * (k + 1), BODY_ROW * orders, k, refined)


@kernel
def change(graph, b, x, k, inverse, exact, Z):
    """Add the effect of accelerations Z to r_{k+2}, omega'_{k+1}, A_{k+2} of a body; inverse, exact: see `inverses`."""
    g, h, g_low, h_low = inverse
    bodies, orders = x.bodies, x.order.room
    at = b * orders * BODY_ROW
    push, o = four(Z, 8 * b), at + S_R * orders + 4 * (k + 2)
    # r_{k+2} += Z_r / ((k + 1) (k + 2)), at order zero with its rounding error
    if exact and k == 0:
        low = four(x.low_r2, 4 * b)
        put_sum(bodies, o, four(bodies, o), times(push, h), x.low_r2, 4 * b)
        put(x.low_r2, 4 * b, add(four(x.low_r2, 4 * b), low))
    elif exact:
        put(bodies, o, add(four(bodies, o), exact_product(push, h, h_low)))
    else:
        put(bodies, o, fma(push, h, four(bodies, o)))
    if graph.bodies[b, 1] == 7:
        # omega'_{k+1} += Z_omega / (k + 1), and A_{k+2} by Eq. (1)
        twist, o = four(Z, 8 * b + 4), at + S_OMEGA * orders + 4 * (k + 1)
        if exact:
            put(bodies, o, add(four(bodies, o), exact_product(twist, g, g_low)))
        else:
            put(bodies, o, fma(twist, g, four(bodies, o)))
        turn(bodies, at, k + 2, exact_product(twist, h, h_low))
