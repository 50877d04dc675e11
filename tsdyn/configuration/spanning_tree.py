"""A spanning tree of the bodies of a scene, and the constraints that close loops beside it.

Residuals are Phi and, for each pair of directions that a constraint aligns, u - v: Phi also admits u = -v. They are
differentiated by twists (v, omega) of the bodies about their centroids, v in units of the scene's size, ground frame.
"""

from typing import NamedTuple

import numpy as np

from ..elements.bodies import rotation_matrix, transform_g
from .motor_starts import opposed
from .tolerances import INITIAL_TOL, TREE_RANK


class Edge(NamedTuple):
    """A constraint between bodies of the tree."""

    constraint: object
    ends: tuple  # numbers of its bodies; the last number is that of the ground and of bodies that are held
    rows: range  # of Phi


class Tree:
    """A spanning tree; places count its bodies from the roots on, those beyond a joint in a row.

    Parameters
    ----------
    metric : Metric
        Of the scene; bodies that it holds belong to the ground.
    q : ndarray (n,)
        A sketch: joints that hold in it are preferred.
    cut, first : collections of constraints
        That are no part of the tree; that are wherever they can be.
    """

    def __init__(self, metric, q, cut=(), first=()):
        self.metric, self.packed, self.reach = metric, metric.packed, metric.reach(q)
        free = ~metric.held
        self.ground = free.size
        self.number = {id(body): i if free[i] else self.ground for i, body in enumerate(self.packed.bodies)}
        edges, self.loops = [], []
        for member in self.packed.members:
            constraint = member.constraint
            if getattr(constraint, "normalises", False) or not constraint.rows:
                continue
            ends = {self.of(part.body_of(marker)) for part in constraint.parts for marker in part.markers}
            edge = Edge(constraint, tuple(ends), range(member.rows.start, member.rows.stop))
            whole = len(ends) == 2 and not any(constraint is each for each in cut)
            (edges if whole else self.loops).append(edge)
        Phi, least = np.abs(metric.arrays(q)[0]), INITIAL_TOL * (1.0 + np.abs(q).max())
        mirrored = opposed(self.packed, q, metric.t)

        def rank(edge):
            preferred = any(edge.constraint is each for each in first)
            is_open = bool(Phi[edge.rows].max() > least) or edge.constraint.title in mirrored
            return not preferred, is_open, -len(edge.rows)

        self._grow(sorted(edges, key=rank), np.flatnonzero(free).tolist())
        self._lay_out()
        self.weights = np.ones(self.rows)
        lengths = np.sqrt(np.asarray(self.slopes(q).power(2).sum(axis=1)).ravel())
        self.weights = 1.0 / np.where(lengths > TREE_RANK * self.reach, lengths, self.reach)

    def of(self, body):
        """The number of a body."""
        return self.number.get(id(body), self.ground)

    def _grow(self, edges, free):
        """Take edges that close no loop; hang the bodies from the ground, and parts without ground from a body."""
        group, near = list(range(self.ground + 1)), [[] for _ in range(self.ground + 1)]

        def top(i):
            while group[i] != i:
                group[i] = i = group[group[i]]
            return i

        for edge in edges:
            a, b = map(top, edge.ends)
            if a == b:
                self.loops.append(edge)
                continue
            group[a] = b
            for one, other in (edge.ends, edge.ends[::-1]):
                near[one].append((other, one, edge))
        self.place, order = {self.ground: -1}, []
        for root in (self.ground, *free):
            ahead = near[root][::-1] if root == self.ground else [(root, self.ground, None)]
            while ahead:
                body, parent, edge = ahead.pop()
                if body not in self.place:
                    self.place[body] = len(order)
                    order.append((body, self.place[parent], edge))
                    ahead += near[body][::-1]
        self.joints = [edge for *_, edge in order]  # None of a root
        self.bodies, self.parents = (np.array([each[k] for each in order], int) for k in (0, 1))

    def _lay_out(self):
        """Where the subtrees end, the levels of the tree, and which residuals belong to joints and to loops."""
        count, last = len(self.joints), self.metric.packed.members[-1:]
        self.ends, depth = np.arange(1, count + 1), np.zeros(count, int)
        for i in range(count):
            depth[i] = 0 if self.parents[i] < 0 else depth[self.parents[i]] + 1
        for i in reversed(range(count)):
            if self.parents[i] >= 0:
                self.ends[self.parents[i]] = max(self.ends[self.parents[i]], self.ends[i])
        self.levels = [np.flatnonzero(depth == k) for k in range(depth.max(initial=-1) + 1)]
        self.rows = self.of_Phi = last[0].rows.stop if last else 0
        pairs, found = [], {}
        for edge in (*self.loops, *filter(None, self.joints)):
            rows = found[id(edge)] = list(edge.rows)
            for pair in getattr(edge.constraint, "opposed", ()):
                rows += range(self.rows, self.rows + 3)
                self.rows += 3
                pairs.append(pair)
        self._lay_out_pairs(pairs)
        of_loops = [found[id(edge)] for edge in self.loops]
        self.loop_rows = np.array([row for rows in of_loops for row in rows], int)
        ends = np.cumsum([0, *map(len, of_loops)])
        sides = [[self.place[body] for body in edge.ends] for edge in self.loops]
        self.between = [  # rows of loops, among those of all, and places of the bodies of those that have two
            (slice(ends[k], ends[k + 1]), places)
            for k, places in enumerate(sides)
            if len(places) == 2 and min(places) >= 0
        ]
        of_joints = [[] if edge is None else found[id(edge)] for edge in self.joints]
        self.joint_rows = np.array([row for rows in of_joints for row in rows], int)
        self.joint_of = np.repeat(np.arange(count), [len(rows) for rows in of_joints])
        self.slots = np.array([slot for rows in of_joints for slot in range(len(rows))], int)

    def _lay_out_pairs(self, pairs):
        """Bodies, directions and places of the directions that are to be aligned, (2, pairs, ...)."""
        sides, index = list(zip(*pairs, strict=True)) or [(), ()], {id(b): i for i, b in enumerate(self.packed.bodies)}
        self.owners = np.array([[index.get(id(body), -1) for body, _ in side] for side in sides], int)
        self.directions, self.moving = np.zeros((*self.owners.shape, 3)), []
        for side, each in enumerate(sides):
            for k, (_, direction) in enumerate(each):
                if callable(direction):
                    self.moving.append((side, k, direction))
                else:
                    self.directions[side, k] = direction
        places = np.array([self.place[self.of(body)] for side in sides for body, _ in side], int)
        self.turning = np.flatnonzero(places >= 0)  # of both sides, one after the other
        rows = 3 * (self.turning % max(len(pairs), 1))[:, None] + np.array([0, 0, 1, 1, 2, 2])
        columns = 6 * places[self.turning, None] + np.array([4, 5, 3, 5, 3, 4])
        self.turning_at = rows.ravel(), columns.ravel()

    def residuals(self, q):
        """Weighed (rows,)."""
        u, v = self._directions(q)
        return self.weights * np.concatenate((self.metric.arrays(q)[0][: self.of_Phi], (u - v).ravel()))

    def holds(self, q):
        """Whether all joints of the tree hold."""
        return bool(np.abs(self.residuals(q)[self.joint_rows]).max(initial=0.0) <= INITIAL_TOL)

    def slopes(self, q):
        """Derivatives of the residuals by the twists of the bodies, (rows, 6 places), sparse."""
        from scipy.sparse import coo_array, csr_array, diags_array, vstack

        count, Phi_q = len(self.bodies), csr_array(self.metric.arrays(q)[1])[: self.of_Phi]
        at, rigid, firsts = self.metric.at[self.bodies], self.metric.rigid[self.bodies], 6 * np.arange(count)
        p = q[at[rigid, None] + np.arange(3, 7)]
        turns = 0.5 * transform_g(p).swapaxes(1, 2) @ rotation_matrix(p).swapaxes(1, 2)
        i, j = np.broadcast_arrays(
            (at[rigid, None] + np.arange(3, 7))[:, :, None], firsts[rigid, None, None] + np.arange(3, 6)
        )
        shifts = [(at[:, None] + np.arange(3)).ravel(), (firsts[:, None] + np.arange(3)).ravel()]
        places = [np.concatenate((a, b.ravel())) for a, b in zip(shifts, (i, j), strict=True)]
        values = np.concatenate((np.full(3 * count, self.reach), turns.ravel()))
        Phi_x = Phi_q @ coo_array((values, tuple(places)), (self.metric.n, 6 * count)).tocsr()
        w = np.concatenate(self._directions(q) * np.array((1.0, -1.0))[:, None, None])[self.turning]
        values = w[:, (2, 1, 2, 0, 1, 0)] * np.array((1.0, -1.0, -1.0, 1.0, 1.0, -1.0))  # omega x w
        aligned = coo_array((values.ravel(), self.turning_at), (self.rows - self.of_Phi, 6 * count))
        return (diags_array(self.weights) @ vstack((Phi_x, aligned))).tocsr()

    def _directions(self, q):
        """Both directions of the pairs, (2, pairs, 3), ground frame."""
        for side, k, direction in self.moving:
            self.directions[side, k] = direction(self.metric.t)
        return np.einsum("skij,skj->ski", self.metric.rotations(q)[self.owners], self.directions)
