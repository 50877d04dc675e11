"""The Taylor integrator: accuracy, steps and orders, output between steps, scenes of every kind, refusals."""

from itertools import pairwise

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import mounted
from tests.helpers.reference import demand_on_the_manifold, error, load
from tests.helpers.tolerances import ALGEBRA, CLOSE, EPS, FINE, HELD, NEAR, ROUNDING, TIGHT
from tsdyn.runs import driver
from tsdyn.simulation import segments

C, F, I = ts.constraints, ts.forces, ts.integrators
TOLERANCES = (1e-4, 1e-8, 1e-12)
SPANS = {"sliding_top": 10.0, "two_body_pendulum_spatial": 10.0, "chain_4": 1.0, "chain_16": 1.0}


@pytest.mark.parametrize("name", SPANS)
@pytest.mark.parametrize("tol", TOLERANCES)
def test_errors_keep_to_the_tolerance(name, tol):
    scene, reference = load(name)
    reference = reference.until(SPANS[name])
    solution = ts.simulate(scene, (0.0, SPANS[name]), integrator=I.Taylor(tol), t_eval=reference.t)
    assert error(solution, reference) < 100.0 * tol + HELD
    demand_on_the_manifold(solution, solution)
    assert solution.stats.rejected == 0


def test_full_accuracy_by_default():
    scene, reference = load("sliding_top")
    reference = reference.until(10.0)
    solution = ts.simulate(scene, (0.0, 10.0), integrator=I.Taylor(), t_eval=reference.t)
    assert error(solution, reference) < 2 * ALGEBRA
    assert solution.stats.steps < 60


def test_fixed_orders_and_the_free_one():
    scene, _ = load("chain_4")
    steps = {
        order: ts.simulate(scene, (0.0, 1.0), integrator=I.Taylor(1e-8, order=order)).stats.steps
        for order in (8, 12, 20, None)
    }
    assert steps[8] > steps[12] > steps[20]
    assert steps[20] <= steps[None] <= steps[12]


def pendulum():
    scene = ts.Scene()
    mass = scene.add_point_mass(mass=2.0, position=(0.6, 0.0, -0.8))
    scene.add(C.Distance(mass, scene.ground, length=1.0))
    return scene, mass


def test_point_masses():
    scene, mass = pendulum()
    runs = [
        ts.simulate(scene, (0.0, 3.0), integrator=method, t_eval=np.linspace(0.0, 3.0, 7))
        for method in (I.Taylor(1e-13), I.DOP853(1e-12, 1e-12))
    ]
    assert np.abs(runs[0].position(mass) - runs[1].position(mass)).max() < FINE
    assert np.ptp(runs[0].energy) < HELD


def test_a_free_body_without_any_constraint():
    scene = ts.Scene(gravity=(0.0, 0.0, -2.0))
    body = scene.add_body(
        mass=1.0, inertia=(2.0, 2.0, 2.0), velocity=(1.0, 0.0, 3.0), angular_velocity=(0.0, 40.0, 0.0)
    )
    solution = ts.simulate(scene, (0.0, 2.0), integrator=I.Taylor(1e-12), t_eval=np.linspace(0.0, 2.0, 400))
    t = solution.t[:, None]
    assert np.abs(solution.position(body) - (t * [1.0, 0.0, 3.0] + t * t * [0.0, 0.0, -1.0])).max() < HELD
    angle = 20.0 * solution.t  # half the angle: p itself goes on, without a change of sign, over many turns
    p = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle), 0.0 * angle], axis=1)
    assert np.abs(solution.orientation(body) - p).max() < TIGHT


def test_bodies_that_are_not_spherical_tumble():
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    J = [[3.0, 0.2, 0.1], [0.2, 2.0, 0.0], [0.1, 0.0, 1.2]]
    scene.add_body(mass=1.0, inertia=J, angular_velocity=(0.1, 6.0, 0.1))
    solution = ts.simulate(scene, (0.0, 10.0), integrator=I.Taylor(1e-13))
    assert np.ptp(solution.energy) < TIGHT
    assert np.ptp(solution.angular_momentum, axis=0).max() < TIGHT


def test_output_between_steps_is_the_series_and_changes_nothing():
    scene, _ = load("two_body_pendulum_spatial")
    plain = ts.simulate(scene, (0.0, 2.0), integrator=I.Taylor(1e-10))
    dense = ts.simulate(scene, (0.0, 2.0), integrator=I.Taylor(1e-10), dense_output=True)
    times = np.linspace(0.0, 2.0, 41)
    asked = ts.simulate(scene, (0.0, 2.0), integrator=I.Taylor(1e-10), t_eval=times)
    assert np.array_equal(plain.t, dense.t)
    assert np.array_equal(plain.q, dense.q)
    assert asked.stats.steps == plain.stats.steps
    state = dense.at(times)
    assert np.abs(state.q - asked.q).max() < ROUNDING * (1.0 + np.abs(asked.q).max())
    assert np.abs(state.qd - asked.qd).max() < ALGEBRA * (1.0 + np.abs(asked.qd).max())
    assert np.abs(state.qdd - asked.qdd).max() < TIGHT * (1.0 + np.abs(asked.qdd).max())
    demand_on_the_manifold(dense, state)
    ends = dense.at(dense.t)
    assert np.abs(ends.q - dense.q).max() < ROUNDING * (1.0 + np.abs(dense.q).max())
    h = 1e-3  # the states are derivatives of each other
    fine = dense.at(1.0 + h * np.arange(-3, 4))
    quotient = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / (60.0 * h)
    assert np.abs(quotient @ fine.q - fine.qd[3]).max() < CLOSE
    assert np.abs(quotient @ fine.qd - fine.qdd[3]).max() < NEAR


def test_events_and_going_on():
    scene, _ = pendulum()

    def lowest(t, state):
        return state.q[0]

    lowest.terminal = True
    solution = ts.simulate(scene, (0.0, 3.0), integrator=I.Taylor(1e-13), events=lowest)
    assert solution.status == ts.Status.EVENT
    assert abs(solution.q_events[0][0, 0]) < ALGEBRA
    rest = ts.simulate(scene, (solution.state.t, 3.0), integrator=I.Taylor(1e-13), state=solution.state)
    whole = ts.simulate(scene, (0.0, 3.0), integrator=I.Taylor(1e-13))
    assert np.abs(rest.q[-1] - whole.q[-1]).max() < HELD


def test_turns_are_counted():
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    wheel = scene.add_body(mass=1.0, inertia=(0.4, 0.4, 0.5), angular_velocity=(0.0, 0.0, 30.0))
    scene.add(C.Spherical(wheel, scene.ground))
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        scene.add(C.Dot1(wheel, scene.ground, axis_a=(0.0, 0.0, 1.0), axis_b=axis))
    z, x = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
    scene.add(F.TorsionalSpring(scene.ground, wheel, axis_a=z, reference_a=x, reference_b=x, stiffness=2.0))
    times = np.linspace(0.0, 5.0, 11)
    solution = ts.simulate(scene, (0.0, 5.0), integrator=I.Taylor(1e-12), t_eval=times)
    rate = np.sqrt(2.0 / 0.5)  # J angle'' = -k angle, over more than two turns
    assert np.abs(solution.angular_velocity(wheel)[:, 2] - 30.0 * np.cos(rate * times)).max() < CLOSE


def test_steps_can_be_bounded_and_fixed():
    scene, _ = load("chain_4")
    fixed = ts.simulate(scene, (0.0, 0.1), integrator=I.Taylor(step=0.004, order=6))
    assert np.allclose(fixed.steps.h, 0.004, rtol=HELD)
    assert len(fixed.t) == 26
    bounded = ts.simulate(scene, (0.0, 0.1), integrator=I.Taylor(1e-6, max_step=0.01, first_step=0.001))
    assert bounded.steps.h[0] == 0.001
    assert bounded.steps.h.max() <= 0.0101


def test_every_step_has_a_chart():
    scene, _ = load("chain_4")
    solution = ts.simulate(scene, (0.0, 0.5), integrator=I.Taylor(1e-8))
    assert len(solution.charts.t) == solution.stats.steps
    assert set(solution.charts.reason) == {"start", "step of a series"}
    assert np.array_equal(solution.charts.t, solution.t[:-1])


def test_other_formulations_are_refused():
    scene, _ = load("chain_4")
    for form in ("null-space", "maggi-kane"):
        with pytest.raises(ts.InvalidArgument, match=r"no other form than 'tangent'.*dop853"):
            ts.simulate(scene, (0.0, 1.0), integrator=I.Taylor(), formulation=form)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tol": 0.0}, "Taylor: tol"),
        ({"tol": float("nan")}, "Taylor: tol"),
        ({"order": 3}, "order must be from 4 to 30, got 3"),
        ({"order": 31}, "order must be from 4 to 30, got 31"),
        ({"order": 7.5}, "Taylor: order"),
        ({"rtol": -1.0}, "Taylor: rtol"),
        ({"step": 0.0}, "Taylor: step"),
    ],
)
def test_bad_settings(settings, message):
    with pytest.raises(ts.InvalidArgument, match=message):
        I.Taylor(**settings)


# the default method


def test_the_default_is_taylor_where_everything_has_a_series():
    scene, _ = load("chain_4")
    solution = ts.simulate(scene, (0.0, 0.1), rtol=1e-6, atol=1e-9)
    assert solution.method == "Taylor(rtol=1e-06, atol=1e-09)"
    assert ts.simulate(scene, (0.0, 0.1), formulation="null-space").method.startswith("DOP853")
    scene.add(F.CoulombFriction(scene.bodies[0], scene.ground, force=0.1))
    assert ts.simulate(scene, (0.0, 0.1)).method.startswith("Taylor")


def test_steps_follow_the_tolerance_down_to_the_limit_of_rounding():
    """1e-15 is finer than 1e-13; from 1e-12 up a step is held to a thousandth."""
    steps = [
        ts.simulate(load("two_body_pendulum_spatial")[0], (0.0, 50.0), integrator=I.Taylor(tol)).stats.steps
        for tol in (1e-12, 1e-13, 1e-15)
    ]
    assert steps[0] < steps[1] < steps[2]
    assert [I.Taylor(tol).step_tolerances()[0] for tol in (1e-8, 1e-12)] == [1e-8 / 1000.0, 1e-12 / 1000.0]
    assert I.Taylor(1e-12).refined == 0 < I.Taylor(9e-13).refined


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8, 1e10])
@pytest.mark.parametrize("tol", [1e-6, 1e-9])
def test_velocities_of_hard_springs_keep_to_the_tolerance(stiffness, tol):
    """Eight periods: orders fell, and errors of velocities rose to thousands of tolerances, in ten times the steps."""
    rate, scene = np.sqrt(stiffness), ts.Scene(gravity=(0.0, 0.0, -9.81))
    mass = scene.add_point_mass(1.0, (0.0, 0.0, 1.0))
    scene.add(F.Spring(mass, scene.ground, stiffness=stiffness))
    solution = ts.simulate(scene, (0.0, 50.0 / rate), integrator=I.Taylor(tol))
    assert solution.velocity(mass)[-1, 2] == pytest.approx(-9.81 / rate * np.sin(50.0), abs=2.0 * tol)
    assert solution.position(mass)[-1, 2] == pytest.approx(1.0 - 9.81 / stiffness * (1.0 - np.cos(50.0)), abs=tol)
    assert solution.stats.steps < 16


def test_no_tolerance_is_so_loose_that_fast_modes_grow():
    """At 10 the chain used to flail, in twice the steps."""
    counts = []
    for tol in (0.1, 10.0):
        scene = ts.Scene()
        arms = [scene.add_body(1.0, (0.01, 0.01, 0.01), position=(0.5 + i, 0.0, 0.0)) for i in range(4)]
        for a, b, at in zip(arms, [scene.ground, *arms], range(4), strict=False):
            scene.add(ts.constraints.Revolute.at(a, b, point=(at, 0.0, 0.0), axis=(0.0, 1.0, 0.0)))
            scene.add(F.TorsionalSpring(a, b, axis_a=(0.0, 1.0, 0.0), stiffness=1e5, damping=10.0))
        counts.append(ts.simulate(scene, (0.0, 0.1), integrator=I.Taylor(tol), history=False).stats.steps)
    assert counts[1] == counts[0]


def test_residuals_of_positions_do_not_walk():
    """Windows of a thousand steps: beyond the first one the residual was up to five times as large."""
    scene = load("two_body_pendulum_spatial")[0]
    solution = ts.simulate(scene, (0.0, 1000.0), integrator=I.Taylor())
    windows = solution.constraint_error.position[: solution.stats.steps // 1000 * 1000].reshape(-1, 1000)
    assert len(windows) > 20
    assert np.median(windows, axis=1).max() < 7.0 * EPS


def test_velocities_of_fast_modes_are_held_too():
    """Rates of 1e8 1/s: errors of places within the tolerance were velocities of metres a second."""
    scene, span = mounted(1e8, count=2), (0.0, 2e-6)
    demanded = ts.simulate(scene, span, integrator=I.DOP853(1e-12, 1e-12), t_eval=span).state
    state = ts.simulate(scene, span, integrator=I.Taylor(1e-6), t_eval=span).state
    np.testing.assert_allclose(state.qd, demanded.qd, rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("slices_of", [1024, 7])
def test_an_implicit_method_is_considered_again_at_times_of_the_motion_alone(slices_of, monkeypatch):
    """Not for what little seems to be left, which may change. Slices end where the clock wants it."""
    asked = []
    monkeypatch.setattr(driver, "FIRST_SLICE", slices_of)
    monkeypatch.setattr(segments.limits, "STEP_EVALUATIONS", 1e9)
    own = segments.Turns._to_implicit
    monkeypatch.setattr(
        segments.Turns, "_to_implicit", lambda self, *given: asked.append(given[1]) or own(self, *given)
    )
    ts.simulate(mounted(1e6, count=2), (0.0, 1.0), rtol=1e-6, atol=1e-6, max_steps=3000)
    assert len(asked) == 5
    assert [later / before for before, later in pairwise(asked)] == [4.0, 4.0, 4.0, 4.0]


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-4, 1e-10])
def test_an_implicit_method_takes_over_when_its_steps_have_grown(tol):
    solution = ts.simulate(mounted(1e8, count=2), (0.0, 1.0), rtol=tol, atol=tol)
    assert solution.method.startswith("Radau")
    assert solution.stats.steps < 2000


@pytest.mark.parametrize("tol", [1e-8, 1e-12, 1e-15])
def test_rows_are_selected_anew_where_kept_ones_stop_holding_an_axis_without_inertia(tol):
    """A slider-crank of thin rods, stretched at first: as the crank is upright, other rows hold it upright."""
    scene = ts.Scene()
    crank = scene.add_body(**ts.shapes.rod(0.2, axis="x", mass=1.0), position=(0.1, 0, 0))
    rod = scene.add_body(**ts.shapes.rod(0.4, axis="x", mass=2.0), position=(0.4, 0, 0))
    slider = scene.add_body(**ts.shapes.box((0.1, 0.1, 0.1), mass=3.0), position=(0.6, 0, 0))
    bodies, points = [scene.ground, crank, rod, slider], [(0, 0, 0), (0.2, 0, 0), (0.6, 0, 0)]
    hinge, *_ = (
        scene.add(C.Revolute.at(*pair, point=point, axis=(0, 0, 1)))
        for pair, point in zip(pairwise(bodies), points, strict=True)
    )
    scene.add(C.Translational.at(scene.ground, slider, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.RotationMotor.of(hinge, angle=2.0 * ts.motions.time))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 3.5), integrator=I.Taylor(tol)).raise_if_failed()
    assert solution.constraint_error.acceleration.max() < FINE


@pytest.mark.parametrize("tol", [1e-8, 1e-11])
def test_a_pendulum_in_nanometres_is_as_accurate_as_in_metres(tol):
    """Floors of the absolute tolerance were lengths in m: in small units steps were too long."""
    runs = []
    for unit in (1.0, 1e-9):
        scene = ts.Scene(gravity=(0.0, 0.0, -9.81 * unit))
        bob = scene.add_point_mass(mass=1.0, position=(unit, 0.0, 0.0))
        scene.add(ts.constraints.Distance(bob, scene.ground))
        run = ts.simulate(scene, (0.0, 5.0), integrator=I.Taylor(rtol=tol, atol=tol * unit))
        runs.append((run.stats.steps, run.q[-1] / unit))
    (steps, place), (others, other) = runs
    assert abs(steps - others) <= 1
    assert np.abs(place - other).max() < 10.0 * tol
