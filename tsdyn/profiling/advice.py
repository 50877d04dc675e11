"""Advice on a profiled call, each item with the measurement that supports it.

Alternatives are run in separate calls and reported only where they are faster. Where an alternative may cost accuracy,
the difference between the two final states is reported with it.
"""

import copy
import time
from typing import NamedTuple

import numpy as np

from ..benchmarking.benchmark import poses
from ..errors import Status, TsdynError
from ..integrators import SDIRK54, Taylor
from ..simulation.scene_cache import prepared
from ..simulation.simulate import simulate
from ..taylor.layout import lacking, without_series
from . import tolerances as limits
from .phases import duration

SHOWN = 3  # parts without series, by name


class Alternative(NamedTuple):
    """An alternative call for the same motion."""

    seconds: float
    gap: float  # of positions (m) and rotation matrices at the end
    method: str


def timed(scene, t_span, options):
    """A solution, and the seconds of its call; Ctrl-C ends the profile."""
    began = time.perf_counter()
    solution = simulate(scene, t_span, **options)
    seconds = time.perf_counter() - began
    if solution.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return solution, seconds


def advise(profile, plain, options):
    """Advice, a tuple of sentences; plain, options: those of the call with two outputs, and of the call as it is."""
    said = [*_outputs(profile), *_parts(profile), *_steps(profile)]
    if not profile.solution.success:
        return (f"The run ended early: {profile.solution.message}", *said)
    try:
        limit = profile.seconds * (1.0 - profile.share("outputs"))
        said += _series(profile, plain, limit)
        if profile.seconds > limits.LONGEST:
            took = duration(profile.seconds)
            said.append(f"Other methods and tolerances were not tried: a call takes {took}.")
        else:
            said += _alternatives(profile, plain, options, limit)
    except KeyboardInterrupt:
        said = ["Interrupted before all alternatives were tried: there may be more to say."]
    return tuple(said)


def _outputs(profile):
    for phase in profile.phases:
        if phase.group == "outputs" and phase.seconds >= limits.OUTPUTS * profile.total:
            share, each = _percent(phase.seconds / profile.total), duration(phase.each)
            if phase.part == "every step":
                yield (
                    f"Output of every step costs {share} of the call: t_eval with the times that are wanted costs "
                    "only those."
                )
            elif phase.part.startswith("times"):
                yield f"t_eval with {phase.calls} outputs costs {share} of the call, {each} each: ask for fewer."
            else:
                name = {"dense output": "dense_output=True", "events": "events"}[phase.part]
                yield f"{name} costs {share} of the call, {each} a step: leave it out where nothing asks for it."


def _parts(profile):
    outside, once = profile.share("Python"), sum(profile.once.values())
    if outside >= limits.PYTHON:
        yield (
            f"Python's part of each call is {duration(outside * profile.total)}, {_percent(outside)}: one call over "
            "a longer interval has it once."
        )
    if once >= limits.ONCE * profile.seconds:
        yield (
            f"A scene's first call takes {duration(once)} more than others: keep the scene, and change its bodies' "
            "numbers or pass state= rather than build it anew."
        )
    for part in dict.fromkeys(phase.part for phase in profile.phases if phase.part.startswith("force: ")):
        share = sum(phase.seconds for phase in profile.phases if phase.part == part) / profile.total
        if share >= limits.FORCE:
            yield f"{part[7:]} takes {_percent(share)} of the call: a cheaper law would pay."


def _steps(profile):
    stats, steps, charts = profile.solution.stats, profile.solution.steps, profile.share("charts")
    if charts >= limits.CHARTS:
        reasons = profile.solution.charts.reason[1:]
        counted = ", ".join(f"{reasons.count(name)} for {name}" for name in dict.fromkeys(reasons)) or "at the start"
        yield f"Charts take {_percent(charts)} of the call: {stats.charts} in {stats.steps} steps, {counted}."
    tried = stats.steps + stats.rejected
    if stats.rejected >= limits.REJECTED * tried:
        low, high = np.quantile(steps.t[~steps.accepted], (0.25, 0.75))
        yield (
            f"{stats.rejected} of {tried} steps were rejected, half of them between t = {low:.3g} and {high:.3g} s: "
            "look there for a corner in a force or a motion, and end a run at it."
        )


def _alternatives(profile, plain, options, limit):
    """The alternatives that are faster than the limit, s."""
    method, solution, astray = profile.method, profile.solution, []
    for said, changes in _changes(profile, plain, options):
        found = _attempt(profile.scene, profile.span, {**plain, **changes}, limit, solution)
        if found is None or (changes.get("integrator", method) is None and found.method == solution.method):
            continue
        if found.gap > _allowed(changes.get("integrator"), method):
            astray.append(found.gap)
            continue
        yield (
            f"{said.format(found.method)} {limit / found.seconds:.2g} times as quick, {duration(found.seconds)} (the "
            f"ends differ by {found.gap:.1e}, m or of a rotation matrix)."
        )
    if astray:
        yield (
            f"Faster alternatives end elsewhere, by up to {max(astray):.1e} (m, or of a rotation matrix): the final "
            "state depends on the method by more than the tolerances. Tighten them, or shorten the interval, until the "
            "final state converges."
        )


def _changes(profile, plain, options):
    """What to try: the beginning of the sentence, with a place for the method's name, and the changed options."""
    method, solution = profile.method, profile.solution
    if options.get("integrator") is not None:
        given = "the same tolerances" if method.step is None else "tolerances of 1e-8"
        same = {} if method.step is not None else {"rtol": method.rtol, "atol": method.atol}
        yield f"The default method, {{}} at {given}, is", {"integrator": None, **same}
    if method.step is None:
        if solution.stats.stiff and not method.implicit:
            yield "The motion is stiff: {} is", {"integrator": SDIRK54(method.rtol, method.atol)}
        looser = copy.copy(method)
        looser.rtol, looser.atol = limits.LOOSER * method.rtol, limits.LOOSER * method.atol
        if max(looser.rtol, looser.atol) <= limits.LOOSEST:
            values = f"rtol={looser.rtol:g} and atol={looser.atol:g}"
            yield f"With tolerances {limits.LOOSER:g} times looser, {values}, it is", {"integrator": looser}
        if method.max_step is not None:
            h, free = solution.steps.h[solution.steps.accepted], copy.copy(method)
            free.max_step = None
            if np.mean(h > 0.999 * method.max_step) > limits.CAPPED:
                yield "Without max_step, which sets most of the steps, it is", {"integrator": free}
    if plain.get("formulation", "tangent") != "tangent":
        yield "formulation='tangent' is", {"formulation": "tangent"}
    if plain.get("chart_interval") is not None:
        yield "Without chart_interval, which forces charts, it is", {"chart_interval": None}


def _allowed(integrator, method):
    """The largest admissible difference of the final states."""
    tolerances = [tol for each in (integrator, method) if each is not None for tol in (each.rtol, each.atol) if tol]
    return min(limits.ERRORS * max(tolerances), limits.LARGEST_GAP) if tolerances else limits.LARGEST_GAP


def _series(profile, plain, limit):
    """The reason why the scene has no Taylor series, and the time of a run without the forces at fault."""
    scene, method = profile.scene, profile.method
    packed = prepared(scene).packed
    found, names = lacking(packed), without_series(packed)
    if method.driver == "series" or not found:
        return
    shown = names[:SHOWN] + [f"{len(names) - SHOWN} more"] * (len(names) > SHOWN)
    said = f"Taylor series can't run this scene: {'; '.join(shown)}."
    forces = {id(load.force) for load in packed.loads} & {id(item) for item, _ in found}
    if len(forces) == len(found) and profile.seconds <= limits.LONGEST:
        bare = copy.copy(scene)
        bare._forces = [twin for twin, force in zip(bare.forces, scene.forces, strict=True) if id(force) not in forces]
        bare.touch()
        taylor = Taylor(rtol=method.rtol or 1e-8, atol=method.atol or 1e-8)
        series = _attempt(bare, profile.span, {**plain, "integrator": taylor}, limit)
        if series is not None:
            said += f" Without {'them' if len(forces) > 1 else 'it'} they take {duration(series.seconds)}."
    yield said


def _attempt(scene, span, options, limit, solution=None):
    """An `Alternative` that is faster by QUICKER, or None."""
    try:
        timed(scene, span, {**options, "max_steps": 1})  # loads the kernels
        some, seconds = timed(scene, span, {**options, "max_steps": limits.SHORT})
        if seconds * (some.span[1] - some.span[0]) > 5.0 * limit * (some.state.t - some.span[0]):
            return None
        seconds, spent = np.inf, 0.0
        while spent < limits.ALTERNATIVE:
            found, taken = timed(scene, span, options)
            seconds, spent = min(seconds, taken), spent + taken
            if not found.success or taken > 2.0 * limit:
                break
    except TsdynError:
        return None
    if not found.success or limits.QUICKER * seconds > limit:
        return None
    pairs = () if solution is None else zip(poses(found), poses(solution), strict=True)
    return Alternative(seconds, max((np.abs(a[-1] - b[-1]).max() for a, b in pairs), default=np.nan), found.method)


def _percent(share):
    return f"{100.0 * share:.0f} %"
