"""Cases, run one after the other."""

from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..ahead.first_run import prepare_first_run
from ..errors import Status, TsdynError
from ..model.equations import is_of_user
from ..runs.arguments import interval, output_times
from ..runs.events import prepare
from ..runs.task import between
from ..simulation.prepared_run import Run, first_method
from ..simulation.run_options import by_name
from ..simulation.solution import Solution
from ..simulation.variants import family_of, of_numbers, packed_anew, start_names
from .arena import Arena, serves
from .case_loop import Finished
from .cases import TIMES, keep_of, record_of, reduced, started
from .tolerances import MOST_KEPT

PLAIN = Status.SUCCESS.sentence


class CaseRecord(NamedTuple):
    """What is known of a case that has been run."""

    status: Status
    message: str
    arrays: dict  # by name


class Study:
    """What all cases have in common: the scene, the options of their runs, what is kept.

    Parameters
    ----------
    scene : Scene
    cases : Cases or CalledCases
    options : RunOptions
    call : RunCall
    keep : str, sequence of str or callable
    free : sequence of str, optional
        Names of the bodies by which each start is made consistent; None takes starts as they are.
    lanes : int
        Cases that run at once in a thread.

    Raises
    ------
    TsdynError
        As `simulate` does for its options.
    """

    def __init__(self, scene, cases, options, call, keep, free=None, lanes=1):
        self.scene, self.cases, self.options, self.call = scene, cases, options, call
        self.free, self.lanes = free, lanes
        self.span = interval(call.t_span)
        self.times, self.events = output_times(call.t_eval, *self.span), prepare(options.events)
        self.within = options.dense_output or self.events is not None or between(self.times, self.span)
        self.family, self.changes = family_of(scene)
        default = options.rtol, options.atol, options.may_use_series
        prepare_first_run(scene, options.method, options.form, self.within, default)
        self.kept = scene._prepared
        self.keep = keep_of(keep, self.times, self.kept.packed)
        self.method, self.n = first_method(options, self.kept), self.kept.n
        self.stops = self.kept.stops(*self.span, self.method.step is None)
        self.names = None if cases.names is None else {*self.changes, *cases.names}
        if self.names is not None and free is not None:
            self.names |= start_names(self.kept.packed)
        self.retimes = self._retimes()
        self.has_arena = options.redundancy == "drop" and serves(self.family, self.kept, self.names)
        self.halt, self.idle = np.zeros(1, np.int64), []  # runners of the threads of an executor

    def _retimes(self):
        """Whether the times of short changes of functions may differ from case to case, for scenes of one family."""
        if not any(is_of_user(load.force) for load in self.kept.packed.loads):
            return False
        return self.names is None or any(is_of_user(self.family.field(name).owner) for name in self.names)

    @property
    def stopped(self):
        """Whether the ensemble ends: loops of cases see it, too."""
        return bool(self.halt[0])

    @stopped.setter
    def stopped(self, whether):
        self.halt[0] = whether

    def __reduce__(self):
        """What is analysed is analysed again in another process."""
        return Study, (self.scene, self.cases, self.options, self.call, self.keep, self.free, self.lanes)

    @property
    def given(self):
        """The arguments of `simulate` by name, but for the scene."""
        return by_name(self.options, self.call)

    def twin(self, cases):
        """The same for some of the cases."""
        other = object.__new__(Study)
        vars(other).update(vars(self), cases=cases)
        return other

    def values(self, i):
        """Values of case i by name, with those of a consistent start."""
        return started(self.scene, self.cases.values(i), self.span[0], self.free)

    def report(self, fraction, *more):
        """Of a run: end it if the ensemble has been stopped."""
        if self.stopped and fraction is not None:
            raise KeyboardInterrupt


class Chunk(NamedTuple):
    """Cases without a gap, and their results."""

    first: int
    status: np.ndarray  # int64 (k,)
    messages: dict  # case -> message, of those that are not the sentence of their status
    arrays: dict  # name -> (k, ...)
    values: dict | None = None  # name -> (k, ...), for arenas

    @property
    def count(self):
        """Number of cases."""
        return len(self.status)


class Runner:
    """Runs cases of a `Study`; for one thread."""

    def __init__(self, study):
        self.study, self._arenas = study, []

    def values(self, cases):
        """Values of some cases, a slice, as arrays by name; None where arenas take none."""
        study = self.study
        if not study.has_arena or study.names is None or study.free is not None:
            return None
        given, count = {**study.changes, **study.cases.fixed}, cases.stop - cases.start
        values = {name: _repeated(value, count) for name, value in given.items()}
        return values | {name: column[cases] for name, column in study.cases.columns.items()}

    def run_many(self, chunk, k):
        """Run cases from k on that need no Python; the first that was not run."""
        return self._arenas[0].run_cases(chunk, k) if self._arenas else k

    def run(self, chunk, k):
        """The `CaseRecord` of case k of a chunk."""
        try:
            return self._run(chunk, k)
        except TsdynError as error:
            return CaseRecord(Status.CASE_FAILED, str(error), {})
        except Exception as error:  # of a user's function: the other cases go on
            return CaseRecord(Status.CASE_FAILED, f"{type(error).__name__}: {error}", {})

    def _run(self, chunk, k):
        study = self.study
        values = study.values(chunk.first + k)
        changes = {**study.changes, **values} if study.changes else values
        if study.has_arena:
            ran = self._in_arena(lambda arena: arena.run_case(chunk, k, lambda: self._scene(changes)))
            if ran is not None:
                return self._record(changes, *ran)
        found = study.family.numbers(changes)
        if study.has_arena and found is not None:
            ran = self._in_arena(lambda arena: arena.run_packed(*found, lambda: self._scene(changes)))
            if ran is not None:
                return self._record(changes, *ran)
        scene = self._scene(changes)
        solution = Run(scene, study.options)._solve(replace(study.call, progress=study.report))
        rows = np.column_stack((solution.t, solution.q, solution.qd)) if study.keep == TIMES else None
        return self._recorded(solution, SimpleNamespace(end=solution._end, rows=rows))

    def _in_arena(self, run):
        """An arena, that of the last case first, and what `run` makes of it; None if a case can't be run in any.

        Each has the redundant rows of its first case, if there are any: the order of these follows from the numbers.
        """
        for arena in (*self._arenas, None):
            if arena is None and len(self._arenas) < MOST_KEPT:
                arena = Arena(self.study)
                self._arenas.append(arena)
            if arena is None:
                return None
            ran = run(arena)
            if arena.is_spoilt:
                self._arenas.remove(arena)
            elif ran is not None and arena is not self._arenas[0]:
                self._arenas.remove(arena)
                self._arenas.insert(0, arena)
            if ran is not None:
                return arena, *ran
            if not arena.has_other_rows:
                return None
        return None

    def _scene(self, changes):
        """A scene with these values."""
        family = self.study.family
        found = None if self.study.kept.sampled else family.numbers(changes)
        if found is None:  # or functions that are sampled, which may have a state
            return packed_anew(family, changes)
        return of_numbers(self.study.scene, family, changes, *found)

    def _record(self, changes, arena, task, outcome):
        """The `CaseRecord` of a run in an arena."""
        study, keep = self.study, self.study.keep
        plain = isinstance(outcome, Finished) or (
            outcome.status is Status.SUCCESS and not (outcome.reason or outcome.end.near_steps or callable(keep))
        )
        if plain and not arena.is_immobile:
            return CaseRecord(Status.SUCCESS, PLAIN, record_of(keep, outcome, study.n, task.times))
        scene = self._scene(changes)
        scene._packed.derived.redundant = arena.packed.derived.redundant
        solution = Solution(scene, task._replace(prepared=scene._prepared), outcome, {"prepare": 0.0, "run": 0.0})
        return self._recorded(solution, outcome)

    def _recorded(self, solution, outcome):
        study = self.study
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        arrays = record_of(study.keep, outcome, study.n, study.times)
        status, message = solution.status, solution.message
        if callable(study.keep):
            arrays |= reduced(study.keep, solution)
        return CaseRecord(status, message, arrays)


def _repeated(value, count):
    """A value for all cases as a column."""
    array = np.asarray(value)
    array = array.astype(float) if array.dtype.kind in "iuf" else array
    return np.broadcast_to(array, (count, *array.shape))
