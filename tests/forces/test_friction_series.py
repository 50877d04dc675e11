"""Series of friction laws: against DOP853, and where a reversal hides from them."""

import numpy as np
import pytest

import tsdyn as ts

C, F, I = ts.constraints, ts.forces, ts.integrators


def pendulum(slip, torque=0.5, links=1):
    """Links that start horizontal, with friction of constant torque in their pins."""
    scene, last = ts.Scene(gravity=(0, 0, -10)), None
    for i in range(links):
        link = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(i + 0.5, 0, 0))
        before = last or scene.ground
        scene.add(C.Revolute.at(before, link, point=(i, 0, 0), axis=(0, 1, 0)))
        scene.add(F.CoulombFriction(link, before, torque=torque, slip_rate=slip))
        last = link
    return scene


def oscillator(slip):
    """A mass on a spring with friction; its velocity reverses every pi / 2 s."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(mass=1.0, position=(2, 0, 0))
    scene.add(F.Spring(mass, scene.ground, stiffness=4.0, free_length=1.0))
    scene.add(F.CoulombFriction(mass, scene.ground, force=0.3, slip_velocity=slip))
    return scene


def test_the_series_of_coulomb_friction_is_that_of_its_law():
    ts.testing.check_force(F.CoulombFriction)


def test_friction_by_series_is_that_by_stages():
    scene = pendulum(0.1)
    one, other = (ts.simulate(scene, (0, 2), integrator=kind(rtol=1e-13, atol=1e-13)) for kind in (I.Taylor, I.DOP853))
    assert np.abs(one.state.q - other.state.q).max() < 1e-12
    assert one.constraint_error.position.max() < 1e-14


@pytest.mark.parametrize("tol", [1e-6, 1e-8])
def test_a_reversal_within_a_step_is_not_missed(tol):
    """Where v is 1 m/s, the law differs from constant friction by a part in 10^6, and is reversed in the next step."""
    solution = ts.simulate(oscillator(1e-3), (0, 5), integrator=I.Taylor(tol))
    exact = ts.simulate(oscillator(1e-3), (0, 5), integrator=I.DOP853(rtol=1e-12, atol=1e-12))
    assert solution.stats.rejected > 0
    assert np.abs(solution.state.q - exact.state.q).max() < 2 * tol


def test_the_default_method_is_the_one_that_is_quicker():
    assert ts.simulate(pendulum(0.1), (0, 0.1)).method.startswith("Taylor")
    assert ts.simulate(oscillator(0.1), (0, 0.1)).method.startswith("DOP853")  # nothing to be solved for


def test_a_pin_that_sticks_creeps_at_its_slip_velocity():
    scene = pendulum(1e-3, torque=20.0)  # 5 N m of weight
    solution = ts.simulate(scene, (0, 1))
    rate = np.linalg.norm(solution.state.angular_velocity(scene.bodies[0]))
    assert rate == pytest.approx(1e-3 * 0.25 / np.sqrt(1.0 - 0.25**2), rel=1e-3)
