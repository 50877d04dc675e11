"""Locked orientations: bodies that the constraints never let rotate, and the constraint graph without their rotations.

A scleronomic row on directions alone constrains relative orientation. If three independent rows of this sort join a
body to the ground, or to bodies that are locked already, the admissible orientations are isolated, and the body keeps
its initial orientation. The rows then hold identically, and neither the rows nor the rotation of the body enter the
equations. The reduced graph keeps every redundancy of the remaining rows.
"""

from typing import NamedTuple

import numpy as np

from ..elements.markers import PARAMETERS, VECTOR
from ..maths.tolerances import NEGLIGIBLE, ROUNDING
from ..model.handles import classes, inertia_classes
from ..motions.prescribed import Motion
from ..rows.constraint_graph import build, graph_of, parts_of, redundant_rows, with_loops
from ..rows.interface import MOST_ROWS


class Still(NamedTuple):
    """What of a scene never turns."""

    bodies: np.ndarray  # int64 (h,)
    holding: np.ndarray  # int64 (k, 2): which of these bodies a row of Phi holds
    omitted: frozenset  # places in Packed.constraints: what joins these bodies to each other and the ground so
    redundant: np.ndarray  # int64: rows of Phi, redundant ones of those that are left


def still(packed):
    """The `Still` of a packed scene with its present redundant rows; `release_loose_bodies` checks if these hold."""
    known = packed.derived
    if known.locked is None:
        known.locked = _find(packed) if known.shared is None else _found_once(packed)
    return known.locked


def _found_once(packed):
    """The `Still` that scenes of a family share, with their redundant rows and bodies that turn."""
    known, rows = packed.derived, packed.derived.redundant
    key = still, None if rows is None else rows.tobytes(), frozenset(known.turning)
    if key not in known.shared:
        known.shared[key] = _find(packed)
    return known.shared[key]


def keep_turning(packed, bodies):
    """Take these bodies (their numbers) for no still ones from now on, whatever holds them."""
    packed.derived.turning.update(bodies)
    packed.derived.forget_locked()


def moving_graph(packed, *columns):
    """As `graph_of`, without the rotations of bodies that are still; the same where there are none."""
    found, known = still(packed), packed.derived
    if not found.bodies.size:
        return graph_of(packed, *columns)
    if columns not in known.moving_networks:
        if known.moving_graph is None:
            known.moving_graph = build(packed, found)
        known.moving_networks[columns] = with_loops(*known.moving_graph, *columns)
    return known.moving_networks[columns]


def moving_parts(packed):
    """The same graph without addresses of loops, and the classes of its kinds; its table is the caller's own."""
    found = still(packed)
    if found.bodies.size:
        return build(packed, found)
    graph, kinds = parts_of(packed)
    return graph._replace(table=graph.table.copy()), kinds


def release_loose_bodies(packed, graph, H):
    """Let bodies rotate from now on whose orientation the rows H of the whole graph, (m 16,), don't hold."""
    while (found := still(packed)).bodies.size:
        place, real = np.full(len(packed.system.segments), -1), graph.row >= 0
        place[graph.row[real]] = np.flatnonzero(real)
        which, rows = found.holding[:, 0], place[found.holding[:, 1]]
        side = np.where(graph.sides[rows, 0] == found.bodies[which], 0, 1)
        torques, squares = H.reshape(-1, 2, 8)[rows, side, 4:7], np.zeros((len(found.bodies), 3, 3))
        np.add.at(squares, which, torques[:, :, None] * torques[:, None, :])
        sizes = np.linalg.eigvalsh(squares)
        loose = ~(sizes[:, 0] > NEGLIGIBLE * sizes[:, 2])
        if not loose.any():
            return
        keep_turning(packed, found.bodies[loose].tolist())


def hold(packed, q, qd):
    """Positions and velocities with what never turns at rest to the last digit, its Euler parameters of length one."""
    first = packed.system.bodies[still(packed).bodies, 0]
    if not first.size:
        return q, qd
    at = first[:, None] + np.arange(3, 7)
    p, q, qd = q[at], q.copy(), qd.copy()
    square = (p * p).sum(axis=1)
    q[at] = np.where((np.abs(square - 1.0) > ROUNDING)[:, None], p / np.sqrt(square)[:, None], p)
    qd[at] = 0.0
    return q, qd


def instances(packed, graph):
    """For each row of ConstraintGraph.kinds its class, and of its instances each constraint with its parameters."""
    groups = {kind: [] for kind in (*classes(packed), *inertia_classes(packed))}
    pairs = [*zip(packed.constraints, packed.parameters, strict=True)]
    for pair in (*pairs, *((row, row.parameters()) for row in packed.inertias)):
        groups[type(pair[0])].append(pair)
    kinds, found = list(groups), []
    begins = np.concatenate((packed.system.kinds["reals"], packed.system.inertias["reals"]))
    for row in graph.kinds:
        i = int(np.searchsorted(begins, row.reals, side="right")) - 1
        first = int((row.reals - begins[i]) // row.stride)
        found.append((kinds[i], groups[kinds[i]][first : first + int(row.count)]))
    return found


def _find(packed):
    """From the ground outwards, body by body."""
    joints, held, holding = _joints(packed), {len(packed.bodies)}, {}
    ways = list(held) if joints[-1] else []
    turning = packed.derived.turning | _bodies_with_friction(packed)
    while ways:
        for _, pair, rows in joints[ways.pop()]:
            for other in set(pair) - held - turning:
                mine = holding.setdefault(other, [])
                mine += rows
                if len(mine) >= 3:
                    held.add(other)
                    ways.append(other)
    omitted = {i: rows for body in held for i, pair, rows in joints[body] if held.issuperset(pair)}
    bodies = sorted(held - {len(packed.bodies)})
    redundant = _redundant(packed, omitted, sum(map(len, omitted.values())) - 3 * len(bodies))
    if redundant is None:
        bodies = omitted = redundant = ()
    holding = [(i, row) for i, body in enumerate(bodies) for row in holding[body]]
    return Still(
        np.array(bodies, np.int64),
        np.array(holding, np.int64).reshape(-1, 2),
        frozenset(omitted),
        np.array(redundant, np.int64),
    )


def _bodies_with_friction(packed):
    """The bodies whose joints have friction, which needs their whole reactions."""
    bodies = {id(body): i for i, body in enumerate(packed.bodies)}
    forces = [load.force for load in packed.loads if load.normal >= 0]
    return {bodies[id(body)] for force in forces for body in (force.a, force.b) if id(body) in bodies}


def _joints(packed):
    """For each body and, last, the ground: (place in Packed.constraints, both bodies, rows) of what may hold it."""
    bodies, nb = {id(body): i for i, body in enumerate(packed.bodies)}, len(packed.bodies)
    holds, found, row = {kind: _holds(kind) for kind in classes(packed)}, [[] for _ in range(nb + 1)], 0
    switched = () if packed.derived.switched is None else set(packed.derived.switched.tolist())
    for i, (constraint, given) in enumerate(zip(packed.constraints, packed.parameters, strict=True)):
        moves = row in switched or any(isinstance(value, Motion) for value in given)
        if holds[type(constraint)] and not moves:
            pair = tuple(bodies.get(id(body), nb) for body in (constraint.a, constraint.b))
            for body in set(pair):
                found[body].append((i, pair, range(row, row + constraint.all_rows)))
        row += constraint.all_rows
    return found


def _redundant(packed, omitted, spare):
    """Redundant rows among those that are left: as many as in the whole scene less the `spare` ones that are omitted.

    If too few redundant rows of the whole scene are left, others are added: a run reselects rows. None where that can't
    be done.
    """
    whole = redundant_rows(packed)
    if not len(whole):
        return () if spare == 0 else None
    gone, row, left, others = set(whole.tolist()), 0, [], []
    for i, constraint in enumerate(packed.constraints):
        if i not in omitted and not constraint.normalises:
            for one in range(row, row + constraint.all_rows):
                (left if one in gone else others).append(one)
        row += constraint.all_rows
    wanted = len(gone) - spare - len(left)
    if wanted < 0 or (wanted > 0 and len(left) + len(others) > MOST_ROWS):
        return None
    return sorted(left + others[len(others) - wanted :])


def _holds(kind):
    """Return True if a kind of constraint is on directions alone, and depends on time through a Motion only."""
    return (
        all(marker.code in (VECTOR, PARAMETERS) for marker in kind.markers)
        and not (kind.normalises or kind.memory or kind.rate_rows)
        and ("phi_t" not in kind.kernels or bool(kind.quantities()))
    )
