"""Segments of a run, each by one method: changes of method, singular passages, one outcome."""

import math
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..ahead import prepare_first_run
from ..configuration.motor_starts import demand_holonomic
from ..errors import Status, TsdynError
from ..formulations.registry import formulation
from ..integrators import SDIRK54, Radau, Taylor
from ..jit.compiled import clock
from ..methods.integrator import frozen
from ..rows.tolerances import NEAR
from ..runs.dense_output import StepPieces
from ..runs.driver import SegmentLink, begin, run
from ..runs.run_log import NAMES, ChartLog, RunEnd, StepLog
from ..runs.step_engine import StepEngine
from ..runs.task import Outcome
from ..runs.tolerances import SLIVER
from ..taylor.series_engine import SeriesEngine
from ..taylor.tolerances import PASSING, SHARP_TOL
from ..validation import damaged, demand, demand_numbers, is_count
from . import tolerances as limits
from .local_origin import within_rounding
from .termination import silent

# Turns of the default method: from its explicit method to the implicit one where the motion is stiff, and back.
#
# Each goes on from where the other stands. Work for a second of motion decides, in evaluations, and after numbers of
# steps: no clock. The explicit method turns where it finds the motion stiff (runs/step_control.py, taylor/stepper.py).
# What the implicit method takes more than the explicit one would have taken for the same motion is lost: fast modes
# have to be followed until they have decayed. It turns back where more is lost than a share of what the explicit method
# would take for the rest. Otherwise the explicit one is tried for some steps, at growing intervals, and earlier where
# the derivatives of the forces had to be evaluated again: as long as old ones serve, the motion is as stiff as it was.
# With friction of joints, where none is at rest.

KEPT = "known", "patience", "taken", "tried", "ask", "window", "jacobians", "began", "lasted", "lost", "most_lost"


def implicit(method, prepared, form):
    """Return the implicit method of the same tolerances: Radau, or SDIRK54 in the null-space form."""
    most = SHARP_TOL if form.basis_free and prepared.sharp else math.inf
    kind = Radau if form.basis_free else SDIRK54
    found = kind(min(method.rtol, most), min(method.atol, most), max_step=method.max_step)
    if not form.basis_free:
        found.safety = limits.STIFF_SAFETY
    return frozen(found)


class Turns:
    """The turns of one run.

    Parameters
    ----------
    scene : Scene
    prepared : Prepared
        Of the scene.
    method : Integrator
        The explicit method.
    form : Formulation
    span : (float, float), s
    within : bool
        Whether output between the ends of steps is requested.

    Attributes
    ----------
    ask : int
        Steps of the segment after which it is asked; of an explicit method not before it has found the motion stiff.
    """

    ask = 0
    known = 0.0  # work of the method before for a second of motion
    patience = limits.PATIENCE  # implicit steps before the explicit method is tried
    taken, tried = 0, False  # explicit steps so far; whether the explicit method is on trial
    jacobians = 0  # of the implicit method's first steps
    began = lasted = 0.0  # s: of the segment, and length of the one before
    lost = most_lost = 0.0  # work, by the implicit method, since it was last even; the most so far

    def __init__(self, scene, prepared, method, form, span, within):
        self.scene, self.prepared, self.method = scene, prepared, method
        self.form, self.end, self.within = form, span[1], within
        self.window = span[0], 0.0  # where the steps that are judged begin: time, work

    @cached_property
    def implicit(self):
        """The implicit method."""
        return implicit(self.method, self.prepared, self.form)

    @cached_property
    def _cost(self):
        """Of an evaluation by the implicit method."""
        return limits.SERIES_COST if isinstance(self.method, Taylor) else limits.COST

    @cached_property
    def _first(self):
        """Steps of the implicit method over which work is measured first."""
        return limits.RESTING if self.prepared.slips else limits.FIRST_WINDOW

    @cached_property
    def _step(self):
        """Work of a step of the explicit method."""
        series = isinstance(self.method, Taylor)
        return self.method.stages * (limits.SHARP_COST if series and self.prepared.sharp else 1.0)

    def begin(self, to_implicit, t, turned):
        """A segment begins at t: after a turn, or after a singular configuration."""
        self.window, self.ask = (t, 0.0), self._first if to_implicit else limits.FIRST_WINDOW
        if to_implicit:
            prepare_first_run(self.scene, self.implicit, self.form, self.within, None)
        elif not self.tried:
            self.ask = limits.FIRST_WINDOW if self.prepared.slips else (limits.AGAIN - 1) * self.taken
        if turned:
            self.lasted, self.began = t - self.began, t

    def turns(self, memory):
        """Whether the run turns to the other method where its memory is."""
        run = memory.run
        steps, t = run.numbers.steps, run.clock.t
        to_explicit = memory.engine.method.implicit
        # Slices end by the clock, too: work is measured from where a method was considered before
        if steps < self.ask or not (to_explicit or self.tried or run.numbers.stiff):
            return False
        work = self._cost * memory.work.counters.evaluations if to_explicit else self._step * steps
        (before, done), self.window = self.window, (t, work)
        rate = (work - done) / (t - before) if t > before else 0.0
        if to_explicit:
            self.lost = max(self.lost + (work - done) - self.known * (t - before), 0.0)
            self.most_lost = max(self.most_lost, self.lost)
            return self._back(memory, steps, min(rate, work / steps / run.clock.h))
        if self.tried:
            return self._tried(steps, rate, run.numbers.stiff)
        return bool(run.numbers.stiff) and self._to_implicit(run, steps, t, max(rate, self._step / run.clock.h))

    def _to_implicit(self, run, steps, t, ours):
        """Whether the implicit method is to go on where the explicit one takes `ours` for a second; not for little."""
        self.ask = limits.AGAIN * steps
        if run.numbers.at_limit == 0 or not self._pays(ours, t):
            return False
        self.known, self.taken = ours, self.taken + steps
        if self.lasted > 0.0:  # the implicit method has been left for longer than it had lasted, or in vain
            longer = self.prepared.slips or t - self.began > self.lasted
            self.patience = limits.PATIENCE if longer else limits.AGAIN * self.patience
        return True

    def _pays(self, rate, t):
        """Whether what is left at this rate is worth a turn."""
        return rate * (self.end - t) > self._cost * limits.TRIED * limits.STEP_EVALUATIONS

    def _back(self, memory, steps, rate):
        """Whether the explicit method is to go on: it would take less work for the rest, or is to be tried.

        A trial may cost as much as was lost before: steps at the limit of stability keep fast modes alive.
        """
        left, rough = self.end - memory.run.clock.t, self.prepared.rough or self.prepared.veers
        jacobians = memory.work.counters.jacobians
        if steps <= self._first:
            self.jacobians = jacobians
        may_pay = memory.run.numbers.still == 0 if rough else jacobians > self.jacobians
        may_win = rough or (rate <= self.known and limits.RISKED * rate * left > self.most_lost)
        patience = self.patience if may_pay else limits.AGAIN * self.patience
        self.tried = steps >= patience and may_win and self._pays(rate, memory.run.clock.t)
        if self.tried:
            self.known = rate
        later = steps + limits.PATIENCE if rough else 2 * steps
        self.ask = later if steps >= self.patience else min(later, self.patience)
        dear = rate > max(limits.SETTLED / steps, 1.0) ** 2 * self.known
        return bool(self.tried or (dear and (rough or self.lost > limits.RISKED * self.known * left)))

    def _tried(self, steps, rate, stiff):
        """Whether the explicit method, after some steps, has failed to take less work."""
        self.ask = 2 * steps
        if steps < limits.TRIED and rate < limits.AGAIN * self.known:
            return False
        self.tried = False
        if rate < self.known:  # one that has been found stiff meanwhile has paid all the same
            self.ask = limits.AGAIN * steps if stiff else 0
            return False
        self.patience, self.taken, self.known = limits.AGAIN * self.patience, self.taken + steps, rate
        return True

    def saved(self):
        """Its state, for a checkpoint."""
        return {name: getattr(self, name) for name in KEPT}

    def restore(self, numbers):
        """As it was when it was saved."""
        window = numbers["window"]
        demand_numbers(numbers | dict(zip(("window", "work"), window, strict=True)), (*KEPT, "work"))
        vars(self).update(numbers)


# Passage through singular configurations: Runge-Kutta methods hand over to the Taylor integrator near the singularity.
#
# Near a singular configuration charts shrink towards zero, while the Taylor series of a motion that passes it smoothly
# is regular. If a chart is made near a singularity, or a fixed step fails near one, a Taylor run continues until the
# configuration is regular again; the method then restarts (`_Segments`). A fixed-step method restarts on its own time
# grid. Runs that meet no singular configuration load none of this.


def by_series(task):
    """The `Task` of a crossing."""
    rtol, atol = (PASSING if tol is None else min(tol, PASSING) for tol in (task.method.rtol, task.method.atol))
    return task._replace(
        method=Taylor(rtol=rtol, atol=atol, max_step=task.method.max_step), form=formulation("tangent"), choose=None
    )


def crossings(found):
    """Say how often the Taylor series took over, and when first; each with the segment before."""
    passed = [before.end.reached for before, series in found if series.status in (Status.PASSAGE, Status.SUCCESS)]
    if not passed:
        return ""
    times = "once" if len(passed) == 1 else f"{len(passed)} times, the first"
    return f"Taylor series carried the motion past a singular configuration {times} after t = {passed[0]:.6g} s."


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

    begins_again = False

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
        return indicator.start >= max(NEAR * indicator.largest, self.share)

    def _next(self):
        """Return the next time of the grid."""
        done = (self.run.clock.t - self.origin) / self.step
        return min(self.origin + math.ceil(done + SLIVER) * self.step, self.end)


# Segments of a run, each by one method: what a segment begins with, and how all of them make one outcome.
#
# A segment ends with Status.STIFF where the default method turns to its implicit method, or back (`Turns`); with
# Status.STEP_COLLAPSED where friction comes to rest within a step, and the implicit method goes on; and with
# Status.PASSAGE where series go on past a singular configuration, or have done so (`Carrier`). All other runs
# have one segment.

PASSAGE, STIFF = Status.PASSAGE, Status.STIFF
METHOD, IMPLICIT, CROSSING = range(3)  # who makes a segment: the task's method, the implicit one, series
GIVEN_UP = (  # by the implicit method: the explicit one goes on
    Status.NEWTON_FAILED, Status.SINGULAR, Status.MASS_SINGULAR, Status.CHART_LOST, Status.STEP_COLLAPSED,
    Status.STAGE_FAILED, Status.JAMMED,
)  # fmt: skip


def run_segments(task, engine, observe=None):
    """Run a `Task` by the engine of its method; return the `Outcome`. An observed run has one segment."""
    passes, begun = observe is None and may_pass(task), None
    if task.choose is None and engine is SeriesEngine:  # there is nobody to go on
        passes = False
    if observe is None and asks_little(task):
        outcome, begun = begin(task, engine, passes)
        if outcome is not None:
            return outcome
    if observe is not None or (task.choose is None and not passes):
        return run(task, engine, observe, begun=begun)
    if task.choose is not None:
        task = task._replace(choose=task.choose())
    link = SegmentLink(passes)
    passed = task.archive.passed if task.archive else []
    try:
        if passed:  # a run that goes on in a later segment
            with damaged("the checkpoint"):
                link.share, link.largest, link.h = map(float, passed[-1]["relay"])
                if passed[-1]["turns"] is not None:
                    task.choose.restore(passed[-1]["turns"])
                segments = _Segments(task, engine, link, [_recalled(known, task) for known in passed])
            return segments.go_on()
        first = task if task.report is silent else task._replace(report=_until_its_end(task.report))
        outcome = run(first, engine, link=link, begun=begun)
        ended = outcome.status in (PASSAGE, STIFF) or came_to_rest(task, outcome.status)
        return _Segments(task, engine, link, [outcome]).go_on() if ended else outcome
    finally:
        task.report(None)


def asks_little(task):
    """Whether nothing is asked of a run between the ends of its slices."""
    asked = task.events is not None or task.sampling is not None or task.archive is not None
    return task.report is silent and not asked


def came_to_rest(task, status):
    """Whether explicit steps collapse where friction changes within them: the implicit method may go on."""
    return status is Status.STEP_COLLAPSED and task.choose is not None and task.prepared.slips


def may_pass(task):
    """Whether there is a way past singular configurations."""
    return not (task.form.first_order or task.prepared.refusal)


def _until_its_end(report):
    """Return a progress report without the end: further segments may follow."""
    return lambda fraction, *more: None if fraction is None else report(fraction, *more)


def _recalled(known, task):
    """The `Outcome` of a segment that had ended when a checkpoint was written."""
    last, remembered = np.array(known["last"], float), np.array(known["remembered"], float)
    demand(last.shape == (3, task.q.size) and remembered.shape == task.remembered.shape, "the end of a segment")
    demand(known["next"] in (METHOD, IMPLICIT, CROSSING) and is_count(known["rows"]), "the parts of the run")
    demand_numbers(known["counts"], NAMES)
    end = RunEnd(float(known["reached"]), last, remembered, known["counts"], None, None)
    return Outcome(Status(known["status"]), "", range(known["rows"]), end, None, None, clock())


class _Segments:
    """A run whose first segments have ended.

    Parameters
    ----------
    task : Task
        The whole run's.
    engine : type
        Of its method.
    link : SegmentLink
    parts : list of Outcome
    """

    def __init__(self, task, engine, link, parts):
        self.task, self.engine, self.link, self.parts, self.turns = task, engine, link, parts, task.choose
        self.roles, self.raised = [METHOD], ""
        self.passed = [] if task.archive is None else task.archive.passed
        if self.passed:
            self.roles += [known["next"] for known in self.passed[:-1]]
            if self.passed[-1]["turns"] is None:
                self.turns = None

    def go_on(self):
        """Complete the run; its `Outcome`."""
        parts, role = self.parts, self.passed[-1]["next"] if self.passed else self._pass()
        try:
            while role is not None:
                if self.link.interrupted:
                    raise KeyboardInterrupt
                rest = self._rest()
                try:
                    parts.append(self._run(rest, role))
                except TsdynError as error:
                    if role != IMPLICIT:  # the partial result is returned
                        parts[-1] = parts[-1]._replace(status=Status.SINGULAR, reason=str(error))
                        break
                    role = self._pass(gives_up=True)
                else:
                    self.roles.append(role)
                    role = self._pass()
        except KeyboardInterrupt:
            parts[-1] = parts[-1]._replace(status=Status.INTERRUPTED)
        return self._outcome()

    def _pass(self, gives_up=False):
        """Who makes the next segment, None for nobody; the archive knows of it, and of the one that has ended.

        Its per-step outputs begin with the row that the segment before ends with.
        """
        part, archive, link = self.parts[-1], self.task.archive, self.link
        if gives_up or (self.roles[-1] == IMPLICIT and part.status in GIVEN_UP):
            self.turns, role = None, METHOD
        else:
            role = self._next(part.status)
        if archive is not None and role is not None:
            if gives_up:
                self.passed.pop()
            end = part.end
            numbers = {"status": part.status, "reached": end.reached, "counts": dict(end.counts), "next": role}
            arrays = {"rows": len(part.rows), "last": end.last.tolist(), "remembered": end.remembered.tolist()}
            turns = None if self.turns is None else self.turns.saved()
            self.passed.append(
                {**numbers, **arrays, "turns": turns, "relay": [link.share, link.largest, float(link.h)]}
            )
            archive.skips = self.task.times.size == 0
        return role

    def _next(self, status):
        role, parts = self.roles[-1], self.parts
        if status is PASSAGE:
            t0, t1 = self.task.span
            if len(parts) > limits.PASSES and parts[-1].end.reached - parts[
                -1 - limits.PASSES
            ].end.reached < limits.GOT_ON * (t1 - t0):
                parts[-1] = parts[-1]._replace(status=Status.STEP_COLLAPSED)
                return None
            return CROSSING if role != CROSSING else self.roles[-2]
        if role == METHOD and self.turns is not None and came_to_rest(self.task, status):
            return IMPLICIT
        return None if status is not STIFF else METHOD if role == IMPLICIT else IMPLICIT

    def _run(self, rest, role):
        """The `Outcome` of the next segment."""
        task, link, turned = self.task, self.link, self.roles[-1] != CROSSING
        if role == CROSSING:
            link.h = 0.0
            return run(by_series(rest), SeriesEngine, link=link, past=lambda memory: Carrier(memory, task, link.share))
        if self.turns is not None:
            self.turns.begin(role == IMPLICIT, rest.span[0], turned)
        if role == METHOD or not turned:
            link.h = 0.0
        if role == IMPLICIT:
            demand_holonomic(rest.prepared.packed, rest.q, rest.span[0], rest.form.name)
            method, self.raised = within_rounding(self.turns.implicit, rest.prepared.packed, rest.q)
            rest = rest._replace(method=method)
        return run(rest._replace(choose=self.turns), StepEngine if role == IMPLICIT else self.engine, link=link)

    def _rest(self):
        """The remaining task, by the task's method."""
        task, parts, last = self.task, self.parts, self.parts[-1].end
        times, left, done = task.times, task.max_steps, sum(part.end.counts["steps"] for part in parts)
        if times.size:
            times = times[sum(len(part.rows) for part in parts) :]
            times = times if times.size else np.array([np.inf])  # an empty array would ask for every step
        if left is not None:
            left = max(left - done, 0)
        (start, end), reached = task.span, last.reached

        def report(fraction, t, steps):
            task.report((reached + fraction * (end - reached) - start) / (end - start), t, done + steps)

        return task._replace(
            span=(reached, end), q=last.last[0], qd=last.last[1], remembered=last.remembered, times=times,
            max_steps=left, report=_until_its_end(report),
        )  # fmt: skip

    def _outcome(self):
        task, parts, last = self.task, self.parts, self.parts[-1]
        logs = task.history and not task.archive
        said = last.reason, self._turned(), crossings(self._who(CROSSING)), self.raised
        ends = [part.end for part in parts]
        steps = StepLog([end.steps for end in ends]) if logs else None
        charts = ChartLog([end.charts for end in ends]) if logs else None
        counts = summed([end.counts for end in ends])
        return last._replace(
            reason=" ".join(part for part in said if part),
            rows=self._rows(),
            end=RunEnd(last.end.reached, last.end.last, last.end.remembered, counts, steps, charts),
            trajectory=StepPieces([part.trajectory for part in parts]) if task.dense_output else None,
            began=parts[0].began,
            method=self._methods(),
        )

    def _who(self, role):
        """The segments that somebody has made, each with the one before."""
        return [pair for pair, who in zip(pairwise(self.parts), self.roles[1:], strict=False) if who == role]

    def _rows(self):
        """The output rows of all segments; every step's begin with the row that the segment before ends with."""
        task = self.task
        if task.archive is not None:
            return range(task.archive.counts["outputs"])
        first, *others = (part.rows for part in self.parts)
        return np.concatenate([first, *(rows[1:] if task.times.size == 0 else rows for rows in others)])

    def _turned(self):
        """Say how often the implicit method took over, and when first."""
        found = [before.end.reached for before, _ in self._who(IMPLICIT)]
        if not found:
            return ""
        name, times = type(self.task.choose.implicit).__name__, "" if len(found) == 1 else f" {len(found)} times, first"
        return f"The motion is stiff: {name} took over{times} at t = {found[0]:.6g} s."

    def _methods(self):
        """The methods of a run that has turned, that of most of the time first; else nothing."""
        implicit = self._who(IMPLICIT)
        if not implicit:
            return ""
        within = sum(part.end.reached - before.end.reached for before, part in implicit)
        first = self.task.method, self.task.choose.implicit
        most = 2.0 * within > self.parts[-1].end.reached - self.task.span[0]
        return " and ".join(repr(method) for method in (first[::-1] if most else first))


def summed(counts):
    """Return the counts of the whole run."""
    ways = {"stiff": any, "largest_landing": max}
    return {name: ways.get(name, sum)(each[name] for each in counts) for name in counts[0]}
