"""Taylor coefficients of the motion of all bodies, order by order, from the state at order zero.

    (k+1) A_{k+1}           = sum_j A_j omega'~_{k-j}                                            (1)
    (k+1)(k+2) m r_{k+2}    = F_k - [Phi_r^T lam]_k                                              (2)
    (k+1) J' omega'_{k+1}   = T_k - sum_j omega'_j x (J' omega')_{k-j} - [Phi_pi'^T lam]_k       (3)
    Phi_{k+2}               = 0                                                                  (4)

(4) is linear in lam_k: S lam_k = (k+1)(k+2) Phi_{k+2} with what (1)-(3) give for lam_k = 0, and S = H W H^T at order
zero for every k, factorised once a step.
"""

from ._four import add, cross, fma, four, lanes, put, splat, sub, times
from ._kernel import kernel
from .block_kernels import solve
from .network import N_COUNT, N_FIRST_INT, N_FIRST_REAL, N_REALS
from .normal import scatter, weigh
from .poses import OMEGA, POSE, RD, R
from .series_loops import ADVANCE, BODY_ROW, RESIDUAL, S_OMEGA, S_R, S_SPIN, call_series


@kernel
def begin(network, system, poses, orders, bodies, Z):
    """Order zero of all bodies, order one of their places, and the forces of order zero but those of a series."""
    for b in range(network.bodies.shape[0]):
        at, p, m = b * orders * BODY_ROW, b * POSE, network.mass[16 * b]
        for c in range(3):
            put(bodies, at + 4 * c, four(poses, p + 4 * c))
        put(bodies, at + S_R * orders, four(poses, p + R))
        put(bodies, at + S_R * orders + 4, four(poses, p + RD))
        put(Z, 8 * b, lanes(m * system.gravity[0], m * system.gravity[1], m * system.gravity[2]))
        if network.bodies[b, 1] == 7:
            put(bodies, at + S_OMEGA * orders, four(poses, p + OMEGA))
            _turn_on(bodies, at, orders, 0)
            put(Z, 8 * b + 4, _spin(network, b, bodies, at, orders, 0))


@kernel
def _spin(network, b, bodies, at, orders, k):
    """(J' omega')_k and the gyroscopic torque of order k; the body's series begins at bodies[at]."""
    torque = splat(0.0)
    if network.spins[b] != 0:
        w, o, spins = 16 * b + 4, at + S_OMEGA * orders, at + S_SPIN * orders
        f = times(four(network.mass, w), splat(bodies[o + 4 * k]))
        f = fma(four(network.mass, w + 4), splat(bodies[o + 4 * k + 1]), f)
        put(bodies, spins + 4 * k, fma(four(network.mass, w + 8), splat(bodies[o + 4 * k + 2]), f))
        for j in range(k + 1):
            torque = add(torque, cross(four(bodies, spins + 4 * (k - j)), four(bodies, o + 4 * j)))
    return torque


@kernel
def _turn_on(bodies, at, orders, k):
    """A_{k+1} of (1)."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    u, v, w = splat(0.0), splat(0.0), splat(0.0)
    o = at + S_OMEGA * orders + 4 * k
    for c in range(at, at + 12 * (k + 1), 12):
        a0, a1, a2 = four(bodies, c), four(bodies, c + 4), four(bodies, c + 8)
        w0, w1, w2 = splat(bodies[o]), splat(bodies[o + 1]), splat(bodies[o + 2])
        x, u = fma(a1, w2, x), fma(a2, w1, u)  # six sums, since each waits for its last
        y, v = fma(a2, w0, y), fma(a0, w2, v)
        z, w = fma(a0, w1, z), fma(a1, w0, w)
        o -= 4
    o, f = at + 12 * (k + 1), splat(1.0 / (k + 1))
    put(bodies, o, times(sub(x, u), f))
    put(bodies, o + 4, times(sub(y, v), f))
    put(bodies, o + 8, times(sub(z, w), f))


@kernel
def run_loops(network, reals, mode, k, orders, bodies, values, places, b, Z):
    """One mode of the series loops of every kind."""
    for i in range(network.kinds.shape[0]):
        kind = network.kinds[i]
        call_series(
            places[i, 0], mode, k, orders, kind[N_COUNT], kind[N_REALS], network.table[kind[N_FIRST_INT] :],
            reals[kind[N_FIRST_REAL] :], bodies, values[places[i, 1] :], b, Z,
        )  # fmt: skip


@kernel
def run_forces(reals, x, k, orders, poses, Z):
    """Order k of all forces, onto Z; at k = 0 the poses are those of order zero."""
    for i in range(x.forces.shape[0]):
        kind = x.forces[i]
        call_series(
            kind[0], 0, k, orders, kind[2], kind[3], x.table[kind[4] :], reals[kind[5] :], x.bodies,
            x.loads[kind[1] :], poses, Z,
        )  # fmt: skip


@kernel
def expand(network, system, k, orders, x, f):
    """Order k of the forces and multipliers, k + 1 of omega', k + 2 of r and A; k in turn from zero, after `begin`.

    On entry Z has the gyroscopic torques of order k, on exit those of k + 1; lam_k stays in b until then.

    x is a `taylor.Expansion`, f a `workspace.Free`.
    """
    bodies, Z = x.bodies, f.Z
    nb = network.bodies.shape[0]
    run_loops(network, system.reals, ADVANCE, k, orders, bodies, x.constraints, x.places, f.b, Z)
    run_forces(system.reals, x, k, orders, f.poses, Z)
    g, h = 1.0 / (k + 1), 1.0 / ((k + 1) * (k + 2))
    for b in range(nb):
        at = b * orders * BODY_ROW
        weigh(network.inverse, b, Z, 8 * b, Z, 8 * b)
        put(bodies, at + S_R * orders + 4 * (k + 2), times(four(Z, 8 * b), splat(h)))
        if network.bodies[b, 1] == 7:
            put(bodies, at + S_OMEGA * orders + 4 * (k + 1), times(four(Z, 8 * b + 4), splat(g)))
            _turn_on(bodies, at, orders, k + 1)
    run_loops(network, system.reals, RESIDUAL, k, orders, bodies, x.constraints, x.places, f.b, Z)
    solve(network.pattern, f.S, f.b)
    for i in range(Z.size):
        Z[i] = 0.0
    scatter(network, f.Y, f.b, Z)
    for b in range(nb):
        at = b * orders * BODY_ROW
        o = at + S_R * orders + 4 * (k + 2)
        put(bodies, o, fma(four(Z, 8 * b), splat(h), four(bodies, o)))
        put(Z, 8 * b, splat(0.0))
        if network.bodies[b, 1] == 7:
            o = at + S_OMEGA * orders + 4 * (k + 1)
            put(bodies, o, fma(four(Z, 8 * b + 4), splat(g), four(bodies, o)))
            w0, w1, w2 = h * Z[8 * b + 4], h * Z[8 * b + 5], h * Z[8 * b + 6]  # A_0 of the change of omega'
            a0, a1, a2, o = four(bodies, at), four(bodies, at + 4), four(bodies, at + 8), at + 12 * (k + 2)
            put(bodies, o, add(four(bodies, o), sub(times(a1, splat(w2)), times(a2, splat(w1)))))
            put(bodies, o + 4, add(four(bodies, o + 4), sub(times(a2, splat(w0)), times(a0, splat(w2)))))
            put(bodies, o + 8, add(four(bodies, o + 8), sub(times(a0, splat(w1)), times(a1, splat(w0)))))
            put(Z, 8 * b + 4, _spin(network, b, bodies, at, orders, k + 1))
