"""The figure of `profile`: one bar a phase, one colour a group."""

from ..benchmarking.figure import COLOURS
from ..drawing import GREY, new_figure
from .phases import duration


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
