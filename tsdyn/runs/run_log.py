"""What a run records and counts: the log, the room for its rows, compact histories, snapshots."""

import ctypes
from collections.abc import Mapping
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from ..jit.kernels import Record, kernel, loader
from ..motions.tracing import LENGTH
from ..validation import EXACT, damaged, demand, is_count
from ..workspaces import STORED, Clock, Counters, LevelControl, RunKernels, RunNumbers
from .tolerances import TRIES

# The log of a run: what is asked of it, and rows of what it records.


class RunLog(NamedTuple):
    """Arrays of a run's own, unlike those of `RunState`: room for a slice of it."""

    t_eval: np.ndarray  # output times, or empty: every step
    stops: np.ndarray  # (stops, 3)  times at which a step ends, increasing, as of `motions.knots.stops_of`
    out: np.ndarray  # (rows, 1 + 3 n + angles + slots)  t, q, qd, qdd, remembered
    history: np.ndarray  # (rows, 3)  of each step tried: t, h, whether it was accepted
    charts: np.ndarray  # (rows, 5)  t, reason, condition, contraction, steps in it; rows are closed when it is left
    points: np.ndarray  # (rows, n + redundant rows)  q0 of each chart and its selection, or (0, n) where nothing asks
    blocks: np.ndarray  # (rows, block)  those of accepted steps


def no_log():
    """An example of its type, of no rows."""
    none = np.zeros((0, 1))
    return RunLog(np.zeros(0), np.zeros((0, 3)), none, none, none, none, none)


load_log = loader(no_log())


@kernel
def is_full(r, log):
    """Return True if there is no room for one more step, and a chart before and after it."""
    return r.numbers.chart_rows + 2 >= log.charts.shape[0] or r.numbers.history >= log.history.shape[0]


@kernel
def note_try(r, log, t, h):
    """A step h from t is tried."""
    row = log.history[r.numbers.history]
    row[0], row[1], row[2] = t, h, 0.0


@kernel
def note_accepted(r, log):
    """The last step tried is accepted."""
    log.history[r.numbers.history - 1, 2] = 1.0


@kernel
def open_chart(r, log, t, reason):
    """A chart is made at t, for this reason."""
    row = log.charts[r.numbers.chart_rows]
    row[0], row[1] = t, reason
    r.numbers.in_chart = 0


@kernel
def close_chart(r, log, condition, contraction):
    """The present chart is left."""
    row = log.charts[r.numbers.chart_rows]
    row[2], row[3], row[4] = condition, contraction, r.numbers.in_chart
    r.numbers.chart_rows += 1


def left_open(run, charts, condition, contraction):
    """The charts (k, 5) of a log, the last of which the run has not left."""
    return with_end(charts[: run.numbers.chart_rows + 1].copy(), run.numbers, condition, contraction)


def with_end(charts, numbers, condition, contraction):
    """Write into the last of some charts how it is where the run has ended."""
    charts[-1, 2:] = condition, contraction, numbers.in_chart
    return charts


# Compact histories of steps and charts: eight bytes a step, nothing for charts that change at every step.
#
# Short histories are stored uncompressed, since a run of 0.1 ms leaves no time for more.

FEW_ROWS, FEW_CHUNKS = 1024, 4


class StepLog:
    """Steps tried, in order: of those accepted the start, as each ends where the next one begins."""

    def __init__(self, parts=()):
        self.chunks = []
        for part in parts:
            self.chunks += part.chunks

    def add(self, rows):
        """Add rows (k, 3): start and length, s, and whether the step was accepted."""
        if _few(rows, self.chunks):
            self.chunks.append(rows.copy())
            return
        # An accepted step ends where the next one begins: its start is enough
        accepted = rows[:, 2] == 1.0
        t, other = rows[accepted, 0].copy(), np.flatnonzero(~accepted)
        ends = np.append(t[1:], np.nan)
        odd = np.flatnonzero(~(ends - t == rows[accepted, 1]))  # the last one, and whatever doesn't follow on
        self.chunks.append((t, odd, rows[accepted, 1][odd], other, rows[other, :2].copy()))

    @property
    def latest(self):
        """Starts (k,) of the steps accepted among the rows added last."""
        if not self.chunks:
            return np.empty(0)
        last = self.chunks[-1]
        return last[last[:, 2] == 1.0, 0] if isinstance(last, np.ndarray) else last[0]

    def arrays(self):
        """Start and length of each step (k,), s, and whether it was accepted."""
        parts = [np.empty((0, 3))]
        for chunk in self.chunks:
            if isinstance(chunk, np.ndarray):
                parts.append(chunk)
                continue
            t, odd, lengths, other, tried = chunk
            rows, accepted = np.empty((t.size + other.size, 3)), np.ones(t.size + other.size, bool)
            accepted[other] = False
            h = np.diff(t, append=np.nan)
            h[odd] = lengths
            rows[accepted, 0], rows[accepted, 1] = t, h
            rows[other, :2], rows[:, 2] = tried, accepted
            parts.append(rows)
        rows = np.concatenate(parts)
        return rows[:, 0].copy(), rows[:, 1].copy(), rows[:, 2] == 1.0


class ChartLog:
    """Charts, in order: column by column, a constant one as a number."""

    def __init__(self, parts=()):
        self.chunks = []
        for part in parts:
            self.chunks += part.chunks

    def add(self, rows, steps):
        """Take rows (k, 5) as of `RunLog.charts`; instants that are the starts of the latest `steps` aren't copied."""
        if _few(rows, self.chunks):
            self.chunks.append(rows)
            return
        if not len(rows):
            return
        starts = steps.latest
        same = np.array_equal(rows[:, 0], starts)
        columns = [_compact(column) for column in (rows[:, 1].astype(np.uint8), rows[:, 2], rows[:, 3])]
        self.chunks.append((starts if same else rows[:, 0].copy(), *columns, _compact(rows[:, 4].astype(np.uint32))))

    def arrays(self):
        """Instant, s, number of the reason, condition, contraction and steps of each chart, (k,) each."""
        columns = zip(*map(_columns, self.chunks), strict=True)
        return [np.concatenate(column) for column in columns]


def _few(rows, chunks):
    return len(rows) < FEW_ROWS and len(chunks) < FEW_CHUNKS


def _columns(chunk):
    return chunk.T if isinstance(chunk, np.ndarray) else [np.broadcast_to(x, chunk[0].shape) for x in chunk]


def _compact(column):
    return column[0] if (column == column[0]).all() else column.copy()


# What a run counts, for `Solution.stats`.

_READ = {
    "steps": attrgetter("numbers.steps"),
    "rejected": attrgetter("numbers.rejected"),
    "evaluations": attrgetter("counters.evaluations"),
    "placements": attrgetter("counters.placements"),
    "newton_iterations": attrgetter("counters.newton"),
    "b_iterations": attrgetter("counters.b_iterations"),
    "charts": attrgetter("counters.charts"),
    "factorizations": attrgetter("counters.factorizations"),
    "stiff": lambda of: bool(of.numbers.stiff),
    "steps_near_singular": attrgetter("numbers.near_steps"),
    "largest_landing": attrgetter("largest_landing"),
    "jacobians": attrgetter("counters.jacobians"),
    "iteration_matrices": attrgetter("counters.iteration_matrices"),
    "stage_iterations": attrgetter("counters.stage_iterations"),
    "solves_skipped": attrgetter("counters.at_rounding"),
    "checks_skipped": attrgetter("counters.unverified"),
    "factorizations_skipped": lambda of: (
        of.counters.kept + of.counters.stage_iterations - of.counters.iteration_matrices
    ),
    "gyroscopic_skipped": lambda of: of.skipped[0] * of.counters.evaluations,
    "rotations_skipped": lambda of: of.skipped[1] * of.counters.evaluations,
    "columns_skipped": lambda of: of.skipped[2] * of.counters.evaluations,
    "forces_skipped": lambda of: 0 if of.has_forces else of.counters.evaluations,
}
NAMES = tuple(_READ)


class Counts(Mapping):
    """The counts of a run by name, each read from its records when it is asked for.

    Parameters
    ----------
    numbers : Numbers
    counters : Counters
        Both at the end of the run, and of its own.
    largest_landing : float, m
    skipped : tuple of int
        What each evaluation skips: torques of bodies with spherical inertia, rotations of bodies that never turn,
        constant columns of markers.
    has_forces : bool
    """

    def __init__(self, numbers, counters, largest_landing, skipped, has_forces):
        self.numbers, self.counters, self.largest_landing = numbers, counters, largest_landing
        self.skipped, self.has_forces = skipped, has_forces

    def __getitem__(self, name):
        return _READ[name](self)

    def __iter__(self):
        return iter(_READ)

    def __len__(self):
        return len(_READ)


# The state of a run between two slices: what a run that goes on begins with, to the bit.
#
# All that kernels see is in the context and in the `RunState` of a memory: arrays and records. What follows from the
# scene and the method (tables, programs, addresses, places in memory) is laid out again by the process that goes on;
# all else is saved. What comes from a file is checked before kernels see it: shapes, and each number that is a place or
# a count.

LAID_OUT = (  # fields that follow from scene and method, or are filled in before they are read
    "system", "graph", "kernels", "friction_solver", "reselection", "joints", "watched", "loaded", "path", "tableau",
    "block", "own", "trial", "table", "of_rates",
)  # fmt: skip
OWN = {  # numbers of records, likewise
    "ChartState": ("turn_limit", "loads_left"),
    "Orders": ("top", "room", "lowest", "highest", "refined", "sweeps"),
    "RunNumbers": (
        "first_order", "adaptive", "steps_wanted", "chart_interval", "free_stages", "dense", "last_stage", "stage_at",
        "rows", "history", "blocks",
    ),
}  # fmt: skip
REMEMBERED = "context.system.remembered"  # reals of the forces that remember something


def demand_noted(noted, rows):
    """Raise ValueError unless each line names rows (of so many), or none by -1: what `note_selection` writes."""
    demand((((noted >= 0.0) & (noted < rows)).all(axis=1) | (noted == -1.0).all(axis=1)).all(), "the redundant rows")


def parts(memory):
    """The arrays and records of a memory by name, to be read and written in place."""
    return {**_parts("context", memory.context), **_parts("run", memory.run)}


def saved(memory):
    """Copies of them."""
    system = memory.context.system
    found = {name: _array(part).copy() for name, part in parts(memory).items()}
    return {**found, REMEMBERED: system.reals[system.memory]}


def restore(memory, arrays, limits):
    """Write them back; limits: of numbers of the `RunState`, by name.

    Raises
    ------
    StorageError
        If shapes differ, or a place is beyond an array.
    """
    system, rows = memory.context.system, len(memory.context.graph.row)
    found, most = {**parts(memory), REMEMBERED: system.reals[system.memory]}, max(rows, memory.context.work.Phi.size)
    with damaged("the checkpoint"):
        for name, part in found.items():
            given, own = arrays[name], _array(part)
            demand(given.shape == own.shape and given.dtype == own.dtype, name)
            if isinstance(part, Record):
                _restore_record(name, part, given, limits)
            elif own.dtype.kind == "i" and own.size:
                demand(given.min() >= 0 and given.max() <= max(most, own.size) and given[0] < max(own.size, 2), name)
        for at, program in _programs(memory.context):
            arrays["context.expansion.loads"][at : at + len(program)] = program
        for name, part in found.items():
            _array(part)[...] = arrays[name]
        system.reals[system.memory] = arrays[REMEMBERED]


def _restore_record(name, record, given, limits):
    """Check the numbers of a record, and put its own ones in the place of those that a file has no say in."""
    kind, own = type(record), OWN.get(type(record).__name__, ())
    found = kind.from_buffer_copy(given)
    for field, what in kind.__annotations__.items():
        if field in own:
            setattr(found, field, getattr(record, field))
            continue
        low, high = (0, limits[field]) if field in limits else (-EXACT, EXACT)
        high = record.highest if (kind.__name__, field) == ("Orders", "next") else high
        demand(what is float or low <= getattr(found, field) <= high, f"{name}.{field}")
    given[...] = np.frombuffer(found, np.uint8)


def _programs(context):
    """The programs of traced functions among the series of loads: where each begins, and a copy of it."""
    expansion = getattr(context, "expansion", None)
    for kind in () if expansion is None else expansion.forces[expansion.forces["run"] != 0]:
        at = int(kind["values"])
        yield at, expansion.loads[at : at + int(expansion.loads[at + LENGTH])].copy()


def _array(part):
    return np.frombuffer(part, np.uint8) if isinstance(part, Record) else part


def _parts(name, value):
    if isinstance(value, tuple):
        found = {}
        for field, part in value._asdict().items():
            if field not in LAID_OUT:
                found.update(_parts(f"{name}.{field}", part))
        return found
    return {} if not isinstance(value, Record) and value.dtype.names else {name: value}


# What a run leaves at its end: the last state, its counts and its histories.

NUMBERS, COUNTERS = ctypes.sizeof(Clock), ctypes.sizeof(LevelControl)  # bytes before them, as `Memory` lays them out
NOW = sum(map(ctypes.sizeof, (Clock, RunNumbers, RunKernels))) // 8  # numbers before q


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
        control, log = LevelControl.from_buffer(self._work), ChartLog()
        log.add(with_end(self._charts, self._numbers(), control.condition, control.contraction), None)
        return log

    @property
    def counts(self):
        """The `Counts`."""
        clock, counters = Clock.from_buffer(self._run), Counters.from_buffer(self._work, COUNTERS)
        return Counts(self._numbers(), counters, clock.largest_landing, self._layout.skipped, self._layout.has_forces)

    def _numbers(self):
        return RunNumbers.from_buffer(self._run, NUMBERS)


def _logged(rows):
    log = StepLog()
    log.add(rows)
    return log


# The records of a run: room for those of a slice, and what earlier slices have recorded.

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
