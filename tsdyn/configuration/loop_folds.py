"""Assembly modes of closed loops: the folds of the links in a sketch, which an assembly has to keep.

At each joint j with an axis n in a loop of constraints, the links to its two neighbours enclose the signed angle

    theta = arcsin( n.(u x v) / |u| |v| )      u, v: from j to the joints before and after

measured from the dead centre. Mirrored assemblies differ in at least one sign. At a spherical joint, n is the axis of a
neighbouring joint; a slide is a joint at infinity, across its direction. A sign of the sketch counts only where the
directions of its links and the positions of its joints agree on it clearly.
"""

from typing import NamedTuple

import numpy as np

from .tolerances import CLEAR, FLAT, POINT_LIKE, SHOWN


class Fold(NamedTuple):
    """Two links of a loop that meet at a joint."""

    title: str
    bodies: tuple  # numbers of the bodies of u and v, the ground's is the last
    u: np.ndarray  # (3,), frame of its body
    v: np.ndarray
    axis: tuple  # body number, direction (3,)
    places: tuple  # the joints before, at and after: (body, point) of both sides; None for a slide


class Folds:
    """The folds of a packed scene; made once."""

    def __init__(self, packed):
        self.folds = list(_folds(packed))

    def drawn(self, metric, q):
        """The signs (k,) that a sketch says: 1, -1, or 0 where it isn't clear."""
        if not self.folds:
            return np.zeros(0)
        links, places = self._angles(metric, q, False), self._angles(metric, q, True)
        clear = (np.abs(links) >= CLEAR) & (np.abs(places) >= CLEAR) & (links * places > 0.0)
        return np.where(clear, np.sign(links), 0.0)

    def shown(self, metric, q):
        """The signs (k,) that the links' directions say by themselves, 0 where they are nearly in line."""
        links = self._angles(metric, q, False)
        return np.where(np.abs(links) >= SHOWN, np.sign(links), 0.0)

    def turned(self, metric, q, drawn):
        """Numbers of the folds that a configuration has to the other side."""
        if not drawn.any():
            return np.zeros(0, int)
        return np.flatnonzero(self._angles(metric, q, False) * drawn < 0.0)

    def angle(self, metric, q, k):
        """Of one fold, rad."""
        return float(self._angles(metric, q, False)[k])

    def _angles(self, metric, q, by_places):
        R = metric.rotations(q)
        r = np.vstack((q[metric.r], np.zeros(3)))
        return np.array([_angle(fold, R, r, by_places) for fold in self.folds])


def _angle(fold, R, r, by_places):
    """From straight, rad, -pi/2 to pi/2."""
    a, b = fold.bodies
    n = R[fold.axis[0]] @ fold.axis[1]
    u, v = R[a] @ fold.u, R[b] @ fold.v
    if by_places:
        before, at, after = (None if sides is None else _joint_position(sides, R, r) for sides in fold.places)
        u, v = (u if before is None else before - at), (v if after is None else after - at)
    size = np.linalg.norm(u) * np.linalg.norm(v)
    return float(np.arcsin(np.clip(n @ np.cross(u, v) / size, -1.0, 1.0))) if size > 0.0 else 0.0


def _joint_position(sides, R, r):
    """Where a joint is: midway between its two sides."""
    return sum(r[body] + R[body] @ point for body, point in sides) / len(sides)


class _Edge(NamedTuple):
    """A constraint that holds a point of one body to a point, or a line, of another."""

    title: str
    ends: tuple  # body numbers
    points: dict  # body number -> point (3,)
    axis: dict  # body number -> the direction about which it turns, for a joint with one
    slide: dict  # body number -> the direction of a slide
    meets: bool  # whether its points coincide


def _edges(packed):
    number = {id(body): i for i, body in enumerate(packed.bodies)}
    ground = len(packed.bodies)
    for member in packed.members:
        constraint = member.constraint
        if constraint.b is None:
            continue
        ends = tuple(number.get(id(body), ground) for body in (constraint.a, constraint.b))
        letters, points = dict(zip("ab", ends, strict=True)), {}
        for marker, place in zip(constraint.markers, member.coordinates, strict=True):
            if marker.prefix == "point_":
                points.setdefault(letters[marker.body], place)
        kinds = [type(part).__name__ for part in constraint.parts]
        held = "Spherical" in kinds
        if len(points) < 2 or not (held or "Distance" in kinds or kinds.count("Dot2") >= 2):
            continue
        pairs = getattr(constraint, "opposed", ())
        directions = [{number.get(id(body), ground): u for body, u in pair} for pair in pairs]
        axis = directions[0] if len(directions) == 1 else {}
        slide = directions[0] if len(directions) > 1 and not held else {}
        yield _Edge(constraint.title, ends, points, axis, slide, "Distance" not in kinds)


def _loops(edges, count):
    """Loops of the graph of bodies, each a list of edges: one for each edge off a tree from the ground."""
    near = [[] for _ in range(count)]
    for i, edge in enumerate(edges):
        for k in (0, 1):
            near[edge.ends[k]].append((i, edge.ends[1 - k]))
    above, tree = {}, set()
    for root in (count - 1, *range(count - 1)):
        if root in above:
            continue
        above[root], queue = None, [root]
        for body in queue:
            for i, other in near[body]:
                if other not in above:
                    above[other] = (i, body)
                    tree.add(i)
                    queue.append(other)
    for i, edge in enumerate(edges):
        if i not in tree:
            yield from _loop(i, edge, above)


def _loop(i, edge, above):
    """The loop that an edge closes; none where it is beside another edge of the same two bodies."""
    paths = []
    for end in edge.ends:
        path, body = [], end
        while above[body] is not None:
            path.append((above[body][0], body))
            body = above[body][1]
        paths.append(path)
    while paths[0] and paths[1] and paths[0][-1] == paths[1][-1]:
        paths[0].pop(), paths[1].pop()
    if len(paths[0]) + len(paths[1]) < 2:
        return
    # from the first end up to where both paths meet, down to the second end, and back over the edge
    yield [j for j, _ in paths[0]] + [j for j, _ in reversed(paths[1])] + [i]


def _folds(packed):
    edges = list(_edges(packed))
    seen = set()
    for joints in _loops(edges, len(packed.bodies) + 1):
        ring = [edges[j] for j in joints]
        for k, edge in enumerate(ring):
            before, after = ring[k - 1], ring[(k + 1) % len(ring)]
            a, b = _shared(before, edge), _shared(edge, after)
            if not edge.meets or edge.slide or None in (a, b) or a == b:
                continue
            for axis in _axes(edge, before, after, a, b):
                u, v = _link(edge, before, a, axis), _link(edge, after, b, axis)
                key = (joints[k], *sorted((joints[k - 1], joints[(k + 1) % len(ring)])), axis[0])
                if u is None or v is None or key in seen:
                    continue
                seen.add(key)
                places = tuple(_sides(e, body) for e, body in ((before, a), (edge, None), (after, b)))
                yield Fold(edge.title, (a, b), u, v, axis, places)


def _shared(one, other):
    """The body that two edges next to each other have in common."""
    common = set(one.ends) & set(other.ends)
    return common.pop() if len(common) == 1 else None


def _axes(edge, before, after, a, b):
    """About which axes links fold there: (body, direction)."""
    if edge.axis:
        return [(a, edge.axis[a])]
    return [(body, near.axis[body]) for near, body in ((before, a), (after, b)) if near.axis]


def _link(edge, near, body, axis):
    """From a joint to the one next to it, in the frame of the body between; None where there is none."""
    if near.slide:
        n = edge.axis.get(body)
        across = None if n is None else np.cross(n, near.slide[body])
        return across if across is not None and np.linalg.norm(across) > FLAT else None
    link = near.points[body] - edge.points[body]
    return link if np.linalg.norm(link) > POINT_LIKE else None


def _sides(edge, body):
    """Where a joint is, by its two sides; a rod's end, by the body that it is on; None for a slide."""
    if edge.slide:
        return None
    if edge.meets:
        return tuple(edge.points.items())
    return ((body, edge.points[body]),)
