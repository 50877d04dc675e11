"""Quantities over time: constraint errors, energies, reactions, lengths of steps; the overview of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import BLUE, GREEN, GREY, VERMILION, save
from ..errors import InvalidArgument
from .axes import axes_of, bare, figure_of, largest

if TYPE_CHECKING:
    from ..hints import ItemLike, Solution


# Quantities over time: energies, reactions, lengths of steps, condition of charts.

COLOURS = (BLUE, VERMILION, GREEN)
MARKERS = "os^Dv"


@figure_of("kinetic_energy", "potential_energy")
def energy(solution: Solution, ax: Any = None) -> Any:
    """Draw kinetic, potential and total energy over time, J. Arguments and errors as for `constraint_error`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0)
    >>> from matplotlib.figure import Figure
    >>> axes = ts.plots.energy(ts.simulate(scene, (0, 1)), Figure().subplots())
    >>> axes.get_ylabel()
    'energy (J)'
    """
    ax = axes_of(ax)
    for name, values, colour in (
        ("kinetic", solution.kinetic_energy, BLUE),
        ("potential", solution.potential_energy, GREEN),
        ("total", solution.energy, "black"),
    ):
        ax.plot(solution.t, values, color=colour, linewidth=1.3, label=name)
    return finished(ax, "energy (J)")


@figure_of("reaction")
def reaction(solution: Solution, item: ItemLike, axes: Any = None) -> Any:
    """Draw force (N) and torque (N m) that a constraint, joint or force exerts, in the ground frame, over time.

    Parameters
    ----------
    solution : Solution
    item : constraint, force, or name of one
    axes : sequence of two matplotlib Axes, optional
        Where to draw force and torque; default new axes of pyplot's.

    Returns
    -------
    ndarray (2,) of matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidConstraint
        If the item isn't in the solution's scene.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bob = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> from matplotlib.figure import Figure
    >>> force, torque = ts.plots.reaction(ts.simulate(scene, (0, 1)), "rod", Figure().subplots(2))
    >>> force.get_ylabel(), torque.get_ylabel()
    ('force (N)', 'torque (N m)')
    """
    loads = solution.reaction(item)
    axes = np.atleast_1d(axes_of(axes, 2, sharex=True))
    for ax, values, label in zip(axes, loads, ("force (N)", "torque (N m)"), strict=True):
        for i, component in enumerate("xyz"):
            ax.plot(solution.t, values[:, i], color=COLOURS[i], linewidth=1.3, label=component)
        ax.plot(solution.t, np.linalg.norm(values, axis=1), color="black", linewidth=1.0, label="norm")
        finished(ax, label)
    axes[0].set_title(f"{getattr(item, 'name', item)}, on one body, ground frame", loc="left", fontsize=11)
    return axes


@figure_of("steps", "charts")
def steps(solution: Solution, ax: Any = None) -> Any:
    """Draw the length of every step over time, s; rejected steps are crosses. Arguments as for `constraint_error`.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If the run kept no histories.

    Examples
    --------
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0)
    >>> from matplotlib.figure import Figure
    >>> ts.plots.steps(ts.simulate(scene, (0, 1)), Figure().subplots()).get_ylabel()
    'step (s)'
    """
    history = solution.steps
    ax, taken = axes_of(ax), history.accepted.astype(bool)
    ax.plot(history.t[taken], history.h[taken], ".-", color=BLUE, linewidth=0.8, markersize=3, label="accepted")
    if not taken.all():
        ax.plot(history.t[~taken], history.h[~taken], "x", color=VERMILION, markersize=5, label="rejected")
    ax.set_yscale("log")
    return finished(ax, "step (s)")


@figure_of("steps", "charts")
def charts(solution: Solution, ax: Any = None) -> Any:
    """Draw the condition of every chart at its end, by the reason of the chart. As for `steps`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bob = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground))
    >>> from matplotlib.figure import Figure
    >>> ts.plots.charts(ts.simulate(scene, (0, 1)), Figure().subplots()).get_ylabel()
    'condition of the chart (1)'
    """
    history = solution.charts
    ax, reasons = axes_of(ax), np.array(history.reason)
    for i, reason in enumerate(dict.fromkeys(history.reason)):
        at = reasons == reason
        look = {"marker": MARKERS[i % len(MARKERS)], "color": (*COLOURS, "black", GREY)[i % 5]}
        ax.plot(history.t[at], history.condition[at], linestyle="", markersize=3, label=f"{reason}: {at.sum()}", **look)
    if (np.nan_to_num(history.condition) > 0.0).any():
        ax.set_yscale("log")
    return finished(ax, "condition of the chart (1)")


def finished(ax: Any, label: str) -> Any:
    """Label the axes of a quantity over time."""
    ax.set_xlabel("time (s)")
    ax.set_ylabel(label)
    bare(ax)
    if ax.lines:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, fontsize="small")
    return ax


# Constraint errors over time.

LEVELS = {"position": ("m", BLUE), "velocity": ("m/s", VERMILION), "acceleration": ("m/s²", GREEN)}


@figure_of("constraint_error")
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
    ax = axes_of(ax)
    for level, (unit, colour) in LEVELS.items():
        error = getattr(solution.constraint_error, level)
        label = f"{level}\nup to {error.max():.1e} {unit}"
        ax.plot(*largest(solution.t, error), color=colour, linewidth=1.3, label=label)
    ax.set_yscale("log")
    ax.set_xlabel("time (s)")
    ax.set_ylabel("constraint error, maximum norm (m, m/s, m/s²)")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small", columnspacing=1.2)
    return ax


# `solution.plot()`: constraint errors, energies, steps and charts of a run.

SIZE = 11.0, 7.5  # inches


def overview(solution: Solution, path: Any = None) -> Any:
    """What `Solution.plot` does."""
    axes = axes_of(None, 2, 2, figsize=SIZE, sharex=True)
    constraint_error(solution, axes[0, 0])
    energy(solution, axes[0, 1])
    for ax, draw in ((axes[1, 0], steps), (axes[1, 1], charts)):
        try:
            draw(solution, ax)
        except InvalidArgument:  # no histories
            ax.text(0.5, 0.5, "no history kept", color=GREY, ha="center", transform=ax.transAxes)
            ax.set_xlabel("time (s)")
    axes[0, 0].figure.suptitle(f"{solution.method}, formulation {solution.formulation}", x=0.01, ha="left")
    if path is not None:
        save(axes[0, 0].figure, path)
    return axes
