"""Minimal coordinates: their choice by the joints, and rows that take variations of q to variations of them."""

from collections import Counter, deque
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..elements.bodies import named, transform_g
from ..elements.element import AngleGeometry
from ..errors import InvalidArgument, SingularConfiguration
from ..maths.tolerances import PIVOT_ROUNDING
from ..model.handles import handles_of
from .tolerances import BATCH, CLEAR, DENSE, IN_TURN, INDEPENDENT

# Functions of time to second order along the nominal motion: arrays of value, rate and half the second derivative.


def product(a, b, spec):
    """Einstein sum of two jets, (3, ...) each; spec is that of their values."""
    first, rest = spec.split(",")
    second, out = rest.split("->")

    def of(i, j):
        return np.einsum(f"{first},{second}->{out}", a[i], b[j])

    return np.stack((of(0, 0), of(0, 1) + of(1, 0), of(0, 2) + of(1, 1) + of(2, 0)))


def quotient(a, b):
    """A jet (3, ...) over a jet of a number (3,)."""
    c0 = a[0] / b[0]
    c1 = (a[1] - c0 * b[1]) / b[0]
    return np.stack((c0, c1, (a[2] - c1 * b[1] - c0 * b[2]) / b[0]))


def constant(value):
    """The jet of what doesn't change."""
    value = np.asarray(value, float)
    return np.stack((value, np.zeros_like(value), np.zeros_like(value)))


def turning(rate):
    """The jet (3, 3, 3) of R^T, R turning steadily at a rate (3,) from the identity."""
    x, y, z = rate
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.stack((np.eye(3), -cross, 0.5 * cross @ cross))


# Minimal coordinates of a tree of joints by its structure: those of the joints, rotations beyond ball joints.
#
# A joint whose own coordinates are as many as its freedoms gives these; one that holds a point and nothing else, the
# rotation of the body beyond it; a body that nothing leads to from the ground, its displacement and rotation.

BALL = 3  # rows
FREE = 6  # of two bodies without joint


def of_tree(motion, variations):
    """The `Variation`s (k,) of a tree of joints, those of joints first; None where the scene is no such tree."""
    packed = motion.packed
    if not motion.rigid.all():
        return None
    numbers = {body: i for i, body in enumerate(packed.bodies)}
    own = {id(row.item): len(row.angles) + len(row.displacements) for row in variations.handles.rows}
    neighbours, count = [[] for _ in range(len(numbers) + 1)], 0  # the ground is the last
    for member in packed.members:
        item = member.constraint
        if getattr(item, "normalises", False):
            continue
        rows = member.rows.stop - member.rows.start
        ball = rows == BALL and not own.get(id(item), 0)
        if not (ball or rows + own.get(id(item), 0) == FREE):
            return None
        a, b = (numbers.get(body, len(numbers)) for body in (item.a, item.b))
        neighbours[a].append((b, ball))
        neighbours[b].append((a, ball))
        count += 1
    turning, free = _beyond(neighbours)
    if count != len(numbers) - len(free):
        return None  # loops
    found = list(variations.joints)
    for i in sorted(free):
        found += variations.of_body(packed.bodies[i])
    found += variations.rotations([packed.bodies[i] for i in sorted(turning)])
    return found if len(found) == motion.freedom else None


def _beyond(neighbours):
    """Numbers of the bodies beyond ball joints, and of those that parts without ground begin with."""
    turning, free, seen = set(), set(), set()
    for root in (len(neighbours) - 1, *range(len(neighbours) - 1)):
        if root in seen:
            continue
        if root < len(neighbours) - 1:
            free.add(root)
        seen.add(root)
        waiting = deque([root])
        while waiting:
            for other, ball in neighbours[waiting.popleft()]:
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)
                    if ball:
                        turning.add(other)
    return turning, free


# Rows that take variations of q to variations of coordinates, with their first two derivatives along the motion.
#
#     dx = Z dq,    dxd = Z dqd + Zd dq,    dxdd = Z dqdd + 2 Zd dqd + Zdd dq
#
# Joint coordinates are functions of q. Displacements and rotations of a body are along axes that turn steadily with R:
# R^T dr and R^T 2 E(p) dp.


def named_coordinates(handles):
    """Of each item with joint coordinates, by its id: their names and geometries, angles first."""
    found, seen = {}, Counter()
    for row in handles.rows:
        seen[row.item.name] += 1
        title = row.item.name + (f" #{seen[row.item.name]}" if seen[row.item.name] > 1 else "")
        own = found[id(row.item)] = []
        for kind, geometries in (("angle", row.angles), ("displacement", row.displacements)):
            for i, geometry in enumerate(geometries):
                own.append((f"{title}.{kind}" + (f" {i + 1}" if len(geometries) > 1 else ""), geometry))
    return found


AXES = ".x", ".y", ".z"


def item_of(scene, given, things, what):
    """The thing that a handle or a name means, and an axis ".x" at the end of the name, or None."""
    if not isinstance(given, str):
        if not any(given is thing for thing in things):
            raise InvalidArgument(f"{given!r} is no {what} of this scene: give a handle or a name.")
        return given, None
    axis = given[-2:] if given[-2:] in AXES and given not in {thing.name for thing in things} else None
    return named(things, given[:-2] if axis else given, what), axis


class Variation(NamedTuple):
    """One coordinate."""

    name: str
    columns: np.ndarray  # (c,) of q
    jet: np.ndarray  # (3, c): Z, Zd and Zdd / 2
    length: bool  # whether it is one, m, or else an angle, rad


class Variations:
    """Rows at a `Motion`, in axes that turn at a rate (3,), rad/s."""

    def __init__(self, motion, rate):
        self.motion, self.handles, self.axes = motion, handles_of(motion.packed), turning(rate)

    @cached_property
    def _named(self):
        return named_coordinates(self.handles)

    @cached_property
    def joints(self):
        """Of all joint coordinates of the constraints."""
        own = {id(member.constraint) for member in self.motion.packed.members}
        return self._of(
            [pair for row in self.handles.rows if id(row.item) in own for pair in self._named[id(row.item)]]
        )

    def of_row(self, row):
        """Of the coordinates of one joint."""
        return self._of(self._named[id(row.item)])

    def _of(self, named):
        """Of pairs (name, geometry) of joint coordinates."""
        turns = [isinstance(geometry, AngleGeometry) for _, geometry in named]
        jets = [None] * len(named)
        for make, kind in ((self._angles, True), (self._displacements, False)):
            which = [i for i, turn in enumerate(turns) if turn is kind]
            for i, jet in zip(which, make([named[i][1] for i in which]) if which else (), strict=True):
                jets[i] = jet
        return [Variation(name, *jet, not turn) for (name, _), jet, turn in zip(named, jets, turns, strict=True)]

    @cached_property
    def bodies(self):
        """Of the displacement and the rotation of all bodies."""
        return [one for body in self.motion.packed.bodies for one in self.of_body(body)]

    def of_body(self, body):
        """Of the displacement of the centroid and, of a rigid body, of its rotation."""
        found = self.point(body, np.zeros(3), body.name)
        return found + self.rotations([body] if body.dimension == 7 else [])

    def rotations(self, bodies):
        """Of the rotations of some rigid bodies, all at once."""
        if not bodies:
            return []
        rows = 2.0 * product(self.axes, transform_e(self._all_parameters(bodies)), "ij,bjk->bik")
        columns = [self._place(body)[0] + np.arange(3, 7) for body in bodies]
        return [
            Variation(f"{body.name}.rotation {axis}", columns[k], rows[:, k, i], False)
            for k, body in enumerate(bodies)
            for i, axis in enumerate("xyz")
        ]

    def point(self, body, s, title):
        """Of the displacement of a point s of a body."""
        columns, rows = self._point(body, s)
        rows = product(self.axes, rows, "ij,jk->ik")
        return [Variation(f"{title}.{axis}", columns, rows[:, i], True) for i, axis in enumerate("xyz")]

    def _angles(self, geometries):
        """Columns and jets of angles (b) atan2(F, E), E = f.v, F = g.v, all in the ground frame."""
        own, other, f, g, h = zip(*geometries, strict=True)
        (v, v_p), (f, f_p), (g, g_p) = (self._directions(*each) for each in ((other, h), (own, f), (own, g)))
        E, F = product(f, v, "bi,bi->b"), product(g, v, "bi,bi->b")
        E_p = np.concatenate((product(v, f_p, "bi,bij->bj"), product(f, v_p, "bi,bij->bj")), axis=2)
        F_p = np.concatenate((product(v, g_p, "bi,bij->bj"), product(g, v_p, "bi,bij->bj")), axis=2)
        square = product(E, E, "b,b->b") + product(F, F, "b,b->b")
        jets = quotient(product(E, F_p, "b,bj->bj") - product(F, E_p, "b,bj->bj"), square[:, :, None])
        return self._with_columns(jets, (own, 3), (other, 3))

    def _displacements(self, geometries):
        """Columns and jets of displacements (b) e.(x_other - x_own), e a direction of the own body."""
        own, other, e, s_own, s_other = zip(*geometries, strict=True)
        e, e_p = self._directions(own, e)
        (x, x_p), (y, y_p) = (self._points(*each) for each in ((own, s_own), (other, s_other)))
        parts = (
            product(y - x, e_p, "bi,bij->bj"),
            -e,
            -product(e, x_p, "bi,bij->bj"),
            e,
            product(e, y_p, "bi,bij->bj"),
        )
        return self._with_columns(np.concatenate(parts, axis=2), (own, 3), (own, 0), (other, 0))

    def _with_columns(self, jets, *blocks):
        """Pairs of columns and jets, of jets (3, b, .) of the coordinates of some bodies (b) from the first one on."""
        found = []
        for i in range(jets.shape[1]):
            columns, used, place = [], [], 0
            for bodies, first in blocks:
                at, dimension = self._place(bodies[i])
                columns.append(np.arange(at + first, at + dimension))
                used.append(np.arange(place, place + max(dimension - first, 0)))
                place += 7 - first
            found.append((np.concatenate(columns), jets[:, i, np.concatenate(used)]))
        return found

    def _place(self, body):
        return self.handles.where(body)

    def _all_parameters(self, bodies):
        """Jets (3, b, 4) of p; of the ground and of point masses those of a body that doesn't turn."""
        jets = np.zeros((3, len(bodies), 4))
        jets[0, :, 0] = 1.0
        self._fill(jets, bodies, 7, 3)
        return jets

    def _fill(self, jets, bodies, least, first):
        """Coordinates of bodies that have so many at least, from the first one on, into jets (3, b, .)."""
        places = [self._place(body) for body in bodies]
        which = [i for i, (_, dimension) in enumerate(places) if dimension >= least]
        at = np.array([places[i][0] for i in which], int)[:, None] + first + np.arange(jets.shape[2])
        motion = self.motion
        for level, values in enumerate((motion.q[at], motion.qd[at], 0.5 * motion.qdd[at])):
            jets[level, which] = values

    def _direction(self, body, s):
        """Jets of A s and of its derivative with respect to p."""
        value, slope = (each[:, 0] for each in self._directions([body], [s]))
        return value, slope if self._place(body)[1] == 7 else np.zeros((3, 3, 0))

    def _directions(self, bodies, s):
        """The same of several: (3, b, 3) and (3, b, 3, 4)."""
        p = self._all_parameters(bodies)
        slope = arm_by_parameters(p, np.array(s, float))
        return 0.5 * product(slope, p, "bij,bj->bi"), slope

    def _points(self, bodies, s):
        """Jets of r + A s of several, (3, b, 3), and of its derivative with respect to p; a point mass has no s."""
        r = np.zeros((3, len(bodies), 3))
        self._fill(r, bodies, 3, 0)
        s = [(0.0, 0.0, 0.0) if self._place(body)[1] == 3 else each for body, each in zip(bodies, s, strict=True)]
        value, slope = self._directions(bodies, s)
        return r + value, slope

    def _point(self, body, s):
        """Columns of a body, and the jet of the derivative of a point of it."""
        at, dimension = self._place(body)
        columns = np.arange(at, at + dimension)
        r = constant(np.eye(3) if dimension else np.zeros((3, 0)))
        return columns, np.concatenate((r, self._direction(body, s)[1]), axis=2)


def arm_by_parameters(p, s):
    """The derivative of A(p) s with respect to p, linear in p: (..., 3, 4) for p (..., 4) and s (3,) or (..., 3)."""
    e0, e = p[..., 0, None], p[..., 1:]
    along = (e * s).sum(axis=-1)[..., None, None]
    cross = np.cross(s[..., None, :], -np.eye(3))
    by_e = along * np.eye(3) + e[..., :, None] * s[..., None, :] - s[..., :, None] * e[..., None, :]
    by_e = by_e - e0[..., None] * cross
    return 2.0 * np.concatenate(((e0 * s + np.cross(e, s))[..., None], by_e), axis=-1)


def transform_e(p):
    """E(p) = [-e, e~ + e0 I], shape (..., 3, 4) for p of shape (..., 4)."""
    return transform_g(p * np.array([1.0, -1.0, -1.0, -1.0])) * np.array([-1.0, 1.0, 1.0, 1.0])


def stacked(variations, n):
    """Z, Zd and Zdd of some coordinates, sparse (c, n) each."""
    from scipy.sparse import csr_array

    rows = np.repeat(np.arange(len(variations)), [one.columns.size for one in variations])
    columns = np.concatenate([one.columns for one in variations] or [np.zeros(0, int)])
    jets = np.concatenate([one.jet for one in variations] or [np.zeros((3, 0))], axis=1)
    factors = (1.0, 1.0, 2.0)
    return [csr_array((c * jet, (rows, columns)), (len(variations), n)) for c, jet in zip(factors, jets, strict=True)]


# Choice of minimal coordinates: joint coordinates in the order of the joints, then displacements and rotations.
#
# The component of a candidate that is independent of those accepted before is a diagonal entry of Z P Z^T, P the
# inverse mass of the motions that are still free. Candidates are examined in batches: those taken in earlier batches
# are rows of the sparse saddle-point matrix, those of the same batch pivots of Cholesky's factor of a small Z P Z^T. So
# the cost is that of a solution a candidate, and of a factorisation a batch.


def chosen(motion, variations):
    """As many independent coordinates as the motion has degrees of freedom, `Variation` each."""
    k, size = motion.freedom, motion.packed.size or 1.0
    if len(variations.joints) == k and _regular(motion, variations.joints, size):
        return list(variations.joints)  # as in trees
    if many := motion.q.size > DENSE:
        found = of_tree(motion, variations)
        if found is not None and _regular(motion, found, size):
            return found
    found = []
    for kind in ("joints", "bodies"):
        if len(found) == k:
            break
        more = getattr(variations, kind)
        if many and kind == "bodies":
            more = sorted(more, key=lambda one: one.length)  # rotations first: errors don't add up along chains
        every = [*found, *more]
        order = _independent(motion, every, len(found), k, size)
        found = [every[i] for i in order]
    if len(found) < k:
        raise SingularConfiguration(
            f"linearise: {k} degrees of freedom, of which {len(found)} show in displacements and rotations of bodies: "
            "the constraints are close to a singular configuration."
        )
    return found


def _regular(motion, every, size):
    """Whether as many coordinates as there are degrees of freedom are clearly independent, in O(N)."""
    from scipy.sparse import diags_array, vstack
    from scipy.sparse.linalg import splu

    A = vstack([motion.H, _rows(motion, every, size)]) @ diags_array(1.0 / motion.root)
    rows = np.sqrt(A.multiply(A).sum(axis=1))
    if not rows.all():
        return False
    try:
        pivots = np.abs(splu((diags_array(1.0 / rows) @ A).tocsc()).U.diagonal())
    except RuntimeError:
        return False
    return bool(pivots.min() > CLEAR * pivots.max())


def _rows(motion, every, size):
    """Z (c, n) of some coordinates, lengths as shares of the size."""
    from scipy.sparse import diags_array

    lengths = np.where([one.length for one in every], size, 1.0)
    return (diags_array(1.0 / lengths) @ stacked(every, motion.q.size)[0]).tocsr()


def _independent(motion, every, given, k, size):
    """Indices of k coordinates at most; the first `given` are taken already."""
    Z = _rows(motion, every, size)
    taken = list(range(given))
    none, free = motion.holding(Z[:0]), motion.holding(Z[:given])
    own = _left(none, Z, np.arange(len(every)))
    weights = Z.multiply(Z) @ (1.0 / motion.root**2)
    own[own <= PIVOT_ROUNDING * weights] = 0.0  # the constraints hold it
    remaining = own if not given else _left(free, Z, np.arange(len(every)))
    least = INDEPENDENT * np.maximum(own, 1e-3 * own.max(initial=0.0))
    while len(taken) < k:
        remaining = np.where(remaining > least, remaining, 0.0)
        remaining[taken] = 0.0
        most = remaining.max(initial=0.0)
        if most == 0.0:
            break
        _take_in_turn(motion, Z, taken, np.flatnonzero(remaining), IN_TURN * IN_TURN * most, least, k)
        if len(taken) < k:
            remaining = _left(motion.holding(Z[taken]), Z, np.arange(len(every)))
    return sorted(taken)


def _left(free, Z, which):
    """Diagonal entries of Z P Z^T of some rows."""
    found = np.zeros(len(which))
    for first in range(0, len(which), BATCH):
        rows = Z[which[first : first + BATCH]]
        found[first : first + BATCH] = rows.multiply(free(rows.T.toarray()).T).sum(axis=1)
    return np.maximum(found, 0.0)


def _take_in_turn(motion, Z, taken, which, share, least, k):
    """Accept candidates in order, each whose independent component exceeds a fraction of the best one's."""
    for first in range(0, len(which), BATCH):
        batch = which[first : first + BATCH]
        rows = Z[batch]
        left = rows @ motion.holding(Z[taken])(rows.T.toarray())
        for i, one in enumerate(batch):
            if len(taken) == k:
                return
            if left[i, i] > max(share, least[one]):
                taken.append(int(one))
                column = left[:, i] / np.sqrt(left[i, i])
                left -= np.outer(column, column)
