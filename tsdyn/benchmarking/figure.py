"""The work-precision figure of `benchmark`: one panel a scene, one line a method."""

from ..drawing import BLUE, GREEN, GREY, VERMILION, new_figure

COLOURS = (BLUE, VERMILION, GREEN, "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "osD^vPX"


def figure(benchmarks):
    """Draw benchmarks side by side."""
    with new_figure(1.0 + 4.0 * len(benchmarks), 4.4) as drawn:
        panels = drawn.subplots(1, len(benchmarks), sharey=True, squeeze=False)[0]
        names = list(dict.fromkeys(row.method for benchmark in benchmarks.values() for row in benchmark.rows))
        for ax, (title, benchmark) in zip(panels, benchmarks.items(), strict=True):
            _panel(ax, benchmark, names)
            ax.set_title(title, loc="left", fontsize=11)
        panels[0].set_ylabel("run time (s)")
        handles = {name: line for ax in panels for line, name in zip(*ax.get_legend_handles_labels(), strict=True)}
        if handles:
            drawn.legend(
                handles.values(),
                handles.keys(),
                loc="outside lower center",
                ncols=len(handles),
                frameon=False,
                fontsize=9,
            )
    return drawn


def _panel(ax, benchmark, names):
    """One line a method, and the errors that the reference can't tell apart in grey."""
    ax.set(xscale="log", yscale="log", xlabel="largest error in position (m) and rotation matrix")
    ax.grid(True, which="major", color="#dddddd", linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    for i, name in enumerate(names):
        points = sorted((row.error, row.seconds) for row in benchmark.rows if row.method == name and not row.message)
        if points:
            look = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)]}
            ax.plot(*zip(*points, strict=True), label=name, markersize=4, linewidth=1.3, **look)
    if benchmark.reference is not None and ax.lines:
        trusted = benchmark.reference.trusted
        ax.axvline(trusted, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)))
        ax.annotate(
            f"reference: {benchmark.reference_digits:.0f} digits", (trusted, 0.98), (3, 0), color=GREY, fontsize=8,
            xycoords=ax.get_xaxis_transform(), textcoords="offset points", rotation=90, va="top",
        )  # fmt: skip
    ax.invert_xaxis()  # better to the right
