"""Ratchets: joints that turn or slide one way only."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import FINE, NEAR

C = ts.constraints
METHODS = one_of_each(tol=1e-11, step=1e-3)


def driven(**options):
    """A wheel of 2 kg m^2 under a torque of cos(t), N m."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2.0), name="wheel")
    scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(ts.forces.Torque(wheel, torque=lambda t: (0.0, 0.0, np.cos(t)), name="drive"))
    scene.add(C.Ratchet(scene["hinge"], name="ratchet", **options))
    return scene


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("method", METHODS)
def test_a_wheel_on_a_freewheel(method):
    """It goes until its rate vanishes at pi, rests as long as the torque is negative, and goes on from 3 pi / 2."""
    times = [np.pi / 2, 1.25 * np.pi, 2 * np.pi]
    solution = ts.simulate(driven(), (0.0, 2 * np.pi), t_eval=times, **METHODS[method]).raise_if_failed()
    angle = np.array((1.0, 2.0, 2.0 + np.pi / 2 - 1.0)) / 2.0
    assert np.abs(solution.angle("hinge") - angle).max() < 1e-7
    assert np.abs(solution.angle_rate("hinge") - (0.5, 0.0, 0.5)).max() < 1e-7
    _, torque = solution.reaction("ratchet")
    assert np.abs(torque[:, 2] - (0.0, -np.cos(1.25 * np.pi), 0.0)).max() < NEAR
    (_, free, _), (held, again, names), _ = solution.phases
    assert names == ("ratchet",)
    assert abs(free - np.pi) < 1e-7
    assert free == held
    assert abs(again - 1.5 * np.pi) < FINE
    assert solution.impulses == []


def test_a_crank_stays_where_it_comes_to_rest():
    """Thrown up with 2 rad/s by 2 kg m^2, 1 kg at 1 m: J w^2 / 2 = m g h."""
    scene = ts.Scene(gravity=(0, 0, -10))
    crank = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0), name="crank")
    hinge = scene.add(C.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, -1, 0)))
    scene.set(hinge, rate=2.0)
    scene.add(C.Ratchet(hinge, name="ratchet"))
    solution = ts.simulate(scene, (0, 1000), rtol=1e-12, atol=1e-12)
    rest = np.arcsin(0.4)
    angle = solution.angle(hinge)[solution.t >= solution.phases[1][0]]
    assert np.abs(angle - rest).max() < FINE
    assert np.ptp(angle) < 1e-11
    assert np.abs(solution.reaction("ratchet", on=crank)[1][-1] - (0, -10.0 * np.cos(rest), 0)).max() < FINE
    assert len(solution.phases) == 2


@pytest.mark.parametrize(("direction", "back"), [(1, 6.0), (-1, 4.0)])
def test_a_slide_is_hit(direction, back):
    """A ball of 1 kg at 3 m/s against 2 kg, elastic: held by the ratchet it takes 6 N s, else 2 m v / (1 + m / M)."""
    scene = ts.Scene(gravity=(0, 0, 0))
    block = scene.add_body(mass=2.0, inertia=(1, 1, 1), name="block")
    rail = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="rail"))
    ball = scene.add_point_mass(mass=1.0, position=(2, 0, 0), velocity=(-3, 0, 0), name="ball")
    scene.add(C.SphereContact(ball, block, radius_a=0.1, radius_b=0.5, restitution=1.0, name="hit"))
    scene.add(C.Ratchet(rail, direction, name="pawl"))
    solution = ts.simulate(scene, (0, 1))
    impulses = {name: impulse for _, name, impulse in solution.impulses}
    assert abs(impulses["hit"] - back) < FINE
    assert ("pawl" in impulses) == (direction == 1)
    assert np.abs(solution.state.velocity(ball)[0] - (back - 3.0)) < FINE
    assert np.abs(solution.state.velocity(block)[0] + (0.0 if direction == 1 else 2.0)) < FINE


def test_an_impulse_of_the_users_and_a_start_against_the_direction():
    scene = driven()
    scene.remove("drive")
    scene.set("hinge", rate=-3.0)
    solution = ts.simulate(scene, (0, 1))
    assert abs(solution.angle_rate("hinge")[-1]) < FINE
    assert [(t, name) for t, name, _ in solution.impulses] == [(0.0, "ratchet")]
    assert abs(solution.impulses[0][2] - 6.0) < FINE
    scene.set("hinge", rate=3.0)

    def event(t, state):
        return t - 0.5

    def brake(change):
        change.impulse("wheel", (-1.0, 0, 0))  # through the axis: nothing turns
        change.set("wheel.inertia", (2, 2, 3))

    event.action = brake
    solution = ts.simulate(scene, (0, 1), events=event)
    assert abs(solution.angle("hinge")[-1] - 3.0) < FINE


def test_files_analyses_and_what_cant_be(tmp_path):
    scene = driven()
    scene.remove("drive")
    scene.set("hinge", rate=1.0)
    assert scene.mobility().degrees_of_freedom == 1
    scene.save(tmp_path / "wheel.toml")
    again = ts.load(tmp_path / "wheel.toml")
    assert (again["ratchet"].joint.name, again["ratchet"].direction) == ("hinge", 1)
    assert abs(ts.simulate(again, (0, 1)).angle("hinge")[-1] - 1.0) < FINE
    with pytest.raises(ts.InvalidConstraint, match="direction must be 1 or -1"):
        C.Ratchet(scene["hinge"], 0)
    with pytest.raises(ts.InvalidConstraint, match="an angle or a displacement"):
        C.Ratchet(scene.add(C.PlaneContact(scene["wheel"], scene.ground, normal_b=(0, 0, 1))))


def test_of_a_joint_with_both_coordinates_the_one_that_is_named():
    """Against the ratchet's direction the body stops at once along one coordinate, and goes on along the other."""
    for which, (v, w) in ((), (-1.0, 0.0)), (("angle",), (-1.0, 0.0)), (("displacement",), (0.0, -2.0)):
        scene = ts.Scene(gravity=(0, 0, 0))
        rod = scene.add_body(1.0, (0.1, 0.1, 0.1), velocity=(0, 0, -1), angular_velocity=(0, 0, -2), name="rod")
        sleeve = scene.add(C.Cylindrical(scene.ground, rod, axis_a=(0, 0, 1), axis_b=(0, 0, 1), name="sleeve"))
        scene.add(C.Ratchet((sleeve, *which) if which else sleeve))
        solution = ts.simulate(scene, (0, 1))
        np.testing.assert_allclose(solution.displacement("sleeve")[-1], v, atol=1e-14)
        np.testing.assert_allclose(solution.angle("sleeve")[-1], w, atol=1e-14)
