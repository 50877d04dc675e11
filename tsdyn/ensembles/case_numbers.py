"""Numbers of the cases of a chunk: checked, laid out as rows of a table, and where each of them is written to."""

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
from ..rows.inertia_rows import lean_bodies, levers
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

# Attributes of bodies that are numbers of a system, while others are of starts; independence of rows depends on them.
OF_ROWS = {"mass", "inertia"}


class Columns:
    """Numbers of each case that follow from values of an owner: a part of the rows of the table.

    Attributes
    ----------
    width : int
        Numbers of a case.
    fill : callable
        fill(values, numbers, starts) checks values by name, writes numbers (k, width) and starts (k, 2, n), and says
        which cases fit.
    systems, graphs : sequence of (str, int, int, int)
        Where numbers are written, in each `System` and in each constraint graph: the name of an array, where its words
        begin, how many, from which number on.
    turning : int
        The body that a graph must turn to have them; -1 for every graph.
    column : int
        Where they begin in a row.
    """

    def __init__(self, width, fill, systems=(), graphs=(), turning=-1):
        self.width, self.fill, self.systems, self.graphs, self.turning = width, fill, systems, graphs, turning
        self.column = 0


def gravity_columns(name):
    """The acceleration of free fall."""

    def fill(values, numbers, starts):
        numbers[:], fits = vectors(values[name])
        return fits

    return Columns(3, fill, [("gravity", 0, 3, 0)])


def mass_columns(i, name, weights):
    """m and 1 / m of body i."""

    def fill(values, numbers, starts):
        m, fits = masses(values[name])
        numbers[:, 0], numbers[:, 1] = m, 1.0 / m
        weights.mass[:, i] = m
        return fits

    weights.follow(i)
    return Columns(2, fill, [("mass", i, 1, 0)], [("mass", 16 * i, 1, 0), ("inverse", 16 * i, 1, 1)])


def inertia_columns(i, name, weights):
    """J' and its inverse, and whether body i has a gyroscopic torque, as a word."""

    def fill(values, numbers, starts):
        J, fits = inertias(values[name])
        moments = np.linalg.eigh(J)[0]
        fits &= moments[:, 0] > THIN * moments[:, 2]
        numbers[:, :9] = J.reshape(-1, 9)
        J = np.where(fits[:, None, None], J, np.eye(3))
        numbers[:, 9:18] = np.linalg.inv(J).reshape(-1, 9)
        spins = (J[:, :1, :1] * np.eye(3) != J).any(axis=(1, 2))
        numbers[:, 18] = spins.astype(np.int64).view(float)
        weights.moments[:, i], weights.inertia[:, i] = moments, np.abs(J).max(axis=(1, 2))
        return fits

    weights.follow(i)
    rows = [(16 * i + 4 * (row + 1), 3, 3 * row) for row in range(3)]
    graphs = [("mass", *row) for row in rows] + [("inverse", at, 3, 9 + j) for at, _, j in rows] + [("spins", i, 1, 18)]
    return Columns(19, fill, [("inertia", 9 * i, 9, 0)], graphs, i)


def start_columns(body, names, bodies):
    """The start of a body, which is no number of a system; names by attribute."""
    (at, length), known = bodies[body.index].tolist(), body.values

    def fill(values, numbers, starts):
        fits, kept = True, {}
        for attribute, name in names.items():
            kept[attribute], good = (orientations if attribute == "orientation" else vectors)(values[name])
            fits = fits & good
        q, qd = starts[:, 0], starts[:, 1]
        if "position" in kept:
            q[:, at : at + 3] = kept["position"]
        if "velocity" in kept:
            qd[:, at : at + 3] = kept["velocity"]
        if length == 7 and not kept.keys().isdisjoint(("orientation", "angular_velocity")):
            p, w = (
                kept[name] if name in kept else np.tile(known[name], (len(starts), 1))
                for name in ("orientation", "angular_velocity")
            )
            q[:, at + 3 : at + 7], qd[:, at + 3 : at + 7] = p, parameter_rates(p, w)
        return fits

    return Columns(0, fill)


# Numbers of a force or a constraint for many cases.
#
# Attributes of tsdyn's own forces and constraints are copied to the packed numbers as they are, but for directions.
# That is found by trying: where other values, no two of them in proportion, appear unchanged, the columns are copied.
# The smallest and the largest value of each chunk are checked as those of one case are.

FACTORS = np.array([1.37, 1.61, 1.83])  # of trial values


class CopiedColumns(Columns):
    """Coordinates of markers and parameters of an item, in a row; those which values don't change as in the base.

    Parameters
    ----------
    family : Family
    item : Constraint or Force
    names : dict
        Names of its parameters by attribute.
    base : ndarray (width,)
        The row of the item as it is.
    row : callable
        The row for other values by attribute; None where these need more than numbers.
    systems : sequence
        As of `Columns`.
    """

    def __init__(self, family, item, names, base, row, systems):
        super().__init__(len(base), self._fill, systems)
        self.names, self._item, self._base, self._row = names, item, base, row
        known = is_ours(type(item).__module__) and all(family.field(name).is_numeric for name in names.values())
        self.sources = self._find_sources() if known else None

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

    def _fill(self, values, numbers, starts):
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


def force_columns(family, force, names):
    """Those of a force."""
    load = family.load_of(force)
    at, count = int(load.alone[0].reals), len(load.parameters)
    base = family.packed.system.reals[at : at + 3 * len(force.coordinates) + count]

    def row(values):
        other = with_attributes(force, values)
        given = checked_parameters(other, Signal, "loads")
        if other.kernels is not force.kernels or len(given) != count or any(isinstance(x, Signal) for x in given):
            return None
        pairs = zip(force.coordinates, other.coordinates, strict=True)
        own = [base[3 * i : 3 * i + 3] if new is old else new for i, (old, new) in enumerate(pairs)]
        return np.concatenate([*own, given])

    return CopiedColumns(family, force, names, base, row, [("reals", at, len(base), 0)])


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
        packed, reals = family.packed, family.packed.system.reals
        self._parts_of = (lambda item: item.parts) if isinstance(constraint, Joint) else (lambda item: (item,))
        first = packed.members[family.members[id(constraint)]].parts.start
        self.parts = range(first, first + len(self._parts_of(constraint)))
        systems, self.points, fixed, at = [], [], set(), 0
        for i in self.parts:
            primitive, count = packed.constraints[i], 3 * len(packed.coordinates[i]) + len(packed.parameters[i])
            systems.append(("reals", family.begins[i], count, at))
            for j, marker in enumerate(primitive.markers):
                if marker.code == POINT:
                    self.points.append((primitive.body_of(marker), at + 3 * j))
                else:
                    fixed |= {at + 3 * j + i for i in range(3)}
            at += count
        base = np.concatenate([reals[begin : begin + count] for _, begin, count, _ in systems])
        self._family = family
        super().__init__(family, constraint, names, base, self._make_row, systems)
        places = {at + i for _, at in self.points for i in range(3)}
        self.parameters = [] if self.sources is None else [j for j in self.sources if j not in places]
        self.serves = self.sources is not None and fixed.isdisjoint(self.sources)

    def _make_row(self, values):
        other = sketch(self._item)
        if isinstance(other, Joint):
            vars(other).update(a=self._family.own_body(other.a), b=self._family.own_body(other.b))
        parts, own = self._parts_of(with_attributes(other, values)), self._parts_of(self._item)
        if [type(part) for part in parts] != [type(part) for part in own]:
            return None
        row = []
        for part, old in zip(parts, own, strict=True):
            given = checked_motions(part)
            if part.rheonomic != old.rheonomic or any(isinstance(x, Motion) for x in given):
                return None
            row += [*part.coordinates, given]
        row = np.concatenate(row)
        return row if len(row) == len(self._base) else None

    def _fill(self, values, numbers, starts):
        """As of any; not where a number becomes zero, or ceases to be: masks of columns depend on that."""
        fits = super()._fill(values, numbers, starts)
        columns = numbers[:, self.parameters]
        return fits & ((columns == 0.0) == (self._base[self.parameters] == 0.0)).all(axis=1)


def _scalars(values):
    return {name: float(value) if np.ndim(value) == 0 else value for name, value in values.items()}


# What follows from points of constraints, where these differ from case to case.


class GeometryColumns(Columns):
    """The size of the scene in each case, and the bound on |Phi| that follows from it.

    Parameters
    ----------
    family : Family
    constraints : list of ConstraintColumns
    writer : NumberWriter
        Its numbers of constraints are known, and its weights are given the longest levers on each body.
    tol : float
        The constraint tolerance of runs.
    """

    def __init__(self, family, constraints, writer, tol):
        super().__init__(2, self._fill)
        self._family, self._constraints, self._writer, self._tol = family, constraints, writer, tol
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
        for columns in constraints:  # the inertia of a body depends on how far its points are
            for body, _ in columns.points:
                if id(body) in self._bodies:
                    writer.weights.follow(self._bodies[id(body)])

    def _fill(self, values, numbers, starts):
        """Sizes and bounds, and which cases ask for no more than numbers; after all constraints."""
        table, far = self._writer.numbers, self._writer.weights.far
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
        far[:] = 0.0
        for body, s in points:
            if id(body) in self._bodies:
                i = self._bodies[id(body)]
                far[:, i] = np.maximum(far[:, i], (s * s).sum(axis=1))
        fits = small == is_small(self._family.packed.size)
        return fits & (not self._lean) & self._are_near(points, starts)

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
    """Whether masses and inertias of the cases ask for no other equations than those of the workspace.

    They do where a body has next to no inertia about an axis, also beside others (`inertia_rows.lean_bodies`), or
    where masses become unequal (`constraint_graph.are_unequal`).

    Attributes
    ----------
    mass, inertia, far : ndarray (k, b)
        Of each case and body: mass, the largest |J'|, and the square of the longest lever.
    moments : ndarray (k, b, 3)
    """

    def __init__(self, base, is_unequal):
        system, self._is_unequal = base.system, is_unequal
        self._rigid, self._lean, self._followed = system.bodies[:, 1] == 7, lean_bodies(base).keys(), set()
        self._base = {
            "mass": system.mass,
            "inertia": np.abs(system.inertia).max(axis=1),
            "far": levers(base) ** 2,
            "moments": np.linalg.eigh(system.inertia.reshape(-1, 3, 3))[0],
        }

    def follow(self, i):
        """Look after a body whose mass, inertia or levers differ."""
        self._followed.add(i)

    def enter(self, count):
        """Lay out the numbers of so many cases, those of the scene at first."""
        for name, array in self._base.items():
            setattr(self, name, np.tile(array, (count, *[1] * array.ndim)))

    def fit(self):
        """Which cases do not."""
        if not self._followed:
            return True
        rigid, own = self._rigid, [i for i in self._followed if self._rigid[i]]
        least, most = self.moments[:, :, 0], np.maximum(self.moments[:, :, 2], self.mass * self.far)
        thin = (least[:, own] < THIN * most[:, own]).any(axis=1)
        if rigid.any():  # light bodies that carry others
            thin |= least[:, rigid].min(axis=1) < MASSLESS * most[:, rigid].max(axis=1)
        unequal = False
        for array in (self.mass, self.inertia[:, rigid]):
            if array.size:
                unequal |= array.max(axis=1) > UNEQUAL_MASSES * array.min(axis=1)
        return ~thin & (unequal == self._is_unequal) & self._lean.isdisjoint(own)


# Numbers of the cases of a chunk: checked, laid out as rows of a table, and where each of them is written to.
#
# A value that is not admissible, or asks for more than numbers, makes its case one that doesn't fit: it is entered as a
# packed scene, which says what is wrong with it.


class Place(NamedTuple):
    """Words of a row of the table, and the array that they are written to."""

    to: np.ndarray  # (words,) float64, a view
    column: int


def writer_of(workspace, names):
    """The `NumberWriter` of these parameters of all cases; None without any, or for one of a constraint or function."""
    family, owners = workspace.study.family, {}
    for name in names:
        field = family.field(name)
        if field.keyword:
            return None
        owners.setdefault(id(field.owner), (field.owner, {}))[1][field.attribute] = name
    constraints = [(owner, changed) for owner, changed in owners.values() if id(owner) in family.members]
    forces = [(owner, changed) for owner, changed in owners.values() if id(owner) in family.loads]
    if any(family.is_structural(owner, changed) for owner, changed in forces):
        return None
    if not owners or (constraints and not _are_numbers(workspace, constraints)):
        return None
    writer = NumberWriter(workspace, owners.values())
    return writer if all(columns.serves for columns in writer.constraints) else None


def _are_numbers(workspace, constraints):
    """Whether no more than numbers can follow from what differs of constraints, and runs need none of it beside."""
    family, kept = workspace.study.family, workspace.kept
    if not workspace.ends_in_first_slice or kept.packed.system.memory.size or not kept.handles.begin_at_zero:
        return False
    return not any(family.is_structural(owner, changed) for owner, changed in constraints)


class NumberWriter:
    """Checks the values of a chunk, and writes the numbers of one case after the other.

    Attributes
    ----------
    written : set of str
        The arrays of a `System` that it writes to.
    moves : bool
        Whether starts differ.
    weights : Weights
    fits : ndarray of bool (k,)
        Which cases of the chunk are written; the others must be entered in another way.
    numbers : ndarray (k, width)
    starts : ndarray (k, 2, n)
        q, qd of each case; of all, (1, 2, n), where starts don't differ.
    """

    moves = False

    def __init__(self, workspace, owners):
        self.workspace, self._parts, self._known = workspace, [], ([], [])
        self.weights = Weights(workspace.base, workspace.is_unequal)
        for owner, names in owners:
            self._parts += self._parts_of(owner, names)
        self.constraints = [part for part in self._parts if isinstance(part, ConstraintColumns)]
        self.geometry, at = None, 0
        if self.constraints:  # last: it follows from the numbers of the others
            tol = workspace.study.options.constraint_tol
            self.geometry = GeometryColumns(workspace.study.family, self.constraints, self, tol)
            self._parts.append(self.geometry)
        for part in self._parts:
            part.column, at = at, at + part.width
        self.width, self.written = at, {name for part in self._parts for name, *_ in part.systems}

    def _parts_of(self, owner, names):
        family = self.workspace.study.family
        if owner is family.template:
            return [gravity_columns(names["gravity"])]
        if not isinstance(owner, PointMass):
            return [(ConstraintColumns if family.load_of(owner) is None else force_columns)(family, owner, names)]
        parts = []
        if "mass" in names:
            parts.append(mass_columns(owner.index, names["mass"], self.weights))
        if "inertia" in names:
            parts.append(inertia_columns(owner.index, names["inertia"], self.weights))
        moved = {attribute: name for attribute, name in names.items() if attribute not in OF_ROWS}
        self.moves = self.moves or bool(moved)
        return [*parts, start_columns(owner, moved, self.workspace.base.system.bodies)] if moved else parts

    def take(self, values, count):
        """Lay out the values of so many cases: arrays (count, ...) by name."""
        self.fits, self.numbers = np.ones(count, bool), np.zeros((count, self.width))
        self.starts = np.empty((count if self.moves else 1, 2, self.workspace.study.n))
        self.starts[:] = self.workspace.study.family.start
        if any(array.dtype != float for array in values.values()):
            self.fits[:] = False
            return
        self.weights.enter(count)
        with np.errstate(all="ignore"):
            for part in self._parts:
                columns = slice(part.column, part.column + part.width)
                self.fits &= part.fill(values, self.numbers[:, columns], self.starts)
            self.fits &= self.weights.fit()

    def size(self, k):
        """The size of the scene in case k of the chunk; None where it is that of the base."""
        return None if self.geometry is None else float(self.numbers[k, self.geometry.column])

    def places_in(self, reals):
        """Those of numbers of constraints, in an array like `System.reals`."""
        return [_place(part, reals, *where) for part in self.constraints for _, *where in part.systems]

    def places(self):
        """All `Place`s, in the arrays of the workspace and of its runs."""
        systems, graphs = self.workspace.systems(), self.workspace.graphs()
        if not (_same(systems, self._known[0]) and _same(graphs, self._known[1])):
            self._known, self._places = (systems, graphs), []
            for part in self._parts:
                turned = [graph for graph in graphs if part.turning < 0 or graph.bodies[part.turning, 1] == 7]
                for owners, wheres in ((systems, part.systems), (turned, part.graphs)):
                    self._places += [_place(part, getattr(owner, name), *where)
                                     for owner in owners for name, *where in wheres]  # fmt: skip
        return self._places

    def write(self, k):
        """Write the numbers of case k of the chunk; its start, or None if it must be entered in another way."""
        if not self.fits[k]:
            return None
        row = self.numbers[k]
        for to, column in self.places():
            to[...] = row[column : column + to.size]
        return (self.starts[k, 0], self.starts[k, 1]) if self.moves else self.workspace.study.family.start


def _place(part, array, begin, words, at):
    return Place(array.reshape(-1).view(float)[begin : begin + words], part.column + at)


def _same(arrays, known):
    return len(arrays) == len(known) and all(a is b for a, b in zip(arrays, known, strict=True))
