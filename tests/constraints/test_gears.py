"""Screws, racks and gears over many turns, against closed forms, by every method."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.driven import METHODS, apart, held, loose, pair, turn
from tests.helpers.tolerances import CLOSE, EPS, FAIR, NEAR, ROUGH, TIGHT

X, Y, Z = np.eye(3)
C, M = ts.constraints, ts.motions


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("lead", [0.05, -0.3])
def test_a_screw_over_many_turns(lead, options):
    """Falls by its weight: g = (lead + J / (m lead)) theta''; the travel stays with the turn over full turns."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    start = 0.3
    screw = scene.add_body(2.0, (0.2, 0.2, 0.002), (0, 0, start), (np.cos(0.2), 0, 0, np.sin(0.2)), name="screw")
    joint = scene.add(C.Screw.at(scene.ground, screw, point_a=(0, 0, 0), point_b=(0, 0, start), axis=Z, lead=lead))
    assert np.abs(scene.evaluate().Phi).max() < 4 * EPS
    solution = ts.simulate(scene, (0.0, 2.0), t_eval=np.linspace(0.0, 2.0, 81), **options)
    held(solution)
    gain = -9.81 * lead / (lead**2 + 0.002 / 2.0)
    theta = gain * solution.t**2 / 2
    assert abs(theta[-1]) > 40.0
    np.testing.assert_allclose(solution.position(screw)[:, 2], start + lead * theta, atol=NEAR * loose(options))
    assert apart(turn(solution, screw), 0.4 + (solution.position(screw)[:, 2] - start) / lead).max() < TIGHT
    force, torque = solution.reaction(joint, on=screw)
    np.testing.assert_allclose(torque[:, 2], 0.002 * gain, rtol=FAIR * loose(options))
    np.testing.assert_allclose(force[:, 2], 2.0 * (9.81 + lead * gain), rtol=FAIR * loose(options))


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_rack_drives_its_pinion(options):
    """(m + J / r^2) x'' = force, the rack sliding in the ground and the pinion turning there."""
    radius, force, mass = 0.06, 3.0, 1.5
    scene = ts.Scene(gravity=(0, 0, 0))
    rack = scene.add_body(mass, (0.1, 0.1, 0.1), name="rack")
    pinion = scene.add_body(0.8, (0.001, 0.001, 0.0015), (0.1, radius, 0), name="pinion")
    scene.add(C.Translational.at(scene.ground, rack, point=(0, 0, 0), axis=X, name="guide"))
    scene.add(C.Revolute.at(scene.ground, pinion, point=pinion.position, axis=Z, name="bearing"))
    teeth = scene.add(
        C.RackAndPinion.at(rack, pinion, point_b=pinion.position, axis=-Z, direction=X, radius=radius, name="teeth")
    )
    assert abs(teeth.parts[0].lead - radius) < EPS
    scene.add(ts.forces.PointForce(rack, force=(force, 0, 0)))
    solution = ts.simulate(scene, (0.0, 1.5), t_eval=np.linspace(0.0, 1.5, 61), **options)
    held(solution)
    gain = force / (mass + 0.0015 / radius**2)
    x = gain * solution.t**2 / 2
    np.testing.assert_allclose(solution.position(rack)[:, 0], x, atol=NEAR * loose(options))
    assert x[-1] / radius > 12.0
    # rolling: the rack passes under the wheel to +x, so the wheel turns about +z
    assert apart(turn(solution, pinion), solution.position(rack)[:, 0] / radius).max() < TIGHT


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("ratio", [-math.sqrt(2.0), 0.37])
def test_a_gear_pair_over_many_turns(ratio, options):
    """(J1 + ratio^2 J2) theta'' = torque, for a ratio that is no fraction."""
    scene, one, other, gear = pair(ratio)
    torque = 1.5
    scene.add(ts.forces.Torque(one, torque=(0, 0, torque)))
    solution = ts.simulate(scene, (0.0, 1.2), t_eval=np.linspace(0.0, 1.2, 61), **options)
    held(solution)
    gain = torque / (0.02 + ratio**2 * 0.05)
    theta = 5.0 * solution.t + gain * solution.t**2 / 2
    assert theta[-1] > 12.0
    assert apart(turn(solution, one), theta).max() < FAIR * loose(options)
    assert apart(turn(solution, other), ratio * np.unwrap(turn(solution, one))).max() < TIGHT
    _, through = solution.reaction(gear, on=other)
    np.testing.assert_allclose(through[:, 2], 0.05 * ratio * gain, rtol=ROUGH * loose(options))


def test_a_planet_gear_needs_its_line_of_centres_only():
    """Turns against a carrier that turns itself, free of torque: the ratio holds against the carrier."""
    scene, one, other, _ = pair(-0.75, 3.0)
    solution = ts.simulate(scene, (0.0, 4.0), rtol=1e-11, atol=1e-11, t_eval=np.linspace(0, 4, 201))
    held(solution)
    carrier = solution.scene.body("carrier")
    angles = [np.unwrap(turn(solution, body)) for body in (carrier, one, other)]
    assert np.ptp(angles[1]) > 25.0
    np.testing.assert_allclose(angles[2] - angles[0], -0.75 * (angles[1] - angles[0]), atol=TIGHT)
    assert np.ptp(solution.energy) < CLOSE * solution.energy[0]


def test_a_gear_goes_on_from_a_state_with_its_turns():
    scene, one, *_ = pair(-math.sqrt(2.0))
    first = ts.simulate(scene, (0.0, 2.0), integrator="dop853", rtol=1e-10, atol=1e-10)
    on = ts.simulate(scene, (2.0, 3.0), state=first.state, integrator="dop853", rtol=1e-10, atol=1e-10)
    held(on)
    assert apart(turn(on, one), 5.0 * on.t).max() < FAIR
    dense = ts.simulate(scene, (0.0, 3.0), dense_output=True, rtol=1e-11, atol=1e-11)
    state = dense.at(np.linspace(0.0, 3.0, 40))
    ends = 2.0 * np.arctan2(state.q[:, [6, 13]], state.q[:, [3, 10]])
    assert apart(ends[:, 0], 5.0 * state.t).max() < CLOSE
    assert apart(ends[:, 1], -math.sqrt(2.0) * 5.0 * state.t).max() < CLOSE
