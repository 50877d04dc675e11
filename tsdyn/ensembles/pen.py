"""Numbers of the cases of a chunk: checked, laid out as rows of a table, and where each of them is written to.

A value that is not admissible, or asks for more than numbers, makes its case one that doesn't fit: it is entered as a
packed scene, which says what is wrong with it.
"""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..elements.bodies import PointMass
from ..sparse.massless_axes import lean_bodies, levers
from ..sparse.tolerances import THIN
from ..taylor.tolerances import LIGHT
from .columns import inertias, masses, orientations, parameter_rates, vectors
from .copied_columns import ConstraintColumns, ForceColumns
from .geometry_columns import GeometryColumns

WEIGHTS = {"mass", "inertia"}


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
            self._follow_levers(owners)
            tol = arena.study.options.settings.constraint_tol
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

    def _follow_levers(self, owners):
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


class GravityColumns:
    """The acceleration of free fall of each case.

    As each sort of columns it has `width`, the numbers of a case; `fill`, which checks and writes them and says which
    cases fit; and `places`: arrays, where a part of them begins, how many words, from which number on.
    """

    width, written = 3, ("gravity",)

    def __init__(self, name):
        self.name = name

    def fill(self, values, numbers, starts):
        """Gravity as it is."""
        numbers[:], fits = vectors(values[self.name])
        return fits

    def places(self, systems, graphs):
        """Gravity of each system."""
        return [(system.gravity, 0, 3, 0) for system in systems]


class MassColumns:
    """m and 1 / m of a body."""

    width, written = 2, ("mass",)

    def __init__(self, body, name, weights):
        self.i, self.name, self.weights = body.index, name, weights
        weights.follow(body)

    def fill(self, values, numbers, starts):
        """Mass and its inverse."""
        m, fits = masses(values[self.name])
        numbers[:, 0], numbers[:, 1] = m, 1.0 / m
        self.weights.masses[self.i] = m
        return fits

    def places(self, systems, graphs):
        """In each system and constraint graph."""
        found = [(system.mass, self.i, 1, 0) for system in systems]
        for graph in graphs:
            found += [(graph.mass, 16 * self.i, 1, 0), (graph.inverse, 16 * self.i, 1, 1)]
        return found


class InertiaColumns:
    """J' and its inverse, and whether the body has a gyroscopic torque, as a word."""

    width, written = 19, ("inertia",)

    def __init__(self, body, name, weights):
        self.i, self.name, self.weights = body.index, name, weights
        weights.follow(body)

    def fill(self, values, numbers, starts):
        """Inertia, its inverse, and whether it is that of a sphere."""
        J, fits = inertias(values[self.name])
        moments = np.linalg.eigh(J)[0]
        fits &= moments[:, 0] > THIN * moments[:, 2]
        numbers[:, :9] = J.reshape(-1, 9)
        J = np.where(fits[:, None, None], J, np.eye(3))
        numbers[:, 9:18] = np.linalg.inv(J).reshape(-1, 9)
        spins = (J[:, :1, :1] * np.eye(3) != J).any(axis=(1, 2))
        numbers[:, 18] = spins.astype(np.int64).view(float)
        self.weights.moments[self.i], self.weights.inertias[self.i] = moments, np.abs(J).max(axis=(1, 2))
        return fits

    def places(self, systems, graphs):
        """In each system, and in each graph in which the orientation isn't locked."""
        i = self.i
        found = [(system.inertia, 9 * i, 9, 0) for system in systems]
        for graph in graphs:
            if graph.bodies[i, 1] == 7:
                for row in range(3):
                    found.append((graph.mass, 16 * i + 4 * (row + 1), 3, 3 * row))
                    found.append((graph.inverse, 16 * i + 4 * (row + 1), 3, 9 + 3 * row))
                found.append((graph.spins, i, 1, 18))
        return found


class StateColumns:
    """The start of a body, which is no number of a system."""

    width, written = 0, ()

    def __init__(self, body, names, arena):
        self.names, self.values = names, body.values
        self.at, length = arena.base.system.bodies[body.index].tolist()
        self.turns = length == 7

    def fill(self, values, numbers, starts):
        """q and qd of the body in the starts of all cases."""
        fits, kept = True, {}
        for attribute, name in self.names.items():
            kept[attribute], good = (orientations if attribute == "orientation" else vectors)(values[name])
            fits = fits & good
        at, q, qd = self.at, starts[:, 0], starts[:, 1]
        if "position" in kept:
            q[:, at : at + 3] = kept["position"]
        if "velocity" in kept:
            qd[:, at : at + 3] = kept["velocity"]
        if self.turns and not kept.keys().isdisjoint(("orientation", "angular_velocity")):
            p, w = (
                kept[name] if name in kept else np.tile(self.values[name], (len(starts), 1))
                for name in ("orientation", "angular_velocity")
            )
            q[:, at + 3 : at + 7], qd[:, at + 3 : at + 7] = p, parameter_rates(p, w)
        return fits

    def places(self, systems, graphs):
        """None: starts are no part of a system."""
        return []


class Weights:
    """Whether masses and inertias of the cases ask for no other equations than those of the arena.

    They do where a body has next to no inertia about an axis (`massless_axes.lean_bodies`), or where masses become
    unequal (`taylor.run_memory.are_unequal`).
    """

    def __init__(self, base, is_unequal):
        self._base, self._is_unequal, self.far, self._thin = base, is_unequal, {}, False
        self._moments = np.linalg.eigh(base.system.inertia.reshape(-1, 3, 3))[0]
        self.masses, self.moments, self.inertias = {}, {}, {}  # by body, of each case

    def follow(self, body):
        """Look after a body whose mass or inertia differs."""
        if body.dimension == 7:
            self.far[body.index] = float(levers(self._base)[body.index] ** 2)
            self._thin |= body.index in lean_bodies(self._base)

    def fit(self, count):
        """Which of so many cases do not."""
        fits = np.full(count, not self._thin)
        if self._thin or not self.far.keys() | self.masses.keys():
            return fits
        for i, far in self.far.items():
            m, moments = self.masses.get(i, self._base.system.mass[i]), self.moments.get(i, self._moments[i : i + 1])
            fits &= ~(moments[:, 0] < THIN * np.maximum(moments[:, 2], m * far))
        return fits & (self._are_unequal(count) == self._is_unequal)

    def _are_unequal(self, count):
        """As `taylor.run_memory.are_unequal`, of each case."""
        system, found = self._base.system, np.zeros(count, bool)
        for own, varied in ((system.mass, self.masses), (np.abs(system.inertia).max(axis=1), self.inertias)):
            others = own > 0.0  # zero for the inertia of a point mass
            others[list(varied)] = False
            every = [own[others][None], *(column[:, None] for column in varied.values())]
            every = np.hstack([np.broadcast_to(columns, (count, columns.shape[1])) for columns in every])
            if every.size:
                found |= every.max(axis=1) > LIGHT * every.min(axis=1)
        return found
