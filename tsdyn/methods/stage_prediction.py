"""First guesses of the stages of a step, k_i = vdd, on the polynomial through stages that are known already.

Known are the earlier stages of the step, and those of the step before on the same chart. The nearest in time are taken,
as many as would have predicted the first implicit stage of the last step best: a stiff transient is no polynomial.

The memory of it: t, h and the counter of charts of the last attempt; h of the step before, 0 where there is none; the
number of points; then vd_i and k_i of each stage of the step before, n floats each.

With friction velocities are predicted in place of accelerations: at rest they are smooth to a part of the slip
velocity, and friction beyond it doesn't determine them.
"""

import math

from ..jit.kernels import kernel, stack
from ..maths.dense_linalg import copy
from .tolerances import APART_AT_LEAST, SAME_TIME

T_LAST, H_LAST, CHART_LAST, H_BEFORE, POINTS, BEFORE = range(6)
LEAST_POINTS, MOST_POINTS = 2, 4


def prediction_memory(stages, n):
    """Floats of memory that predictions need."""
    return BEFORE + 2 * stages * n


@kernel
def begin_prediction(memory, own, stages, n, t, h, charts):
    """Keep the stages of the last attempt if it led to t; the ratio of their step to h, 0 where there are none.

    memory is that of the stages, of which stage i has vd_i at (2 i + 2) n and k_i behind; own is that of predictions.
    """
    if own[CHART_LAST] != charts:
        own[H_BEFORE] = 0.0
    # The last attempt ended at t: its stages are those of the step before
    elif own[H_LAST] > 0.0 and abs(own[T_LAST] + own[H_LAST] - t) <= SAME_TIME * h:
        own[H_BEFORE] = own[H_LAST]
        copy(memory[2 * n :][: 2 * stages * n], own[BEFORE:])
    # Neither accepted nor repeated
    elif own[T_LAST] != t:
        own[H_BEFORE] = 0.0
    own[T_LAST], own[H_LAST], own[CHART_LAST] = t, h, charts
    return own[H_BEFORE] / h


@kernel
def predict(tableau, memory, own, i, ratio, points, part, k):  # eight: what is known, and what is asked for
    """k_i (part 1) or vd_i (part 0) on the polynomial through the `points` nearest of the stages known.

    Of the step before, too, if ratio > 0.
    """
    n, stages = k.size, int(tableau[0])
    times, places = stack(MOST_POINTS), stack(MOST_POINTS)
    found, target = 0, _time(tableau, i)
    # Take the known times in order of their distance, in units of h from the start of this step
    while found < points:
        least, place, time = math.inf, -1, 0.0
        for j in range(i + (stages - 1 if ratio > 0.0 else 0)):
            # Stages of this step, then those of the step before, at (c_j - 1) ratio
            tau = _time(tableau, j) if j < i else (_time(tableau, j - i) - 1.0) * ratio
            distance = abs(tau - target)
            # Times that nearly coincide make Lagrange's weights large
            for m in range(found):
                if abs(tau - times[m]) <= (APART_AT_LEAST * max(ratio, 1.0) if ratio > 0.0 else 0.0):
                    distance = math.inf
            if distance < least:
                least, place, time = distance, j, tau
        if place < 0:
            break
        times[found], places[found] = time, float(place)
        found += 1
    for e in range(n):
        k[e] = 0.0
    for m in range(found):
        # Lagrange's polynomial through them
        weight, source = 1.0, int(places[m])
        for l in range(found):
            if l != m:
                weight *= (target - times[l]) / (times[m] - times[l])
        known = memory[(2 * source + 2 + part) * n :] if source < i else own[BEFORE + (2 * (source - i) + part) * n :]
        for e in range(n):
            k[e] += weight * known[e]


@kernel
def _time(tableau, i):
    """c_i."""
    return tableau[2 + i * (2 + int(tableau[0]))]


@kernel
def extrapolated(own, i):
    """The number of points for stage i: the last of a step are within the earlier ones, or close."""
    return min(max(int(own[POINTS]), LEAST_POINTS), MOST_POINTS) if i < LEAST_POINTS + 1 else MOST_POINTS


@kernel
def choose_points(tableau, memory, own, ratio, part, scratch):
    """Take the number of points that would have predicted the first implicit stage best; scratch is of n floats."""
    n, least = scratch.size, math.inf
    k = memory[(4 + part) * n :]
    # Squared error of the prediction from so many points
    for points in range(LEAST_POINTS, MOST_POINTS + 1):
        predict(tableau, memory, own, 1, ratio, points, part, scratch)
        off = 0.0
        for e in range(n):
            off += (k[e] - scratch[e]) * (k[e] - scratch[e])
        if off < least:
            least, own[POINTS] = off, float(points)
