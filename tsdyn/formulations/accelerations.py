"""Accelerations and multipliers on the constraint manifold, without a basis of the tangent space.

    (H W H^T) lam = H W (Q_A + Q_v) + gamma,    qdd = W (Q_A + Q_v - H^T lam)

in terms of (r'', omega''): Q_A + Q_v is the force and the body torque less omega' x J' omega'.
"""

from ..elements.loops.body_poses import OMEGA, POSE, P, add_torque, write_accelerations
from ..jit.kernels import kernel
from ..jit.simd import cross, fma, four, put, splat, sub, times
from ..model.equations import applied_forces
from ..rows.axis_rows import gather_axes
from ..rows.evaluation import run_loops
from ..rows.schur_complement import gather, scatter, weigh
from ..sparse.constraint_graph import BIAS
from ..sparse.factorisation import solve


@kernel
def body_forces(network, system, w, f, t):
    """Z = applied forces, gravity and gyroscopic torques on the bodies, at w.q, w.qd and the poses."""
    has_forces = system.forces.shape[0] > 0
    if has_forces:
        for i in range(f.Q.size):
            f.Q[i] = 0.0
        applied_forces(system, w.q, w.qd, t, f.Q)
    for b in range(network.bodies.shape[0]):
        z, at, m = 8 * b, b * POSE, network.mass[16 * b]
        i = network.bodies[b, 0]
        for c in range(3):
            f.Z[z + c] = m * system.gravity[c]
            if has_forces:
                f.Z[z + c] += f.Q[i + c]
        torque = splat(0.0)
        if network.bodies[b, 1] == 7:
            if network.spins[b] != 0:
                o = 16 * b + 4
                spin = times(four(network.mass, o), splat(f.poses[at + OMEGA]))
                spin = fma(four(network.mass, o + 4), splat(f.poses[at + OMEGA + 1]), spin)
                spin = fma(four(network.mass, o + 8), splat(f.poses[at + OMEGA + 2]), spin)
                torque = sub(torque, cross(four(f.poses, at + OMEGA), spin))
            put(f.Z, z + 4, torque)
            if has_forces:
                add_torque(f.poses, at + P, f.Q, i + 3, f.Z, z + 4)


@kernel
def accelerate_bodies(network, system, w, f, t):
    """Z = (r'', omega''), b = lam; H, Y and the factors of S are those of the poses, w.q and w.qd their numbers."""
    solve_accelerations(network, system, w, f, t)
    write_accelerations(network.bodies, f.poses, f.Z, w.qdd)


@kernel
def solve_accelerations(network, system, w, f, t):
    """The same without qdd; w.q and w.qd are read where there are forces."""
    body_forces(network, system, w, f, t)
    for b in range(network.bodies.shape[0]):
        weigh(network.inverse, b, f.Z, 8 * b, f.Z, 8 * b)
    if f.b.size == 0:
        return
    gather(network, f.H, f.Z, f.b)
    gather_axes(network, f.Z, f.b)
    run_loops(network, system.reals, BIAS, f, t, f.gamma, f.H)
    for e in range(f.b.size):
        f.b[e] += f.gamma[e]
    solve(network.pattern, f.S, f.b)
    scatter(network, f.Y, f.b, f.Z)
