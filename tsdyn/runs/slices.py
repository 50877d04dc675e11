"""A run in slices: the compiled driver is called again and again, with room for the records of each slice.

A slice is short enough for Ctrl-C to be answered at once. The first is as long as the memory's `weight` allows, which
is the number of coordinates where a step is O(N) and more where it is not; the others follow from the time that the
last one took.
"""

import time
import traceback
import warnings
from contextlib import suppress
from functools import cached_property

from ..errors import InconsistentState, SingularConfiguration, Status
from ..jit.compiled import clock
from ..jit.interrupts import deferred_interrupts
from ..observables.not_finite import not_finite
from ..rows.interface import redundant_of
from ..sparse.length_metric import MASS_REMEDY, mass_ratio
from ..sparse.tolerances import TOO_UNEQUAL
from ..validation import damaged, demand_numbers
from . import snapshot
from .recorder import Recorder
from .tolerances import GETTING_ON, HOPELESS, NOISY, PACED, SLICE_SECONDS

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
    """

    def __init__(self, t):
        self.t, self.tries, self.before = t, 0, 0.0  # since when, how many; s a try before that

    def judge(self, t, tries, end):
        """Status and reason of a run that is at t after `tries` more steps."""
        self.tries += tries
        if self.tries < PACED:
            return SLICE_DONE, ""
        # s of motion a step
        before, now = self.before, (t - self.t) / self.tries
        self.t, self.tries, self.before = t, 0, now
        if now > 0.0 and (end - t <= HOPELESS * now or now > GETTING_ON * before):
            return SLICE_DONE, ""
        left = f"{(end - t) / now:.0e} more" if now > 0.0 else "infinitely many more"
        return Status.STEP_COLLAPSED, (
            f"At the pace of the last {PACED} steps the rest would take {left}; give max_steps to continue."
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
        return Pace(self.task.span[0])

    def drive(self, first=None):
        """Advance until the end, from the `run.StartedRun` of a run on."""
        rows = self._rows() if first is None else first.rows
        while self.status is SLICE_DONE:
            if first is None:
                self.recorder.begin_slice(rows)
                self._adapt(rows, self._advance(rows))
            else:
                self._go_on(first)
                first = None
            self._look_up()
            if self.status is SLICE_DONE:
                rows = self._rows()
                if rows <= 0:
                    self.status = Status.MAX_STEPS

    def _rows(self):
        """Steps of the next slice, which ends where another method is considered: that mustn't depend on the clock."""
        steps = self.run.numbers.steps
        rows = min(self.most, self.limit - steps)
        # Another method is considered after a number of steps, not of seconds: results must not depend on the clock
        ask = 0 if self.choose is None else self.choose.ask
        return min(rows, ask - steps) if ask > steps else rows

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

    def _go_on(self, first):
        """From the end of a first slice."""
        self.recorder.adopt(first.log)
        if first.status is None:
            raise KeyboardInterrupt
        self._end_slice(first.status)
        self._adapt(first.rows, clock() - first.began)

    def _end_slice(self, status):
        """Take the status of a slice; refuse a run that could not begin."""
        if not self.run.numbers.begun:
            # A run without a first step is an error, whose cause is named
            singular = status in (Status.SINGULAR, Status.MASS_SINGULAR)
            if status in (Status.SINGULAR, Status.UNHELD):
                masses = mass_ratio(self.task.prepared.packed, TOO_UNEQUAL)
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
        elif seconds < SLICE_SECONDS / 2 and self.run.numbers.history >= rows:
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
        if task.max_steps is None and run.numbers.adaptive:
            self.status, self.reason = self.pace.judge(run.clock.t, run.numbers.history, end)
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
        return numbers, arrays | snapshot.saved(self.memory)

    def restore(self, numbers, arrays):
        """Begin between two slices of a run that was left there."""
        with damaged("the checkpoint"):
            self.recorder.restore(numbers["outputs"], arrays, len(self.memory.context.graph.row))
            limits = {"next_eval": self.task.times.size, "next_stop": len(self.task.stops)}
            limits["chart_rows"] = len(arrays["recorder.charts"]) - 1
            snapshot.restore(self.memory, arrays, limits)
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
            stacklevel=2,
        )


def drive(memory, task, watch, first=None):
    """Drive a run to its end; Status, what there is to say of it, and the closed `Recorder`. first: a `run.StartedRun`.

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
