"""Short changes of functions of time: pulses, bumps, edges, kinks. Found by samples, so that no step passes over them.

A step sees a function at its stages alone, and flies over a pulse between them. So functions are sampled before a run,
at SAMPLES + 1 times of it, and each sixth difference of samples is compared with the WINDOW before it that share none
of its samples:

    |d_i| > CLEAR max(|d_j|, i - ORDER - WINDOW <= j < i - ORDER) + FAINT max |f|

is a change; after a pause, too, what is large beside those before the last change. The same on each stride-th sample:
a bump is found where the stride shows it in few samples. What varies as much before, as a sine or noise does, is no
change: it keeps the steps short itself.
"""

import math

import numpy as np

from ..jit.kernels import entry, kernel
from .tolerances import CLEAR, FAINT, OF_STEP, SAMPLES, STRIDES

ORDER, WINDOW = 6, 5  # of the differences; how many one is compared with
REACH = 30  # differences after a change among which another one is compared with those before both
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
        values = np.where(finite, samples / size, 2.0)  # what is not finite for some time is a change
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
    return np.linspace(t, t + h, OF_STEP + 1)


def is_noise(samples):
    """Whether most differences of samples within a step are as large as what they vary by."""
    with np.errstate(all="ignore"):
        varies = np.ptp(samples)
        return bool(FAINT * np.abs(samples).max() < varies < np.median(np.abs(np.diff(samples, ORDER))))


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


@entry
def mark_changes(values, strides, d, marks):
    """Mark the samples, each `stride`-th of values (k,), at which an interval with a change ends; d: scratch."""
    for row in range(strides.size):
        s = strides[row]
        count, first, last = (values.size - 1) // s + 1 - ORDER, -1, -1
        least, until, quiet = 0.0, -1, False
        for i in range(count):
            v = values[i * s :]
            d[i] = abs(v[0] + v[6 * s] - 6.0 * (v[s] + v[5 * s]) + 15.0 * (v[2 * s] + v[4 * s]) - 20.0 * v[3 * s])
        for i in range(count + ORDER + 1):
            if first >= 0 and i > last + ORDER:  # differences first to last are large
                for end in range(min(first + ORDER, last + 1), max(first + ORDER, last + 1) + 1):
                    marks[row, end] = 1
                first = -1
            if i >= count:
                continue
            limit = CLEAR * _before(d, i, s == 1) + FAINT
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
