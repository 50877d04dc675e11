"""The figure of `tsdyn stress`: constraint errors and energy errors of the cases of the gallery, over time."""

import numpy as np

from ..drawing import BLUE, GREEN, GREY, VERMILION, new_figure

COLOURS = 10  # of matplotlib's cycle
ZERO = 1e-17  # what an error of zero is drawn as
LEVELS = (("position", BLUE, "o"), ("velocity", GREEN, "s"), ("acceleration", VERMILION, "^"))


def figure(found):
    """Return a matplotlib Figure: constraint errors of each case, and its energy error over time.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    """
    with new_figure(11.0, 0.34 * len(found) + 2.2) as drawn:
        errors, energies = drawn.subplots(1, 2)
        names = [figures["case"] for figures in found]
        rows = np.arange(len(found))[::-1]
        for level, colour, marker in LEVELS:
            values = [max(figures[level], ZERO) for figures in found]
            errors.plot(values, rows, marker, color=colour, label=level, markersize=5)
        errors.set(xscale="log", yticks=rows, xlabel="largest constraint error (m, m/s, m/s²)")
        errors.set_yticklabels(names)
        errors.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small")
        errors.grid(axis="y", color=GREY, alpha=0.2)
        for i, figures in enumerate(found):
            share, error = np.array(figures["growth"]).T
            style = "-" if i < COLOURS else "--"
            energies.plot(share, np.maximum(error, ZERO), style, linewidth=1.0, label=figures["case"])
        energies.set(xscale="log", yscale="log", xlabel="share of the run", ylabel="relative error of energy")
        energies.legend(fontsize=6, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        for axes in (errors, energies):
            axes.spines[["top", "right"]].set_visible(False)
    return drawn
