"""The first slice of a run, within which most runs of small scenes end.

Its records lie in arrays that the memory keeps, and a run that ends there copies them. A longer one goes on from there:
see `slices.drive`.
"""

from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..rows.interface import redundant_of
from . import slices
from .recorder import CHART_ROOM, NO_ROWS
from .run_log import RunLog
from .tolerances import TRIES


class FirstSlice(NamedTuple):
    """A run after its first slice."""

    log: RunLog
    rows: int  # steps that there was room for
    status: Status  # None where Ctrl-C was pressed meanwhile
    began: float  # by `jit.compiled.clock`


class Room(NamedTuple):
    """Where a memory keeps the records of a first slice."""

    first: int  # slices.FIRST_SLICE
    most: int  # steps
    width: int  # of a row of outputs
    history: np.ndarray
    charts: np.ndarray


def room_for(memory, task):
    """The `RunLog` of the first slice of a run, and the steps that there is room for."""
    room, times = memory.room, task.times
    if room is None or room.first != slices.FIRST_SLICE:
        room = memory.room = _room_for(memory)
    rows, blocks = min(room.most, slices.step_limit(memory.run, task)), (NO_ROWS, NO_ROWS)
    if task.dense_output:
        n, redundant = memory.run.now.shape[1], len(redundant_of(memory.context.tangent))
        blocks = np.zeros((2 * CHART_ROOM, n + redundant)), np.empty((rows, memory.run.block.size))
    out = np.empty((times.size or rows + 1, room.width))
    return RunLog(times, task.stops, out, room.history, room.charts, *blocks), rows


def _room_for(memory):
    most, run = slices.first_slice(memory.weight), memory.run
    history, charts = np.empty((most + 2 * TRIES, 3)), np.empty((2 * CHART_ROOM, 5))
    return Room(slices.FIRST_SLICE, most, 1 + run.now.size + run.remembered.size, history, charts)
