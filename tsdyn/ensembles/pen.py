"""Numbers of the cases of a chunk: checked, laid out as rows of a table, and where each of them is written to.

A value that is not admissible, or asks for more than numbers, makes its case one that doesn't fit: it is entered as a
packed scene, which says what is wrong with it.
"""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..elements.bodies import PointMass
from .body_columns import WEIGHTS, GravityColumns, InertiaColumns, MassColumns, StateColumns
from .copied_columns import ConstraintColumns, ForceColumns
from .geometry_columns import GeometryColumns
from .weights import Weights


class Place(NamedTuple):
    """Words of a row of the table, and the array that they are written to."""

    to: np.ndarray  # (words,) float64, a view
    column: int


def pen_of(arena, names):
    """The `Pen` for these parameters of all cases; None if there is one of a constraint or function, or none at all."""
    family, owners = arena.study.family, {}
    for name in names:
        field = family.field(name)
        if field.keyword:
            return None
        owners.setdefault(id(field.owner), (field.owner, {}))[1][field.attribute] = name
    constraints = [(owner, changed) for owner, changed in owners.values() if id(owner) in family.members]
    if not owners or (constraints and not _are_numbers(arena, constraints)):
        return None
    pen = Pen(arena, owners.values())
    return pen if all(columns.serves for columns in pen.constraints) else None


def _are_numbers(arena, constraints):
    """Whether no more than numbers can follow from what differs of constraints, and runs need none of it beside."""
    family, kept = arena.study.family, arena.kept
    if not arena.is_brief or kept.packed.system.memory.size or not kept.handles.begin_at_zero:
        return False
    return not any(family.is_structural(owner, changed) for owner, changed in constraints)


class Pen:
    """Checks the values of a chunk, and writes the numbers of one case after the other.

    Attributes
    ----------
    written : set of str
        The arrays of a `System` that it writes to.
    moves : bool
        Whether starts differ.
    fits : ndarray of bool (k,)
        Which cases of the chunk are written; the others must be entered in another way.
    numbers : ndarray (k, width)
    starts : ndarray (k, 2, n)
        q, qd of each case; of all, (1, 2, n), where starts don't differ.
    """

    def __init__(self, arena, owners):
        self.arena, self._parts, self._known = arena, [], ([], [])
        self._weights = Weights(arena.base, arena.is_unequal)
        for owner, names in owners:
            self._parts += self._parts_of(owner, names)
        self.constraints = [part for part in self._parts if isinstance(part, ConstraintColumns)]
        self.geometry, at = None, 0
        if self.constraints:
            self._follow_levers()
            tol = arena.study.options.constraint_tol
            self.geometry = GeometryColumns(arena.study.family, self.constraints, self._weights, tol)
            self._parts.append(self.geometry)
        for part in self._parts:
            part.column, at = at, at + part.width
        self.width, self.written = at, {name for part in self._parts for name in part.written}
        self.moves = any(isinstance(part, StateColumns) for part in self._parts)

    def _parts_of(self, owner, names):
        family = self.arena.study.family
        if owner is family.template:
            return [GravityColumns(names["gravity"])]
        if not isinstance(owner, PointMass):
            kind = ConstraintColumns if family.load_of(owner) is None else ForceColumns
            return [kind(family, owner, names)]
        parts = []
        if "mass" in names:
            parts.append(MassColumns(owner, names["mass"], self._weights))
        if "inertia" in names:
            parts.append(InertiaColumns(owner, names["inertia"], self._weights))
        moved = {attribute: name for attribute, name in names.items() if attribute not in WEIGHTS}
        return [*parts, StateColumns(owner, moved, self.arena)] if moved else parts

    def take(self, values, count):
        """Lay out the values of so many cases: arrays (count, ...) by name."""
        self.fits, self.numbers = np.ones(count, bool), np.zeros((count, self.width))
        self.starts = np.empty((count if self.moves else 1, 2, self.arena.study.n))
        self.starts[:] = self.arena.study.family.start
        if any(array.dtype != float for array in values.values()):
            self.fits[:] = False
            return
        with np.errstate(all="ignore"):
            for part in self._parts:
                columns = slice(part.column, part.column + part.width)
                self.fits &= part.fill(values, self.numbers[:, columns], self.starts)
            if self.geometry is not None:
                self._weights.far = dict(self._far)
                columns = slice(self.geometry.column, self.geometry.column + 2)
                self.fits &= self.geometry.fit(self.numbers[:, columns], self.numbers, self.starts)
            self.fits &= self._weights.fit(count)

    def _follow_levers(self):
        """Look after the inertia of all bodies that a point of a constraint is on."""
        for columns in self.constraints:
            for body, _ in columns.points:
                if isinstance(body, PointMass):
                    self._weights.follow(body)
        self._far = dict.fromkeys(self._weights.far, 0.0)

    def size(self, k):
        """The size of the scene in case k of the chunk; None where it is that of the base."""
        return None if self.geometry is None else float(self.numbers[k, self.geometry.column])

    def places_in(self, reals):
        """Those of numbers of constraints, in an array like `System.reals`."""
        system = SimpleNamespace(reals=reals)
        found = [(part, place) for part in self.constraints for place in part.places([system], [])]
        return [Place(to[begin : begin + words], part.column + at) for part, (to, begin, words, at) in found]

    def places(self):
        """All `Place`s, in the arrays of the arena and of its runs."""
        systems, graphs = self.arena.systems(), self.arena.graphs()
        if not (_same(systems, self._known[0]) and _same(graphs, self._known[1])):
            self._known, self._places = (systems, graphs), []
            for part in self._parts:
                for array, begin, words, at in part.places(systems, graphs):
                    to = array.reshape(-1).view(float)[begin : begin + words]
                    self._places.append(Place(to, part.column + at))
        return self._places

    def write(self, k):
        """Write the numbers of case k of the chunk; its start, or None if it must be entered in another way."""
        if not self.fits[k]:
            return None
        row = self.numbers[k]
        for to, column in self.places():
            to[...] = row[column : column + to.size]
        return (self.starts[k, 0], self.starts[k, 1]) if self.moves else self.arena.study.family.start


def _same(arrays, known):
    return len(arrays) == len(known) and all(a is b for a, b in zip(arrays, known, strict=True))
