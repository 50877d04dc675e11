"""Numbers of a force for many cases.

Attributes of tsdyn's own forces are copied to the packed numbers as they are, but for directions. That is found by
trying: where other values, no two of them in proportion, appear unchanged, the columns are copied. The smallest and the
largest value of each chunk are checked as those of one case are. Other forces are asked case by case.
"""

import numpy as np

from ..elements.element import checked_parameters
from ..errors import TsdynError
from ..jit.code_hash import is_ours
from ..motions.signals import Signal
from ..parameters.edit import sketch

FACTORS = np.array([1.37, 1.61, 1.83])  # of trial values


class ForceColumns:
    """Coordinates of markers and parameters of a force, in a row; those which values don't change as in the base."""

    written = ("reals",)

    def __init__(self, family, force, names):
        self.names, self._force = names, force
        load = family.load_of(force)
        self._at, self._count = int(load.alone[0].reals), len(load.parameters)
        self.width = 3 * len(force.coordinates) + self._count
        self._base = family.packed.system.reals[self._at : self._at + self.width]
        known = is_ours(type(force).__module__) and all(family.field(name).is_numeric for name in names.values())
        self._sources = self._find_sources() if known else None

    def _row(self, values):
        """The numbers of one case, values by attribute; None if it needs more than numbers."""
        other, force = sketch(self._force), self._force
        vars(other)["added"] = False
        for attribute, value in values.items():
            setattr(other, attribute, value)
        other.check()
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

    def _find_sources(self):
        """Which attribute, and which of its numbers, each number of the row is; None if one is none of them."""
        trial = {}
        for n, attribute in enumerate(self.names):
            value = np.asarray(getattr(self._force, attribute), float)
            if value.shape not in ((), (3,)):
                return None
            trial[attribute] = (value + 0.1 + 0.0137 * n) * (FACTORS if value.ndim else FACTORS[0])
        try:
            row = self._row({name: float(x) if x.ndim == 0 else x for name, x in trial.items()})
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
        if self._sources is None or not self._are_checked(given):
            return self._fill_each(given, numbers)
        for j, (attribute, i) in self._sources.items():
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

    def places(self, systems, graphs):
        """In each system."""
        return [(system.reals, self._at, self.width, 0) for system in systems]


def _scalars(values):
    return {name: float(value) if np.ndim(value) == 0 else value for name, value in values.items()}
