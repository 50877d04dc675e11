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

from ..elements.bodies import rotation_matrix
from ..elements.element import AngleGeometry
from ..maths.tolerances import TINY
from ..model import handles as joint_motion
from ..model.handles import handles_of
from .continuation import close
from .motor_starts import are_aligned
from .spanning_tree import Tree
from .tolerances import (
    AIMED,
    CLOSED_LOOPS,
    DAMPING,
    HINT,
    HINTED,
    LEAST_DAMPING,
    MOST_DAMPING,
    MOST_ENTRIES,
    MOST_STEPS,
    MOST_TURN,
    SMALL_ANGLE,
    SPREADS,
    STALLED,
    TREE_RANK,
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
        held = s > TREE_RANK
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
            o[level] = _product(o[above], o[level])
        q, bodies = q.copy(), tree.bodies
        q[metric.r[bodies]] = centre + shift + _turned(o, q[metric.r[bodies]] - centre)
        rigid = metric.rigid[bodies]
        at = metric.at[bodies][rigid, None] + np.arange(3, 7)
        p = _product(o[rigid], q[at])
        q[at] = p / np.linalg.norm(p, axis=1, keepdims=True)
        return q

    def _descend(self, q, limited):
        """Levenberg and Marquardt from q. Return the configuration where it ends, and the number of steps."""
        (r, beyond, size), damping, steps, slow, linearised = self._state(q, limited), DAMPING, 0, 0, None
        while steps < MOST_STEPS and damping < MOST_DAMPING and slow < STALLED[0]:
            aimed = self._aimed(q)
            if size <= CLOSED_LOOPS**2 and aimed:
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
        return all(abs(self.away(q, aim)) <= AIMED for aim in self.aims)

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
        theta[np.abs(J).max(axis=0, initial=0.0) < TREE_RANK] = 0.0  # in no loop
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


def _product(o, p):
    """The Euler parameters (k, 4) of A(o) A(p)."""
    e0 = o[:, :1] * p[:, :1] - (o[:, 1:] * p[:, 1:]).sum(axis=1, keepdims=True)
    return np.concatenate((e0, o[:, :1] * p[:, 1:] + p[:, :1] * o[:, 1:] + np.cross(o[:, 1:], p[:, 1:])), axis=1)
