"""Constraints that can't be met together: the fewest of which inequalities prove it, or those that were left open.

Distances of points, and angles of directions, obey the triangle inequality. On a body they are known; constraints give
bounds of them:

    Spherical, Distance    d(x_a, x_b) = 0, L       Dot2    d(x_a, x_b) >= |c|
    Dot1                   angle(a, b) = arccos c    directions that a joint aligns    angle = 0

Two points that are further apart than a way over other bounds is long are a conflict; of the ways with a violation that
over the fewest constraints is found first.
"""

import numpy as np

from ..constraints.distance import Distance
from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..constraints.spherical import Spherical
from ..elements.bodies import rotation_matrix
from ..errors import InconsistentState
from ..motions.prescribed import Motion
from .tolerances import MOST_NODES, NAMED_SHARE, PROVED, SHOWN_CONSTRAINTS


class Bounds:
    """Nodes (points, or directions) on bodies, and bounds of their distances from each other."""

    def __init__(self, distance, most=np.inf):
        self.distance, self.most, self.edges = distance, most, []
        self.nodes = {}  # number by (body, *coordinates in its frame)

    def node(self, owner, place):
        """The number of a node."""
        return self.nodes.setdefault((owner, *np.asarray(place, float).tolist()), len(self.nodes))

    def add(self, member, one, other, lower, upper):
        """Bounds of the distance of two nodes by a member."""
        self.edges.append((member, one, other, lower, upper))

    def violation(self):
        """(members, lower, upper) of a contradiction of the fewest constraints; None where there is none."""
        if not 0 < len(self.nodes) <= MOST_NODES:
            return None
        table = np.array(list(self.nodes))
        owners, places = table[:, 0], table[:, 1:]
        inner = np.full(2 * owners.shape, np.inf)
        groups = [np.flatnonzero(owners == owner) for owner in np.unique(owners)]
        for group in groups:
            inner[np.ix_(group, group)] = self.distance(places[group][:, None], places[group][None])
        known = np.where(inner < self.most, inner, 0.0)  # at least; opposite directions are those of other edges, too
        allowed = PROVED * max(1.0, float(known.max()))
        ways = [inner]  # of up to so many constraints
        while True:
            for i, j in np.argwhere(known > ways[-1] + allowed)[:1]:
                return self._found(self._way(ways, inner, i, j), known[i, j], ways[-1][i, j])
            for k, (_, i, j, lower, _) in enumerate(self.edges if len(ways) > 1 else ()):
                if lower > ways[-2][i, j] + allowed:
                    return self._found({k} | self._way(ways[:-1], inner, i, j), lower, ways[-2][i, j])
            if len(ways) > 1 and not (ways[-1] < ways[-2]).any():
                return None
            ways.append(self._longer(ways[-1], inner, groups))

    def _found(self, used, lower, upper):
        return list({id(self.edges[k][0]): self.edges[k][0] for k in sorted(used)}.values()), float(lower), float(upper)

    def _longer(self, way, inner, groups):
        """The shortest ways over one constraint more."""
        found = way.copy()
        for _, i, j, _, upper in self.edges:
            if np.isfinite(upper):
                found[:, j] = np.minimum(found[:, j], way[:, i] + upper)
                found[:, i] = np.minimum(found[:, i], way[:, j] + upper)
        reached = found.copy()
        for group in groups:
            for node in group:
                found[:, group] = np.minimum(found[:, group], reached[:, node, None] + inner[node, group])
        return found

    def _way(self, ways, inner, i, j):
        """The numbers of the edges on the shortest way from i to j."""
        used = set()
        for before, now in zip(ways[-2::-1], ways[:0:-1], strict=True):
            if now[i, j] < before[i, j]:
                _, k, j = min(
                    (before[i, a] + upper + inner[b, j], k, a)
                    for k, (_, one, other, _, upper) in enumerate(self.edges)
                    for a, b in ((one, other), (other, one))
                )
                used.add(k)
        return used


def proved(metric, q):
    """(members, sentence) of a conflict that no configuration can avoid; None where none is proved."""
    packed, held = metric.packed, metric.held
    index, starts = {id(body): i for i, body in enumerate(packed.bodies)}, metric.at
    points, directions = Bounds(_distance), Bounds(_angle, np.pi - PROVED)

    def node(bounds, body, place, turns):
        """On a body; of one that is held, and of the ground, in the ground frame."""
        i, place = index.get(id(body), -1), np.asarray(place, float)
        if i < 0 or not held[i]:
            return bounds.node(i, place)
        A = rotation_matrix(q[starts[i] + 3 : starts[i] + 7]) if metric.rigid[i] else np.eye(3)
        return bounds.node(-1, A @ place if turns else q[metric.r[i]] + A @ place)

    def angle(member, one, other, value):
        """Directions, and their opposites."""
        pairs = [[node(directions, body, sign * np.asarray(u), True) for sign in (1, -1)] for body, u in (one, other)]
        (a, back_a), (b, back_b) = pairs
        for i, j, size in (
            (a, b, value),
            (back_a, back_b, value),
            (a, back_b, np.pi - value),
            (back_a, b, np.pi - value),
        ):
            directions.add(member, i, j, size, size)

    for member in packed.members:
        for k in range(member.parts.start, member.parts.stop):
            part, places = packed.constraints[k], packed.coordinates[k]
            markers = {
                marker.argument: (part.body_of(marker), s) for marker, s in zip(part.markers, places, strict=True)
            }
            value = [x.value(metric.t)[0] if isinstance(x, Motion) else float(x) for x in packed.parameters[k][:1]]
            if isinstance(part, (Spherical, Distance, Dot2)):
                a, b = (node(points, *markers[name], False) for name in ("point_a", "point_b"))
                size = abs(value[0]) if value else 0.0
                points.add(member, a, b, size, np.inf if isinstance(part, Dot2) else size)
            elif isinstance(part, Dot1):
                angle(member, markers["axis_a"], markers["axis_b"], float(np.arccos(np.clip(value[0], -1.0, 1.0))))
        for pair in getattr(member.constraint, "opposed", ()):
            sides = [(body, u(metric.t) if callable(u) else u) for body, u in pair]
            angle(member, *sides, 0.0)
    for bounds, what in (
        (points, "points at least {:.9g} m and at most {:.9g} m apart"),
        (directions, "directions at least {:.9g} rad and at most {:.9g} rad apart"),
    ):
        found = bounds.violation()
        if found:
            return found[0], f"two {what.format(*found[1:])} are required"
    return _held(metric, q, held, index)


def _held(metric, q, held, index):
    """A constraint between bodies that are held, which isn't met."""
    Phi = np.abs(metric.arrays(q)[0])
    for member in metric.packed.members:
        bodies = {part.body_of(marker) for part in member.constraint.parts for marker in part.markers}
        fixed = all(index.get(id(body), -1) < 0 or held[index[id(body)]] for body in bodies)
        if fixed and bodies and Phi[member.rows].max() > PROVED * (1.0 + np.abs(q).max()):
            return [member], "its bodies are held where it isn't met"
    return None


def _distance(x, y):
    return np.linalg.norm(x - y, axis=-1)


def _angle(u, v):
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=-1), (u * v).sum(axis=-1))


def refuse(scene, metric, found, conflict, starts, held=()):
    """Raise InconsistentState that names the constraints in conflict, or those left open, also as `.constraints`."""
    members = [member for member in metric.packed.members if not getattr(member.constraint, "normalises", False)]
    left = np.zeros(len(metric.packed.system.segments))
    left[metric.own] = np.abs(found.Phi)
    sizes = np.array([left[member.rows].max() for member in members])
    where = f" with {', '.join(body.name for body in held)} held fixed" if len(held) else ""
    chosen = [member for member, size in zip(members, sizes, strict=True) if size > NAMED_SHARE * sizes.max()]
    if conflict:
        chosen, reason = conflict
        alone = "This constraint is infeasible on its own" if len(chosen) == 1 else f"These {len(chosen)} conflict"
        story = f"no configuration satisfies all constraints{where}. {alone}: {reason}"
        remedy = "Change a length, point or axis of one of them, or remove one"
    else:
        tried = (
            f"{starts} starts{where}, the sketch and displacements of its joints"
            if starts > 1
            else f"the sketch{where}"
        )
        story = f"not assembled from {tried}. No conflict is proved; the smallest residuals found are"
        remedy = "Improve the sketch of the bodies, or give values of joints from which to start, joints={name: value}"
    names, lines = scene.row_names(), []
    for member in sorted(chosen, key=lambda member: -left[member.rows].max())[:SHOWN_CONSTRAINTS]:
        row = member.rows.start + int(np.argmax(left[member.rows]))
        lines.append(f"  {member.constraint.title}: |Phi| = {left[row]:.3g} in {names[row]}")
    if len(chosen) > SHOWN_CONSTRAINTS:
        lines.append(f"  ... and {len(chosen) - SHOWN_CONSTRAINTS} more")
    error = InconsistentState(
        f"{story}:\n" + "\n".join(lines) + f"\n{remedy}" + ("; or hold fewer bodies." if len(held) else ".")
    )
    error.constraints = tuple(member.constraint for member in chosen)
    raise error
