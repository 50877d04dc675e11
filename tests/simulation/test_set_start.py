"""`scene.set_start`: a state, or the velocity of the whole, as the start of a scene."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import FAIR, HELD

G = 10.0


def cart():
    """A body on two springs along vertical guides, which stands 0.1 m below their free length at rest."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_body(mass=2.0, inertia=(0.1, 0.2, 0.3), position=(0, 0, 1), name="block")
    scene.add(ts.constraints.Translational.at(scene.ground, block, point=(0, 0, 1), axis=(0, 0, 1), name="guide"))
    scene.add(ts.forces.Spring(block, scene.ground, stiffness=200.0, free_length=1.0, damping=1.0, name="spring"))
    return scene


def wheel():
    scene = ts.Scene(gravity=(0, 0, 0))
    disc = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.2), name="disc")
    scene.add(ts.constraints.Revolute.at(scene.ground, disc, point=(0, 0, 0), axis=(0, 0, 1), name="axle"))
    return scene


def linkage():
    """Two rods on a hinge, free in space, and a point mass."""
    scene = ts.Scene(gravity=(0, 0, 0))
    a = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(0.5, 1, 0), name="a")
    turned = (np.cos(0.4), 0.0, np.sin(0.4), 0.0)
    far = np.array([1.0, 1.0, 0.0]) + 0.5 * np.array([np.cos(0.8), 0.0, -np.sin(0.8)])
    b = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=far, orientation=turned, name="b")
    scene.add(ts.constraints.Revolute.at(a, b, point=(1, 1, 0), axis=(0, 1, 0), name="hinge"))
    scene.add_point_mass(0.5, position=(0, 0, 2), name="c")
    return scene


def test_an_equilibrium_is_the_start():
    """The spring carries m g: 1 - 20 / 200 = 0.9 m; a run stays there."""
    scene = cart()
    for given in (scene.equilibrium(), scene.equilibrium().state):
        scene.set_start(given)
        np.testing.assert_allclose(scene["block"].position, [0, 0, 0.9], atol=FAIR)
        np.testing.assert_array_equal(scene["block"].velocity, 0.0)
        run = ts.simulate(scene, (0.0, 1.0))
        np.testing.assert_allclose(run.position("block")[:, 2], 0.9, atol=FAIR)


@pytest.mark.parametrize("ask", [lambda run: run, lambda run: run.state, lambda run: run.at(1.0)])
def test_a_run_goes_on_with_all_its_turns(ask):
    """20 rad/s over a second: more than three turns, which are counted on."""
    scene = wheel()
    scene.set("axle", rate=20.0)
    run = ts.simulate(scene, (0.0, 1.0), dense_output=True)
    scene.set_start(ask(run))
    again = ts.simulate(scene, (1.0, 1.5))
    np.testing.assert_allclose(again.angle("axle")[[0, -1]], [20.0, 30.0], atol=HELD * 100)
    scene.set_start(ts.State(0.0, again.q[0], again.qd[0]))  # bare arrays know no turns: those of the scene
    np.testing.assert_allclose(ts.simulate(scene, (0.0, 0.1)).angle("axle")[0], 20.0, atol=HELD * 100)


def test_the_velocity_of_the_whole():
    """Momentum is M V, angular momentum about the centre of mass J Omega; all distances remain."""
    scene, V, Omega = linkage(), np.array([1.0, -2.0, 3.0]), np.array([0.3, 2.0, -1.0])
    before = [body.position for body in scene.bodies]
    scene.set_start(velocity=V, angular_velocity=Omega)
    np.testing.assert_array_equal([body.position for body in scene.bodies], before)
    run = ts.simulate(scene, (0.0, 1.0), t_eval=[0.0])
    np.testing.assert_allclose(run.linear_momentum[0], 4.5 * V, atol=HELD)
    masses = [body.mass for body in scene.bodies]
    centre = masses @ np.array(before) / 4.5
    J = np.zeros((3, 3))
    for body, r in zip(scene.bodies, np.array(before) - centre, strict=True):
        J += body.mass * (r @ r * np.eye(3) - np.outer(r, r))
        if body.dimension == 7:
            A = run.rotation(body)[0]
            J += A @ body.inertia @ A.T
    expected = J @ Omega + np.cross(centre, 4.5 * V)
    np.testing.assert_allclose(run.angular_momentum[0], expected, atol=100 * HELD)
    assert run.kinetic_energy[0] == pytest.approx(0.5 * (4.5 * V @ V + Omega @ J @ Omega), abs=100 * HELD)
    scene.set_start(velocity=V)  # the one that isn't given is zero
    np.testing.assert_allclose([body.velocity for body in scene.bodies], [V] * 3, atol=HELD)
    np.testing.assert_allclose(scene["a"].angular_velocity, 0.0, atol=HELD)


def test_positions_of_a_state_and_the_velocity_of_the_whole():
    scene = linkage()
    scene.set("hinge", rate=3.0)
    run = ts.simulate(scene, (0.0, 0.5))
    scene.set_start(run, angular_velocity=(0, 0, 2.0))
    np.testing.assert_allclose(scene["b"].position, run.position("b")[-1], atol=HELD)
    assert ts.simulate(scene, (0.0, 0.1)).angle_rate("hinge")[0] == pytest.approx(0.0, abs=100 * HELD)


def test_motions_hold_at_the_time_of_the_state():
    """A motor turns by t^2: its angle at the end of a run is the start of runs from there alone."""
    scene = wheel()
    scene.add(ts.constraints.RotationMotor.of(scene["axle"], angle=ts.motions.time**2, name="motor"))
    end = ts.simulate(scene, (0.0, 1.0))
    scene.set_start(end)
    assert ts.simulate(scene, (1.0, 2.0)).angle("axle")[-1] == pytest.approx(4.0, abs=FAIR)
    with pytest.raises(ts.InconsistentState, match="motor"):
        scene.set_start(ts.State(0.5, end.state.q, end.state.qd))


def test_a_scene_with_other_parameters_has_a_start_of_its_own():
    scene = wheel()
    other = scene.with_parameters({"disc.angular_velocity": (0, 0, 10.0)})
    other.set_start(ts.simulate(other, (0.0, 1.0)))
    assert ts.simulate(other, (0.0, 0.1)).angle("axle")[0] == pytest.approx(10.0, abs=FAIR)
    assert ts.simulate(scene, (0.0, 0.1)).angle("axle")[0] == 0.0
    copied = other.copy()
    assert ts.simulate(copied, (0.0, 0.1)).angle("axle")[0] == pytest.approx(10.0, abs=FAIR)


WRONG = [
    ({}, ts.InvalidArgument, "nothing is given; give a state, velocity= or angular_velocity="),
    ({"velocity": 3}, ts.InvalidArgument, r"velocity \(m/s\)"),
    ({"angular_velocity": (0, np.nan, 0)}, ts.InvalidArgument, r"angular_velocity \(rad/s\)"),
    ({"state": 5}, ts.InvalidArgument, "state must have q and qd"),
    ({"state": ts.State(0.0, np.zeros(3), np.zeros(3))}, ts.InvalidArgument, "7 finite numbers"),
    ({"velocity": (1, 0, 0)}, ts.InconsistentState, "Revolute 'axle'"),
    ({"angular_velocity": (1, 0, 0)}, ts.InconsistentState, "Revolute 'axle'"),
    ({"state": ts.State(0.0, np.eye(7)[3] + 0.1 * np.eye(7)[0], np.zeros(7))}, ts.InconsistentState, "axle"),
    ({"speed": (1, 0, 0)}, ts.InvalidCall, "speed"),
]


@pytest.mark.parametrize(("given", "error", "said"), WRONG)
def test_what_is_refused_changes_nothing(given, error, said):
    scene = wheel()
    scene.set("axle", angle=9.0, rate=2.0)
    before = scene.start
    with pytest.raises(error, match=said):
        scene.set_start(**given)
    np.testing.assert_array_equal(scene.start, before)
    assert ts.simulate(scene, (0.0, 0.1)).angle("axle")[0] == pytest.approx(9.0, abs=FAIR)
