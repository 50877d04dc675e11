"""Contacts beside friction of joints: each is decided with what the other one does, in closed form."""

import numpy as np
import pytest

import tsdyn as ts

C, F = ts.constraints, ts.forces
G = 9.81


def arm():
    """A horizontal arm of 2 kg, its centre 0.5 m beside a pin along y: 0.7 kg m^2 about the pin."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(2.0, (0.01, 0.2, 0.2), position=(0.5, 0, 0), name="arm")
    scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    return scene, body


def seat(torque):
    """A ball of 1 kg on the tip of the arm, which a brake holds: the tip would fall faster than the ball."""
    scene, body = arm()
    scene.add(F.CoulombFriction(body, scene.ground, torque=torque, name="brake"))
    ball = scene.add_point_mass(1.0, position=(1.0, 0, 0), name="ball")
    scene.add(C.PlaneContact(ball, body, point_b=(0.5, 0, 0), normal_b=(0, 0, 1), unilateral=True, name="seat"))
    return scene


def test_a_ball_stays_on_an_arm_that_a_brake_holds():
    """The brake carries (2 * 0.5 + 1 * 1) g = 19.62 N m."""
    solution = ts.simulate(seat(20.0), (0, 1))
    assert solution.phases == [(0.0, 1.0, ("seat", "brake"))]
    assert np.ptp(solution.q, axis=0).max() < 1e-15
    np.testing.assert_allclose(solution.reaction("seat")[0][-1], [0, 0, G], rtol=1e-13)
    np.testing.assert_allclose(solution.reaction("brake")[1][-1], [0, -2 * G, 0], rtol=1e-13)


@pytest.mark.parametrize("torque", [5.0, 15.0])
def test_a_ball_on_an_arm_that_slips(torque):
    """The tip falls with (2 g - torque) / (0.7 + 1), less than g: the ball goes with it."""
    scene = seat(torque)
    solution = ts.simulate(scene, (0, 0.1))
    assert solution.phases == [(0.0, 0.1, ("seat",))]
    begin, rate = scene.evaluate(), (2 * G - torque) / 1.7
    np.testing.assert_allclose(solution.acceleration("ball")[0], [0, 0, -rate], atol=1e-12)
    np.testing.assert_allclose(solution.reaction("seat")[0][0], [0, 0, G - rate], rtol=1e-12)
    np.testing.assert_allclose(begin.qdd[-1], -rate, rtol=1e-12)
    lost = solution.energy[0] - solution.energy[-1]
    np.testing.assert_allclose(lost, torque * abs(solution.angle("pin")[-1]), rtol=1e-9)


def test_an_inactive_brake_holds_nothing():
    """The tip would fall with 1 / 0.7 g, faster than the ball: the seat opens."""
    scene = seat(20.0)
    scene.deactivate("brake")
    solution = ts.simulate(scene, (0, 0.1))
    np.testing.assert_allclose(solution.acceleration("ball")[0], [0, 0, -G], rtol=1e-13)
    np.testing.assert_allclose(solution.reaction("seat")[0], 0.0, atol=1e-13)


@pytest.mark.parametrize("kinetic", [0.01, 1.0, 20.0])
def test_an_arm_with_a_rough_pin_on_a_stop(kinetic):
    """At its tip: the floor carries what the load leaves of 9.81 N, the pin nothing; a pin that holds it stays."""
    scene, body = arm()
    scene.add(F.RevoluteFriction(scene["pin"], radius=0.1, kinetic=kinetic, name="rough"))
    scene.add(
        C.PlaneContact(body, scene.ground, point_a=(0.5, 0, 0), normal_b=(0, 0, 1), unilateral=True, name="floor")
    )
    lift = scene.add(F.PointForce(body, point_a=(0.5, 0, 0), force=(0, 0, 8.0), name="lift"))
    solution = ts.simulate(scene, (0, 0.2))
    assert solution.phases == [(0.0, 0.2, ("floor", "rough"))]
    np.testing.assert_allclose(solution.reaction("floor")[0][-1], [0, 0, G - 8.0], rtol=1e-12)
    assert not solution.reaction("rough")[1].any()
    lift.force = (0, 0, 12.0)
    solution = ts.simulate(scene, (0, 0.2))
    load = 2 * G - 12.0  # of the pin, at rest
    if 0.1 * kinetic * abs(load) > 12.0 - G:
        assert solution.phases == [(0.0, 0.2, ("floor", "rough"))]
        np.testing.assert_allclose(solution.reaction("rough")[1][-1], [0, 12.0 - G, 0], rtol=1e-12)
    else:
        assert solution.phases == [(0.0, 0.2, ())]
        assert solution.angle("pin")[-1] < 0.0


def test_friction_of_joints_is_refused_on_contacts_that_open():
    scene = ts.Scene()
    block = scene.add_point_mass(mass=1.0, name="block")
    floor = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor"))
    with pytest.raises(ts.InvalidForce, match=r"'floor' opens and closes, .*set kinetic and static there"):
        scene.add(ts.forces.ContactFriction(floor, kinetic=0.3))
    floor.unilateral = False
    scene.add(ts.forces.ContactFriction(floor, kinetic=0.3, name="brake"))
    with pytest.raises(ts.InvalidConstraint, match="'brake' is friction of a contact that doesn't open; remove it"):
        floor.unilateral = True
    assert not floor.unilateral
