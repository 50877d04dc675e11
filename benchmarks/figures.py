"""The figures of the documentation, from recorded measurements; needs matplotlib: pip install '.[plot]'."""

import math

from tsdyn.drawing import BLUE, GREEN, GREY, VERMILION, save

COLOURS = (VERMILION, GREEN, "#CC79A7", "#E69F00", "#56B4E9", "#8C564B", "#009E9E", "#B8860B", "#6A3D9A")
MARKERS = "osD^vPX<>"


def _look(name, others):
    """tsdyn bold and blue, kernels by hand in grey dashes, the others in colours of their own."""
    if name == "tsdyn":
        return {"color": BLUE, "linewidth": 2.6, "marker": "o", "markersize": 5, "zorder": 5}
    if name.startswith("tsdyn"):
        styles = ("-", "--", "-.", ":", (0, (1, 1)), (0, (5, 1)), (0, (3, 1, 1, 1)))
        return {"color": BLUE, "linewidth": 1.1, "alpha": 0.8, "linestyle": styles[others % len(styles)]}
    if name.startswith("by hand"):
        return {"color": GREY, "linewidth": 1.6, "linestyle": "--" if "DOP853" in name else ":"}
    return {"color": COLOURS[others % len(COLOURS)], "marker": MARKERS[others % 9], "markersize": 3, "linewidth": 1.2}


def sheet(panels, width, height, sharey=False):
    """A figure, and so many axes with logarithmic scales."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(panels, 3)
    rows = math.ceil(panels / columns)
    drawn = Figure(figsize=(width * columns, height * rows + 0.9), dpi=150, layout="constrained")
    FigureCanvasAgg(drawn)
    axes = drawn.subplots(rows, columns, squeeze=False, sharey=sharey).ravel()
    for ax in axes[panels:]:
        ax.set_visible(False)
    for ax in axes[:panels]:
        ax.grid(True, which="major", color="#dddddd", linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.set(xscale="log", yscale="log")
    return drawn, axes[:panels]


def _legend(drawn, axes):
    handles = {name: line for ax in axes for line, name in zip(*ax.get_legend_handles_labels(), strict=True)}
    drawn.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False, fontsize=8)


def work_precision(results, path):
    """A panel a scene, a line a contender; better is down and to the right."""
    names = list(dict.fromkeys(name for one in results for name in one.contenders()))
    own = [name for name in names if name.startswith("tsdyn,")]
    rest = [name for name in names if not name.startswith(("tsdyn", "by hand"))]
    drawn, axes = sheet(len(results), 4.2, 3.6)
    for ax, one in zip(axes, results, strict=True):
        for name in one.contenders():
            points = sorted(
                (max(row.error, 1e-16), 1e3 * row.seconds)
                for row in one.rows
                if row.contender == name and not row.message and row.error < 1.0
            )
            if points:
                place = own.index(name) if name in own else rest.index(name) if name in rest else 0
                ax.plot(*zip(*points, strict=True), label=name, **_look(name, place))
        ax.set_title(one.scene, loc="left", fontsize=11)
        ax.set(xlabel="error (m, rotation matrix)", ylabel="run time (ms)")
        ax.invert_xaxis()
    _legend(drawn, axes)
    return save(drawn, path)


def scaling(sizes, path):
    """Microseconds an evaluation, and a whole run, against bodies."""
    drawn, axes = sheet(2, 4.6, 3.6)
    families = dict.fromkeys(size.family for size in sizes)
    for i, family in enumerate(families):
        mine = [size for size in sizes if size.family == family]
        x = [size.bodies for size in mine]
        look = {"color": (BLUE, *COLOURS)[i], "marker": MARKERS[i], "markersize": 4, "label": family}
        axes[0].plot(x, [size.evaluation for size in mine], **look)
        axes[1].plot(x, [1e3 * size.run for size in mine], **look)
    axes[0].set(xlabel="bodies", ylabel="evaluation (us)")
    axes[1].set(xlabel="bodies", ylabel="0.2 s of motion to 1e-6 (ms)")
    _legend(drawn, axes)
    return save(drawn, path)
