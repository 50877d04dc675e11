"""The records of a run: room for those of a slice, and what earlier slices have recorded."""

import numpy as np

from ..workspaces.run_state import STORED
from .history import ChartLog, StepLog
from .run_log import RunLog

CHART_ROOM = 64  # charts of a slice at first, half of what there is room for
LARGEST_SLICE = 1 << 17  # steps, and charts that are kept in one piece
BLOCK_ROOM = 1 << 22  # floats of a slice's blocks


class Recorder:
    """All that a run records, slice by slice.

    Attributes
    ----------
    log : RunLog
        Of the present slice. After `close`, out, blocks and charts are those of the whole run, but for charts that
        are in `passed`.
    steps : StepLog
        Or None, where no history is kept.
    passed : ChartLog
        The charts before those of the log; or None.
    most : int
        Steps of a slice at most.
    """

    def __init__(self, task, run):
        self.run, self.per_step, self.dense = run, task.times.size == 0, run.numbers.dense == STORED
        self.steps, self.passed = (StepLog(), ChartLog()) if task.history else (None, None)
        self.most = max(BLOCK_ROOM // run.block.size, 1) if self.dense else LARGEST_SLICE
        n = run.now.shape[1]
        charts, points = np.zeros((2 * CHART_ROOM, 5)), np.zeros((2 * CHART_ROOM if run.numbers.dense else 0, n))
        none, out = np.empty((0, 3)), np.empty((task.times.size, 1 + 3 * n + run.remembered.size))
        self.log = RunLog(task.times, task.stops, out, none, charts, points, np.empty((0, run.block.size)))
        self._out, self._blocks = [], []

    def begin_slice(self, rows):
        """Make room for a slice of so many steps; what was recorded before is kept."""
        run, log = self.run.numbers, self.log
        self._collect()
        charts, points = log.charts, log.points
        full = run.chart_rows + CHART_ROOM > len(charts)
        if not self.dense and run.chart_rows:
            self._pass_charts()
        if full and (self.dense or len(charts) < LARGEST_SLICE):
            charts, points = _doubled(charts), _doubled(points)
        self.log = log._replace(
            out=np.empty((rows + 1, log.out.shape[1])) if self.per_step else log.out,
            history=np.empty((rows, 3)),
            charts=charts,
            points=points,
            blocks=np.empty((rows if self.dense else 0, log.blocks.shape[1])),
        )

    def close(self):
        """Put the slices together."""
        run, log = self.run.numbers, self.log
        self._collect()
        if not self.dense and run.chart_rows > CHART_ROOM:  # fewer are logged with the last one
            self._pass_charts()
        self.log = log._replace(
            out=_joined(log.out, self._out) if self.per_step else log.out[: run.rows],
            blocks=_joined(log.blocks, self._blocks) if self.dense else log.blocks,
        )

    def chart_history(self, charts):
        """The history of charts, with those that are left at the end; or None."""
        if self.passed is not None:
            self.passed.add(charts, self.steps)
        return self.passed

    def _collect(self):
        """Take what the slice has written, so that the driver begins at the first rows again."""
        run, log = self.run.numbers, self.log
        if self.per_step and run.rows:
            self._out.append(log.out[: run.rows])
            run.rows = 0
        if self.dense and run.blocks:
            self._blocks.append(log.blocks[: run.blocks])
            run.blocks = 0
        if run.history:
            if self.steps is not None:
                self.steps.add(log.history[: run.history])
            run.history = 0

    def _pass_charts(self):
        """Log the charts that have been left, and let the present one be the first."""
        run, charts, points = self.run.numbers, self.log.charts, self.log.points
        left = run.chart_rows
        if self.passed is not None:
            self.passed.add(charts[:left], self.steps)
        charts[0], points[:1] = charts[left], points[left : left + 1]
        run.chart_rows = 0


def _doubled(rows):
    return np.concatenate((rows, np.empty_like(rows)))


def _joined(rows, parts):
    """The parts in one array, which is none of theirs."""
    return parts[0].copy() if len(parts) == 1 else np.concatenate((rows[:0], *parts))
