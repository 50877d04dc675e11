"""Multipliers and constraint reactions, from positions, velocities and accelerations."""

import math
from collections import Counter

import numpy as np

from ..elements.bodies import rotation_matrix, transform_g
from ..elements.loops.body_poses import take_loads
from ..elements.loops.coordinate_rows import INTS
from ..elements.markers import POINT
from ..jit.kernels import entry
from ..maths.dense_linalg import copy
from ..model.equations import constraint_jacobian, set_time
from ..model.packed import classes, index_of
from ..model.sparse_jacobian import WIDTH, with_short_rows
from ..rows.interface import balance_loads, mark_redundant
from ..workspaces.workspace import load_parts
from .factorised_rows import factorise_at
from .friction_reactions import with_normal_loads
from .generalised_forces import applied_loads, force_loads, inertial_forces, velocity_forces
from .row_parts import give, taken

MATRIX = np.zeros((0, 0))  # its type


@entry("pv", MATRIX, MATRIX, MATRIX, MATRIX)
def solve_multipliers(context, t, q, r, rows, out):
    """out (k, m) with Phi_q^T lam = r, by least squares; r (k, n) is Q_A + Q_v - M qdd. NaN where Phi_q is singular.

    S lam = H W r on the graph with one step of refinement, r in terms of bodies, then the normalisations from the
    remainder of r along p. The system is that with short rows, rows (m, 14) scratch, zero on entry.
    """
    whole = load_parts(context)
    graph, s, f = whole.graph, whole.system, whole.tangent
    bodies = graph.bodies
    for k in range(t.size):
        regular = factorise_at(graph, s, f, t[k], q[k])
        constraint_jacobian(s, q[k], t[k], rows)
        copy(r[k], f.Q)
        take_loads(bodies, q[k], r[k], f.Z)
        for i in range(out.shape[1]):
            out[k, i] = 0.0
        for _ in range(2):
            balance_loads(graph, f.rows, f.Z, f.b)
            for e in range(f.b.size):
                if graph.row[e] >= 0:
                    out[k, graph.row[e]] += f.b[e]
        for i in range(out.shape[1]):  # remainder of r
            for half in range(2):
                at = s.segments[i, 2 * half]
                for c in range(s.segments[i, 2 * half + 1]):
                    f.Q[at + c] -= rows[i, 7 * half + c] * out[k, i]
        for b in range(bodies.shape[0]):
            i = graph.normals[b]
            if i >= 0:
                x = 0.0
                for c in range(3, 7):
                    x += f.Q[bodies[b, 0] + c] * q[k, bodies[b, 0] + c]
                out[k, i] = x
        mark_redundant(graph, f, math.nan, out[k])
        if not regular:
            for i in range(out.shape[1]):
                out[k, i] = math.nan


def multipliers(packed, t, q, qd, qdd, memory=None):
    """Multipliers (k, m) of M qdd + Phi_q^T lam = Q_A + Q_v; NaN where Phi_q has lost rank.

    memory (k, slots): memory of forces, zeros by default.
    """
    memory = with_normal_loads(packed, t, q, qd, qdd, memory)
    found = taken(packed, q.shape[1])
    out = np.zeros((t.size, len(found.system.segments)))
    f = applied_loads(packed.system, t, q, qd, memory)
    f += velocity_forces(found.system, q, qd)
    f -= inertial_forces(found.system, q, qdd)
    solve_multipliers(found.address, t, q, f, np.zeros((out.shape[1], WIDTH)), out)
    give(packed, found)
    return out


def particular(multipliers):
    """Multipliers (k, m) with zeros at redundant rows: they solve the same equations."""
    redundant = np.isnan(multipliers)
    if not redundant.any():
        return multipliers
    return np.where(redundant & ~redundant.all(axis=1, keepdims=True), 0.0, multipliers)


def reaction(solution, member, body):
    """Force and torque (k, 3) that a constraint exerts on a body, torque about its first point on it, ground frame.

    -Phi_r^T lam at the centroid and the body torque -G Phi_p^T lam / 2, moved to the point. member is a system.Member.
    """
    packed = solution.packed
    system = with_short_rows(packed)
    system = system._replace(reals=system.reals.copy(), kinds=only(packed, member.parts))
    load = np.zeros((solution.t.size, system.bodies[index_of(packed, body), 1]))
    rows = np.zeros((len(system.segments), WIDTH))
    halves = []  # half of each row that belongs to the body
    for part in packed.constraints[member.parts]:
        halves += [0 if body is part.a else WIDTH // 2 if body is part.b else -1] * part.rows
    lam = np.ascontiguousarray(particular(solution.multipliers)[:, member.rows])
    first, halves = member.rows.start, np.array(halves, np.int64)
    constraint_loads(system, solution.t, solution.q, lam, first, halves, rows, load)
    return at_first_point(solution, body, load, member.constraint, member.coordinates)


def only(packed, parts):
    """Return the entries of System.kinds for these primitives, a slice: one for each."""
    if packed.derived.places_within is None:
        seen, within = Counter(), []
        for constraint in packed.constraints:
            within.append(seen[type(constraint)])
            seen[type(constraint)] += 1
        packed.derived.places_within = within
    rows = dict(zip(classes(packed), with_short_rows(packed).kinds, strict=True))
    kinds = np.array([rows[type(part)] for part in packed.constraints[parts]], packed.system.kinds.dtype)
    within = np.array(packed.derived.places_within[parts])
    kinds["table"] += INTS * within
    kinds["reals"] += kinds["stride"] * within
    kinds["count"] = 1
    return kinds


def loads_of(packed):
    """Return the loads by the id of their force."""
    if packed.derived.loads is None:
        packed.derived.loads = {id(load.force): load for load in packed.loads}
    return packed.derived.loads


def force_reaction(solution, load, body):
    """Force and torque (k, 3) that a force exerts on a body, torque about its first point on it, ground frame."""
    force, system = load.force, solution.system._replace(forces=load.alone)
    Q = force_loads(system, solution.t, solution.q, solution.qd, solution._memory)
    at, length = solution.system.bodies[index_of(solution.packed, body)]
    return at_first_point(solution, body, Q[:, at : at + length], force, load.coordinates)


def at_first_point(solution, body, load, item, coordinates):
    """Force and torque of generalised forces load (k, 7 or 3) on a body, about the first point of the item on it."""
    at, length = solution.system.bodies[index_of(solution.packed, body)]
    force, torque = load[:, :3].copy(), np.zeros((load.shape[0], 3))
    if length == 7:
        p = solution.q[:, at + 3 : at + 7]
        A = rotation_matrix(p)
        torque = np.einsum("kij,kjl,kl->ki", A, 0.5 * transform_g(p), load[:, 3:])
        letter = "a" if body is item.a else "b"
        pairs = zip(item.markers, coordinates, strict=True)
        points = [s for marker, s in pairs if marker.body == letter and marker.code == POINT]
        if points:
            torque -= np.cross(A @ points[0], force)
    return force, torque


@entry
def constraint_loads(s, t, q, lam, first, halves, rows, out):
    """out (k, 7 or 3) = -Phi_q^T lam of one body; lam (k, rows of the constraint), which begin at first.

    halves (rows,) is the first entry of the body in each row, negative if there is none.
    """
    for k in range(t.size):
        set_time(s, t[k])
        constraint_jacobian(s, q[k], t[k], rows)
        for i in range(lam.shape[1]):
            if halves[i] < 0:
                continue
            for c in range(out.shape[1]):
                out[k, c] -= rows[first + i, halves[i] + c] * lam[k, i]
