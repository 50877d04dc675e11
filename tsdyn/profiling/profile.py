"""`profile`: run time of a call of `simulate` by phases, with advice."""

from __future__ import annotations

import copy
import time
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting, unknown_argument
from ..errors import InvalidArgument, Status
from ..jit.cache import statistics
from ..jit.kernels import DEBUG
from ..observables.state import remembered
from ..runs.arguments import interval, state_arrays
from ..simulation import prepared_run
from ..simulation.prepared_run import DRIVERS
from ..simulation.run_options import OPTIONS, from_names
from ..simulation.scene import Scene
from ..simulation.scene_cache import prepared
from ..simulation.segments import implicit
from ..simulation.simulate import simulate
from .advice import advise
from .instrumentation import Stopwatch, Timekeeper, prices
from .phases import Phase, of_series, of_steps, orders
from .report import Profile
from .timers import own_cost
from .tolerances import FEWEST, LONG, MOST, RESOLUTION, SAMPLE

if TYPE_CHECKING:
    from ..hints import Span

OUTPUTS = {"t_eval": "times of t_eval", "dense_output": "dense output", "events": "events"}


@fitting
def profile(scene: Scene, t_span: Span = (0.0, 10.0), *, advice: bool = True, **options: Any) -> Profile:
    """Measure the run time of `simulate(scene, t_span, **options)` by phases; the scene is not changed.

    The call is repeated unchanged, and with its two ends as the only output; once more with a stopwatch around the
    compiled driver, and once with timers in place of the addresses that the driver calls. Other runs pay nothing, and
    the sum of the phases is compared with the time of the unchanged call.

    Parameters
    ----------
    scene : Scene
    t_span : (float, float), s
    advice : bool
        Whether to run alternatives that may be faster, such as another method or looser tolerances.
    **options
        As for `simulate`, without progress.

    Returns
    -------
    Profile
        Its `phases`, `advice`, `skipped`; text in a terminal, a table in a notebook, and a figure by `plot()`.

    Raises
    ------
    TsdynError
        As `simulate`, before anything is measured; StepFailure if the run makes no step.

    Examples
    --------
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0, velocity=(1, 0, 0))
    >>> report = ts.profile(scene, (0, 0.1), advice=False)
    >>> report.solution.success, report.seconds > 0.0
    (True, True)
    """
    if DEBUG:
        raise InvalidArgument("profile times compiled kernels, and with TSDYN_DEBUG=1 there are none.")
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    for name in options:
        if name == "progress":
            raise InvalidArgument("profile makes many runs and has no progress; leave progress out.")
        if name not in OPTIONS:
            raise unknown_argument("profile", name, ["scene", "t_span", "advice", *OPTIONS])
    if not isinstance(advice, (bool, np.bool_)):
        raise InvalidArgument(f"advice must be True or False, got {advice!r}.")
    before = dict(statistics)
    solution, seconds = _timed(scene, t_span, options)
    loaded = {name: statistics[name] - before.get(name, 0) for name in ("hits", "misses", "seconds")}
    if solution.stats.seconds["run"] < LONG:  # the first call may have loaded or compiled kernels
        solution, seconds = _timed(scene, t_span, options)
    start, end = interval(t_span)[0], solution.reached
    if not end > start:
        solution.raise_if_failed()
    wanted, call = from_names({"t_span": t_span, **options})
    method = _method(scene, solution, wanted)
    plain = {name: value for name, value in options.items() if name not in (*OUTPUTS, "integrator", "rtol", "atol")}
    plain["t_eval"] = (start, end)

    asked = {name: options[name] for name in OUTPUTS if not (options.get(name) is None or options[name] is False)}
    sorts = {"asked": (t_span, options), "plain": ((start, end), {**plain, "integrator": method})}
    if options.get("integrator") is None and (solution.stats.stiff or method.implicit):
        sorts["chosen"] = t_span, {**_without(options), "integrator": method}
    if len(asked) > 1:
        sorts |= {name: ((start, end), {**plain, name: value, "integrator": method}) for name, value in asked.items()}
    least, watch, keeper, run = _rounds(scene, method, (start, end), plain, sorts, seconds)

    entries = keeper.entries(own_cost())
    series = method.driver == "series"
    found = (of_series if series else of_steps)(entries, keeper.kinds, prices(watch.memory), run.stats)
    chosen = least.get("chosen", least["asked"])
    outside = [Phase("Python", "arguments, slices, the solution", 1, max(least["plain"] - least["driver"], 0.0))]
    outside += _outputs(asked, least, chosen, solution)
    if "chosen" in least:
        outside.append(Phase("choice of the method", "steps by the other one", 1, max(least["asked"] - chosen, 0.0)))
    once = _once(scene.copy(), method, wanted, call.state, start)
    result = Profile(
        scene, solution, method, (start, end), least["asked"], least["driver"], (*found, *outside), once, loaded,
        orders(entries) if series else (),
    )  # fmt: skip
    if advice:
        try:
            result.advice = advise(result, simulate, plain, options)
        except KeyboardInterrupt:
            result.advice = ("Interrupted before all alternatives were tried: there may be more to say.",)
    return result


def _timed(scene, t_span, options):
    """Return a solution and the seconds of its call; Ctrl-C ends the profile."""
    began = time.perf_counter()
    solution = simulate(scene, t_span, **options)
    seconds = time.perf_counter() - began
    if solution.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return solution, seconds


def _without(options):
    return {name: value for name, value in options.items() if name not in ("rtol", "atol")}


def _method(scene, solution, options):
    """Return the method of a solution, of most of its time if it has turned."""
    method = prepared_run.first_method(options, prepared(scene))
    if options.method is not None or solution.method.startswith(repr(method)):
        return method
    return implicit(method, prepared(scene), options.form)


def _observed(method, observer):
    """Return the method with a driver that passes its memory to an observer."""
    method = copy.copy(method)
    method.driver = partial(DRIVERS[method.driver], observe=observer.observe)
    return method


def _rounds(scene, method, span, plain, sorts, seconds):
    """Return the least seconds of each kind of call, the last stopwatch, the fastest timekeeper and its solution."""
    least, keeper, run = {}, None, None
    _timed(scene, span, {**plain, "integrator": _observed(method, Timekeeper()), "max_steps": 1})  # loads the timers
    for _ in range(int(np.clip(SAMPLE / seconds, FEWEST if seconds < LONG else 1, MOST))):
        watch, timed = Stopwatch(), Timekeeper()
        _timed(scene, span, {**plain, "integrator": _observed(method, watch)})
        solution, _ = _timed(scene, span, {**plain, "integrator": _observed(method, timed)})
        watch.release()
        timed.release()
        if keeper is None or timed.seconds < keeper.seconds:
            keeper, run = timed, solution
        times = {"driver": watch.seconds}
        times |= {name: _timed(scene, *arguments)[1] for name, arguments in sorts.items()}
        least = {name: min(value, least.get(name, np.inf)) for name, value in times.items()}
    return least, watch, keeper, run


def _outputs(asked, least, chosen, solution):
    """Return the phases of requested outputs, each by the additional time of a call."""
    total = max(chosen - least["plain"], 0.0)
    if not asked:
        return [Phase("outputs", "every step", solution.t.size, total)]
    more = (
        {name: max(least[name] - least["plain"], RESOLUTION) for name in asked}
        if len(asked) > 1
        else dict.fromkeys(asked, 1)
    )
    calls = {"t_eval": solution.t.size, "dense_output": solution.stats.steps, "events": solution.stats.steps}
    share = total / sum(more.values())
    return [Phase("outputs", OUTPUTS[name], calls[name], value * share) for name, value in more.items()]


def _once(scene, method, options, state, start):
    """Return seconds of work that only the first call of a scene does; of a scene that hasn't been packed."""
    seconds, clock = {}, time.perf_counter
    began = clock()
    scene.packed  # noqa: B018
    seconds["packing"] = clock() - began
    began, kept = clock(), prepared(scene)
    if method.driver == "series":
        kept.series  # noqa: B018
    else:
        form = options.form.serving(method)
        form.graph(kept.packed)
        kept.system(method.implicit, form.basis_free)
    seconds["order of elimination"] = clock() - began
    given = scene.start if state is None else state_arrays(state, kept.n)
    began = clock()
    memory = remembered(state, kept, start, given[0])
    kept.start(scene, given, start, options.initial_tol, memory, options.redundancy == "drop")
    seconds["check of the start"] = clock() - began
    return seconds
