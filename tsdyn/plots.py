"""Figures; matplotlib, an optional dependency, is imported on first use.

`constraint_error` draws one solution into the caller's axes; `tables_figure` draws the result of
`haug_tables.reproduce` without pyplot, so it affects neither the caller's backend nor open figures.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .benchmarking.haug_tables import DURATION, LEVELS
from .drawing import BLUE, GREEN, GREY, VERMILION, demand_matplotlib, new_figure, save

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .hints import Solution

ZERO = 1e-17  # what an error of exactly zero is drawn as: below any other
POINTS = 400  # stretches of time, the largest error of each of which is drawn
UNITS = ("m", "m/s", "m/s²")


def constraint_error(solution: Solution, ax: Any = None) -> Any:
    """Draw the constraint errors of a solution over time: position, velocity and acceleration, log scale.

    Of a long run the largest error in each of 400 stretches of time is drawn; zeros are drawn at 1e-17.

    Parameters
    ----------
    solution : Solution
    ax : matplotlib Axes, optional
        Where to draw; default new axes of pyplot's.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.

    Examples
    --------
    The errors of a pendulum, in the axes of a figure made for them:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> from matplotlib.figure import Figure
    >>> figure = Figure()
    >>> axes = ts.plots.constraint_error(ts.simulate(scene, (0, 1)), figure.subplots())
    >>> axes.get_yscale()
    'log'
    """
    demand_matplotlib()
    if ax is None:
        from matplotlib import pyplot

        _, ax = pyplot.subplots(layout="constrained")
    for level, unit, error, colour in zip(
        LEVELS, UNITS, solution.constraint_error, (BLUE, VERMILION, GREEN), strict=True
    ):
        _draw(ax, solution.t, error, colour, label=f"{level}\nup to {error.max():.1e} {unit}")
    ax.set_yscale("log")
    ax.set_xlabel("time (s)")
    ax.set_ylabel("constraint error, maximum norm")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small", columnspacing=1.2)
    return ax


def tables_figure(tables: Sequence[Any]) -> Any:
    """Draw constraint errors over time at the tightest tolerance: scenes side by side, a panel for each level.

    Parameters
    ----------
    tables : sequence of tables.Table

    Returns
    -------
    matplotlib Figure
        Its `savefig` writes it; `save` does so with its errors explained.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.

    Notes
    -----
    The tables take minutes.

    Examples
    --------
    >>> import tsdyn as ts
    >>> from tsdyn.benchmarking.haug_tables import reproduce
    >>> figure = ts.plots.tables_figure(reproduce())  # doctest: +SKIP
    >>> ts.plots.save(figure, "tables.png")  # doctest: +SKIP
    """
    with new_figure(9.0, 6.8) as figure:
        figure.suptitle(
            "Constraint error: Maggi/Kane drifts, the tangent-space ODE stays at rounding",
            x=0.01,
            ha="left",
            weight="bold",
            fontsize=13,
        )
        panels = figure.subplots(
            len(LEVELS), len(tables), sharex=True, sharey="row", squeeze=False, height_ratios=(1.9, 1.0, 1.0)
        )
        for table, column in zip(tables, panels.T, strict=True):
            _title(column[0], table)
            for ax, level in zip(column, LEVELS, strict=True):
                _panel(ax, table, level)
            column[-1].set(xlim=(0.0, DURATION), xlabel="time (s)")
        for row, level, unit in zip(panels, LEVELS, UNITS, strict=True):
            low, high = row[0].get_ylim()
            row[0].set(ylim=(low / 2.0, 20.0 * high), ylabel=f"{level} ({unit})")  # room for the words over the curves
    return figure


def _title(ax, table):
    tangent, maggi_kane = table.rows[-1], table.baseline[-1]
    ax.set_title(table.experiment.title.partition(" (")[0], loc="left", weight="bold", fontsize=11, pad=34)
    ax.annotate(
        f"Nystrom4, step {1e3 * table.experiment.step:g} ms, Tol {tangent.tolerance:.0e}\n"
        f"run time {tangent.seconds:.2f} s; Maggi/Kane {maggi_kane.seconds:.2f} s",
        (0.0, 1.0),
        (0.0, 7.0),
        xycoords="axes fraction",
        textcoords="offset points",
        color=GREY,
        fontsize=9,
    )


def _panel(ax, table, level):
    at = LEVELS.index(level)
    tangent, maggi_kane = table.rows[-1], table.baseline[-1]
    ours, theirs, published = tangent.measured[at], maggi_kane.measured[at], tangent.published[at]
    ax.set_yscale("log")
    ax.minorticks_off()
    ax.tick_params(labelsize=9)
    ax.spines[["top", "right"]].set_visible(False)
    ax.axhline(published, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    _note(ax, DURATION, published, "paper", GREY, offset=(4.0, 0.0), ha="left", va="center")
    _draw(ax, maggi_kane.t, maggi_kane.error[at], VERMILION)
    _draw(ax, tangent.t, tangent.error[at], BLUE)
    above = published if ours < published < 10.0 * ours else ours  # the words keep off the dashed line
    if level == "position":
        _note(ax, DURATION, theirs, f"Maggi/Kane drifts to {theirs:.0e}", VERMILION)
        _note(ax, DURATION, above, f"tangent-space ODE stays below {_ceiling(ours)}", BLUE)
    else:
        _note(ax, DURATION, above, f"both stay below {_ceiling(max(ours, theirs))}", "black")


def _note(ax, x, y, text, colour, offset=(0.0, 4.0), ha="right", va="bottom"):
    ax.annotate(text, (x, y), offset, textcoords="offset points", ha=ha, va=va, color=colour, fontsize=10)


def _ceiling(value):
    """The next number of one digit above a value."""
    value = max(value, ZERO)
    power = 10.0 ** math.floor(math.log10(value))
    return f"{(math.floor(value / power) + 1) * power:.0e}"


def _draw(ax, t, error, colour, label=None):
    """One curve, thinned to the largest error of each stretch of time, zeros lifted to where a log axis has them."""
    size = max(1, -(-t.size // POINTS))
    at = [start + int(error[start : start + size].argmax()) for start in range(0, t.size, size)]
    ax.plot(t[at], np.maximum(error[at], ZERO), color=colour, linewidth=1.3, label=label)


__all__ = ["constraint_error", "save", "tables_figure"]
