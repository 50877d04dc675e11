"""`simulate`: prepare a run, or take the last one of the same options, and run it; whether a run could begin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..calls import fitting
from ..methods.integrator import is_plain
from ..runs.arguments import interval, output_times
from .prepared_run import Run, demand_scene
from .run_options import RunCall, RunOptions, documented, from_names

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..hints import ArrayLike, Event, Formulation, Method, Place, Progress, Redundancy, Scene, Solution, Span, State


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
        max_step, history, chart_interval,
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
    run = Run(scene, options)
    if options.events is None and is_plain(run.method):
        kept = run._prepared
        kept.runs = (run, *kept.runs[: KEPT - 1])  # and not written to: other threads may be reading
    return run


# Whether a run could begin: all that `simulate` refuses before it runs anything.


def demand_startable(scene, given):
    """Raise what `simulate(scene, **given)` raises before a run."""
    options, call = from_names({"t_span": (0.0, 1.0), **given})
    Run(scene, options)._check(call)
