"""The result of `profile`: phases and their table, skipped work, advice, and the figure."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

from ..benchmarking.benchmark import COLOURS
from ..drawing import GREY, Drawn, new_figure
from .phases import duration

if TYPE_CHECKING:
    from ..hints import Integrator, Phase, Scene, Solution


# The figure of `profile`: one bar a phase, one colour a group.


def figure(profile):
    """Draw a profile."""
    groups = list(profile.groups())
    colours = {group: COLOURS[i % len(COLOURS)] for i, group in enumerate(groups)}
    phases = profile.phases
    with new_figure(8.0, 1.4 + 0.28 * len(phases)) as drawn:
        ax = drawn.subplots()
        shares = [100.0 * phase.seconds / profile.total for phase in phases]
        ax.barh(range(len(phases)), shares, color=[colours[phase.group] for phase in phases], height=0.7)
        for i, (phase, share) in enumerate(zip(phases, shares, strict=True)):
            ax.annotate(
                duration(phase.seconds),
                (share, i),
                (4, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
                color=GREY,
            )
        ax.set_yticks(range(len(phases)), [f"{phase.group}: {phase.part}" for phase in phases], fontsize=8)
        ax.invert_yaxis()
        ax.margins(x=0.12)
        ax.spines[["top", "right"]].set_visible(False)
        ax.set_xlabel("share of the call (%)")
        ax.set_title(
            f"{duration(profile.seconds)} a call, {profile.solution.method}", loc="left", fontsize=11, weight="bold"
        )
    return drawn


SKIPPED = {
    "solves_skipped": "position solves, on the constraints to rounding already",
    "checks_skipped": "checks of a correction that was known to suffice",
    "factorizations_skipped": "factorisations, older factors serving or still contracting",
    "gyroscopic_skipped": "gyroscopic torques of spheres",
    "rotations_skipped": "rotations of bodies that never turn",
    "columns_skipped": "series of constant columns of Phi_q",
    "forces_skipped": "evaluations without forces",
}
HEAD = ("", "share", "time", "calls", "a call")


class Profile(Drawn):
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
        Taylor method: calls and seconds of each order from zero, without loops over constraints and forces.
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

    def __init__(  # called in one place
        self,
        scene: Scene,
        solution: Solution,
        method: Integrator,
        span: tuple[float, float],
        seconds: float,
        driver: float,
        phases: tuple[Phase, ...],
        once: dict[str, float],
        loaded: dict[str, Any],
        orders: tuple[tuple[int, float], ...],
    ) -> None:
        self.scene, self.solution, self.method, self.span = scene, solution, method, span
        self.seconds, self.driver, self.phases, self.once = seconds, driver, phases, once
        self.loaded, self.orders, self.advice = loaded, orders, ()

    @property
    def accounted(self) -> float:
        """The sum of the phases over the time of the driver; timer errors make the difference to 1."""
        return sum(p.seconds for p in self.phases if p.group not in _OUTSIDE) / self.driver

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
        return {
            name: sum(p.seconds for p in self.phases if p.group == name)
            for name in dict.fromkeys(phase.group for phase in self.phases)
        }

    def _rows(self):
        """Yield (True for a group, False for a part; cells) of the table."""
        for group, seconds in self.groups().items():
            parts = [phase for phase in self.phases if phase.group == group]
            only = parts[0] if len(parts) == 1 else None
            yield True, self._cells(f"{group}: {only.part}" if only else group, seconds, only.calls if only else 0)
            for phase in parts if only is None else ():
                yield False, self._cells(phase.part, phase.seconds, phase.calls)

    def _cells(self, name, seconds, calls):
        each = duration(seconds / calls) if calls else ""
        return name, f"{100.0 * seconds / self.total:.1f} %", duration(seconds), str(calls or ""), each

    def _facts(self):
        s, solution = self.solution.stats, self.solution
        yield f"{duration(self.seconds)} a call, {self.span[0]:g} to {self.span[1]:g} s"
        yield f"{solution.method}, formulation {solution.formulation}"
        counts = "steps", "rejected", "evaluations", "placements", "factorizations", "charts"
        yield ", ".join(f"{getattr(s, name)} {name}" for name in counts)
        if " and " in solution.method:
            yield f"it turns from one to the other; calls and phases are those of {type(self.method).__name__} alone"
        yield f"the phases add up to {100.0 * self.accounted:.0f} % of the compiled driver's {duration(self.driver)}"

    def _notes(self):
        """Titled lines below the table."""
        if self.orders:
            times = ", ".join(duration(seconds / calls) for calls, seconds in self.orders)
            yield "Each order, from 0, constraints and forces apart", [times]
        yield "Once for a scene", [", ".join(f"{name} {duration(x)}" for name, x in self.once.items())]
        if self.loaded["misses"]:
            yield "Once for this machine, just now", [f"kernels compiled: {self.loaded['misses']}"]
        elif self.loaded["hits"]:
            yield "Once for a process", [f"kernels loaded: {self.loaded['hits']}, {duration(self.loaded['seconds'])}"]
        skipped = [f"{count} {SKIPPED[name]}" for name, count in self.skipped.items() if count]
        yield "Skipped", skipped or ["nothing"]
        yield "What to change", list(self.advice) or ["nothing stands out"]

    def __str__(self) -> str:
        lines = [HEAD, *(cells for _, cells in self._rows())]
        names = [line[0] if own else f"  {line[0]}" for own, line in [(True, HEAD), *self._rows()]]
        widths = [max(map(len, column)) for column in (names, *list(zip(*lines, strict=True))[1:])]
        table = [
            "  ".join([name.ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(line[1:], widths[1:], strict=True))])
            for name, line in zip(names, lines, strict=True)
        ]
        notes = [text for title, items in self._notes() for text in (f"{title}:", *(f"- {item}" for item in items))]
        return "\n".join(["Profile: " + ";\n".join(self._facts()) + ".", "", *map(str.rstrip, table), "", *notes])

    def __repr__(self) -> str:
        largest = max(self.groups().items(), key=lambda pair: pair[1])
        return (
            f"<Profile: {duration(self.seconds)} a call by {self.solution.method}, {largest[0]} "
            f"{100.0 * largest[1] / self.total:.0f} %, {len(self.advice)} to change>"
        )

    def _repr_html_(self) -> str:
        """Return the text as a table, for notebooks."""
        rows = ["".join(f"<th>{cell}</th>" for cell in HEAD)]
        for own, cells in self._rows():
            tag = "th" if own else "td"
            rows.append("".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells))
        caption = "; ".join(html.escape(fact) for fact in self._facts())
        notes = "".join(
            f"<dt>{html.escape(title)}</dt>" + "".join(f"<dd>{html.escape(item)}</dd>" for item in items)
            for title, items in self._notes()
        )
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<table><caption>Profile: {caption}</caption>{body}</table><dl>{notes}</dl>"

    def figure(self) -> Any:
        """Draw it; return the matplotlib Figure."""
        return figure(self)


_OUTSIDE = ("Python", "outputs", "choice of the method")
