"""Taylor coefficients of the motion with joint friction, order by order.

Friction i is g_i N_i, with the normal load N_i of the reaction of its joint. At order k it is known but for what is
linear in lam_k:

    (g_i N_i)_k = sum_{j>0} g_i,j N_i,k-j + g_i,0 (N_i,k at lam_k = 0 + N_i,lam lam_k)                (1)
    N~ lam_k    = (k+1)(k+2) Phi_{k+2} at lam_k = 0,     N~ = S - H W sum_i g_i,0 N_i,lam              (2)

N_i,lam is that of order zero, so N~ is factorised once a step, as S is without friction. At order zero N_i is not
linear: Newton's method gives lam_0 (accelerations.py), and (2) what it lacks to rounding.
"""

from ..elements.loops.constraint_rows import turned, write_accelerations
from ..elements.loops.constraint_series import ADVANCE, BODY_ROW, RESIDUAL, S_OMEGA, S_R
from ..errors import Status
from ..formulations.accelerations import (
    accelerate_with_friction,
    body_reaction,
    factorise_loads,
    find_reactions,
    load_slope,
    refine_accelerations,
)
from ..jit.kernels import callback, kernel, stack
from ..jit.simd import add, cross, first, four, put, second, splat, third
from ..maths.dense_linalg import copy
from ..maths.tolerances import LAST_PLACE
from ..rows.interface import add_products, evaluate_bias, note_loads, solve_friction_series, weigh_bodies
from .coefficients import (
    change,
    exact_product,
    inverses,
    put_product,
    run_forces,
    run_loops,
    spin,
    turn,
    turn_ahead,
)
from .layout import load_series
from .step_parts import begin_orders, write_qdd

JAMMED = int(Status.JAMMED)


@kernel
def sum_reaction(reals, x, i, k):
    """Order k of the reaction that friction i depends on, about the point of its joint."""
    friction, orders = x.frictions[i], x.order.room
    F, T, p, o = splat(0.0), splat(0.0), friction.point, friction.reaction + k
    for j in range(friction.first, friction.first + friction.count):
        # Force, and torque about the joint's point: sum_l A_l s x f_{k-l}
        source = x.sources[j]
        s, forces, at = source.coordinates, source.forces, source.body * orders * BODY_ROW
        s0, s1, s2 = reals[s], reals[s + 1], reals[s + 2]
        # Of a point, its arm from the joint's point
        if source.is_point == 1:
            F = add(F, four(x.constraints, forces + 4 * k))
            s0, s1, s2 = s0 - reals[p], s1 - reals[p + 1], s2 - reals[p + 2]
        if s0 != 0.0 or s1 != 0.0 or s2 != 0.0:
            for l in range(k + 1):
                arm = turned(x.bodies, at + 12 * l, s0, s1, s2)
                T = add(T, cross(arm, four(x.constraints, forces + 4 * (k - l))))
    x.loads[o], x.loads[o + orders], x.loads[o + 2 * orders] = first(F), second(F), third(F)
    o += 3 * orders
    x.loads[o], x.loads[o + orders], x.loads[o + 2 * orders] = first(T), second(T), third(T)


@kernel
def _sum_reactions(reals, x, k):
    """What is known of order k of all reactions, and order k - 1 as a whole; that of order zero is known before."""
    for i in range(x.frictions.shape[0]):
        if k > 1:
            sum_reaction(reals, x, i, k - 1)
        sum_reaction(reals, x, i, k)


@kernel
def _find_slopes(graph, system, w, x, f):
    """Set the derivatives of the normal loads by lam_0, and order zero of the reactions."""
    r, reaction, out = f.friction, stack(6), stack(13)
    for i in range(graph.frictions.shape[0]):
        friction, series = graph.frictions[i], x.frictions[i]
        # N, N_lam and the reaction of order zero
        body_reaction(graph, f, friction, r.lam, reaction)
        load_slope(system, series.slope, friction, w.q, w.qd, x.order.time, reaction, out)
        for c in range(7):
            r.load[7 * i + c] = out[c]
        for c in range(6):
            x.loads[series.reaction + c * x.order.room] = out[7 + c]


@kernel
def _start(graph, system, w, x, f):
    """Z <- accelerations, r.lam <- lam_0, from Z = W F without friction; False if no reactions balance the friction."""
    r = f.friction
    x.low_r2[:] = 0.0
    note_loads(f)
    # Newton's method for lam_0; if it fails from the last multipliers, from zero
    evaluate_bias(graph, system, f, x.order.time)
    if find_reactions(graph, system, f, w.q, w.qd, x.order.time, LAST_PLACE):
        return True
    copy(r.Z, f.Z)
    for e in range(r.lam.size):
        r.lam[e] = 0.0
    return find_reactions(graph, system, f, w.q, w.qd, x.order.time, LAST_PLACE)


@kernel
def _correct(graph, system, k, exact, x, f):
    """Correct the series by Eq. (2) for its residuals; f.gamma is lam_k so far."""
    orders, inverse = x.order.room, inverses(k, exact)
    # Residuals of Phi_{k+2}
    run_loops(graph, system.reals, RESIDUAL, k, x, f)
    # less what r_2 has lost to rounding
    if k == 0 and exact:
        for b in range(graph.bodies.shape[0]):
            put(f.Z, 8 * b, add(four(x.low_r2, 4 * b), four(x.low_r2, 4 * b)))
            put(f.Z, 8 * b + 4, splat(0.0))
        add_products(graph, f.rows, f.Z, f.b)
    # Eq. (2)
    solve_friction_series(graph, f, x.bodies, S_OMEGA * orders + 4 * (k + 1), BODY_ROW * orders, k)
    for e in range(f.b.size):
        f.gamma[e] += f.b[e]
    for b in range(graph.bodies.shape[0]):
        change(graph, b, x, k, inverse, exact, f.Z)


@kernel
def expand_with_friction(graph, system, w, k, last, refine, x, f):
    """As `coefficients.expand`; False if no reactions balance the friction at order zero."""
    bodies, Z, orders, r, exact = x.bodies, f.Z, x.order.room, f.friction, refine > 1
    # Reactions by earlier multipliers, friction as far as it is known, Eq. (1), other forces
    run_loops(graph, system.reals, ADVANCE, k, x, f)
    if k > 0:
        _sum_reactions(system.reals, x, k)
    run_forces(system.reals, x, k, f)
    weigh_bodies(graph, Z)
    # At order zero all of the friction
    if k == 0 and not _start(graph, system, w, x, f):
        return False
    g, h, g_low, h_low = inverses(k, exact)
    for b in range(graph.bodies.shape[0]):
        # Coefficients with lam_k = 0, or at order zero with lam_0
        at = b * orders * BODY_ROW
        put_product(bodies, at + S_R * orders + 4 * (k + 2), four(Z, 8 * b), h, h_low, exact)
        if graph.bodies[b, 1] == 7:
            put_product(bodies, at + S_OMEGA * orders + 4 * (k + 1), four(Z, 8 * b + 4), g, g_low, exact)
            turn(bodies, at, k + 2, exact_product(four(Z, 8 * b + 4), h, h_low))
    # lam_k, refined
    for e in range(f.gamma.size):
        f.gamma[e] = r.lam[e] if k == 0 else 0.0
    for _ in range(1 + (x.order.sweeps if k < refine else 0)):
        _correct(graph, system, k, exact, x, f)
    # lam_k stays in b for the next order
    copy(f.gamma, f.b)
    # N~ of order zero serves all orders
    if k == 0:
        copy(f.gamma, r.lam)
        _find_slopes(graph, system, w, x, f)
        if not factorise_loads(graph, f, False):
            return False
    for b in range(graph.bodies.shape[0]):
        # What order k + 1 begins with
        put(Z, 8 * b, splat(0.0))
        if graph.bodies[b, 1] == 7 and not last:
            put(Z, 8 * b + 4, spin(graph, b, bodies, b * orders * BODY_ROW, orders, k + 1))
            turn_ahead(bodies, b * orders * BODY_ROW, orders, k + 2, exact)
    return True


@callback("pii")
def expand_friction_series(context, start, end):
    """As `step_parts.expand_series`. Status."""
    c = load_series(context)
    x, refine = c.expansion, begin_orders(c, start)
    for k in range(start, end):
        last = k > 0 and k + 1 == x.order.top
        if not expand_with_friction(c.graph, c.system, c.work, k, last, refine, x, c.tangent):
            return JAMMED
    if start == 0:
        write_qdd(c)
    return 0


@callback("pdd")
def accelerate_with_friction_here(context, t, h):
    """As `step_parts.accelerate_here`. Status.

    Newton's method starts from zero, so that what is between the steps depends on nothing that was asked for before.
    """
    c = load_series(context)
    f, r, kept = c.tangent, c.tangent.friction, c.expansion.kept
    copy(r.lam, kept)
    for e in range(r.lam.size):
        r.lam[e] = 0.0
    found = accelerate_with_friction(c.graph, c.system, c.work, f, t, LAST_PLACE)
    refine_accelerations(c.graph, f)
    write_accelerations(c.graph.bodies, f.poses, f.Z, c.work.qdd)
    copy(kept, r.lam)
    return 0 if found else JAMMED
