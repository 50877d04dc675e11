"""DOP853: its tableau, its order, and that errors follow the tolerances down to rounding."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from examples import bricard
from tests.helpers.reference import demand_every_level, load, run
from tests.helpers.tolerances import HELD, ROUNDING
from tsdyn.methods.tableau import RungeKuttaTableau

DOP853, RK45 = ts.integrators.DOP853, ts.integrators.RK45
SCENES = ("sliding_top", "two_body_pendulum", "two_body_pendulum_spatial")
FORMS = ("tangent", "maggi-kane")


def test_tableau_meets_its_order_conditions():
    """Quadrature and stage sums by the class; here the bushy trees of orders five to eight, and Hairer's C(q)."""
    tableau = DOP853().tableau
    a, b, c = tableau.arrays
    size = np.abs(a).sum(axis=1).max()
    for power in range(2, 7):
        for chain in range(1, 8 - power):
            left = b.copy()
            for _ in range(chain):
                left = left @ a
            expected = 1.0 / np.prod(np.arange(power + 1, power + chain + 2, dtype=float))
            assert abs(left @ c**power - expected) < ROUNDING * size
    wrong = {"a": tableau.a, "b": (*tableau.b[:-1], tableau.b[-1] + 1e-9), "c": tableau.c, "order": 8}
    with pytest.raises(ts.InvalidArgument, match="b c"):
        RungeKuttaTableau(**wrong)
    with pytest.raises(ts.InvalidArgument, match="13 weights"):
        RungeKuttaTableau(tableau.a, tableau.b, tableau.c, 8, error=(1.0, -1.0))


@pytest.mark.parametrize("name", SCENES[1:])
def test_the_estimate_vanishes_nowhere(name):
    """That of the tangent part did now and then: steps were too long, and errors 0.03 to 0.06 of the tolerance."""
    off = [run(name, DOP853(rtol=tol, atol=tol))[1] / tol for tol in (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)]
    assert np.exp(np.mean(np.log(off))) < 0.012


def test_prescribed_motion_is_exact_however_long_the_step():
    """Fifteen radians at steps of one radian, which is as far as bodies with prescribed motions turn in a step."""
    scene = ts.Scene()
    wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2), angular_velocity=(0, 0, 3))
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    directions = {"reference_a": (1, 0, 0), "across_a": (0, 1, 0), "reference_b": (1, 0, 0)}
    scene.add(ts.constraints.AngleDriver(scene.ground, wheel, **directions, angle=ts.motions.Ramp(0.0, 3.0)))
    solution = ts.simulate(scene, (0.0, 5.0), integrator=DOP853(1e-10, 1e-10))
    assert solution.stats.steps < 25
    assert solution.state.angle(hinge) == pytest.approx(15.0, abs=HELD)


@pytest.mark.parametrize("name", SCENES)
def test_down_to_rounding(name):
    assert run(name, DOP853(rtol=1e-13, atol=1e-13))[1] < HELD


@pytest.mark.parametrize("formulation", FORMS)
def test_it_takes_fewer_evaluations_than_rk45(formulation):
    ends = [
        run("two_body_pendulum", method(1e-12, 1e-12), formulation=formulation)[0].stats.evaluations
        for method in (DOP853, RK45)
    ]
    assert ends[0] < 0.5 * ends[1]


def test_evaluations_are_counted():
    """Twelve a step, the end's among them; three more and one an output only where a step's inside is asked for."""
    scene, _ = load("sliding_top")
    method = DOP853(1e-8, 1e-8)
    plain = ts.simulate(scene, (0.0, 10.0), integrator=method)
    tried = plain.stats.steps + plain.stats.rejected
    assert plain.stats.evaluations == 12 * tried + 2
    at_steps = ts.simulate(scene, (0.0, 10.0), integrator=method, t_eval=plain.t[::7])
    assert at_steps.stats.evaluations == plain.stats.evaluations
    inside = ts.simulate(scene, (0.0, 10.0), integrator=method, t_eval=(plain.t[:2].mean(), plain.t[5:7].mean()))
    assert inside.stats.evaluations == plain.stats.evaluations + 2 * (3 + 1)


def test_steps_follow_the_charts_of_a_linkage():
    """At a loose tolerance charts limit the steps of Bricard's loop; few steps leave one, and the motion is right."""
    scene, tol = bricard.build(), 1e-4
    solution = ts.simulate(scene, (0.0, 2.0), integrator=DOP853(tol, tol))
    exact = ts.simulate(scene, (0.0, 2.0), integrator=ts.integrators.Taylor(tol=1e-13))
    assert 4 * solution.stats.rejected < solution.stats.steps
    assert np.abs(solution.q[-1] - exact.q[-1]).max() < tol
    demand_every_level(solution)


@pytest.mark.parametrize("name", ["two_body_pendulum", "two_body_pendulum_spatial"])
def test_steps_follow_the_time_scale(name):
    """Swings quicken and slow down within a step; by errors alone a twelfth of the steps is rejected, and more."""
    for tol in (1e-4, 1e-6):
        solution, off = run(name, DOP853(rtol=tol, atol=tol))
        assert solution.stats.rejected < 0.065 * solution.stats.steps
        assert off < tol


def test_accelerations_of_a_spring_are_no_time_scale():
    """x = 1 + 0.3 cos(w t): accelerations pass zero twice a period, the steps don't change."""
    scene, w = ts.Scene(gravity=(0.0, 0.0, 0.0)), np.sqrt(40.0)
    ball = scene.add_point_mass(mass=1.0, position=(1.3, 0.0, 0.0))
    scene.add(ts.forces.Spring(ball, scene.ground, stiffness=40.0, free_length=1.0))
    solution = ts.simulate(scene, (0.0, 20.0), integrator=DOP853(1e-6, 1e-6))
    assert solution.stats.rejected == 0
    settled = solution.steps.h[len(solution.steps.h) // 5 : -1]
    assert settled.max() < 1.4 * settled.min()
    exact = 1.0 + 0.3 * np.cos(w * solution.t)
    assert np.abs(solution.position(ball)[:, 0] - exact).max() < 1e-7


def test_from_rest_and_a_load_that_jumps():
    """Nothing moves for a second, then a force acts: x = 5 (t - 1)^2, and x = 5 + 10 (t - 2) after another."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    ball = scene.add_point_mass(mass=0.1, position=(0.0, 0.0, 0.0))
    push = ts.Table([0.0, 1.0, 1.0, 2.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    scene.add(ts.forces.PointForce(ball, force=(push, 0.0, 0.0)))
    solution = ts.simulate(scene, (0.0, 3.0), integrator=DOP853(1e-10, 1e-10), t_eval=(0.0, 1.0, 1.5, 2.0, 3.0))
    assert np.abs(solution.position(ball)[:, 0] - (0.0, 0.0, 1.25, 5.0, 15.0)).max() < HELD


@pytest.mark.parametrize("method", [RK45, DOP853])
def test_a_new_chart_does_not_make_the_control_forget(method):
    """The error before enters the next step; forgotten at every chart, steps would be a fifth longer or shorter.

    Young charts have a little less of an error, so that there may be fewer steps.
    """
    scene, _ = load("two_body_pendulum")
    often, seldom = (
        ts.simulate(scene, (0.0, 5.0), integrator=method(1e-9, 1e-9), chart_interval=interval) for interval in (1, 1000)
    )
    assert often.stats.charts > 3 * seldom.stats.charts
    assert 0.93 < often.stats.steps / seldom.stats.steps < 1.03
    times = np.linspace(0.5, 4.5, 50)
    h = [np.interp(times, s.steps.t[s.steps.accepted], s.steps.h[s.steps.accepted]) for s in (often, seldom)]
    assert 0.97 < np.median(h[0] / h[1]) < 1.08


@pytest.mark.slow
def test_scipy_integrate_is_imported_when_needed():
    code = (
        "import sys, tsdyn; m = tsdyn.integrators.DOP853(); a = 'scipy.integrate' in sys.modules; m.tableau;"
        "print(a, 'scipy.integrate' in sys.modules)"
    )
    root = Path(__file__).parents[2]
    result = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["False", "True"]
