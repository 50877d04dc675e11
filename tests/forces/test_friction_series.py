"""Series of friction laws: against DOP853, and where a reversal hides from them."""

import numpy as np
import pytest

import tsdyn as ts

C, F, I = ts.constraints, ts.forces, ts.integrators


def pendulum(slip, torque=0.5):
    """A link that starts horizontal, with friction of constant torque in its pin."""
    scene = ts.Scene(gravity=(0, 0, -10))
    link = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.5, 0, 0))
    scene.add(C.Revolute.at(scene.ground, link, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(F.CoulombFriction(link, scene.ground, torque=torque, slip_rate=slip))
    return scene


def oscillator(slip):
    """A mass on a spring with friction; its velocity reverses every pi / 2 s."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(mass=1.0, position=(2, 0, 0))
    scene.add(F.Spring(mass, scene.ground, stiffness=4.0, free_length=1.0))
    scene.add(F.CoulombFriction(mass, scene.ground, force=0.3, slip_velocity=slip))
    return scene


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
