"""Accelerations and multipliers on the constraint manifold, without a basis of the tangent space.

    (H W H^T) lam = H W (Q_A + Q_v) + gamma,    qdd = W (Q_A + Q_v - H^T lam)

in terms of (r'', omega''): Q_A + Q_v is the force and the body torque less omega' x J' omega'.
"""

from ..elements.loops.body_poses import OMEGA, POSE, P, add_torque, write_accelerations
from ..jit.kernels import kernel
from ..jit.simd import cross, fma, four, get, lanes, let, put, splat, sub, times
from ..maths.dense_linalg import largest
from ..model.equations import applied_forces
from ..rows.interface import constrain, constrain_accelerations, evaluate_bias, note_loads, weigh_bodies
from .tolerances import EXACT, REFINEMENTS


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
    # Z = W F
    body_forces(graph, system, w, f, t)
    weigh_bodies(graph, f.Z)
    note_loads(f)
    if f.b.size == 0:
        return
    # Eqs. 3 and 4: lam = S^-1 (H Z + gamma),  qdd = Z - Y^T lam
    evaluate_bias(graph, system, f, t)
    constrain_accelerations(graph, f.rows, f.gamma, f.Z, f.b)
