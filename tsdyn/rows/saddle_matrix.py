"""The saddle-point matrix of implicit methods: unknowns, order of elimination, factors and solves."""

from itertools import product
from typing import NamedTuple

import numpy as np

from ..elements.loops.coordinate_rows import INTS as CONSTRAINT_INTS
from ..elements.loops.forces import FORCE_INTS, SPAN, kept_size
from ..elements.loops.template import AT, DIMENSION
from ..jit.kernels import Record, complex_vector, data_of, kernel, records, stack
from ..jit.simd import let
from ..maths.tolerances import SUM_ROUNDING
from ..model.handles import first_rows
from ..model.packed import members_of
from .elimination import factor_lu, solve_lu, with_kernels
from .inertia_rows import clear_rows, lean_bodies, put_rows_back
from .schur_complement import more
from .symbolic import Pattern, analyse, fill_reducing_order, lay_out_in_order

# Order of elimination of the saddle-point matrix of bodies and constraint rows.
#
#     [ A    H^T ]      A: blocks of bodies and of pairs of bodies that forces or constraints couple
#     [ H    0   ]
#
# The diagonal blocks of the rows are zero, so rows follow bodies. When bodies E and rows R have been eliminated, the
# pivots of R are -H_RE A_E^-1 H_RE^T: regular if the rows R are independent with all other bodies held fast. Rows
# depend on relative motion alone. So a connected set of bodies and rows keeps the independence that it has in the whole
# system as long as at most one body outside of the set, or the ground, is joined to it: its anchor. Bodies are ordered
# for least fill; rows between two bodies are eliminated as soon as the set that they make has one anchor at most. In a
# tree these are the rows of a body's joint to its parent, right behind the body. Rows that close a loop wait for the
# loop. Axis rows (inertia_rows.py) follow the last rows at their body, which hold the axis.

GROUND = -1


def order_saddle(bodies, pairs, joined, lean=()):
    """Return the order of elimination of bodies and rows.

    Parameters
    ----------
    bodies : list of int
        Degrees of freedom of each body.
    pairs : list of tuple of int
        The two bodies, or more, or GROUND, of each set of rows.
    joined : list of (int, int)
        Pairs of bodies that forces couple.
    lean : list of int
        The body of each set of axis rows.

    Returns
    -------
    list of int
        Nodes: a body by its number, set i of rows as len(bodies) + i; then the sets of axis rows.
    """
    cliques = {tuple(sorted(set(pair) - {GROUND})) for pair in (*pairs, *joined)}
    cliques = {clique for clique in cliques if len(clique) > 1}
    sets = _Sets(pairs)
    ranks = fill_reducing_order(bodies, [set(pair) for pair in sorted(cliques)])
    sets.rank = {body: at for at, body in enumerate(ranks)} | {GROUND: -1}
    order = []
    for body in ranks:
        order.append(body)
        order += [len(bodies) + i for i in sets.eliminate(body)]
    return _with_axes(order, len(bodies), pairs, lean) if lean else order


def _with_axes(order, nb, pairs, lean):
    """The order with axis rows behind the last rows at their body."""
    last, behind = {}, {}
    for node in order:
        for body in (node,) if node < nb else pairs[node - nb]:
            last[body] = node
    for i, body in enumerate(lean):
        behind.setdefault(last[body], []).append(nb + len(pairs) + i)
    return [i for node in order for i in (node, *behind.get(node, ()))]


class _Sets:
    """Connected sets of eliminated bodies and rows, each with its anchors and the rows that wait."""

    def __init__(self, pairs):
        self.pairs, self.rank = pairs, {}
        self.at_body = {}
        for i, pair in enumerate(pairs):
            for body in pair:
                if body != GROUND:
                    self.at_body.setdefault(body, []).append(i)
        self.done = set()
        self.home = {}  # of an eliminated body, its set; sets that have been merged point to what they are part of
        self.into, self.anchors, self.waiting, self.at_anchor = [], [], [], {}

    def eliminate(self, body):
        """The rows that can follow a body, in order."""
        name = self._new(self.at_body.get(body, ()))
        self.home[body] = name
        # Sets whose anchor was this body
        for other in self.at_anchor.pop(body, ()):
            self.anchors[self._find(other)].discard(body)
            name = self._merge(name, self._find(other))
        found = []
        # Rows become ready one after the other
        while (i := self._next(self._find(name))) is not None:
            found.append(i)
            name = self._join(i)
        return found

    def _new(self, rows):
        self.into.append(len(self.into))
        self.anchors.append(set())
        self.waiting.append(set(rows) - self.done)
        return len(self.into) - 1

    def _find(self, name):
        while self.into[name] != name:
            self.into[name] = name = self.into[self.into[name]]
        return name

    def _ends(self, i):
        """The sets that rows i connect, and the anchors of their union."""
        sets = {self._find(self.home[body]) for body in self.pairs[i] if body in self.home}
        anchors = {body for body in self.pairs[i] if body not in self.home}
        return sets, anchors.union(*(self.anchors[name] for name in sets))

    def _next(self, name):
        """The waiting rows of a set that can be eliminated: those to the ground first, then to the next body."""
        ready = [i for i in self.waiting[name] if len(self._ends(i)[1]) < 2]
        return min(ready, key=lambda i: (max(self._place(body) for body in self.pairs[i]), i), default=None)

    def _place(self, body):
        return -1 if body in self.home else self.rank[body]

    def _join(self, i):
        """Eliminate rows i, and merge the sets that they connect."""
        sets, anchors = self._ends(i)
        name, *others = sets
        for other in others:
            name = self._merge(name, other)
        self.done.add(i)
        self.waiting[name].discard(i)
        self.anchors[name] = anchors
        for body in anchors - {GROUND}:
            self.at_anchor.setdefault(body, set()).add(name)
        return name

    def _merge(self, one, two):
        if one == two:
            return one
        if len(self.waiting[one]) < len(self.waiting[two]):
            one, two = two, one
        self.into[two] = one
        self.anchors[one] |= self.anchors[two]
        self.waiting[one] |= self.waiting[two]
        self.anchors[two], self.waiting[two] = set(), set()
        return one


# The saddle-point matrix of implicit methods: unknowns, blocks, and where every number goes in its factors.
#
#     [ M - g C_b - g^2 K_b    H^T ]      (r'', omega'') of the bodies
#     [ H                      0   ]      multipliers of the rows
#
# K_b and C_b have a block for each body and two for each pair of bodies that a force or a constraint couples. A body
# without inertia about an axis has an axis row besides.

UPPER, LOWER, OWN = range(3)  # where a block stands: above the diagonal, below it, on it
BLOCK = 36  # floats of one


class Block(Record):
    """A block of K and C: derivatives of the load on one body by the motion of another, or by its own."""

    row: int  # the two bodies
    column: int
    target: int  # where it begins in the factors, and the length of a row there
    stride: int
    place: int


class SaddleInstance(Record):
    """A force or a constraint, its two bodies and the blocks that it adds to; it begins as a `ForceExtent`."""

    count: int  # one
    stride: int  # reals
    columns: int  # of both bodies
    loop: int  # address of forces.jacobian, or of constraint_hessians.geometric_stiffness
    rows_loop: int  # of a constraint: address of coordinate_rows.jacobian
    reals: int  # where they begin
    at_a: int  # where the coordinates of its bodies begin, and how many they are
    at_b: int
    size_a: int
    size_b: int
    kept: int  # of a force: where its derivatives begin among those kept
    row: int  # of a constraint: its first row in order of the graph, and how many there are
    rows: int
    aa: int  # blocks, -1 where a body is the ground
    ab: int
    ba: int
    bb: int


class LeanAxis(Record):
    """An axis c e without inertia: what it adds to the block of its body, and its axis row (inertia_rows.py)."""

    target: int  # where the block begins in the factors, and the length of a row there
    stride: int
    first: int  # where the row begins, and its stride
    step: int
    own: int  # where its diagonal entry is
    x: float  # c e, body frame
    y: float
    z: float


class SaddleGraph(NamedTuple):
    """nb bodies, m rows of the constraint graph."""

    pattern: Pattern
    blocks: np.ndarray  # Block (blocks,): block b of body b first, then those of pairs
    forces: np.ndarray  # Instance (forces,)
    constraints: np.ndarray  # Instance (constraints that are no normalisations,)
    body_at: np.ndarray  # int64 (nb,): where a body's unknowns begin
    row_at: np.ndarray  # int64 (m,): where a row's multiplier is; -1 for what is no row of Phi
    sides: np.ndarray  # int64 (pairs, 2, 2): of a side, where H begins in the factors and its stride; -1: nowhere
    diagonal: np.ndarray  # int64 (m,): where a row's diagonal entry is
    axes: np.ndarray  # LeanAxis (axes,)


def no_saddle():
    """The `SaddleGraph` of nothing, for its type."""
    none, blocks, instances = np.zeros(0, np.int64), records(Block), records(SaddleInstance)
    sides, axes = np.zeros((0, 0, 0), np.int64), records(LeanAxis)
    return SaddleGraph(analyse([], [])[1], blocks, instances, instances, none, none, sides, none, axes)


def saddle_of(packed, graph, system):
    """The `SaddleGraph` of a packed scene, its constraint graph, and its system with the loops of implicit methods."""
    known = packed.derived
    if known.saddle is None or known.saddle[0] is not graph or known.saddle[1] is not system:
        known.saddle = graph, system, _SaddleBuilder(packed, graph, system).saddle()
    return known.saddle[2]


class _SaddleBuilder:
    """What the steps hand on to each other."""

    def __init__(self, packed, graph, system):
        self.packed, self.graph, self.system = packed, graph, system
        self.nb = len(graph.bodies)
        self.degrees = np.where(graph.bodies[:, 1] == 7, 6, 3).tolist()
        self.body_of = {int(at): body for body, at in enumerate(system.bodies[:, 0])}
        self.row_of = {int(row): e for e, row in enumerate(graph.row) if row >= 0}
        self.row_of |= {-1 - i: int(e) for i, e in enumerate(graph.inertias)}
        self._find_nodes()
        self.lean = lean_bodies(packed)
        forces, constraints = self._forces(), self._constraints()
        joined = {tuple(sorted(pair)) for pair, _ in forces if GROUND not in pair and pair[0] != pair[1]}
        order = order_saddle(self.degrees, self.pairs, sorted(joined), list(self.lean))
        sizes = self.degrees + [len(rows) for rows in self.rows] + [len(one.axes) for one in self.lean.values()]
        cliques = [{*pair, self.nb + i} - {GROUND} for i, pair in enumerate(self.pairs)] + [set(p) for p in joined]
        cliques += [{body, self.nb + len(self.pairs) + i} for i, body in enumerate(self.lean)]
        self.starts, self.pattern, self.where = lay_out_in_order(sizes, cliques, order)
        self.blocks, self.block_of = [], {}
        for body in range(self.nb):
            self._block(body, body)
        self.forces = [self._instance(pair, values) for pair, values in forces]
        self.constraints = [self._instance(pair, values) for pair, values in constraints]

    def _find_nodes(self):
        """Rows of the same two bodies, or more, are one node: its bodies, its rows, and of each row its node."""
        nodes, self.pairs, self.rows, self.node = {}, [], [], {}
        m, later = len(self.graph.row), {}
        for i, e in enumerate(self.graph.tails.tolist()):
            later.setdefault(e, []).append(m + i)
        self.ends = {e: [e, *later.get(e, ())] for e in self.row_of.values()}  # pairs of sides
        for e in self.row_of.values():
            pair = [self._body(b) for b in self.graph.sides[self.ends[e]].ravel()]
            pair = tuple(sorted(set(pair) if len(pair) > 2 else pair))
            i = nodes.setdefault(pair, len(nodes))
            if i == len(self.pairs):
                self.pairs.append(pair)
                self.rows.append([])
            self.node[e] = i
            self.rows[i].append(e)

    def _body(self, number):
        return int(number) if number < self.nb else GROUND

    def _places(self, table):
        """Where the coordinates of an instance's bodies begin, and how many they are."""
        own = self.system.table[table:]
        return int(own[AT]), int(own[AT + 1]), int(own[DIMENSION]), int(own[DIMENSION + 1])

    def _forces(self):
        """Of every force its bodies and what its `SaddleInstance` begins with."""
        found = []
        for kind in self.system.forces:
            size = kept_size(members_of(kind, self.packed.loads)[0].force.markers)
            for i in range(kind.count):
                own = self._places(kind.table + FORCE_INTS * i)
                pair = tuple(
                    self.body_of[at] if length else GROUND for at, length in zip(own[:2], own[2:], strict=True)
                )
                extent, reals = (1, kind.stride, SPAN), kind.reals + kind.stride * i
                found.append((pair, (*extent, kind.jacobian, 0, reals, *own, kind.kept + size * i, 0, 0)))
        return found

    def _constraints(self):
        """The same of every constraint that is no normalisation.

        The second derivatives of terms that read further bodies are left out.
        """
        found, taken, later = [], {}, {e: iter(ends) for e, ends in self.ends.items()}
        items = [*self.packed.constraints, *self.packed.inertias]
        kinds = dict(zip(dict.fromkeys(map(type, items)), [*self.system.kinds, *self.system.inertias], strict=True))
        rows = [*first_rows(self.packed.constraints), *((row, -1 - i) for i, row in enumerate(self.packed.inertias))]
        for constraint, row in rows:
            kind = kinds[type(constraint)]
            i = taken[type(constraint)] = taken.get(type(constraint), -1) + 1
            e = self.row_of.get(row)
            if constraint.normalises or e is None:
                continue
            pair = tuple(self._body(b) for b in self.graph.sides[next(later[e])])
            if constraint.others:
                continue
            own, reals = self._places(kind.table + CONSTRAINT_INTS * i), kind.reals + kind.stride * i
            loops = kind.stiffness, kind.jacobian
            found.append((pair, (1, kind.stride, SPAN, *loops, reals, *own, 0, e, constraint.all_rows or 1)))
        return found

    def _instance(self, pair, values):
        a, b = pair
        blocks = (self._block(*bodies) for bodies in ((a, a), (a, b), (b, a), (b, b)))
        return *values, *blocks

    def _block(self, i, j):
        """The number of a block, which is made where it is new; -1 with the ground."""
        if GROUND in (i, j):
            return -1
        if (i, j) not in self.block_of:
            target, stride, transposed = self.where(i, j)
            self.block_of[i, j] = len(self.blocks)
            self.blocks.append((i, j, target, stride, OWN if i == j else LOWER if transposed else UPPER))
        return self.block_of[i, j]

    def saddle(self):
        """The `SaddleGraph`."""
        m = len(self.graph.row)
        row_at, diagonal = np.full(m, -1, np.int64), np.zeros(m, np.int64)
        sides = np.full((len(self.graph.sides), 2, 2), -1, np.int64)
        for i, rows in enumerate(self.rows):
            node = self.nb + i
            own, width, _ = self.where(node, node)
            for r, e in enumerate(rows):
                row_at[e], diagonal[e] = self.starts[node] + r, own + r * (width + 1)
                for pair, k in product(self.ends[e], range(2)):
                    b = int(self.graph.sides[pair, k])
                    if b < self.nb:
                        target, stride, transposed = self.where(node, b)
                        sides[pair, k] = (target + r, stride) if transposed else (target + r * stride, 1)
        return SaddleGraph(
            with_kernels(self.pattern, unsymmetric=True), records(Block, self.blocks),
            records(SaddleInstance, self.forces), records(SaddleInstance, self.constraints),
            self.starts[: self.nb].copy(), row_at, sides, diagonal, records(LeanAxis, self._axes()),
        )  # fmt: skip

    def _axes(self):
        """The fields of each `LeanAxis`."""
        for i, (body, one) in enumerate(self.lean.items()):
            node = self.nb + len(self.pairs) + i
            target, stride, _ = self.where(body, body)
            base, step, _ = self.where(node, body)  # below the diagonal: the body comes first
            own, width, _ = self.where(node, node)
            for a, (axis, true) in enumerate(zip(one.axes, one.true, strict=True)):
                c = np.sqrt(one.given - true) * axis
                yield target + 3 * (stride + 1), stride, base + 3 * step + a, step, own + a * (width + 1), *c


# The rows of the saddle-point matrix of implicit methods, its factors and solves.
#
# s is a `SaddleWorkspace`; the blocks of bodies are added by the caller.


@kernel
def write_saddle_rows(graph, f, s):
    """Set the matrix to H and H^T at the present H, axis and inertia rows, and ones at redundant rows."""
    # Zeros for fill
    for i in range(s.graph.pattern.shape[1]):
        let(s.upper, i, 0.0)
        let(s.lower, i, 0.0)
    put_rows_back(graph, f.rows)
    _write_rows(graph, f, s)
    clear_rows(graph, f.rows)
    _write_axes(s)


@kernel
def _write_rows(graph, f, s):
    """H and H^T in the places of the factors; one on the diagonal of redundant rows."""
    H = f.rows.H
    for e in range(graph.sides.shape[0]):
        for k in range(2):
            # H of one side of the row; step is 1 along a row of the block and its width along a column
            base, step = s.graph.sides[e, k, 0], s.graph.sides[e, k, 1]
            if base >= 0:
                for c in range(6 if graph.bodies[graph.sides[e, k], 1] == 7 else 3):
                    # Terms of one sum may share a body
                    x = H[16 * e + 8 * k + c + c // 3]
                    more(s.upper, base + step * c, x)
                    more(s.lower, base + step * c, x)
    # A dropped row has a zero multiplier
    for i in range(f.dropped[0]):
        at = s.graph.diagonal[f.dropped[1 + i]]
        s.upper[at] = s.lower[at] = 1.0
    # h a - mu
    for i in range(graph.inertias.size):
        at = s.graph.diagonal[graph.inertias[i]]
        s.upper[at] = s.lower[at] = -1.0


@kernel
def _write_axes(s):
    """Axis rows, and the inertia that they take back."""
    axis = stack(3)
    for i in range(s.graph.axes.shape[0]):
        one = s.graph.axes[i]
        # c e beside the block of the body, and - c^2 e e^T of the raised inertia taken back: J' + c^2 e e^T
        axis[0], axis[1], axis[2] = one.x, one.y, one.z
        for r in range(3):
            let(s.upper, one.first + one.step * r, axis[r])
            let(s.lower, one.first + one.step * r, axis[r])
            for c in range(3):
                more(s.upper, one.target + one.stride * r + c, axis[r] * axis[c])
                more(s.lower, one.target + one.stride * r + c, axis[r] * axis[c])
        let(s.upper, one.own, 1.0)
        let(s.lower, one.own, 1.0)


@kernel
def factorise_saddle(s):
    """Factorise the saddle-point matrix; return True if it is nonsingular."""
    return factor_lu(s.graph.pattern, s.lower, s.upper, SUM_ROUNDING) < 0


@kernel
def solve_saddle(s):
    """s.x <- the solution for the right-hand side s.x."""
    solve_lu(s.graph.pattern, s.lower, s.upper, s.x)


@kernel
def factorise_complex_saddle(s, pair):
    """Factorise the matrix of a pair of eigenvalues; return True if it is nonsingular."""
    size = s.graph.pattern.shape[2]
    lower = complex_vector(data_of(s.complex_lower[pair]), size)
    upper = complex_vector(data_of(s.complex_upper[pair]), size)
    return factor_lu(s.graph.pattern, lower, upper, SUM_ROUNDING) < 0


@kernel
def solve_complex_saddle(s, pair):
    """s.complex_x <- the solution for the right-hand side s.complex_x, real and imaginary parts in turn."""
    size, x = s.graph.pattern.shape[2], complex_vector(data_of(s.complex_x), s.x.size)
    lower = complex_vector(data_of(s.complex_lower[pair]), size)
    upper = complex_vector(data_of(s.complex_upper[pair]), size)
    solve_lu(s.graph.pattern, lower, upper, x)
