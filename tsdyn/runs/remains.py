"""What a run leaves that ends well within its first slice: copies of its records, read when the solution is asked."""

import ctypes

import numpy as np

from ..workspaces.run_state import Clock, Kernels, Numbers
from ..workspaces.workspace import Control, Counters
from .counts import Counts
from .history import FEW_ROWS, ChartLog, StepLog
from .run_log import with_end

NUMBERS, COUNTERS = ctypes.sizeof(Clock), ctypes.sizeof(Control)  # bytes before them, as `Memory` lays them out
NOW = sum(map(ctypes.sizeof, (Clock, Numbers, Kernels))) // 8  # numbers before q


class Remains:
    """Copies of the records of a run, and what they say, as of an `Outcome`.

    Parameters
    ----------
    memory : Memory
        At the end of the run.
    log : RunLog
    keeps : bool
        Whether the histories of steps and charts are kept.
    """

    __slots__ = ("_charts", "_run", "_steps", "_told", "_work")

    def __init__(self, memory, log, keeps):
        self._told, self._run, self._work = memory.told, memory.run_state.copy(), memory.state.copy()
        self._steps = self._charts = None
        if keeps:
            run = memory.run.numbers
            steps = log.history[: run.history]
            self._steps = steps.copy() if len(steps) < FEW_ROWS else _logged(steps)
            self._charts = log.charts[: run.chart_rows + 1].copy()

    @property
    def reached(self):
        """Time, s."""
        return float(self._run[0])

    @property
    def last(self):
        """q, qd, qdd there, (3, n)."""
        n = self._told.n
        return self._run[NOW : NOW + 3 * n].reshape(3, n)

    @property
    def remembered(self):
        """Angles of joints there, and what forces remember."""
        at = NOW + 6 * self._told.n
        return self._run[at : at + self._told.remembered]

    @property
    def steps(self):
        """The `StepLog`, or None."""
        return _logged(self._steps) if isinstance(self._steps, np.ndarray) else self._steps

    @property
    def charts(self):
        """The `ChartLog`, or None."""
        if self._charts is None:
            return None
        control, log = Control.from_buffer(self._work), ChartLog()
        log.add(with_end(self._charts, self._numbers(), control.condition, control.contraction), None)
        return log

    @property
    def counts(self):
        """The `Counts`."""
        clock, counters = Clock.from_buffer(self._run), Counters.from_buffer(self._work, COUNTERS)
        return Counts(self._numbers(), counters, clock.largest_landing, self._told.skipped, self._told.has_forces)

    def _numbers(self):
        return Numbers.from_buffer(self._run, NUMBERS)


def _logged(rows):
    log = StepLog()
    log.add(rows)
    return log
