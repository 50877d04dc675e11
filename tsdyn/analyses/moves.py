"""A configuration at rest and how it is moved: by increments that close the constraints, as far as loads do work."""

import numpy as np

from ..configuration.continuation import Metric, close
from ..configuration.tolerances import MOST_ROTATION
from ..elements.markers import POINT
from ..errors import SingularConfiguration
from ..jit.kernels import entry
from ..maths.dense_linalg import dependent
from ..maths.tolerances import PIVOT_ROUNDING, TINY
from ..model.equations import WIDTH, places, remember, set_time, with_short_rows
from ..model.handles import all_angles, counted
from ..model.packed import no_system
from ..observables.evaluate import dependent_rows
from ..rows.constraint_graph import redundant_rows
from .nominal_motion import NominalMotion, Pairs
from .rest import Increments, Rest, SparsePattern
from .tolerances import ACCEPTED, DENSE, FINAL, GOOD, HALVINGS, REDUNDANT_SHARE, REGULARISED, SHORT, SHORTER, WORTH

# What is constant during a search for an equilibrium: kinds of rows, bodies of each part, sparsity.


class SceneStructure:
    """Of a packed scene at time t, s; reach is a length of it, m.

    Attributes
    ----------
    own : ndarray (m',)
        Rows of Phi but normalisations; normals : (b',) those.
    parts : ndarray (e,)
        The `Pairs` that aren't normalisations.
    rows, blocks, saddle, light : Pattern
        Of A (m', size), of sums of blocks (e, 12, 12) and (b, 6, 6), and of [[K, A^T], [A, diagonal]], the last with a
        diagonal K.
    """

    def __init__(self, packed, t, q):
        self.packed, self.t, self.metric = packed, t, Metric(packed, None, t, rates=True)
        self.reach = self.metric.reach(q)
        self.system, self.pairs = with_short_rows(packed), Pairs(packed)
        self.increments = Increments(self.metric, self.reach)
        kinds = np.array([part.normalises for part in packed.constraints], bool)
        self.own = self.metric.own
        rows = np.repeat(kinds, [part.all_rows for part in packed.constraints])
        self.normals = np.flatnonzero(rows)
        at, length = places(packed)
        # Short rows, those of later terms of sums last; their places among those of `own`
        tails = packed.system.tails
        self.lines = np.concatenate((self.own, len(packed.system.segments) + np.arange(tails.size)))
        self._line_rows = np.concatenate((np.arange(self.own.size), np.searchsorted(self.own, tails)))
        self._by_rows = self.increments.bodies_at(at[self.lines], length[self.lines])
        self.normal_bodies = self.increments.bodies_at(at[self.normals, 0], length[self.normals, 0])
        self.parts = np.flatnonzero(~np.concatenate((kinds, np.zeros(self.pairs.counts[1], bool))))
        self.constraints = int((~kinds).sum())
        half = WIDTH // 2
        lengths = self.pairs.used.reshape(-1, 2, half).sum(axis=2)[self.parts]
        self.by_parts = self.increments.bodies_at(self.pairs.columns[self.parts][:, ::half], lengths)
        self.no_pairs = np.zeros((len(self.parts), 12, 12))
        self._make_patterns()
        self.weights = self._weights()
        self._known = redundant_rows(packed)

    def _make_patterns(self):
        each, m, size = self.increments, self.own.size, self.increments.size
        columns = each.columns_of(self.by_parts)
        pairs = SparsePattern.of_blocks(columns, columns, (size, size))
        self.blocks = SparsePattern.of_parts([(pairs, 0, 0), (each.own, 0, 0)], (size, size))
        self._pairs = pairs
        self.rows = SparsePattern.of_blocks(self._line_rows[:, None], each.columns_of(self._by_rows), (m, size))
        turned = SparsePattern(self.rows.columns, self.rows.rows, (size, m))
        below = SparsePattern(np.arange(m), np.arange(m), (m, m))
        whole = size + m, size + m
        self._across, self._turned = self.rows, turned
        order = [(self.blocks, 0, 0), (self.rows, size, 0), (turned, 0, size), (below, size, size)]
        self.saddle = SparsePattern.of_parts(order, whole)
        diagonal = SparsePattern(np.arange(size), np.arange(size), (size, size))
        self.light = SparsePattern.of_parts([(diagonal, 0, 0), *order[1:]], whole)

    def _weights(self):
        """G of rest.py: the pattern of its saddle-point matrix, its numbers, their places, and its diagonal (size,)."""
        shifts, size = self.increments.translates, self.increments.size
        diagonal, rods = np.where(shifts, REGULARISED, 1.0), self._rods()
        if not rods.size:
            return self.light, diagonal, (np.arange(size), np.arange(size)), diagonal
        pairs, own = self.no_pairs.copy(), np.zeros((len(self.metric.at), 6, 6))
        for i, j, sign in ((0, 0, 1.0), (6, 6, 1.0), (0, 6, -1.0), (6, 0, -1.0)):
            pairs[rods, i : i + 3, j : j + 3] = sign * np.eye(3)
        own[:, range(6), range(6)] = np.repeat([[REGULARISED, 1.0]], 3, axis=1)
        top = self.stiffness(pairs, own)
        return self.saddle, top, (self.blocks.rows, self.blocks.columns), self.blocks.matrix(top).diagonal()

    def _rods(self):
        """Which parts hold two points at a distance: the difference of displacements rotates them."""
        kept = [self.packed.constraints[i] for i in self.parts[: self.constraints]]
        return np.flatnonzero(
            [
                part.rows == part.all_rows == 1 and not part.summed and all(m.code == POINT for m in part.markers)
                for part in kept
            ]
        )

    def stiffness(self, pairs, own):
        """Numbers of the sum of blocks of pairs (e, 12, 12) and of bodies (b, 6, 6), for `blocks`."""
        return self.blocks.sum(np.concatenate((self._pairs.sum(pairs), self.increments.own.sum(own))))

    def matrix(self, pattern, top, A, below):
        """[[top, A^T], [A, below]] by `saddle` or `light`; A are numbers for `rows`."""
        return pattern.matrix(pattern.sum(np.concatenate((top, A, self._turned.sum(A), below))))

    def transformed_rows(self, P, rows):
        """Numbers for `rows` of short rows (lines, 14)."""
        halves = rows[self.lines].reshape(-1, 2, 1, WIDTH // 2) @ P[self._by_rows]
        return self.rows.sum(halves.reshape(-1, 12))

    def falling(self):
        """Numbers of the bodies of a part that gravity acts on and nothing joins to the ground; none without gravity.

        Constraints and forces of one body join it to the ground.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        count, (i, j) = len(self.metric.at), self.by_parts.T
        if not np.any(self.system.gravity):
            return np.zeros(0, int)
        graph = coo_array((np.ones(len(i)), (i, j)), (count + 1, count + 1))
        parts = connected_components(graph, directed=False)[1]
        loose = np.flatnonzero(parts[:-1] != parts[-1])
        return loose[parts[loose] == parts[loose[0]]] if loose.size else loose

    def closed(self, q):
        """The consistent configuration next to q by Gauss-Newton steps; None where there is none."""
        q, Phi, _ = close(self.metric, q)
        return q if np.abs(Phi).max(initial=0.0) <= ACCEPTED * (1.0 + np.abs(q).max()) else None

    def left_out(self, A, q):
        """Which of the own rows are redundant at q, bool (m',); A are numbers for `rows`."""
        found = np.zeros(self.own.size, bool)
        if not self._known.size:
            return found
        if self.metric.n <= DENSE:
            which = self.own[dependent(self.rows.matrix(A).toarray())]
        else:
            which = dependent_rows(self.packed, q, self.t, REDUNDANT_SHARE)
        which = self._known if which is None or which.size != self._known.size else which
        found[np.searchsorted(self.own, which)] = True
        return found


# A configuration at rest, and moves to others: increments that satisfy the constraints, along which loads do work.
#
# The work along an increment is that of the trapezoidal rule, so no load needs a potential.


@entry(no_system(), "vvdv")
def update_memory(s, q, qd, t, out):
    """Let forces and constraints remember a configuration; out (slots,)."""
    set_time(s, t)
    remember(s, q, qd, t, out)


class Moves:
    """A configuration at rest.

    Parameters
    ----------
    packed : Packed
    handles : Handles
    remembered : ndarray
        Joint angles, then memory of forces and constraints.
    t : float, s
    q : ndarray (n,)
        Consistent.
    report : callable (fraction, said)
        Called with the progress of the search.

    Attributes
    ----------
    rest : Rest
    angles, memory : ndarray
        What is remembered here.
    gone, turned : float
        Of all moves: the largest shifts, m, and turns, rad.
    longest : float, m
        A move's largest shift.
    trust : float
        The share of the longest move that the last one did its work on.
    """

    def __init__(self, packed, handles, remembered, t, q, report):
        self.report = report
        self.packed, self.handles, self.t = packed, handles, t
        self.angles, self.memory = remembered[: handles.count].copy(), remembered[handles.count :].copy()
        self.frame = SceneStructure(packed, t, q)
        self.reach, self.increments = self.frame.reach, self.frame.increments
        self.rest, self._motion = self._at(q), None
        self.gone, self.turned, self.longest, self.trust = 0.0, 0.0, 0.5 * self.reach, 1.0

    def _at(self, q):
        return Rest(self.frame, self.memory, q)

    @property
    def motion(self):
        """The `Motion` here."""
        if self._motion is None or self._motion.q is not self.rest.q:
            self._motion = self._motion_at(self.rest.q)
        return self._motion

    def _motion_at(self, q):
        return NominalMotion(self.packed, self.memory, self.t, q, np.zeros(q.size), still=True)

    @property
    def unbalanced(self):
        """The largest acceleration from rest, m/s^2, over that of the loads by themselves."""
        return self.rest.unbalanced

    def nothing(self, reduced):
        """Stiffness, 1/s^2, that counts as zero: rounding of its terms, and apparent stiffness of residual loads."""
        left = self.unbalanced * self.rest.acceleration_scale / self.reach
        return PIVOT_ROUNDING * reduced.scale + len(reduced.K_hat) * left

    def size(self, u):
        """The largest shift, as a share of the reach, or turn, rad, of an increment."""
        shift, turn = self.increments.extent(u)
        return max(shift / self.reach, turn)

    def length(self, u):
        """The same over that of the longest move."""
        shift, turn = self.increments.extent(u)
        return max(shift / self.longest, turn / MOST_ROTATION, TINY)

    def advance(self, u, factors):
        """Move by an increment, or a fraction along which loads do the predicted work; whether it moves."""
        far, factor = self.length(u), 1.0
        turn = self.increments.extent(u)[1]
        factor = min(1.0, self.trust / far)
        for _ in range(HALVINGS):
            if self.attempt(factor * u, factors):
                limited = factor * far > 0.99 * self.trust
                if limited and self.trust == 1.0 and factor * turn < 0.99 * MOST_ROTATION:
                    self.longest *= 2.0
                self.trust = min(1.0, self.trust * 2.0) if limited or factor == 1.0 else factor * far
                return True
            factor *= SHORTER
        return False

    def attempt(self, u, factors):
        """Move by an increment if the loads do work along it; whether they do."""
        old, size = self.rest, self.size(u)
        promised = float(old.left @ u) - 0.5 * old.quadratic.along(u)
        moved = self.increments.moved(old.q, u)
        q = old.closed(moved, factors.correction)
        q = old.closed(moved) if q is None else q
        if q is None or not np.isfinite(promised):
            return False
        if size > SHORT:
            work = 0.5 * (old.Q + old.loads_at(q)) @ (q - old.q)
            if not work > WORTH * promised:
                return False
        return self._move(q, u, size, promised)

    def approach_by(self, u):
        """Move by an increment, or a fraction that reduces the residual; whether one does."""
        factor = min(1.0, 1.0 / self.length(u))
        for i in range(HALVINGS):
            q = self.rest.closed(self.increments.moved(self.rest.q, factor * 0.5**i * u))
            if q is not None and self._move(q, factor * 0.5**i * u, 0.0, np.inf):
                return True
        return False

    def _move(self, q, u, size, promised):
        """Be at q. After a short way, whose work is rounding, less must be unbalanced, or what is left does work."""
        old = self.rest
        try:
            rest = self._at(q)
        except SingularConfiguration:
            return False
        better = size > SHORT or rest.unbalanced < GOOD * old.unbalanced
        if not (better or (size > FINAL and 0.5 * (old.left + rest.left) @ u > WORTH * promised)):
            return False
        shift, turn = self.increments.extent(u)
        self.gone, self.turned, self.rest = self.gone + shift, self.turned + turn, rest
        self.remember()
        return True

    def remember(self):
        """Count turns up to here."""
        q = self.rest.q
        if self.handles.count:
            self.angles = counted(all_angles(self.handles, q), self.angles)
        if self.memory.size:
            out, system = np.zeros(self.memory.size), self.rest.system
            update_memory(system, q, np.zeros(q.size), self.t, out)
            if not np.array_equal(out, self.memory):
                self.memory = out
                self.rest = self._at(q)
