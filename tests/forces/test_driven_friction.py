"""Friction of joints that motors move: against the motion, after each reversal; none while the motor rests."""

import numpy as np
import pytest
from scipy.interpolate import PPoly

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, HELD

C, F = ts.constraints, ts.forces
G = 9.81


def arm(motion, rate):
    """2 kg, half a metre beside a rough pin along y that a motor turns."""
    scene = ts.Scene()
    body = scene.add_body(2.0, (0.1, 0.2, 0.3), (0.5, 0, 0), name="arm")
    pin = scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    scene.add(F.RevoluteFriction(pin, radius=0.05, kinetic=0.3, static=0.4, name="rub"))
    scene.add(C.RotationMotor.of(pin, angle=motion, name="motor"))
    scene.set("pin", angle=0.0, rate=rate)
    return scene


def demand_friction(solution, slow):
    """The friction is mu R N against the rate, of what turns faster than `slow`, rad/s."""
    w, torque = solution.angle_rate("pin"), solution.reaction("rub", on=solution.scene["arm"])[1][:, 1]
    N = 2.0 * np.linalg.norm((solution.acceleration("arm") + np.array((0, 0, G)))[:, [0, 2]], axis=1)
    moves = np.abs(w) > slow
    np.testing.assert_allclose(torque[moves], (-np.sign(w) * 0.3 * 0.05 * N)[moves], rtol=0, atol=HELD)


def cubic(t):
    """Stands still at 1 s, where acceleration is zero, too."""
    return 0.3 * (t - 1.0) ** 3 + 0.3


@pytest.mark.slow_for("*null-space*")
@pytest.mark.parametrize(
    ("motion", "rate"), [(ts.motions.Sine(0.5, 2.0), 1.0), (cubic, 0.9)], ids=["to and fro", "an inflection"]
)
@pytest.mark.parametrize("given", [{}, {"integrator": "dop853"}, {"formulation": "null-space"}], ids=str)
def test_friction_is_against_the_motion_after_each_reversal(motion, rate, given):
    """Three reversals in 5 s, or none, but a rate of zero."""
    solution = ts.simulate(arm(motion, rate), (0, 5), **given)
    assert solution.success
    demand_friction(solution, 1e-7)


def test_a_motor_that_rests_has_no_friction_to_overcome():
    """From rest to rest between 1 and 2 s: the pin sticks before and after, and the motor carries the load alone."""
    smooth = 0.3 * np.array([[0, 0, 0, 0, 0, 0], [6, -15, 10, 0, 0, 0], [0, 0, 0, 0, 0, 1]]).T
    solution = ts.simulate(arm(PPoly(smooth, [0, 1, 2, 4]), 0.0), (0, 4), dense_output=True, rtol=1e-11, atol=1e-11)
    (_, first, rests), (_, last, moves), (_, _, again) = solution.phases
    assert (rests, moves, again) == (("rub",), (), ("rub",))
    assert 1.0 < first < 1.001
    assert last == pytest.approx(2.0, abs=1e-5)
    still = solution.at([0.5, 3.0])
    torques = [state.reaction("motor", on="arm")[1][1] for state in (solution.at(0.5), solution.at(3.0))]
    np.testing.assert_allclose(torques, -2.0 * G * (still.position("arm")[:, 0]), rtol=0, atol=CLOSE)
    demand_friction(solution, 1e-7)
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=CLOSE)
