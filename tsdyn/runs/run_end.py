"""What a run leaves at its end: the last state, its counts and its histories."""

import ctypes
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..workspaces.run_state import Clock, Kernels, Numbers
from ..workspaces.workspace import Control, Counters
from .counts import Counts
from .history import FEW_ROWS, ChartLog, StepLog
from .run_log import with_end

NUMBERS, COUNTERS = ctypes.sizeof(Clock), ctypes.sizeof(Control)  # bytes before them, as `Memory` lays them out
NOW = sum(map(ctypes.sizeof, (Clock, Numbers, Kernels))) // 8  # numbers before q


class RunEnd(NamedTuple):
    """The end of a run; n coordinates."""

    reached: float  # s
    last: np.ndarray  # (3, n)  q, qd, qdd there
    remembered: np.ndarray  # (angles + slots,)  there
    counts: Mapping  # of `Solution.stats`
    steps: StepLog  # or None
    charts: ChartLog  # or None

    @property
    def near_steps(self):
        """Steps near singular configurations."""
        return self.counts["steps_near_singular"]


class RecordedEnd:
    """The same, read from copies of a memory's records when it is asked for.

    Parameters
    ----------
    memory : Memory
        At the end of the run.
    steps : StepLog or ndarray (k, 3), or None
        An array is the memory's, and copied.
    charts : ChartLog or ndarray (k, 5), or None
        Likewise; the last row is of the chart that the run has not left.
    """

    __slots__ = ("_charts", "_layout", "_run", "_steps", "_work", "near_steps")

    def __init__(self, memory, steps, charts):
        self._layout, self._run, self._work = memory.layout, memory.run_state.copy(), memory.state.copy()
        if isinstance(steps, np.ndarray):
            steps, charts = steps.copy() if len(steps) < FEW_ROWS else _logged(steps), charts.copy()
        self._steps, self._charts, self.near_steps = steps, charts, memory.run.numbers.near_steps

    @property
    def reached(self):
        """Time, s."""
        return float(self._run[0])

    @property
    def last(self):
        """q, qd, qdd there, (3, n)."""
        n = self._layout.n
        return self._run[NOW : NOW + 3 * n].reshape(3, n)

    @property
    def remembered(self):
        """Angles of joints there, and what forces remember."""
        at = NOW + 6 * self._layout.n
        return self._run[at : at + self._layout.remembered]

    @property
    def steps(self):
        """The `StepLog`, or None."""
        return _logged(self._steps) if isinstance(self._steps, np.ndarray) else self._steps

    @property
    def charts(self):
        """The `ChartLog`, or None."""
        if not isinstance(self._charts, np.ndarray):
            return self._charts
        control, log = Control.from_buffer(self._work), ChartLog()
        log.add(with_end(self._charts, self._numbers(), control.condition, control.contraction), None)
        return log

    @property
    def counts(self):
        """The `Counts`."""
        clock, counters = Clock.from_buffer(self._run), Counters.from_buffer(self._work, COUNTERS)
        return Counts(self._numbers(), counters, clock.largest_landing, self._layout.skipped, self._layout.has_forces)

    def _numbers(self):
        return Numbers.from_buffer(self._run, NUMBERS)


def _logged(rows):
    log = StepLog()
    log.add(rows)
    return log
