"""A run in slices: repeated calls of the compiled driver, with room for the records of each slice."""

import time
from typing import NamedTuple

import numpy as np

from ..errors import InconsistentState, SingularConfiguration, Status
from .history import ChartLog, StepLog
from .run_state import (
    ADAPTIVE,
    BEGUN,
    BLOCKS,
    CHART_ROWS,
    DENSE,
    HISTORY,
    ROWS,
    STEPS,
    STEPS_WANTED,
    STIFF,
    STORED,
    Record,
    T,
)
from .sampling import Sampled
from .task import Outcome

SLICE_SECONDS = 0.2  # how often a run comes back to Python: progress, interrupts
LARGEST_SLICE, CHART_ROOM = 1 << 17, 64
FIRST_SLICE, FIRST_WORK = 1024, 1 << 17  # steps; coordinates stepped on, unless that is less than a step
PACED, HOPELESS = 1000, 1e10  # steps tried over which a run's pace is taken; as many to go are too many
BLOCK_ROOM = 1 << 22  # floats of a slice's blocks


class Recorded(NamedTuple):
    """All that a run has recorded: rows as in `Record`, and histories."""

    out: np.ndarray
    blocks: np.ndarray
    charts: np.ndarray  # those that blocks refer to, if any, and the last one
    points: np.ndarray
    steps: StepLog  # or None
    passed: ChartLog  # charts before those, or None

    def log(self, charts):
        """The history of charts with those that are left at the end, or None."""
        if self.passed is not None:
            self.passed.add(charts, self.steps)
        return self.passed


class Driven(NamedTuple):
    """A run that has been driven to its end."""

    status: Status
    reason: str
    recorded: Recorded
    watch: object  # of its events, or None
    began: float  # time.perf_counter() then

    def outcome(self, task, run, charts, counted, trajectory):
        """The `Outcome`; counted is what `Solution.stats` has of it, charts are those left at the end."""
        recorded, watch = self.recorded, self.watch
        found = None if watch is None else watch.found(task.prepared.n)
        return Outcome(
            self.status, self.reason, recorded.out, recorded.steps, recorded.log(charts), float(run.clock[T]),
            run.now.copy(), run.remembered.copy(), counted, trajectory, found, self.began,
        )  # fmt: skip


class Pace:
    """Whether a run gets on: an adaptive one whose steps stay so short that it would never end is ended.

    Parameters
    ----------
    t : float, s
        Where it begins.
    """

    def __init__(self, t):
        self.t, self.tries, self.before = t, 0, 0.0  # since when, how many; s a try before that

    def judge(self, t, tries, end):
        """Status, and what there is to say: of a run that is at t after so many more tries."""
        self.tries += tries
        if self.tries < PACED:
            return Status.SLICE_DONE, ""
        before, now = self.before, (t - self.t) / self.tries
        self.t, self.tries, self.before = t, 0, now
        if now > 0.0 and (end - t <= HOPELESS * now or now > 2.0 * before):
            return Status.SLICE_DONE, ""
        left = f"{(end - t) / now:.0e} more" if now > 0.0 else "infinitely many more"
        return Status.STEP_COLLAPSED, (
            f"At the pace of the last {PACED} steps the rest would take {left}; give max_steps to continue."
        )


def drive_part(memory, task, relay, reading, past=None):
    """Drive a run that goes on from what the relay knows; `Driven`. `past(memory)` makes what is driven of it."""
    relay.enter(memory)
    watch = relay.watching(task, reading)
    began = time.perf_counter()
    driven = memory if task.sampling is None else Sampled(memory, task.sampling)
    status, reason, recorded = drive(driven if past is None else past(driven), task, watch)
    relay.leave(memory)
    return Driven(status, reason, recorded, watch, began)


def drive(memory, task, watch):
    """Drive a run; return Status, message and `Recorded`.

    A slice is short enough for Ctrl-C to be answered at once: the first by the memory's `weight`, which is the number
    of coordinates where a step is O(N) and more where it is not, the others by the time that the last took.
    `task.choose(run)` is asked when the motion is found stiff; where it says so the run ends with Status.STIFF.
    """
    run, numbers, times, choose = memory.run, memory.run.numbers, task.times, task.choose
    t0, t1 = task.span
    limit = int(numbers[STEPS_WANTED]) + len(task.stops) if task.max_steps is None else task.max_steps
    per_step, dense = times.size == 0, numbers[DENSE] == STORED
    n, block = run.now.shape[1], run.block.size
    most = min(max(FIRST_WORK // memory.weight, 1), FIRST_SLICE)
    width = 1 + 3 * n + run.remembered.size
    largest = max(BLOCK_ROOM // block, 1) if dense else LARGEST_SLICE
    chunks = {"out": [], "blocks": []}
    steps, passed = (StepLog(), ChartLog()) if task.history else (None, None)
    pace = Pace(t0)

    def room(rows, out, charts, points):
        """A record for the next slice, of so many rows, besides what goes on being filled."""
        out = np.empty((rows + 1, width)) if per_step else out
        return Record(
            times, task.stops, out, np.empty((rows, 3)), charts, points, np.empty((rows if dense else 0, block))
        )

    rows = min(most, limit)
    charts, points = np.zeros((2 * CHART_ROOM, 5)), np.zeros((2 * CHART_ROOM if numbers[DENSE] else 0, n))
    record = room(rows, np.empty((times.size, width)), charts, points)
    status, reason = Status.SLICE_DONE, ""
    try:
        while True:
            started = time.perf_counter()
            if watch is None:
                status = memory.advance(record, rows)
            else:
                status, reason = watch.advance(memory, record, rows)
            seconds = time.perf_counter() - started
            if not numbers[BEGUN]:
                singular = status in (Status.SINGULAR, Status.MASS_SINGULAR)
                kind = SingularConfiguration if singular else InconsistentState
                raise kind(f"no step could be made from the start. {status.sentence} {status.remedy}")
            if seconds > 2 * SLICE_SECONDS:
                most = max(int(rows * SLICE_SECONDS / seconds), 1)
            elif seconds < SLICE_SECONDS / 2 and numbers[HISTORY] == rows:
                most = min(2 * most, largest)
            if choose is not None and numbers[STIFF] and status == Status.SLICE_DONE:
                if choose(run):
                    status = Status.STIFF
                choose = None
            try:
                task.report((run.clock[T] - t0) / (t1 - t0))
            except Exception as error:  # what has been computed is worth more than a progress bar
                if status == Status.SLICE_DONE:
                    status, reason = Status.INTERRUPTED, f"progress raised {type(error).__name__}: {error}."
            if status == Status.SLICE_DONE and task.max_steps is None and numbers[ADAPTIVE]:
                status, reason = pace.judge(float(run.clock[T]), int(numbers[HISTORY]), t1)
            left = limit - int(numbers[STEPS])
            if status != Status.SLICE_DONE:
                break
            if left <= 0:
                status = Status.MAX_STEPS
                break
            _collect(numbers, record, chunks, per_step, dense, steps)
            rows, charts, points = min(most, left), record.charts, record.points
            full = numbers[CHART_ROWS] + CHART_ROOM > len(charts)
            if not dense:
                _pass_by(numbers, charts, points, steps, passed)
            if full and (dense or len(charts) < LARGEST_SLICE):
                charts, points = _doubled(charts), _doubled(points)
            record = room(rows, record.out, charts, points)
    except KeyboardInterrupt:
        if watch is not None:
            watch.go_back(run, record)
        if run.clock[T] >= t1:
            status = Status.SUCCESS
        elif status == Status.SLICE_DONE:
            status = Status.INTERRUPTED
    finally:
        task.report(None)
    reason = reason or memory.reason
    _collect(numbers, record, chunks, per_step, dense, steps)
    if not dense and numbers[CHART_ROWS] > CHART_ROOM:  # fewer are logged with the last one
        _pass_by(numbers, record.charts, record.points, steps, passed)
    out = _joined(record.out, chunks["out"]) if per_step else record.out[: numbers[ROWS]]
    blocks = _joined(record.blocks, chunks["blocks"]) if dense else record.blocks
    return status, reason, Recorded(out, blocks, record.charts, record.points, steps, passed)


def _collect(numbers, record, chunks, per_step, dense, steps):
    if per_step and numbers[ROWS]:
        chunks["out"].append(record.out[: numbers[ROWS]])
        numbers[ROWS] = 0
    if dense and numbers[BLOCKS]:
        chunks["blocks"].append(record.blocks[: numbers[BLOCKS]])
        numbers[BLOCKS] = 0
    if numbers[HISTORY]:
        if steps is not None:
            steps.add(record.history[: numbers[HISTORY]])
        numbers[HISTORY] = 0


def _pass_by(numbers, charts, points, steps, passed):
    """Log the charts that have been left, and let the present one be the first."""
    left = numbers[CHART_ROWS]
    if passed is not None:
        passed.add(charts[:left], steps)
    charts[0], points[:1] = charts[left], points[left : left + 1]
    numbers[CHART_ROWS] = 0


def _doubled(rows):
    return np.concatenate((rows, np.empty_like(rows)))


def _joined(rows, parts):
    """The parts in one array, which is none of theirs."""
    return parts[0].copy() if len(parts) == 1 else np.concatenate((rows[:0], *parts))
