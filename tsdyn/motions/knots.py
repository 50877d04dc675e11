"""Knots of piecewise motions and loads, and short changes of functions of time: no step passes over them."""

import math

import numpy as np

from ..errors import InvalidConstraint
from ..jit.kernels import entry, kernel
from ..maths.tolerances import NEGLIGIBLE, TYPED
from .tolerances import CLEAR_CHANGE, LEAST_SPAN, SAME_VALUE, SAMPLES, STRIDES, TOGETHER

# Knots of piecewise motions and loads: stops of a run, and jumps that no run may cross.

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
    noise = NEGLIGIBLE * largest[0] / np.minimum(piece[1:], piece[:-1])
    jumps = np.abs(sides[1] - sides[0])
    for level, name, allowed in ((0, "value", 0.0), (1, "rate", noise)):
        excess = jumps[level] - (TYPED * largest[level] + allowed)
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


# Short changes of functions of time: pulses, bumps, edges, kinks. Found by samples, so that no step passes over them.
#
# A step sees a function at its stages alone, and flies over a pulse between them. So functions are sampled before a
# run, at SAMPLES + 1 times of it, and each sixth difference of samples is compared with the WINDOW before it that share
# none of its samples:
#
#     |d_i| > CLEAR max(|d_j|, i - ORDER - WINDOW <= j < i - ORDER) + FAINT max |f|
#
# shows a change within f_i to f_{i + ORDER}. The same on each stride-th sample: a wide bump is found by the stride at
# which it has few samples. What varies as much before, as a sine or noise does, is no change: it keeps the steps short
# itself.
#
# The second edge of a pulse has the first one in its window, and a pulse of a train the one before. So REACH
# differences after a change are compared with the limit of that change, too: once one has been below it (`quiet`),
# larger ones are another change.

ORDER, WINDOW = 6, 5  # of the differences; how many one is compared with
REACH = 30  # differences after a change that are compared with its limit, too
NO_CHANGES = np.empty((0, 2))


def sample_times(t0, t1):
    """The times at which the functions of a run are sampled."""
    return np.linspace(t0, t1, SAMPLES + 1)


def changes(t, functions):
    """Intervals (k, 2), s, that no step may pass over, from samples of functions (each (k,)) at times t (k,)."""
    strides, found, d = np.array(STRIDES), [NO_CHANGES], np.empty(t.size)
    for samples in functions:
        finite = np.isfinite(samples)
        size = np.abs(samples[finite]).max(initial=0.0) or 1.0
        values = np.where(finite, samples, 2.0 * size) / size  # what is not finite for some time is a change
        if not np.ptp(values):
            continue
        marks = np.zeros((strides.size, t.size), np.int8)
        mark_changes(values, strides, d, marks)
        row, end = np.nonzero(marks)
        end *= strides[row]
        found.append(np.column_stack((t[end - strides[row]], t[end])))
    intervals = np.concatenate(found)
    return np.unique(intervals, axis=0) if intervals.size else NO_CHANGES


def within_step(t, h):
    """The times within a step at which `is_noise` is asked."""
    return np.linspace(t, t + h, STRIDES[-1] + 1)


def is_noise(samples):
    """Whether most differences of samples within a step are as large as what they vary by."""
    with np.errstate(all="ignore"):
        varies = np.ptp(samples)
        return bool(SAME_VALUE * np.abs(samples).max() < varies < np.median(np.abs(np.diff(samples, ORDER))))


@kernel
def _before(d, i, finest):
    """The largest difference before the i-th; the first ones on the finest grid are compared with those after them."""
    if i <= ORDER and not finest:
        return math.inf
    begin = i - ORDER - WINDOW if i > ORDER else i + ORDER + 1
    largest = 0.0
    for j in range(max(begin, 0), begin + WINDOW):
        largest = max(largest, d[j])
    return largest


@entry("vwv", np.zeros((0, 0), np.int8))
def mark_changes(values, strides, d, marks):
    """Mark the samples, each `stride`-th of values (k,), at which an interval with a change ends; d: scratch.

    A jump between samples c - 1 and c makes the differences c - ORDER to c - 1 large. So of large ones in succession,
    `first` to `last`, the intervals that end at samples first + ORDER to last + 1 are marked. least: the limit of the
    change before, for differences up to `until`.
    """
    for row in range(strides.size):
        s = strides[row]
        count, first, last = (values.size - 1) // s + 1 - ORDER, -1, -1
        least, until, quiet = 0.0, -1, False
        # Sixth differences of every s-th sample, |D^6 v|
        for i in range(count):
            v = values[i * s :]
            d[i] = abs(v[0] + v[6 * s] - 6.0 * (v[s] + v[5 * s]) + 15.0 * (v[2 * s] + v[4 * s]) - 20.0 * v[3 * s])
        for i in range(count + ORDER + 1):
            # A change has ended: mark its intervals
            if first >= 0 and i > last + ORDER:  # differences first to last are large
                for end in range(min(first + ORDER, last + 1), max(first + ORDER, last + 1) + 1):
                    marks[row, end] = 1
                first = -1
            if i >= count:
                continue
            # Large: far above the differences before it; within REACH of a large one, above `least`
            limit = CLEAR_CHANGE * _before(d, i, s == 1) + SAME_VALUE
            if d[i] > limit:
                least = least if i <= until else limit
                until, quiet = i + REACH, False
            elif d[i] <= least:
                quiet = True  # what is large from here on is another change
                continue
            elif not (quiet and i <= until):
                continue
            elif last < i - 1:
                until = i + REACH
            first = i if first < 0 else first
            last = i
