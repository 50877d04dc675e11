"""Phase portraits and Poincare sections of a joint coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import BLUE, VERMILION
from ..errors import InvalidArgument
from .axes import axes_of, bare, figure_of

if TYPE_CHECKING:
    from ..hints import ArrayLike, ItemLike, Solution

KINDS = {"angle": "rad", "displacement": "m"}


@figure_of("handles")
def phase_portrait(solution: Solution, joint: ItemLike, ax: Any = None, *, wrap: bool = False) -> Any:
    """Draw the rate of a joint's angle (rad) or displacement (m) over it; the start is a dot.

    Parameters
    ----------
    solution : Solution
    joint : joint, or name of one
        One that has an angle, or else a displacement; of several angles the first.
    ax : matplotlib Axes, optional
        Where to draw; default new axes of pyplot's.
    wrap : bool
        Whether to show angles modulo a turn, from -pi to pi.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidConstraint
        If the joint has neither, or isn't in the solution's scene.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bar = (scene := ts.Scene()).add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0))
    >>> hinge = ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge")
    >>> hinge = scene.add(hinge)
    >>> from matplotlib.figure import Figure
    >>> axes = ts.plots.phase_portrait(ts.simulate(scene, (0, 1)), "hinge", Figure().subplots())
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('angle of hinge (rad)', 'rate (rad/s)')
    """
    ax, (x, rate, kind) = axes_of(ax), coordinate_of(solution, joint)
    if wrap and kind == "angle":
        x = wrapped(x)
        jumps = np.flatnonzero(np.abs(np.diff(x)) > np.pi) + 1
        x, rate = np.insert(x, jumps, np.nan), np.insert(rate, jumps, np.nan)
    ax.plot(x, rate, color=BLUE, linewidth=1.0)
    ax.plot(x[:1], rate[:1], "o", color=VERMILION, markersize=4)
    return _labelled(ax, solution, joint, kind)


@figure_of("handles", "at")
def poincare_section(
    solution: Solution, joint: ItemLike, times: ArrayLike, ax: Any = None, *, wrap: bool = True
) -> Any:
    """Draw a joint's angle (rad) or displacement (m) and its rate at some times: a section of the motion.

    Parameters
    ----------
    solution : Solution
        Of a run with dense_output=True.
    times : array_like (k,), s
        The periods of an excitation, such as np.arange(0.0, 500.0, period), or `solution.t_events[i]`, when an event
        was crossed.
    joint, ax, wrap
        As for `phase_portrait`.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If the run kept no dense output, or a time is outside of it.
    InvalidConstraint
        If the joint has neither, or isn't in the solution's scene.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> bar = (scene := ts.Scene()).add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0)))
    >>> from matplotlib.figure import Figure
    >>> solution = ts.simulate(scene, (0, 5), dense_output=True)
    >>> axes = ts.plots.poincare_section(solution, hinge, np.arange(0.0, 5.0, 0.5), Figure().subplots())
    >>> len(axes.lines[0].get_xdata())
    10
    """
    times = np.atleast_1d(np.asarray(times, float))
    if not times.size:
        raise InvalidArgument("poincare_section: times is empty; no event was crossed, or there is no period.")
    ax, (x, rate, kind) = axes_of(ax), coordinate_of(solution.at(times), joint)
    ax.plot(wrapped(x) if wrap and kind == "angle" else x, rate, ".", color=BLUE, markersize=4)
    return _labelled(ax, solution, joint, kind)


def coordinate_of(states: Any, joint: ItemLike) -> tuple[Any, Any, str]:
    """Coordinate and rate (k,) of a joint along a run, and which it is: "angle" or "displacement"."""
    item = states.handles.item(joint)
    kinds = {type(one).__name__.lower() for one in getattr(item, "joint_coordinates", ())}
    kind = "displacement" if kinds == {"displacement"} else "angle"
    x, rate = (getattr(states, name)(item) for name in (kind, f"{kind}_rate"))
    return (x, rate, kind) if x.ndim == 1 else (x[:, 0], rate[:, 0], kind)


def wrapped(angle: Any) -> Any:
    """An angle from -pi to pi."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def _labelled(ax, solution, joint, kind):
    name, unit = solution.handles.item(joint).name, KINDS[kind]
    ax.set_xlabel(f"{kind} of {name} ({unit})")
    ax.set_ylabel(f"rate ({unit}/s)")
    bare(ax)
    return ax
