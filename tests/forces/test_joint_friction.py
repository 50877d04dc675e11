"""Friction of joints and contacts that follows from their reactions: closed forms, balances, every method."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.rough_joints import (
    PRECISE,
    G,
    block,
    chain,
    coefficient,
    demand_balance,
    four_bar,
    pendulum,
    pendulum_rates,
    slide,
)
from tests.helpers.tolerances import ALGEBRA, CLOSE, FAIR, FINE, HELD, NEAR, TIGHT

C, F = ts.constraints, ts.forces


@pytest.mark.slow_but("taylor-*")
@pytest.mark.parametrize(
    ("method", "formulation"),
    [("taylor", "tangent"), ("dop853", "tangent"), ("dop853", "null-space"), ("dop853", "maggi-kane")],
)
def test_a_block_on_a_slope_brakes_as_it_should(method, formulation):
    scene, body, contact, friction, along = block(0.3, 0.5, 3.0, slip_velocity=1e-7)
    solution = ts.simulate(scene, (0.0, 0.4), formulation=formulation, **PRECISE | {"integrator": method})
    rate = -G * (np.sin(0.5) + 0.3 * np.cos(0.5))
    assert solution.success
    np.testing.assert_allclose(solution.position(body)[-1], (3.0 * 0.4 + rate * 0.08) * along, atol=HELD)
    force, torque = solution.reaction(friction)
    np.testing.assert_allclose(force, np.broadcast_to(-0.3 * 2 * G * np.cos(0.5) * along, force.shape), rtol=HELD)
    assert not torque.any()
    np.testing.assert_allclose(solution.dissipation, -(force * solution.velocity(body)).sum(axis=1), rtol=HELD)
    assert np.abs(solution.power).max() < ALGEBRA
    demand_balance(scene, solution, (contact, friction))


@pytest.mark.slow
def test_a_block_that_sticks_creeps_at_the_speed_of_the_regularisation():
    scene, body, _, _, along = block(0.8, 0.5, slip_velocity=1e-3)
    solution = ts.simulate(scene, (0.0, 2.0))
    assert solution.success
    assert "Radau" in solution.method
    ratio = np.tan(0.5) / 0.8
    creep = 1e-3 * ratio / np.sqrt(1.0 - ratio**2)
    np.testing.assert_allclose(solution.velocity(body)[-1], -creep * along, atol=CLOSE)


@pytest.mark.slow
def test_stribecks_peak():
    """Held up to the static coefficient, and braked by the kinetic one when it slides."""
    given = {"static": 0.7, "slip_velocity": 1e-5, "stribeck_velocity": 1e-2}
    for angle, slides in ((np.arctan(0.68), False), (np.arctan(0.72), True)):
        scene, body, _, friction, _ = block(0.3, angle, **given)
        solution = ts.simulate(scene, (0.0, 1.0))
        speed = np.linalg.norm(solution.velocity(body)[-1])
        assert solution.success
        assert (speed > 1.0) == slides
        if slides:
            size = np.linalg.norm(solution.reaction(friction)[0][-1])
            assert size == pytest.approx(0.3 * 2 * G * np.cos(angle), rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_a_pendulum_on_a_rough_pin(formulation):
    """Against minimal coordinates in SciPy: it comes to rest, through many turns of the direction."""
    scene, bar, pin, friction = pendulum()
    solution = ts.simulate(scene, (0.0, 3.0), formulation=formulation, **PRECISE)
    angle, rate = solve_ivp(pendulum_rates, (0, 3), (0, 0), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(solution.position(bar)[-1], (0.8 * np.cos(angle), 0, -0.8 * np.sin(angle)), atol=FINE)
    np.testing.assert_allclose(solution.angular_velocity(bar)[-1], (0, rate, 0), atol=FINE)
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max()) < ALGEBRA
    assert errors.acceleration.max() < HELD
    F_pin, _ = solution.reaction(pin)
    v = 0.05 * solution.angular_velocity(bar)[:, 1]
    torque = -0.05 * coefficient(v, 0.3, 0.4, 0.05, 0.01) * np.hypot(F_pin[:, 0], F_pin[:, 2])
    np.testing.assert_allclose(solution.reaction(friction)[1][:, 1], torque, atol=HELD)
    demand_balance(scene, solution, (pin, friction))


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-4, 1e-7, 1e-10])
def test_loads_of_explicit_stages_are_as_exact_as_the_steps(tol):
    """Against minimal coordinates in SciPy; S is factorised where a step ends, and not at its stages."""
    scene, bar, *_ = pendulum()
    solution = ts.simulate(scene, (0.0, 1.0), integrator=ts.integrators.DOP853(tol, tol))
    angle, rate = solve_ivp(pendulum_rates, (0, 1), (0, 0), method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(solution.position(bar)[-1], (0.8 * np.cos(angle), 0, -0.8 * np.sin(angle)), atol=tol)
    np.testing.assert_allclose(solution.angular_velocity(bar)[-1], (0, rate, 0), atol=10.0 * tol)
    assert 3 * solution.stats.factorizations < solution.stats.evaluations
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max()) < ALGEBRA
    assert errors.acceleration.max() < HELD


@pytest.mark.slow
def test_implicit_and_fixed_steps_and_dense_output_agree():
    scene, _bar, *_ = pendulum()
    exact = ts.simulate(scene, (0.0, 1.0), dense_output=True, **PRECISE)
    for method in (
        ts.integrators.SDIRK54(1e-9, 1e-9),
        ts.integrators.Nystrom4(step=1e-3),
        ts.integrators.RK45(1e-9, 1e-9),
    ):
        solution = ts.simulate(scene, (0.0, 1.0), integrator=method)
        assert np.abs(solution.q[-1] - exact.q[-1]).max() < NEAR
    np.testing.assert_allclose(exact.energy - exact.work, exact.energy[0], atol=CLOSE)
    state = exact.at(0.5)
    again = ts.simulate(scene, (0.5, 1.0), state=state, **PRECISE)
    np.testing.assert_allclose(again.q[-1], exact.q[-1], atol=FINE)
    np.testing.assert_allclose(again.multipliers[0], state.multipliers, atol=TIGHT)


@pytest.mark.slow_but("0.5-0.4-taylor-*")
@pytest.mark.parametrize(
    ("method", "formulation"), [("taylor", "tangent"), ("dop853", "tangent"), ("dop853", "null-space")]
)
@pytest.mark.parametrize(("length", "width"), [(None, None), (0.5, None), (None, 0.4), (0.5, 0.4)])
def test_a_slide_that_is_tilted_in_its_guide(length, width, method, formulation):
    """Torques of the load at (0, 0.2, 0.3): 0.2 * 4 about x, 0.3 * 6 about y, -0.2 * 6 about z."""
    scene, body, guide, friction = slide(length, width)
    N = 2.0 * G - 4.0
    N += 0.0 if width is None else 0.8 / width
    N += 0.0 if length is None else 2.0 / length * np.hypot(1.8, 1.2)
    acceleration = (6.0 - 0.25 * N) / 2.0
    end = min(0.5, 0.9 * 1.5 / max(-acceleration, 1e-9))  # while it slides on
    solution = ts.simulate(scene, (0.0, end), formulation=formulation, **PRECISE | {"integrator": method})
    np.testing.assert_allclose(solution.position(body)[-1, 0], 1.5 * end + 0.5 * acceleration * end**2, atol=TIGHT)
    np.testing.assert_allclose(solution.reaction(friction)[0][:, 0], -0.25 * N, rtol=TIGHT)
    demand_balance(scene, solution, (guide, friction, *scene.forces[1:]))


@pytest.mark.slow
def test_the_collar_and_the_length_of_a_pin():
    """A wheel on a horizontal shaft: its weight across, a push along, and a torque that tilts."""
    scene = ts.Scene()
    wheel = scene.add_body(3.0, (0.2, 0.2, 0.1), angular_velocity=(0, 0, 20.0), name="wheel")
    wheel.orientation = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)  # its z along -y
    shaft = scene.add(C.Revolute.at(wheel, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    friction = scene.add(
        F.RevoluteFriction(
            shaft, radius=0.02, kinetic=0.1, collar_radius=0.03, length=0.1, preload=5.0, slip_velocity=1e-9
        )
    )
    scene.add(F.PointForce(wheel, force=(0, 7.0, 0)))
    scene.add(F.Torque(wheel, torque=(0.4, 0, 0)))
    N = 5.0 + 3.0 * G + 1.5 * 7.0 + 20.0 * 0.4
    solution = ts.simulate(scene, (0.0, 1.0), **PRECISE)
    np.testing.assert_allclose(solution.angular_velocity(wheel)[-1], (0, 0, 20.0 - 0.1 * 0.02 * N / 0.1), atol=FINE)
    assert np.linalg.norm(solution.reaction(friction)[1][-1]) == pytest.approx(0.1 * 0.02 * N, rel=HELD)


@pytest.mark.slow
def test_many_rough_joints_against_the_equations_in_numpy():
    """The solver's accelerations and reactions against `evaluate`, which solves the dense equations by its own code."""
    scene, joints = chain(6)
    every = {}
    for formulation in ("tangent", "null-space"):
        solution = every[formulation] = ts.simulate(
            scene, (0.0, 0.3), formulation=formulation, integrator="dop853", rtol=1e-9, atol=1e-9
        )
        for k in range(0, solution.t.size, 7):
            seen = scene.evaluate(solution.q[k], solution.qd[k], solution.t[k])
            scale = np.abs(seen.qdd).max()
            np.testing.assert_allclose(solution.qdd[k], seen.qdd, atol=TIGHT * scale)
            np.testing.assert_allclose(solution.multipliers[k], seen.multipliers, atol=TIGHT * scale)
        demand_balance(scene, solution, (*joints, *scene.forces), tol=1e-10)
    last = [solution.q[-1] for solution in every.values()]
    np.testing.assert_allclose(*last, atol=FAIR)


@pytest.mark.slow
def test_evaluate_of_a_large_scene():
    scene, _ = chain(150)
    seen = scene.evaluate()
    solution = ts.simulate(scene, (0.0, 1e-4), integrator="rk45", max_steps=1)
    scale = np.abs(seen.qdd).max()
    np.testing.assert_allclose(solution.qdd[0], seen.qdd, atol=FINE * scale)
    residual = seen.M @ seen.qdd + seen.Phi_q.T @ seen.multipliers - seen.Q_A - seen.S
    assert np.abs(residual).max() < CLOSE * scale


@pytest.mark.slow
def test_redundant_constraints_whose_needed_reactions_are_unique():
    scene, joints = four_bar()
    solution = ts.simulate(scene, (0.0, 1.0), dense_output=True, **PRECISE)
    assert solution.success
    assert not solution.reaction_unique(joints[0]).any()
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=NEAR)
    other = ts.simulate(scene, (0.0, 1.0), formulation="null-space", **PRECISE)
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=CLOSE)
    seen = scene.evaluate(solution.q[3], solution.qd[3], solution.t[3])
    np.testing.assert_allclose(seen.qdd, solution.qdd[3], atol=CLOSE)
