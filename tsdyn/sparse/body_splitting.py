"""Body splitting: a body with many joints (a hub) couples all their rows into one dense block of S.

A hub is split into a tree of parts, each welded to its parent by as many rows as the body has degrees of freedom; mass
and inertia are distributed over the parts. Few rows meet at a part, so the graph is as sparse as a tree of bodies. The
system is equivalent: welded parts move as one body, so S = H W H^T of the parts, with zeros on the right-hand side for
the welds, gives the multipliers of the undivided body. S of the parts is positive definite wherever the rows are
independent; each level of the tree carries an equal share of the mass, which keeps S well conditioned.

Constraints are assigned to parts along a traversal of the rest of the scene, so that constraints close to each other
in the graph meet at neighbouring parts.
"""

from typing import NamedTuple

from .tolerances import FAN, LARGEST, LEAF


class Part(NamedTuple):
    """A part of a hub."""

    body: int
    scale: float  # of the hub's mass over its own
    nodes: list  # that meet there
    welds: list  # pairs: the node of a weld, its sign on this part


def cut(pairs, sizes, degrees):
    """Cut the hubs of a graph.

    Parameters
    ----------
    pairs : sequence of (int, int)
        The bodies of each node (all rows between two bodies); one of them may be the ground, -1.
    sizes : list of int
        Rows of each node; those of the welds, which are nodes too, are appended.
    degrees : sequence of int
        Degrees of freedom of each body, 6 or 3.

    Returns
    -------
    list of Part
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
        level = [Part(hub, float(len(levels) * count), [] if below else leaves[i], []) for i in range(count)]
        for i, part in enumerate(below):
            weld, above = len(sizes), level[i * count // len(below)]
            sizes.append(degrees)
            part.welds.append((weld, 1))
            above.welds.append((weld, -1))
        parts += level
        below = level
    return parts
