"""The first slice of a run, and what is kept of a run that ends well within it, as most runs of small scenes do.

Its records lie in arrays that the memory keeps. A run that ends there leaves copies of them; what a solution says of it
is made when it is asked for. A longer run goes on from there: see `slices.drive`.
"""

import time
from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..rows.interface import redundant_of
from . import slices
from .recorder import CHART_ROOM, NO_ROWS
from .remains import Remains
from .run_log import RunLog, with_end
from .task import Outcome
from .tolerances import TRIES
from .trajectory import Trajectory

SUCCESS = Status.SUCCESS


class Begun(NamedTuple):
    """A run after its first slice."""

    log: RunLog
    rows: int  # steps that there was room for
    status: Status  # None where Ctrl-C was pressed meanwhile
    seconds: float


class Room(NamedTuple):
    """Where a memory keeps the records of a first slice."""

    first: int  # slices.FIRST_SLICE
    most: int  # steps
    width: int  # of a row of outputs
    history: np.ndarray
    charts: np.ndarray


def limit_of(run, stops, max_steps):
    """How many steps a run may make."""
    return run.numbers.steps_wanted + len(stops) if max_steps is None else max_steps


def begin(memory, times, stops, limit):
    """Make the first slice of a run that has been entered; the `Begun`."""
    room = memory.room
    if room is None or room.first != slices.FIRST_SLICE:
        room = memory.room = _room_for(memory)
    rows, blocks = min(room.most, limit), (NO_ROWS, NO_ROWS)
    if memory.run.numbers.dense:
        blocks = _room_for_blocks(memory, rows)
    out = np.empty((times.size or rows + 1, room.width))
    log, started = RunLog(times, stops, out, room.history, room.charts, *blocks), time.perf_counter()
    try:
        status = memory.advance(log, rows)
    except KeyboardInterrupt:
        status = None
    return Begun(log, rows, status, time.perf_counter() - started)


def _room_for(memory):
    most, run = slices.first_slice(memory.weight), memory.run
    history, charts = np.empty((most + 2 * TRIES, 3)), np.empty((2 * CHART_ROOM, 5))
    return Room(slices.FIRST_SLICE, most, 1 + run.now.size + run.remembered.size, history, charts)


def _room_for_blocks(memory, rows):
    """Points and blocks of dense output, which no later run writes to."""
    n, redundant = memory.run.now.shape[1], len(redundant_of(memory.context.tangent))
    return np.zeros((2 * CHART_ROOM, n + redundant)), np.empty((rows, memory.run.block.size))


def has_ended_well(memory, begun):
    """Whether that was all, and there is nothing more to look at."""
    return begun.status is SUCCESS and memory.run.numbers.near_steps == 0


def rows_of(memory, log):
    """The outputs of a run that has ended, in an array of their own."""
    count, out = memory.run.numbers.rows, log.out
    return (out if len(out) == count else out[:count]) if log.t_eval.size else out[:count].copy()


def readings_of(memory, task):
    """How the steps of a run are read, in this process and in others; None, None where nothing asks for it.

    The same for all runs of an engine, so that a reader serves again.
    """
    if not memory.run.numbers.dense:
        return None, None
    engine, packed, tol = memory.engine, task.prepared.packed, task.constraint_tol
    of, found = getattr(engine, "readings", (None, None))
    if of is None or of[0] is not packed or of[1] != tol:
        found = engine.reading(memory, task.prepared, tol)
        engine.readings = (packed, tol), found
    return found


def trajectory_of(memory, log, task):
    """The `Trajectory` of a run that has ended; None where none is asked for."""
    numbers, control = memory.run.numbers, memory.work.control
    if not numbers.dense:
        return None
    charts = with_end(log.charts[: numbers.chart_rows + 1].copy(), numbers, control.condition, control.contraction)
    records = log.blocks[: numbers.blocks].copy(), charts, log.points[: len(charts)].copy()
    return Trajectory(readings_of(memory, task), records, task.span[0], memory.run.now.copy(), task.angles, task.stops)


class Brief:
    """The `Outcome` of a run that has ended well within its first slice.

    Parameters
    ----------
    memory : Memory
    begun : Begun
    task : Task
    began : float
        As of `Outcome`.
    """

    __slots__ = ("began", "remains", "rows", "trajectory")
    status, reason, events, method = SUCCESS, "", None, ""

    def __init__(self, memory, begun, task, began):
        self.rows, self.remains = rows_of(memory, begun.log), Remains(memory, begun.log, task.history)
        self.trajectory, self.began = trajectory_of(memory, begun.log, task), began

    def __getattr__(self, name):
        return getattr(self.remains, name)

    def _replace(self, **changes):
        """Return it as an `Outcome`, with other values."""
        return Outcome(*(getattr(self, name) for name in Outcome._fields))._replace(**changes)
