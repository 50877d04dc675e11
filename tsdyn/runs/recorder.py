"""The records of a run: room for those of a slice, and what earlier slices have recorded."""

import numpy as np

from ..validation import demand, is_count
from ..workspaces.run_state import STORED
from .history import ChartLog, StepLog
from .run_log import RunLog
from .snapshot import demand_noted
from .tolerances import TRIES

CHART_ROOM = 64  # charts of a slice at first, half of what there is room for
LARGEST_SLICE = 1 << 17  # steps, and charts that are kept in one piece
BLOCK_ROOM = 1 << 22  # floats of a slice's blocks
NO_ROWS = np.empty((0, 1))


class Recorder:
    """All that a run records, slice by slice.

    Attributes
    ----------
    log : RunLog
        Of the present slice.
    out, blocks : ndarray
        After `close`: those of the whole run.
    steps : StepLog
        Or None, where no history is kept.
    passed : ChartLog
        The charts before those of the log; or None.
    most : int
        Steps of a slice at most.
    interrupted : bool
        Whether Ctrl-C came when the run had ended, perhaps for another segment to go on.
    """

    interrupted = False

    def __init__(self, task, run, redundant):
        self.run, self.times, self.stops, self.archive = run, task.times, task.stops, task.archive
        self.per_step, self.dense = task.times.size == 0, run.numbers.dense == STORED
        self.steps, self.passed = (StepLog(), ChartLog()) if task.history and not self.archive else (None, None)
        self.most = max(BLOCK_ROOM // run.block.size, 1) if self.dense else LARGEST_SLICE
        n, rooms = run.now.shape[1], 2 * CHART_ROOM
        self.charts = np.empty((rooms, 5))
        self.points = np.zeros((rooms, n + redundant)) if run.numbers.dense else NO_ROWS  # series write none
        self._width = 1 + 3 * n + run.remembered.size
        self.out = NO_ROWS if self.per_step else np.empty((task.times.size, self._width))
        self.blocks, self.log = NO_ROWS, None
        self._parts, self._count = ([], []), 0  # of out and blocks; outputs in the archive

    def begin_slice(self, rows):
        """Make room for a slice of so many steps; what was recorded before is kept."""
        if self.log is not None:
            self.collect()
            self._make_room_for_charts()
        if self.per_step:
            self.out = np.empty((rows + 1, self._width))
        if self.dense:
            self.blocks = np.empty((rows, self.run.block.size))
        history = np.empty((rows + 2 * TRIES, 3))
        self.log = RunLog(self.times, self.stops, self.out, history, self.charts, self.points, self.blocks)

    def adopt(self, log):
        """Go on from a first slice whose records are in this log."""
        self.log, self.out, self.charts, self.points, self.blocks = log, log.out, log.charts, log.points, log.blocks

    def close(self):
        """Put the slices together."""
        run = self.run.numbers
        self.collect()
        if self.archive is not None:
            self.out = range(self._count)
            return
        if not self.dense and run.chart_rows > CHART_ROOM:  # fewer are logged with the last one
            self._pass_charts()
        self.out = _joined(self._parts[0], self._width) if self.per_step else self.out[: run.rows]
        if self.dense:
            self.blocks = _joined(self._parts[1], self.run.block.size)

    def chart_history(self, charts):
        """The history of charts, with those that are left at the end; or None."""
        self._log_charts(charts)
        return self.passed

    def saved(self):
        """Outputs so far, and arrays: the charts that are logged, the last of them open."""
        rows = self.run.numbers.chart_rows + 1
        return self._count, {"recorder.charts": self.charts[:rows].copy(), "recorder.points": self.points[:rows].copy()}

    def restore(self, count, arrays, rows):
        """As it was when it was saved; rows: how many there are to select from."""
        self._count, charts, points = count, arrays["recorder.charts"], arrays["recorder.points"]
        demand(is_count(count), "the number of outputs")
        demand(charts.dtype == points.dtype == float and charts[0].shape == self.charts[0].shape, "the charts")
        demand(points.shape == (len(charts) if len(self.points) else 0, self.points.shape[1]), "the points of charts")
        demand_noted(points[:, self.run.now.shape[1] :], rows)
        while len(self.charts) < len(charts) + CHART_ROOM:
            self.charts, self.points = _doubled(self.charts), _doubled(self.points)
        self.charts[: len(charts)], self.points[: len(points)] = charts, points

    def collect(self):
        """Take what the slice has written, so that the driver begins at the first rows again."""
        run, (out, blocks) = self.run.numbers, self._parts
        # A store takes outputs and steps at once
        if self.archive is not None:
            self.archive.add("outputs", self.out[: run.rows])
            self.archive.add("steps", self.log.history[: run.history])
            self._count += run.rows
            run.rows = 0
        # Parts are joined at the end
        if self.per_step and run.rows:
            out.append(self.out[: run.rows])
            run.rows = 0
        if self.dense and run.blocks:
            blocks.append(self.blocks[: run.blocks])
            run.blocks = 0
        if run.history:
            if self.steps is not None:
                self.steps.add(self.log.history[: run.history])
            run.history = 0

    def _make_room_for_charts(self):
        full = self.run.numbers.chart_rows + CHART_ROOM > len(self.charts)
        if not self.dense:
            self._pass_charts()
        if full and (self.dense or len(self.charts) < LARGEST_SLICE):
            self.charts, self.points = _doubled(self.charts), _doubled(self.points)

    def _pass_charts(self):
        """Log the charts that have been left, and let the present one be the first."""
        run, charts, points = self.run.numbers, self.charts, self.points
        # The chart that is still open goes on as the first
        left = run.chart_rows
        self._log_charts(charts[:left].copy())
        charts[0], points[:1] = charts[left], points[left : left + 1]
        run.chart_rows = 0

    def _log_charts(self, charts):
        if self.archive is not None:
            self.archive.add("charts", charts)
        if self.passed is not None:
            self.passed.add(charts, self.steps)


def _doubled(rows):
    return np.concatenate((rows, np.zeros_like(rows)))


def _joined(parts, width):
    """A new array of all parts."""
    return parts[0].copy() if len(parts) == 1 else np.concatenate((np.empty((0, width)), *parts))
