"""Outputs and histories: what is asked for never changes what is computed."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.fixed_steps import SCENES, STEP, formulations, rows, run, same, same_history, scenes
from tests.helpers.reference import load
from tests.helpers.tolerances import CLOSE, HELD

# t_eval


@pytest.mark.slow_but("*sliding_top")
@scenes
@formulations
def test_t_eval_changes_no_step(make, formulation, rng):
    plain = run(make(), (0.0, 1.7), formulation=formulation)
    dense = rng.uniform(0.0, 1.7, 300)
    for times in (
        np.sort(dense),
        np.linspace(0.0, 1.7, 7),
        [1.7],
        [0.0],
        [1e-9],
        plain.t,
        np.nextafter(plain.t[1:], 0),
    ):
        other = run(make(), (0.0, 1.7), formulation=formulation, t_eval=times)
        np.testing.assert_array_equal(other.t, times)
        same_history(plain, other)


@scenes
@formulations
def test_outputs_at_steps_are_the_steps(make, formulation):
    plain = run(make(), (0.0, 1.0), formulation=formulation)
    same(plain, run(make(), (0.0, 1.0), formulation=formulation, t_eval=plain.t))
    same(run(make(), (0.0, 1.0), formulation=formulation, t_eval=plain.t[3::5]), rows(plain, slice(3, None, 5)))


# histories


@scenes
@formulations
@pytest.mark.parametrize("span", [(0.0, 1.0), (0.0, 1.001), (-0.3, 0.61), (0.0, 1e-4)])
def test_history_of_steps_and_charts(make, formulation, span):
    if span[0] and make is SCENES["driven"]:
        pytest.skip("this scene is consistent at t = 0")
    solution = run(make(), span, formulation=formulation)
    stats, (t, h, accepted), charts = solution.stats, solution.steps, solution.charts
    assert stats.steps == accepted.sum() == len(solution.t) - 1 == np.ceil((span[1] - span[0]) / STEP * (1 - 1e-12))
    assert stats.rejected == (~accepted).sum() == 0
    np.testing.assert_array_equal(solution.t[:-1], t)
    assert (solution.t[0], solution.t[-1]) == span
    np.testing.assert_allclose(h, np.diff(solution.t), rtol=0, atol=0)
    np.testing.assert_allclose(h[:-1], STEP, rtol=HELD)
    assert 0 < h[-1] <= STEP * (1 + CLOSE)
    assert stats.charts == len(charts.t) == len(charts.reason)
    assert charts.steps.sum() == stats.steps
    assert charts.reason[0] == "start"
    assert charts.t[0] == span[0]
    np.testing.assert_array_equal(charts.t, solution.t[np.concatenate(([0], np.cumsum(charts.steps[:-1])))])
    assert all(charts.reason)
    assert (charts.condition >= 1.0).all()
    assert (charts.contraction >= 0.0).all()
    assert stats.evaluations == 4 * stats.steps + 1  # Nystrom4, and its first-order equivalent
    assert stats.placements >= 3 * stats.steps + 1
    solved = stats.newton_iterations + stats.solves_skipped
    placed = {"null-space": stats.placements, "tangent": stats.steps}  # there stages stay off the manifold
    assert solved >= placed.get(formulation, 0)
    assert stats.factorizations > 0
    assert set(stats.seconds) == {"prepare", "run"}


@scenes
def test_dense_outputs_cost_one_evaluation_each(make):
    plain = run(make(), (0.0, 1.0))
    for count in (10, 100):
        times = plain.t[1 : count + 1] - STEP / 3
        other = run(make(), (0.0, 1.0), t_eval=times)
        assert other.stats.evaluations == plain.stats.evaluations + count


def test_forced_charts_are_where_they_are_asked_for():
    scene, _ = load("sliding_top")
    solution = run(scene, (0.0, 1.0), chart_interval=8)
    assert set(solution.charts.reason) == {"start", "chart_interval"}
    np.testing.assert_array_equal(solution.charts.t, np.arange(0, 256, 8) * STEP)
    assert (solution.charts.steps == 8).all()


@pytest.mark.parametrize("most", [1, 100, 1023, 1024, 1025, 5000])
def test_max_steps_ends_the_run_and_keeps_what_was_done(most):
    """Also around the sizes of the slices in which a run comes back to Python."""
    scene, _ = load("sliding_top")
    span, step = (0.0, 10.0), 1e-3
    whole = run(scene, span, step)
    part = ts.simulate(scene, span, integrator=ts.integrators.Nystrom4(step), max_steps=most)
    assert part.status == ts.Status.MAX_STEPS
    assert not part.success
    with pytest.raises(ts.StepFailure, match="max_steps"):
        part.raise_if_failed()
    assert part.stats.steps == most
    same(part, rows(whole, slice(0, most + 1)))
    assert part.state.t == whole.t[most]
