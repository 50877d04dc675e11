"""RK45: its order, its error control, its dense output, and how it ends when it can't go on."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.pendulums import pulled_straight
from tests.helpers.reference import demand_every_level, error, load, run
from tests.helpers.tolerances import CLOSE, FINE, HELD, ROUGH, ROUNDING

C = ts.constraints
RK45 = ts.integrators.RK45
SCENES = ("sliding_top", "two_body_pendulum", "two_body_pendulum_spatial")
FORMS = ("tangent", "maggi-kane")


def observed_order(name, steps, **options):
    found = [run(name, RK45(step=h), **options) for h in steps]
    assert min(solution.stats.charts for solution, _ in found) > 50
    return np.polyfit(np.log(steps), np.log([off for _, off in found]), 1)[0]


@pytest.mark.parametrize("name", SCENES)
def test_order_with_a_chart_every_step(name):
    """So the method's own error is seen alone; that of charts of many steps has the same order, and may cancel it.

    In longer steps the next term takes away from the first: two-body pendulums come to order five from below.
    """
    assert abs(observed_order(name, 1.0 / np.array([240, 480, 960]), chart_interval=1) - 5.0) < 0.4


@pytest.mark.parametrize("formulation", FORMS)
def test_order_with_charts_by_the_criteria(formulation):
    assert abs(observed_order("sliding_top", 1.0 / np.array([120, 240, 480, 960]), formulation=formulation) - 5.0) < 0.2


@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("name", SCENES)
def test_error_follows_the_tolerance(name, tol):
    solution, off = run(name, RK45(rtol=tol, atol=tol))
    assert off < max(100.0 * tol, 3e-11)
    demand_every_level(solution)


@pytest.mark.parametrize(("name", "tol", "end"), [("chain_4", 1e-9, 1.0), ("chain_16", 1e-6, 0.4)])
def test_chains_with_a_force_on_the_last_body(name, tol, end):
    scene, reference = load(name)
    reference = reference.until(end)
    solution = ts.simulate(scene, (0.0, end), integrator=RK45(rtol=tol, atol=tol), t_eval=reference.t)
    assert error(solution, reference) < 100.0 * tol


@pytest.mark.parametrize("formulation", FORMS)
def test_rejected_steps_leave_no_trace(formulation):
    """Steps far too long are tried first, and rejected; the end is that of a cautious start."""
    ends = []
    for first in (1.0, 1e-4):
        solution, _ = run("two_body_pendulum", RK45(1e-9, 1e-9, first_step=first), formulation=formulation)
        ends.append(solution.q[-1])
        history = solution.steps
        assert history.accepted.sum() == solution.stats.steps
        assert (~history.accepted).sum() == solution.stats.rejected
        accepted = history.t[history.accepted]
        np.testing.assert_allclose(np.diff(accepted), history.h[history.accepted][:-1], rtol=CLOSE)
        if first == 1.0:
            assert solution.stats.rejected > 2
    np.testing.assert_allclose(*ends, atol=ROUGH)


def test_evaluations_are_counted():
    solution, _ = run("sliding_top", RK45(1e-8, 1e-8))
    stats = solution.stats
    tried = stats.steps + stats.rejected
    assert 6 * tried <= stats.evaluations <= 6 * tried + 2 + solution.t.size


def test_output_changes_no_step():
    scene, _ = load("two_body_pendulum_spatial")
    plain = ts.simulate(scene, (0.0, 10.0), integrator="rk45", rtol=1e-7, atol=1e-7)
    dense = ts.simulate(scene, (0.0, 10.0), integrator="rk45", rtol=1e-7, atol=1e-7, t_eval=np.linspace(0, 10, 173))
    np.testing.assert_array_equal(plain.steps.h, dense.steps.h)
    np.testing.assert_array_equal(plain.q[-1], dense.q[-1])


def test_largest_step_and_fixed_step():
    scene, _ = load("sliding_top")
    bounded = ts.simulate(scene, (0.0, 1.0), integrator=RK45(1e-3, 1e-3, max_step=0.01))
    assert bounded.steps.h.max() <= 0.01 * (1 + HELD)
    fixed = ts.simulate(scene, (0.0, 1.0), integrator=RK45(step=0.03))
    np.testing.assert_allclose(fixed.steps.h, [*[0.03] * 33, 0.01], rtol=HELD)


def test_driven_and_free_scenes():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.0), name="bead")
    scene.add_point_mass(1.0, velocity=(0.0, 0.0, 5.0), name="ball")
    motion = (lambda t: 1.0 + 0.2 * np.sin(3.0 * t), lambda t: 0.6 * np.cos(3.0 * t), lambda t: -1.8 * np.sin(3.0 * t))
    scene.add(C.Distance(bead, scene.ground, length=motion))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 2.0), integrator=RK45(1e-10, 1e-10)).raise_if_failed()
    assert solution.constraint_error.position.max() < ROUNDING
    assert solution.constraint_error.acceleration.max() < HELD
    height = 5.0 * solution.t - 0.5 * 9.81 * solution.t**2
    np.testing.assert_allclose(solution.position(scene.body("ball"))[:, 2], height, atol=FINE)


def test_collapsing_step_says_where_and_hands_back_what_it_had():
    solution = ts.simulate(pulled_straight(), (0.0, 2.0), integrator=RK45(1e-8, 1e-8))
    assert not solution.success
    assert 0.9 < solution.t[-1] <= 1.0
    assert np.isfinite(solution.q).all()
    assert "t = " in solution.message
    assert any(name in solution.message for name in ("upper", "lower", "reach"))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: RK45(rtol=0.0), "rtol"),
        (lambda: RK45(atol=float("nan")), "atol"),
        (lambda: RK45(step=-1.0), "step"),
        (lambda: RK45(max_step="1"), "max_step"),
        (lambda: RK45(first_step=0.0), "first_step"),
        (lambda: ts.simulate(load("sliding_top")[0], (0, 1), integrator=RK45(), atol=1e-6), "atol"),
        (lambda: ts.simulate(load("sliding_top")[0], (0, 1), integrator="rk45", rtol=-1.0), "rtol"),
    ],
)
def test_bad_input(call, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        call()


@pytest.mark.parametrize("name", ["rk45", "taylor"])
def test_a_method_named_by_a_string_has_the_tolerances_of_simulate(name):
    kind = ts.integrators.RK45 if name == "rk45" else ts.integrators.Taylor
    scene = load("two_body_pendulum")[0]
    named = ts.simulate(scene, (0.0, 1.0), integrator=name)
    given = ts.simulate(scene, (0.0, 1.0), integrator=kind(rtol=1e-8, atol=1e-8))
    assert np.array_equal(named.q, given.q)
    half = ts.simulate(scene, (0.0, 1.0), integrator=name, rtol=1e-5)
    assert np.array_equal(half.q, ts.simulate(scene, (0.0, 1.0), integrator=kind(rtol=1e-5, atol=1e-8)).q)
