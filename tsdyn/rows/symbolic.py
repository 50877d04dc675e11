"""Symbolic part of the sparse factorisation: fill-reducing order, supernodes, the place of each number."""

import heapq
from bisect import bisect_right
from collections import deque
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..maths.dense_linalg import sparse_lu
from .tolerances import LINK_COST, LOOKUP, NUMBER_COST, OWN, PIVOTS_COST, PRODUCT_COST, UPDATE_COST, WIDEST

COSTS = 4096  # of blocks of so many sizes, kept

# Panels: where every number of a factor goes, and the products that elimination subtracts.
#
# Block j stores its rows of the upper triangle as one dense row-major panel: its own columns first, then the columns of
# later rows that elimination reaches,
#
#     values[heads[j] + r * widths[j] + c],   r < size of j,   c < widths[j] = size of j + rows reached.
#
# Elimination of block j updates the panels of later blocks by products of its columns. The targets are listed here
# once, so the kernels in factorisation.py neither search nor allocate.


class Pattern(NamedTuple):
    """What the kernels of factorisation.py read: int64 vectors only."""

    shape: np.ndarray  # rows, length of the panels, length of a value array (panels, then room for a diagonal)
    starts: np.ndarray  # first row of each block in the eliminated vector, and the end
    heads: np.ndarray  # where each block's panel begins in the value array
    widths: np.ndarray  # length of a row of each block's panel
    columns: np.ndarray  # of each block, the first of its segments, and the end
    segments: np.ndarray  # pairs: first row in the eliminated vector, count; the rows that each panel reaches
    updates: np.ndarray  # of each block, the first of its records, and the end
    records: np.ndarray  # sixes: row column, rows, first column, columns in its own panel; target, target's row length
    negative: np.ndarray  # rows of late nodes, whose pivots are below zero
    kernels: np.ndarray  # (3,): addresses of elimination.py's kernels of factor, factor_lu, solve; (0,) without them


def lay_out(sizes, cliques, groups):
    """Rows of each node, the pattern but for negative pivots, and `where`, as `analyse` returns them."""
    layout = _PanelLayout(sizes, cliques, groups)
    return layout.rows, layout.pattern(), layout.where


class _PanelLayout:
    """Places of all entries in the panels of the blocks.

    Parameters
    ----------
    sizes : list of int
        Rows of each node.
    cliques : list of set of int
    groups : list of list of int
        Nodes of each block, in order of elimination.
    """

    def __init__(self, sizes, cliques, groups):
        self.sizes, self.home = sizes, {i: g for g, group in enumerate(groups) for i in group}
        self._number_rows(groups)
        self._lay_out_panels(_reached(groups, cliques, self.home))

    def _number_rows(self, groups):
        """Set the first row of each node and of each block, and the end."""
        self.rows, self.starts, at = np.zeros(len(self.sizes), np.int64), [], 0
        for group in groups:
            self.starts.append(at)
            for i in group:
                self.rows[i] = at
                at += self.sizes[i]
        self.starts.append(at)
        self.first = self.rows.tolist()

    def _lay_out_panels(self, above):
        """Set where each panel begins, how wide it is, and which runs of rows its columns are."""
        self.heads, self.widths, self.columns, self.segments, self.length = [], [], [0], [], 0
        self.maps = []  # of each panel: where runs of consecutive rows begin, in the eliminated vector and in the panel
        for g, nodes in enumerate(above):
            start, size = self.starts[g], self.starts[g + 1] - self.starts[g]
            froms, places, width = [start], [0], size
            pieces = self._runs(nodes)
            for begin, count in pieces:
                froms.append(begin)
                places.append(width)
                width += count
            self.maps.append((froms, places))
            self.segments += pieces
            self.columns.append(len(self.segments))
            self.heads.append(self.length)
            self.widths.append(width)
            self.length += size * width

    def _runs(self, nodes):
        """Runs of consecutive rows of these nodes: the first row, their number."""
        pieces = []
        for i in sorted(nodes, key=self.first.__getitem__):
            if pieces and sum(pieces[-1]) == self.first[i]:
                pieces[-1][1] += self.sizes[i]
            else:
                pieces.append([self.first[i], self.sizes[i]])
        return pieces

    def _column(self, g, row):
        """Column of a row in the panel of block g."""
        froms, places = self.maps[g]
        # The run of consecutive rows that holds this one
        run = bisect_right(froms, row) - 1
        place = places[run] + row - froms[run]
        if place >= (places[run + 1] if run + 1 < len(places) else self.widths[g]):
            raise KeyError("these nodes are not coupled")
        return place

    def where(self, i, j):
        """Offset, stride and transposition of the block of nodes i and j, see `analyse`."""
        if not self.sizes[i] or not self.sizes[j]:
            return 0, 0, False  # a block without entries
        first = self.first
        transposed = first[i] > first[j]
        if transposed:
            i, j = j, i
        g = self.home[i]
        at = self.heads[g] + (first[i] - self.starts[g]) * self.widths[g] + self._column(g, first[j])
        return at, self.widths[g], transposed

    def _updates(self, g):
        """Records of the products that elimination of block g subtracts from later panels."""
        (froms, places), records = self.maps[g], []
        pieces = [(froms[k], place, end - place) for k, (place, end) in enumerate(_spans(places, self.widths[g])) if k]
        for k, (start, place, count) in enumerate(pieces):
            while count > 0:
                target = bisect_right(self.starts, start) - 1
                taken = min(count, self.starts[target + 1] - start)
                head = self.heads[target] + (start - self.starts[target]) * self.widths[target]
                for run, span, to in self._targets(target, [(start, place, count), *pieces[k + 1 :]]):
                    records.append((place, taken, run, span, head + to, self.widths[target]))
                start, place, count = start + taken, place + taken, count - taken
        return records

    def _targets(self, target, pieces):
        """Runs of columns that are consecutive in a panel and in the target's: where they begin in both, how many."""
        runs = []
        for row, run, span in pieces:
            to = self._column(target, row)
            if runs and runs[-1][2] + runs[-1][1] == to:
                runs[-1][1] += span
            else:
                runs.append([run, span, to])
        return runs

    def pattern(self):
        """The `Pattern`, without negative pivots."""
        updates, records = [0], []
        for g in range(len(self.heads)):
            records += self._updates(g)
            updates.append(len(records))
        shape = self.starts[-1], self.length, self.length + self.starts[-1]
        lists = shape, self.starts, self.heads, self.widths, self.columns, self.segments, updates, records, (), ()
        return Pattern(*(np.array(numbers, np.int64).reshape(-1) for numbers in lists))


def _spans(places, width):
    return zip(places, [*places[1:], width], strict=True)


def _reached(groups, cliques, home):
    """For each group, the set of later nodes that its elimination reaches."""
    waiting = [[] for _ in groups]
    for clique in cliques:
        if clique:
            waiting[min(home[i] for i in clique)].append(clique)
    above = []
    for g, group in enumerate(groups):
        union = set().union(*waiting[g]).difference(group)
        waiting[g] = None
        if union:
            waiting[min(home[i] for i in union)].append(union)
        above.append(union)
    return above


# Symbolic part of the sparse factorisation: fill-reducing ordering and supernodes.
#
# The pattern is symmetric. Rows are grouped into nodes (all constraint rows between two bodies); the nodes at one body
# form a clique. Nodes are eliminated in a fill-reducing order; consecutive nodes with nearly equal remaining patterns
# are merged into one dense block (a supernode).


def analyse(sizes, cliques, late=0):
    """Order the nodes, group them into blocks and lay out the value array.

    Parameters
    ----------
    sizes : sequence of int
        Rows of each node; zero is allowed.
    cliques : iterable of sequences of int
        Nodes that are coupled to one another.
    late : int
        So many nodes, the last ones, are eliminated after all others that they are coupled to. No two of them share a
        clique.

    Returns
    -------
    rows : ndarray of int64, shape (nodes,)
        Where each node's rows begin in the eliminated vector.
    pattern : Pattern
        For the kernels; pattern.shape[2] is the length of a value array, of which the first pattern.shape[1] numbers
        are to be set.
    where : callable
        where(i, j) returns (offset, stride, transposed) of the block of nodes i and j, which must share a clique or be
        the same: entry (r, c) stands at offset + r * stride + c, or, where transposed, at offset + c * stride + r.
        Transposed means below the diagonal. A symmetric matrix needs only one of (i, j) and (j, i). For another,
        blocks that are not transposed go to `upper` and transposed ones to `lower`; a node's own block goes to both,
        to `lower` transposed. KeyError where the nodes are not coupled.
    """
    sizes = [int(size) for size in sizes]
    cliques = [{int(i) for i in clique if sizes[i]} for clique in cliques]
    early = len(sizes) - late
    others = [{i for i in clique if i < early} for clique in cliques] if late else cliques
    order = fill_reducing_order(sizes[:early], [clique for clique in others if len(clique) > 1])
    order = _with_late(order, cliques, early) if late else order
    rows, pattern, where = lay_out_in_order(sizes, cliques, order)
    negative = [row for i in range(early, len(sizes)) for row in range(rows[i], rows[i] + sizes[i])]
    return rows, pattern._replace(negative=np.array(negative, np.int64)), where


def lay_out_in_order(sizes, cliques, order):
    """Group nodes, eliminated in a given order, into blocks; what `analyse` returns, without late nodes.

    cliques are sets without nodes of size zero.
    """
    return lay_out(sizes, cliques, _amalgamate(sizes, order, *_tree(sizes, order, cliques)))


def _with_late(order, cliques, early):
    """The order with each late node behind the last of those that it is coupled to."""
    rank = {i: at for at, i in enumerate(order)}
    behind, alone = {}, []
    for clique in cliques:
        for i in clique:
            if i >= early:
                others = [rank[n] for n in clique if n < early]
                (behind.setdefault(max(others), []) if others else alone).append(i)
    return alone + [i for at, node in enumerate(order) for i in (node, *behind.get(at, ()))]


def fill_reducing_order(sizes, cliques):
    """Order of elimination: nodes in one clique only cost no fill and go first; then by minimum degree."""
    graph = _QuotientGraph(sizes, cliques)
    # Trees vanish entirely here
    graph.peel()
    core = [i for i in range(len(sizes)) if not graph.done[i]]
    # Large cores: SuperLU's ordering is faster
    if len(core) > OWN:
        return graph.order + _minimum_degree(core, graph.members.values())
    # Minimum degree; among equals the one that changed longest ago
    ticket = len(core)
    latest = {i: (graph.degree(i), at) for at, i in enumerate(core)}
    heap = [(*key, i) for i, key in latest.items()]
    heapq.heapify(heap)
    while heap:
        *key, i = heapq.heappop(heap)
        if graph.done[i] or latest[i] != tuple(key):
            continue
        changed = set(graph.eliminate(i)).union(*graph.peel())
        for n in changed:
            if not graph.done[n]:
                ticket += 1
                latest[n] = graph.degree(n), ticket  # behind others of its degree: independent nodes first
                heapq.heappush(heap, (*latest[n], n))
    return graph.order


class _QuotientGraph:
    """Nodes and the cliques that they are in; elimination of a node merges its cliques into one."""

    def __init__(self, sizes, cliques):
        self.sizes, self.members = sizes, dict(enumerate(set(clique) for clique in cliques))
        self.owners = [set() for _ in sizes]
        for name, clique in self.members.items():
            for i in clique:
                self.owners[i].add(name)
        self.order, self.done = [], [size == 0 for size in sizes]
        self.free = deque(i for i, own in enumerate(self.owners) if len(own) < 2 and not self.done[i])

    def degree(self, i):
        """Rows that node i is coupled to."""
        return sum(self.sizes[n] for n in set().union(*(self.members[name] for name in self.owners[i])))

    def peel(self):
        """Eliminate the nodes that are in one clique only, until there are none; the nodes that each one changes."""
        changed = []
        while self.free:
            i = self.free.popleft()
            if not self.done[i]:
                changed.append(self.eliminate(i))
        return changed

    def eliminate(self, i):
        """Eliminate node i; the nodes that are coupled to it."""
        members, owners = self.members, self.owners
        self.done[i] = True
        self.order.append(i)
        names = owners[i]
        if not names:
            return ()
        into = max(names, key=lambda name: len(members[name]))
        union = members[into]
        union.discard(i)
        alone = len(names) == 1
        if not alone:
            self._merge(i, names, into)
        if len(union) == 1:
            for n in union:
                owners[n].discard(into)
            del members[into]
        if alone and len(union) > 1:
            return union  # nobody else has come free
        self.free.extend(n for n in union if len(owners[n]) < 2)
        return union

    def _merge(self, i, names, into):
        """Merge the cliques of these names into one of them, without node i; cliques within it are dropped."""
        members, owners = self.members, self.owners
        union = members[into]
        for name in names:
            if name != into:
                union |= members.pop(name)
        union.discard(i)
        for n in union:
            owners[n] -= names
            owners[n].add(into)
            for name in [name for name in owners[n] if name != into and members[name] <= union]:
                for other in members.pop(name):
                    owners[other].discard(name)


def _minimum_degree(core, cliques):
    """Order many nodes in loops by SuperLU's multiple minimum degree."""
    import scipy.sparse

    at = {i: place for place, i in enumerate(core)}
    rows, columns = [], []
    for clique in cliques:
        places = [at[i] for i in clique]
        rows += [i for i in places for _ in places]
        columns += [i for _ in places for i in places]
    n = len(core)
    graph = scipy.sparse.csc_matrix((np.full(len(rows), -1.0), (rows, columns)), (n, n))
    # Diagonally dominant, so that no pivoting changes the order
    heavy = 1.0 - 2.0 * np.asarray(graph.sum(axis=0)).ravel()
    factors = sparse_lu(
        (graph + scipy.sparse.diags(heavy)).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return [core[i] for i in np.argsort(factors.perm_c)]


def _tree(sizes, order, cliques):
    """Elimination tree of the nodes, and how many rows elimination of each reaches."""
    rank = {i: at for at, i in enumerate(order)}
    waiting = {i: [] for i in order}
    for clique in cliques:
        if clique:
            waiting[min(clique, key=rank.get)].append(clique)
    parent, reach = {}, {}
    for i in order:
        parent[i], reach[i] = -1, 0
        union = set().union(*waiting.pop(i)) - {i}
        if union:
            parent[i] = min(union, key=rank.get)
            reach[i] = sum(sizes[n] for n in union)
            waiting[parent[i]].append(union)
    return parent, reach


@lru_cache(COSTS)
def _cost(size, reach):
    """Nanoseconds, roughly, of factoring a block once and solving with it three times: measured and fitted."""
    if size == reach == 3:
        return LINK_COST
    steps = -(-size // 3)
    numbers = size * reach + size * (size + 1) / 2
    products = sum((size + reach - k) ** 2 for k in range(size)) / 2
    return PIVOTS_COST * steps + NUMBER_COST * numbers + PRODUCT_COST * products + (UPDATE_COST if reach else 0.0)


def _amalgamate(sizes, order, parent, reach):
    """Group nodes into dense blocks where a longer block costs less than two, zeros that it takes in included."""
    groups, rows, cost = {}, {}, {}  # by the last node of each
    children = {i: [] for i in order}
    for i in order:
        groups[i], rows[i], cost[i] = [i], sizes[i], _cost(sizes[i], reach[i])
        # A child joins its parent where one dense block is cheaper than two
        for child in children.pop(i):
            both = _cost(rows[i] + rows[child], reach[i])
            if rows[i] + rows[child] <= WIDEST and both <= cost[i] + cost[child]:
                groups[i] = groups.pop(child) + groups[i]
                rows[i] += rows[child]
                cost[i] = both
        if parent[i] >= 0:
            children[parent[i]].append(i)

    # A whole small tree as one block, where that is cheaper
    root = {}
    for i in reversed(order):
        root[i] = root[parent[i]] if parent[i] >= 0 else i
    whole = {i: [] for i in root.values()}
    for i in groups:
        whole[root[i]].append(i)
    for i, parts in whole.items():
        total = sum(rows[part] for part in parts)
        if len(parts) > 1 and total <= WIDEST and _cost(total, 0) <= LOOKUP * sum(cost[part] for part in parts):
            groups[i] = [node for part in parts for node in groups.pop(part)]
    return list(groups.values())
