"""Where joints and forces attach to bodies, and how large things are: what symbols are scaled by."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..elements.markers import POINT
from .body_shapes import solid_of

SAME = 1e-9  # distance of points that are one, per reach
PER_MOTION = 0.1  # reach of a lone point mass, per extent of the motion


class Attached(NamedTuple):
    """A constraint or force with its places; a and b are indices of bodies, -1: ground, or no second body."""

    item: Any
    a: int
    b: int
    places: dict[str, Any]  # argument of each marker -> coordinates (3,), frame of its body
    points: dict[str, Any]  # "a", "b" -> the first point there; absent where it has none

    def point(self, letter: str) -> Any:
        """The first point on a body, its centroid where there is none."""
        return self.points.get(letter, np.zeros(3))


def attached(packed: Any) -> tuple[list[Attached], list[Attached]]:
    """Constraints, without the normalisations, and forces of a packed scene."""
    index = {id(body): i for i, body in enumerate(packed.bodies)}

    def one(item, coordinates):
        points = {m.body: s for m, s in reversed([*zip(item.markers, coordinates, strict=True)]) if m.code == POINT}
        places = {m.argument: s for m, s in zip(item.markers, coordinates, strict=True)}
        return Attached(item, index.get(id(item.a), -1), index.get(id(item.b), -1), places, points)

    constraints = [one(member.constraint, member.coordinates) for member in packed.members]
    constraints = [each for each in constraints if not getattr(each.item, "normalises", False)]
    return constraints, [one(load.force, load.coordinates) for load in packed.loads]


def joint_points(items: list[Attached], count: int) -> list[list[Any]]:
    """For each body the different points where something attaches."""
    found: list[list[Any]] = [[] for _ in range(count)]
    for each in items:
        for index, letter in ((each.a, "a"), (each.b, "b")):
            if index >= 0 and letter in each.points:
                found[index].append(each.points[letter])
    return [_different(points) for points in found]


def _different(points):
    kept: list[Any] = []
    for point in points:
        if all(np.linalg.norm(point - other) > SAME * (1.0 + np.linalg.norm(point)) for other in kept):
            kept.append(point)
    return kept


def reaches(packed: Any, points: list[list[Any]], position: Any) -> Any:
    """How far each body reaches from its centroid, m: to its farthest joint, or as its inertia does.

    Of point masses, the median of the rigid bodies' reaches, or a part of the extent of the motion.
    """
    reach = np.zeros(len(packed.bodies))
    for i, body in enumerate(packed.bodies):
        reach[i] = max((float(np.linalg.norm(point)) for point in points[i]), default=0.0)
        if reach[i] == 0.0 and body.dimension == 7:
            reach[i] = solid_of(packed.system.mass[i], packed.system.inertia[i].reshape(3, 3)).extent
    if (reach > 0.0).any():
        rest = float(np.median(reach[reach > 0.0]))
    else:
        rest = PER_MOTION * float(np.ptp(position.reshape(-1, 3), axis=0).max()) or 1.0
    return np.where(reach > 0.0, reach, rest)
