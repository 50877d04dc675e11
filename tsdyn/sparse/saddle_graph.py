"""The saddle-point matrix of implicit methods: unknowns, blocks, and where every number goes in its factors.

    [ M - g C_b - g^2 K_b    H^T ]      (r'', omega'') of the bodies
    [ H                      0   ]      multipliers of the rows

K_b and C_b have a block for each body and two for each pair of bodies that a force or a constraint couples. A body
without inertia about an axis has an axis row besides.
"""

from typing import NamedTuple

import numpy as np

from ..elements.loops.coordinate_rows import INTS as CONSTRAINT_INTS
from ..elements.loops.forces import INTS as FORCE_INTS
from ..elements.loops.forces import kept_size
from ..elements.loops.template import AT, DIMENSION
from ..jit.kernels import Record, records
from ..model.packed_forces import members_of
from .elimination import with_kernels
from .massless_axes import lean_bodies
from .panels import Pattern
from .saddle_order import GROUND, order_saddle
from .symbolic import analyse, lay_out_in_order

UPPER, LOWER, OWN = range(3)  # where a block stands: above the diagonal, below it, on it
BLOCK = 36  # floats of one


class Block(Record):
    """A block of K and C: derivatives of the load on one body by the motion of another, or by its own."""

    row: int  # the two bodies
    column: int
    target: int  # where it begins in the factors, and the length of a row there
    stride: int
    place: int


class Instance(Record):
    """A force or a constraint, its two bodies and the blocks that it adds to."""

    loop: int  # address of forces.jacobian, or of constraint_hessians.loop
    rows_loop: int  # of a constraint: address of coordinate_rows.jacobian
    stride: int  # floats, and where they begin
    reals: int
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
    """An axis c e without inertia: what it adds to the block of its body, and its axis row (massless_axes.py)."""

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
    sides: np.ndarray  # int64 (m, 2, 2): of a row and a body, where H begins in the factors and its stride; -1: nowhere
    diagonal: np.ndarray  # int64 (m,): where a row's diagonal entry is
    axes: np.ndarray  # LeanAxis (axes,)


def no_saddle():
    """The `SaddleGraph` of nothing, for its type."""
    none, blocks, instances = np.zeros(0, np.int64), records(Block), records(Instance)
    sides, axes = np.zeros((0, 0, 0), np.int64), records(LeanAxis)
    return SaddleGraph(analyse([], [])[1], blocks, instances, instances, none, none, sides, none, axes)


def saddle_of(packed, graph, system):
    """The `SaddleGraph` of a packed scene, its constraint graph, and its system with the loops of implicit methods."""
    known = packed.derived
    if known.saddle is None or known.saddle[0] is not graph or known.saddle[1] is not system:
        known.saddle = graph, system, _Builder(packed, graph, system).saddle()
    return known.saddle[2]


class _Builder:
    """What the steps hand on to each other."""

    def __init__(self, packed, graph, system):
        self.packed, self.graph, self.system = packed, graph, system
        self.nb = len(graph.bodies)
        self.degrees = np.where(graph.bodies[:, 1] == 7, 6, 3).tolist()
        self.body_of = {int(at): body for body, at in enumerate(system.bodies[:, 0])}
        self.row_of = {int(row): e for e, row in enumerate(graph.row) if row >= 0}
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
        """Rows of the same two bodies are one node: its bodies, its rows, and of each row its node."""
        nodes, self.pairs, self.rows, self.node = {}, [], [], {}
        for e in self.row_of.values():
            pair = tuple(sorted(self._body(b) for b in self.graph.sides[e]))
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
        """Of every force its bodies and what its `Instance` begins with."""
        found = []
        for kind in self.system.forces:
            size = kept_size(members_of(kind, self.packed.loads)[0].force.markers)
            for i in range(kind.count):
                own = self._places(kind.table + FORCE_INTS * i)
                pair = tuple(
                    self.body_of[at] if length else GROUND for at, length in zip(own[:2], own[2:], strict=True)
                )
                loops, reals = (kind.jacobian, 0), (kind.stride, kind.reals + kind.stride * i)
                found.append((pair, (*loops, *reals, *own, kind.kept + size * i, 0, 0)))
        return found

    def _constraints(self):
        """The same of every constraint that is no normalisation."""
        found, row, taken = [], 0, {}
        kinds = dict(zip(dict.fromkeys(map(type, self.packed.constraints)), self.system.kinds, strict=True))
        for constraint in self.packed.constraints:
            kind = kinds[type(constraint)]
            i = taken[type(constraint)] = taken.get(type(constraint), -1) + 1
            e = self.row_of.get(row)
            row += constraint.rows
            if constraint.normalises or e is None:
                continue
            pair = tuple(self._body(b) for b in self.graph.sides[e])
            own, reals = self._places(kind.table + CONSTRAINT_INTS * i), (kind.stride, kind.reals + kind.stride * i)
            found.append((pair, (kind.curvature, kind.jacobian, *reals, *own, 0, e, constraint.rows)))
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
        sides = np.full((m, 2, 2), -1, np.int64)
        for i, rows in enumerate(self.rows):
            node = self.nb + i
            own, width, _ = self.where(node, node)
            for r, e in enumerate(rows):
                row_at[e], diagonal[e] = self.starts[node] + r, own + r * (width + 1)
                for k, b in enumerate(self.graph.sides[e]):
                    if b < self.nb:
                        target, stride, transposed = self.where(node, int(b))
                        sides[e, k] = (target + r, stride) if transposed else (target + r * stride, 1)
        return SaddleGraph(
            with_kernels(self.pattern, unsymmetric=True), records(Block, self.blocks), records(Instance, self.forces),
            records(Instance, self.constraints), self.starts[: self.nb].copy(), row_at, sides, diagonal,
            records(LeanAxis, self._axes()),
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
