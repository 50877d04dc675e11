"""The log of a run: what is asked of it, and rows of what it records."""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import kernel


class RunLog(NamedTuple):
    """Arrays of a run's own, unlike those of `Run`: room for a slice of it."""

    t_eval: np.ndarray  # output times, or empty: every step
    stops: np.ndarray  # (stops, 3)  times at which a step ends, increasing, as of `motions.knots.stops_of`
    out: np.ndarray  # (rows, 1 + 3 n + angles + slots)  t, q, qd, qdd, remembered
    history: np.ndarray  # (rows, 3)  of each step tried: t, h, whether it was accepted
    charts: np.ndarray  # (rows, 5)  t, reason, condition, contraction, steps in it; rows are closed when it is left
    points: np.ndarray  # (rows, n + redundant rows)  q0 of each chart and its selection, or (0, n) where nothing asks
    blocks: np.ndarray  # (rows, block)  those of accepted steps


def no_log():
    """An example of its type, of no rows."""
    none = np.zeros((0, 1))
    return RunLog(np.zeros(0), np.zeros((0, 3)), none, none, none, none, none)


@kernel
def is_full(r, log):
    """Return True if there is no room for one more step, and a chart before and after it."""
    return r.numbers.chart_rows + 2 >= log.charts.shape[0] or r.numbers.history >= log.history.shape[0]


@kernel
def note_try(r, log, t, h):
    """A step h from t is tried."""
    row = log.history[r.numbers.history]
    row[0], row[1], row[2] = t, h, 0.0


@kernel
def note_accepted(r, log):
    """The last step tried is accepted."""
    log.history[r.numbers.history - 1, 2] = 1.0


@kernel
def open_chart(r, log, t, reason):
    """A chart is made at t, for this reason."""
    row = log.charts[r.numbers.chart_rows]
    row[0], row[1] = t, reason
    r.numbers.in_chart = 0


@kernel
def close_chart(r, log, condition, contraction):
    """The present chart is left."""
    row = log.charts[r.numbers.chart_rows]
    row[2], row[3], row[4] = condition, contraction, r.numbers.in_chart
    r.numbers.chart_rows += 1


def left_open(run, charts, condition, contraction):
    """The charts (k, 5) of a log, the last of which the run has not left."""
    return with_end(charts[: run.numbers.chart_rows + 1].copy(), run.numbers, condition, contraction)


def with_end(charts, numbers, condition, contraction):
    """Write into the last of some charts how it is where the run has ended."""
    charts[-1, 2:] = condition, contraction, numbers.in_chart
    return charts
