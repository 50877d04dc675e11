"""Accelerations and multipliers on the manifold without a basis of the tangent space; coupled joint friction."""

import math

from ..elements.loops.constraint_rows import OMEGA, POSE, P, add_torque, write_accelerations
from ..elements.loops.forces import FORCE_INTS
from ..elements.loops.friction import DERIVE, HERE, call_load_slope, call_normal_load, call_unit_friction
from ..errors import Status
from ..jit.kernels import callback, caller, kernel, long_kernel, stack
from ..jit.simd import add, cross, fma, four, get, lanes, let, put, splat, sub, times
from ..maths.dense_linalg import copy, largest
from ..maths.tolerances import LAST_PLACE, SUM_ROUNDING
from ..model.equations import applied_forces
from ..rows.interface import (
    DYNAMICS,
    acceleration_residuals,
    add_multiplier_terms,
    apply_multipliers,
    clear_redundant,
    constrain,
    constrain_accelerations,
    evaluate_bias,
    factorise_and_constrain,
    factorise_product,
    factorise_selected_rows,
    inner,
    note_loads,
    solve_product,
    weigh,
    weigh_bodies,
)
from ..workspaces import load
from .tolerances import DAMPED, DAMPED_SHARE, EXACT, LOAD_SWEEPS, NEWTON_DONE, REFINEMENTS, SLOW_FACTORS

# Accelerations and multipliers on the constraint manifold, without a basis of the tangent space.
#
#     (H W H^T) lam = H W (Q_A + Q_v) + gamma,    qdd = W (Q_A + Q_v - H^T lam)
#
# in terms of (r'', omega''): Q_A + Q_v is the force and the body torque less omega' x J' omega'.


@kernel
def body_forces(graph, system, w, f, t):
    """Set Z to applied forces, gravity and gyroscopic torques on the bodies, at w.q, w.qd and the poses."""
    has_forces = system.forces.shape[0] > 0
    # Q_A without gravity, in the coordinates q
    if has_forces:
        for c in range(f.Q.size):
            f.Q[c] = 0.0
        applied_forces(system, w.q, w.qd, t, f.Q)
    for b in range(graph.bodies.shape[0]):
        z, at, m = 8 * b, b * POSE, get(graph.mass, 16 * b)
        i = graph.bodies[b, 0]
        # Force on the centroid: gravity and Q_A,r
        put(f.Z, z, lanes(m * system.gravity[0], m * system.gravity[1], m * system.gravity[2]))
        if has_forces:
            for c in range(3):
                let(f.Z, z + c, get(f.Z, z + c) + get(f.Q, i + c))
        # Body torque: -omega' x J' omega', J' by columns; of a spherical inertia it is zero
        torque = splat(0.0)
        if graph.bodies[b, 1] == 7:
            if graph.spins[b] != 0:
                o = 16 * b + 4
                spin = times(four(graph.mass, o), splat(get(f.poses, at + OMEGA)))
                spin = fma(four(graph.mass, o + 4), splat(get(f.poses, at + OMEGA + 1)), spin)
                spin = fma(four(graph.mass, o + 8), splat(get(f.poses, at + OMEGA + 2)), spin)
                torque = sub(torque, cross(four(f.poses, at + OMEGA), spin))
            put(f.Z, z + 4, torque)
            # + G Q_A,p / 2
            if has_forces:
                add_torque(f.poses, at + P, f.Q, i + 3, f.Z, z + 4)


@kernel
def accelerate_bodies(graph, system, w, f, t):
    """Set Z = (r'', omega'') and b = lam; H, Y and the factors of S are those of the poses, w.q and w.qd."""
    solve_accelerations(graph, system, w, f, t)
    refine_accelerations(graph, f)
    write_accelerations(graph.bodies, f.poses, f.Z, w.qdd)


@kernel
def refine_accelerations(graph, f):
    """Project Z onto H Z + gamma = 0 until it holds: more than once where masses are unequal by 1e10."""
    if f.b.size > 0:
        # lam = S^-1 (H Z + gamma),  Z <- Z - Y^T lam
        far = largest(f.Z)
        for _ in range(REFINEMENTS):
            if constrain(graph, f.rows, f.gamma, f.Z, f.b) <= EXACT * far:
                break


@kernel
def solve_accelerations(graph, system, w, f, t):
    """Solve for accelerations and multipliers, without qdd; w.q and w.qd are read if there are forces."""
    free_accelerations(graph, system, w, f, t)
    if f.b.size > 0:
        # Eqs. 3 and 4: lam = S^-1 (H Z + gamma),  qdd = Z - Y^T lam
        constrain_accelerations(graph, f.rows, f.gamma, f.Z, f.b)


@kernel
def factorise_for_accelerations(graph, system, w, f, t):
    """The same with S that is not factored yet; return the row that fails, or -1."""
    free_accelerations(graph, system, w, f, t)
    return factorise_and_constrain(graph, f.rows, f.gamma, f.Z, f.b)


@kernel
def free_accelerations(graph, system, w, f, t):
    """Set Z = W F and gamma."""
    body_forces(graph, system, w, f, t)
    weigh_bodies(graph, f.Z)
    note_loads(f)
    if f.b.size > 0:
        evaluate_bias(graph, system, f, t)


# Joint friction, shared by all forms: forces for unit normal load, normal loads, convergence of the loads.

SOLVE_FRICTION = "pdp"  # context, t, vdd where the form has a basis: solves for friction and accelerations
call_friction = caller(SOLVE_FRICTION)


@kernel
def body_of(friction, side):
    """The body of a side, 0 for a and 1 for b."""
    return friction.body_a if side == 0 else friction.body_b


@kernel
def _instance(system, friction):
    """Floats of the instance; where its table and its floats begin."""
    kind = system.forces[friction.kind]
    index = friction.index
    return kind.stride, kind.table + FORCE_INTS * index, kind.reals + kind.stride * index


@kernel
def unit_friction(system, friction, q, qd, t, out):
    """out (14,) = generalised forces on the bodies a and b, for a normal load of one."""
    stride, own, real = _instance(system, friction)
    call_unit_friction(friction.unit, stride, system.table[own:], system.reals[real:], q, qd, t, out)


@kernel
def normal_load(system, f, friction, q, what, reaction, out):
    """out (7,) = the normal load of a reaction (6,) and, with DERIVE, its derivative by that; HERE: for another q."""
    stride, own, real = _instance(system, friction)
    call_normal_load(
        friction.normal, stride, system.table[own:], system.reals[real:], q, f.friction.kept[friction.kept :],
        friction.on, what, reaction, out,
    )  # fmt: skip


@kernel
def load_slope(system, slope, friction, q, qd, t, reaction, out):
    """out (13,) = the same by the series of the load, whose kernel is at `slope`; then the reaction about the point."""
    stride, own, real = _instance(system, friction)
    call_load_slope(slope, stride, system.table[own:], system.reals[real:], q, qd, t, friction.on, reaction, out)


@kernel
def forget_loads(system):
    """Set joint friction to zero in the sum of forces."""
    for i in range(system.normals.size):
        system.reals[system.normals[i]] = 0.0


@kernel
def keep_loads(system, f):
    """Set joint friction in the sum of forces to the present normal loads, such as for its derivatives."""
    for i in range(system.normals.size):
        system.reals[system.normals[i]] = f.friction.load[7 * i]


@kernel
def step_share(sweep):
    """Return the share of a Newton correction of the loads that is applied."""
    return 1.0 if sweep < DAMPED else DAMPED_SHARE


@kernel
def has_converged(change, before, share, sweep, least):
    """Return True if a correction is at most `least`, or if quadratic convergence makes the next one so."""
    return change <= least or (share == 1.0 and sweep > 0 and change * change <= least * before)


# Coupled friction and reactions in the tangent form: friction of a joint depends on the reaction of the joint.
#
#     (r'', omega'') = W (F + sum_i g_i F_n,i(lam) - H^T lam)
#     S lam = H W (F + sum_i g_i F_n,i(lam)) + gamma
#
# g_i is the generalised force of friction i for unit normal load, F_n,i the normal load. Newton's method starts from
# the multipliers of the previous evaluation; its matrix is
#
#     N~ = H (W (H^T - sum_i g_i F_n,i,lam))^T
#
# g_i acts on the two bodies of its joint and F_n,i,lam has entries in the rows of that joint, so N~ has the block
# pattern of S and a factorisation of comparable cost.

OK, JAMMED, SINGULAR = int(Status.SUCCESS), int(Status.JAMMED), int(Status.SINGULAR)


@kernel
def weigh_units(graph, system, f, q, qd, t):
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
def find_loads(graph, system, f, q, lam, what):  # six: where the loads are, and what to do
    """Normal loads at the multipliers lam, as `normal_load`."""
    r, reaction = f.friction, stack(6)
    for i in range(graph.frictions.shape[0]):
        friction = graph.frictions[i]
        body_reaction(graph, f, friction, lam, reaction)
        normal_load(system, f, friction, q, what, reaction, r.load[7 * i :])


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
def find_reactions(graph, system, f, q, qd, t, least):  # seven: what the loads depend on, and how exact they are
    """Z = (r'', omega''), r.lam the multipliers and r.load the normal loads; Z is W F on entry, gamma as Eq. 3 has it.

    H and Y are those of the poses; `least` is the relative error of the multipliers that may be left. Return True if
    reactions were found.
    """
    r = f.friction
    weigh_units(graph, system, f, q, qd, t)
    copy(f.Z, r.Z)
    # Start: the multipliers of the last evaluation, or none. Without any the first matrix is S, free of friction
    clear_redundant(f, r.lam)
    size = largest(r.lam)
    if not size < math.inf:
        for e in range(r.lam.size):
            r.lam[e] = 0.0
        size = 0.0
    before, renew, done, left = math.inf, True, False, math.inf
    for sweep in range(LOAD_SWEEPS):
        # Loads at the present lam, with derivatives where N~ is factorised
        derived = renew and size > 0.0 and not done
        find_loads(graph, system, f, q, r.lam, (DERIVE if derived else 0) | (HERE if sweep == 0 else 0))
        # Z = W (F + sum_i g_i F_n,i - H^T lam)
        _apply_loads(graph, f)
        if done:
            return True
        # dlam = N~^-1 (H Z + gamma)
        acceleration_residuals(graph, f.rows, f.gamma, f.Z, f.b)
        add_multiplier_terms(graph, r.lam, f.b)
        left = largest(f.b)
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
        done = has_converged(change, before, share, sweep, least * size)
        done = done or (renew and not cold and change <= NEWTON_DONE * size)
        renew, before = cold or sweep >= DAMPED or change > SLOW_FACTORS * before, change
    # Where all reactions vanish, what is left of them is rounding of the accelerations
    if not left <= SUM_ROUNDING * largest(f.Z):
        return False
    find_loads(graph, system, f, q, r.lam, 0)
    _apply_loads(graph, f)
    return True


@kernel
def accelerate_with_friction(graph, system, w, f, t, least):
    """Z = (r'', omega'') with joint friction, as `find_reactions`; f.friction.lam is where Newton's method starts."""
    forget_loads(system)
    free_accelerations(graph, system, w, f, t)
    return find_reactions(graph, system, f, w.q, w.qd, t, least)


@callback(SOLVE_FRICTION)
def solve_friction(context, t, unused):
    """Solve for accelerations as accelerations.solve_accelerations, with joint friction. Status."""
    c = load(context)
    system, f, graph, stage = c.system, c.tangent, c.graph, c.chart.state
    found = accelerate_with_friction(graph, system, c.work, f, t, stage.loads_left if stage.free == 1 else LAST_PLACE)
    keep_loads(system, f)
    copy(f.friction.lam, f.b)
    if found:
        return OK
    # Where S hasn't been factorised yet, it may be the reason
    singular = stage.free == 1 and factorise_selected_rows(graph, f, f.rows, DYNAMICS) >= 0
    return SINGULAR if singular else JAMMED
