"""Numbers of a force or a constraint for many cases.

Attributes of tsdyn's own forces and constraints are copied to the packed numbers as they are, but for directions. That
is found by trying: where other values, no two of them in proportion, appear unchanged, the columns are copied. The
smallest and the largest value of each chunk are checked as those of one case are.
"""

import numpy as np

from ..elements.element import checked_parameters
from ..elements.joint import Joint
from ..elements.markers import POINT
from ..errors import TsdynError
from ..jit.code_hash import is_ours
from ..model.packed import checked_motions
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..parameters.edit import sketch, with_attributes

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
