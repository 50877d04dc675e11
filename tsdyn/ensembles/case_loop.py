"""The compiled loop over cases: each is written into shared arrays and run by series, without Python."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..configuration.initial_conditions import LANDED, RedundantStarts, RegularStarts, consistent
from ..configuration.motor_starts import are_aligned, demand_aligned
from ..errors import Status
from ..formulations.locked_orientations import hold, still
from ..jit.kernels import DEBUG, Record, caller, data_of, entry, integers, kernel, loader, resident, vector
from ..maths.dense_linalg import copy
from ..model.packed import Derived
from ..observables.reactions import demand_unique
from ..observables.state import remembered
from ..runs.driver import FIRST_SLICE, FIRST_WORK
from ..runs.run_log import CHART_ROOM, NO_ROWS, RunEnd, RunLog, no_log
from ..runs.run_memory import call_driver
from ..runs.task import state_arrays
from ..runs.tolerances import LONG_STEPS, TRIES
from ..simulation.local_origin import are_near, origin_of
from ..simulation.parameters import KEPT
from ..taylor.layout import load_series
from ..taylor.series_engine import SeriesEngine
from ..taylor.stepper import advance_series
from ..workspaces import load_run, words
from .case_numbers import OF_ROWS, Place
from .cases import TIMES
from .tolerances import FEW_LONG, MOSTLY, TRIED

# Runs by series that end within the driver's first slice, without the bookkeeping that longer ones need.

COMPLETE = Status.SUCCESS


class Finished(NamedTuple):
    """Of an `Outcome` what an ensemble keeps."""

    end: RunEnd  # its `last` (2, n): q, qd
    rows: np.ndarray  # outputs; valid until the next run


class FirstSlice:
    """Runs a `Task` in the memory of a workspace, if it ends within one slice.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study):
        n, times = study.n, study.times
        self.rows = min(max(FIRST_WORK // n, 1), FIRST_SLICE)
        width = 1 + 3 * n + study.kept.handles.count + study.family.packed.system.memory.size
        self.out = np.empty((times.size or self.rows + 1, width))
        history, charts = np.empty((self.rows + 2 * TRIES, 3)), np.empty((self.rows + CHART_ROOM, 5))  # one a step
        self._long = self._tried = 0
        self.log = RunLog(times, study.stops, self.out, history, charts, NO_ROWS, NO_ROWS)

    @staticmethod
    def serves(study):
        """Return True if nothing is asked of the runs of a study that needs more."""
        options = study.options
        plain = options.events is None and not options.dense_output and options.max_steps is None
        return plain and study.method.driver == "series" and not len(study.stops) and not callable(study.keep)

    def run(self, task):
        """The `Finished` run; None if it hasn't ended well within the slice, or most haven't: it begins again then."""
        kept = task.prepared
        if self._long * MOSTLY > self._tried > TRIED or origin_of(kept.packed, task.q) is not None:
            return None
        engine = kept.engine(SeriesEngine, task.method, task.form, task.within)
        memory = kept.take(engine)
        memory.enter(engine, task, False)
        status, run = memory.advance(self.log, self.rows), memory.run
        self._tried += 1
        self._long += status is Status.SLICE_DONE
        found = None
        if status is COMPLETE and not run.numbers.near_steps:
            found = Finished(RunEnd(run.clock.t, run.now[:2].copy(), *[None] * 4), self.out[: run.numbers.rows])
        if status is not Status.NOT_FINITE:  # NaN may be left
            kept.give(engine.kind, memory)
        return found


# Consistent starts of the cases of a workspace, checked as those of runs alone are.


class Starts:
    """Checks and projects the starts of a workspace, one after the other.

    Attributes
    ----------
    others : list
        The scene with other redundant rows, if there are any: unknown, and none.
    has_other_rows : bool
        Whether other rows were redundant at the last start than at the first.
    """

    def __init__(self, workspace):
        self._workspace, self.others, self.has_other_rows = workspace, [], False
        self._known, self._regular, self._redundant = (None, None), None, None

    def start(self, start):
        """The memory of forces and a consistent start; None if the start needs a scene of its own."""
        workspace, kept, packed = self._workspace, self._workspace.kept, self._workspace.kept.packed
        study = workspace.study
        t, tol, state = study.span[0], study.options.initial_tol, study.call.state
        q, qd = start if state is None else state_arrays(state, kept.n)
        known, found = self._known
        if known is q and not workspace.written & OF_ROWS:
            return found
        memory = remembered(state, kept, t, q)
        if packed.system.memory.size:
            packed.system.reals[packed.system.memory] = memory[kept.handles.count :]
        started = self._started(q, qd, t, tol)
        if started is None or workspace.is_spoilt:
            return None
        if known is not q:
            demand_aligned(packed, started[0], t)
        demand_unique(packed, started[0], t)
        found = memory, hold(packed, *started)
        self._known = q, found
        return found

    def kernel(self):
        """As of `RegularStarts`, once a start has been checked."""
        return self._regular.kernel()

    def _started(self, q, qd, t, tol):
        """A start as `consistent` returns it; None if it needs a scene of its own."""
        workspace, derived = self._workspace, self._workspace.packed.derived
        if self._regular is None:
            self._regular = RegularStarts(workspace.scene, q, qd, t, tol)
        if derived.redundant is None and self._regular.are_plain(q, qd):
            return q, qd
        if workspace.kept.packed.coordinates is not workspace.base.coordinates:
            return None
        if derived.redundant is None:
            return consistent(workspace.scene, workspace.packed.system, q, qd, t, tol, True)
        if self._redundant is None:
            self.others = [self._with_redundant(rows) for rows in (None, np.zeros(0, np.int64))]
            self._redundant = RedundantStarts([*self.others, workspace.scene], q, qd, t, tol)
        started = self._redundant.landed(q, qd)
        self.has_other_rows = started is None
        return started

    def _with_redundant(self, rows):
        """The scene with the same arrays, and other redundant rows."""
        workspace = self._workspace
        derived = Derived(redundant=rows, shared=workspace.study.family.shared)
        for name in KEPT:
            setattr(derived, name, getattr(workspace.packed.derived, name))
        own = SimpleNamespace(**vars(workspace.scene))
        own.packed = workspace.packed._replace(derived=derived)
        return own


SUCCESS = int(Status.SUCCESS)
call_take = caller("pppppidd")


class LoopNumbers(Record):
    """Settings of a loop, and how it ended."""

    most: int  # steps of a case; a longer one is left to Python
    moves: int  # whether starts differ
    may_land: int  # whether they may be projected
    grid: int  # whether outputs are kept, in place of the last state
    driver: int  # address of `advance_series`
    take_start: int  # address of `take_start`; 0 where starts need no check
    start_context: int  # its arguments
    start_rates: int
    start_at: int
    start_count: int
    start_t: float
    start_tol: float
    ran: int  # whether the case at which the loop has ended was run
    status: int  # Status of that run


class Plan(NamedTuple):
    """What cases have in common."""

    numbers: LoopNumbers
    images: np.ndarray  # int64 (k, 3)  what a run finds as it was: address, that of its image or 0 for zeros, words
    places: np.ndarray  # int64 (k, 3)  address, first number in a row of the table, words
    start: np.ndarray  # (2, n)  q, qd of the present case
    log: RunLog


class CaseArrays(NamedTuple):
    """The cases of a chunk, and their results."""

    table: np.ndarray  # (k, width)
    starts: np.ndarray  # (k, 2, n), or (1, 2, n) of all
    fits: np.ndarray  # int64 (k,)  whether a case may be run here
    t: np.ndarray  # (k,)
    q: np.ndarray  # (k, n), or (k, times n)
    qd: np.ndarray
    status: np.ndarray  # int64 (k,)
    stopped: np.ndarray  # int64 (1,)  not 0: the loop ends


def _example():
    integers_, none = np.zeros((0, 3), np.int64), np.zeros((0, 1))
    ones = np.zeros(0, np.int64)
    plan = Plan(LoopNumbers(), integers_, integers_, none, no_log())
    return plan, CaseArrays(none, np.zeros((0, 2, 1)), ones, np.zeros(0), none, none, ones, ones)


load_plan, load_chunk = map(loader, _example())


@kernel
def enter_case(plan, chunk, k):
    """Memory as a run finds it, with the numbers of case k."""
    for i in range(plan.images.shape[0]):
        address, source, count = plan.images[i]
        words = integers(address, count)
        if source == 0:
            for j in range(count):
                words[j] = 0
        else:
            image = integers(source, count)
            for j in range(count):
                words[j] = image[j]
    for i in range(plan.places.shape[0]):
        address, first, count = plan.places[i]
        to = vector(address, count)
        for j in range(count):
            to[j] = chunk.table[k, first + j]


@kernel
def take_start(plan, chunk, k, c, r):
    """The start of case k, made consistent; False if that is left to Python."""
    n, start, given = plan.numbers, plan.start, chunk.starts[min(k, chunk.starts.shape[0] - 1)]
    if n.take_start == 0:
        return True
    for i in range(2):
        copy(given[i], start[i])
    q, qd = data_of(start[0]), data_of(start[1])
    done = call_take(
        n.take_start, n.start_context, q, qd, n.start_rates, n.start_at, n.start_count, n.start_t, n.start_tol
    )
    if done == 0 or (done == LANDED and n.may_land == 0):
        return False
    if n.moves == 1 or done == LANDED:
        for to in (c.work.q, r.now[0]):
            copy(start[0], to)
        for to in (c.work.qd, r.now[1]):
            copy(start[1], to)
    return True


@kernel
def _keep(plan, chunk, k, r):
    """The results of case k."""
    n, q, qd = r.now.shape[1], chunk.q[k], chunk.qd[k]
    chunk.t[k] = r.clock.t
    if plan.numbers.grid == 0:
        for j in range(n):
            q[j], qd[j] = r.now[0, j], r.now[1, j]
    else:
        for i in range(r.numbers.rows):
            row = plan.log.out[i]
            for j in range(n):
                q[i * n + j], qd[i * n + j] = row[1 + j], row[1 + n + j]
    chunk.status[k] = SUCCESS


@entry("ppppii")
def run_cases(context, run, where, chunk_at, first, end):
    """Run cases from `first` on; the first one that was left to Python, or `end`."""
    c, r, plan, chunk = load_series(context), load_run(run), load_plan(where), load_chunk(chunk_at)
    numbers = plan.numbers
    numbers.ran = 0
    for k in range(first, end):
        if chunk.stopped[0] != 0 or chunk.fits[k] == 0:
            return k
        enter_case(plan, chunk, k)
        if not take_start(plan, chunk, k, c, r):
            return k
        status = call_driver(numbers.driver, context, run, plan.log, numbers.most)
        if status != SUCCESS or r.numbers.near_steps != 0:
            numbers.ran, numbers.status = 1, status
            return k
        _keep(plan, chunk, k, r)
    return end


# The cases of a chunk that the compiled loop runs: what it needs of a workspace, laid out once.

NOT_FINITE, SLICE_DONE = int(Status.NOT_FINITE), int(Status.SLICE_DONE)


class Batch:
    """Runs successive cases in the memory of a workspace.

    Parameters
    ----------
    workspace : CaseWorkspace
    task : Task
        Of a case that has ended within the driver's first slice, its start regular.
    first_slice : FirstSlice
    """

    def __init__(self, workspace, task, first_slice):
        self._workspace, self._task, self._slice = workspace, task, first_slice
        self._numbers = LoopNumbers(
            most=first_slice.rows,
            moves=workspace.writer.moves,
            grid=workspace.study.keep == TIMES,
            driver=advance_series.address,
        )
        self._long, self._cases, self._memory, self._places, self._chunk = 0, 0, None, None, None
        self._start = None
        if workspace.writer.moves or workspace.writer.written & OF_ROWS or workspace.writer.geometry is not None:
            numbers, (arguments, self._start) = self._numbers, workspace.starts.kernel()
            (
                numbers.take_start, numbers.start_context, numbers.start_rates, numbers.start_at, numbers.start_count,
                numbers.start_t, numbers.start_tol,
            ) = arguments  # fmt: skip
            numbers.may_land = not still(workspace.packed).bodies.size

    @staticmethod
    def serves(workspace):
        """Whether Python has nothing to do between the cases of a workspace."""
        packed, writer, state = workspace.packed, workspace.writer, workspace.study.call.state
        if DEBUG or writer is None or workspace.kept.n >= LONG_STEPS:
            return False
        # Redundant rows are selected in each case
        selects = writer.moves or writer.written & OF_ROWS or writer.geometry is not None
        if packed.derived.redundant is not None and selects:
            return False
        moved = still(packed).bodies.size or packed.system.memory.size or not workspace.kept.handles.begin_at_zero
        return not (writer.moves and (moved or state is not None))

    def enter(self, chunk):
        """Take the chunk that the workspace's writer has laid out, and arrays for its results."""
        arrays, status = chunk.arrays, chunk.status
        writer, study = self._workspace.writer, self._workspace.study
        fits, packed = writer.fits, self._workspace.packed
        if writer.moves:
            q = writer.starts[:, 0]
            fits = fits & are_near(packed, q) if writer.geometry is None else fits.copy()
            fits[fits] = are_aligned(packed, q[fits], study.span[0])
        count = len(status)
        self._at, *self._chunk = resident(CaseArrays(
            writer.numbers, writer.starts, fits.astype(np.int64), arrays["t"], arrays["q"].reshape(count, -1),
            arrays["qd"].reshape(count, -1), status, study.halt,
        ))  # fmt: skip

    def run(self, k, end):
        """Run cases of the chunk from k on; the first that was not."""
        if self._long * FEW_LONG > self._cases > TRIED:  # longer ones hardly notice Python
            return k
        memory = self._take()
        reached = run_cases(*memory.where, self._plan, self._at, k, end)
        numbers = self._numbers
        self._cases += reached - k + numbers.ran
        self._long += numbers.ran and numbers.status == SLICE_DONE
        if not (numbers.ran and numbers.status == NOT_FINITE):  # NaN may be left
            self._give(memory)
        return reached

    def _take(self):
        """The memory of runs, laid out for this batch."""
        kept, task = self._workspace.kept, self._task
        engine, places = kept.engine(SeriesEngine, task.method, task.form, task.within), self._workspace.writer.places()
        memory = kept.take(engine)
        if memory is not self._memory or places is not self._places:
            self._lay_out(memory, engine, places)
        self._kind = engine.kind
        return memory

    def _give(self, memory):
        """Let others use the memory."""
        self._workspace.kept.give(self._kind, memory)

    def _lay_out(self, memory, engine, places):
        memory.enter(engine, self._task, False)
        self._memory, self._places = memory, places
        arrays = [*memory.entered(), *([] if self._start is None else self._start.entered())]
        arrays = [array for array in arrays if array.size]
        self._images = [(array, array.copy() if array.any() else None) for array in arrays]
        images = [[a.ctypes.data, 0 if b is None else b.ctypes.data, a.nbytes // 8] for a, b in self._images]
        targets = [[place.to.ctypes.data, place.column, place.to.size] for place in (*places, *self._own(memory))]
        start = np.zeros((2, self._workspace.study.n))
        self._plan, *self._kept = resident(Plan(self._numbers, _words(images), _words(targets), start, self._slice.log))

    def _own(self, memory):
        """Places of numbers that follow from points of constraints, in the memory of runs and of starts."""
        writer = self._workspace.writer
        if writer.geometry is None:
            return []
        at, found, control = writer.geometry.column, writer.places_in(self._start.reals), memory.work.control
        found += [Place(_number(each, "size"), at) for each in (control, self._start.work.control)]
        return [*found, Place(_number(control, "u_tol"), at + 1)]


def _number(record, name):
    """A number of a record as an array."""
    at = getattr(type(record), name).offset // 8
    return words(record).view(float)[at : at + 1]


def _words(rows):
    return np.array(rows, np.int64).reshape(-1, 3)
