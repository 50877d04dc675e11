"""What a run with a store writes to: outputs and histories, buffered; read again when they are asked for."""

import math
import shutil
import time
from functools import cached_property

import numpy as np

from ..errors import StorageError
from ..formulations.charts import REASONS
from . import checkpoint
from .formats import Column, StoredTable, format_of

READERS = 1.0  # s, after which readers see what has been written; later in proportion where that takes longer than
BRIEF = 0.01  # s
OUTPUTS, STEPS, CHARTS = "outputs", "steps", "charts"
COORDINATES = ("x", "y", "z", "e0", "e1", "e2", "e3")
_LEVELS = {
    "q": ("positions and Euler parameters", "m or 1"),
    "qd": ("their first derivatives", "m/s or 1/s"),
    "qdd": ("their second derivatives", "m/s^2 or 1/s^2"),
}
_STEPS = {"step_h": ("length of a step", "s"), "step_accepted": ("whether it was accepted", "1")}
_CHARTS = {
    "chart_reason": ("number of the reason for the chart", "1"),
    "chart_condition": ("condition at its end", "1"),
    "chart_contraction": ("contraction at its end", "1"),
    "chart_steps": ("steps on it", "1"),
}


def tables_of(bodies, remembered, history):
    """The tables of a store: outputs of these bodies, so many remembered numbers, histories."""
    names = [f"{body.name}.{x}" for body in bodies for x in COORDINATES[: body.dimension]]
    labels, columns = {"coordinate": names}, [_times("time", "model time")]
    columns += [Column(name, ("coordinate",), _attributes(*said)) for name, said in _LEVELS.items()]
    if remembered:
        labels["slot"] = [str(i) for i in range(remembered)]
        columns.append(
            Column("remembered", ("slot",), _attributes("joint angles, and what forces remember", "rad or 1"))
        )
    tables = {OUTPUTS: StoredTable("time", tuple(columns), labels)}
    for name, dimension, said in ((STEPS, "step_time", _STEPS), (CHARTS, "chart_time", _CHARTS)):
        if history:
            rest = [Column(column, (), _attributes(*words)) for column, words in said.items()]
            tables[name] = StoredTable(dimension, (_times(dimension, "start"), *rest), {})
    return tables


def units_of_level(level):
    """The units of q, qd or qdd: of positions, and of Euler parameters."""
    return _LEVELS[level][1]


def _times(name, said):
    return Column(name, (), _attributes(said, "s"))


def _attributes(said, units):
    return {"long_name": said, "units": units}


class Archive:
    """A store that a run writes to, and its checkpoint.

    Parameters
    ----------
    path : Path
    tables : dict
        As `tables_of` makes them.
    attributes : dict
        Of the store as a whole.
    interval : float, s
        Between checkpoints; None for no checkpoints.
    request : (dict, dict)
        Numbers and arrays that a checkpoint begins with: what the run was asked.
    facts : dict
        Numbers that it begins with.
    """

    def __init__(self, path, tables, attributes, interval, request, facts):
        self.path, self._tables, self._attributes = path, tables, attributes
        self._interval, self.request, self.facts = interval, request, facts
        self._format = format_of(path)
        self.shift, self.skips, self.passed = 0.0, False, []  # of positions; a first row; segments that have ended
        self.resting = None  # coordinates of bodies that rest in the present phase, and where
        self.known = self.resumed = None  # what a run that goes on begins with: numbers, arrays; its present phase
        self.before = None  # makes numbers and arrays of the phases that have ended, and of how the present one begins
        self._store = None

    def begin(self):
        """Make the store; nothing is left where that fails."""
        try:
            self._store = self._format.Store.create(self.path, self._tables, self._attributes)
        except OSError:
            shutil.rmtree(self.path, ignore_errors=True)
            self.path.unlink(missing_ok=True)
            raise
        self._set_counts(self._none())

    def go_on(self, numbers, arrays):
        """Open the store where a checkpoint was written."""
        self._reopen(numbers["counts"], numbers["size"])
        self.known, self.passed = (numbers, arrays), numbers["passed"]
        self.resumed = None if numbers.get("between") else self.known

    def begin_again(self, request):
        """Forget what has been written: another method begins at the start."""
        self.request = request
        checkpoint.remove(self.path)
        self._store.close()
        self._reopen(self._none(), 0)
        self.passed, self.resumed = [], None

    def go_back(self, counts):
        """Forget the rows beyond these counts: the next ones take their places."""
        for name, count in counts.items():
            surplus, parts = self.counts[name] - count, self._waiting[name]
            while surplus > 0 and parts:
                rows = parts.pop()
                if len(rows) > surplus:
                    parts.append(rows[:-surplus])
                surplus -= len(rows)
            if surplus > 0:  # a checkpoint may count on what is written
                checkpoint.remove(self.path)
                self._written = -math.inf
        self.counts = dict(counts)

    def _none(self):
        return dict.fromkeys(self._tables, 0)

    def _reopen(self, counts, size):
        self._store = self._format.Store.reopen(self.path, self._tables, self._attributes, counts, size)
        self._set_counts(counts)

    def _set_counts(self, counts):
        self.counts = dict(counts)
        self._waiting, self._size = {name: [] for name in self._tables}, 0
        self._due, self._written = time.perf_counter() + READERS, -math.inf  # the first checkpoint is due at once

    @property
    def columns(self):
        """Names of the columns of each table."""
        return {name: [column.name for column in table.columns] for name, table in self._tables.items()}

    def add(self, name, rows):
        """Add rows (k, columns) of a table; they are copied."""
        if name not in self._tables:
            return
        if self.skips and name == OUTPUTS and len(rows):
            rows, self.skips = rows[1:], False
        if len(rows):
            self._waiting[name].append(self._placed(rows) if name == OUTPUTS else rows.copy())
            self.counts[name] += len(rows)
            self._size += rows.size

    def _placed(self, rows):
        """A copy of outputs: in the scene's coordinates, bodies that rest where they are to the last bit."""
        rows, n = rows.copy(), len(self._tables[OUTPUTS].labels["coordinate"])
        if not np.isscalar(self.shift):
            rows[:, 1 : 1 + n] += self.shift
        if self.resting is not None:
            still, q = self.resting
            rows[:, 1 + still], rows[:, 1 + n + still], rows[:, 1 + 2 * n + still] = q, 0.0, 0.0
        return rows

    def look_up(self, state):
        """Between slices: let readers see what is new, and write a checkpoint if one is due; `state()` makes it."""
        now = time.perf_counter()
        if self._interval is not None and now - self._written >= self._interval:
            self.checkpoint(*state())
        elif now >= self._due and self._size:
            self.flush()
            ended = time.perf_counter()
            self._due = ended + READERS * max((ended - now) / BRIEF, 1.0)
        elif self._size > self._format.BUFFER:
            self._write()

    @property
    def most_steps(self):
        """How many steps the whole run may make, None for any number: max_steps, and as many after each stop there."""
        most = self.facts["max_steps"]
        return None if most is None else most + self.facts["granted"]

    def stop(self, state):
        """Write a checkpoint where max_steps stops the run: a run that goes on from it may make as many steps again."""
        if self.has_checkpoints and self.facts["max_steps"] is not None:
            self.facts["granted"] = self.most_steps
            self.checkpoint(*state())

    def checkpoint(self, numbers, arrays):
        """Write a checkpoint of this state."""
        self._write()
        self._store.sync()
        facts = {**self.facts, "counts": self.counts, "passed": self.passed, "size": self._store.size}
        (asked, held), (before, more) = self.request, ({}, {}) if self.before is None else self.before()
        checkpoint.write(self.path, {**facts, **asked, **before, **numbers}, {**held, **more, **arrays})
        self._written = time.perf_counter()
        self._due = self._written + READERS

    @property
    def has_checkpoints(self):
        """Whether checkpoints are asked for."""
        return self._interval is not None

    def flush(self):
        """Let readers see everything."""
        self._write()
        self._store.flush()

    def close(self):
        """Close the store."""
        self._store.close()

    def _write(self):
        for name, parts in self._waiting.items():
            if parts:
                rows = np.concatenate(parts)
                self._store.write(self.counts[name] - len(rows), self._columns(name, rows))
                parts.clear()
        self._size = 0

    def _columns(self, name, rows):
        """Rows of a table as arrays by column; the times last, for readers who count by them."""
        if name != OUTPUTS:
            columns = [column.name for column in self._tables[name].columns]
            found = dict(zip(columns[1:], rows.T[1:], strict=True))
            return found | {columns[0]: rows[:, 0]}
        n = len(self._tables[OUTPUTS].labels["coordinate"])
        found = {level: rows[:, 1 + i * n : 1 + (i + 1) * n] for i, level in enumerate(_LEVELS)}
        if rows.shape[1] > 1 + 3 * n:
            found["remembered"] = rows[:, 1 + 3 * n :]
        return found | {"time": rows[:, 0]}


# Outputs and histories of a run in a store, read when they are asked for.


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
