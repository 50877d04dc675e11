"""The packed system: what the kernels see of a scene, as a named tuple of arrays whose type never changes."""

from typing import NamedTuple

import numpy as np

from .motion import Motion
from .primitive import AT, BLOCK, DIMENSION, INTS, ROW, STRIDE

# columns of System.kinds: four addresses, then where a kind's instances are
PHI, JACOBIAN, GAMMA, PHI_T, COUNT, REALS, FIRST_INT, FIRST_REAL, COLUMNS = range(9)


class System(NamedTuple):
    """All that a scene says, as arrays; built by `pack`, constant during a run but for the motions' places in reals."""

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length 7 or 3
    mass: np.ndarray  # float64 (nb,)
    inertia: np.ndarray  # float64 (nb, 9): J' row by row; zero for a point mass
    gravity: np.ndarray  # float64 (3,)
    kinds: np.ndarray  # int64 (kinds, 8): addresses and extents, columns above
    table: np.ndarray  # int64: for each instance the places in q and Phi_q, primitive.INTS numbers
    reals: np.ndarray  # float64: for each instance marker coordinates, then parameters
    motions: np.ndarray  # int64 (motions, 4): addresses of f, fd, fdd; place of the first in reals
    rheonomic: np.ndarray  # int64 (1,): whether any row depends on time
    segments: np.ndarray  # int64 (m, 4): the nonzero columns of a row of Phi_q: begin, length, twice


def pack(scene):
    """Pack a scene into a System; loads (at the very first use compiles) the kernels of the kinds it uses."""
    starts = np.cumsum([0, *(body.dimension for body in scene.bodies)])
    n = int(starts[-1])
    where = {id(body): (int(at), body.dimension) for at, body in zip(starts, scene.bodies, strict=False)}
    groups, row = {}, 0
    segments = []
    for constraint in scene.constraints:
        groups.setdefault(type(constraint), []).append((constraint, row))
        row += constraint.rows
        spans = [where.get(id(body), (0, 0)) for body in (constraint.a, constraint.b)]
        segments += [[*spans[0], *spans[1]]] * constraint.rows

    kinds, table, reals, motions = [], [], [], []
    for kind, members in groups.items():
        first = len(table), len(reals)
        for constraint, at_row in members:
            table += _places(constraint, at_row, n, where)
            reals += np.concatenate(constraint.coordinates).tolist()
            for value in constraint.parameters():
                if isinstance(value, Motion):
                    motions.append((*value.addresses, len(reals)))
                    reals += value.value(0.0)
                else:
                    reals.append(float(value))
        stride = (len(reals) - first[1]) // len(members)
        addresses = [kind.kernels[name].address for name in ("phi", "jacobian", "gamma")]
        moving = any(constraint.rheonomic for constraint, _ in members)
        addresses.append(kind.kernels["phi_t"].address if moving else 0)
        kinds.append([*addresses, len(members), stride, *first])

    inertias = [body.values.get("inertia", np.zeros((3, 3))).ravel() for body in scene.bodies]
    return System(
        bodies=np.array(list(where.values()), np.int64).reshape(-1, 2),
        mass=np.array([body.values["mass"] for body in scene.bodies]),
        inertia=np.array(inertias).reshape(-1, 9),
        gravity=scene.gravity,
        kinds=np.array(kinds, np.int64).reshape(-1, COLUMNS),
        table=np.array(table, np.int64),
        reals=np.array(reals),
        motions=np.array(motions, np.int64).reshape(-1, 4),
        rheonomic=np.array([any(kind[PHI_T] for kind in kinds)], np.int64),
        segments=np.array(segments, np.int64).reshape(-1, 4),
    )


def _places(constraint, row, n, where):
    """Fill the table entry of one instance; the ground has dimension 0 and no place."""
    entry = np.zeros(INTS, np.int64)
    for i, body in enumerate((constraint.a, constraint.b)):
        at, dimension = where.get(id(body), (0, 0))
        entry[AT + i], entry[DIMENSION + i], entry[BLOCK + i] = at, dimension, row * n + at
    entry[ROW], entry[STRIDE] = row, n
    return entry.tolist()
