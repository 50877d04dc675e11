"""`simulate`: validate the arguments, pass a run request to the driver of the method, return a Solution."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from ..ahead.first_run import prepare_first_run
from ..calls import fitting
from ..configuration.holonomic import demand_holonomic
from ..elements.membership import warn_of_waiting
from ..errors import InvalidArgument
from ..jit.compiled import clock
from ..methods.integrator import frozen
from ..observables.state import remembered
from ..runs.arguments import demand_steps_seen, state_arrays
from ..runs.brief import Brief
from ..runs.sampling import Sampling
from ..runs.step_engine import StepEngine
from ..runs.task import Task
from ..taylor.series_engine import SeriesEngine
from ..validation import damaged
from . import method_choice, stored_runs
from .local_origin import origin_of, run_near
from .options import checked
from .plans import keep, planned
from .rounding_limit import within_rounding
from .scene import Scene
from .scene_cache import prepared
from .segments import run_segments
from .solution import Solution

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..hints import ArrayLike, Event, Formulation, Method, Place, Progress, Redundancy, Span, State

ENGINES = {"steps": StepEngine, "series": SeriesEngine}
DRIVERS = {name: partial(run_segments, engine=engine) for name, engine in ENGINES.items()}  # by Integrator.driver


def _go_on(given, unfinished):
    """Complete the run of a plan that is longer than its first slice."""
    plan, scene, stretch = unfinished.plan, given["scene"], unfinished.stretch
    choose = None
    if plan.task.choose is not None:
        options = plan.options._replace(span=stretch.span, times=stretch.times, within=stretch.within)
        choose = method_choice.turns_of(scene, plan.kept, plan.task.method, options)
    task = plan.task_of(stretch, unfinished.start, choose)
    return _solution(given, task, run_segments(task, plan.kind, unfinished=unfinished), unfinished.called)


@planned(_go_on)
@fitting
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
    state: State | None = None,
) -> Solution:
    """Integrate a scene over an interval of time; the scene is not changed.

    Parameters
    ----------
    scene : Scene
    t_span : (float, float), s
        Start and end, start < end.
    integrator : Integrator or str, optional
        A method, or its name ("nystrom4", "rk45", "dop853", "taylor", ...). By default Taylor; DOP853 if a part of the
        scene has no series, or series fail where a law is not analytic. Where the motion is found stiff Radau (SDIRK54
        with friction by reactions, and in the null-space form) goes on from there, as long as it needs less work;
        `solution.message` says so.
    rtol, atol : float, optional
        Tolerances of the default method, or of an adaptive method given by name; default 1e-8. An instance has its own
        tolerances; rtol or atol beside an instance is refused.
    formulation : {"tangent", "null-space", "maggi-kane"}
        "tangent": the tangent-space ODE without a basis, in O(N) for chains and trees; "null-space": Eq. 26, as in the
        paper; "maggi-kane": Eqs. 17-18, the baseline that drifts off the constraints. Implicit methods work in
        either of the first two, with dense matrices in the second.
    constraint_tol : float
        u_tol and B_tol of Eqs. 28-29: bound on |Phi| (m) and on |Phi_q U B - I|.
    initial_tol : float
        Largest residual of a start, relative to 1 + max |q| or 1 + max |qd|, that is accepted; the start is then
        projected onto the constraints.
    redundancy : {"drop", "refuse"}
        Treatment of redundant constraint rows: "drop" removes them from the equations if they hold wherever the others
        hold (the selection is renewed when the kept rows come close to dependence); "refuse" raises
        RedundantConstraints.
    t_eval : array_like, s, optional
        Increasing output times within t_span, from dense output on the manifold; they never change the steps. None
        gives every accepted step and both ends.
    dense_output : bool
        Keep the interpolant of every step, for `solution.at(t)` at any time.
    events : callable or list of callables, optional
        f(t, state) -> float with a `State`. All zeros inside every step are located on the manifold and recorded in
        `solution.t_events`: sign changes, and touches of zero within rounding, which count once. Events never change
        the steps. As for scipy.integrate.solve_ivp, an attribute `direction` > 0 or < 0 selects rising or falling
        zeros, and `terminal` = True, or a number of occurrences, ends the run. A function that raises, or returns no
        finite number, ends the run with success=False.
    max_steps : int, optional
        Largest number of steps; the run ends there.
    max_step : float, s, optional
        Longest step, for every method; a longer fixed step is reduced to it. Changes of functions of time within a
        thousandth of t_span are found without it; for shorter ones give half of their duration.
    history : bool, optional
        Keep `solution.steps` and `solution.charts`: 8 bytes per step, 16 to 40 more per rejected step and chart. By
        default they are kept, but for runs with a store, whose histories go to the store if they are asked for.
    store : str or PathLike, optional
        Stream the outputs to a file while the run goes on, in constant memory; by its suffix Zarr (.zarr) or HDF5 (.h5,
        .hdf5, .nc), with dimensions, coordinates and units as xarray reads them (needs `tsdyn[data]`). The solution
        reads from it.
    checkpoint : float, s, optional
        With a store: write a state at least so often, in real time, from which `resume(store)` goes on to the bit.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable receives the fraction done, 0 to 1. An exception that it raises ends
        the run with a RuntimeWarning that shows its traceback; the solution so far is returned.
    chart_interval : int, optional
        Number of steps after which a new chart is made regardless of the criteria; for experiments.
    state : State, optional
        Positions and velocities to start from instead of those of the bodies, such as `solution.state`.

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
    given = locals()
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    if scene._waiting:
        warn_of_waiting(scene, 4)
    if store is not None or checkpoint is not None:
        stored_runs.demand_storable(given)
    return run_from(given, plans=True)


def run_from(given, numbers=None, arrays=None, archive=None, plans=False):
    """Run what the arguments of `simulate` ask for; with the numbers and arrays of a checkpoint, from there.

    An archive is that of a run which begins again by another method. With `plans` the call is kept for later ones.
    """
    scene, options = given["scene"], checked(given)
    method, settings, default = options.method, options.settings, (given["rtol"], given["atol"], options.series)
    prepare_first_run(scene, method, settings.form, options.within, default)
    kept = prepared(scene)
    if method is None:
        method = method_choice.explicit(kept, *default)
    if settings.max_step is not None:
        method = frozen(method.bounded(settings.max_step))
    demand_steps_seen(method, *options.span)

    started = clock()
    choose = method_choice.turns_of(scene, kept, method, options) if given["integrator"] is None else None
    task = _request(scene, kept, method, options, given["state"], choose)
    if given["store"] is not None:
        return _run_stored(task, given, options, (numbers, arrays), archive)
    outcome = run_task(task, scene, settings.initial_tol)
    solution = _solution(given, task, outcome, started)
    if plans and type(outcome) is Brief:
        keep(given, task, ENGINES[method.driver], options, solution)
    return solution


def _solution(given, task, outcome, started):
    """The `Solution` of a run, or of one by another method if it has failed."""
    ended = clock()
    other = method_choice.instead(task, outcome.status)
    if other is not None:
        return run_from(_again(given, other))
    seconds = {"prepare": outcome.began - started, "run": ended - outcome.began}
    return Solution(given["scene"], task, outcome, seconds)


def _again(given, method):
    """Return the arguments of the run by another method."""
    return {**given, "integrator": method, "rtol": None, "atol": None}


def _run_stored(task, given, options, found, archive):
    """Run a task whose outputs go to a store, from its start or from what was found in a checkpoint."""
    scene, (numbers, arrays), kept = given["scene"], found, task.prepared
    archive = archive or stored_runs.archive_of(given, kept, options.history, numbers, arrays)
    started = clock()
    if numbers is not None and numbers.get("ended"):
        with damaged("the checkpoint"):
            slots = kept.handles.count + kept.packed.system.memory.size
            outcome = stored_runs.ended_outcome(numbers, arrays, archive, kept.n, slots)
        return Solution(scene, task, outcome, {"prepare": 0.0, "run": numbers["seconds"]})
    try:
        outcome = run_task(task._replace(archive=archive), scene, options.settings.initial_tol)
        seconds = clock() - started
        other = method_choice.instead(task, outcome.status)
        if other is not None:
            given = _again(given, other)
            return run_from(given, archive=stored_runs.begin_again(archive, given))
        outcome = stored_runs.ended(archive, outcome, seconds, task)
    finally:
        archive.close()
    timed = {"prepare": outcome.began - started, "run": seconds}
    return Solution(scene, task, outcome, timed, stored_runs.call_to_go_on(archive))


def _request(scene, kept, method, options, state, choose):
    """Return the run request, with a start that is consistent with the constraints."""
    span, settings, form = options.span, options.settings, options.settings.form
    stops = kept.stops(*span, method.step is None)
    start = scene._initial() if state is None else state_arrays(state, kept.n)
    memory = remembered(state, kept, span[0], start[0])
    q, qd = kept.start(scene, start, span[0], settings.initial_tol, memory, settings.drop)
    if not form.basis_free or method.implicit:
        demand_holonomic(kept.packed, q, span[0], form.name)
    if method.coupled and kept.rough:
        raise InvalidArgument(
            f"{type(method).__name__} doesn't solve for reactions that friction depends on "
            f"({', '.join(kept.rough)}): SDIRK54 does, as do all explicit methods."
        )
    sampling = Sampling(kept, state is not None) if kept.sampled else None
    return Task(
        kept, method, form, span, q, qd, memory, options.times, settings.dense_output,
        options.events, settings.constraint_tol, settings.max_steps, settings.chart_interval or 0, options.report,
        options.history, choose if sampling is None else None, stops, sampling,  # a sampled controller can't be rerun
    )  # fmt: skip


def run_task(task, scene, initial_tol):
    """Run the method's driver, relative to a local origin if the scene is far from its own."""
    driver, packed = DRIVERS.get(task.method.driver, task.method.driver), task.prepared.packed
    origin = origin_of(packed, task.q)
    if origin is not None:
        return run_near(driver, task, scene, origin, initial_tol)
    limited, said = within_rounding(task.method, packed, task.q)
    outcome = driver(task if limited is task.method else task._replace(method=limited))
    if task.method.step is not None:
        said = task.prepared.unresolved(*task.span, task.method.step)
    if said:
        outcome = outcome._replace(reason=" ".join(part for part in (outcome.reason, said) if part))
    return outcome
