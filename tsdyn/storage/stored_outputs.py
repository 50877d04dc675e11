"""Outputs and histories of a run in a store, read when they are asked for."""

from functools import cached_property

import numpy as np

from ..errors import StorageError
from ..formulations.chart_validity import REASONS
from .archive import OUTPUTS, STEPS
from .formats import format_of


class StoredOutputs:
    """The outputs of a run.

    Parameters
    ----------
    path : Path
        Of the store.
    columns : dict
        Names of the columns of its tables.
    """

    def __init__(self, path, columns):
        self.path, self.columns = path, columns

    @cached_property
    def count(self):
        """How many outputs there are."""
        return format_of(self.path).count(self.path, self.columns[OUTPUTS])

    def read(self, column, part):
        """A slice of a column of the outputs; of nothing, where there is no such column."""
        if column not in self.columns[OUTPUTS]:
            return None
        return format_of(self.path).read(self.path, column, slice(*part.indices(self.count)))


class StoredLog:
    """A history in a store, as `StepLog` or `ChartLog` give one."""

    def __init__(self, outputs, name):
        self._outputs, self._name = outputs, name

    @classmethod
    def of(cls, outputs, name):
        """The history, or None where none was kept."""
        return cls(outputs, name) if name in outputs.columns else None

    def arrays(self):
        """As of a `StepLog`, or of a `ChartLog`."""
        path, columns = self._outputs.path, self._outputs.columns[self._name]
        kind = format_of(path)
        whole = slice(0, kind.count(path, columns))
        found = [kind.read(path, column, whole) for column in columns]
        if self._name == STEPS:
            found[2] = found[2] == 1.0
        elif not np.isin(found[1], np.arange(len(REASONS))).all():
            raise StorageError(f"{path} is damaged: the reasons of its charts are none.")
        return found
