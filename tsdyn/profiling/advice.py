"""Advice on a profiled call, each item with the measurement that supports it.

Alternatives are run in separate calls and reported only where they are faster. Where an alternative may cost accuracy,
the difference between the two final states is reported with it.
"""

import copy
import time
from functools import partial
from typing import NamedTuple

import numpy as np

from ..benchmarking.benchmark import poses
from ..errors import Status, TsdynError
from ..integrators import SDIRK54, Taylor
from ..simulation.scene_cache import prepared
from ..taylor.layout import lacking, without_series
from .phases import duration
from .tolerances import (
    ALTERNATIVE,
    CAPPED,
    CHARTS,
    ERRORS,
    FORCE,
    LARGEST_GAP,
    LONGEST,
    LOOSER,
    LOOSEST,
    ONCE,
    OUTPUTS,
    PYTHON,
    QUICKER,
    REJECTED,
    SHORT,
)

SHOWN = 3


class Alternative(NamedTuple):
    """An alternative call for the same motion."""

    seconds: float
    gap: float  # of positions (m) and rotation matrices at the end
    method: str


def advise(profile, simulate, plain, options):
    """Return advice, a tuple of sentences.

    Parameters
    ----------
    profile : Profile
    simulate : callable
    plain, options : dict
        Options of the call with two outputs, and of the call as it is.
    """
    said = [*_outputs(profile), *_around(profile), *_forces(profile), *_steps(profile)]
    if not profile.solution.success:
        return (f"The run ended early: {profile.solution.message}", *said)
    limit = profile.seconds * (1.0 - profile.share("outputs"))
    said += _series(profile, plain, limit, simulate)
    if profile.seconds > LONGEST:
        return (*said, f"Other methods and tolerances were not tried: a call takes {duration(profile.seconds)}.")
    run = partial(simulate, profile.scene, profile.span)
    return (*said, *_alternatives(profile, run, plain, options, limit))


def _outputs(profile):
    for phase in profile.phases:
        if phase.group == "outputs" and phase.seconds >= OUTPUTS * profile.total:
            share, each = _percent(phase.seconds / profile.total), duration(phase.each)
            if phase.part.startswith("times"):
                yield f"t_eval with {phase.calls} outputs costs {share} of the call, {each} each: ask for fewer."
            elif phase.part == "every step":
                yield (
                    f"Output of every step costs {share} of the call: t_eval with the times that are wanted costs "
                    "only those."
                )
            else:
                name = {"dense output": "dense_output=True", "events": "events"}[phase.part]
                yield f"{name} costs {share} of the call, {each} a step: leave it out where nothing asks for it."


def _around(profile):
    outside = sum(p.seconds for p in profile.phases if p.group == "Python")
    if outside >= PYTHON * profile.total:
        yield (
            f"Python's part of each call is {duration(outside)}, {_percent(outside / profile.total)}: one call over "
            "a longer interval has it once."
        )
    once = sum(profile.once.values())
    if once >= ONCE * profile.seconds:
        yield (
            f"A scene's first call takes {duration(once)} more than others: keep the scene, and change its bodies' "
            "numbers or pass state= rather than build it anew."
        )


def _forces(profile):
    parts = {}
    for phase in profile.phases:
        if phase.part.startswith("force: "):
            parts[phase.part[7:]] = parts.get(phase.part[7:], 0.0) + phase.seconds
    for name, seconds in parts.items():
        if seconds >= FORCE * profile.total:
            yield f"{name} takes {_percent(seconds / profile.total)} of the call: a cheaper law would pay."


def _steps(profile):
    stats, steps = profile.solution.stats, profile.solution.steps
    charts = profile.share("charts")
    if charts >= CHARTS:
        reasons = profile.solution.charts.reason[1:]
        counted = ", ".join(f"{reasons.count(name)} for {name}" for name in dict.fromkeys(reasons)) or "at the start"
        yield f"Charts take {_percent(charts)} of the call: {stats.charts} in {stats.steps} steps, {counted}."
    tried = stats.steps + stats.rejected
    if stats.rejected >= REJECTED * tried:
        low, high = np.quantile(steps.t[~steps.accepted], (0.25, 0.75))
        yield (
            f"{stats.rejected} of {tried} steps were rejected, half of them between t = {low:.3g} and {high:.3g} s: "
            "look there for a corner in a force or a motion, and end a run at it."
        )


def _alternatives(profile, run, plain, options, limit):
    """Return the alternatives that are faster than the limit, s."""
    method, solution = profile.method, profile.solution
    astray = []

    def attempt(**changes):
        found = _attempt(run, {**plain, "integrator": method, **changes}, limit, solution)
        if found and found.gap > _allowed(changes.get("integrator"), method):
            astray.append(found.gap)
            return None
        return found

    adaptive = method.step is None
    tolerances = {"rtol": method.rtol, "atol": method.atol} if adaptive else {}
    given = "the same tolerances" if adaptive else "tolerances of 1e-8"
    if options.get("integrator") is not None:
        found = attempt(integrator=None, **tolerances)
        if found and found.method != solution.method:
            yield f"The default method, {found.method} at {given}, is {_quicker(found, limit)}."
    if solution.stats.stiff and not method.implicit and adaptive:
        found = attempt(integrator=SDIRK54(method.rtol, method.atol))
        if found:
            yield f"The motion is stiff: {found.method} is {_quicker(found, limit)}."
    if adaptive:
        looser = copy.copy(method)
        looser.rtol, looser.atol = LOOSER * method.rtol, LOOSER * method.atol
        found = attempt(integrator=looser) if max(looser.rtol, looser.atol) <= LOOSEST else None
        if found:
            values = f"rtol={looser.rtol:g} and atol={looser.atol:g}"
            yield f"With tolerances {LOOSER:g} times looser, {values}, it is {_quicker(found, limit)}."
    if method.max_step is not None and adaptive:
        h = solution.steps.h[solution.steps.accepted]
        free = copy.copy(method)
        free.max_step = None
        found = attempt(integrator=free) if np.mean(h > 0.999 * method.max_step) > CAPPED else None
        if found:
            yield f"Without max_step, which sets most of the steps, it is {_quicker(found, limit)}."
    if plain.get("formulation", "tangent") != "tangent":
        found = attempt(formulation="tangent")
        if found:
            yield f"formulation='tangent' is {_quicker(found, limit)}."
    if plain.get("chart_interval") is not None:
        found = attempt(chart_interval=None)
        if found:
            yield f"Without chart_interval, which forces charts, it is {_quicker(found, limit)}."
    if astray:
        yield (
            f"Faster alternatives end elsewhere, by up to {max(astray):.1e} (m, or of a rotation matrix): the final "
            "state depends on the method by more than the tolerances. Tighten them, or shorten the interval, until the "
            "final state converges."
        )


def _allowed(integrator, method):
    """Return the largest admissible difference of the final states."""
    tolerances = [tol for each in (integrator, method) if each is not None for tol in (each.rtol, each.atol) if tol]
    return min(ERRORS * max(tolerances), LARGEST_GAP) if tolerances else LARGEST_GAP


def _series(profile, plain, limit, simulate):
    """Return the reason why the scene has no Taylor series, and the time of a run without the forces at fault."""
    scene, method = profile.scene, profile.method
    packed = prepared(scene).packed
    found = lacking(packed)
    if method.driver == "series" or not found:
        return
    said = f"Taylor series can't run this scene: {_names(without_series(packed))}."
    forces = {id(load.force) for load in packed.loads} & {id(item) for item, _ in found}
    if len(forces) < len(found) or profile.seconds > LONGEST:
        yield said
        return
    bare = copy.copy(scene)
    bare._forces = [twin for twin, force in zip(bare.forces, scene.forces, strict=True) if id(force) not in forces]
    bare.touch()
    tolerances = {"rtol": method.rtol or 1e-8, "atol": method.atol or 1e-8}
    series = _attempt(partial(simulate, bare, profile.span), {**plain, "integrator": Taylor(**tolerances)}, limit, None)
    them = "them" if len(forces) > 1 else "it"
    yield said if series is None else f"{said} Without {them} they take {duration(series.seconds)}."


def _attempt(run, options, limit, solution):
    """Return an `Alternative` that is faster by QUICKER, or None."""
    try:
        run(**{**options, "max_steps": 1})  # loads the kernels
        began = time.perf_counter()
        some = run(**{**options, "max_steps": SHORT})
        seconds, (start, end) = time.perf_counter() - began, some.span
        if seconds * (end - start) > 5.0 * limit * (some.state.t - start):
            return None
        seconds, spent = np.inf, 0.0
        while spent < ALTERNATIVE:
            began = time.perf_counter()
            found = run(**options)
            taken = time.perf_counter() - began
            seconds, spent = min(seconds, taken), spent + taken
            if not found.success or taken > 2.0 * limit:
                break
    except TsdynError:
        return None
    if Status.INTERRUPTED in (some.status, found.status):
        raise KeyboardInterrupt
    if not found.success or QUICKER * seconds > limit:
        return None
    if solution is None:
        return Alternative(seconds, np.nan, found.method)
    gap = max(
        float(np.abs(one[-1] - other[-1]).max()) for one, other in zip(poses(found), poses(solution), strict=True)
    )
    return Alternative(seconds, gap, found.method)


def _quicker(found, limit):
    return (
        f"{limit / found.seconds:.2g} times as quick, {duration(found.seconds)} (the ends differ by {found.gap:.1e}, m "
        "or of a rotation matrix)"
    )


def _percent(share):
    return f"{100.0 * share:.0f} %"


def _names(found):
    shown = found[:SHOWN] + ([f"{len(found) - SHOWN} more"] if len(found) > SHOWN else [])
    return "; ".join(shown)
