"""Constraint errors over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..drawing import BLUE, GREEN, VERMILION
from .axes import axes_of, figure_of, largest

if TYPE_CHECKING:
    from ..hints import Solution

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
