"""The Python side of the Taylor driver; see task.py."""

import numpy as np

from ..errors import InvalidArgument, Status
from ..runs.run_state import CHART_ROWS, FILLED, STORED
from ..runs.segments import Relay
from ..runs.slices import drive_part
from ..runs.step_run import counts
from ..runs.trajectory import Trajectory
from .layout import is_far, refusal, room
from .run_memory import Series, SeriesMemory
from .step_parts import accelerate_here, expand_far_series, expand_series, pass_singular, reach
from .trajectory import SeriesReader


def addresses(within, far):
    """Those that the driver and readers are given; within: whether anything is asked for between the steps."""
    expand = expand_far_series if far else expand_series
    between = (accelerate_here.address, pass_singular.address) if within else (0, 0)
    return np.array([expand.address, reach.address, *between], np.int64)


def _reading(packed, network, highest, steps):
    """A reader's kind, and what to make one with."""
    return SeriesReader, packed.system, network, room(highest), packed.size, steps


def read_again(packed, highest):
    """The same in another process than the run's."""
    network = Series(packed, refusal(packed)).network
    return _reading(packed, network, highest, addresses(True, is_far(network, highest)))


def run_series(task, observe=None, relay=None, past=None):
    """Run a `Task`; the `Outcome`. `observe` is given the memory before the run: one of its own.

    As a part of a run by another method it is given a `Relay`, and `past(memory)` makes what is driven of its memory.
    """
    prepared, method = task.prepared, task.method
    if task.form.name != "tangent":
        raise InvalidArgument(
            f"Taylor series are of the motion itself and need no other form than 'tangent'; formulation="
            f"{task.form.name!r} is served by 'dop853', 'rk45' and 'nystrom4'."
        )
    order = method.orders()
    kind = "taylor", order[2]
    memory = None if observe else prepared.take(kind, lambda: SeriesMemory(prepared, order[2]))
    if memory is None or memory.series is not prepared.series:  # of the scene before it was changed
        memory = SeriesMemory(prepared, order[2])
    dense = STORED if task.dense_output else FILLED if task.events is not None else 0
    memory.clear(task, order, dense)
    memory.steps = addresses(task.within, is_far(prepared.series.network, order[2]))
    memory.load()
    run, packed = memory.run, prepared.packed
    reading = None
    if dense:
        reading = _reading(packed, prepared.series.network, order[2], memory.steps)
    if observe is not None:
        observe(memory)
    driven = drive_part(memory, task, relay or Relay(), reading, past)
    recorded = driven.recorded
    charts, last = recorded.charts[: run.numbers[CHART_ROWS] + 1].copy(), run.now.copy()
    trajectory = None
    if task.dense_output:
        again, sides = (read_again, packed, order[2]), (task.span[0], last, task.angles, task.stops)
        trajectory = Trajectory(reading, again, recorded.blocks, charts, recorded.points, *sides)
    counted = counts(
        run, memory.work.counters, packed, prepared.spheres, prepared.still, prepared.series.constant_columns
    )
    outcome = driven.outcome(task, run, charts, counted, trajectory)
    if observe is None and outcome.status != Status.NOT_FINITE:  # NaN may be left in what a run takes as its own
        prepared.give(kind, memory)
    return outcome
