"""The front end of every driver: memory, driver loop, outcome.

An engine is what differs from driver to driver: `StepEngine` for methods with a step kernel, `SeriesEngine` of
tsdyn.taylor for series. It is made of a scene's `Prepared`, a method, a form, and whether anything is asked for between
the ends of steps; serves any number of runs (`Prepared.engine`), and has

    method, form    the form is the one that the driver runs
    kind            of the memory: one of the same kind serves another run
    memory(prepared)            a new `Memory`
    serves(memory)              whether a memory that was made before is that of the scene as it is now
    lay_out(memory)             enter the system, and the numbers and kernels of the method
    reading(memory, prepared, constraint_tol)
                                a `Reading` of the steps, and a picklable function with its arguments that makes it anew
    skipped         bodies without gyroscopic torque, bodies that never turn, constant columns of series
"""

from ..errors import Status
from ..jit.compiled import clock
from ..jit.interrupts import CollectionsDeferred
from .brief import Brief, begin, has_ended_well, limit_of, readings_of
from .counts import Counts
from .run_log import left_open
from .sampling import Sampled
from .segments import Relay
from .slices import drive
from .task import Outcome
from .trajectory import Trajectory

NOT_FINITE, PASSAGE, STIFF = Status.NOT_FINITE, Status.PASSAGE, Status.STIFF


def run(task, engine, observe=None, relay=None, past=None, briefly=False, unfinished=None):
    """Run a `Task` by a kind of engine; the `Outcome`, or a `Brief` where a run of which little is asked allows it.

    `observe` is given the memory before the run: one of its own. With a `Relay` the run is a segment of one; where
    there is a way past singular configurations, it ends with Status.PASSAGE next to one. `past(memory)` makes what is
    advanced in place of the memory.
    """
    prepared = task.prepared
    if unfinished is not None:
        memory = unfinished.memory
        return _end(task, memory, unfinished.begun, unfinished.began, relay)
    engine = prepared.engine(engine, task.method, task.form, task.within)
    memory = None if observe else prepared.take(engine.kind)
    if memory is None or not engine.serves(memory):
        with CollectionsDeferred():
            memory = engine.memory(prepared)
    memory.enter(engine, task, relay is not None and relay.passes)
    if briefly:
        began = clock()
        begun = begin(memory, task.times, task.stops, limit_of(memory.run, task.stops, task.max_steps))
        return _end(task, memory, begun, began, relay)
    readings = readings_of(memory, task)
    if observe is not None:
        observe(memory)
    watch = None
    if relay is not None:
        relay.enter(memory)
    if task.events is not None:
        watch = (relay or Relay()).watching(task, readings[0])
    began = clock()
    advanced = memory if task.sampling is None else Sampled(memory, task.sampling)
    driven = drive(advanced if past is None else past(advanced), task, watch)
    if relay is not None and driven[0] in (PASSAGE, STIFF):
        relay.leave(memory)
        relay.interrupted = driven[2].interrupted
    outcome = _outcome(task, engine, memory, driven, readings, watch, began)
    if watch is not None:
        readings[0].give(watch.reader)
    if observe is None and outcome.status is not NOT_FINITE:  # NaN may be left in what a run takes as its own
        prepared.give(engine.kind, memory)
    return outcome


def _end(task, memory, begun, began, relay):
    """The outcome of a run that has made its first slice."""
    engine = memory.engine
    if has_ended_well(memory, begun):
        outcome = Brief(memory, begun, task, began)
    else:
        driven = drive(memory, task, None, begun)
        if relay is not None and driven[0] in (PASSAGE, STIFF):
            relay.leave(memory)
        outcome = _outcome(task, engine, memory, driven, readings_of(memory, task), None, began)
    if outcome.status is not NOT_FINITE:
        task.prepared.give(engine.kind, memory)
    return outcome


def _outcome(task, engine, memory, driven, readings, watch, began):
    """The `Outcome` of a run that has been driven."""
    status, reason, recorder = driven
    run, control = memory.run, memory.work.control
    charts, last = left_open(run, recorder.charts, control.condition, control.contraction), run.now.copy()
    trajectory = None
    if task.dense_output:
        records = recorder.blocks, charts, recorder.points[: len(charts)].copy()
        trajectory = Trajectory(readings, records, task.span[0], last, task.angles, task.stops)
    found = None if watch is None else watch.found(task.prepared.n)
    return Outcome(
        status, reason, recorder.out, recorder.steps, recorder.chart_history(charts), run.clock.t,
        last, run.remembered.copy(), Counts.of(memory), trajectory, found, began,
    )  # fmt: skip
