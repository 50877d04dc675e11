"""Multipliers and constraint reactions from q, qd and qdd; their uniqueness; where surfaces touch."""

from __future__ import annotations

import math
from collections import Counter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting_methods
from ..elements.bodies import rotation_matrix, transform_g
from ..elements.force import Force
from ..elements.joint import SumRow
from ..elements.loops.constraint_rows import place_bodies, take_loads
from ..elements.loops.coordinate_rows import BLOCK, INTS
from ..elements.loops.friction import HERE
from ..elements.markers import POINT
from ..elements.unilateral import contacts_of
from ..errors import InvalidBody, InvalidConstraint, RedundantConstraints
from ..formulations.accelerations import find_reactions, normal_load
from ..jit.kernels import entry, kernel, long_kernel, resident, stack, twin
from ..maths.dense_linalg import copy
from ..maths.tolerances import LAST_PLACE, NEGLIGIBLE, RANK_TOL, TINY
from ..model.equations import WIDTH, added_inertia, constraint_jacobian, recall, set_time, with_short_rows
from ..model.handles import classes, first_rows, handles_of, index_of
from ..model.packed import has_friction, member_of, no_system
from ..rows.constraint_graph import REDUCED, graph_of, redundant_rows
from ..rows.interface import (
    METRIC,
    Rows,
    balance_loads,
    count_self_stresses,
    evaluate_every_row,
    evaluate_rows,
    factorise_rows,
    mark_redundant,
    redundancy,
    reset_selection,
    self_stress,
    weigh_bodies,
    with_all_rows,
)
from ..workspaces import arrays_of, load_parts, parts
from .generalised_forces import applied_loads, force_loads, inertial_forces, velocity_forces
from .tolerances import KEPT_FLOATS

if TYPE_CHECKING:
    from ..hints import BodyLike, Floats, Handles, ItemLike


# The workspace in which rows are evaluated and factorised after a run; one that is idle serves the next call.


class RowParts:
    """`Parts` of a packed scene with short rows, and their address; one evaluation at a time.

    Parameters
    ----------
    system : System
    graph : ConstraintGraph
    n : int
        Coordinates.
    selects : bool
        Whether redundant rows are selected anew where that is needed.
    """

    def __init__(self, system, graph, n, selects=True):
        self.source, self.graph, self.selects = system, graph, selects
        self.system = system._replace(reals=system.reals.copy())
        whole = parts(self.system, graph if selects else with_all_rows(graph), n)
        reset_selection(graph, whole.tangent)
        self._images = [(array, array.copy()) for array in arrays_of((whole.work, whole.tangent)) if array.size]
        self.address, *self._keep = resident(whole)

    @property
    def size(self):
        """Floats of it."""
        return sum(array.size for array, _ in self._images)

    def enter(self):
        """As if it were new."""
        for array, image in self._images:
            array[...] = image
        self.system.reals[...] = self.source.reals


def taken(packed, n):
    """Return a `RowParts` of a packed scene, as if it were new."""
    system, graph = with_short_rows(packed), graph_of(packed, REDUCED)
    try:
        found = packed.derived.row_parts.pop()
    except IndexError:
        found = None
    if found is None or found.graph is not graph or found.source is not system:
        return RowParts(system, graph, n, packed.derived.switched is None)
    found.enter()
    return found


def give(packed, found):
    """Take back one that is no longer in use, unless it is large, or has room to select rows again."""
    fixed = redundancy(found.graph) == 0 or not found.selects
    if not packed.derived.row_parts and fixed and found.size < KEPT_FLOATS:
        packed.derived.row_parts.append(found)


# Constraint rows at given positions, factorised.


@kernel
def factorise_at(graph, s, f, t, q):
    """H, Y and the factors of S at t, q. Return True if S is nonsingular."""
    set_time(s, t)
    place_bodies(graph.bodies, q, f.poses)
    evaluate_rows(graph, s, f, f.rows, t)
    return factorise_rows(graph, s, f, f.rows, t, METRIC)


# Normal loads of joint friction, from positions, velocities and accelerations.


@entry("pvmmmmm")
def solve_normal_loads(context, t, q, qd, r, memory, out):
    """out (k, frictions): normal loads with Phi_q^T lam - sum_i g_i N_i = r (k, n); NaN if there are none.

    H W (H^T lam - sum_i g_i N_i(lam)) = H W r: the acceleration equation for the residual forces.
    """
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    for k in range(t.size):
        recall(s, memory[k])
        found = factorise_at(graph, s, f, t[k], q[k])
        take_loads(graph.bodies, q[k], r[k], f.Z)
        weigh_bodies(graph, f.Z)
        for e in range(f.gamma.size):
            f.gamma[e] = 0.0
        found = found and find_reactions(graph, s, f, q[k], qd[k], t[k], LAST_PLACE)
        for i in range(out.shape[1]):
            out[k, i] = f.friction.load[7 * i] if found else np.nan


def with_normal_loads(packed, t, q, qd, qdd, memory):
    """Return the memory of forces (k, slots), then normal loads of joint friction if there is any."""
    system = packed.system
    if not system.normals.size:
        return memory
    memory = np.zeros((t.size, system.memory.size)) if memory is None else memory
    if memory.shape[1] > system.memory.size:
        return memory
    r = applied_loads(system, t, q, qd, memory)
    r += velocity_forces(system, q, qd)
    r -= inertial_forces(system, q, qdd)
    own = system._replace(reals=system.reals.copy())
    context, *_keep = resident(parts(own, graph_of(packed, REDUCED), q.shape[1]))
    loads = np.zeros((t.size, system.normals.size))
    solve_normal_loads(context, t, q, qd, r, memory, loads)
    return np.hstack((memory, loads))


@entry("pvmmmmm")
def solve_multipliers(context, t, q, r, memory, rows, out):
    """out (k, m) with Phi_q^T lam = r, by least squares; r (k, n) is Q_A + Q_v - M qdd. NaN where Phi_q is singular.

    S lam = H W r on the graph with one step of refinement, r in terms of bodies, then the normalisations from the
    remainder of r along p. The system is that with short rows, rows (lines, 14) scratch, zero on entry.
    """
    whole = load_parts(context)
    graph, s, f = whole.graph, whole.system, whole.tangent
    bodies = graph.bodies
    for k in range(t.size):
        recall(s, memory[k])
        # S = H W H^T, and Phi_q by short rows
        regular = factorise_at(graph, s, f, t[k], q[k])
        constraint_jacobian(s, q[k], t[k], rows)
        copy(r[k], f.Q)
        take_loads(bodies, q[k], r[k], f.Z)
        # S lam = H W r, refined once: balance_loads leaves in Z what lam doesn't balance
        for i in range(out.shape[1]):
            out[k, i] = 0.0
        for _ in range(2):
            balance_loads(graph, f.rows, f.Z, f.b)
            for e in range(f.b.size):
                if graph.row[e] >= 0:
                    out[k, graph.row[e]] += f.b[e]
        for i in range(rows.shape[0]):  # remainder of r; rows of later terms of sums are behind all others
            row = i if i < out.shape[1] else s.tails[i - out.shape[1]]
            for half in range(2):
                at = s.segments[i, 2 * half]
                for c in range(s.segments[i, 2 * half + 1]):
                    f.Q[at + c] -= rows[i, 7 * half + c] * out[k, row]
        # Multiplier of a normalisation: the remainder of r along p
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
    system, f = with_short_rows(packed), applied_loads(packed.system, t, q, qd, memory)
    f += velocity_forces(system, q, qd)
    f -= inertial_forces(system, q, qdd)
    lam, shares = balancing(packed, t, q, f, memory), packed.derived.shares
    if shares is None:
        return lam
    slots = packed.system.memory.size
    return shares.multipliers(packed, t, q, qd, memory[:, :slots], lam, memory[:, slots:])


def balancing(packed, t, q, f, memory=None):
    """Multipliers (k, m) of Phi_q^T lam = f, generalised forces (k, n) in balance; NaN as of `multipliers`."""
    found, out = taken(packed, q.shape[1]), np.zeros((t.size, len(packed.system.segments)))
    memory = np.zeros((t.size, 0)) if memory is None else memory
    solve_multipliers(found.address, t, q, f, memory, np.zeros((len(found.system.segments), WIDTH)), out)
    give(packed, found)
    if packed.derived.switched is not None:  # rows of frictions that slide carry nothing, unless none has multipliers
        off = np.isin(np.arange(out.shape[1]), redundant_rows(packed))
        out[:, off] = np.where(np.isnan(out[:, ~off]).any(axis=1), np.nan, 0.0)[:, None]
    return out


def particular(multipliers):
    """Multipliers (k, m) with zeros at redundant rows: they solve the same equations."""
    redundant = np.isnan(multipliers)
    if not redundant.any():
        return multipliers
    return np.where(redundant & ~redundant.all(axis=1, keepdims=True), 0.0, multipliers)


def reaction(solution, member, body):
    """Force and torque (k, 3) that a constraint exerts on a body, ground frame.

    -Phi_r^T lam at the centroid and the body torque -G Phi_p^T lam / 2, moved to the contact point, if there is one, or
    to the first point on the body. member is a system.Member.
    """
    packed = solution.packed
    system = with_short_rows(packed)
    kinds = only(packed, member.parts)
    system = system._replace(reals=system.reals.copy(), kinds=kinds)
    load = np.zeros((solution.t.size, system.bodies[index_of(packed, body), 1]))
    rows = np.zeros((len(system.segments), WIDTH))
    lines = []  # short rows of the constraint: which, its row, and the half of it that belongs to the body
    for part, first in zip(
        packed.constraints[member.parts], system.table[kinds["table"] + BLOCK] // WIDTH, strict=True
    ):
        if body is part.a or body is part.b:
            own = member_of(packed, part).rows
            lines += [
                (first + r, row, 0 if body is part.a else WIDTH // 2)
                for r, row in enumerate(range(own.start, own.stop))
            ]
    lines, lam = np.array(lines, np.int64).reshape(-1, 3), particular(solution.multipliers)
    memory = np.zeros((solution.t.size, 0)) if solution._memory is None else solution._memory
    constraint_loads(system, solution.t, solution.q, memory, lam, *np.ascontiguousarray(lines.T), rows, load)
    contact = touching(packed, member, solution.q)
    place = None if contact is None else contact[0]
    return at_first_point(solution, body, load, member.constraint, member.coordinates, place)


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
    if force.adds_inertia:
        # -h^T (h qdd + gamma_h) of its inertia row
        rows = [one.force for one in solution.packed.loads if one.force.adds_inertia]
        columns, h, gamma = list(added_inertia(system, solution.q, solution.qd))[rows.index(force)]
        Q[:, columns] -= ((h * solution.qdd[:, columns]).sum(axis=1) + gamma)[:, None] * h
    at, length = solution.system.bodies[index_of(solution.packed, body)]
    return at_first_point(solution, body, Q[:, at : at + length], force, load.coordinates)


def held_reaction(motion, load, body):
    """What rows that hold a friction exert on a body where it sticks: force and torque (k, 3) as of `force_reaction`.

    motion is one of the phase with these rows, multipliers (k, m) and all.
    """
    force, torque = np.zeros((2, len(motion.q), 3))
    lam, slot, item = particular(motion.multipliers), load.slot + load.force.memory, load.force
    frames = [rotations(motion.system, motion.packed, each, motion.q) for each in (item.a, item.b)]
    for slide in load.slides:
        first = slot + slide.directions
        for k, row in enumerate(motion.packed.derived.holds.get(slot, ())):
            numbers = motion._memory[:, first + k * slide.row_numbers :][:, : slide.row_numbers]
            s, h = (np.einsum("kij,kj->ki", A, numbers[:, 3 * i :][:, :3]) for i, A in enumerate(frames))
            if slide.turns:
                torque -= lam[:, row, None] * np.cross(s, h)
            else:
                force -= lam[:, row, None] * np.einsum("kij,kj->ki", frames[1], numbers[:, :3])
        slot += slide.count
    if body is item.a:
        return force, torque
    points = [
        (marker.body, s) for marker, s in zip(item.markers, load.coordinates, strict=True) if marker.code == POINT
    ]
    (_, of_a), of_b = points[0], next((s for letter, s in points if letter == "b"), np.zeros(3))
    arm = place_of(motion, item.a, of_a, frames[0]) - place_of(motion, item.b, of_b, frames[1])
    return -force, -torque - np.cross(arm, force)


def rotations(system, packed, body, q):
    """Rotation matrices (k, 3, 3) of a body along q (k, n)."""
    if body.dimension != 7:
        return np.broadcast_to(np.eye(3), (len(q), 3, 3))
    at, _ = system.bodies[index_of(packed, body)]
    return rotation_matrix(q[:, at + 3 : at + 7])


def place_of(motion, body, s, A):
    """A point s of a body, (k, 3), m, ground frame, by its rotation matrices."""
    place = A @ s
    if not body.dimension:
        return place
    at, _ = motion.system.bodies[index_of(motion.packed, body)]
    return place + motion.q[:, at : at + 3]


def at_first_point(solution, body, load, item, coordinates, place=None):
    """Force and torque of generalised forces load (k, 7 or 3) on a body, about the first point of the item on it.

    place (k, 3), m, is where the torque is taken about instead.
    """
    at, length = solution.system.bodies[index_of(solution.packed, body)]
    force, torque = load[:, :3].copy(), np.zeros((load.shape[0], 3))
    if length == 7:
        p = solution.q[:, at + 3 : at + 7]
        A = rotation_matrix(p)
        torque = np.einsum("kij,kjl,kl->ki", A, 0.5 * transform_g(p), load[:, 3:])
        letter = "a" if body is item.a else "b"
        pairs = zip(item.markers, coordinates, strict=True)
        points = [s for marker, s in pairs if marker.body == letter and marker.code == POINT]
        if place is not None:
            torque -= np.cross(place - solution.q[:, at : at + 3], force)
        elif points:
            torque -= np.cross(A @ points[0], force)
    return force, torque


@entry(no_system(), "vmmmwwwmm")
def constraint_loads(s, t, q, memory, lam, lines, which, halves, rows, out):
    """out (k, 7 or 3) = -Phi_q^T lam of one body, lam (k, m): over these lines of the short rows (lines, 14).

    which are their rows of Phi, halves where the entries of the body begin.
    """
    for k in range(t.size):
        set_time(s, t[k])
        recall(s, memory[k])
        constraint_jacobian(s, q[k], t[k], rows)
        for i in range(lines.size):
            for c in range(out.shape[1]):
                out[k, c] -= rows[lines[i], halves[i] + c] * lam[k, which[i]]


# Uniqueness of reactions among redundant constraints: reactions to which no self-stress contributes.
#
# A redundant row gives a self-stress z, H^T z = 0. Any multiple of z may be added to the multipliers without effect on
# the motion. The reaction of a constraint is unique if no self-stress loads a body through it.


@long_kernel
def find_rows(graph, s, f, q, t, whole):
    """H at q without redundant rows and, in `whole`, with them, and the factors of S; False if S is singular."""
    regular = factorise_at(graph, s, f, t, q)
    evaluate_every_row(graph, s, f, Rows(whole, f.rows.Y, f.rows.S, f.rows.h), t)
    return regular


@entry("pdvvm")
def _self_stresses(context, t, q, whole, out):
    """out (count, rows): a self-stress of each redundant row."""
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    find_rows(graph, s, f, q, t, whole)
    for d in range(min(count_self_stresses(f), out.shape[0])):
        self_stress(graph, f, whole, d)
        for e in range(out.shape[1]):
            out[d, e] = f.b[e]


@entry("pvmwwvv")
def free_loads(context, t, q, rows, sides, whole, out):
    """out (k,): the largest load on a body by these sides of H in a unit self-stress, relative to their size.

    rows are those of the multipliers, sides where the eight numbers of each begin.
    """
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    for k in range(t.size):
        out[k] = 0.0 if find_rows(graph, s, f, q[k], t[k], whole) else math.inf
        for d in range(count_self_stresses(f)):
            largest, size = self_stress(graph, f, whole, d), 0.0
            for c in range(8):
                load = 0.0
                for i in range(rows.size):
                    h = whole[sides[i] + c]
                    size = max(size, abs(h))
                    load += f.b[rows[i]] * h
                f.Z[c] = load
            for c in range(8):
                out[k] = max(out[k], abs(f.Z[c]) / max(largest * size, TINY))


def unique(solution, rows, body):
    """Determine whether the reaction of these rows, a slice, on a body is unique: bool (k,)."""
    graph = graph_of(solution.packed, REDUCED)
    if not redundancy(graph):
        return np.ones(solution.t.size, bool)
    wanted = np.flatnonzero((graph.row >= rows.start) & (graph.row < rows.stop))
    owner = np.concatenate((np.arange(len(graph.row)), graph.tails))
    pairs, side = np.nonzero((graph.sides == index_of(solution.packed, body)) & np.isin(owner, wanted)[:, None])
    wanted, sides = owner[pairs], 16 * pairs + 8 * side
    system = solution.system._replace(reals=solution.system.reals.copy())
    context, *_keep = resident(parts(system, graph, solution.q.shape[1]))
    out = np.zeros(solution.t.size)
    free_loads(context, solution.t, solution.q, wanted, sides, np.zeros(16 * len(graph.sides)), out)
    return out < RANK_TOL


# Refusal of joint friction that depends on a reaction which redundant constraints leave undetermined.


@entry("pdvvv")
def _free_loads(context, t, q, whole, out):
    """out (frictions,): the largest normal load in a unit self-stress."""
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    reaction, none, found = stack(6), stack(7), stack(7)
    find_rows(graph, s, f, q, t, whole)
    for d in range(count_self_stresses(f)):
        largest = self_stress(graph, f, whole, d)
        for i in range(out.size):
            friction = graph.frictions[i]
            for c in range(6):
                reaction[c] = 0.0
            normal_load(s, f, friction, q, HERE, reaction, none)
            for j in range(friction.first, friction.first + friction.count):
                e, side = graph.friction_rows[j]
                at = 16 * e + 8 * side
                for c in range(3):
                    reaction[c] -= whole[at + c] * f.b[e] / largest
                    reaction[3 + c] -= whole[at + 4 + c] * f.b[e] / largest
            normal_load(s, f, friction, q, 0, reaction, found)
            out[i] = max(out[i], abs(found[0] - none[0]))


def demand_unique(packed, q, t):
    """Raise RedundantConstraints if a friction depends on a reaction that isn't unique at q."""
    graph = graph_of(packed, REDUCED)
    if packed.derived.switched is not None or not (redundancy(graph) and len(graph.frictions)):
        return
    system = packed.system._replace(reals=packed.system.reals.copy())
    context, *_keep = resident(parts(system, graph, q.size))
    free = np.zeros(len(graph.frictions))
    _free_loads(context, t, q, np.zeros(16 * len(graph.sides)), free)
    wrong = [load.force for load in packed.loads if load.normal >= 0 and free[load.normal] > RANK_TOL]
    if wrong:
        names = ", ".join(force.name for force in wrong)
        joints = ", ".join(force.joint.name for force in wrong)
        raise RedundantConstraints(
            f"{names}: the normal load depends on a reaction of {joints} that is not unique, since constraint rows are "
            "redundant (statically indeterminate).\nUse joints with fewer rows, so that the reaction is unique "
            "(scene.mobility() names the rows), or remove the part of the friction that depends on it."
        )


# Forces and torques that the constraints and forces of a scene exert, of solutions, states and equilibria alike.


def member(packed, constraint):
    """The `Member` of a constraint of the scene."""
    found = member_of(packed, constraint)
    if found is None:
        raise InvalidConstraint(f"{constraint!r} is not a constraint or force of this solution's scene.")
    return found


def acted(packed, item, on):
    """The body on which the load of an item is asked for: a handle, a name, or None for the item's own choice."""
    if on is None:
        return item.on
    handles = handles_of(packed)
    on = handles.body(on) if isinstance(on, str) else handles.own(on)
    if on is item.a or on is item.b or (isinstance(item, (Force, SumRow)) and on in item.bodies):
        if on.dimension:
            return on
        raise InvalidBody(f"{item.name}: the load on the ground is the opposite of the load on {item.on.name!r}.")
    if getattr(on, "dimension", 0):
        on = handles.body(on)  # refuses one of another scene
    raise InvalidBody(f"{item.name}: on must be one of its bodies, got {on!r}.")


def exerted(motion, item, on):
    """Force and torque (k, 3) of an item along a motion, on a body of it.

    A motion has packed, system, t (k,), q and qd (k, n), multipliers (k, m) and _memory (k, slots).
    """
    item = handles_of(motion.packed).item(item)
    load = loads_of(motion.packed).get(id(item))
    if load is not None:
        body = acted(motion.packed, item, on)
        force, torque = force_reaction(motion, load, body)
        if load.slides and motion.packed.derived.holds:
            more = held_reaction(motion, load, body)
            return force + more[0], torque + more[1]
        return force, torque
    if is_idle(motion.packed, item):
        acted(motion.packed, item, on)
        return np.zeros((motion.t.size, 3)), np.zeros((motion.t.size, 3))
    return reaction(motion, member(motion.packed, item), acted(motion.packed, item, on))


def is_idle(packed, item):
    """Whether an item takes no part in a phase of its scene: it is open, or inactive."""
    present = member_of(packed, item) is not None or id(item) in loads_of(packed)
    return not present and any(item is known for known in handles_of(packed).items)


def contact_point(motion, item):
    """Contact point (k, 3) of an item along a motion."""
    return _contact(motion, handles_of(motion.packed).item(item))[0]


def shared(motion):
    """The motion with the multipliers (k, m) of least sum of squares at contacts, as equal tyres on one axle share it.

    lam + z x solves the same equations for self-stresses z, whichever rows are dropped.
    """
    packed, lam = motion.packed, particular(motion.multipliers)
    graph = graph_of(packed, REDUCED)
    if not redundancy(graph):
        return motion
    contacts = [(part, row) for part, row in first_rows(packed.constraints) if hasattr(type(part), "contact")]
    rows = np.concatenate([np.arange(row, row + part.all_rows) for part, row in contacts])
    own, stresses = np.flatnonzero(graph.row >= 0), np.zeros((len(lam), redundancy(graph), len(graph.row)))
    system = motion.system._replace(reals=motion.system.reals.copy())
    context, *_keep = resident(parts(system, graph, motion.q.shape[1]))
    for i, t in enumerate(motion.t):
        _self_stresses(context, t, motion.q[i], np.zeros(16 * len(graph.sides)), stresses[i])
    z = np.zeros((len(lam), lam.shape[1], redundancy(graph)))
    z[:, graph.row[own]] = stresses[:, :, own].swapaxes(1, 2)
    z[~np.isfinite(z).all(axis=(1, 2))] = 0.0  # at a singular configuration
    x = np.linalg.pinv(z[:, rows], rcond=RANK_TOL) @ lam[:, rows, None]
    names = "packed", "system", "t", "q", "qd", "_memory"
    given = {name: getattr(motion, name) for name in names}
    return SimpleNamespace(**given, multipliers=lam - (z @ x)[:, :, 0])


def friction_demand(motion, item):
    """Tangential over normal force (k,); infinite where the surfaces would have to pull, zero where they are apart."""
    item = handles_of(motion.packed).item(item)
    _, normal = _contact(motion, item)
    force, _ = exerted(shared(motion), item, item.on)
    force = force if item.on is item.a else -force
    push = np.einsum("ki,ki->k", normal, force)
    tangential = np.linalg.norm(force - push[:, None] * normal, axis=1)
    size, largest = np.hypot(push, tangential), np.zeros(push.size)
    pulls = (push <= 0.0) & (size > 0.0)
    if pulls.any():  # by rounding, beside what others carry
        for other in contacts_of(handles_of(motion.packed).items):
            largest = np.maximum(largest, np.linalg.norm(exerted(motion, other, None)[0], axis=1))
    demand = np.where(pulls & (size > NEGLIGIBLE * largest), np.inf, 0.0)
    return np.divide(tangential, push, out=demand, where=push > 0.0)


def _contact(motion, item):
    """Contact point and normal of an item; refused where it has none."""
    contact = None if isinstance(item, Force) else touching(motion.packed, member(motion.packed, item), motion.q)
    if contact is None:
        raise InvalidConstraint(
            f"{item.name} has no contact point; RollingDisc, RollingBall, RollingEllipsoid and RollingBallOnCylinder "
            "have one, and contacts with friction."
        )
    return contact


@fitting_methods
class Exerting:
    """Mixed into states that know their scene: `packed`, t, q, qd, qdd, multipliers and the `memory` of forces."""

    __slots__ = ()
    packed: Any
    memory: Any
    t: Any
    q: Floats
    qd: Floats
    qdd: Floats
    multipliers: Floats

    @property
    def handles(self) -> Handles:
        """The bodies and joints of the scene."""
        return handles_of(self.packed)

    def reaction(self, item: ItemLike, on: BodyLike | None = None) -> tuple[Floats, Floats]:
        """Force (N) and torque (N m) that a constraint, a joint as a whole, or a force exerts: (3,) each.

        As `Solution.reaction` has them: on a, or b if a is the ground; in the ground frame, the torque about the item's
        first point on that body. A state at k times gives (k, 3).
        """
        force, torque = exerted(self._motion(item), item, on)
        return (force, torque) if np.ndim(self.t) else (force[0], torque[0])

    def contact_point(self, constraint: ItemLike) -> Floats:
        """Where a rolling or sliding surface touches, as `Solution.contact_point` has it: (3,), of k times (k, 3)."""
        point = contact_point(self._motion(constraint), constraint)
        return point if np.ndim(self.t) else point[0]

    def friction_demand(self, constraint: ItemLike) -> Floats:
        """Tangential over normal force, as `Solution.friction_demand` has it: a number, of k times (k,)."""
        demand = friction_demand(self._motion(constraint), constraint)
        return demand if np.ndim(self.t) else demand[0]

    def _acting(self, item):
        """The packed scene that has a constraint or force as it acts, and multipliers of its rows."""
        return self.packed, self.multipliers

    def _motion(self, item):
        """The states as what `exerted` reads."""
        packed, lam = self._acting(item)
        levels = self.q, self.qd, self.qdd, lam
        t, (q, qd, qdd, lam) = np.atleast_1d(self.t), map(np.atleast_2d, levels)
        memory = with_normal_loads(packed, t, q, qd, qdd, np.atleast_2d(self.memory))
        return SimpleNamespace(packed=packed, system=packed.system, t=t, q=q, qd=qd, multipliers=lam, _memory=memory)


# Where surfaces touch, and where they touch at no single point.


def touching(packed, member, q):
    """Contact point, m, and unit normal towards a, (k, 3) each in the ground frame; None for what has no contact."""
    for i in range(member.parts.start, member.parts.stop):
        find = getattr(type(packed.constraints[i]), "contact", None)
        if find is not None:
            return tuple(level.T for level in twin(find)(_markers(packed, i, q), packed.parameters[i]))
    if has_friction(packed, member.constraint):  # a point on a plane
        x = _markers(packed, member.parts.start, q)
        return x[:3].T, x[6:9].T
    return None


def singular_place(packed, q, among=None):
    """Name the first constraint whose own singular place is at q (n,), and say what it is; "" elsewhere.

    among: primitives, by default all.
    """
    known = packed.derived.with_singular_places
    if known is None:
        parts = enumerate(packed.constraints)
        known = packed.derived.with_singular_places = [i for i, part in parts if hasattr(type(part), "singular_place")]
    for i in known:
        part = packed.constraints[i]
        if among is not None and part not in among:
            continue
        said = twin(type(part).singular_place)(_markers(packed, i, q[None])[:, 0], packed.parameters[i])
        if said:
            return f"{part.name}: {said}"
    return ""


def _markers(packed, i, q):
    """Coordinates (len(x), k) of the markers of a primitive, Points and Vectors, along positions q (k, n)."""
    part, found = packed.constraints[i], []
    for marker, s in zip(part.markers, packed.coordinates[i], strict=True):
        body, x = part.body_of(marker), np.broadcast_to(s, (len(q), 3))
        if body.dimension:
            at = packed.system.bodies[index_of(packed, body), 0]
            x = rotation_matrix(q[:, at + 3 : at + 7]) @ s if body.dimension == 7 else x
            x = x + q[:, at : at + 3] if marker.code == POINT else x
        found.append(x)
    return np.concatenate(found, axis=1).T
