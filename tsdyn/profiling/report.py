"""The result of `profile`: phases and their table, skipped work, advice, and the figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..benchmarking.benchmark import COLOURS
from ..drawing import GREY, Tabulated, new_figure
from .phases import duration

if TYPE_CHECKING:
    from ..hints import Integrator, Phase, Scene, Solution

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
