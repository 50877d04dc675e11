"""Numbers of the cases of a chunk: checked, laid out as rows of a table, and where each of them is written to."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..elements.bodies import Ground, PointMass, transform_g
from ..elements.element import checked_parameters
from ..elements.joint import Joint
from ..elements.markers import POINT
from ..elements.tolerances import SQUARABLE, UNIT_LENGTH
from ..errors import TsdynError
from ..jit.code_hash import is_ours
from ..maths.tolerances import NEGLIGIBLE, TINY, TYPED
from ..model.packed import POINT_SIZE, checked_motions, is_small
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..rows.massless_axes import lean_bodies, levers
from ..rows.tolerances import MASSLESS, THIN, UNEQUAL_MASSES
from ..simulation.local_origin import are_within
from ..simulation.parameters import sketch, with_attributes

# Values of bodies for many cases at once, checked as `elements.bodies` checks those of one, to the same bits.
#
# Each function returns what is kept of the values, and which of them are admissible; what is kept of others is
# undefined.


def vectors(values):
    """Vectors (k, 3)."""
    if values.shape[1:] != (3,):
        return np.zeros((len(values), 3)), np.zeros(len(values), bool)
    return values, np.isfinite(values).all(axis=1)


def masses(values):
    """Masses (k,)."""
    if values.ndim != 1:
        return np.ones(len(values)), np.zeros(len(values), bool)
    return values, (values >= TINY) & (values <= SQUARABLE)


def inertias(values):
    """Inertias (k, 3, 3), of principal values (k, 3) or matrices; those that are not admissible are the identity."""
    if values.shape[1:] == (3,):
        values, principal = np.zeros((len(values), 3, 3)), values
        values[:, range(3), range(3)] = principal
    if values.shape[1:] != (3, 3):
        return np.tile(np.eye(3), (len(values), 1, 1)), np.zeros(len(values), bool)
    fits = np.isfinite(values).all(axis=(1, 2)) & values.any(axis=(1, 2))
    values = np.where(fits[:, None, None], values, np.eye(3))
    scale = np.abs(values).max(axis=(1, 2))
    fits &= (scale >= TINY) & (scale <= SQUARABLE)
    unit = values / scale[:, None, None]
    fits &= np.abs(unit - unit.swapaxes(1, 2)).max(axis=(1, 2)) <= NEGLIGIBLE
    principal = np.linalg.eigvalsh(unit / 2.0 + unit.swapaxes(1, 2) / 2.0)
    fits &= principal[:, 0] >= -NEGLIGIBLE
    fits &= principal[:, 2] <= (principal[:, 0] + principal[:, 1]) * (1.0 + TYPED)
    return values / 2.0 + values.swapaxes(1, 2) / 2.0, fits


def orientations(values):
    """Euler parameters (k, 4)."""
    if values.shape[1:] != (4,):
        return np.zeros((len(values), 4)), np.zeros(len(values), bool)
    length = np.sqrt(_products(values[:, None, :], values)[:, 0])
    return values / length[:, None], np.abs(length - 1.0) <= UNIT_LENGTH


def parameter_rates(p, omega):
    """pd = G(p)^T omega' / 2, (k, 4)."""
    G = np.ascontiguousarray(transform_g(p))  # laid out as one alone is, for the same bits
    return 0.5 * _products(G.swapaxes(1, 2), omega)


def _products(A, x):
    """A x of each, by the routine that multiplies one alone."""
    return (A @ x[:, :, None])[:, :, 0]


# Numbers of bodies, and of gravity, for many cases.

WEIGHTS = {"mass", "inertia"}  # attributes that are numbers of a system; the others are of starts


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


# Numbers of a force or a constraint for many cases.
#
# Attributes of tsdyn's own forces and constraints are copied to the packed numbers as they are, but for directions.
# That is found by trying: where other values, no two of them in proportion, appear unchanged, the columns are copied.
# The smallest and the largest value of each chunk are checked as those of one case are.

FACTORS = np.array([1.37, 1.61, 1.83])  # of trial values


class CopiedColumns:
    """Coordinates of markers and parameters of an item, in a row; those which values don't change as in the base.

    A subclass has `_row`, and sets `_base`, the row of the item as it is.
    """

    written = ("reals",)

    def __init__(self, family, item, names):
        self.names, self._item, self._family = names, item, family
        known = is_ours(type(item).__module__) and all(family.field(name).is_numeric for name in names.values())
        self.sources = self._find_sources() if known else None

    @property
    def width(self):
        """Numbers of a row."""
        return len(self._base)

    def _find_sources(self):
        """Which attribute, and which of its numbers, each number of the row is; None if one is none of them."""
        trial = {}
        for n, attribute in enumerate(self.names):
            value = np.asarray(getattr(self._item, attribute), float)
            if value.shape not in ((), (3,)):
                return None
            trial[attribute] = (value + 0.1 + 0.0137 * n) * (FACTORS if value.ndim else FACTORS[0])
        try:
            row = self._row(_scalars(trial))
        except TsdynError:
            return None
        if row is None:
            return None
        found = {}
        for j in np.flatnonzero(row != self._base).tolist():
            equal = [(name, i) for name, x in trial.items() for i in np.flatnonzero(np.ravel(x) == row[j]).tolist()]
            if len(equal) != 1:
                return None
            found[j] = equal[0]
        return found if {name for name, _ in found.values()} == self.names.keys() else None

    def fill(self, values, numbers, starts):
        """The numbers of all cases."""
        numbers[:] = self._base
        given = {attribute: values[name] for attribute, name in self.names.items()}
        if self.sources is None or not self._are_checked(given):
            return self._fill_each(given, numbers)
        for j, (attribute, i) in self.sources.items():
            numbers[:, j] = given[attribute].reshape(len(numbers), -1)[:, i]
        return np.ones(len(numbers), bool)

    def _are_checked(self, given):
        """Whether the extremes of each attribute are admissible, and with them all between."""
        ends = [{name: end(column, axis=0) for name, column in given.items()} for end in (np.min, np.max)]
        if not all(np.isfinite(value).all() for end in ends for value in end.values()):
            return False
        try:
            return all(self._row(_scalars(end)) is not None for end in ends)
        except TsdynError:
            return False

    def _fill_each(self, given, numbers):
        fits = np.zeros(len(numbers), bool)
        for k in range(len(numbers)):
            try:
                row = self._row(_scalars({name: column[k] for name, column in given.items()}))
            except TsdynError:
                continue
            if row is not None:
                numbers[k], fits[k] = row, True
        return fits


class ForceColumns(CopiedColumns):
    """Those of a force."""

    def __init__(self, family, force, names):
        load = family.load_of(force)
        self._at, self._count = int(load.alone[0].reals), len(load.parameters)
        width = 3 * len(force.coordinates) + self._count
        self._base = family.packed.system.reals[self._at : self._at + width]
        super().__init__(family, force, names)

    def _row(self, values):
        """The numbers of one case, values by attribute; None if it needs more than numbers."""
        other, force = with_attributes(self._item, values), self._item
        given = checked_parameters(other, Signal, "loads")
        if other.kernels is not force.kernels or len(given) != self._count or any(isinstance(x, Signal) for x in given):
            return None
        row, at = self._base.copy(), 0
        for old, new in zip(force.coordinates, other.coordinates, strict=True):
            if new is not old:
                row[at : at + 3] = new
            at += 3
        row[at:] = given
        return row

    def places(self, systems, graphs):
        """In each system."""
        return [(system.reals, self._at, self.width, 0) for system in systems]


class ConstraintColumns(CopiedColumns):
    """Those of the primitives that a constraint is made of; points and parameters, no directions.

    Attributes
    ----------
    serves : bool
        Whether all that the values change is copied from them.
    points : list of (body, number)
        Where the points of the primitives begin in a row; body is the packed scene's, or the ground.
    """

    def __init__(self, family, constraint, names):
        first = family.packed.members[family.members[id(constraint)]].parts.start
        self._owner = constraint if isinstance(constraint, Joint) else None
        own = constraint.parts if self._owner else (constraint,)
        self.parts, self._at, self.points, fixed, at = range(first, first + len(own)), [], [], set(), 0
        for i in self.parts:
            primitive, given = family.packed.constraints[i], family.packed.parameters[i]
            self._at.append((family.begins[i], at, 3 * len(family.packed.coordinates[i]) + len(given)))
            for marker in primitive.markers:
                if marker.code == POINT:
                    self.points.append((primitive.body_of(marker), at))
                else:
                    fixed |= {at, at + 1, at + 2}
                at += 3
            at += len(given)
        reals = family.packed.system.reals
        self._base = np.concatenate([reals[begin : begin + count] for begin, _, count in self._at])
        super().__init__(family, constraint, names)
        places = {at + i for _, at in self.points for i in range(3)}
        self.parameters = [] if self.sources is None else [j for j in self.sources if j not in places]
        self.serves = self.sources is not None and fixed.isdisjoint(self.sources)

    def _row(self, values):
        other = sketch(self._item)
        if self._owner:
            vars(other).update(a=self._family.own_body(other.a), b=self._family.own_body(other.b))
        other = with_attributes(other, values)
        row, own = [], self._item.parts if self._owner else (self._item,)
        parts = other.parts if self._owner else (other,)
        if [type(part) for part in parts] != [type(part) for part in own]:
            return None
        for part, old in zip(parts, own, strict=True):
            given = checked_motions(part)
            if part.rheonomic != old.rheonomic or any(isinstance(x, Motion) for x in given):
                return None
            row += [np.concatenate(part.coordinates), given] if part.coordinates else [given]
        row = np.concatenate(row)
        return row if len(row) == len(self._base) else None

    def fill(self, values, numbers, starts):
        """As of any; not where a number becomes zero, or ceases to be: masks of columns depend on that."""
        fits = super().fill(values, numbers, starts)
        columns = numbers[:, self.parameters]
        return fits & ((columns == 0.0) == (self._base[self.parameters] == 0.0)).all(axis=1)

    def places(self, systems, graphs):
        """In each system, primitive by primitive."""
        return [(system.reals, begin, count, at) for system in systems for begin, at, count in self._at]


def _scalars(values):
    return {name: float(value) if np.ndim(value) == 0 else value for name, value in values.items()}


# What follows from points of constraints, where these differ from case to case.


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
        small = (length > 0.0) & (length < POINT_SIZE)
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


# Cases whose masses and inertias ask for other equations than those of the scene they vary.


class Weights:
    """Whether masses and inertias of the cases ask for no other equations than those of the arena.

    They do where a body has next to no inertia about an axis, also beside others (`massless_axes.lean_bodies`), or
    where masses become unequal (`length_metric.are_unequal`).
    """

    def __init__(self, base, is_unequal):
        self._base, self._is_unequal, self.far, self._thin = base, is_unequal, {}, False
        self._moments = np.linalg.eigh(base.system.inertia.reshape(-1, 3, 3))[0]
        self._levers, self._lean = levers(base), lean_bodies(base)
        self.masses, self.moments, self.inertias = {}, {}, {}  # by body, of each case

    def follow(self, body):
        """Look after a body whose mass or inertia differs."""
        if body.dimension == 7:
            self.far[body.index] = float(self._levers[body.index] ** 2)
            self._thin |= body.index in self._lean

    def fit(self, count):
        """Which of so many cases do not."""
        fits = np.full(count, not self._thin)
        if self._thin or not self.far.keys() | self.masses.keys():
            return fits
        for i, far in self.far.items():
            m, moments = self.masses.get(i, self._base.system.mass[i]), self.moments.get(i, self._moments[i : i + 1])
            fits &= ~(moments[:, 0] < THIN * np.maximum(moments[:, 2], m * far))
        return fits & ~self._are_light(count) & (self._are_unequal(count) == self._is_unequal)

    def _are_light(self, count):
        """Which cases may have light bodies that carry others."""
        moments, rigid = self._moments, self._base.system.bodies[:, 1] == 7
        least, most = np.full(count, np.inf), np.zeros(count)
        for i in np.flatnonzero(rigid):
            own = self.moments.get(i, moments[i : i + 1])
            far = self.masses.get(i, self._base.system.mass[i]) * self._levers[i] ** 2
            least, most = np.minimum(least, own[:, 0]), np.maximum(most, np.maximum(own[:, 2], far))
        return least < MASSLESS * most

    def _are_unequal(self, count):
        """As `length_metric.are_unequal`, of each case."""
        system, found = self._base.system, np.zeros(count, bool)
        for own, varied in ((system.mass, self.masses), (np.abs(system.inertia).max(axis=1), self.inertias)):
            others = own > 0.0  # zero for the inertia of a point mass
            others[list(varied)] = False
            every = [own[others][None], *(column[:, None] for column in varied.values())]
            every = np.hstack([np.broadcast_to(columns, (count, columns.shape[1])) for columns in every])
            if every.size:
                found |= every.max(axis=1) > UNEQUAL_MASSES * every.min(axis=1)
        return found


# Numbers of the cases of a chunk: checked, laid out as rows of a table, and where each of them is written to.
#
# A value that is not admissible, or asks for more than numbers, makes its case one that doesn't fit: it is entered as a
# packed scene, which says what is wrong with it.


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
