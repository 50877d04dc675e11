"""Passage through singular configurations: Runge-Kutta methods hand over to the Taylor integrator near the singularity.

Near a singular configuration charts shrink towards zero, while the Taylor series of a motion that passes it smoothly is
regular. If a chart is made near a singularity, or a fixed step fails near one, a Taylor run continues until the
configuration is regular again; the method then restarts. A fixed-step method restarts on its own time grid. Runs that
meet no singular configuration load none of this.
"""

import math
import time

import numpy as np

from ..errors import Status, TsdynError
from ..formulations.registry import formulation
from ..integrators import Taylor
from ..runs.history import ChartLog, StepLog
from ..runs.run import run
from ..runs.segments import Relay
from ..runs.step_engine import StepEngine
from ..runs.task import Outcome
from ..runs.trajectory import Pieces
from ..taylor.series_engine import SeriesEngine
from .tolerances import FINEST, NO_STEP, REGULAR


def run_past(task, observe=None):
    """Run a `Task` of a step method; return the `Outcome`. An observed run has one segment, without crossings."""
    if observe is not None or task.form.first_order or task.prepared.refusal:
        return run(task, StepEngine, observe)
    relay, passed = Relay(), task.archive.passed if task.archive else []
    try:
        if passed:  # a run that goes on in a later segment
            relay.share, relay.largest = passed[-1]["relay"]
            return _go_on(task, relay, [_recalled(task, known) for known in passed])
        outcome = run(task._replace(report=_until_its_end(task.report)), StepEngine, relay=relay)
        return _go_on(task, relay, [outcome]) if outcome.status == Status.PASSAGE else outcome
    finally:
        task.report(None)


def _until_its_end(report):
    """Return a progress report without the end: further segments may follow."""
    return lambda fraction, *more: None if fraction is None else report(fraction, *more)


def _pass(task, relay, part):
    """Let the archive know that a segment has ended; per-step outputs begin with the row that it ends with."""
    if task.archive is not None:
        numbers = {"status": part.status, "reached": part.reached, "counts": dict(part.counts), "rows": len(part.rows)}
        arrays = {"last": part.last.tolist(), "remembered": part.remembered.tolist()}
        task.archive.passed.append({**numbers, **arrays, "relay": [relay.share, relay.largest]})
        task.archive.skips = task.times.size == 0


def _recalled(task, known):
    """The `Outcome` of a segment that had ended when a checkpoint was written."""
    return Outcome(
        Status(known["status"]), "", range(known["rows"]), None, None, known["reached"], np.array(known["last"]),
        np.array(known["remembered"]), known["counts"], None, None, time.perf_counter(),
    )  # fmt: skip


def _go_on(task, relay, parts):
    """Complete a run whose segments so far have ended near singular configurations."""
    first, recalled = parts[0], task.archive is not None and task.archive.resumed is not None
    try:
        while parts[-1].status == Status.PASSAGE:
            if not recalled:
                _pass(task, relay, parts[-1])
            recalled = False
            series = len(parts) % 2 == 1
            rest = _rest(task, parts, series)
            if rest.max_steps == 0:
                parts[-1] = parts[-1]._replace(status=Status.MAX_STEPS)
                break
            try:
                if series:
                    part = run(rest, SeriesEngine, relay=relay, past=lambda memory: Carrier(memory, task, relay.share))
                else:
                    part = run(rest, StepEngine, relay=relay)
            except TsdynError as error:  # the partial result is returned
                parts[-1] = parts[-1]._replace(status=Status.SINGULAR, reason=str(error))
                break
            parts.append(part)
    except KeyboardInterrupt:
        parts[-1] = parts[-1]._replace(status=Status.INTERRUPTED)
    last = parts[-1]
    return last._replace(
        reason=" ".join(part for part in (last.reason, _said(parts)) if part),
        rows=_rows(task, parts),
        steps=StepLog([part.steps for part in parts]) if task.history and not task.archive else None,
        charts=ChartLog([part.charts for part in parts]) if task.history and not task.archive else None,
        counts=_summed([part.counts for part in parts]),
        trajectory=Pieces([part.trajectory for part in parts]) if task.dense_output else None,
        began=first.began,
    )


def _said(parts):
    """Say how often the Taylor series took over, and when first."""
    way = zip(parts[::2], parts[1::2], strict=False)
    passed = [before.reached for before, series in way if series.status in (Status.PASSAGE, Status.SUCCESS)]
    if not passed:
        return ""
    times = "once" if len(passed) == 1 else f"{len(passed)} times, the first"
    return f"Taylor series carried the motion past a singular configuration {times} after t = {passed[0]:.6g} s."


def _rows(task, parts):
    """Return the output rows of all segments; every step's begin with the row that the segment before ends with."""
    if task.archive is not None:
        return range(task.archive.counts["outputs"])
    first, *others = (part.rows for part in parts)
    return np.concatenate([first, *(rows[1:] if task.times.size == 0 else rows for rows in others)])


def _rest(task, parts, series):
    """Return the remaining task, for the Taylor method or the method itself."""
    last, times, left = parts[-1], task.times, task.max_steps
    done = sum(part.counts["steps"] for part in parts)
    if times.size:
        times = times[sum(len(part.rows) for part in parts) :]
        times = times if times.size else np.array([np.inf])  # an empty array would ask for every step
    if left is not None:
        left = max(left - done, 0)
    (start, end), reached = task.span, last.reached

    done = sum(part.counts["steps"] for part in parts)

    def report(fraction, t, steps):
        task.report((reached + fraction * (end - reached) - start) / (end - start), t, done + steps)

    rest = task._replace(
        span=(reached, end), q=last.last[0], qd=last.last[1], remembered=last.remembered, times=times, max_steps=left,
        report=_until_its_end(report),
    )  # fmt: skip
    if not series:
        return rest
    rtol, atol = (FINEST if tol is None else min(tol, FINEST) for tol in (task.method.rtol, task.method.atol))
    return rest._replace(
        method=Taylor(rtol=rtol, atol=atol, max_step=task.method.max_step), form=formulation("tangent"), choose=None
    )


def _summed(counts):
    """Return the counts of the whole run."""
    ways = {"stiff": any, "largest_landing": max}
    return {name: ways.get(name, sum)(each[name] for each in counts) for name in counts[0]}


class Carrier:
    """The memory of a Taylor run that is advanced until the configuration is regular again.

    Parameters
    ----------
    memory : Memory
    task : Task
        The whole run's.
    share : float
        Pivot share of the weakest row at the start; the method resumes when it has grown.
    """

    def __init__(self, memory, task, share):
        self.memory, self.share = memory, share
        self.run, self.weight, self.context = memory.run, memory.weight, memory.context
        self.origin, self.end = task.span
        self.step = task.method.step
        self.grid = math.nan  # the grid time that is aimed at

    def advance(self, log, most):
        """Advance as `Memory` does; Status.PASSAGE when the configuration is regular again."""
        if most <= 0:
            return self.memory.advance(log, most)
        numbers, clock = self.run.numbers, self.run.clock
        for _ in range(most):
            done = numbers.steps
            status = self.memory.advance(log, 1)
            if status == Status.SUCCESS and clock.t < self.end:
                status = Status.SLICE_DONE
            if status != Status.SLICE_DONE or numbers.steps == done:
                return status
            if not self._is_regular():
                clock.t_end = self.end
            elif self.step is None or clock.t == self.grid:
                return Status.PASSAGE
            else:
                clock.t_end = self.grid = self._next()
        return Status.SLICE_DONE

    def saved(self):
        """The grid time that is aimed at, the share that was met, and what the memory has to say."""
        return {"grid": self.grid, "share": self.share, "memory": self.memory.saved()}

    def restore(self, numbers):
        """As it was when it was saved."""
        self.grid, self.share = numbers["grid"], numbers["share"]
        self.memory.restore(numbers["memory"])

    @property
    def reason(self):
        """A sentence on the end of the run."""
        return self.memory.reason

    def _is_regular(self):
        indicator = self.context.tangent.indicator
        return indicator.start >= max(REGULAR * indicator.largest, self.share)

    def _next(self):
        """Return the next time of the grid."""
        done = (self.run.clock.t - self.origin) / self.step
        return min(self.origin + math.ceil(done + NO_STEP) * self.step, self.end)
