"""`profile`: run time of a call of `simulate` by phases, with advice."""

from __future__ import annotations

import copy
import threading
import time
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calls import fitting, unknown_argument
from ..drawing import GREY, Tabulated, new_figure
from ..errors import InvalidArgument, Status, TsdynError
from ..formulations.registry import FORMULATIONS
from ..integrators import Taylor
from ..jit.cache import statistics
from ..jit.kernels import DEBUG
from ..model.handles import has_rates
from ..observables.state import remembered
from ..runs.events import Watch
from ..runs.run_memory import Memory
from ..runs.task import interval, state_arrays
from ..simulation import hybrid, prepared_run
from ..simulation.contact_run import _ContactRun
from ..simulation.phase_scenes import at_start
from ..simulation.prepared_run import DRIVERS, Run, simulate
from ..simulation.run_options import OPTIONS, from_names
from ..simulation.scene import Scene
from ..simulation.scene_cache import prepared
from ..simulation.segments import implicit
from ..simulation.transitions import Transitions
from ..taylor.layout import lacking, without_series
from . import tolerances as limits
from .benchmark import COLOURS, poses
from .phase_times import Phase, Timing, calibrate, duration, phases
from .tolerances import FEWEST, LONG, MOST, RESOLUTION, SAMPLE

if TYPE_CHECKING:
    from ..hints import Integrator, Solution, Span

# Time of a run whose rows come and go, by what its Python code does: steps, searches, impacts, packing.
#
# What is timed: the owner of each function, the function, and the group and part that its own time belongs to: without
# that of other functions of this table that it calls.
WATCHED = (
    (Memory, Memory.advance, "steps", "compiled driver"),
    (Watch, Watch._fly, "steps", "flights, with searches and impacts"),
    (Watch, Watch._search_step, "events", "searches of steps"),
    (Transitions, Transitions._hit, "events", "impacts"),
    (Transitions, Transitions._bounces, "events", "impacts"),
    (Transitions, Transitions._decide_modes, "events", "contacts and frictions that hold afterwards"),
    (hybrid, hybrid.ask, "events", "actions asked"),
    (hybrid, hybrid.carry_out, "events", "actions carried out"),
    (_ContactRun, _ContactRun._scene_of, "phases", "packed"),
    (_ContactRun, _ContactRun._phase, "phases", "prepared and driven"),
)
GROUPS = tuple(dict.fromkeys(group for _, _, group, _ in WATCHED))


class Stopwatch:
    """Own time, and calls, of the functions of the table in this thread while it watches."""

    def __init__(self):
        self.calls, self.seconds, self.inner, self.thread = Counter(), Counter(), [0.0], threading.get_ident()

    def _timed(self, function, part):
        @wraps(function)
        def timed(*arguments, **named):
            if threading.get_ident() != self.thread:
                return function(*arguments, **named)
            began = time.perf_counter()
            self.inner.append(0.0)
            try:
                return function(*arguments, **named)
            finally:
                spent = time.perf_counter() - began
                self.seconds[part] += spent - self.inner.pop()
                self.inner[-1] += spent
                self.calls[part] += 1

        return timed

    @contextmanager
    def watching(self):
        """Time the functions of the table."""
        try:
            for owner, function, *part in WATCHED:
                setattr(owner, function.__name__, self._timed(function, tuple(part)))
            yield self
        finally:
            for owner, function, *_ in WATCHED:
                setattr(owner, function.__name__, function)

    @property
    def driver(self):
        """Seconds in the compiled driver, with what flights do between its steps."""
        return sum(seconds for (group, _), seconds in self.seconds.items() if group == GROUPS[0])

    def phases(self, solution):
        """The `Phase`s of the run of a solution: parts that ran, and how often."""
        counted = {
            "compiled driver": solution.stats.steps,
            "impacts": len({t for t, *_ in solution.impulses}),
            "packed": len(solution._phases.packed),
        }
        parts = dict.fromkeys((group, part) for *_, group, part in WATCHED)
        return [
            Phase(*part, counted.get(part[1], self.calls[part]), self.seconds[part])
            for part in parts
            if self.calls[part]
        ]


# The result: phases and their table, skipped work, advice, and the figure.

SKIPPED = {
    "solves_skipped": "position solves, on the constraints to rounding already",
    "checks_skipped": "checks of a correction that was known to suffice",
    "factorizations_skipped": "factorisations, older factors serving or still contracting",
    "gyroscopic_skipped": "gyroscopic torques of spheres",
    "rotations_skipped": "rotations of bodies that never turn",
    "columns_skipped": "series of constant columns of Phi_q",
    "forces_skipped": "evaluations without forces",
}
COUNTS = "steps", "rejected", "evaluations", "placements", "factorizations", "charts"
OUTSIDE = "Python", "outputs", "choice of the method", *GROUPS[1:]  # of the compiled driver


@dataclass(eq=False, repr=False)
class Profile(Tabulated):
    """Where the time of a call of `simulate` goes; made by `tsdyn.profile`.

    Attributes
    ----------
    seconds : float
        Time of the call with all kernels loaded: the least of several.
    driver : float
        Time in the compiled driver, without outputs between steps.
    phases : tuple of Phase
        group, part, calls, seconds; and `each`, seconds per call.
    orders : tuple of (int, float)
        Taylor method: calls and seconds of each order from zero.
    total : float
        Seconds of all phases, of which `share` and the table give shares.
    once : dict
        Seconds of work of the first call alone, by name.
    skipped : dict
        Skipped work, by its name in `Solution.stats`.
    advice : tuple of str
        Advice, each item with its measurement; empty if nothing stands out.
    solution : Solution
    """

    scene: Scene
    solution: Solution
    method: Integrator
    span: tuple[float, float]
    seconds: float
    driver: float
    phases: tuple[Phase, ...]
    orders: tuple[tuple[int, float], ...]
    once: dict[str, float]
    loaded: dict[str, Any]
    advice: tuple[str, ...] = ()

    @property
    def accounted(self) -> float:
        """The sum of the phases over the time of the driver; timer errors make the difference to 1."""
        return sum(p.seconds for p in self.phases if p.group not in OUTSIDE) / self.driver

    @property
    def skipped(self) -> dict[str, int]:
        """Skipped work, by its name in `Solution.stats`."""
        return {name: getattr(self.solution.stats, name) for name in SKIPPED}

    @property
    def total(self) -> float:
        """Seconds of all phases; errors of timers aside those of a call. Shares are of this, and add up to one."""
        return sum(phase.seconds for phase in self.phases) or self.seconds

    def share(self, group: str, part: str | None = None) -> float:
        """The share of a group in the call, or of a part of a group."""
        return sum(p.seconds for p in self.phases if p.group == group and part in (None, p.part)) / self.total

    def groups(self) -> dict[str, float]:
        """Seconds of each group."""
        names = dict.fromkeys(phase.group for phase in self.phases)
        return {name: sum(p.seconds for p in self.phases if p.group == name) for name in names}

    def _rows(self):
        """The cells of groups and, indented, of their parts."""
        for group, seconds in self.groups().items():
            parts = [phase for phase in self.phases if phase.group == group]
            lone = len(parts) == 1
            yield self._cells(f"{group}: {parts[0].part}" if lone else group, seconds, parts[0].calls if lone else 0)
            for phase in () if lone else parts:
                yield self._cells(f"  {phase.part}", phase.seconds, phase.calls)

    def _cells(self, name, seconds, calls):
        each = duration(seconds / calls) if calls else ""
        return name, f"{100.0 * seconds / self.total:.1f} %", duration(seconds), str(calls or ""), each

    def _shown(self):
        s, solution, loaded = self.solution.stats, self.solution, self.loaded
        above = [
            f"Profile: {duration(self.seconds)} a call, {self.span[0]:g} to {self.span[1]:g} s;",
            f"{solution.method}, formulation {solution.formulation};",
            ", ".join(f"{getattr(s, name)} {name}" for name in COUNTS) + ";",
            f"the phases add up to {100.0 * self.accounted:.0f} % of the compiled driver's {duration(self.driver)}.",
            "",
        ]
        if solution._phases is not None:
            counted = f"{len(solution.phases)} phases, {len(solution.impulses)} impulses;"
            above[3] = f"{counted} the compiled driver takes {duration(self.driver)}."
        elif " and " in solution.method:
            kind = type(self.method).__name__
            above.insert(3, f"it turns from one to the other; calls and phases are those of {kind} alone;")
        notes = {"Once for a scene": [", ".join(f"{name} {duration(x)}" for name, x in self.once.items())]}
        if self.orders:
            notes = {"Each order, from 0": [", ".join(duration(x / calls) for calls, x in self.orders)], **notes}
        if loaded["misses"]:
            notes["Once for this machine, just now"] = [f"kernels compiled: {loaded['misses']}"]
        elif loaded["hits"]:
            notes["Once for a process"] = [f"kernels loaded: {loaded['hits']}, {duration(loaded['seconds'])}"]
        skipped = [f"{count} {SKIPPED[name]}" for name, count in self.skipped.items() if count]
        notes |= {"Skipped": skipped or ["nothing"], "What to change": self.advice or ["nothing stands out"]}
        below = [line for title, items in notes.items() for line in (f"{title}:", *(f"- {item}" for item in items))]
        return above, [("", "share", "time", "calls", "a call"), *self._rows()], ["", *below]

    def __repr__(self) -> str:
        largest = max(self.groups().items(), key=lambda pair: pair[1])
        return (
            f"<Profile: {duration(self.seconds)} a call by {self.solution.method}, {largest[0]} "
            f"{100.0 * largest[1] / self.total:.0f} %, {len(self.advice)} to change>"
        )

    def figure(self) -> Any:
        """Draw it, a bar a phase and a colour a group; return the matplotlib Figure."""
        groups, phases = list(self.groups()), self.phases
        with new_figure(8.0, 1.4 + 0.28 * len(phases)) as drawn:
            ax = drawn.subplots()
            colours = [COLOURS[groups.index(phase.group) % len(COLOURS)] for phase in phases]
            bars = ax.barh(
                range(len(phases)), [100.0 * p.seconds / self.total for p in phases], color=colours, height=0.7
            )
            ax.bar_label(bars, [duration(phase.seconds) for phase in phases], padding=4, fontsize=8, color=GREY)
            ax.set_yticks(range(len(phases)), [f"{phase.group}: {phase.part}" for phase in phases], fontsize=8)
            ax.invert_yaxis()
            ax.margins(x=0.12)
            ax.spines[["top", "right"]].set_visible(False)
            ax.set_xlabel("share of the call (%)")
            title = f"{duration(self.seconds)} a call, {self.solution.method}"
            ax.set_title(title, loc="left", fontsize=11, weight="bold")
        return drawn


# The measurement.

OUTPUTS = {"t_eval": "times of t_eval", "dense_output": "dense output", "events": "events"}


@fitting
def profile(scene: Scene, t_span: Span = (0.0, 10.0), *, advice: bool = True, **options: Any) -> Profile:
    """Measure the run time of `simulate(scene, t_span, **options)` by phases; the scene is not changed.

    The call is repeated unchanged, and with its two ends as the only output; once more with a stopwatch around the
    compiled driver, and once with timers in place of the kernels that the driver calls. Parts of these kernels, such as
    constraint rows and each force, are timed by repetition at the final state, and counted. Other runs pay nothing.

    Of a run with contacts, exact friction or events with an action, phases are those of its Python code: steps of the
    compiled driver as a whole, flights between impacts, searches for events, impacts, what holds after them, packing.

    Parameters
    ----------
    scene : Scene
    t_span : (float, float), s
    advice : bool
        Whether to run alternatives that may be faster, such as another method or looser tolerances.
    **options
        As for `simulate`, without progress, store and checkpoint.

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
        if name in ("progress", "store", "checkpoint"):
            raise InvalidArgument(f"profile makes many runs, none of which has {name}; leave {name} out.")
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
    run = Run(scene, wanted)
    if run._has_phases(call):
        return _of_phases(run, solution, (t_span, options), seconds, loaded, advice)
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


def _of_phases(run, solution, call, seconds, loaded, advice):
    """The `Profile` of a run with phases, call: its interval and options, of which a call took these seconds."""
    scene, least, best, began, rounds = run.scene, np.inf, (np.inf, None), time.perf_counter(), 0
    while rounds < (FEWEST if seconds < LONG else 1) or (rounds < MOST and time.perf_counter() - began < 2 * SAMPLE):
        least, rounds = min(least, timed(scene, *call)[1]), rounds + 1
        with Stopwatch().watching() as watch:
            _, spent = timed(scene, *call)
        best = min(best, (spent, watch), key=lambda pair: pair[0])
    spent, watch = best
    found = watch.phases(solution)
    found.append(
        Phase("Python", "arguments, outputs, the solution", 1, max(spent - sum(p.seconds for p in found), 0.0))
    )
    bare, began = copy.copy(scene), time.perf_counter()
    bare.touch()
    Run(bare, run.options)
    once = {"packing of the first phase": time.perf_counter() - began}
    span, options = (solution.span[0], solution.reached), call[1]
    result = Profile(scene, solution, run.method, span, least, watch.driver, tuple(found), (), once, loaded)
    plain = {name: value for name, value in options.items() if name not in ("t_eval", "dense_output")}
    result.advice = advise(result, {**plain, "t_eval": span}, options) if advice else ()
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

    watched(Timing(half), max_steps=1)  # loads the timers
    least, driver, best, began, rounds = {}, np.inf, None, time.perf_counter(), 0
    most = SAMPLE * (2 + len(calls))
    while rounds < (FEWEST if seconds < LONG else 1) or (rounds < MOST and time.perf_counter() - began < most):
        outside, _ = watched(Timing())
        inside = watched(Timing(half))
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
        form = options.form.serving(method, has_rates(kept.packed))
        form.graph(kept.packed)
        kept.system(method.implicit, form.basis_free)
    times.append(time.perf_counter())
    given = scene.start if state is None else state_arrays(state, kept.n)
    memory = remembered(state, kept, start, given[0])
    kept.start(scene, given, start, options.initial_tol, memory, options.redundancy == "drop")
    times.append(time.perf_counter())
    return dict(zip(("packing", "order of elimination", "check of the start"), np.diff(times).tolist(), strict=True))


# Advice on a profiled call, each item with the measurement that supports it.
#
# Alternatives are run in separate calls and reported only where they are faster. Where an alternative may cost
# accuracy, the difference between the two final states is reported with it.

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
    said = [*_about_outputs(profile), *_parts(profile), *_steps(profile), *_impacts(profile)]
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


def _about_outputs(profile):
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


def _impacts(profile):
    times, (start, end) = np.array([t for t, *_ in profile.solution.impulses]), profile.span
    if times.size and profile.share("events") >= limits.EVENTS:
        low, high = np.quantile(times, (0.25, 0.75))
        if high - low < limits.CROWDED * (end - start):
            yield (
                f"Half of the {times.size} impulses lie between t = {low:.9g} and {high:.9g} s, and events take "
                f"{_percent(profile.share('events'))} of the call: a lower restitution ends such a series sooner."
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
            form = FORMULATIONS[plain.get("formulation", "tangent")]
            yield (
                "The motion is stiff: {} is",
                {"integrator": implicit(method, prepared(at_start(profile.scene)), form)},
            )
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
    packed = prepared(at_start(scene)).packed
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
