"""Derivatives of all constraints and forces, each as a block of the 14 coordinates of its two bodies.

The loops of implicit methods write into matrices of n columns. Here n is 14 and the instances' bodies are taken to be
two of their own, so one pass fills separate blocks, and storage is O(N).
"""

from typing import NamedTuple

import numpy as np

from ..elements.loops.coordinate_rows import INTS, ROW, STRIDE
from ..elements.loops.forces import INTS as FORCE_INTS
from ..elements.loops.template import AT
from ..jit.kernels import entry
from ..model.equations import call_jacobian, constraint_curvature, set_time
from ..model.packed import with_curvatures
from ..model.packed_forces import with_force_jacobians
from ..model.sparse_jacobian import WIDTH, as_csr

STEP = WIDTH * WIDTH + WIDTH  # floats from a block to the next


class Derivatives(NamedTuple):
    """Of constraints and forces at one motion, sparse."""

    K: object  # (n, n) (Phi_q^T lam)_q
    G1: object  # (m, n) (Phi_q qd + Phi_t)_q
    G2: object  # (m, n) (Phi_q qdd + gamma)_q
    Q_q: object  # (n, n) of applied forces
    Q_qd: object


@entry
def fill_blocks(s, x, lam, rows, Q_q, Q_qd, kept):
    """Blocks of all instances: s has the table of `_separate`; x (4, 14 instances) q, qd, qdd and, first of all, t.

    rows (3, .): K, G1, G2 one after the other. Sums; zero on entry.
    """
    t = x[3, 0]
    set_time(s, t)
    constraint_curvature(s, x[0], x[1], x[2], t, lam, rows[0], rows[1], rows[2])
    for i in range(s.forces.shape[0]):
        kind = s.forces[i]
        table, reals, own = s.table[kind.table :], s.reals[kind.reals :], kept[kind.kept :]
        call_jacobian(kind.jacobian, kind.count, kind.stride, table, reals, x[0], x[1], t, 14, Q_q, Q_qd, 1, own)


class Pairs:
    """Constraints and forces of a packed scene, each on the 14 coordinates of its two bodies.

    Attributes
    ----------
    counts : (int, int)
        Of constraints and of forces, which follow them.
    columns, used : ndarray (instances, 14)
        Coordinates of the two bodies, zero where there are none, and whether there are.
    """

    def __init__(self, packed):
        self.packed = packed
        whole = with_force_jacobians(packed._replace(system=with_curvatures(packed)))
        system, self._size = whole
        constraints, forces = _entries(system, system.kinds, INTS), _entries(system, system.forces, FORCE_INTS)
        constraints = constraints[np.argsort(constraints[:, 1 + ROW], kind="stable")]
        places = np.concatenate((constraints[:, 1 + AT : 5 + AT], forces[:, 1 + AT : 5 + AT]))
        table = system.table.copy()
        table[constraints[:, 0] + STRIDE] = WIDTH
        first = np.concatenate((constraints[:, 0], forces[:, 0]))
        for k in range(2):
            table[first + AT + k] = WIDTH * np.arange(len(first)) + k * (WIDTH // 2)
        self._system = system._replace(table=table)
        self.columns, self.used = _columns(places)
        self.counts = len(constraints), len(forces)

    def blocks(self, motion, lam):
        """(Phi_q^T lam)_q (constraints, 14, 14); rows of G1 and G2 (2, .); Q_q and Q_qd (forces, 14, 14).

        A motion has q, qd, qdd (n,), t, and the system with its memory.
        """
        nc, nf = self.counts
        x = np.zeros((4, max(self.columns.size, 1)))
        for level, values in enumerate((motion.q, motion.qd, motion.qdd)):
            x[level, : self.columns.size] = np.where(self.used, values[self.columns], 0.0).ravel()
        x[3] = motion.t
        rows = np.zeros((3, max(STEP * nc, WIDTH * (len(lam) + nc))))
        Q = np.zeros((2, STEP * (nc + nf)))
        system = self._system._replace(reals=motion.system.reals.copy())
        fill_blocks(system, x, lam, rows, *Q, np.zeros(self._size))
        return _whole(rows[0, : STEP * nc]), rows[1:], *(_whole(one[STEP * nc :]) for one in Q)


def derivatives(motion):
    """The `Derivatives` at a `Motion`."""
    packed, pairs = motion.packed, Pairs(motion.packed)
    (nc, _), m, n = pairs.counts, len(motion.lam), motion.q.size
    K, rows, Q_q, Q_qd = pairs.blocks(motion, motion.lam)
    counts = np.array([packed.constraints[i].rows for i in range(nc)], int)
    lines = np.arange(m) + np.repeat(np.arange(nc), counts)  # of row r in G1 and G2
    G1, G2 = (as_csr(packed, one[: WIDTH * (m + nc)].reshape(-1, WIDTH)[lines]) for one in rows)
    K = _scatter(K, pairs.columns[:nc], pairs.used[:nc], n)
    Q_q, Q_qd = (_scatter(one, pairs.columns[nc:], pairs.used[nc:], n) for one in (Q_q, Q_qd))
    return Derivatives(K, G1, G2, Q_q, Q_qd)


def _whole(blocks):
    """Blocks (instances, 14, 14) without the floats between them."""
    return blocks.reshape(-1, STEP)[:, : WIDTH * WIDTH].reshape(-1, WIDTH, WIDTH)


def _entries(system, kinds, width):
    """Of every instance of some kinds: where its entry in the table begins, and the entry."""
    found = [np.zeros((0, 1 + width), np.int64)]
    for kind in kinds:
        first = kind.table + width * np.arange(kind.count)
        found.append(np.column_stack((first, system.table[first[:, None] + np.arange(width)])))
    return np.concatenate(found)


def _columns(places):
    """Coordinates (instances, 14) of the two bodies, zero where there are none, and whether there are."""
    half = np.arange(WIDTH // 2)
    columns = (places[:, :2, None] + half).reshape(len(places), WIDTH)
    used = (half < places[:, 2:, None]).reshape(len(places), WIDTH)
    return np.where(used, columns, 0), used


def _scatter(blocks, columns, used, n):
    """Sum of blocks as a sparse (n, n)."""
    from scipy.sparse import csr_array

    both = used[:, :, None] & used[:, None, :]
    i, j = np.broadcast_arrays(columns[:, :, None], columns[:, None, :])
    return csr_array((blocks[both], (i[both], j[both])), (n, n))
