"""Symbolic part of the sparse factorisation: fill-reducing ordering, supernodes, and the address of every entry.

The pattern is symmetric. Rows are grouped into nodes (all constraint rows between two bodies); the nodes at one body
form a clique. Nodes are eliminated in a fill-reducing order; consecutive nodes with nearly equal remaining patterns are
merged into one dense block (a supernode). Block j stores its rows of the upper triangle as one dense row-major panel:
its own columns first, then the columns of later rows that elimination reaches,

    values[heads[j] + r * widths[j] + c],   r < size of j,   c < widths[j] = size of j + rows reached.

Elimination of block j updates the panels of later blocks by products of its columns. The targets are listed here once,
so the kernels in factorisation.py neither search nor allocate.
"""

import heapq
from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np

WIDEST = 24  # rows of a block
OWN = 100  # nodes in loops that are ordered here, without importing scipy.sparse


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
    order = _order(sizes[:early], [clique for clique in others if len(clique) > 1])
    order = _with_late(order, cliques, early) if late else order
    groups = _amalgamate(sizes, order, *_tree(sizes, order, cliques))
    rows, pattern, where = _lay_out(sizes, cliques, groups)
    negative = [row for i in range(early, len(sizes)) for row in range(rows[i], rows[i] + sizes[i])]
    return rows, pattern._replace(negative=np.array(negative, np.int64)), where


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


def _order(sizes, cliques):
    """Order of elimination: nodes in one clique only cost no fill and go first; then by minimum degree."""
    members = dict(enumerate(set(clique) for clique in cliques))
    owners = [set() for _ in sizes]
    for name, clique in members.items():
        for i in clique:
            owners[i].add(name)
    order, done = [], [size == 0 for size in sizes]
    free = deque(i for i, own in enumerate(owners) if len(own) < 2 and not done[i])

    def eliminate(i):
        done[i] = True
        order.append(i)
        names = owners[i]
        if not names:
            return ()
        into = max(names, key=lambda name: len(members[name]))
        union = members[into]
        union.discard(i)
        alone = len(names) == 1
        if not alone:
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
        if len(union) == 1:
            for n in union:
                owners[n].discard(into)
            del members[into]
        if alone and len(union) > 1:
            return union  # nobody else has come free
        free.extend(n for n in union if len(owners[n]) < 2)
        return union

    def peel():
        while free:
            i = free.popleft()
            if not done[i]:
                yield eliminate(i)

    deque(peel(), 0)
    core = [i for i in range(len(sizes)) if not done[i]]
    if len(core) > OWN:
        return order + _minimum_degree(core, members.values())
    ticket = len(core)

    def degree(i):
        return sum(sizes[n] for n in set().union(*(members[name] for name in owners[i])))

    latest = {i: (degree(i), at) for at, i in enumerate(core)}
    heap = [(*key, i) for i, key in latest.items()]
    heapq.heapify(heap)
    while heap:
        *key, i = heapq.heappop(heap)
        if done[i] or latest[i] != tuple(key):
            continue
        changed = set(eliminate(i)).union(*peel())
        for n in changed:
            if not done[n]:
                ticket += 1
                latest[n] = degree(n), ticket  # behind others of its degree: independent nodes first
                heapq.heappush(heap, (*latest[n], n))
    return order


def _minimum_degree(core, cliques):
    """Order many nodes in loops by SuperLU's multiple minimum degree."""
    import scipy.sparse
    import scipy.sparse.linalg

    at = {i: place for place, i in enumerate(core)}
    rows, columns = [], []
    for clique in cliques:
        places = [at[i] for i in clique]
        rows += [i for i in places for _ in places]
        columns += [i for _ in places for i in places]
    n = len(core)
    graph = scipy.sparse.csc_matrix((np.full(len(rows), -1.0), (rows, columns)), (n, n))
    heavy = 1.0 - 2.0 * np.asarray(graph.sum(axis=0)).ravel()
    factors = scipy.sparse.linalg.splu(
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


def _cost(size, reach):
    """Nanoseconds, roughly, of factoring a block once and solving with it three times: measured and fitted."""
    if size == reach == 3:
        return 66.0  # mostly a link of a chain, which has kernels of its own
    steps = -(-size // 3)
    numbers = size * reach + size * (size + 1) / 2
    products = sum((size + reach - k) ** 2 for k in range(size)) / 2
    return 49.0 * steps + 2.4 * numbers + 0.24 * products + (20.0 if reach else 0.0)


def _amalgamate(sizes, order, parent, reach):
    """Group nodes into dense blocks where a longer block costs less than two, zeros that it takes in included."""
    groups, rows, cost = {}, {}, {}  # by the last node of each
    children = {i: [] for i in order}
    for i in order:
        groups[i], rows[i], cost[i] = [i], sizes[i], _cost(sizes[i], reach[i])
        for child in children.pop(i):
            both = _cost(rows[i] + rows[child], reach[i])
            if rows[i] + rows[child] <= WIDEST and both <= cost[i] + cost[child]:
                groups[i] = groups.pop(child) + groups[i]
                rows[i] += rows[child]
                cost[i] = both
        if parent[i] >= 0:
            children[parent[i]].append(i)

    root = {}
    for i in reversed(order):
        root[i] = root[parent[i]] if parent[i] >= 0 else i
    whole = {i: [] for i in root.values()}
    for i in groups:
        whole[root[i]].append(i)
    for i, parts in whole.items():
        total = sum(rows[part] for part in parts)
        # a tenth more: what the parts have to look up isn't in their cost
        if len(parts) > 1 and total <= WIDEST and _cost(total, 0) <= 1.1 * sum(cost[part] for part in parts):
            groups[i] = [node for part in parts for node in groups.pop(part)]
    return list(groups.values())


def _lay_out(sizes, cliques, groups):
    home = {i: g for g, group in enumerate(groups) for i in group}
    above = _reached(groups, cliques, home)
    rows = np.zeros(len(sizes), np.int64)
    starts, at = [], 0
    for group in groups:
        starts.append(at)
        for i in group:
            rows[i] = at
            at += sizes[i]
    starts.append(at)
    first = rows.tolist()

    heads, widths, columns, segments = [], [], [0], []
    maps = []  # of each panel: where runs of consecutive rows begin, in the eliminated vector and in the panel
    length = 0
    for g, nodes in enumerate(above):
        pieces = []
        for i in sorted(nodes, key=first.__getitem__):
            if pieces and sum(pieces[-1]) == first[i]:
                pieces[-1][1] += sizes[i]
            else:
                pieces.append([first[i], sizes[i]])
        size = starts[g + 1] - starts[g]
        froms, places, width = [starts[g]], [0], size
        for start, count in pieces:
            froms.append(start)
            places.append(width)
            width += count
        maps.append((froms, places))
        segments += pieces
        columns.append(len(segments))
        heads.append(length)
        widths.append(width)
        length += size * width

    def column(g, row):
        froms, places = maps[g]
        run = bisect_right(froms, row) - 1
        place = places[run] + row - froms[run]
        if place >= (places[run + 1] if run + 1 < len(places) else widths[g]):
            raise KeyError("these nodes are not coupled")
        return place

    def where(i, j):
        if not sizes[i] or not sizes[j]:
            return 0, 0, False  # a block without entries
        transposed = first[i] > first[j]
        if transposed:
            i, j = j, i
        g = home[i]
        return heads[g] + (first[i] - starts[g]) * widths[g] + column(g, first[j]), widths[g], transposed

    updates, records = [0], []
    for g in range(len(groups)):
        froms, places = maps[g]
        pieces = [(froms[k], place, end - place) for k, (place, end) in enumerate(_spans(places, widths[g])) if k]
        for k, (start, place, count) in enumerate(pieces):
            while count > 0:
                target = bisect_right(starts, start) - 1
                taken = min(count, starts[target + 1] - start)
                head = heads[target] + (start - starts[target]) * widths[target]
                runs = []
                for row, run, span in [(start, place, count), *pieces[k + 1 :]]:
                    to = column(target, row)
                    if runs and runs[-1][2] + runs[-1][1] == to:
                        runs[-1][1] += span
                    else:
                        runs.append([run, span, to])
                for run, span, to in runs:
                    records.append((place, taken, run, span, head + to, widths[target]))
                start, place, count = start + taken, place + taken, count - taken
        updates.append(len(records))

    def pack(numbers):
        return np.array(numbers, np.int64).reshape(-1)

    shape = pack([at, length, length + at])
    return (
        rows,
        Pattern(shape, *map(pack, (starts, heads, widths, columns, segments, updates, records, ()))),
        where,
    )


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
