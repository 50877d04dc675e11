"""Time histories of channels: "hinge.angle", "arm.position.z" and so on.

A curve has points within each step: of the dense output where the run kept one, else of the quintic with the positions,
velocities and accelerations of the outputs on both sides. Between outputs that are too far apart for that there is no
curve; they are dots.
"""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import save
from ..errors import InvalidArgument, StepFailure
from ..model.kinematics import Anchor
from ..observables.channels import channels_of, values_of
from ..observables.quintic import intervals, quintic, ranges
from ..observables.reactions import multipliers
from ..observables.state import RememberingState
from .axes import axes_of
from .histories import finished
from .tolerances import AT_REST, NO_TORQUE, RESOLVED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..hints import Solution

WIDTH, HEIGHT, LABEL = 8.0, 2.2, 26  # of a panel, inches; characters of a line of its label
POINTS, FEWEST = 2000, 3  # of a curve at least, and of each step
MOST = 20_000  # steps that are drawn
AT_ONCE = 1 << 19  # coordinates of states that are evaluated together
INSIDE = 1e-9  # of a step: so near its ends are its first and last points, so that jumps between steps are upright


def time_histories(solution: Solution, names: str | Sequence[str], path: Any = None) -> Any:
    """What `Solution.plot` does with channels, and raises."""
    if not solution.t.size:
        raise InvalidArgument("plot: the solution has no outputs, so there is nothing to show.")
    channels = channels_of(solution.packed, names, solution._lacks)
    times, values, lost = _within_steps(solution, channels) or _between_outputs(solution, channels)
    values[np.isin(intervals(solution.t, times)[0], lost)] = np.nan
    dots = np.unique([lost, lost + 1]) if solution.t.size > 1 else np.zeros(1, int)
    ends = values_of(solution._picked(dots), channels) if dots.size else None
    panels = {}
    for i, channel in enumerate(channels):
        panels.setdefault(channel.unit, []).append(i)
    size = WIDTH, HEIGHT * max(len(panels), 1.5)
    axes = axes_of(None, len(panels), 1, figsize=size, sharex=True, squeeze=False)[:, 0]
    for ax, (unit, some) in zip(axes, panels.items(), strict=True):
        for i in some:
            (line,) = ax.plot(times, values[:, i], linewidth=1.3, label=channels[i].name)
            if ends is not None:
                ax.plot(solution.t[dots], ends[:, i], ".", color=line.get_color(), markersize=4)
        quantities = ", ".join(dict.fromkeys(channels[i].quantity for i in some))
        finished(ax, fill(f"{quantities} ({unit})", LABEL))
        if unit == "N m":
            force = np.nanmax(np.abs(values[:, panels.get("N", [])]), initial=0.0)
            low, high, least = *ax.get_ylim(), NO_TORQUE * force * solution.packed.size
            ax.set_ylim(min(low, -least), max(high, least))
    for ax in axes[:-1]:
        ax.set_xlabel("")
    if path is not None:
        save(axes[0].figure, path)
    return axes


def _times(edges):
    """Times (k,) within the steps between edges."""
    steps = np.column_stack((edges[:-1], edges[1:]))[:: max(len(edges) // MOST, 1)]
    share = np.linspace(INSIDE, 1.0 - INSIDE, max(FEWEST, POINTS // max(len(steps), 1)))
    return (steps[:, :1] + (steps[:, 1:] - steps[:, :1]) * share).ravel()


def _values(ask, times, channels, n):
    """Values (k, channels) at times, of the states that `ask` gives, of n coordinates, some at once."""
    parts = np.array_split(times, max(times.size * n // AT_ONCE, 1))
    return np.concatenate([values_of(ask(part), channels) for part in parts])


def _within_steps(solution, channels):
    """Times and values of the dense output, and no interval without; None where there is no dense output."""
    if solution._trajectory is None or solution.t.size == 1:
        return None
    start, end = solution.t[[0, -1]]
    edges = solution._trajectory.edges
    times = _times(np.unique([start, *edges[(start < edges) & (edges < end)], end]))
    try:
        return times, _values(solution.at, times, channels, solution.q.shape[1]), np.zeros(0, int)
    except StepFailure:  # of a run that ended early, close to its end
        return None


def _between_outputs(solution, channels):
    """Times and values of the quintic, and the intervals between outputs that are too long for it."""
    t, levels = solution.t, (solution.q, solution.qd, solution.qdd)

    def state(times):
        i, _, _ = intervals(t, times)
        q, qd, qdd = quintic(t, levels, times)
        memory = solution._remembers[i]
        lam = np.zeros((times.size, 0)) if solution._lacks else multipliers(solution.packed, times, q, qd, qdd, memory)
        anchor = Anchor(solution.anchor.angles[i], times - t[i], (levels[0][i], levels[1][i]))
        return RememberingState.of(solution.packed, memory, anchor, times, q, qd, qdd, lam)

    times = _times(np.unique(t))
    return times, _values(state, times, channels, levels[0].shape[1]), _unresolved(t, *levels)


def _unresolved(t, q, qd, qdd):
    """Numbers of the intervals where cubic and quintic differ: by a 64th of the sum of these at half the interval."""
    h = np.diff(t)[:, None]
    d, v, w = np.diff(q, axis=0), h * qd[:-1], h * qd[1:]
    ends = h * h * qdd[:-1] - 6.0 * d + 4.0 * v + 2.0 * w, h * h * qdd[1:] + 6.0 * d - 2.0 * v - 4.0 * w
    size = np.maximum(ranges(q), AT_REST * np.abs(q).max(initial=0.0))
    return np.flatnonzero((np.maximum(*map(np.abs, ends)) > 32.0 * RESOLVED * size).any(axis=1))
