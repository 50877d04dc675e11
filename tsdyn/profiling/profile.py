"""`profile`: run time of a call of `simulate` by phases, with advice."""

from __future__ import annotations

import copy
import time
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting, unknown_argument
from ..errors import InvalidArgument
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
from .advice import advise, timed
from .phases import Phase, phases
from .report import Profile
from .timers import Watch, calibrate
from .tolerances import FEWEST, LONG, MOST, RESOLUTION, SAMPLE

if TYPE_CHECKING:
    from ..hints import Span

OUTPUTS = {"t_eval": "times of t_eval", "dense_output": "dense output", "events": "events"}


@fitting
def profile(scene: Scene, t_span: Span = (0.0, 10.0), *, advice: bool = True, **options: Any) -> Profile:
    """Measure the run time of `simulate(scene, t_span, **options)` by phases; the scene is not changed.

    The call is repeated unchanged, and with its two ends as the only output; once more with a stopwatch around the
    compiled driver, and once with timers in place of the kernels that the driver calls. Parts of these kernels, such as
    constraint rows and each force, are timed by repetition at the final state, and counted. Other runs pay nothing.

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
    solution, seconds = timed(scene, t_span, options)
    loaded = {name: statistics[name] - before.get(name, 0) for name in ("hits", "misses", "seconds")}
    if solution.stats.seconds["run"] < LONG:  # the first call may have loaded or compiled kernels
        solution, seconds = timed(scene, t_span, options)
    start, end = interval(t_span)[0], solution.reached
    if not end > start:
        solution.raise_if_failed()
    wanted, call = from_names({"t_span": t_span, **options})
    method = _method(scene, solution, wanted)
    asked = {name: options[name] for name in OUTPUTS if not (options.get(name) is None or options[name] is False)}
    plain = {name: value for name, value in options.items() if name not in (*OUTPUTS, "integrator", "rtol", "atol")}
    plain |= {"t_eval": (start, end), "integrator": method}
    calls = {"asked": (t_span, options), "plain": ((start, end), plain)}
    if options.get("integrator") is None and (solution.stats.stiff or method.implicit):
        given = {name: value for name, value in options.items() if name not in ("rtol", "atol")}
        calls["chosen"] = t_span, {**given, "integrator": method}
    if len(asked) > 1:
        calls |= {name: ((start, end), {**plain, name: value}) for name, value in asked.items()}
    least, driver, found, orders = _rounds(scene, calls, seconds)
    chosen = least.get("chosen", least["asked"])
    found.append(Phase("Python", "arguments, slices, the solution", 1, max(least["plain"] - driver, 0.0)))
    found += _outputs(asked, least, chosen, solution)
    if "chosen" in least:
        found.append(Phase("choice of the method", "steps by the other one", 1, max(least["asked"] - chosen, 0.0)))
    once = _once(scene.copy(), method, wanted, call.state, start)
    result = Profile(scene, solution, method, (start, end), least["asked"], driver, tuple(found), orders, once, loaded)
    result.advice = advise(result, plain, options) if advice else ()
    return result


def _method(scene, solution, options):
    """Return the method of a solution, of most of its time if it has turned."""
    method = prepared_run.first_method(options, prepared(scene))
    if options.method is not None or solution.method.startswith(repr(method)):
        return method
    return implicit(method, prepared(scene), options.form)


def _rounds(scene, calls, seconds):
    """Least seconds of each call and of the plain one's driver; phases of that, and calls and seconds of each order."""
    (span, plain), (unit, half) = calls["plain"], calibrate()

    def watched(watch, **more):
        method = copy.copy(plain["integrator"])
        method.driver = partial(DRIVERS[method.driver], observe=watch.observe)
        solution, _ = timed(scene, span, {**plain, **more, "integrator": method})
        watch.release()
        return watch, solution.stats

    watched(Watch(half), max_steps=1)  # loads the timers
    least, driver, best, began, rounds = {}, np.inf, None, time.perf_counter(), 0
    most = SAMPLE * (2 + len(calls))
    while rounds < (FEWEST if seconds < LONG else 1) or (rounds < MOST and time.perf_counter() - began < most):
        outside, _ = watched(Watch())
        inside = watched(Watch(half))
        driver, rounds = min(driver, outside.seconds), rounds + 1
        best = inside if best is None or inside[0].seconds < best[0].seconds else best
        least |= {name: min(timed(scene, *call)[1], least.get(name, np.inf)) for name, call in calls.items()}
    times = best[0].times(unit)
    return least, driver, phases(outside.memory, times, best[1]), tuple(times["orders"])


def _outputs(asked, least, chosen, solution):
    """Return the phases of requested outputs, each by the additional time of a call."""
    total = max(chosen - least["plain"], 0.0)
    if not asked:
        return [Phase("outputs", "every step", solution.t.size, total)]
    more = {name: max(least.get(name, chosen) - least["plain"], RESOLUTION) for name in asked}
    share = total / sum(more.values())
    each = solution.t.size, solution.stats.steps, solution.stats.steps
    return [Phase("outputs", part, calls, share * more[name])
            for (name, part), calls in zip(OUTPUTS.items(), each, strict=True) if name in more]  # fmt: skip


def _once(scene, method, options, state, start):
    """Return seconds of work that only the first call of a scene does; of a scene that hasn't been packed."""
    times = [time.perf_counter()]
    scene.packed  # noqa: B018
    times.append(time.perf_counter())
    kept = prepared(scene)
    if method.driver == "series":
        kept.series  # noqa: B018
    else:
        options.form.serving(method).graph(kept.packed)
        kept.system(method.implicit)
    times.append(time.perf_counter())
    given = scene.start if state is None else state_arrays(state, kept.n)
    memory = remembered(state, kept, start, given[0])
    kept.start(scene, given, start, options.initial_tol, memory, options.redundancy == "drop")
    times.append(time.perf_counter())
    return dict(zip(("packing", "order of elimination", "check of the start"), np.diff(times).tolist(), strict=True))
