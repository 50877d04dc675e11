"""`prepare`: what every run of a scene with the same options has in common, worked out once."""

from __future__ import annotations

import html
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from ..ahead.first_run import kernels_of, prepare_first_run
from ..calls import fitting, fitting_methods
from ..configuration.holonomic import demand_holonomic
from ..elements.membership import warn_of_waiting
from ..errors import InvalidArgument
from ..jit.compiled import clock
from ..observables.state import remembered
from ..runs.arguments import demand_steps_seen, interval, output_times, state_arrays
from ..runs.events import prepare as prepared_events
from ..runs.sampling import Sampling
from ..runs.step_engine import StepEngine
from ..runs.task import Task, between
from ..taylor.series_engine import SeriesEngine
from ..validation import damaged
from . import method_choice, stored_runs
from .local_origin import origin_of, run_near
from .progress import reporter
from .rounding_limit import within_rounding
from .run_options import RunCall, RunOptions, by_name, documented
from .scene import Scene
from .scene_cache import prepared
from .segments import run_segments
from .solution import Solution

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..hints import ArrayLike, Event, Formulation, Method, Place, Progress, Redundancy, Span, State

ENGINES = {"steps": StepEngine, "series": SeriesEngine}
DRIVERS = {name: partial(run_segments, engine=engine) for name, engine in ENGINES.items()}  # by Integrator.driver


@fitting_methods
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

    def __init__(self, scene: Scene, options: RunOptions) -> None:
        self.scene, self.options = scene, options
        self._compiled, self._known = set(), None  # with outputs between steps or not; the last start
        self._prepare_kernels(options.dense_output or options.events is not None)
        self._prepared = kept = prepared(scene)
        self._start = scene._initial()
        self.method = method = method_choice.first_method(options, kept)
        self._form, self._drop = options.form, options.redundancy == "drop"
        self._driver = DRIVERS.get(method.driver, method.driver)
        self._needs_holonomic = not self._form.basis_free or method.implicit
        if method.coupled and kept.rough:
            raise InvalidArgument(
                f"{type(method).__name__} doesn't solve for reactions that friction depends on "
                f"({', '.join(kept.rough)}): SDIRK54 does, as do all explicit methods."
            )

    @documented("t_eval", "state", "store", "checkpoint", "progress")
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
        if scene._prepared is not self._prepared or scene._start is not self._start:
            raise InvalidArgument(
                "the scene has changed since it was prepared: prepare it again, by ts.prepare(scene, ...), or leave "
                "the scene as it is and change numbers by run.with_parameters({...})."
            )
        return self.solve(RunCall(t_span, t_eval, store, checkpoint, progress, state))

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

    def solve(self, call: RunCall, found: tuple[Any, Any] = (None, None), archive: Any = None) -> Solution:
        """Run as of `__call__`, without a look at what has become of the scene.

        found: numbers and arrays of a checkpoint to go on from. archive: that of a run which begins again by another
        method.
        """
        started, is_stored = clock(), call.store is not None or call.checkpoint is not None
        if is_stored and archive is None and found[0] is None:
            stored_runs.demand_storable(call, self.options)
        task = self._task(call)
        if is_stored:
            return self._stored(task, call, found, archive)
        outcome = run_task(task, self.scene, self.options.initial_tol, self._driver)
        ended, other = clock(), method_choice.instead(task, outcome.status)
        if other is not None:
            return self._by(other).solve(call)
        return Solution(self.scene, task, outcome, {"prepare": outcome.began - started, "run": ended - outcome.began})

    def check(self, call: RunCall) -> None:
        """Raise what a call raises before anything is run."""
        self._task(call)

    def _task(self, call):
        """The `Task` of a call, its start consistent with the constraints."""
        options, kept, method = self.options, self._prepared, self.method
        span, state = interval(call.t_span), call.state
        times = output_times(call.t_eval, *span)
        demand_steps_seen(method, *span)
        within = options.dense_output or options.events is not None or between(times, span)
        self._prepare_kernels(within)
        stops = kept.stops(*span, method.step is None)
        memory, q, qd = self._start_of(state, span[0])
        choose = sampling = None
        if kept.sampled:  # a sampled controller can't be run again: no turns
            sampling = Sampling(kept, state is not None)
        else:
            choose = method_choice.turns_of(self.scene, kept, method, options, span, within)
        history = call.store is None if options.history is None else options.history
        return Task(
            kept, method, self._form, span, q, qd, memory, times, options.dense_output,
            prepared_events(options.events), options.constraint_tol, options.max_steps, options.chart_interval or 0,
            reporter(call.progress), history, choose, stops, sampling,
        )  # fmt: skip

    def _start_of(self, state, t):
        """What joints and forces remember at a start, and q and qd, projected; the scene's own is looked at once."""
        scene, kept, options = self.scene, self._prepared, self.options
        engines, given = kept.packed.derived.engines, scene._initial() if state is None else None
        if given is not None and self._known is not None:
            known, of, start = self._known
            if known is given and of == (t, id(engines)):
                return start
        arrays = given or state_arrays(state, kept.n)
        memory = remembered(state, kept, t, arrays[0])
        q, qd = kept.start(scene, arrays, t, options.initial_tol, memory, self._drop)
        if self._needs_holonomic:
            demand_holonomic(kept.packed, q, t, self._form.name)
        start = memory, q, qd
        if given is not None:
            self._known = given, (t, id(kept.packed.derived.engines)), start
        return start

    def _prepare_kernels(self, within):
        """Have compiled what runs need, at the first one with outputs between steps, or without."""
        if within not in self._compiled:
            options = self.options
            default = options.rtol, options.atol, options.may_use_series
            prepare_first_run(self.scene, options.method, options.form, within, default)
            self._compiled.add(within)

    def _by(self, method):
        """The same by another method."""
        return Run(self.scene, replace(self.options, integrator=method, rtol=None, atol=None))

    def _stored(self, task, call, found, archive):
        """Run a task whose outputs go to a store, from its start or from what was found in a checkpoint."""
        scene, (numbers, arrays), kept = self.scene, found, task.prepared
        given = {"scene": scene, **by_name(self.options, call)}
        archive = archive or stored_runs.archive_of(given, kept, task.history, numbers, arrays)
        started = clock()
        if numbers is not None and numbers.get("ended"):
            with damaged("the checkpoint"):
                slots = kept.handles.count + kept.packed.system.memory.size
                outcome = stored_runs.ended_outcome(numbers, arrays, archive, kept.n, slots)
            return Solution(scene, task, outcome, {"prepare": 0.0, "run": numbers["seconds"]})
        try:
            outcome = run_task(task._replace(archive=archive), scene, self.options.initial_tol, self._driver)
            seconds = clock() - started
            other = method_choice.instead(task, outcome.status)
            if other is not None:
                run = self._by(other)
                given |= by_name(run.options, call)
                return run.solve(call, archive=stored_runs.begin_again(archive, given))
            outcome = stored_runs.ended(archive, outcome, seconds)
        finally:
            archive.close()
        timed = {"prepare": outcome.began - started, "run": seconds}
        return Solution(scene, task, outcome, timed, stored_runs.call_to_go_on(archive))

    def __reduce__(self):
        """A Run that is pickled is prepared anew where it is read."""
        return Run, (self.scene, self.options)

    def _facts(self):
        method, options = self.method, self.options
        why = method_choice.reason(self._prepared, options)
        tolerances = f"fixed steps of {method.step} s"
        if method.step is None:
            rtol, atol = method.step_tolerances()
            tolerances = (
                f"rtol={method.rtol:g}, atol={method.atol:g} of the run; each step is held to rtol={rtol:.2g}, "
                f"atol={atol:.2g} (safety factor {method.rtol / rtol:.3g})"
            )
        names = dict.fromkeys(kernels_of(self.scene, method, self._form, True in self._compiled))
        return {
            "method": f"{method!r}, {why}",
            "steps": tolerances,
            "form": f"{options.formulation}; |Phi| to {options.constraint_tol:g} m, starts to {options.initial_tol:g}",
            "options": repr(options),
            "kernels": f"{len(names)}: {', '.join(names)}",
        }

    def __str__(self) -> str:
        lines = [f"  {name:9}{fact}" for name, fact in self._facts().items()]
        return "\n".join([f"Run of {self.scene!r}", *lines])

    def _repr_html_(self) -> str:
        """Return the text as a table, for notebooks."""
        rows = "".join(f"<tr><th>{name}</th><td>{html.escape(fact)}</td></tr>" for name, fact in self._facts().items())
        return f"<table><caption>Run of {html.escape(repr(self.scene))}</caption>{rows}</table>"

    def __repr__(self) -> str:
        return f"<Run of {self.scene!r} by {self.method!r}, {self.options.formulation}>"


@fitting
@documented(*(name for name in RunOptions.__dataclass_fields__ if name != "method"))
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
    [ 0.372107  0.       -0.9282  ]
    """
    demand_scene(scene)
    return Run(
        scene,
        RunOptions(
            integrator, rtol, atol, formulation, constraint_tol, initial_tol, redundancy, dense_output, events,
            max_steps, max_step, history, chart_interval,
        ),
    )  # fmt: skip


def demand_scene(scene):
    """Raise InvalidArgument unless it is a scene; warn of parts that were never added to it."""
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    if scene._waiting:
        warn_of_waiting(scene, 5)


def run_task(task, scene, initial_tol, driver=None):
    """Run the method's driver, relative to a local origin if the scene is far from its own."""
    method, packed = task.method, task.prepared.packed
    driver = driver or DRIVERS.get(method.driver, method.driver)
    origin = origin_of(packed, task.q)
    if origin is not None:
        return run_near(driver, task, scene, origin, initial_tol)
    limited, said = within_rounding(method, packed, task.q)
    outcome = driver(task if limited is method else task._replace(method=limited))
    if method.step is not None:
        said = task.prepared.unresolved(*task.span, method.step)
    if said:
        outcome = outcome._replace(reason=" ".join(part for part in (outcome.reason, said) if part))
    return outcome
