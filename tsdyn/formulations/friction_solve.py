"""Coupled friction and reactions in the tangent form: friction of a joint depends on the reaction of the joint.

    (r'', omega'') = W (F + sum_i g_i F_n,i(lam) - H^T lam)
    S lam = H W (F + sum_i g_i F_n,i(lam)) + gamma

g_i is the generalised force of friction i for unit normal load, F_n,i the normal load. Newton's method starts from the
multipliers of the previous evaluation; its matrix is

    N~ = H (W (H^T - sum_i g_i F_n,i,lam))^T

g_i acts on the two bodies of its joint and F_n,i,lam has entries in the rows of that joint, so N~ has the block
pattern of S and a factorisation of comparable cost.
"""

import math

from ..elements.loops.body_poses import POSE, P, add_torque
from ..errors import Status
from ..jit.kernels import callback, kernel, long_kernel, stack
from ..jit.simd import add, four, put, splat, sub, times
from ..maths.dense_linalg import copy, largest
from ..rows.interface import (
    acceleration_residuals,
    add_axis_multipliers,
    apply_multipliers,
    clear_redundant,
    evaluate_bias,
    factorise_product,
    inner,
    note_loads,
    solve_product,
    weigh,
    weigh_bodies,
)
from ..workspaces.workspace import load
from .accelerations import body_forces
from .friction_loads import SOLVE_FRICTION, body_of, forget_loads, has_converged, normal_load, step_share, unit_friction
from .tolerances import DAMPED, LOAD_ROUNDING, LOAD_SWEEPS, NEWTON_DONE, SLOW_LOADS

OK, JAMMED = int(Status.SUCCESS), int(Status.JAMMED)


@kernel
def _weigh_units(graph, system, f, q, qd, t):
    """r.g = W g."""
    r, Q = f.friction, stack(14)
    for i in range(graph.frictions.shape[0]):
        friction = graph.frictions[i]
        # g_i on each body: force, and body torque G Q_p / 2
        unit_friction(system, friction, q, qd, t, Q)
        for k in range(2):
            body, at, o = body_of(friction, k), 16 * i + 8 * k, 7 * k
            put(r.g, at + 4, splat(0.0))
            for c in range(3):
                r.g[at + c] = Q[o + c]
            r.g[at + 3] = 0.0
            if body < graph.bodies.shape[0] and graph.bodies[body, 1] == 7:
                add_torque(f.poses, body * POSE + P, Q, o + 3, r.g, at + 4)
            weigh(graph.inverse, body, r.g, at, r.g, at)


@kernel
def body_reaction(graph, f, friction, lam, out):
    """out (6,) = what the joint of a friction exerts: force, ground frame; torque about the centroid, body frame."""
    for c in range(6):
        out[c] = 0.0
    # -H^T lam over the rows of the joint
    for j in range(friction.first, friction.first + friction.count):
        e, side = graph.friction_rows[j]
        at = 16 * e + 8 * side
        for c in range(3):
            out[c] -= f.rows.H[at + c] * lam[e]
            out[3 + c] -= f.rows.H[at + 4 + c] * lam[e]


@kernel
def _find_loads(graph, system, f, q, qd, t, derive):
    """Normal loads and, with derive = 1, their derivatives at the multipliers r.lam."""
    r, reaction = f.friction, stack(6)
    for i in range(graph.frictions.shape[0]):
        friction = graph.frictions[i]
        body_reaction(graph, f, friction, r.lam, reaction)
        normal_load(system, friction, q, qd, t, derive, reaction, r.load[7 * i :])


@kernel
def _apply_loads(graph, f):
    """Z = r.Z + W g N - Y^T lam."""
    r = f.friction
    copy(r.Z, f.Z)
    # + W g_i F_n,i on the two bodies of the joint
    for i in range(graph.frictions.shape[0]):
        N = splat(r.load[7 * i])
        for k in range(2):
            z, at = 8 * body_of(graph.frictions[i], k), 16 * i + 8 * k
            put(f.Z, z, add(four(f.Z, z), times(four(r.g, at), N)))
            put(f.Z, z + 4, add(four(f.Z, z + 4), times(four(r.g, at + 4), N)))
    apply_multipliers(graph, f.rows, r.lam, f.Z)


@kernel
def factorise_loads(graph, f, cold):
    """Factorise N~, or S if `cold`; False if the matrix is singular."""
    r, change = f.friction, stack(8)
    # X^T = W (H^T - sum_i g_i F_n,i,lam),  N~ = H X^T
    copy(f.rows.Y, r.X)
    if not cold:
        for i in range(graph.frictions.shape[0]):
            friction = graph.frictions[i]
            a, b = friction.body_a, friction.body_b
            # F_n,i by the reaction; a unit multiplier of row e changes the reaction by -H_e
            change[3] = change[7] = 0.0
            for c in range(3):
                change[c], change[4 + c] = r.load[7 * i + 1 + c], r.load[7 * i + 4 + c]
            for j in range(friction.first, friction.first + friction.count):
                e, side = graph.friction_rows[j]
                n = splat(-inner(f.rows.H, 16 * e + 8 * side, change, 0))
                for k in range(2):
                    body, x = graph.sides[e, k], 16 * e + 8 * k
                    g = 16 * i if body == a else 16 * i + 8
                    if body in (a, b):
                        put(r.X, x, sub(four(r.X, x), times(four(r.g, g), n)))
                        put(r.X, x + 4, sub(four(r.X, x + 4), times(four(r.g, g + 4), n)))
    return factorise_product(graph, f, r.X, r.lower, r.upper)


@long_kernel
def find_reactions(graph, system, f, q, qd, t):
    """Z = (r'', omega''), r.lam the multipliers and r.load the normal loads; Z is W F on entry, gamma as Eq. 3 has it.

    H, Y and S are those of the poses. Return True if reactions were found.
    """
    r = f.friction
    _weigh_units(graph, system, f, q, qd, t)
    copy(f.Z, r.Z)
    # Start: the multipliers of the last evaluation, or none. Without any the first matrix is S, free of friction
    clear_redundant(f, r.lam)
    size = largest(r.lam)
    if not size < math.inf:
        for e in range(r.lam.size):
            r.lam[e] = 0.0
        size = 0.0
    before, renew, done = math.inf, True, False
    for sweep in range(LOAD_SWEEPS):
        # Loads at the present lam, with derivatives where N~ is factorised
        _find_loads(graph, system, f, q, qd, t, int(renew and size > 0.0 and not done))
        # Z = W (F + sum_i g_i F_n,i - H^T lam)
        _apply_loads(graph, f)
        if done:
            return True
        # dlam = N~^-1 (H Z + gamma)
        acceleration_residuals(graph, f.rows, f.gamma, f.Z, f.b)
        add_axis_multipliers(graph, r.lam, f.b)
        if renew and not factorise_loads(graph, f, size == 0.0):
            return False
        solve_product(graph, r.lower, r.upper, f.b)
        change, share = largest(f.b), step_share(sweep)
        if not change < math.inf:
            return False
        for e in range(f.b.size):
            r.lam[e] += share * f.b[e]
        # Converged: the correction is rounding, or that of a new matrix is so small that its square is
        cold, size = size == 0.0, largest(r.lam)
        done = has_converged(change, before, share, sweep, LOAD_ROUNDING * size)
        done = done or (renew and not cold and change <= NEWTON_DONE * size)
        renew, before = cold or sweep >= DAMPED or change > SLOW_LOADS * before, change
    return False


@kernel
def accelerate_with_friction(graph, system, w, f, t):
    """Z = (r'', omega'') with joint friction, as `find_reactions`; f.friction.lam is where Newton's method starts."""
    forget_loads(system)
    body_forces(graph, system, w, f, t)
    weigh_bodies(graph, f.Z)
    note_loads(f)
    evaluate_bias(graph, system, f, t)
    return find_reactions(graph, system, f, w.q, w.qd, t)


@callback(SOLVE_FRICTION)
def solve_friction(context, t, unused):
    """Solve for accelerations as accelerations.solve_accelerations, with joint friction. Status."""
    c = load(context)
    system, f, graph = c.system, c.tangent, c.graph
    found = accelerate_with_friction(graph, system, c.work, f, t)
    for i in range(system.normals.size):
        system.reals[system.normals[i]] = f.friction.load[7 * i]
    copy(f.friction.lam, f.b)
    return OK if found else JAMMED
