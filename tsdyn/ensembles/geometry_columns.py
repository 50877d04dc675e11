"""What follows from points of constraints, where these differ from case to case."""

import numpy as np

from ..elements.bodies import Ground
from ..elements.markers import POINT
from ..model.lengths import SMALL, is_small
from ..simulation.local_origin import are_within
from ..sparse.massless_axes import lean_bodies


class GeometryColumns:
    """The size of the scene in each case, and the bound on |Phi| that follows from it.

    Parameters
    ----------
    family : Family
    constraints : list of ConstraintColumns
    weights : Weights
        Is told the longest levers on each body.
    tol : float
        The constraint tolerance of runs.
    """

    width, written = 2, ()

    def __init__(self, family, constraints, weights, tol):
        self._family, self._constraints, self._weights, self._tol = family, constraints, weights, tol
        packed, varied = family.packed, {i for columns in constraints for i in columns.parts}
        self._lean = bool(lean_bodies(packed))
        self._reaches = [pair for i, pair in enumerate(family.reaches) if i not in varied]
        for i in varied:  # what is no point stays
            pairs = zip(packed.constraints[i].markers, packed.coordinates[i], strict=True)
            self._reaches += [(0.0, float(np.abs(s).max())) for marker, s in pairs if marker.code != POINT]
        items = [(c, x) for i, (c, x) in enumerate(zip(packed.constraints, packed.coordinates, strict=True))
                 if i not in varied]  # fmt: skip
        self._points = list(_points_of(items))
        self._loaded = list(_points_of((load.force, load.coordinates) for load in packed.loads))
        self._bodies = {id(body): i for i, body in enumerate(packed.bodies)}

    def fill(self, values, numbers, starts):
        """Nothing yet: the numbers of constraints come first."""
        return True

    def places(self, systems, graphs):
        """None in systems: runs and starts have them."""
        return []

    def fit(self, numbers, table, starts):
        """Write sizes and bounds; which cases ask for no more than numbers. table: those of all columns."""
        found = [(body, table[:, columns.column + at : columns.column + at + 3])
                 for columns in self._constraints for body, at in columns.points]  # fmt: skip
        points = found + [(body, s[None]) for body, s in self._points]
        length, whole = (np.full(len(numbers), max((pair[n] for pair in self._reaches), default=0.0)) for n in (0, 1))
        for _, s in found:
            most = np.abs(s).max(axis=1)
            length, whole = np.maximum(length, most), np.maximum(whole, most)
        small = (length > 0.0) & (length < SMALL)
        size = np.where(small, length, whole)
        numbers[:, 0], numbers[:, 1] = size, np.where((size > 0.0) & (size < 1.0), self._tol * size, self._tol)
        self._enter_levers(points)
        fits = small == is_small(self._family.packed.size)
        return fits & (not self._lean) & self._are_near(points, starts)

    def _enter_levers(self, points):
        for body, s in points:
            i = self._bodies.get(id(body))
            if i in self._weights.far:
                self._weights.far[i] = np.maximum(self._weights.far[i], (s * s).sum(axis=1))

    def _are_near(self, points, starts):
        points = points + [(body, s[None]) for body, s in self._loaded]
        grounded = [s for body, s in points if isinstance(body, Ground)]
        others = [np.abs(s).max(axis=1) for body, s in points if not isinstance(body, Ground)]
        longest = np.max(np.broadcast_arrays(0.0, *others), axis=0)
        return are_within(self._family.packed, starts[:, 0], grounded, longest)


def _points_of(items):
    for item, coordinates in items:
        for marker, s in zip(item.markers, coordinates, strict=True):
            if marker.code == POINT:
                yield item.body_of(marker), s
