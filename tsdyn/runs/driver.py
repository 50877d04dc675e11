"""The front end of every driver: a run in slices and segments, sampled loads, the outcome."""

import math
import time
import traceback
import warnings
from contextlib import suppress
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..calls import line_of_user
from ..errors import InconsistentState, InvalidArgument, InvalidForce, SingularConfiguration, Status
from ..jit.compiled import clock
from ..jit.interrupts import deferred_interrupts
from ..methods.tolerances import SAME_TIME
from ..model import handles
from ..motions.tolerances import TOGETHER
from ..observables.generalised_forces import not_finite
from ..rows.constraint_graph import MASS_REMEDY, mass_ratio
from ..rows.interface import redundant_of
from ..rows.tolerances import UNEQUAL_MASSES
from ..validation import damaged, demand_numbers, number
from . import run_log
from .dense_output import Trajectory
from .events import Watch
from .run_log import CHART_ROOM, NO_ROWS, RecordedEnd, Recorder, RunLog, left_open
from .task import Outcome
from .tolerances import GETTING_ON, HOPELESS_STEPS, MOST_INSTANTS, NOISY, PACED, PACED_WORK, SLICE_SECONDS, TRIES

# A run in slices: the compiled driver is called again and again, with room for the records of each slice.
#
# A slice is short enough for Ctrl-C to be answered at once. The first is as long as the memory's `weight` allows, which
# is the number of coordinates where a step is O(N) and more where it is not; the others follow from the time that the
# last one took.

SLICE_DONE = Status.SLICE_DONE  # which takes longer to look up than to compare
FIRST_SLICE, FIRST_WORK = 1024, 1 << 15  # steps; coordinates stepped on, unless that is less than a step


def first_slice(weight):
    """How many steps of this `weight` there are in a first slice."""
    return min(max(FIRST_WORK // weight, 1), FIRST_SLICE)


def step_limit(run, task):
    """How many steps a run may make."""
    return run.numbers.steps_wanted + len(task.stops) if task.max_steps is None else task.max_steps


class Pace:
    """Progress of a run: an adaptive run whose steps stay too short to reach its end is ended.

    Parameters
    ----------
    t : float, s
        Where it begins.
    weight : int
        Of its memory.

    Attributes
    ----------
    due : int
        Steps of the segment after which it is judged next.
    """

    def __init__(self, t, weight):
        self.t, self.steps, self.due, self.before = t, 0, PACED, 0.0  # since when; s a step before that
        self.most = PACED * max(PACED_WORK // weight, 1)  # steps from one judgement to the next

    def judge(self, t, steps, end):
        """Status and reason of a run that is at t after so many steps."""
        # s of motion a step
        made = steps - self.steps
        before, now = self.before, (t - self.t) / made
        self.t, self.steps, self.due, self.before = t, steps, steps + min(2 * made, self.most), now
        if now > 0.0 and (end - t <= HOPELESS_STEPS * now or now > GETTING_ON * before):
            return SLICE_DONE, ""
        left = f"{(end - t) / now:.0e} more" if now > 0.0 else "infinitely many more"
        return Status.STEP_COLLAPSED, (
            f"At the pace of the last {made} steps the rest would take {left}; give max_steps to continue."
        )


class Slices:
    """The slices of one run: how long each is, and whether there is another.

    Parameters
    ----------
    memory : Memory
        Or what advances one in its place: `Sampled`, `Carrier`.
    task : Task
    watch : Watch
        Of the run's events, or None.
    recorder : Recorder
    """

    def __init__(self, memory, task, watch, recorder):
        self.memory, self.task, self.watch, self.recorder = memory, task, watch, recorder
        self.run, self.choose = memory.run, task.choose
        self.limit = step_limit(self.run, task)
        self.most = first_slice(memory.weight)
        self.status, self.reason = SLICE_DONE, ""

    @cached_property
    def pace(self):
        """The `Pace` of the run."""
        return Pace(self.task.span[0], self.memory.weight)

    def drive(self, first=None):
        """Advance until the end, from the `StartedRun` of a run on."""
        rows = self._rows() if first is None else first.rows
        while self.status is SLICE_DONE:
            if first is None:
                self.recorder.begin_slice(rows)
                self._adapt(rows, self._advance(rows))
            else:
                # From the end of a first slice
                self.recorder.adopt(first.log)
                if first.status is None:
                    raise KeyboardInterrupt
                self._end_slice(first.status)
                self._adapt(first.rows, clock() - first.began)
                first = None
            self._look_up()
            if self.status is SLICE_DONE:
                rows = self._rows()
                if rows <= 0:
                    self.status = Status.MAX_STEPS
                    if self.task.archive is not None:
                        with deferred_interrupts():
                            self.recorder.collect()
                            self.task.archive.stop(self.saved)

    def _rows(self):
        """Steps of the next slice. It ends where something is decided: results must not depend on the clock."""
        steps = self.run.numbers.steps
        due = [0 if self.choose is None else self.choose.ask, self.pace.due]
        return min([self.most, self.limit - steps, *(at - steps for at in due if at > steps)])

    def _advance(self, rows):
        """One slice; the seconds that it has taken."""
        started, log = time.perf_counter(), self.recorder.log
        if self.watch is None:
            status = self.memory.advance(log, rows)
        else:
            status, self.reason = self.watch.advance(self.memory, log, rows)
        seconds = time.perf_counter() - started
        self._end_slice(status)
        return seconds

    def _end_slice(self, status):
        """Take the status of a slice; refuse a run that could not begin."""
        if not self.run.numbers.begun:
            # A run without a first step is an error, whose cause is named
            singular = status in (Status.SINGULAR, Status.MASS_SINGULAR)
            if status in (Status.SINGULAR, Status.UNHELD):
                masses = mass_ratio(self.task.prepared.packed, UNEQUAL_MASSES**2)
                if masses:
                    raise SingularConfiguration(f"no step could be made from the start: {masses}. {MASS_REMEDY}")
            kind = SingularConfiguration if singular else InconsistentState
            *why, cause = self._why(status)
            raise kind(" ".join(filter(None, ("no step could be made from the start.", *why)))) from cause
        self.status = status

    def _why(self, status):
        """What ends a run at its start: the status, forces that are not finite, the remedy; an exception or None."""
        task, found, cause = self.task, "", None
        if status is Status.NOT_FINITE:
            slots = task.remembered[len(task.angles) :]
            found, cause = not_finite(task.prepared.packed, task.span[0], task.q, task.qd, slots)
        return status.sentence, found, status.remedy, cause

    def _adapt(self, rows, seconds):
        """The length of the next slice, from the time of this one."""
        # Aim at SLICE_SECONDS
        if seconds > 2 * SLICE_SECONDS:
            self.most = max(int(rows * SLICE_SECONDS / seconds), 1)
        elif seconds < SLICE_SECONDS / 2 and 2 * self.run.numbers.history >= rows:  # beginning again takes a row, too
            self.most = min(2 * self.most, self.recorder.most)

    def _look_up(self):
        """Between slices: whether another method takes over, the progress bar, the pace."""
        run, task, (start, end) = self.run, self.task, self.task.span
        # Another method takes over
        if self.choose is not None and self.status is SLICE_DONE and self.choose.turns(self.memory):
            self.status = Status.STIFF
        try:
            t = run.clock.t
            task.report((t - start) / (end - start), t, run.numbers.steps)
        except Exception as error:  # what has been computed is worth more than a progress bar
            if self.status is SLICE_DONE:
                self.status = Status.INTERRUPTED
                self.reason = f"progress raised {type(error).__name__}: {str(error).rstrip('.')}."
                _warn_of(error, t)
        if self.status is not SLICE_DONE:
            return
        # A run that would never end is ended
        if run.numbers.steps >= self.pace.due and task.max_steps is None and run.numbers.adaptive:
            self.status, self.reason = self.pace.judge(t, run.numbers.steps, end)
            if self.status is SLICE_DONE and end - t > NOISY * run.clock.h:
                self._look_for_noise(t)
        # A checkpoint is due
        if task.archive is not None and self.status is SLICE_DONE:
            with deferred_interrupts():
                self.recorder.collect()
                task.archive.look_up(self.saved)

    def _look_for_noise(self, t):
        """End a run whose short steps follow noise."""
        h = float(self.run.clock.h)
        what = self.task.prepared.noise(float(t), h)
        if what:
            self.status = Status.STEP_COLLAPSED
            self.reason = (
                f"{what}: the function is noise, which varies within a step of {h:.1e} s as it does from step to step: "
                "no tolerance and no max_step resolves it. Let it hold its values for some time, as a ts.Table of "
                "kind='previous' does, or take fixed steps, such as integrator=ts.integrators.Nystrom4(step=...)."
            )

    def saved(self):
        """The state between two slices: numbers, and arrays by name."""
        outputs, arrays = self.recorder.saved()
        numbers = {
            "t": self.run.clock.t,
            "outputs": outputs,
            "turns": None if self.choose is None else self.choose.saved(),
            "pace": vars(self.pace),
            "memory": self.memory.saved(),
        }
        if self.watch is not None:
            numbers["watch"], watched = self.watch.saved()
            arrays |= watched
        return numbers, arrays | run_log.saved(self.memory)

    def restore(self, numbers, arrays):
        """Begin between two slices of a run that was left there."""
        with damaged("the checkpoint"):
            self.recorder.restore(numbers["outputs"], arrays, len(self.memory.context.graph.row))
            limits = {"next_eval": self.task.times.size, "next_stop": len(self.task.stops)}
            limits["chart_rows"] = len(arrays["recorder.charts"]) - 1
            run_log.restore(self.memory, arrays, limits)
            if self.choose is not None:
                self.choose.restore(numbers["turns"])
            demand_numbers(numbers["pace"], vars(self.pace))
            vars(self.pace).update(numbers["pace"])
            self.memory.restore(numbers["memory"])
            if self.watch is not None:
                self.watch.restore(numbers["watch"], arrays)


def _warn_of(error, t):
    """Show an exception of a user's `progress` with its traceback: nobody reads the message of a solution unasked."""
    told = "".join(traceback.format_exception(error)).rstrip()
    with suppress(RuntimeWarning):  # nor is the solution lost where warnings are errors
        warnings.warn(
            f"progress raised {type(error).__name__}, which ends the run at t = {t:.9g} s; the solution so far is "
            f"returned.\n{told}",
            RuntimeWarning,
            stacklevel=line_of_user(),
        )


def drive(memory, task, watch, first=None):
    """Drive a run to its end; Status, what there is to say of it, and the closed `Recorder`. first: a `StartedRun`.

    Where `task.choose` says that another method goes on, the run ends with Status.STIFF.
    """
    recorder = Recorder(task, memory.run, len(redundant_of(memory.context.tangent)))
    slices = Slices(memory, task, watch, recorder)
    if task.archive is not None and task.archive.resumed is not None:
        slices.restore(*task.archive.resumed)
        task.archive.resumed = None
    try:
        slices.drive(first)
    except OSError as error:
        if task.archive is None:
            raise
        slices.status, slices.reason = Status.STORE_FAILED, f"{error.strerror or error}."
    except KeyboardInterrupt:
        if not memory.run.numbers.begun:  # there is nothing to return
            raise
        if watch is not None:
            watch.go_back(memory.run, recorder.log)
        if memory.run.clock.t >= task.span[1]:
            slices.status = Status.SUCCESS
        elif slices.status is SLICE_DONE:
            slices.status = Status.INTERRUPTED
        else:  # the segment had ended: the next one is not to begin
            recorder.interrupted = True
    finally:
        task.report(None)
    recorder.close()
    return slices.status, slices.reason or memory.reason, recorder


# Sample and hold: joint loads whose Python functions are evaluated at times k period, between slices of a run.
#
# A step ends at each sampling time. The driver returns, the functions that are due are evaluated, their values are
# stored in the memory of the forces, and the driver continues from the new accelerations.


class Failed(Exception):
    """A function raised, or gave no finite number."""


class Sampling:
    """The sampled loads of one run, all of its parts.

    Parameters
    ----------
    prepared : Prepared
    continued : bool
        Whether the run goes on from a state, so that what is held there stays until the next instant.
    """

    def __init__(self, prepared, continued):
        self.packed, self.handles, self.loads = prepared.packed, prepared.handles, sampled(prepared.packed)
        self.last = [-math.inf] * len(self.loads)  # when each was evaluated
        self.begun = continued
        for load in self.loads:
            reset = getattr(load.force.function, "reset", None)
            if callable(reset) and not continued:
                reset()

    def of(self, prepared):
        """Those of the next phase of the run, which go on; others than before where an action has changed them."""
        other = Sampling(prepared, True)
        known = {load.force.name: t for load, t in zip(self.loads, self.last, strict=True)}
        other.last = [known.get(load.force.name, -math.inf) for load in other.loads]
        return other

    def saved(self):
        """When each function was evaluated last, and what it keeps."""
        return {"last": self.last, "begun": self.begun, "kept": [_kept(load.force.function) for load in self.loads]}

    def restore(self, numbers):
        """As it was when it was saved."""
        self.last, self.begun = numbers["last"], numbers["begun"]
        for load, kept in zip(self.loads, numbers["kept"], strict=True):
            for name, (kind, value) in kept.items():
                vars(load.force.function)[name] = np.array(value, kind)[()] if kind else value

    def ask(self, memory, t, q, qd):
        """Evaluate the functions that are due at t, and hold their values."""
        self.take(memory.run.remembered, t, q, qd, memory.context.system.reals)

    def take(self, remembered, t, q, qd, reals=None):
        """The same in what a run remembers, and in the numbers of a system."""
        for i, load in enumerate(self.loads):
            force = load.force
            later = t - self.last[i] > 2.0 * _slack(t, force.period)  # a phase may begin by rounding after an instant
            if later and (not self.begun or is_due(t, force.period)):
                angles, self.last[i] = remembered[: self.handles.count], t
                values = self._values(load, t, (q, qd), angles)
                slots = np.arange(load.slot, load.slot + len(values))
                if reals is not None:
                    reals[self.packed.system.memory[slots]] = values
                remembered[self.handles.count + slots] = values
        self.begun = True

    def _values(self, load, t, levels, angles):
        """Values of a force's function; angles are the approximate ones that the run has counted."""
        force, law = load.force, load.law
        try:
            if law is None:
                given = [force.function(t, *self._coordinate(force, levels, angles))]
            else:
                given = law.evaluate(t, *levels, angles.copy(), load.parameters)
        except Exception as error:
            raise Failed(
                f"{force.name}: its function raised {type(error).__name__} at t = {t:.9g} s: {str(error).rstrip('.')}."
            ) from error
        values = [number(value) for value in given]
        if not all(map(math.isfinite, values)):
            shown = given[0] if law is None else given
            raise Failed(f"{force.name}: its function must return a finite number; at t = {t:.9g} s it gave {shown!r}.")
        return values

    def _coordinate(self, force, levels, angles):
        """The coordinate of a force's joint, and its rate."""
        row = self.handles.row(force.joint, force.coordinate)
        evaluate, geometry = getattr(handles, force.coordinate), force.geometry
        x, rate = (float(evaluate(geometry, *self.handles.motions(geometry, levels), level)) for level in (0, 1))
        if force.coordinate == "angle":
            x = float(handles.counted(x, angles[row.first + force.which]))
        return x, rate


class Sampled:
    """The memory of a run, advanced from instant to instant; see `Memory`."""

    begins_again = False

    def __init__(self, memory, sampling):
        self.memory, self.sampling = memory, sampling
        self.run, self.weight, self.context = memory.run, memory.weight, memory.context
        self.reason = ""

    def saved(self):
        """What the `Sampling` saves."""
        return self.sampling.saved()

    def restore(self, numbers):
        """As it was when it was saved."""
        self.sampling.restore(numbers)

    def step(self, log):
        """Make one step. What is due at its end is left to `answer`: the step may have gone past an event."""
        return self.memory.advance(log, 1)

    def answer(self, log):
        """Ask the functions that are due where the run is; the Status."""
        if not self.run.numbers.waiting:
            return Status.SLICE_DONE
        try:
            return self._answer(log)
        except Failed as failure:
            self.reason = str(failure)
            return Status.SAMPLING_FAILED

    def _answer(self, log):
        """New values, and accelerations with them."""
        run = self.run
        self.sampling.ask(self.memory, float(run.clock.t), run.now[0].copy(), run.now[1].copy())
        return self.memory.advance(log, 0)

    def advance(self, log, most):
        """Make up to `most` steps; the Status, as of the driver's `advance`."""
        run, work = self.run, self.memory.context.work
        numbers = run.numbers
        try:
            # The first values, before the first accelerations
            if not numbers.begun and most != 0:
                self.sampling.ask(self.memory, float(run.clock.t), work.q.copy(), work.qd.copy())
            first = numbers.history
            while True:
                # Up to the next instant, or to the end of the slice
                done = int(numbers.history - first)
                status = self.memory.advance(log, most - done if most > 0 else most)
                if status != Status.SLICE_DONE or not numbers.waiting:
                    return status
                status = self._answer(log)
                if status != Status.SLICE_DONE or numbers.history - first >= most:
                    return status
        except Failed as failure:
            if not numbers.begun:
                raise InvalidForce(str(failure)) from failure.__cause__
            self.reason = str(failure)
            return Status.SAMPLING_FAILED


def _kept(function):
    """What an object with a `reset` keeps: {attribute: (type of an array or "", value)}, numbers, lists and arrays."""
    found, attributes = {}, getattr(function, "__dict__", {})
    for name, value in attributes.items() if hasattr(function, "reset") else ():
        if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "biuf":
            found[name] = value.dtype.str, value.tolist()
        elif all(isinstance(x, (int, float)) for x in (value if isinstance(value, list) else [value])):
            found[name] = "", value
    return found


def sampled(packed):
    """The loads that are sampled."""
    return [load for load in packed.loads if getattr(load.force, "period", None) is not None]


def is_due(t, period):
    """Return True if t is an instant of a period."""
    return abs(t - round(t / period) * period) <= _slack(t, period)


def _slack(t, period):
    """How far a time t may be from an instant of a period and count as that instant, s."""
    return max(SAME_TIME * period, TOGETHER * abs(t))


def instants_of(packed, t0, t1):
    """The instants within (t0, t1) at which a function is asked, s, increasing."""
    found = []
    for load in sampled(packed):
        period = load.force.period
        count = (t1 - t0) / period
        if not count < MOST_INSTANTS:
            raise InvalidArgument(
                f"{load.force.name}: a period of {period:g} s makes {count:.3g} instants, and {MOST_INSTANTS} are as "
                "many as a run may have; take a longer period or a shorter run."
            )
        times = np.arange(math.floor(t0 / period), math.ceil(t1 / period) + 1) * period
        found.append(times[(times > t0) & (times < t1)])
    return np.unique(np.concatenate(found)) if found else np.empty(0)


# Run segments: state and records passed between the parts of one run that different methods integrate.


class SegmentLink:
    """Handed from part to part of a run: its events, and how near to a singular configuration it has come.

    Parameters
    ----------
    passes : bool
        Whether there is a way past singular configurations.
    """

    def __init__(self, passes=False):
        self.watch, self.passes = None, passes
        self.interrupted = False  # whether Ctrl-C came when a part had just ended
        self.h = 0.0  # s, of the first step of the next part; zero for its own choice
        self.share = self.largest = (
            0.0  # of the weakest row, where the last part ended, and at most; see row_selection.py
        )

    def enter(self, memory):
        """Let a part begin where the last one ended."""
        memory.context.tangent.indicator.largest = self.largest
        if self.h > 0.0:
            memory.run.clock.h = self.h

    def leave(self, memory):
        """Take over how a part ended."""
        indicator = memory.context.tangent.indicator
        self.share, self.largest, self.h = indicator.start, indicator.largest, memory.run.clock.h

    def watching(self, task, reading):
        """The `Watch` of the run's events, with a reader for the steps of this part; None where there are none."""
        if task.events is None:
            return None
        reader = reading.reader()
        if self.watch is None:
            self.watch = Watch(task.events, task.prepared.packed, reader, task.span[0], task.resume)
        else:
            self.watch.read_by(reader)
        return self.watch


# The front end of every driver: memory, driver loop, outcome.
#
# An engine is what differs from driver to driver: `StepEngine` for methods with a step kernel, `SeriesEngine` of
# tsdyn.taylor for series. It is made of a scene's `Prepared`, a method, a form, and whether anything is asked for
# between the ends of steps; serves any number of runs (`Prepared.engine`), and has
#
#   method, form    the form is the one that the driver runs
#   kind            of the memory: one of the same kind serves another run
#   layouts         how many memories have been laid out for it
#   memory(prepared)            a new `Memory`
#   serves(memory)              whether a memory that was made before is that of the scene as it is now
#   lay_out(memory, interval)   enter the system, and the numbers and kernels of the method
#   reading(memory, prepared, constraint_tol)
#                               a `TrajectoryReading` of the steps, and a picklable function with arguments that
#                               makes it again
#   skipped         bodies without gyroscopic torque, bodies that never turn, constant columns of series

SUCCESS, NOT_FINITE, PASSAGE, STIFF = Status.SUCCESS, Status.NOT_FINITE, Status.PASSAGE, Status.STIFF


class StartedRun(NamedTuple):
    """A run after its first slice."""

    log: RunLog
    rows: int  # steps that there was room for
    status: Status  # None where Ctrl-C was pressed meanwhile
    began: float  # by `jit.compiled.clock`


class SliceArrays(NamedTuple):
    """Where a memory keeps the records of a first slice."""

    first: int  # driver.FIRST_SLICE
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
    driven = drive(advanced if past is None else past(advanced), task, watch, first)
    if link is not None and driven[0] in (PASSAGE, STIFF):
        link.leave(memory)
        link.interrupted = driven[2].interrupted
    outcome = _driven(task, memory, driven, readings, watch, began)
    if watch is not None:
        readings[0].give(watch.reader)
    # NaN may be left in what a run takes as its own; laws give it after Ctrl-C, too
    spoilt = outcome.status is NOT_FINITE or (memory.calls_laws and outcome.status is Status.INTERRUPTED)
    if observe is None and not spoilt:
        prepared.give(memory.engine.kind, memory)
    return outcome


def _log_of(memory, task):
    """The `RunLog` of the first slice of a run, and the steps that there is room for."""
    arrays, times = memory.arrays, task.times
    if arrays is None or arrays.first != FIRST_SLICE:
        arrays = memory.arrays = _arrays_of(memory)
    rows, blocks = min(arrays.most, step_limit(memory.run, task)), (NO_ROWS, NO_ROWS)
    if task.dense_output:
        n, redundant = memory.run.now.shape[1], len(redundant_of(memory.context.tangent))
        blocks = np.zeros((len(arrays.charts), n + redundant)), np.empty((rows, memory.run.block.size))
    out = np.empty((times.size or rows + 1, arrays.width))
    return RunLog(times, task.stops, out, arrays.history, arrays.charts, *blocks), rows


def _arrays_of(memory):
    most, run = first_slice(memory.weight), memory.run
    history, charts = np.empty((most + 2 * TRIES, 3)), np.empty((most + CHART_ROOM, 5))  # one a step
    return SliceArrays(FIRST_SLICE, most, 1 + run.now.size + run.remembered.size, history, charts)


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
    return Outcome(status, reason, recorder.out, end, trajectory, found, began, interrupted=recorder.interrupted)


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
