"""Panels: where every number of a factor goes, and the products that elimination subtracts.

Block j stores its rows of the upper triangle as one dense row-major panel: its own columns first, then the columns of
later rows that elimination reaches,

    values[heads[j] + r * widths[j] + c],   r < size of j,   c < widths[j] = size of j + rows reached.

Elimination of block j updates the panels of later blocks by products of its columns. The targets are listed here once,
so the kernels in factorisation.py neither search nor allocate.
"""

from bisect import bisect_right
from typing import NamedTuple

import numpy as np


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
    layout = _Layout(sizes, cliques, groups)
    return layout.rows, layout.pattern(), layout.where


class _Layout:
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
