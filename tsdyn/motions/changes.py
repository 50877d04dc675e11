"""Short changes of functions of time: pulses, bumps, edges, kinks. Found by samples, so that no step passes over them.

A step sees a function at its stages alone, and flies over a pulse between them. So functions are sampled before a run,
at SAMPLES + 1 times of it, and each sixth difference of samples is compared with the WINDOW before it that share none of
its samples:

    |d_i| > CLEAR max(|d_j|, i - ORDER - WINDOW <= j < i - ORDER) + FAINT max |f|

is a change. The same on every STRIDE-th sample: a bump is found where the stride shows it in few samples. What varies as
much before, as a sine or noise does, is no change: it keeps the steps short itself.
"""

import numpy as np

from .tolerances import CLEAR, FAINT, SAMPLES, STRIDES

ORDER, WINDOW = 6, 5  # of the differences; how many one is compared with
NO_CHANGES = np.empty((0, 2))


def sample_times(t0, t1):
    """The times at which the functions of a run are sampled."""
    return np.linspace(t0, t1, SAMPLES + 1)


def changes(t, functions):
    """Intervals (k, 2), s, that no step may pass over, from samples of functions (each (k,)) at times t (k,)."""
    found = [NO_CHANGES]
    for samples in functions:
        values = np.where(np.isfinite(samples), samples, np.nan)
        size = np.nanmax(np.abs(values), initial=0.0) or 1.0
        values = np.nan_to_num(values / size, nan=2.0)  # what is not finite for some time is a change
        for stride in STRIDES:
            at, ends = t[::stride], _ends(values[::stride], stride == 1)
            found.append(np.column_stack((at[ends - 1], at[ends])))
    return np.unique(np.concatenate(found), axis=0)


def _ends(values, finest):
    """The samples at which intervals with a change end; those that begin with one count on the finest grid."""
    d = np.abs(np.diff(values, ORDER))
    before = np.full(d.size, np.inf)
    before[ORDER + 1 :] = _largest(np.concatenate((np.zeros(WINDOW - 1), d)))[: -ORDER - 1]
    if finest:
        before[: ORDER + 1] = _largest(d[ORDER + 1 :])[: ORDER + 1]
    high = np.flatnonzero(d > CLEAR * before + FAINT)
    if not high.size:
        return high
    groups = np.split(high, np.flatnonzero(np.diff(high) > ORDER) + 1)
    ends = [range(min(i[0] + ORDER, i[-1] + 1), max(i[0] + ORDER, i[-1] + 1) + 1) for i in groups]
    return np.concatenate(ends)


def _largest(d):
    """The largest of each WINDOW in a row."""
    found, size = d[WINDOW - 1 :], d.size - WINDOW + 1
    for i in range(WINDOW - 1):
        found = np.maximum(found, d[i : i + size])
    return found
