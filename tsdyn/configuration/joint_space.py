"""Assembly in the coordinates of the joints of a spanning tree: closed loops from far away.

The joints of the tree hold by themselves; their free displacements are found for which the loops hold as well. A
displacement is a twist (v, omega), which all bodies beyond the joint have about one point.

    xi_i = Z_i theta_i - A_i^+ Phi_i      joint i: A_i Z_i = 0; the last term closes the joint itself     (1)
    J_i  = sum_{k beyond i} A_k Z_i       loops: A_k the derivative by the twist of body k                (2)
    x_i  = e^xi_1 ... e^xi_i x_i          from the root to body i                                         (3)

theta by Levenberg and Marquardt. Time and memory are proportional to the bodies, for each row of a loop.
"""

from typing import NamedTuple

import numpy as np

from ..elements.bodies import euler_product, rotation_matrix, transform_g
from ..elements.element import AngleGeometry
from ..maths.tolerances import NEGLIGIBLE, SUM_ROUNDING, TINY
from ..model import handles as joint_motion
from ..model.handles import handles_of
from .continuation import close
from .motor_starts import are_aligned, opposed
from .tolerances import (
    DAMPING,
    DEPENDENCE,
    HINT,
    HINTED,
    INITIAL_TOL,
    LEAST_DAMPING,
    MOST_DAMPING,
    MOST_ENTRIES,
    MOST_STEPS,
    MOST_TURN,
    SMALL_ANGLE,
    SPREADS,
    STALLED,
)


class Aim(NamedTuple):
    """A value of a coordinate of a joint of the tree."""

    place: int  # of the body beyond the joint
    geometry: object
    sense: float  # -1 where that is the own body of the geometry
    value: float  # rad or m


class Closed(NamedTuple):
    """The best configuration that was found."""

    q: np.ndarray  # (n,)
    Phi: np.ndarray  # without normalisations
    met: bool
    steps: int
    starts: int


class Loops:
    """Closes the loops of a scene; coordinates of joints may be given, and limits of them as hints.

    Parameters
    ----------
    metric : Metric
    q : ndarray (n,)
        The sketch.
    values : dict
        Of joints, each with values of its coordinates: angles, then displacements.
    limits : dict
        Of joints, each with (lower, upper) of its only coordinate.
    cut : collection of constraints
        That close the loops.
    """

    def __init__(self, metric, q, values=None, limits=None, cut=()):
        values = values or {}
        self.metric, self.sketch, self.tree = metric, q, Tree(metric, q, cut, list(values))
        self.cut, self.handles = [edge.constraint for edge in self.tree.loops], handles_of(metric.packed)
        self.rows = {id(row.item): row for row in self.handles.rows}
        self.aims = [aim for joint, given in values.items() for aim in self._aims(joint, given)]
        self.limits, self.half = [], np.zeros(0)  # middles, and half widths
        for joint, (lower, upper) in (limits or {}).items():
            found = [] if joint in values else self._aims(joint, (0.5 * (lower + upper),))
            self.limits += found
            self.half = np.append(self.half, [0.5 * (upper - lower)] * len(found))

    def _aims(self, joint, values):
        """The `Aim`s of a joint; none where it is no joint of the tree."""
        tree = self.tree
        place = next((i for i, edge in enumerate(tree.joints) if edge and edge.constraint is joint), None)
        row = self.rows.get(id(joint))
        if place is None or row is None:
            return []
        geometries = (*row.angles, *row.displacements)
        child = tree.bodies[place]
        return [
            Aim(place, geometry, 1.0 if tree.of(geometry.other) == child else -1.0, float(value))
            for geometry, value in zip(geometries, values, strict=False)
        ]

    # Coordinates of joints.

    def away(self, q, aim):
        """How far a coordinate is from its value, rad or m; angles within half a turn."""
        return coordinate_from(self.handles, q, aim.geometry, aim.value)

    def _slope(self, q, aim):
        """The derivative of a coordinate by the twist of the body beyond its joint, (6,)."""
        # angle = atan2(g.h, f.h), displacement = e.(x_other - x_own): as the other body moves, or by its sense the own
        g, (own, other) = aim.geometry, self.handles.motions(aim.geometry, (q,))
        if isinstance(g, AngleGeometry):
            u, w, v = (np.array(motion.arm(s, 0)) for motion, s in ((own, g.f), (own, g.g), (other, g.h)))
            E, F = u @ v, w @ v
            turn, shift = (E * np.cross(v, w) - F * np.cross(v, u)) / (E * E + F * F), np.zeros(3)
        else:
            shift = np.array(own.arm(g.e, 0))
            child = self.metric.r[self.tree.bodies[aim.place]]
            turn, shift = np.cross(np.array(other.point(g.s_other, 0)) - q[child], shift), self.tree.reach * shift
        return aim.sense * np.concatenate((shift, turn))

    def beyond(self, q):
        """How far coordinates are beyond their limits, rad or m, with sign."""
        away = np.array([self.away(q, aim) for aim in self.limits])
        return np.sign(away) * np.maximum(np.abs(away) - self.half, 0.0)

    # Steps.

    def _state(self, q, limited):
        """Residuals of the constraints, those of limits, and the sum of their squares."""
        r, beyond = self.tree.residuals(q), HINT * self.beyond(q) if limited else np.zeros(0)
        used = np.concatenate((r[self.tree.loop_rows], r[self.tree.joint_rows], beyond))
        return r, beyond, float(used @ used) if np.isfinite(used).all() else np.inf

    def _twists(self, q, r, aims):
        """Of each joint: the free twists Z (places, 6, 6), which of them there are, and that which closes it."""
        tree, A = self.tree, self.tree.slopes(q)
        count, own = len(tree.joints), A[tree.joint_rows].tocoo()
        i, j = own.coords
        mine = j // 6 == tree.joint_of[i]
        i, j, values = i[mine], j[mine], own.data[mine]
        extra = [[] for _ in range(count)]
        for aim in aims:
            extra[aim.place].append((self._slope(q, aim), self.away(q, aim)))
        first = tree.slots.max(initial=-1) + 1
        blocks = np.zeros((count, max(6, first + max(map(len, extra), default=0)), 6))
        residuals = np.zeros(blocks.shape[:2])
        blocks[tree.joint_of[i], tree.slots[i], j % 6] = values
        residuals[tree.joint_of, tree.slots] = r[tree.joint_rows]
        for place, rows in enumerate(extra):
            for k, (slope, away) in enumerate(rows):
                length = np.linalg.norm(slope) or 1.0
                blocks[place, first + k], residuals[place, first + k] = slope / length, away / length
        U, s, V = np.linalg.svd(blocks)
        held = s > DEPENDENCE
        part = np.einsum("eri,er->ei", U[:, :, :6], residuals) / np.where(held, s, 1.0) * held
        return A, V, ~held, -np.einsum("ei,eij->ej", part, V)

    def _about_centre(self, q, twists):
        """Twists (places, ..., 6) about the centroid of the scene, from those about the bodies' own."""
        d = (q[self.metric.r[self.tree.bodies]] - self._centre(q)) / self.tree.reach
        d = d.reshape((-1,) + (1,) * (twists.ndim - 2) + (3,))
        moved = twists.copy()
        moved[..., :3] += np.cross(d, twists[..., 3:])
        return moved

    def _centre(self, q):
        return q[self.metric.r].mean(axis=0)

    def _linearised(self, q, r, aims, beyond=()):
        """Twists of Eq. (1) about the centre, J of Eq. (2) by their thetas, and the residuals that closing leaves.

        Limits that are passed are rows of J as well.
        """
        tree = self.tree
        A, Z, free, closing = self._twists(q, r, aims)
        place, passed = free.nonzero()[0], np.flatnonzero(beyond)
        hints = np.zeros((passed.size, place.size))
        for row, aim in enumerate(self.limits[k] for k in passed):
            hints[row, place == aim.place] = HINT * Z[aim.place, free[aim.place]] @ self._slope(q, aim)
        Z, closing = (self._about_centre(q, each) for each in (Z, closing))
        loops = A[tree.loop_rows].toarray().reshape(-1, len(tree.joints), 6)
        d = (q[self.metric.r[tree.bodies]] - self._centre(q)) / tree.reach
        loops[..., 3:] += np.cross(d, loops[..., :3])
        for rows, (one, other) in tree.between:  # seen from one of two bodies: what moves both changes nothing
            loops[rows, one] = -loops[rows, other]
        total = np.concatenate((np.zeros_like(loops[:, :1]), np.cumsum(loops, axis=1)), axis=1)
        carried = total[:, tree.ends] - total[:, :-1]
        J = np.concatenate((np.einsum("rki,ki->rk", carried[:, place], Z[free]), hints))
        left = r[tree.loop_rows] + np.einsum("rei,ei->r", carried, closing)
        return Z, free, closing, J, np.concatenate((left, np.asarray(beyond)[passed]))

    def _step(self, linearised, damping):
        """The twists (places, 6) of a step.

        theta = -(J^T J + damping I)^-1 J^T left = -J^T (J J^T + damping I)^-1 left, by the smaller matrix.
        """
        Z, free, closing, J, left = linearised
        if J.shape[0] < J.shape[1]:
            theta = -J.T @ np.linalg.solve(J @ J.T + damping * np.eye(J.shape[0]), left)
        else:
            theta = -np.linalg.solve(J.T @ J + damping * np.eye(J.shape[1]), J.T @ left)
        return self._of_joints(Z, free, theta) + closing

    @staticmethod
    def _of_joints(Z, free, theta):
        whole = np.zeros(free.shape)
        whole[free] = theta
        return np.einsum("ej,eji->ei", whole, Z)

    def _moved(self, q, twists):
        """The configuration after twists of the joints about the centre, Eq. (3)."""
        tree, metric, centre = self.tree, self.metric, self._centre(q)
        size = np.abs(twists[:, 3:]).max(initial=0.0)
        twists = twists * min(1.0, MOST_TURN / max(size, TINY))
        o, shift = _exponential(twists * np.repeat((tree.reach, 1.0), 3))
        for level in tree.levels[1:]:
            above = tree.parents[level]
            shift[level] = shift[above] + _turned(o[above], shift[level])
            o[level] = euler_product(o[above], o[level])
        q, bodies = q.copy(), tree.bodies
        q[metric.r[bodies]] = centre + shift + _turned(o, q[metric.r[bodies]] - centre)
        rigid = metric.rigid[bodies]
        at = metric.at[bodies][rigid, None] + np.arange(3, 7)
        p = euler_product(o[rigid], q[at])
        q[at] = p / np.linalg.norm(p, axis=1, keepdims=True)
        return q

    def _descend(self, q, limited):
        """Levenberg and Marquardt from q. Return the configuration where it ends, and the number of steps."""
        (r, beyond, size), damping, steps, slow, linearised = self._state(q, limited), DAMPING, 0, 0, None
        while steps < MOST_STEPS and damping < MOST_DAMPING and slow < STALLED[0]:
            aimed = self._aimed(q)
            if size <= SUM_ROUNDING**2 and aimed:
                break
            steps += 1
            linearised = linearised or self._linearised(q, r, self.aims, beyond)
            trial = self._moved(q, self._step(linearised, damping))
            state = self._state(trial, limited)
            if aimed and not state[-1] < size:
                damping *= 8.0
                continue
            slow = slow + 1 if state[-1] > STALLED[1] * size else 0
            q, (r, beyond, size), damping, linearised = trial, state, max(0.1 * damping, LEAST_DAMPING), None
        return q, steps

    def close(self, tol, excess=lambda q: 0.0):
        """Return the `Closed` of the first start from which the loops close.

        Of a few, that with the least sum of excess(q) and of what coordinates are beyond their limits. Loops of which
        Eq. (2) needs too much memory are left as they are.
        """
        rng, best, total, after = np.random.default_rng(0), None, 0, 0
        if self.tree.loop_rows.size * 6 * len(self.tree.joints) > MOST_ENTRIES:
            return Closed(self.sketch, self.metric.linear(self.sketch)[0], False, 0, 1)
        spreads = (None,) * bool(self.limits) + SPREADS
        for start in range(1 + len(spreads)):
            q = self._start(rng, spreads[start - 1]) if start else self.sketch
            for limited in (True, False) if self.limits else (False,):
                q, steps = self._descend(q, limited)
                total += steps
            q, Phi, more = close(self.metric, q)
            total += more
            met = np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max())
            met = bool(met and are_aligned(self.metric.packed, q, self.metric.t) and self._aimed(q))
            rank = not met, float(excess(q) + np.abs(self.beyond(q)).sum() if met else np.linalg.norm(Phi))
            if best is None or rank < best[0]:
                best = rank, q, Phi
            after += not best[0][0]
            if best[0] == (False, 0.0) or after > HINTED:
                break
        return Closed(*best[1:], not best[0][0], total, start + 1)

    def _aimed(self, q):
        return all(abs(self.away(q, aim)) <= NEGLIGIBLE for aim in self.aims)

    def set_out(self):
        """Return the sketch with the joints at their values, or as near as they come; loops may be open."""
        q = self.sketch
        for _ in range(MOST_STEPS):
            if self._aimed(q):
                break
            *_, closing = self._twists(q, self.tree.residuals(q), self.aims)
            q = self._moved(q, self._about_centre(q, closing))
        return q

    def _start(self, rng, spread):
        """The sketch with joints displaced at random, limited ones within their limits; None: these at the middle."""
        shares = rng.uniform(-1.0, 1.0, len(self.limits)) * (spread is not None)
        moves = (shares * self.half).tolist()
        within = [aim._replace(value=aim.value + move) for aim, move in zip(self.limits, moves, strict=True)]
        q = self.sketch
        Z, free, closing, J, _ = self._linearised(q, self.tree.residuals(q), [*self.aims, *within])
        theta = rng.uniform(-1.0, 1.0, J.shape[1]) * (spread or 0.0)
        theta[np.abs(J).max(axis=0, initial=0.0) < DEPENDENCE] = 0.0  # in no loop
        theta[np.repeat([edge is None for edge in self.tree.joints], free.sum(axis=1))] = 0.0
        return self._moved(q, self._of_joints(Z, free, theta) + closing)


def coordinate_from(handles, q, geometry, value):
    """How far the coordinate of a geometry is from a value, rad or m; angles within half a turn."""
    turns = isinstance(geometry, AngleGeometry)
    evaluate = joint_motion.angle if turns else joint_motion.displacement
    away = evaluate(geometry, *handles.motions(geometry, (q,)), 0) - value
    return float(joint_motion.counted(away, 0.0) if turns else away)


def _exponential(twists):
    """The motions of twists (k, 6), m and rad: Euler parameters (k, 4) and displacements (k, 3) of the centre.

    V v,  V = I + (1 - cos a) / a^2 w~ + (a - sin a) / a^3 w~ w~,  a = |w|
    """
    v, w = twists[:, :3], twists[:, 3:]
    a = np.linalg.norm(w, axis=1)[:, None]
    small = a < SMALL_ANGLE
    safe = np.where(small, 1.0, a)
    one = np.where(small, 0.5 - a * a / 24.0, (1.0 - np.cos(safe)) / safe**2)
    two = np.where(small, 1.0 / 6.0 - a * a / 120.0, (safe - np.sin(safe)) / safe**3)
    across = np.cross(w, v)
    o = np.concatenate((np.cos(a / 2.0), np.sinc(a / (2.0 * np.pi)) / 2.0 * w), axis=1)
    return o, v + one * across + two * np.cross(w, across)


def _turned(o, x):
    """A(o) x, (k, 3)."""
    return np.einsum("kij,kj->ki", rotation_matrix(o), x)


# A spanning tree of the bodies of a scene, and the constraints that close loops beside it.
#
# Residuals are Phi and, for each pair of directions that a constraint aligns, u - v: Phi also admits u = -v. They are
# differentiated by twists (v, omega) of the bodies about their centroids, v in units of the scene's size, ground frame.


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
        self.weights = 1.0 / np.where(lengths > DEPENDENCE * self.reach, lengths, self.reach)

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
