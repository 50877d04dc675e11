"""Figures; matplotlib, an optional dependency, is imported on first use.

Figures of a solution draw into the caller's axes, or into new ones; `tables_figure` draws the result of
`haug_tables.reproduce` without pyplot, so it affects neither the caller's backend nor open figures.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .calls import fitting
from .drawing import BLUE, GREY, VERMILION, ZERO, largest, new_figure, save
from .errors import InvalidArgument
from .graphics.curves import (
    charts,
    constraint_error,
    contacts,
    energy,
    mode_shapes,
    phase_portrait,
    poincare_section,
    reaction,
    steps,
)
from .graphics.ensembles import final_map, quantile_bands
from .measuring.haug_tables import DURATION, LEVELS

if TYPE_CHECKING:
    from collections.abc import Sequence


UNITS = ("m", "m/s", "m/s²")


@fitting
def tables_figure(tables: Sequence[Any]) -> Any:
    """Draw constraint errors over time at the tightest tolerance: scenes side by side, a panel for each level.

    Parameters
    ----------
    tables : sequence of PaperTable

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
    >>> from tsdyn.measuring.haug_tables import reproduce
    >>> figure = ts.plots.tables_figure(reproduce())  # doctest: +SKIP
    >>> ts.plots.save(figure, "tables.png")  # doctest: +SKIP
    """
    if not isinstance(tables, (list, tuple)) or not all(hasattr(table, "experiment") for table in tables):
        raise InvalidArgument(f"tables_figure: tables must be what haug_tables.reproduce() returns, got {tables!r}.")
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


def _draw(ax, t, error, colour):
    """One curve."""
    ax.plot(*largest(t, error), color=colour, linewidth=1.3)


__all__ = [
    "charts",
    "constraint_error",
    "contacts",
    "energy",
    "final_map",
    "mode_shapes",
    "phase_portrait",
    "poincare_section",
    "quantile_bands",
    "reaction",
    "save",
    "steps",
    "tables_figure",
]
