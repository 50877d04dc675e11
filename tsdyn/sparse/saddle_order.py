"""Order of elimination of the saddle-point matrix of bodies and constraint rows.

    [ A    H^T ]      A: blocks of bodies and of pairs of bodies that forces or constraints couple
    [ H    0   ]

The diagonal blocks of the rows are zero, so rows follow bodies. When bodies E and rows R have been eliminated, the
pivots of R are -H_RE A_E^-1 H_RE^T: regular if the rows R are independent with all other bodies held fast. Rows depend
on relative motion alone. So a connected set of bodies and rows keeps the independence that it has in the whole system
as long as at most one body outside of the set, or the ground, is joined to it: its anchor. Bodies are ordered for least
fill; rows between two bodies are eliminated as soon as the set that they make has one anchor at most. In a tree these
are the rows of a body's joint to its parent, right behind the body. Rows that close a loop wait for the loop. Axis rows
(massless_axes.py) follow the last rows at their body, which hold the axis.
"""

from .symbolic import fill_reducing_order

GROUND = -1


def order_saddle(bodies, pairs, joined, lean=()):
    """Return the order of elimination of bodies and rows.

    Parameters
    ----------
    bodies : list of int
        Degrees of freedom of each body.
    pairs : list of (int, int)
        The two bodies, or GROUND, of each set of rows.
    joined : list of (int, int)
        Pairs of bodies that forces couple.
    lean : list of int
        The body of each set of axis rows.

    Returns
    -------
    list of int
        Nodes: a body by its number, set i of rows as len(bodies) + i; then the sets of axis rows.
    """
    cliques = {tuple(sorted(pair)) for pair in (*pairs, *joined) if GROUND not in pair and pair[0] != pair[1]}
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
