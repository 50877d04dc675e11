"""`prepare` and `simulate`: a run with its options made concrete for a scene, and calls of it."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..ahead import kernels_of, prepare_first_run
from ..calls import ELSEWHERE, fitting
from ..configuration.motor_starts import demand_holonomic
from ..drawing import html_table
from ..elements.element import warn_of_waiting
from ..errors import InvalidArgument, Status
from ..integrators import DOP853, Taylor
from ..jit.compiled import clock
from ..methods.integrator import frozen, is_plain
from ..observables.state import remembered
from ..runs.driver import Sampling
from ..runs.events import prepare as prepared_events
from ..runs.step_engine import StepEngine
from ..runs.task import Task, adaptive, between, demand_steps_seen, interval, output_times, state_arrays
from ..taylor.series_engine import SeriesEngine
from ..validation import damaged
from . import stored_runs
from .local_origin import origin_of, run_near, within_rounding
from .phase_scenes import at_start, with_own_parts
from .run_options import OF_CALL, OF_RUN, RunCall, RunOptions, by_name, documented, from_names
from .scene import Scene
from .scene_cache import prepared, prepared_numbers
from .segments import Turns, run_segments
from .solution import Solution
from .termination import reporter

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..hints import ArrayLike, Event, Formulation, ImpactLaw, Method, Place, Progress, Redundancy, Span, State


# Choice of the default method: Taylor; DOP853 where a part of the scene has no series; implicit where it is stiff.
#
# Taylor steps with sharp forces are shorter, and no quicker than those of DOP853 in scenes without constraints. Where
# series fail, the run begins again with DOP853. Where the motion is found stiff, the implicit method goes on:
# segments.py.


def first_method(options, prepared):
    """Return the method that a run of these `RunOptions` begins with."""
    method = options.method
    if method is None:
        series = options.may_use_series and not prepared.refusal and prepared.pays
        method = adaptive(Taylor if series else DOP853, options.rtol, options.atol)
    return method if options.max_step is None else frozen(method.bounded(options.max_step))


def reason(options, prepared):
    """Say why a run of these `RunOptions` begins with its first method."""
    if options.method is not None:
        return "as asked."
    if not options.may_use_series:
        return "series serve the tangent form alone, and make their charts themselves."
    if prepared.refusal:
        return prepared.refusal
    if not prepared.pays:
        return "a force changes sharply, and without constraints series are no quicker."
    return "every constraint and force has a series. Radau takes over where the motion is found stiff."


def turns_of(scene, prepared, method, form, span, within):
    """What makes the `Turns` of a run by the default method; None in a form that no implicit method serves."""
    return None if form.first_order else partial(Turns, scene, prepared, method, form, span, within)


def instead(task, status):
    """Return the method that begins a run of the default method again; None if its `status` stands.

    A law that is not analytic somewhere, as |v| at rest, may end series where stages go on.
    """
    failed = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    if failed and task.choose is not None and isinstance(task.method, Taylor) and task.prepared.sharp:
        return DOP853(task.method.rtol, task.method.atol, max_step=task.method.max_step)
    return None


# `prepare`: what every run of a scene with the same options has in common, worked out once.

SUCCESS = Status.SUCCESS
ENGINES = {"steps": StepEngine, "series": SeriesEngine}
FLOAT = np.dtype(float)
FIXED = {float, int}  # a tuple of them can't be changed
DRIVERS = {name: partial(run_segments, engine=engine) for name, engine in ENGINES.items()}  # by Integrator.driver


class _Last(NamedTuple):
    """What the task of the last call follows from, beside the options."""

    t_span: tuple
    t_eval: tuple | None
    start: tuple  # q, qd: arrays of the scene, or of a state
    bits: tuple | None  # of the state
    engines: dict  # of the scene: replaced where other rows or bodies take part in the equations
    task: Task
    is_regular: bool  # whether nothing else is to be checked, as of `run_task`


def _is_fixed(times):
    """Whether times can't have changed when they are given again."""
    return times is None or (type(times) is tuple and FIXED.issuperset(map(type, times)))


def _bits_of(state, prepared):
    """Positions and velocities of a state as bytes; None where a run takes more from it, or they are not plain."""
    q, qd, memory = (getattr(state, name, None) for name in ("q", "qd", "memory"))
    plain = type(q) is type(qd) is np.ndarray and q.dtype is qd.dtype is FLOAT and q.ndim == qd.ndim == 1
    if prepared.remembers or not plain or not (memory is None or np.shape(memory) == (0,)):
        return None
    return q.tobytes(), qd.tobytes()


class Run:
    """Runs of a scene with the same options, as `prepare` returns them.

    Parameters
    ----------
    scene : Scene
    options : RunOptions

    Attributes
    ----------
    scene : Scene
    options : RunOptions
    method : Integrator
        The method that a run begins with.

    Notes
    -----
    A Run may be called by several threads at once: each call has a workspace of its own, and the compiled driver
    releases the GIL. It belongs to the scene as it was prepared. After an edit of the scene a call raises
    InvalidArgument; prepare the scene again, or change numbers by `with_parameters`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> stone = scene.add_point_mass(mass=1.0, name="stone")
    >>> run = ts.prepare(scene, rtol=1e-10)
    >>> solution = run((0, 1))
    >>> print(run((solution.reached, 2.0), state=solution.state).position(stone)[-1])
    [  0.   0. -20.]
    """

    @fitting
    def __init__(self, scene: Scene, options: RunOptions) -> None:
        self.scene, self.options, self._form = scene, options, options.form
        if options.acts:
            with_own_parts(scene)
        self._first = at_start(scene)  # whose method and kernels are those of the first phase
        self._in_phases = options.acts or self._first is not scene
        self._compiled = set()  # with outputs between steps, or not
        self._last = self._seen = None  # the last `_Last`, and state
        # phases end at events
        self._prepare_kernels(self._in_phases or options.dense_output or options.events is not None)
        self._prepared = kept = prepared(self._first)
        self._packed, self._start = scene.packed, scene._initial()
        self.method = method = first_method(options, kept)
        self._driver = DRIVERS.get(method.driver, method.driver)

    @fitting
    @documented(*OF_CALL)
    def __call__(
        self,
        t_span: Span,
        *,
        t_eval: ArrayLike | None = None,
        state: State | None = None,
        store: Place | None = None,
        checkpoint: float | None = None,
        progress: Progress | None = None,
    ) -> Solution:
        """Run over an interval of time.

        Parameters
        ----------
        t_span : (float, float), s
            Start and end, start < end.
        {options}

        Returns
        -------
        Solution
            With the bits of `simulate`.

        Raises
        ------
        TsdynError
            As of `simulate`; InvalidArgument also if the scene has changed since it was prepared.
        """
        scene = self.scene
        if scene._users:
            scene.refresh()
        if scene._packed is not self._packed or scene._start is not self._start:
            raise InvalidArgument(
                "the scene has changed since it was prepared: prepare it again, by ts.prepare(scene, ...), or leave "
                "the scene as it is and change numbers by run.with_parameters({...})."
            )
        return self._solve(RunCall(t_span, t_eval, store, checkpoint, progress, state))

    @fitting
    def with_parameters(self, values: Mapping[str, Any]) -> Run:
        """Return a Run of the scene with other values of some parameters, with the same options.

        Parameters
        ----------
        values : mapping
            Values by name, as of `Scene.with_parameters`.

        Raises
        ------
        TsdynError
            As of `Scene.with_parameters`.

        Examples
        --------
        >>> import tsdyn as ts
        >>> scene = ts.Scene(gravity=(0, 0, -10))
        >>> stone = scene.add_point_mass(mass=1.0, name="stone")
        >>> run = ts.prepare(scene).with_parameters({"stone.velocity": (1, 0, 0)})
        >>> print(run((0, 1)).position(stone)[-1])
        [ 1.  0. -5.]
        """
        return Run(self.scene.with_parameters(values), self.options)

    def _of_phase(self, phase):
        """The same of a phase in which other rows hold."""
        other = copy(self)
        other.scene = other._first = phase
        other._prepared, other._packed, other._start = prepared(phase), phase.packed, phase._initial()
        other._last = other._seen = None
        return other

    def _solve(self, call: RunCall, found: tuple[Any, Any] = (None, None), archive: Any = None) -> Solution:
        """Run as of `__call__`, without checking whether the scene has changed.

        found: numbers and arrays of a checkpoint to go on from. archive: that of a run which begins again by another
        method.
        """
        started, is_stored = clock(), call.store is not None or call.checkpoint is not None
        if is_stored and archive is None and found[0] is None:
            stored_runs.demand_storable(call, self.options)
        if self._has_phases(call):
            return self._solve_phases(call, found, is_stored)
        task = self._task(call)
        if is_stored:
            return self._stored(task, call, found, archive)
        last = self._last
        if last is not None and task is last.task and last.is_regular:
            outcome = self._driver(task)
        else:
            outcome = run_task(task, self.scene, self.options.initial_tol)
        ended = clock()
        if outcome.status is not SUCCESS:
            other = instead(task, outcome.status)
            if other is not None:
                return self._with_method(other)._solve(call)
        return Solution(self.scene, task, outcome, {"prepare": outcome.began - started, "run": ended - outcome.began})

    def _has_phases(self, call):
        """Whether a run is a sequence of phases: by the scene, by actions of events, or by what these have changed."""
        return self._in_phases or (call.state is not None and getattr(call.state, "phase", None) is not None)

    def _solve_phases(self, call, found, is_stored):
        """The same of a run with phases."""
        from . import contact_run
        from .checkpoints import recorded

        started, scene, options, archive, goes_on = clock(), self.scene, self.options, None, ""
        if is_stored:
            archive = stored_runs.archive_of(
                {"scene": scene, **by_name(options, call)}, prepared_numbers(scene), bool(options.history), *found
            )
        if archive is not None and found[0] is not None and found[0].get("ended"):
            task = contact_run.first_task(scene, options, call, _run_of)
            outcome = self._ended(task, *found, archive)
            with damaged("the checkpoint"):
                phases = contact_run.phases_of(scene, *recorded(*found))
            outcome = outcome._replace(phases=phases)
            return Solution(scene, task, outcome, {"prepare": 0.0, "run": found[0]["seconds"]})
        try:
            task, outcome = contact_run.run_contacts(scene, options, call, _run_of, run_task, instead, archive)
            task, seconds = task._replace(method=self.method), clock() - started
            outcome = outcome._replace(method=outcome.method if outcome.method != repr(self.method) else "")
            if archive is not None:
                outcome = stored_runs.ended(archive, outcome, seconds, task)
                goes_on = stored_runs.call_to_go_on(archive)
        finally:
            if archive is not None:
                archive.close()
        timed = {"prepare": outcome.began - started, "run": seconds}
        return Solution(scene, task, outcome, timed, goes_on)

    def _check(self, call: RunCall) -> None:
        """Raise what a call raises before anything is run."""
        if not self._has_phases(call):
            self._task(call)
            return
        from . import contact_run

        contact_run.first_task(self.scene, self.options, call, _run_of)

    def _task(self, call):
        """The `Task` of a call, its start consistent with the constraints.

        That of the last call serves again if nothing that it follows from can have changed.
        """
        state, kept, last = call.state, self._prepared, self._last
        known, is_plain, bits = kept.packed.derived, call.progress is call.store is None, None
        if state is not None:  # its numbers are compared if it is given again
            bits = _bits_of(state, kept) if state is self._seen else None
            is_plain = is_plain and bits is not None
        self._seen = state
        if (
            is_plain
            and last is not None
            and call.t_span is last.t_span
            and call.t_eval is last.t_eval
            and bits == last.bits
            and (state is not None or self.scene._start is last.start)
            and known.engines is last.engines
        ):
            return last.task
        start = self.scene._initial() if state is None else state_arrays(state, kept.n)
        task = self._new_task(call, start)
        if is_plain and not (task.events or task.sampling) and _is_fixed(call.t_span) and _is_fixed(call.t_eval):
            is_regular = origin_of(task.prepared.packed, task.q) is None and task.method.step is None
            is_regular = is_regular and within_rounding(task.method, task.prepared.packed, task.q)[0] is task.method
            self._last = _Last(call.t_span, call.t_eval, start, bits, known.engines, task, is_regular)
        return task

    def _new_task(self, call, start, memory=None, tol=None):
        """The same; start: q, qd as given, memory: joint angles and what forces remember, by default of the state.

        tol: that of the start, by default that of the options.
        """
        options, kept, method, state = self.options, self._prepared, self.method, call.state
        span = interval(call.t_span)
        times = output_times(call.t_eval, *span)
        demand_steps_seen(method, *span)
        within = options.dense_output or options.events is not None or between(times, span)
        self._prepare_kernels(within)
        stops = kept.stops(*span, method.step is None)
        begins = memory is None and state is None
        memory = remembered(state, kept, span[0], start[0]) if memory is None else memory
        tol = options.initial_tol if tol is None else tol
        q, qd = kept.start(self.scene, start, span[0], tol, memory, options.redundancy == "drop")
        if not self._form.basis_free or method.implicit:
            demand_holonomic(kept.packed, q, span[0], options.formulation)
        choose = sampling = None
        if kept.sampled:  # a sampled controller can't be run again: no turns
            sampling = Sampling(kept, not begins)
        elif options.method is None:
            choose = turns_of(self.scene, kept, method, self._form, span, within)
        history = call.store is None if options.history is None else options.history
        return Task(
            kept, method, self._form, span, q, qd, memory, times, within, options.dense_output,
            prepared_events(options.events), options.constraint_tol, options.max_steps, options.chart_interval or 0,
            reporter(call.progress), history, choose, stops, sampling,
        )  # fmt: skip

    def _prepare_kernels(self, within):
        """Have compiled what runs need, at the first one with outputs between steps, or without."""
        if within not in self._compiled:
            options = self.options
            default = options.rtol, options.atol, options.may_use_series
            prepare_first_run(self._first, options.method, self._form, within, default)
            self._compiled.add(within)

    def _with_method(self, method):
        """The same by another method."""
        return Run(self.scene, replace(self.options, integrator=method, rtol=None, atol=None))

    def _stored(self, task, call, found, archive):
        """Run a task whose outputs go to a store, from its start or from what was found in a checkpoint."""
        scene, (numbers, arrays), kept = self.scene, found, task.prepared
        given = {"scene": scene, **by_name(self.options, call)}
        archive = archive or stored_runs.archive_of(given, kept, task.history, numbers, arrays)
        started = clock()
        if numbers is not None and numbers.get("ended"):
            outcome = self._ended(task, numbers, arrays, archive)
            return Solution(scene, task, outcome, {"prepare": 0.0, "run": numbers["seconds"]})
        try:
            task = task._replace(archive=archive, max_steps=archive.most_steps)
            outcome = run_task(task, scene, self.options.initial_tol)
            seconds = clock() - started
            other = instead(task, outcome.status)
            if other is not None:
                run = self._with_method(other)
                given |= by_name(run.options, call)
                return run._solve(call, archive=stored_runs.begin_again(archive, given))
            outcome = stored_runs.ended(archive, outcome, seconds, task)
        finally:
            archive.close()
        timed = {"prepare": outcome.began - started, "run": seconds}
        return Solution(scene, task, outcome, timed, stored_runs.call_to_go_on(archive))

    @staticmethod
    def _ended(task, numbers, arrays, archive):
        """The `Outcome` of a stored run that has ended."""
        kept = task.prepared
        with damaged("the checkpoint"):
            slots = kept.handles.count + kept.packed.system.memory.size
            return stored_runs.ended_outcome(numbers, arrays, archive, kept.n, slots)

    def __reduce__(self):
        """A pickled Run is prepared again where it is read."""
        return Run, (self.scene, self.options)

    def _facts(self):
        method, options = self.method, self.options
        why = reason(options, self._prepared)
        tolerances = f"fixed steps of {method.step} s"
        if method.step is None:
            rtol, atol = method.step_tolerances()
            tolerances = (
                f"rtol={method.rtol:g}, atol={method.atol:g} of the run; each step is held to rtol={rtol:.2g}, "
                f"atol={atol:.2g} (safety factor {method.rtol / rtol:.3g})"
            )
        kernels = kernels_of(self._first, method, self._form, True in self._compiled)
        laws = {load.force.name: load.law for load in self._prepared.packed.loads if load.law is not None}
        said, phased = [f"{name} {law.said}" for name, law in laws.items()], self._first is not self.scene
        return {
            "method": f"{method!r}: {why}",
            "steps": tolerances,
            "form": f"{options.formulation}; |Phi| to {options.constraint_tol:g} m, starts to {options.initial_tol:g}",
            "options": repr(options),
            "kernels": f"{len(kernels)}: {_listed(kernels)}",
            **({"laws": "; ".join(said)} if said else {}),
            **({"phases": "the first one; each begins by a method and kernels of its own"} if phased else {}),
        }

    def __str__(self) -> str:
        lines = [f"  {name:9}{fact}" for name, fact in self._facts().items()]
        return "\n".join([f"Run of {self.scene!r}", *lines])

    def _repr_html_(self) -> str:
        """Return the text as a table, for notebooks."""
        return html_table(self._facts().items(), f"Run of {self.scene!r}", named=True)

    def __repr__(self) -> str:
        return f"<Run of {self.scene!r} by {self.method!r}, {self.options.formulation}>"


def _listed(kernels):
    """The names of kernels, those of a class of constraints or forces behind it."""
    groups = {}
    for kernel in kernels:
        owner, _, name = getattr(kernel, "py_func", kernel).__qualname__.removesuffix("_loop").rpartition(".")
        groups.setdefault(owner, []).append(name)
    own = groups.pop("", [])
    return ", ".join([*(f"{owner} ({', '.join(names)})" for owner, names in groups.items()), *own])


@fitting
@documented(*OF_RUN)
def prepare(
    scene: Scene,
    *,
    integrator: Method | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    formulation: Formulation = "tangent",
    constraint_tol: float = 1e-12,
    initial_tol: float = 1e-9,
    redundancy: Redundancy = "drop",
    dense_output: bool = False,
    events: Event | Sequence[Event] | None = None,
    max_steps: int | None = None,
    max_step: float | None = None,
    history: bool | None = None,
    chart_interval: int | None = None,
    law: ImpactLaw = "newton",
) -> Run:
    """Prepare runs of a scene: method, kernels and workspace are chosen once, for any number of calls.

    Parameters
    ----------
    scene : Scene
    {options}

    Returns
    -------
    Run
        `run(t_span, t_eval=..., state=...)` returns the `Solution` of `simulate` with these options. `print(run)` says
        what it will do.

    Raises
    ------
    TsdynError
        A subclass: InvalidArgument if an option is inadmissible or the method doesn't serve the scene.

    Examples
    --------
    A pendulum, restarted from where it is every tenth of a second:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> run, state = ts.prepare(scene, rtol=1e-9), None
    >>> for k in range(5):
    ...     state = run((0.1 * k, 0.1 * (k + 1)), state=state).state
    >>> print(state.position(bob).round(6) + 0.0)
    [ 0.372081  0.       -0.9282  ]
    """
    demand_scene(scene)
    return Run(
        scene,
        RunOptions(
            integrator, rtol, atol, formulation, constraint_tol, initial_tol, redundancy, dense_output, events,
            max_steps, max_step, history, chart_interval, law,
        ),
    )  # fmt: skip


ELSEWHERE["prepare"] = dict.fromkeys(("t_span", *OF_CALL), "the call, run(t_span, t_eval=...)")
ELSEWHERE["Run.__call__"] = dict.fromkeys(OF_RUN, "ts.prepare(scene, rtol=...)")


def demand_scene(scene):
    """Raise InvalidArgument unless it is a scene; warn of parts that were never added to it."""
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    if scene._waiting:
        warn_of_waiting(scene)


def run_task(task, scene, initial_tol):
    """Run the method's driver, relative to a local origin if the scene is far from its own."""
    method, packed = task.method, task.prepared.packed
    driver, origin = DRIVERS.get(method.driver, method.driver), origin_of(packed, task.q)
    if origin is not None:
        return run_near(driver, task, scene, origin, initial_tol)
    limited, said = within_rounding(method, packed, task.q)
    outcome = driver(task if limited is method else task._replace(method=limited))
    if method.step is not None:
        said = task.prepared.unresolved(*task.span, method.step)
    if said:
        outcome = outcome._replace(reason=" ".join(part for part in (outcome.reason, said) if part))
    return outcome


# `simulate`: prepare a run, or take the last one of the same options, and run it; whether a run could begin.

KEPT = 8  # runs of a scene


@fitting
@documented()
def simulate(  # many arguments, by name: each is an option of a run
    scene: Scene,
    t_span: Span,
    *,
    integrator: Method | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    formulation: Formulation = "tangent",
    constraint_tol: float = 1e-12,
    initial_tol: float = 1e-9,
    redundancy: Redundancy = "drop",
    t_eval: ArrayLike | None = None,
    dense_output: bool = False,
    events: Event | Sequence[Event] | None = None,
    max_steps: int | None = None,
    max_step: float | None = None,
    history: bool | None = None,
    store: Place | None = None,
    checkpoint: float | None = None,
    progress: Progress | None = None,
    chart_interval: int | None = None,
    law: ImpactLaw = "newton",
    state: State | None = None,
) -> Solution:
    """Integrate a scene over an interval of time; the scene is not changed.

    Parameters
    ----------
    scene : Scene
    t_span : (float, float), s
        Start and end, start < end.
    {options}

    Returns
    -------
    Solution
        Partial if the run ended early, by Ctrl-C for example: see `.success`, `.status`, `.message`, or call
        `.raise_if_failed()`.

    Raises
    ------
    TsdynError
        A subclass, before the run starts: InvalidArgument, InvalidBody, InconsistentState, RedundantConstraints,
        SingularConfiguration.

    Examples
    --------
    A pendulum of 1 m, released from the horizontal:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> solution = ts.simulate(scene, (0, 1), t_eval=[0.0, 0.5, 1.0])
    >>> print(solution.position(bob)[:, 2].round(6) + 0.0)
    [ 0.       -0.9282   -0.148328]
    >>> bool(solution.constraint_error.position.max() < 1e-12)
    True
    """
    demand_scene(scene)
    options = RunOptions(
        integrator, rtol, atol, formulation, constraint_tol, initial_tol, redundancy, dense_output, events, max_steps,
        max_step, history, chart_interval, law,
    )  # fmt: skip
    call = RunCall(t_span, t_eval, store, checkpoint, progress, state)
    return _run_of(scene, options, call)._solve(call)


def _run_of(scene, options, call):
    """The `Run` of a scene with these options: one of the last ones, or a new one, for a call that is checked first.

    Runs of a method or of events of a user aren't kept: what they do may change unseen.
    """
    if scene._users:
        scene.refresh()
    kept = scene._prepared
    for run in () if kept is None else kept.runs:
        if run.options == options:
            return run
    output_times(call.t_eval, *interval(call.t_span))
    base = scene._base
    run = Run(scene, options) if base in (None, scene) else _run_of(base, options, call)._of_phase(scene)
    if options.events is None and is_plain(run.method):
        kept = prepared_numbers(scene)
        kept.runs = (run, *kept.runs[: KEPT - 1])  # and not written to: other threads may be reading
    return run


# Whether a run could begin: all that `simulate` refuses before it runs anything.


def demand_startable(scene, given):
    """Raise what `simulate(scene, **given)` raises before a run."""
    options, call = from_names({"t_span": (0.0, 1.0), **given})
    Run(scene, options)._check(call)
