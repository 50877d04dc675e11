"""`max_step`, `history`, and the little memory that histories are kept in."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_forms import point_pendulum
from tests.helpers.tolerances import NEAR
from tsdyn.runs.run_log import ChartLog, StepLog

I = ts.integrators
METHODS = [None, I.Taylor(), I.DOP853(1e-9, 1e-9), I.RK45(1e-6, 1e-6), I.Nystrom4(1e-2)]
every_method = pytest.mark.parametrize("method", METHODS, ids=repr)


@every_method
@pytest.mark.parametrize("end", [0.05, 0.050004])
def test_no_step_is_longer_than_max_step(method, end):
    scene = point_pendulum()[0]
    solution = ts.simulate(scene, (0.0, end), integrator=method, max_step=5e-3).raise_if_failed()
    assert solution.steps.h.max() <= 5e-3 * (1.0 + NEAR)
    assert solution.stats.steps >= np.ceil(end / 5e-3)
    assert solution.t[-1] == end
    if method is not None:
        assert method.max_step is None  # the user's own is left alone


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "1", True])
def test_impossible_max_steps_are_refused(value):
    with pytest.raises(ts.InvalidArgument, match="max_step"):
        ts.simulate(point_pendulum()[0], (0.0, 0.1), max_step=value)


@every_method
@pytest.mark.parametrize("dense_output", [False, True])
def test_without_histories(method, dense_output):
    scene = point_pendulum()[0]
    plain, without = (
        ts.simulate(scene, (0.0, 0.5), integrator=method, dense_output=dense_output, history=history)
        for history in (True, False)
    )
    for name in ("t", "q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(without, name))
    assert plain.stats.steps == without.stats.steps == plain.steps.accepted.sum()
    assert plain.stats.charts == plain.charts.t.size
    assert repr(without)
    for name in ("steps", "charts"):
        with pytest.raises(ts.InvalidArgument, match="history=True"):
            getattr(without, name)
    with pytest.raises(ts.InvalidArgument, match="history must"):
        ts.simulate(scene, (0.0, 0.5), history="no")


def test_histories_of_steps_are_what_was_added(rng):
    log, parts, t = StepLog(), [], 3.0
    for count in (1, 1000, 7, 2, 3, 30):
        rows = np.empty((count, 3))
        for row in rows:
            h, accepted = rng.uniform(1e-3, 1.0), rng.random() < 0.8
            end = t + h
            row[:] = t, end - t, accepted
            t = end if accepted else t
        rows[-1, 1] *= 0.3  # as at an event
        log.add(rows)
        parts.append(rows)
    for ours, theirs in zip(StepLog([log]).arrays(), np.concatenate(parts).T, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert [part.size for part in StepLog().arrays()] == [0, 0, 0]


def test_histories_of_charts_are_what_was_added(rng):
    log, parts = ChartLog(), []
    for count in (1, 500, 0, 700, 3, 2, 0, 9):
        rows = np.column_stack((rng.random(count), rng.integers(0, 5, count), rng.random((count, 2)), np.ones(count)))
        steps = StepLog()
        if count == 500:  # each a chart
            steps.add(rows[:, [0, 2, 4]])
        log.add(rows, steps)
        parts.append(rows)
    for ours, theirs in zip(ChartLog([log]).arrays(), np.concatenate(parts).T, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_step_is_kept_in_eight_bytes():
    """Of a run by series, each step of which is a chart; more than one slice."""
    solution = ts.simulate(point_pendulum()[0], (0.0, 3000.0), integrator=I.Taylor(), t_eval=[0.0, 3000.0])
    chunks = solution._step_log.chunks + solution._chart_log.chunks
    arrays = {id(x): x for chunk in chunks for x in ([chunk] if isinstance(chunk, np.ndarray) else chunk)}
    kept = sum(x.nbytes for x in arrays.values() if isinstance(x, np.ndarray))
    assert solution.stats.steps > 12_000
    first = 64 * 256 * 4  # the first few slices, as they are
    assert kept < 9 * solution.stats.steps + first
    t, h, accepted = solution.steps
    np.testing.assert_array_equal(t[1:], (t + h)[:-1] if accepted.all() else t[1:])
    np.testing.assert_array_equal(solution.charts.t, t[accepted])
