"""`profile`: run time of a call of `simulate` by phases, with advice."""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..benchmarking.benchmark import COLOURS
from ..calls import fitting, unknown_argument
from ..drawing import GREY, Tabulated, new_figure
from ..errors import InvalidArgument
from ..jit.cache import statistics
from ..jit.kernels import DEBUG
from ..model.packed import has_rates
from ..observables.state import remembered
from ..runs.arguments import interval, state_arrays
from ..simulation import prepared_run
from ..simulation.prepared_run import DRIVERS
from ..simulation.run_options import OPTIONS, from_names
from ..simulation.scene import Scene
from ..simulation.scene_cache import prepared
from ..simulation.segments import implicit
from .advice import advise, timed
from .phases import Phase, duration, phases
from .timers import Timing, calibrate
from .tolerances import FEWEST, LONG, MOST, RESOLUTION, SAMPLE

if TYPE_CHECKING:
    from ..hints import Integrator, Solution, Span

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
OUTSIDE = "Python", "outputs", "choice of the method"  # of the compiled driver


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
        if " and " in solution.method:
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
