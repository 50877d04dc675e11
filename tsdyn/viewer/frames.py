"""Frames of an animation: a run resampled at equal intervals of time.

Between two outputs the coordinates are the quintic with the values, rates and accelerations of both; where a run kept
its dense output, they are read from that. Euler parameters are scaled to unit length.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InvalidArgument, StepFailure

if TYPE_CHECKING:
    from ..hints import Floats, Solution

OUTPUTS = 8000  # of a stored run, that are read at most


class Frames(NamedTuple):
    """The run at times (k,), equally spaced; poses of b bodies. `run`: outputs beside these times."""

    times: Floats
    position: Floats  # (k, b, 3), m
    orientation: Floats  # (k, b, 4), Euler parameters; (1, 0, 0, 0) for a point mass
    run: Any

    def interpolated(self, values: Floats) -> Floats:
        """Values (outputs of `run`, ...) at the times of the frames, linear between outputs."""
        i, s, _ = _intervals(self.run.t, self.times)
        s = s.reshape(-1, *[1] * (values.ndim - 1))
        return values[i] + s * (values[np.minimum(i + 1, len(values) - 1)] - values[i])


def resample(solution: Solution, count: int) -> Frames:
    """The `Frames` of a solution, at most `count`; raises InvalidArgument where it has numbers that aren't finite."""
    times = np.linspace(solution.t[0], solution.t[-1], count if solution.t[-1] > solution.t[0] else 1)
    run = _beside(solution, times)
    q = _dense(solution, times)
    if q is None:
        q = quintic(run, times)
    bodies = [solution.handles.where(body) for body in solution.handles.bodies]
    position = np.stack([q[:, at : at + 3] for at, _ in bodies], axis=1)
    orientation = np.zeros((times.size, len(bodies), 4))
    orientation[:, :, 0] = 1.0
    for i, (at, dimension) in enumerate(bodies):
        if dimension == 7:
            p = q[:, at + 3 : at + 7]
            orientation[:, i] = p / np.linalg.norm(p, axis=1, keepdims=True)
    if not all(np.isfinite(array).all() for array in (position, orientation, run.qd, run.qdd)):
        raise InvalidArgument(
            "the outputs have numbers that aren't finite, which can't be drawn: view others, solution[a:b].view()."
        )
    return Frames(times, position, orientation, run)


def _dense(solution, times):
    """Coordinates (k, n) from dense output, None where there is none, or it fails."""
    try:
        return None if solution._trajectory is None else solution.at(times).q
    except (InvalidArgument, StepFailure):  # of a run that ended early, close to its end
        return None


def _beside(solution, times):
    """The outputs on both sides of each time."""
    if solution._stored is not None:
        return solution[:: max(1, solution.t.size // OUTPUTS)]
    after = np.clip(np.searchsorted(solution.t, times, side="right"), 1, solution.t.size - 1)
    return solution._picked(np.union1d(after - 1, after) if solution.t.size > 1 else np.arange(1))


def quintic(run: Solution, times: Floats) -> Floats:
    """Coordinates (k, n) at times (k,), from those at the outputs with their rates and accelerations."""
    i, s, h = _intervals(run.t, times)
    j, s, h = np.minimum(i + 1, run.t.size - 1), s[:, None], h[:, None]
    q, d = run.q[i], run.q[j] - run.q[i]
    v, a, w, b = h * run.qd[i], h * h * run.qdd[i], h * run.qd[j], h * h * run.qdd[j]
    c3 = 10.0 * d - 6.0 * v - 4.0 * w - 1.5 * a + 0.5 * b
    c4 = -15.0 * d + 8.0 * v + 7.0 * w + 1.5 * a - b
    c5 = 6.0 * d - 3.0 * (v + w) - 0.5 * (a - b)
    return q + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5))))


def _intervals(t, times):
    """For each time the output before it, and where it is in the interval from there, 0 to 1, of length h, s."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(t.size - 2, 0))
    h = t[np.minimum(i + 1, t.size - 1)] - t[i]
    s = np.divide(times - t[i], h, out=np.zeros_like(times), where=h > 0.0)
    return i, np.clip(s, 0.0, 1.0), h
