"""Cases, run one after the other, in the arrays that the runs of a thread share."""

from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..ahead import prepare_first_run
from ..elements.bodies import PointMass
from ..errors import Status, TsdynError
from ..files.scene_text import TableNumbers
from ..jit.code_hash import is_ours
from ..model.equations import is_of_user
from ..model.handles import classes, handles_of
from ..model.packed import Derived, System, is_small
from ..motions.signals import Signal
from ..rows.constraint_graph import are_unequal, weights
from ..rows.inertia_rows import lean_bodies
from ..runs.events import prepare
from ..runs.task import Task, between, interval, output_times
from ..simulation import prepared_run
from ..simulation.parameters import KEPT
from ..simulation.phase_scenes import at_start
from ..simulation.prepared_run import Run, first_method, run_task
from ..simulation.run_options import by_name
from ..simulation.scene_cache import prepared
from ..simulation.solution import Solution
from ..simulation.variants import family_of, of_numbers, packed_anew, start_names
from .case_loop import Batch, Finished, FirstSlice, Starts
from .case_numbers import OF_ROWS, writer_of
from .cases import TIMES, keep_of, record_of, reduced, started
from .tolerances import MOST_KEPT

# Which cases can share arrays: those whose numbers change nothing that is found from them beforehand.


def serves(family, kept, names):
    """Return True if cases with other values of these parameters, all where names is None, can share arrays."""
    packed = family.packed
    driven = {kind for kind, row in zip(classes(packed), packed.system.kinds, strict=True) if row.phi_t}
    if kept.sampled:
        return False
    fields = family.fields.values() if names is None else map(family.field, names)
    for owner in {id(field.owner): field.owner for field in fields}.values():
        if isinstance(owner, TableNumbers) and names is not None:
            return False
        if owner is family.template or isinstance(owner, (PointMass, TableNumbers)):
            continue
        load = family.load_of(owner)
        if load is not None and any(isinstance(value, Signal) for value in load.parameters):
            return False  # numbers beside a function of time are written into the memory of the series
        kinds = {type(part) for part in getattr(owner, "parts", ())}
        if load is None and (kinds & driven or not all(is_ours(kind.__module__) for kind in (type(owner), *kinds))):
            return False
    return True


def have_same_zeros(parameters, base):
    """Whether numbers of constraints are zero where others are: masks of columns depend on these."""
    if parameters is base:
        return True
    changed = [(new, old) for new, old in zip(parameters, base, strict=True) if new is not old]
    return all((x == 0.0) == (y == 0.0) for new, old in changed for x, y in zip(new, old, strict=True))


# The arrays that the runs of one thread have in common: each case writes its numbers into them.
#
# Everything that numbers don't change is made once: constraint graphs, memory of runs, addresses. A case whose numbers
# change more (an axis without inertia, a scene of micrometres) isn't run here; it is run as a scene of its own, with
# the same bits.


class CaseWorkspace:
    """Arrays of a scene, and the memory of its runs; for one thread.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study):
        self.study, family = study, study.family
        derived = Derived(shared=family.shared)
        for name in KEPT:
            setattr(derived, name, getattr(family.packed.derived, name))
        system = System(*(array.copy() for array in family.packed.system))
        self.base, self.packed = family.packed, family.packed._replace(system=system, derived=derived)
        self.kept, template = study.kept.like(self.packed), family.template
        self.scene = SimpleNamespace(
            packed=self.packed, system=system, bodies=template.bodies, constraints=template.constraints,
            row_names=template.row_names,
        )  # fmt: skip
        self.is_unequal = are_unequal(system)
        self.written, self.starts = set(), Starts(self)
        self._slice = FirstSlice(study) if FirstSlice.serves(study) and not study.retimes else None
        self.writer = None if study.names is None else writer_of(self, study.names)
        self._chunk, self._batch = None, None

    def systems(self):
        """The `System`s whose arrays hold the numbers of a case, but for reals: the scene's, and the memory's."""
        return [self.packed.system, *(memory.context.system for memory in self._memories())]

    def enter(self, packed):
        """Write the numbers of a packed scene; False if they change more than numbers."""
        base, own = self.base, self.packed
        if is_small(packed.size) != is_small(base.size) or not have_same_zeros(packed.parameters, base.parameters):
            return False
        names = [name for name in System._fields if getattr(packed.system, name) is not getattr(base.system, name)]
        moved = packed.coordinates is not base.coordinates
        if (moved or "mass" in names or "inertia" in names) and lean_bodies(packed):
            return False
        for name in {*names, *self.written}:
            array = getattr(packed.system, name)
            getattr(own.system, name)[...] = array
            for memory in self._memories():
                getattr(memory.context.system, name)[...] = array
        if moved or self.kept.packed.coordinates is not base.coordinates:
            own.derived.levers = own.derived.near = own.derived.grounded = None
            own.derived.origin = None, None
        if packed.members is not base.members or self.kept.packed.members is not base.members:
            own.derived.members = own.derived.aligned = None
            own.derived.handles = self.kept.handles = handles_of(packed)
        if OF_ROWS & {*names, *self.written}:
            self._weigh()
        self.written = {*names}
        self.kept.packed = self.scene.packed = packed._replace(system=own.system, derived=own.derived)
        return True

    @property
    def ends_in_first_slice(self):
        """Whether nothing is asked of runs that end within a slice but their states."""
        return self._slice is not None

    @property
    def has_other_rows(self):
        """Whether the last case had other redundant rows than the first."""
        return self.starts.has_other_rows

    @property
    def is_spoilt(self):
        """Whether a case has left bodies that turn behind, which the next one may not have."""
        return bool(self.packed.derived.turning)

    @property
    def is_immobile(self):
        """Whether redundant rows leave no degree of freedom, which the message of a run says."""
        rows, system = self.packed.derived.redundant, self.packed.system
        return rows is not None and self.kept.n == len(system.segments) - len(rows)

    def _memories(self):
        return [memory for spare in self.kept._spare.values() for memory in spare]

    def graphs(self):
        """The constraint graphs of the workspace and of its runs."""
        known, series = self.packed.derived, vars(self.kept).get("series")
        others = [other.packed.derived.graph for other in self.starts.others]
        graphs = [found[0] for found in (known.graph, known.moving_graph, *others) if found is not None]
        return graphs if series is None else [*graphs, series.graph]

    def _weigh(self):
        """Write masses and inertias into the constraint graphs."""
        for graph in self.graphs():
            found = weights(self.packed.system, graph.bodies, {})
            for array, value in zip((graph.inverse, graph.mass, graph.spins), found, strict=True):
                array[...] = value

    def run_cases(self, chunk, k):
        """Run cases of a chunk from k on without Python between them; the first that was not run."""
        if self._batch is None or not self._takes(chunk):
            return k
        return self._batch.run(k, len(chunk.status))

    def _takes(self, chunk):
        """Have the writer lay out a chunk; False if there is none, or the chunk has no values for it."""
        if self.writer is None or chunk.values is None:
            return False
        if chunk is not self._chunk:
            self._chunk = chunk
            self.writer.take(chunk.values, len(chunk.status))
            if self._batch is not None:
                self._batch.enter(chunk)
        return True

    def run_case(self, chunk, k, scene):
        """As `run_packed`, case k of a chunk."""
        self.starts.has_other_rows = False
        if not self._takes(chunk):
            return None
        start, size = self.writer.write(k), self.writer.size(k)
        self.written |= self.writer.written
        if start is None:
            return None
        self.kept.packed = self.scene.packed = self.packed
        if size is not None:
            self.kept.packed = self.scene.packed = self.packed._replace(size=size)
            start = start[0].copy(), start[1].copy()  # of another size, if of the same numbers
        ran = self._run(start, scene, size is not None)
        if self._batch is None and ran is not None and Batch.serves(self):
            if self.study.lanes > 1 and self._slice is not None:
                from .lanes import LaneBatch

                self._batch = LaneBatch(self, ran[0], self._slice, self.study.lanes)
            elif isinstance(ran[1], Finished):
                self._batch = Batch(self, ran[0], self._slice)
            if self._batch is not None:
                self._batch.enter(chunk)
        return ran

    def run_packed(self, packed, start, scene):
        """The `Task` and the `Outcome` of a case, or a `Finished`; None if it can't be run here.

        `scene()` makes it a scene of its own.
        """
        self.starts.has_other_rows = False
        if not self.enter(packed):
            return None
        if packed.coordinates is not self.base.coordinates:
            start = tuple(np.array(array) for array in start)  # of another size, if of the same numbers
        return self._run(start, scene)

    def _run(self, start, scene, is_resized=False):
        if self.written & OF_ROWS and are_unequal(self.packed.system) != self.is_unequal:
            return None
        found = self.starts.start(start)
        if found is None:
            return None
        study, (memory, (q, qd)) = self.study, found
        if is_resized:  # what is packed beside the arrays is that of the base
            if self.packed.derived.redundant is not None:
                return None
            self.packed.derived.origin = q, None  # the writer has compared
        options, method, span = study.options, study.method, study.span
        choose = None
        if options.method is None:
            choose = prepared_run.turns_of(study.scene, self.kept, method, options.form, span, study.within)
        stops = self.kept.stops(*span, method.step is None) if study.retimes else study.stops
        task = Task(
            self.kept, method, options.form, span, q, qd, memory, study.times, study.within,
            options.dense_output, study.events, options.constraint_tol, options.max_steps,
            options.chart_interval or 0, study.report, options.history is not False, choose, stops,
        )  # fmt: skip
        outcome = None if self._slice is None or self.is_immobile else self._slice.run(task)
        if outcome is not None:
            return task, outcome
        if is_resized:
            return None
        outcome = run_task(task, self.scene, options.initial_tol)
        return None if prepared_run.instead(task, outcome.status) is not None else (task, outcome)


# The cases of a chunk.

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
        first = at_start(scene)
        prepare_first_run(first, options.method, options.form, self.within, default)
        acts = options.acts or getattr(call.state, "phase", None) is not None
        self.kept, self.has_phases = scene._prepared, acts or first is not scene
        self.keep = keep_of(keep, self.times, self.kept.packed)
        self.method, self.n = first_method(options, prepared(first)), self.kept.n
        self.stops = self.kept.stops(*self.span, self.method.step is None)
        self.names = None if cases.names is None else {*self.changes, *cases.names}
        if self.names is not None and free is not None:
            self.names |= start_names(self.kept.packed)
        self.retimes = self._retimes()
        alike = options.redundancy == "drop" and not self.has_phases
        self.has_workspace = alike and serves(self.family, self.kept, self.names)
        self.halt, self.idle = np.zeros(1, np.int64), []  # runners of the threads of an executor
        self._known = scene.packed, scene._initial()

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
        return Study, (self.scene_as_run, self.cases, self.options, self.call, self.keep, self.free, self.lanes)

    @property
    def scene_as_run(self):
        """The scene as it was; a copy where it has been changed since."""
        packed, start = self._known
        if self.scene._packed is not packed or self.scene._start is not start:
            self.scene = packed_anew(self.family, self.changes)
            self._known = self.scene.packed, self.scene._initial()
        return self.scene

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
        return started(self.scene_as_run, self.cases.values(i), self.span[0], self.free)

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
    values: dict | None = None  # name -> (k, ...), for workspaces

    @property
    def count(self):
        """Number of cases."""
        return len(self.status)


class Runner:
    """Runs cases of a `Study`; for one thread."""

    def __init__(self, study):
        self.study, self._workspaces = study, []

    def values(self, cases):
        """Values of some cases, a slice, as arrays by name; None where workspaces take none."""
        study = self.study
        if not study.has_workspace or study.names is None or study.free is not None:
            return None
        given, count = {**study.changes, **study.cases.fixed}, cases.stop - cases.start
        values = {name: _repeated(value, count) for name, value in given.items()}
        return values | {name: column[cases] for name, column in study.cases.columns.items()}

    def run_many(self, chunk, k):
        """Run cases from k on that need no Python; the first that was not run."""
        return self._workspaces[0].run_cases(chunk, k) if self._workspaces else k

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
        if study.has_workspace:
            ran = self._in_workspace(lambda workspace: workspace.run_case(chunk, k, lambda: self._scene(changes)))
            if ran is not None:
                return self._record(changes, *ran)
        found = study.family.numbers(changes)
        if study.has_workspace and found is not None:
            ran = self._in_workspace(lambda workspace: workspace.run_packed(*found, lambda: self._scene(changes)))
            if ran is not None:
                return self._record(changes, *ran)
        scene = self._scene(changes)
        solution = Run(scene, study.options)._solve(replace(study.call, progress=study.report))
        rows = np.column_stack((solution.t, solution.q, solution.qd)) if study.keep == TIMES else None
        return self._recorded(solution, SimpleNamespace(end=solution._end, rows=rows))

    def _in_workspace(self, run):
        """A workspace, that of the last case first, and what `run` makes of it; None if a case can't be run in any.

        Each has the redundant rows of its first case, if there are any: the order of these follows from the numbers.
        """
        for workspace in (*self._workspaces, None):
            if workspace is None and len(self._workspaces) < MOST_KEPT:
                workspace = CaseWorkspace(self.study)
                self._workspaces.append(workspace)
            if workspace is None:
                return None
            ran = run(workspace)
            if workspace.is_spoilt:
                self._workspaces.remove(workspace)
            elif ran is not None and workspace is not self._workspaces[0]:
                self._workspaces.remove(workspace)
                self._workspaces.insert(0, workspace)
            if ran is not None:
                return workspace, *ran
            if not workspace.has_other_rows:
                return None
        return None

    def _scene(self, changes):
        """A scene with these values."""
        family = self.study.family
        found = None if self.study.kept.sampled else family.numbers(changes)
        if found is None:  # or functions that are sampled, which may have a state
            return packed_anew(family, changes)
        return of_numbers(self.study.scene, family, changes, *found)

    def _record(self, changes, workspace, task, outcome):
        """The `CaseRecord` of a run in a workspace."""
        study, keep = self.study, self.study.keep
        plain = isinstance(outcome, Finished) or (
            outcome.status is Status.SUCCESS and not (outcome.reason or outcome.end.near_steps or callable(keep))
        )
        if plain and not workspace.is_immobile:
            return CaseRecord(Status.SUCCESS, PLAIN, record_of(keep, outcome, study.n, task.times))
        scene = self._scene(changes)
        scene._packed.derived.redundant = workspace.packed.derived.redundant
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
