"""The Python side of the Taylor driver; see task.py."""

import time

import numpy as np

from ..errors import InvalidArgument, Status
from ..runs.run_state import CHART_ROWS, FILLED, STORED, T
from ..runs.sampling import Sampled
from ..runs.segments import Relay
from ..runs.slices import drive
from ..runs.step_run import counts
from ..runs.task import Outcome
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
    relay = relay or Relay()
    relay.enter(memory)
    watch = relay.watching(task, reading)

    began = time.perf_counter()
    driven = memory if task.sampling is None else Sampled(memory, task.sampling)
    status, reason, recorded = drive(driven if past is None else past(driven), task, watch)
    relay.leave(memory)
    charts, last = recorded.charts[: run.numbers[CHART_ROWS] + 1].copy(), run.now.copy()
    trajectory = None
    if task.dense_output:
        again, sides = (read_again, packed, order[2]), (task.span[0], last, task.angles, task.stops)
        trajectory = Trajectory(reading, again, recorded.blocks, charts, recorded.points, *sides)
    outcome = Outcome(
        status,
        reason,
        recorded.out,
        recorded.steps,
        recorded.log(charts),
        float(run.clock[T]),
        last,
        run.remembered.copy(),
        counts(
            run,
            memory.work.counters.tolist(),
            packed,
            prepared.spheres,
            prepared.still,
            prepared.series.constant_columns,
        ),
        trajectory,
        None if watch is None else watch.found(prepared.n),
        began,
    )
    if observe is None and status != Status.NOT_FINITE:  # NaN may be left in what a run takes as its own
        prepared.give(kind, memory)
    return outcome
