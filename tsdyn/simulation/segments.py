"""Segments of a run, each by one method: what a segment begins with, and how all of them make one outcome.

A segment ends with Status.STIFF where the default method turns to its implicit method, or back (turns.py); with
Status.STEP_COLLAPSED where friction comes to rest within a step, and the implicit method goes on; and with
Status.PASSAGE where series go on past a singular configuration, or have done so (singularity_crossing.py). All other
runs have one segment.
"""

from itertools import pairwise

import numpy as np

from ..configuration.holonomic import demand_holonomic
from ..errors import Status, TsdynError
from ..jit.compiled import clock
from ..runs.counts import NAMES
from ..runs.history import ChartLog, StepLog
from ..runs.run import begin, run
from ..runs.run_end import RunEnd
from ..runs.segments import SegmentLink
from ..runs.step_engine import StepEngine
from ..runs.task import Outcome
from ..runs.trajectory import Pieces
from ..taylor.series_engine import SeriesEngine
from ..validation import damaged, demand, demand_numbers, is_count
from .progress import silent
from .rounding_limit import within_rounding
from .singularity_crossing import Carrier, by_series, crossings
from .tolerances import GOT_ON, PASSES

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
    return not task.form.first_order and not task.prepared.refusal


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
                if rest.max_steps == 0:
                    parts[-1] = parts[-1]._replace(status=Status.MAX_STEPS)
                    break
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
            if len(parts) > PASSES and parts[-1].end.reached - parts[-1 - PASSES].end.reached < GOT_ON * (t1 - t0):
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
        counts = _summed([end.counts for end in ends])
        return last._replace(
            reason=" ".join(part for part in said if part),
            rows=self._rows(),
            end=RunEnd(last.end.reached, last.end.last, last.end.remembered, counts, steps, charts),
            trajectory=Pieces([part.trajectory for part in parts]) if task.dense_output else None,
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


def _summed(counts):
    """Return the counts of the whole run."""
    ways = {"stiff": any, "largest_landing": max}
    return {name: ways.get(name, sum)(each[name] for each in counts) for name in counts[0]}
