"""Bodies that a scene never turns, and its network without their rotations.

A row on directions of two bodies alone, which no time enters, holds an orientation. Where three such rows join a body
to the ground, or to bodies that are held already, and are independent there, the orientations that they allow are
isolated: the body keeps the one that it has for as long as it moves. So those rows hold by themselves, and neither they
nor the body's rotation need be in the equations. Rows that are redundant hold nothing here: what is left is then as
independent as the whole was, and the dropped rows follow from the others as before.
"""

from typing import NamedTuple

import numpy as np

from .markers import PARAMETERS, VECTOR
from .motion import Motion
from .network import DROPPED, N_COUNT, N_FIRST_REAL, N_REALS, build, is_regular, network_of, with_loops
from .system import FIRST_REAL, classes

STILL, NETWORK = ("still",), ("still", "network")  # in Packed.shared, as tuples: `network.drop` takes them out
TURNING = "turning"
LEAST = 1e-6  # of the largest singular value of three rows: with less they don't hold a body


class Still(NamedTuple):
    """What of a scene never turns."""

    bodies: np.ndarray  # int64 (h,)
    rows: np.ndarray  # int64 (h, 3): the rows of Phi that hold each
    omitted: frozenset  # places in Packed.constraints: what joins these bodies to each other and the ground so
    dropped: np.ndarray  # int64: rows of Phi that are redundant


def still(packed):
    """The `Still` of a packed scene with the rows that it drops now; where they hold is for `settle` to say."""
    kept = packed.shared
    if STILL not in kept:
        kept[STILL] = _find(packed)
    return kept[STILL]


def turning(packed):
    """The set of bodies (their numbers) that are never taken for still, whatever holds them; add to it before a run."""
    return packed.shared.setdefault(TURNING, set())


def moving_network(packed, *columns):
    """As `network_of`, without the rotations of bodies that are still; the same where there are none."""
    found, kept = still(packed), packed.shared
    if not found.bodies.size:
        return network_of(packed, *columns)
    key = (*STILL, *columns)
    if key not in kept:
        if NETWORK not in kept:
            kept[NETWORK] = build(packed, found)
        kept[key] = with_loops(*kept[NETWORK], *columns)
    return kept[key]


def moving_parts(packed):
    """The same network without addresses of loops, and the classes of its kinds; a network of the caller's own."""
    found = still(packed)
    return build(packed, found if found.bodies.size else None)


def settle(packed, network, H):
    """Have bodies turn, from now on, that the rows H of the whole network, (m 16,), don't hold where they stand."""
    while (found := still(packed)).bodies.size:
        place = np.empty(len(packed.system.segments), np.int64)
        place[network.row[network.row >= 0]] = np.flatnonzero(network.row >= 0)
        rows = place[found.rows]
        side = np.where(network.sides[rows, 0] == found.bodies[:, None], 0, 1)
        torques = H.reshape(-1, 2, 8)[rows, side, 4:7]
        sizes = np.linalg.svd(torques, compute_uv=False)
        loose = ~(sizes[:, 2] > LEAST * sizes[:, 0])
        if not loose.any():
            return
        turning(packed).update(found.bodies[loose].tolist())
        forget(packed)


def forget(packed):
    """Have it found anew what is still."""
    for key in [key for key in packed.shared if isinstance(key, tuple) and key[:1] == STILL]:
        del packed.shared[key]


def hold(packed, q, qd):
    """Positions and velocities with what never turns at rest to the last digit, its Euler parameters of length one."""
    first = packed.system.bodies[still(packed).bodies, 0]
    if not first.size:
        return q, qd
    at = first[:, None] + np.arange(3, 7)
    p, q, qd = q[at], q.copy(), qd.copy()
    square = (p * p).sum(axis=1)
    q[at] = np.where((np.abs(square - 1.0) > 1e-15)[:, None], p / np.sqrt(square)[:, None], p)
    qd[at] = 0.0
    return q, qd


def instances(packed, network):
    """For each row of Network.kinds its class, and of its instances each constraint with its parameters."""
    groups = {kind: [] for kind in classes(packed)}
    for pair in zip(packed.constraints, packed.parameters, strict=True):
        groups[type(pair[0])].append(pair)
    kinds, begins, found = list(groups), packed.system.kinds[:, FIRST_REAL], []
    for row in network.kinds:
        i = int(np.searchsorted(begins, row[N_FIRST_REAL], side="right")) - 1
        first = int((row[N_FIRST_REAL] - begins[i]) // row[N_REALS])
        found.append((kinds[i], groups[kinds[i]][first : first + int(row[N_COUNT])]))
    return found


def _find(packed):
    """From the ground outwards, body by body."""
    bodies, nb = {id(body): i for i, body in enumerate(packed.bodies)}, len(packed.bodies)
    joints, row, holds = [[] for _ in range(nb + 1)], 0, {kind: _holds(kind) for kind in classes(packed)}
    for i, (constraint, given) in enumerate(zip(packed.constraints, packed.parameters, strict=True)):
        if holds[type(constraint)] and not any(isinstance(value, Motion) for value in given):
            pair = tuple(bodies.get(id(body), nb) for body in (constraint.a, constraint.b))
            for body in set(pair):
                joints[body].append((i, pair, range(row, row + constraint.rows)))
        row += constraint.rows
    gone = set()
    if joints[nb] and len(packed.shared.get(DROPPED, ())):
        whole = network_of(packed)
        gone = set(whole.row[packed.shared[DROPPED]].tolist())
    holding = {}  # body: rows
    held, ways = {nb}, [nb] if joints[nb] and is_regular(packed) else []
    while ways:
        body = ways.pop()
        for _, pair, rows in joints[body]:
            for other in set(pair) - held - turning(packed):
                mine = holding.setdefault(other, [])
                mine += [row for row in rows if row not in gone]
                if len(mine) >= 3:
                    held.add(other)
                    ways.append(other)
    omitted = frozenset(i for body in held for i, pair, _ in joints[body] if held.issuperset(pair))
    held = np.array(sorted(held - {nb}), np.int64)
    rows = np.array([holding[body][:3] for body in held.tolist()], np.int64).reshape(-1, 3)
    return Still(held, rows, omitted, np.array(sorted(gone), np.int64))


def _holds(kind):
    """Whether a kind of constraint is on directions alone, and no time enters it but by a Motion."""
    return (
        all(marker.code in (VECTOR, PARAMETERS) for marker in kind.markers)
        and not (kind.normalises or kind.memory)
        and ("phi_t" not in kind.kernels or bool(kind.quantities()))
    )
