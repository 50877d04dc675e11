"""The front end of every driver: memory, driver loop, outcome.

An engine is what differs from driver to driver: `StepEngine` for methods with a step kernel, `SeriesEngine` of
tsdyn.taylor for series. It is made of a `Task` and has

    task            the task as the driver runs it
    kind            of the memory: one of the same kind serves another run
    memory()        a new `Memory`
    serves(memory)  whether a memory that was made before is that of the scene as it is now
    enter(memory)   clear it, and enter the task
    reading(memory) a `Reading` of the steps, and a picklable function with its arguments that makes it anew
    skipped         bodies without gyroscopic torque, bodies that never turn, constant columns of series
"""

import time

from ..errors import Status
from ..workspaces.run_state import FILLED, STORED
from .run_log import left_open
from .sampling import Sampled
from .segments import Relay
from .slices import drive
from .task import Outcome
from .trajectory import Trajectory


def run(task, engine, observe=None, relay=None, past=None):
    """Run a `Task` by a kind of engine; the `Outcome`.

    `observe` is given the memory before the run: one of its own. With a `Relay` the run is a segment of one, and ends
    with Status.PASSAGE next to a singular configuration that there is a way past. `past(memory)` makes what is advanced
    in place of the memory.
    """
    engine = engine(task)
    task, prepared = engine.task, engine.task.prepared
    memory = None if observe else prepared.take(engine.kind, engine.memory)
    if memory is None or not engine.serves(memory):
        memory = engine.memory()
    engine.enter(memory)
    memory.set_out(task, STORED if task.dense_output else FILLED if task.events is not None else 0, relay is not None)
    memory.load()
    reading, again = engine.reading(memory) if memory.run.numbers.dense else (None, None)
    if observe is not None:
        observe(memory)
    relay = relay or Relay()
    relay.enter(memory)
    watch, began = relay.watching(task, reading), time.perf_counter()
    advanced = memory if task.sampling is None else Sampled(memory, task.sampling)
    driven = drive(advanced if past is None else past(advanced), task, watch)
    relay.leave(memory)
    outcome = _outcome(engine, memory, driven, (reading, again), watch, began)
    if observe is None and outcome.status != Status.NOT_FINITE:  # NaN may be left in what a run takes as its own
        prepared.give(engine.kind, memory)
    return outcome


def _outcome(engine, memory, driven, readings, watch, began):
    """The `Outcome` of a run that has been driven."""
    status, reason, recorder = driven
    task, run, control = engine.task, memory.run, memory.work.control
    charts, last = left_open(run, recorder.charts, control.condition, control.contraction), run.now.copy()
    trajectory = None
    if task.dense_output:
        records = recorder.blocks, charts, recorder.points[: len(charts)].copy()
        trajectory = Trajectory(readings, records, task.span[0], last, task.angles, task.stops)
    found = None if watch is None else watch.found(task.prepared.n)
    return Outcome(
        status, reason, recorder.out, recorder.steps, recorder.chart_history(charts), run.clock.t,
        last, run.remembered.copy(), counts(memory, *engine.skipped), trajectory, found, began,
    )  # fmt: skip


def counts(memory, no_spin, no_turn, constant_columns):
    """What `Solution.stats` counts.

    Of what each evaluation skips: the torques of no_spin bodies, the rotations of no_turn, so many columns of markers.
    """
    numbers, counters = memory.run.numbers, memory.work.counters
    evaluations = counters.evaluations
    return {
        "steps": numbers.steps,
        "rejected": numbers.rejected,
        "evaluations": evaluations,
        "placements": counters.placements,
        "newton_iterations": counters.newton,
        "b_iterations": counters.b_iterations,
        "charts": counters.charts,
        "factorizations": counters.factorizations,
        "stiff": bool(numbers.stiff),
        "steps_near_singular": numbers.near_steps,
        "largest_landing": memory.run.clock.largest_landing,
        "jacobians": counters.jacobians,
        "iteration_matrices": counters.iteration_matrices,
        "stage_iterations": counters.stage_iterations,
        "solves_skipped": counters.at_rounding,
        "checks_skipped": counters.unverified,
        "factorizations_skipped": counters.kept + counters.stage_iterations - counters.iteration_matrices,
        "gyroscopic_skipped": no_spin * evaluations,
        "rotations_skipped": no_turn * evaluations,
        "columns_skipped": constant_columns * evaluations,
        "forces_skipped": 0 if memory.packed.loads else evaluations,
    }
