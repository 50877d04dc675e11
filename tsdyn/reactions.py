"""Multipliers and the forces of constraints, from positions, velocities and accelerations."""

import math

import numpy as np

from ._kernel import entry
from .assembly import constraint_jacobian, set_time
from .bodies import rotation_matrix, transform_g
from .linalg import cholesky, cholesky_solve
from .loads import applied_loads, force_loads, inertial_forces, velocity_forces
from .markers import POINT


@entry
def solve_multipliers(s, t, q, f, Phi_q, A, b, out):
    """out (k, m) with Phi_q^T lam = f, by least squares; f (k, n) is Q_A + S - M qdd. NaN where Phi_q is singular.

    Normal equations with one step of refinement, (Phi_q Phi_q^T) lam = Phi_q f; f lies in the range of Phi_q^T.
    """
    m, n = Phi_q.shape
    for row in range(t.size):
        set_time(s, t[row])
        constraint_jacobian(s, q[row], t[row], Phi_q)
        for i in range(m):
            out[row, i] = 0.0
            for j in range(i + 1):
                x = 0.0
                for c in range(n):
                    x += Phi_q[i, c] * Phi_q[j, c]
                A[i, j] = x
        if not cholesky(A, m, 1e-15):
            for i in range(m):
                out[row, i] = math.nan
            continue
        for _ in range(2):
            for i in range(m):
                b[i] = 0.0
            for c in range(n):
                x = f[row, c]
                for i in range(m):
                    x -= Phi_q[i, c] * out[row, i]
                for i in range(m):
                    b[i] += Phi_q[i, c] * x
            cholesky_solve(A, b, m)
            for i in range(m):
                out[row, i] += b[i]


def multipliers(system, t, q, qd, qdd, memory=None):
    """Multipliers (k, m) of M qdd + Phi_q^T lam = Q_A + S; NaN where Phi_q has lost rank.

    memory (k, slots) is what forces remember, zeros by default.
    """
    m = system.segments.shape[0]
    out = np.zeros((t.size, m))
    system = system._replace(reals=system.reals.copy())
    f = applied_loads(system, t, q, qd, memory) + velocity_forces(system, q, qd) - inertial_forces(system, q, qdd)
    solve_multipliers(system, t, q, f, np.zeros((m, q.shape[1])), np.zeros((m, m)), np.zeros(m), out)
    return out


def reaction(solution, constraint):
    """Force and torque (k, 3) that a constraint exerts on its body, torque about its first point, ground frame.

    -Phi_r^T lam at the centroid and the body torque -G Phi_p^T lam / 2, moved to the point.
    """
    system = solution.system
    body = constraint.a if constraint.a.dimension else constraint.b
    packed = solution.packed
    index = packed.constraints.index(constraint)
    row = sum(other.rows for other in packed.constraints[:index])
    k, m = solution.multipliers.shape
    load = np.empty((k, solution.q.shape[1]))
    motions = system._replace(reals=system.reals.copy())
    rows = slice(row, row + constraint.rows)
    lam = np.zeros_like(solution.multipliers)
    lam[:, rows] = solution.multipliers[:, rows]
    constraint_loads(motions, solution.t, solution.q, lam, np.zeros((m, solution.q.shape[1])), load)
    return _at_first_point(solution, body, load, constraint, packed.coordinates[index])


def force_reaction(solution, load):
    """Force and torque (k, 3) that a force exerts on its body, torque about its first point, ground frame."""
    force, system = load.force, solution.system._replace(forces=load.row[None])
    body = force.a if force.a.dimension else force.b
    Q = force_loads(system, solution.t, solution.q, solution.qd, solution._memory)
    return _at_first_point(solution, body, Q, force, load.coordinates)


def _at_first_point(solution, body, load, item, coordinates):
    """Force and torque of generalised forces load (k, n) on a body, about the first point that the item has on it."""
    at, length = solution.system.bodies[body.index]
    force, torque = load[:, at : at + 3].copy(), np.zeros((load.shape[0], 3))
    if length == 7:
        p = solution.q[:, at + 3 : at + 7]
        A = rotation_matrix(p)
        torque = np.einsum("kij,kjl,kl->ki", A, 0.5 * transform_g(p), load[:, at + 3 : at + 7])
        letter = "a" if body is item.a else "b"
        pairs = zip(item.markers, coordinates, strict=True)
        points = [s for marker, s in pairs if marker.body == letter and marker.code == POINT]
        if points:
            torque -= np.cross(A @ points[0], force)
    return force, torque


@entry
def constraint_loads(s, t, q, lam, Phi_q, out):
    """out (k, n) = -Phi_q^T lam at every output; lam (k, m), Phi_q scratch, zero on entry."""
    m, n = Phi_q.shape
    for row in range(t.size):
        set_time(s, t[row])
        constraint_jacobian(s, q[row], t[row], Phi_q)
        for c in range(n):
            out[row, c] = 0.0
        for i in range(m):
            if lam[row, i] != 0.0:
                for c in range(n):
                    out[row, c] -= Phi_q[i, c] * lam[row, i]
