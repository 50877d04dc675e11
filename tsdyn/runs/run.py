"""The front end of every driver: memory, driver loop, outcome.

An engine is what differs from driver to driver: `StepEngine` for methods with a step kernel, `SeriesEngine` of
tsdyn.taylor for series. It is made of a scene's `Prepared`, a method, a form, and whether anything is asked for between
the ends of steps; serves any number of runs (`Prepared.engine`), and has

    method, form    the form is the one that the driver runs
    kind            of the memory: one of the same kind serves another run
    layouts         how many memories have been laid out for it
    memory(prepared)            a new `Memory`
    serves(memory)              whether a memory that was made before is that of the scene as it is now
    lay_out(memory)             enter the system, and the numbers and kernels of the method
    reading(memory, prepared, constraint_tol)
                                a `Reading` of the steps, and a picklable function with its arguments that makes it anew
    skipped         bodies without gyroscopic torque, bodies that never turn, constant columns of series
"""

from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..jit.compiled import clock
from ..rows.interface import redundant_of
from . import slices
from .recorder import CHART_ROOM, NO_ROWS
from .run_end import RecordedEnd
from .run_log import RunLog, left_open
from .sampling import Sampled
from .segments import SegmentLink
from .task import Outcome
from .tolerances import TRIES
from .trajectory import Trajectory

SUCCESS, NOT_FINITE, PASSAGE, STIFF = Status.SUCCESS, Status.NOT_FINITE, Status.PASSAGE, Status.STIFF


class StartedRun(NamedTuple):
    """A run after its first slice."""

    log: RunLog
    rows: int  # steps that there was room for
    status: Status  # None where Ctrl-C was pressed meanwhile
    began: float  # by `jit.compiled.clock`


class SliceArrays(NamedTuple):
    """Where a memory keeps the records of a first slice."""

    first: int  # slices.FIRST_SLICE
    most: int  # steps
    width: int  # of a row of outputs
    history: np.ndarray
    charts: np.ndarray


def begin(task, engine, passes):
    """Run the first slice of a `Task`: its `Outcome` and None; None, memory and `StartedRun` if it goes on.

    Nothing is asked of the run between its slices. passes: whether it ends next to a singular configuration.
    """
    prepared = task.prepared
    engine = prepared.engine(engine, task.method, task.form, task.within)
    memory = prepared.take(engine)
    memory.enter(engine, task, passes)
    log, rows = _log_of(memory, task)
    began = clock()
    try:
        status = memory.advance(log, rows)
    except KeyboardInterrupt:
        status = None
    if status is not SUCCESS or memory.run.numbers.near_steps:
        return None, (memory, StartedRun(log, rows, status, began))
    outcome = _ended(task, memory, log, began)
    prepared.give(engine.kind, memory)
    return outcome, None


def run(task, engine, observe=None, link=None, past=None, begun=None):
    """Run a `Task` by a kind of engine; the `Outcome`.

    `observe` is given the memory before the run: one of its own. With a `SegmentLink` the run is a segment; where
    there is a way past singular configurations, it ends with Status.PASSAGE next to one. `past(memory)` makes what is
    advanced in place of the memory. begun: memory and `StartedRun` of a run that has begun.
    """
    prepared = task.prepared
    if begun is None:
        engine = prepared.engine(engine, task.method, task.form, task.within)
        memory, first = prepared.take(engine) if observe is None else prepared.new_memory(engine), None
        memory.enter(engine, task, link is not None and link.passes)
        if observe is not None:
            observe(memory)
        if link is not None:
            link.enter(memory)
    else:
        memory, first = begun
    readings, watch = _readings(memory, task), None
    if task.events is not None:
        watch = (link or SegmentLink()).watching(task, readings[0])
    began = clock() if first is None else first.began
    advanced = memory if task.sampling is None else Sampled(memory, task.sampling)
    driven = slices.drive(advanced if past is None else past(advanced), task, watch, first)
    if link is not None and driven[0] in (PASSAGE, STIFF):
        link.leave(memory)
        link.interrupted = driven[2].interrupted
    outcome = _driven(task, memory, driven, readings, watch, began)
    if watch is not None:
        readings[0].give(watch.reader)
    if observe is None and outcome.status is not NOT_FINITE:  # NaN may be left in what a run takes as its own
        prepared.give(memory.engine.kind, memory)
    return outcome


def _log_of(memory, task):
    """The `RunLog` of the first slice of a run, and the steps that there is room for."""
    arrays, times = memory.arrays, task.times
    if arrays is None or arrays.first != slices.FIRST_SLICE:
        arrays = memory.arrays = _arrays_of(memory)
    rows, blocks = min(arrays.most, slices.step_limit(memory.run, task)), (NO_ROWS, NO_ROWS)
    if task.dense_output:
        n, redundant = memory.run.now.shape[1], len(redundant_of(memory.context.tangent))
        blocks = np.zeros((2 * CHART_ROOM, n + redundant)), np.empty((rows, memory.run.block.size))
    out = np.empty((times.size or rows + 1, arrays.width))
    return RunLog(times, task.stops, out, arrays.history, arrays.charts, *blocks), rows


def _arrays_of(memory):
    most, run = slices.first_slice(memory.weight), memory.run
    history, charts = np.empty((most + 2 * TRIES, 3)), np.empty((2 * CHART_ROOM, 5))
    return SliceArrays(slices.FIRST_SLICE, most, 1 + run.now.size + run.remembered.size, history, charts)


def _ended(task, memory, log, began):
    """The `Outcome` of a run that has ended well within its first slice."""
    numbers, steps, charts, trajectory = memory.run.numbers, None, None, None
    rows = log.out if len(log.out) == numbers.rows else log.out[: numbers.rows]
    if not log.t_eval.size:  # there was room for more steps
        rows = rows.copy()
    if task.history:
        steps, charts = log.history[: numbers.history], log.charts[: numbers.chart_rows + 1]
    if task.dense_output:
        trajectory = _trajectory(task, memory, log, log.blocks[: numbers.blocks].copy(), _readings(memory, task))
    return Outcome(SUCCESS, "", rows, RecordedEnd(memory, steps, charts), trajectory, None, began)


def _driven(task, memory, driven, readings, watch, began):
    """The `Outcome` of a run that has been driven."""
    status, reason, recorder = driven
    trajectory = _trajectory(task, memory, recorder, recorder.blocks, readings) if task.dense_output else None
    end = RecordedEnd(memory, recorder.steps, recorder.chart_history(_charts(memory, recorder)))
    found = None if watch is None else watch.found(task.prepared.n)
    return Outcome(status, reason, recorder.out, end, trajectory, found, began)


def _charts(memory, log):
    """The charts (k, 5) of a `RunLog` or a `Recorder`, the last of them as the run has ended in it."""
    control = memory.work.control
    return left_open(memory.run, log.charts, control.condition, control.contraction)


def _trajectory(task, memory, log, blocks, readings):
    """The `Trajectory` of a run that has ended; log: as of `_charts`."""
    charts = _charts(memory, log)
    records = blocks, charts, log.points[: len(charts)].copy()
    return Trajectory(readings, records, task.span[0], memory.run.now.copy(), task.angles, task.stops)


def _readings(memory, task):
    """How the steps of a run are read, in this process and in others; None, None where nothing asks for it.

    The same for all runs of an engine, so that a reader serves again.
    """
    if not memory.run.numbers.dense:
        return None, None
    engine, packed, tol = memory.engine, task.prepared.packed, task.constraint_tol
    of, found = engine.readings
    if of is None or of[0] is not packed or of[1] != tol:
        found = engine.reading(memory, task.prepared, tol)
        engine.readings = (packed, tol), found
    return found
