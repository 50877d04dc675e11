"""Knots of piecewise motions and loads: stops of a run, and jumps that no run may cross."""

import numpy as np

from ..errors import InvalidConstraint
from .tolerances import JUMP, LEAST_SPAN, ROUNDING, TOGETHER

NO_STOPS = np.empty((0, 3))


def demand_covered(motion, t0, t1, what, error):
    """Refuse a run beyond the times for which a motion has values."""
    for pieces in motion.pieces:
        first, last = pieces.covers
        if t0 < first or t1 > last:
            raise error(
                f"{what}: the table covers {first:g} to {last:g} s and the run {t0:g} to {t1:g} s; extend the table or "
                "shorten t_span."
            )


def joints(motion, t0, t1):
    """The knots of a motion in (t0, t1], s, increasing."""
    found = [pieces.joints(t0, t1) for pieces in motion.pieces]
    return np.unique(np.concatenate(found)) if found else np.empty(0)


def demand_followed(motion, t0, t1, what):
    """Refuse a motion of a constraint whose value or rate jumps at a knot in (t0, t1)."""
    times = joints(motion, t0, t1)
    times = times[times < t1]
    if not times.size:
        return
    sides = motion.sides(times)
    largest = np.abs(sides).max(axis=(0, 2))
    piece = np.diff(np.concatenate(([t0], times, [t1])))
    noise = ROUNDING * largest[0] / np.minimum(piece[1:], piece[:-1])
    jumps = np.abs(sides[1] - sides[0])
    for level, name, allowed in ((0, "value", 0.0), (1, "rate", noise)):
        excess = jumps[level] - (JUMP * largest[level] + allowed)
        i = int(np.argmax(excess))
        if not excess[i] <= 0.0:
            raise InvalidConstraint(
                f"{what}: its {name} jumps from {sides[0][level][i]:.9g} to {sides[1][level][i]:.9g} at t = "
                f"{times[i]:.9g} s, which no constraint can follow; join the values by a smoother curve, such as "
                "scipy.interpolate.CubicSpline."
            )


def stops_of(parameters, instants, changes, t0, t1):
    """Return the stops of a run from t0 to t1: knots of a scene's Motions and Signals, sampling times, changes; (k, 3).

    Knots and sampling times that differ by rounding are merged into the last, or into t1. The second column marks
    sampling times, at which a Python function is called. A step ends at a stop if it begins at the time in the third
    column at the latest, which is that of the stop but for intervals (k, 2) of changes.
    """
    near = TOGETHER * max(abs(t0), abs(t1), LEAST_SPAN * (t1 - t0))
    hard = _hard_stops(parameters, instants, t0, t1)
    if not changes.size:
        return hard
    begins, ends = changes.T
    known = np.concatenate((hard[:, 0], [t1]))
    apart = np.abs(ends - known[np.searchsorted(known, ends - near).clip(max=known.size - 1)]) > near
    soft = np.column_stack((ends, np.zeros(ends.size), begins))[apart]
    stops = np.concatenate((hard, soft))
    return stops[np.argsort(stops[:, 0], kind="stable")]


def _hard_stops(parameters, instants, t0, t1):
    found = [joints(motion, t0, t1) for given in parameters for motion in given.motions if motion.pieces]
    if not (instants.size or found):
        return NO_STOPS
    times = np.concatenate([instants, *found])
    order = np.argsort(times, kind="stable")
    times, asked = times[order], np.where(order < instants.size, 1.0, 0.0)
    near = TOGETHER * np.maximum(np.abs(times), LEAST_SPAN * (t1 - t0))
    late = t1 - times <= near
    times, asked = np.where(late, t1, times), np.where(late, 0.0, asked)
    kept = times - t0 > near
    times, asked, near = times[kept], asked[kept], near[kept]
    if not times.size:
        return NO_STOPS
    ends = np.flatnonzero(np.append(np.diff(times) > near[1:], True))  # of each group
    return np.column_stack((times[ends], np.maximum.reduceat(asked, np.append(0, ends[:-1] + 1)), times[ends]))
