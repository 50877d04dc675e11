"""The constraint graph of a scene and its construction: rows, bodies, products, split hubs; the metric of lengths."""

from functools import cache
from itertools import pairwise
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops.constraint_rows import BODY, INTS, PAIR, ROW, STILL
from ..errors import InvalidConstraint
from ..jit.kernels import Record, kernel, records, row_of
from ..model.equations import WIDTH, constraint_arrays, places, with_short_rows
from ..model.handles import first_rows
from ..model.packed import FrictionPlace, frictions_of, has_lengths, is_small
from .elimination import with_kernels
from .inertia_rows import AXIS_OWN, MasslessAxes, Share, axes_of, inverses, lean_bodies, levers, no_axes
from .symbolic import Pattern, analyse
from .tolerances import FAN, LARGEST, LEAF, LEAST_SHARE, NO_ARM, UNEQUAL_MASSES

# The constraint graph of a scene for the basis-free forms: rows, bodies, and the addresses of their products.
#
# It has no normalisation rows: displacements (dr, dpi') satisfy them (constraint_rows.py). The Schur complement S = H W
# H^T couples rows that share a body; its blocks, their elimination order and all addresses are determined once for a
# scene.

REDUCED, VALUES, BIAS, DRIFT = LOOPS = "reduced", "values", "bias", "drift"  # those of a `RowKind`


class RowKind(Record):
    """Instances of one class of primitive without a gap."""

    reduced: int  # addresses of the loops of constraint_rows.py; zero where they aren't needed or there is none
    values: int
    bias: int
    drift: int  # 1 for a moving kind until it is loaded
    count: int  # instances
    stride: int  # reals of each
    table: int  # where the entries of the first begin in ConstraintGraph.table
    reals: int  # and in System.reals


class Product(Record):
    """H Y^T of two runs of constraints at a body; of one constraint with itself, at both."""

    left: int  # where the sides of the two runs begin in H, and how many rows they have
    rows: int
    right: int
    columns: int
    target: int  # where the product goes in S
    stride: int  # length of a row there
    same: int  # 1 for a constraint with itself; 2 for a later term of a sum with itself


class PartProduct(Record):
    """The same at a part of a split body."""

    left: int
    rows: int
    right: int
    columns: int
    target: int
    stride: int
    kind: int
    body: int


ROWS, ROWS_WELD, WELD_ROWS, WELDS = range(4)  # kinds
W_MASS, W_ROTATION, WEIGHTS = 0, 4, 16


class ConstraintGraph(NamedTuple):
    """Rows are in order of elimination; sides are (row, a or b), each 8 floats of H, which are zero where row is -1.

    A row that is a sum has a pair of sides for each of its terms: that of the first in its own place, those of the
    others behind the pairs of all rows.
    """

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length: 7, 3, or poses.STILL of what never turns
    kinds: np.ndarray  # RowKind (kinds,); more than one of a class where instances between them are left out
    table: np.ndarray  # int64: constraint_rows.INTS for each instance
    sides: np.ndarray  # int64 (m + tails, 2): the bodies of a row; nb is the ground
    sums: np.ndarray  # int64 (sums,): rows that several instances add to
    tails: np.ndarray  # int64 (tails,): the row of each pair of sides behind those of all rows
    row: np.ndarray  # int64 (m,): its place among the rows of Phi; -1 for a weld's or an axis's
    products: np.ndarray  # Product (products,): rows of sides that meet at a body, and where their product goes
    inverse: np.ndarray  # ((nb + 1) 16,): 1 / m and three zeros, columns of J'^-1; zero for the ground
    mass: np.ndarray  # ((nb + 1) 16,): m and three zeros, columns of J'
    spins: np.ndarray  # int64 (nb,): whether omega' x J' omega' is ever other than zero
    pattern: Pattern  # of S
    turns: np.ndarray  # (m,): one for rows that are pure numbers, such as those of axes; of no size but in small scenes
    rates: np.ndarray  # int64 (rows on velocities,): which rows of the graph they are, in order of elimination
    normals: np.ndarray  # int64 (nb,): the row of Phi that normalises a body's p, or -1
    parts: np.ndarray  # PartProduct (products,): the products at the parts of hubs
    scales: np.ndarray  # (products,): what they are multiplied by
    welds: np.ndarray  # int64 (rows of welds, 2): which row, of which body
    diagonal: np.ndarray  # int64 (m,): where the diagonal entry of a row is in a value array of the pattern
    dropped: np.ndarray  # int64: rows that follow from the others, as chosen at the first start; see row_selection.py
    frictions: np.ndarray  # (frictions,) of FrictionPlace: those that follow from reactions
    friction_rows: np.ndarray  # int64 (rows of their joints, 2): which row, and on which side its reaction is taken
    friction_solver: np.ndarray  # int64 (1,): address of what solves for them, as the form needs it
    axes: MasslessAxes  # rows of bodies with next to no inertia about an axis
    inertias: np.ndarray  # int64 (k,): rows that add inertia to a joint coordinate, see inertia_rows.py


def no_graph():
    """The graph of nothing, for its type."""
    none, pattern = np.zeros(0, np.int64), analyse([], [])[1]
    pairs = np.zeros((0, 2), np.int64)
    kinds, products, parts = records(RowKind), records(Product), records(PartProduct)
    return ConstraintGraph(
        pairs, kinds, none, pairs, none, none, none, products, np.zeros(16), np.zeros(16), none, pattern, np.zeros(0),
        none, none, parts, np.zeros(0), pairs, none, none, records(FrictionPlace), pairs, np.zeros(1, np.int64),
        no_axes(), none,
    )  # fmt: skip


@kernel
def is_raised(graph):
    """Whether S of the dynamics has another metric than the inverse masses: with axis rows or inertia rows."""
    return graph.axes.rows.shape[0] > 0 or graph.inertias.size > 0


# The metric of lengths, in which the rank of constraint rows is judged: geometry alone, whatever the masses.
#
#     |x|^2 = sum |dr|^2 + L^2 |w'|^2
#
# L is the longest arm of a body's joints, m. Where all of these are next to nothing, rows may still have arms that no
# point shows: the radius of a wheel, the way along a guide, the lead of a screw. L is then the longest of those,
# |Phi_w'| / |Phi_r| of a row and a body at the start.

MASS_REMEDY = "Give light bodies that carry heavy ones more mass, or make them one body with what they carry."


def arms(packed):
    """L of each body, (bodies,), m: no less than a share of the longest; one in a scene without lengths. Found once."""
    if packed.derived.arms is None:
        found = levers(packed)
        longest, shown = found.max(initial=0.0), _longest_shown(packed)
        packed.derived.arms = np.maximum(found, LEAST_SHARE * longest if longest > NO_ARM * shown else shown or 1.0)
    return packed.derived.arms


def _longest_shown(packed):
    """The largest |Phi_w'| / |Phi_r| of a row and a body at the start, m; zero where no row has both."""
    system, q = with_short_rows(packed), np.concatenate([body.q for body in packed.bodies])
    system = system._replace(motions=system.motions[:0], signals=system.signals[:0])  # at no time
    halves = constraint_arrays(system, q, np.zeros_like(q), 0.0, WIDTH)[1].reshape(-1, 2, WIDTH // 2)
    at, length = places(packed)
    rows = np.concatenate((np.arange(len(packed.system.segments)), system.tails))
    rigid = length == 7
    # Phi_p = 2 Phi_w' G, and a part along p
    p = q[at[rigid][:, None] + np.arange(3, 7)]
    move, turn = halves[rigid][:, :3], 0.5 * halves[rigid][:, 3:]
    turn = turn - np.einsum("ki,ki->k", turn, p)[:, None] * p
    # Terms of a row on the same body: |Phi_r| and |Phi_w'| add up, so opposite pulls don't cancel
    _, row_of = np.unique((q.size * rows[:, None] + at)[rigid], return_inverse=True)
    move, turn = (np.bincount(row_of, np.linalg.norm(part, axis=1)) for part in (move, turn))
    both = (move > 0.0) & np.isfinite(move + turn)  # neither where a row is singular
    return float((turn[both] / move[both]).max(initial=0.0))


def coordinate_scales(packed):
    """Factors (n,) that make columns of Phi_q those of dr and of 2 L dp, whose length is that of L w'."""
    bodies, L = packed.system.bodies, arms(packed)
    scales = np.ones(int(bodies[:, 1].sum()))
    rigid = bodies[:, 1] == 7
    scales[bodies[rigid, :1] + np.arange(3, 7)] = 0.5 / L[rigid, None]
    return scales


def by_lengths(packed, graph):
    """The constraint graph with the inverse of this metric for W, and without axis rows but in name."""
    inverse, values = np.zeros((len(graph.bodies) + 1, WEIGHTS)), np.zeros_like(graph.axes.values)
    inverse[:-1, W_MASS] = 1.0
    rigid = np.flatnonzero(graph.bodies[:, 1] == 7)
    inverse[rigid[:, None], W_ROTATION + np.array([0, 5, 10])] = arms(packed)[rigid, None] ** -2.0
    values[:, AXIS_OWN] = -1.0
    return graph._replace(inverse=inverse.ravel(), axes=graph.axes._replace(values=values))


def are_unequal(system):
    """Whether heavy bodies may load light ones: the factors of S, and accelerations, lose digits to their ratio."""
    largest = np.abs(system.inertia).max(axis=1)  # zero for a point mass
    return any(x.max() > UNEQUAL_MASSES * x.min() for x in (system.mass, largest[largest > 0.0]) if x.size)


def mass_ratio(packed, least=0.0):
    """The lightest and the heaviest body by mass or inertia, for messages; empty where their ratio is below `least`."""
    system, bodies = packed.system, np.arange(len(packed.bodies))
    rigid = bodies[system.bodies[:, 1] == 7]
    found = [(bodies, system.mass, "kg"), (rigid, np.abs(system.inertia[rigid]).max(axis=1), "kg m^2")]
    which, sizes, unit = min((each for each in found if each[0].size), key=lambda each: each[1].min() / each[1].max())
    light, heavy = sizes.argmin(), sizes.argmax()
    if sizes[heavy] < least * sizes[light]:
        return ""
    one, other = (f"{packed.bodies[which[i]].name} ({sizes[i]:.3g} {unit})" for i in (light, heavy))
    return f"the mass ratio of these bodies is too large for accelerations in double precision: {one} beside {other}"


# Body splitting: a body with many joints (a hub) couples all their rows into one dense block of S.
#
# A hub is split into a tree of parts, each welded to its parent by as many rows as the body has degrees of freedom;
# mass and inertia are distributed over the parts. Few rows meet at a part, so the graph is as sparse as a tree of
# bodies. The system is equivalent: welded parts move as one body, so S = H W H^T of the parts, with zeros on the
# right-hand side for the welds, gives the multipliers of the undivided body. S of the parts is positive definite
# wherever the rows are independent; each level of the tree carries an equal share of the mass, which keeps S well
# conditioned.
#
# Constraints are assigned to parts along a traversal of the rest of the scene, so that constraints close to each other
# in the graph meet at neighbouring parts.


class SplitPart(NamedTuple):
    """A part of a hub."""

    body: int
    scale: float  # of the hub's mass over its own
    nodes: list  # that meet there
    welds: list  # pairs: the node of a weld, its sign on this part


def cut(pairs, sizes, degrees):
    """Cut the hubs of a graph.

    Parameters
    ----------
    pairs : sequence of tuple of int
        The bodies of each node (all rows between two bodies, or more); one of them may be the ground, -1.
    sizes : list of int
        Rows of each node; those of the welds, which are nodes too, are appended.
    degrees : sequence of int
        Degrees of freedom of each body, 6 or 3.

    Returns
    -------
    list of SplitPart
    """
    at_body = {}
    for node, pair in enumerate(pairs):
        for body in pair:
            if body >= 0:
                at_body.setdefault(body, []).append(node)
    # Rows at one body beyond which its dense block costs more than a tree
    hubs = {body for body, nodes in at_body.items() if sum(sizes[node] for node in nodes) > LARGEST}
    if not hubs:
        return []
    place = _walk(pairs, at_body, hubs)
    parts = []
    for hub in sorted(hubs):
        parts += _tree(hub, sorted(at_body[hub], key=place.__getitem__), sizes, degrees[hub])
    return parts


def _walk(pairs, at_body, hubs):
    """When each node is met on a walk, breadth first, that doesn't pass hubs or the ground."""
    place = {}
    for first in range(len(pairs)):
        queue = [first]
        for node in queue:
            if node in place:
                continue
            place[node] = len(place)
            for body in pairs[node]:
                if body >= 0 and body not in hubs:
                    queue += [other for other in at_body[body] if other not in place]
    return place


def _tree(hub, nodes, sizes, degrees):
    """The parts of one hub; sizes grows by the welds."""
    # Leaves hold at most LEAF rows
    leaves, rows = [[]], 0
    for node in nodes:
        if leaves[-1] and rows + sizes[node] > LEAF:
            leaves.append([])
            rows = 0
        leaves[-1].append(node)
        rows += sizes[node]
    # Inner levels join FAN parts each, up to one root
    levels = [len(leaves)]
    while levels[-1] > 1:
        levels.append(-(-levels[-1] // FAN))
    parts, below = [], []
    # Every level carries the same share of the mass
    for count in levels:
        level = [SplitPart(hub, float(len(levels) * count), [] if below else leaves[i], []) for i in range(count)]
        for i, part in enumerate(below):
            weld, above = len(sizes), level[i * count // len(below)]
            sizes.append(degrees)
            part.welds.append((weld, 1))
            above.welds.append((weld, -1))
        parts += level
        below = level
    return parts


# Builds the constraint graph of a packed scene, step by step.
#
# joints      constraints that are no normalisations, the two bodies and the first row of Phi of each
# nodes       pairs of bodies that joints connect: the blocks of S; their rows are eliminated together. A row that is a
#             sum connects more than two: its terms are joints of one row and one node
# hubs        bodies with many nodes, cut into parts that welds hold together (`cut`)
# products    where H_i W H_j^T of two runs of joints at a body goes in S


class _Joint(NamedTuple):
    constraint: object
    pair: tuple  # the numbers of its two bodies; that of the ground is the number of bodies
    row: int  # the first of its rows in Phi; -1 of one that adds inertia


class _Lean(NamedTuple):
    """A body without inertia about an axis, or a part of it where it is cut as a hub."""

    body: int
    clique: int
    scale: float
    nodes: list  # of a part; None for a whole body
    welds: list


def build(packed, still=None):
    """The graph of a packed scene, with the addresses of the loops still zero, and the classes of its kinds.

    With `still`, a `locked_orientations.Still`, without the rotations of those bodies and the rows that hold them.
    Scenes of a family share all but numbers, unless a body has next to no inertia about an axis.
    """
    # Axis rows depend on inertias, so a scene that has any is not shared
    shared = packed.derived.shared
    if shared is None or lean_bodies(packed):
        return _GraphBuilder(packed, still).graph()
    place = None if still is None else (still.bodies.tobytes(), still.omitted)
    key = build, packed.derived.redundant is None, is_small(packed.size), place
    if key not in shared:
        shared[key] = _GraphBuilder(packed, still).graph()
    graph, used = shared[key]
    inverse, mass, spins = weights(packed.system, graph.bodies, {})
    dropped = dropped_rows(packed, still, graph.row)
    own = {"inverse": inverse, "mass": mass, "spins": spins, "dropped": dropped, "table": graph.table.copy()}
    return graph._replace(**own), used


class _GraphBuilder:
    """What the steps hand on to each other."""

    def __init__(self, packed, still):
        self.packed, self.system, self.still = packed, packed.system, still
        self.rows, omitted = packed.system.bodies, ()
        if still is not None:
            omitted, self.rows = still.omitted, self.rows.copy()
            self.rows[still.bodies, 1] = STILL
        self.bodies = {id(body): i for i, body in enumerate(packed.bodies)}
        self.nb = len(self.bodies)
        self._find_joints(omitted)
        self._find_nodes()
        self._cut_hubs()
        self._find_lean_bodies()
        self.starts, self.pattern, where = analyse(self.sizes, self.cliques, len(self.held))
        self.where = cache(where)
        self._place_rows()

    def _find_joints(self, omitted):
        self.joints, self.normals = [], np.full(self.nb, -1, np.int64)
        for i, (constraint, row) in enumerate(first_rows(self.packed.constraints)):
            if constraint.normalises:
                self.normals[self.bodies[id(constraint.a)]] = row
            elif i not in omitted:
                self.joints.append(_Joint(constraint, self._pair(constraint), row))
        self.joints += [_Joint(added, self._pair(added), -1) for added in self.packed.inertias]

    def _pair(self, part):
        return self.bodies.get(id(part.a), self.nb), self.bodies.get(id(part.b), self.nb)

    def _find_nodes(self):
        """The nodes, how many rows each has, and of every joint its node and its first row within."""
        self.nodes, self.sizes, self.inside, ends = {}, [], [], {}
        for constraint, pair, row in self.joints:
            if constraint.summed:
                ends[row] = (*ends.get(row, ()), *pair)
        for constraint, pair, row in self.joints:
            node = self.nodes.setdefault(tuple(sorted(set(ends.get(row, pair)))), len(self.nodes))
            if node == len(self.sizes):
                self.sizes.append(0)
            self.inside.append((node, self.sizes[node] - (not constraint.all_rows)))
            self.sizes[node] += constraint.all_rows

    def _cut_hubs(self):
        """Parts of hubs, and the cliques: nodes that meet at a body or a part. Frictions couple a hub's rows whole."""
        degrees = np.where(self.rows[:, 1] == 7, 6, 3).tolist()
        whole = self.packed.derived.redundant is not None or self.system.normals.size
        pairs = [tuple(body if body < self.nb else -1 for body in pair) for pair in self.nodes]
        self.parts = [] if whole else cut(pairs, self.sizes, degrees)
        self.hubs, self.cliques = {part.body for part in self.parts}, [[] for _ in range(self.nb)]
        for pair, node in self.nodes.items():
            for body in pair:
                if body < self.nb and body not in self.hubs:
                    self.cliques[body].append(node)
        self.cliques += [[*part.nodes, *(weld for weld, _ in part.welds)] for part in self.parts]

    def _find_lean_bodies(self):
        """Bodies with axes without inertia, whose rows are nodes of their own, eliminated last."""
        self.lean = {body: one for body, one in lean_bodies(self.packed).items() if self.rows[body, 1] == 7}
        self.held = [_Lean(body, body, 1.0, None, []) for body in sorted(self.lean.keys() - self.hubs)]
        self.held += [
            _Lean(part.body, self.nb + i, part.scale, part.nodes, part.welds)
            for i, part in enumerate(self.parts)
            if part.body in self.lean
        ]
        for i, held in enumerate(self.held):
            self.cliques[held.clique].append(len(self.sizes) + i)
        self.sizes += [len(self.lean[held.body].axes) for held in self.held]

    def _place_rows(self):
        """Of every row, in order of elimination, its two bodies and its place in Phi; and the joints at each body."""
        m = sum(self.sizes)
        self.firsts = [int(self.starts[node]) + offset for node, offset in self.inside]
        self.tails = [first for (part, *_), first in zip(self.joints, self.firsts, strict=True) if not part.all_rows]
        # Pairs of sides: those of later terms of sums follow those of the rows
        later = iter(range(m, m + len(self.tails)))
        self.pairs = [
            first if part.all_rows else next(later) for (part, *_), first in zip(self.joints, self.firsts, strict=True)
        ]
        self.counts = [part.all_rows or 1 for part, *_ in self.joints]
        sides, places = [(self.nb, self.nb)] * (m + len(self.tails)), [-1] * m
        self.at_body, self.at_node = [[] for _ in range(self.nb)], [[] for _ in self.nodes]
        for i, (constraint, pair, row) in enumerate(self.joints):
            first, count = self.pairs[i], self.counts[i]
            sides[first : first + count] = [pair] * count
            if constraint.all_rows:
                places[first : first + count] = range(row, row + count)
            self.at_node[self.inside[i][0]].append(i)
            for side, body in enumerate(pair):
                if body < self.nb and body not in self.hubs:
                    self.at_body[body].append((i, side))
        self.sides, self.places = np.array(sides, np.int64).reshape(-1, 2), np.array(places, np.int64)

    def _at_part(self, body, nodes):
        """The joints of these nodes that are at a body, and their sides there."""
        found = (i for node in nodes for i in self.at_node[node] if body in self.joints[i].pair)
        return [(i, self.joints[i].pair.index(body)) for i in found]

    def _product(self, i, side, rows, j, other, columns):
        """Columns of ConstraintGraph.products, of runs that begin with joints i and j, at sides of these."""
        (node, r), (other_node, c) = self.inside[i], self.inside[j]
        target, stride, _ = self.where(node, other_node)
        left, right = 16 * self.pairs[i] + 8 * side, 16 * self.pairs[j] + 8 * other
        return left, rows, right, columns, target + r * stride + c, stride

    def _products(self):
        counts, firsts, product = self.counts, self.firsts, self._product
        kinds = [1 if joint.constraint.all_rows else 2 for joint in self.joints]
        products = [(*product(i, 0, counts[i], i, 0, counts[i]), kind) for i, kind in enumerate(kinds)]
        products.sort(key=itemgetter(-1))  # later terms of sums add to what is there
        for found in self.at_body:
            runs = [(run, firsts[run[0][0]], sum([counts[i] for i, _ in run])) for run in self._runs(found)]
            # Of each joint with the rest of its run
            for run, _, left in runs:
                for one, after in pairwise(run):
                    left -= counts[one[0]]
                    products.append((*product(*one, counts[one[0]], *after, left), 0))
            # Of pairs of runs, above the diagonal only; two terms of one sum both ways
            for run, first, rows in runs:
                for other, second, columns in runs:
                    if first < second or (first == second and run is not other):
                        products.append((*product(*run[0], rows, *other[0], columns), 0))
        return records(Product, products)

    def _runs(self, found):
        """Joints and their sides at a body, in lists whose rows follow one another within a node, on one side.

        A term of a sum is a list of its own: its row is that of other terms, too.
        """
        runs, end = [], None
        for i, side in sorted(found, key=lambda one: self.firsts[one[0]]):
            node, count, summed = self.inside[i][0], self.counts[i], self.joints[i].constraint.summed
            if summed or (node, self.firsts[i], self.pairs[i], side) != end:
                runs.append([])
            runs[-1].append((i, side))
            end = None if summed else (node, self.firsts[i] + count, self.pairs[i] + count, side)
        return runs

    def _products_at_hubs(self):
        """`parts` and `scales` of the graph: products at the parts of hubs, and with the welds between these."""
        products, scales = [], []
        for part in self.parts:
            found = self._at_part(part.body, part.nodes)
            # Rows with rows
            for i, side in found:
                for j, other in found:
                    if self.firsts[i] <= self.firsts[j]:
                        at_part = self._product(i, side, self.counts[i], j, other, self.counts[j])
                        products.append((*at_part, ROWS, part.body))
                        scales.append(part.scale - (i == j))  # the whole hub's is among the products
            for weld, sign in part.welds:
                count = self.sizes[weld]
                for i, side in found:
                    # Rows with the weld's, whose H is +-I
                    node, r = self.inside[i]
                    target, stride, after = self.where(node, weld)
                    to, kind = (target + r, WELD_ROWS) if after else (target + r * stride, ROWS_WELD)
                    left = 16 * self.pairs[i] + 8 * side
                    products.append((left, self.counts[i], 0, count, to, stride, kind, part.body))
                    scales.append(sign * part.scale)
                for other, other_sign in part.welds:
                    # Welds with welds
                    target, stride, after = self.where(weld, other)
                    if not after:
                        products.append((0, count, 0, count, target, stride, WELDS, part.body))
                        scales.append(sign * other_sign * part.scale)
        return records(PartProduct, products), np.array(scales, float)

    def _welds(self):
        rows = [
            (int(self.starts[weld]) + r, part.body)
            for part in self.parts
            for weld, sign in part.welds
            if sign > 0
            for r in range(self.sizes[weld])
        ]
        return np.array(rows, np.int64).reshape(-1, 2)

    def _axes(self):
        """ConstraintGraph.axes; the rows of axes get their body as a side."""
        first = len(self.sizes) - len(self.held)
        shares = [
            Share(
                held.body,
                held.scale,
                self.at_body[held.body] if held.nodes is None else self._at_part(held.body, held.nodes),
                held.welds,
                first + i,
            )
            for i, held in enumerate(self.held)
        ]
        axes = axes_of(shares, self.lean, self.counts, self.pairs, self.inside, self.where, self.starts)
        self.sides[axes.rows["row"], 0] = axes.rows["body"]
        return axes

    def _kinds(self, index):
        """`kinds` and `table` of the graph, and the class of each of the kinds: runs of instances without a gap."""
        items = [*self.packed.constraints, *self.packed.inertias]
        classes = dict.fromkeys(type(item) for item in items)
        kinds, table, used = [], [], []
        for kind, packed_kind in zip(classes, [*self.system.kinds, *self.system.inertias], strict=True):
            if kind.normalises:
                continue
            phi_t, stride, first_real = packed_kind.phi_t, packed_kind.stride, packed_kind.reals
            last = None  # the instance before, where it is not left out
            for at, constraint in enumerate(item for item in items if type(item) is kind):
                i = index.get(id(constraint))
                if i is None:
                    continue
                # An omitted instance interrupts the run
                if last is None or last != at - 1:
                    kinds.append(
                        {
                            "drift": int(phi_t != 0),
                            "count": 0,
                            "stride": stride,
                            "table": len(table),
                            "reals": first_real + at * stride,
                        }
                    )
                    used.append(kind)
                last = at
                kinds[-1]["count"] += 1
                entry = [0] * INTS
                entry[BODY : BODY + 2], entry[ROW], entry[PAIR] = self.joints[i].pair, self.firsts[i], self.pairs[i]
                table += entry
        return records(RowKind, [row_of(RowKind, **kind) for kind in kinds]), np.array(table, np.int64), tuple(used)

    def _sums(self):
        """The rows that are sums."""
        return [first for (part, *_), first in zip(self.joints, self.firsts, strict=True) if part.summed]

    def _turns(self):
        """ConstraintGraph.turns."""
        if not is_small(self.packed.size):
            return np.zeros(0)
        turns = np.zeros(len(self.places))
        for (constraint, _, _), first in zip(self.joints, self.firsts, strict=True):
            turns[first : first + constraint.all_rows] = not has_lengths(constraint)
        return turns if turns.any() else np.zeros(0)

    def _rates(self):
        """ConstraintGraph.rates."""
        pairs = zip(self.joints, self.firsts, strict=True)
        found = [range(first + joint.constraint.rows, first + joint.constraint.all_rows) for joint, first in pairs]
        return np.array(sorted(i for rows in found for i in rows), np.int64)

    def graph(self):
        """The `ConstraintGraph`, and the classes of its kinds."""
        parts, scales = self._products_at_hubs()
        axes = self._axes()
        index = {id(joint.constraint): i for i, joint in enumerate(self.joints)}
        kinds, table, used = self._kinds(index)
        inverse, mass, spins = weights(self.system, self.rows, self.lean)

        def rows_of(part):
            first = self.firsts[index[id(part)]]
            return range(first, first + part.all_rows)

        frictions, friction_rows = frictions_of(self.packed, self.bodies, rows_of, self.sides)
        graph = ConstraintGraph(
            bodies=self.rows,
            kinds=kinds,
            table=table,
            sides=self.sides,
            sums=np.array(sorted(set(self._sums())), np.int64),
            tails=np.array(self.tails, np.int64),
            row=self.places,
            products=self._products(),
            inverse=inverse,
            mass=mass,
            spins=spins,
            pattern=with_kernels(self.pattern),
            turns=self._turns(),
            rates=self._rates(),
            normals=self.normals,
            parts=parts,
            scales=scales,
            welds=self._welds(),
            diagonal=_diagonal(self.pattern),
            dropped=dropped_rows(self.packed, self.still, self.places),
            frictions=frictions,
            friction_rows=friction_rows,
            friction_solver=np.zeros(1, np.int64),
            axes=axes,
            inertias=np.array([self.firsts[index[id(row)]] for row in self.packed.inertias], np.int64),
        )
        return graph, used


def weights(system, rows, lean):
    """ConstraintGraph.inverse, ConstraintGraph.mass and ConstraintGraph.spins.

    rows: as ConstraintGraph.bodies; lean: as `lean_bodies` returns it.
    """
    nb = len(rows)
    inverse, mass = np.zeros((nb + 1, WEIGHTS)), np.zeros((nb + 1, WEIGHTS))
    spins = np.zeros(nb, np.int64)
    inverse[:nb, W_MASS], mass[:nb, W_MASS] = 1.0 / system.mass, system.mass
    rigid = np.flatnonzero(rows[:, 1] == 7)
    J = system.inertia[rigid].reshape(-1, 3, 3)
    spins[rigid] = (J[:, :1, :1] * np.eye(3) != J).any(axis=(1, 2))
    for out, matrices in ((inverse, inverses(J, [lean.get(i) for i in rigid])), (mass, J)):
        out.reshape(-1, 4, 4)[rigid, 1:, :3] = matrices
    return inverse.ravel(), mass.ravel(), spins


def dropped_rows(packed, still, row):
    """ConstraintGraph.dropped, of a graph whose rows have these places in Phi."""
    if still is not None:
        return np.flatnonzero(np.isin(row, still.redundant))
    redundant = packed.derived.redundant
    return np.zeros(0, np.int64) if redundant is None else redundant.copy()


def _diagonal(pattern):
    """Where the diagonal entries are, in the order of the eliminated vector."""
    sizes = np.diff(pattern.starts)
    within = np.arange(pattern.shape[0]) - np.repeat(pattern.starts[:-1], sizes)
    return np.repeat(pattern.heads, sizes) + within * (np.repeat(pattern.widths, sizes) + 1)


# The constraint graphs of a packed scene: built once, with the loops that a kernel needs loaded.


def graph_of(packed, *columns):
    """The graph of a packed scene with the addresses of these loops, made and loaded once."""
    known = packed.derived
    if columns not in known.graphs:
        known.graphs[columns] = with_loops(*parts_of(packed), *columns)
    return known.graphs[columns]


def parts_of(packed):
    """The graph without addresses of loops, not to be written to, and the classes of its kinds; made once."""
    known = packed.derived
    if known.graph is None:
        known.graph = build(packed)
    return known.graph


def set_redundant(packed, rows):
    """Discard the graphs of a scene; new ones have these redundant rows, int64 (k,), or None.

    Hubs are left whole then: elimination may end with the row of a weld, which can't be left out.
    """
    packed.derived.forget_graphs()
    packed.derived.redundant = rows


def redundant_rows(packed):
    """Redundant rows of Phi, int64 (k,)."""
    places = packed.derived.redundant
    return np.zeros(0, np.int64) if places is None else graph_of(packed).row[places]


def with_loops(graph, kinds, *columns):
    """The graph with the addresses of these loops, which are loaded now."""
    table = graph.kinds.copy()
    for i, kind in enumerate(kinds):
        for loop in columns:
            if loop != DRIFT or table[DRIFT][i] != 0:
                table[loop][i] = address(kind.kernels, loop, kind.__name__, InvalidConstraint)
    return graph._replace(kinds=table, friction_solver=np.zeros(1, np.int64))
