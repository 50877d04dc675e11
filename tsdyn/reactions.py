"""Multipliers and the forces of constraints, from positions, velocities and accelerations."""

import math

import numpy as np

from ._kernel import entry
from .assembly import constraint_jacobian, set_time
from .bodies import rotation_matrix, transform_g
from .linalg import cholesky, cholesky_solve
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


def multipliers(system, t, q, qd, qdd):
    """Multipliers (k, m) of M qdd + Phi_q^T lam = Q_A + S; NaN where Phi_q has lost rank."""
    m = system.segments.shape[0]
    out = np.zeros((t.size, m))
    system = system._replace(reals=system.reals.copy())
    f = unbalanced(system, q, qd, qdd)
    solve_multipliers(system, t, q, f, np.zeros((m, q.shape[1])), np.zeros((m, m)), np.zeros(m), out)
    return out


def unbalanced(system, q, qd, qdd):
    """Q_A + S - M qdd (k, n): what the constraints have to provide, Phi_q^T lam."""
    f = np.empty_like(q)
    for (at, length), mass, J in zip(system.bodies, system.mass, system.inertia, strict=True):
        f[:, at : at + 3] = mass * (system.gravity - qdd[:, at : at + 3])
        if length == 7:
            part, J = slice(at + 3, at + 7), J.reshape(3, 3)
            G, Gd = transform_g(q[:, part]), transform_g(qd[:, part])
            S = 8.0 * np.einsum("kji,jl,klm,km->ki", Gd, J, Gd, q[:, part])
            f[:, part] = S - 4.0 * np.einsum("kji,jl,klm,km->ki", G, J, G, qdd[:, part])
    return f


def reaction(solution, constraint):
    """Force and torque (k, 3) that a constraint exerts on its body, torque about its first point, ground frame.

    -Phi_r^T lam at the centroid and the body torque -G Phi_p^T lam / 2, moved to the point.
    """
    system = solution.system
    body = constraint.a if constraint.a.dimension else constraint.b
    packed = solution.packed
    index = packed.constraints.index(constraint)
    row = sum(other.rows for other in packed.constraints[:index])
    at, length = system.bodies[body.index]
    k, m = solution.multipliers.shape
    load = np.empty((k, solution.q.shape[1]))
    motions = system._replace(reals=system.reals.copy())
    rows = slice(row, row + constraint.rows)
    lam = np.zeros_like(solution.multipliers)
    lam[:, rows] = solution.multipliers[:, rows]
    constraint_loads(motions, solution.t, solution.q, lam, np.zeros((m, solution.q.shape[1])), load)
    force, torque = load[:, at : at + 3].copy(), np.zeros((k, 3))
    if length == 7:
        p = solution.q[:, at + 3 : at + 7]
        A = rotation_matrix(p)
        torque = np.einsum("kij,kjl,kl->ki", A, 0.5 * transform_g(p), load[:, at + 3 : at + 7])
        letter = "a" if body is constraint.a else "b"
        points = [
            s for mark, s in zip(constraint.markers, packed.coordinates[index], strict=True)
            if mark.body == letter and mark.code == POINT
        ]  # fmt: skip
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
