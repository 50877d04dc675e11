"""`scene.equilibrium`: closed forms, minima of energy, stability limits, reactions, and what has no equilibrium."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.closed_loops import bricard, four_bar
from tests.helpers.hanging_chains import DOWN, G, pendulum_matrices, pendulums
from tests.helpers.tolerances import CLOSE, HELD

C, F = ts.constraints, ts.forces


def test_mass_sags_on_its_spring():
    scene = ts.Scene(gravity=DOWN)
    ball = scene.add_point_mass(mass=2.0, position=(0, 0, -1), name="ball")
    spring = scene.add(F.Spring(scene.ground, ball, stiffness=400.0, damping=3.0, name="spring"))
    found = scene.equilibrium()
    assert found.stable
    assert found.neutral == 0
    np.testing.assert_allclose(found.state.position(ball), (0, 0, -1 - 2.0 * G / 400.0), atol=HELD)
    np.testing.assert_allclose(found.reaction(spring)[0], (0, 0, 2.0 * G), atol=1e-11)
    assert found.moved == pytest.approx(2.0 * G / 400.0)
    assert ball.position[2] == -1.0  # the scene is as it was
    run = ts.simulate(scene, (0.0, 1.0), state=found.state)
    np.testing.assert_allclose(run.q[-1], found.state.q, atol=1e-11)


@pytest.mark.parametrize("angles", [[np.pi], [3.0, 1.0], [np.pi, np.pi, np.pi], np.linspace(0.1, 3.1, 6)])
def test_pendulums_hang_down(angles):
    scene = pendulums(angles)
    found = scene.equilibrium()
    M, K = pendulum_matrices(len(angles))
    expected = 1.0 / np.linalg.eigvalsh(
        np.linalg.solve(np.linalg.cholesky(K), M) @ np.linalg.inv(np.linalg.cholesky(K)).T
    )
    assert found.stable
    assert found.smallest_stiffness == pytest.approx(expected.min(), rel=CLOSE)
    assert np.abs(found.state.q[:2]).max() < HELD
    force, torque = found.reaction("pin 0", on="link 0")
    np.testing.assert_allclose(force, (0, 0, 1.3 * G * len(angles)), atol=1e-10)
    np.testing.assert_allclose(torque, 0.0, atol=1e-10)
    assert scene.linearise(found.state).steady


@pytest.mark.parametrize("stiffness", [2.0, 6.0])
def test_upright_pendulum_on_a_torsional_spring_buckles(stiffness):
    """k theta = m g l / 2 sin theta: upright where k is above m g l / 2, else to a side."""
    scene = pendulums([np.pi])
    moment = 1.3 * G * 0.35
    scene.add(
        F.TorsionalSpring(
            scene.ground,
            scene.bodies[0],
            axis_a=(0, 1, 0),
            reference_a=(0, 0, -1),
            reference_b=(0, 0, 1),
            stiffness=stiffness,
        )
    )
    found = scene.equilibrium()
    theta = 0.0 if stiffness > moment else brentq(lambda x: stiffness * x - moment * np.sin(x), 0.1, np.pi)
    assert found.stable
    assert abs(found.state.position("link 0")[0]) == pytest.approx(0.35 * np.sin(theta), abs=CLOSE)
    inertia = 0.02 + 1.3 * 0.35**2
    assert found.smallest_stiffness == pytest.approx((stiffness - moment * np.cos(theta)) / inertia, rel=CLOSE)


def test_torsional_spring_unwinds_over_turns():
    scene = pendulums([0.0])
    scene.gravity = (0, 0, 0)
    spring = F.TorsionalSpring(
        scene.ground,
        scene.bodies[0],
        axis_a=(0, 1, 0),
        reference_a=(1, 0, 0),
        reference_b=(1, 0, 0),
        stiffness=3.0,
        free_angle=10.0,
    )
    scene.add(spring)
    found = scene.equilibrium()
    assert found.state.angle(spring) == pytest.approx(10.0, abs=CLOSE)
    assert found.state.angle("pin 0") == pytest.approx(10.0, abs=CLOSE)


def test_four_bar_with_redundant_rows_is_at_its_energy_minimum():
    scene = four_bar(rate=0.0)
    found = scene.equilibrium()
    heights = lambda angle: sum(b.mass * b.position[1] for b in four_bar(angle=angle, rate=0.0).bodies)  # noqa: E731
    best = minimize_scalar(heights, bracket=(-1.6, -1.2), options={"xtol": 1e-12})
    lowest = sum(b.mass * found.state.position(b)[1] for b in scene.bodies)
    assert found.stable
    assert lowest <= best.fun + HELD
    weight = 9.81 * sum(b.mass for b in scene.bodies)
    pins = [pin for pin in scene.constraints if scene.ground in (getattr(pin, "a", None), getattr(pin, "b", None))]
    held = sum(found.reaction(pin)[0][1] for pin in pins if pin.joint_coordinates)
    assert held == pytest.approx(weight, rel=CLOSE)


def test_rows_that_are_redundant_change_on_the_way():
    """Bricard's linkage swings through its lowest point without a singularity, by other rows than at the start."""
    scene = bricard()
    found = scene.equilibrium()
    run = ts.simulate(scene, (0.0, 2.0), t_eval=np.linspace(0.0, 2.0, 4001))
    assert found.stable
    height = sum(body.mass * 9.81 * found.state.position(body)[1] for body in scene.bodies)
    assert height == pytest.approx(run.potential_energy.min(), abs=1e-3)
    assert height <= run.potential_energy.min()


@pytest.mark.parametrize("torque", [2.0, 6.0])
def test_constant_torque(torque):
    """tau = m g l / 2 sin theta, as long as there is such an angle; else the pendulum is driven round."""
    scene, moment = pendulums([0.0]), 1.3 * G * 0.35
    scene.add(F.Torque(scene.bodies[0], torque=(0, torque, 0), name="push"))
    if torque > moment:
        with pytest.raises(ts.NoEquilibrium, match="link 0"):
            scene.equilibrium()
        return
    found = scene.equilibrium()
    assert found.stable
    assert found.state.angle("pin 0") == pytest.approx(np.arcsin(torque / moment), rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_ziegler_column_flutters(share):
    """Masses 2 m and m, springs k, a follower load P at the tip: flutter from (7 / 2 - sqrt 2) k / l on."""
    k, length, mass = 5.0, 0.8, 1.5
    scene = ts.Scene(gravity=(0, 0, 0))
    tiny = (1e-9, 1e-9, 1e-9)
    before, top = scene.ground, np.zeros(3)
    for i, m in enumerate((2.0 * mass, mass)):
        end = top + np.array([0, 0, length])
        body = scene.add_body(m, tiny, end, name=f"mass {i}")
        scene.add(C.Revolute.at(before, body, point=top, axis=(0, 1, 0), name=f"pin {i}"))
        scene.add(
            F.TorsionalSpring(
                before,
                body,
                axis_a=(0, 1, 0),
                reference_a=(1, 0, 0),
                reference_b=(1, 0, 0),
                stiffness=k,
                name=f"spring {i}",
            )
        )
        before, top = body, end
    load = share * (3.5 - np.sqrt(2.0)) * k / length
    scene.add(F.PointForce(before, force=(0, 0, -load), frame="body"))
    found = scene.equilibrium()
    assert found.moved == 0.0
    assert found.stable == (share < 1.0)


def test_two_balls_in_space_have_five_neutral_directions():
    scene = ts.Scene(gravity=(0, 0, 0))
    one, two = (scene.add_point_mass(mass=m, position=(x, 0, 0)) for m, x in ((1.0, 0.0), (2.0, 1.5)))
    scene.add(F.Spring(one, two, stiffness=30.0, free_length=1.0))
    found = scene.equilibrium()
    assert found.stable
    assert found.neutral == 5
    assert found.smallest_stiffness == pytest.approx(30.0 * (1.0 + 0.5), rel=CLOSE)
    assert np.linalg.norm(found.state.position(one) - found.state.position(two)) == pytest.approx(1.0, abs=HELD)


def test_pendulum_beside_a_hard_spring_is_not_neutral():
    scene = pendulums([0.0])
    ball = scene.add_point_mass(mass=1.0, position=(5.0, 0, -1))
    scene.add(F.Spring(scene.ground, ball, stiffness=1e12, free_length=1.0, point_a=(5.0, 0, 0)))
    found = scene.equilibrium()
    assert found.stable
    assert found.neutral == 0
    inertia, moment = 0.02 + 1.3 * 0.35**2, 1.3 * G * 0.35
    assert found.smallest_stiffness == pytest.approx(min(G, moment / inertia), rel=1e-3)


def test_all_directions_neutral():
    scene = ts.Scene(gravity=DOWN)
    cart = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="cart")
    scene.add(C.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=(1, 0, 0)))
    found = scene.equilibrium()
    assert (found.stable, found.neutral, found.smallest_stiffness) == (True, 1, 0.0)
    assert repr(found) == "<Equilibrium: stable, 1 neutral>"


def test_what_is_held_altogether_has_no_stiffness():
    scene = ts.Scene(gravity=DOWN)
    stone = scene.add_point_mass(mass=1.0, name="stone")
    law = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.3}
    scene.add(C.PlaneContact(stone, scene.ground, **law))
    assert repr(scene.equilibrium()) == "<Equilibrium: stable, nothing can move>"


def test_hanging_chain_of_rigid_links_from_a_rough_guess():
    """Between two supports: the pull along the span is the same everywhere, and the supports carry the weight."""
    count, length = 7, 0.3
    scene = ts.Scene(gravity=DOWN)
    angle = 0.4
    before, top, links = scene.ground, np.zeros(3), []
    for i in range(count):
        turn = Rotation.from_rotvec([0, angle * (1 if i % 2 else -1), 0])
        along = turn.apply([length, 0, 0])
        body = scene.add_body(0.5, (1e-4, 4e-3, 4e-3), top + along / 2, turn, name=f"link {i}")
        links.append(
            scene.add(
                C.Spherical(before, body, point_a=top if i == 0 else (length / 2, 0, 0), point_b=(-length / 2, 0, 0))
            )
        )
        before, top = body, top + along
    links.append(scene.add(C.Spherical(before, scene.ground, point_a=(length / 2, 0, 0), point_b=top)))
    for body in scene.bodies:
        scene.add(
            F.TorsionalSpring(
                scene.ground, body, axis_a=(1, 0, 0), reference_a=(0, 0, 1), reference_b=(0, 0, 1), stiffness=1e-3
            )
        )
    found = scene.equilibrium()
    assert found.stable
    assert min(found.state.position(body)[2] for body in scene.bodies) < -0.1
    pulls = [
        found.reaction(link, on=body)[0] for link, body in zip(links, [*scene.bodies, scene.bodies[-1]], strict=True)
    ]
    assert pulls[0][2] + pulls[-1][2] == pytest.approx(0.5 * count * G, rel=CLOSE)
    for i, pull in enumerate(pulls[:-1]):
        assert abs(pull[0] - pulls[0][0]) < 1e-6 * abs(pull[0])
        assert pull[2] == pytest.approx(pulls[0][2] - 0.5 * G * i, abs=1e-5)


def test_what_has_no_equilibrium_is_refused():
    falling = ts.Scene()
    falling.add_point_mass(mass=1.0, name="ball")
    with pytest.raises(ts.NoEquilibrium, match="ball"):
        falling.equilibrium()
    scene = pendulums([0.3])
    with pytest.raises(ts.InvalidArgument, match="guess"):
        scene.equilibrium(guess=[1.0, 2.0])
    with pytest.raises(ts.InvalidArgument, match="t must"):
        scene.equilibrium(t=np.nan)
    with pytest.raises(ts.InvalidBody, match="body"):
        scene.equilibrium().reaction("pin 0", on=pendulums([0.0]).bodies[0])
    sampled = pendulums([0.1])
    sampled.add(F.JointTorque(sampled["pin 0"], function=lambda t, x, rate: -x, period=0.1, name="servo"))
    with pytest.raises(ts.InvalidForce, match="servo"):
        sampled.equilibrium()


def test_a_motor_that_turns_is_refused_and_one_at_rest_holds():
    scene = pendulums([0.3, 0.0])
    motor = scene.add(C.RotationMotor.of(scene["pin 0"], angle=0.4 * ts.motions.time, name="motor"))
    with pytest.raises(ts.InconsistentState, match="motor"):
        scene.equilibrium()
    scene.remove(motor)
    scene.add(C.RotationMotor.of(scene["pin 0"], angle=0.4, name="brake"))
    found = scene.equilibrium()
    moment = 1.3 * G * 0.7 * 1.5 * np.sin(0.7)  # link 0 is held 0.4 rad from its pose, link 1 hangs down
    assert found.state.angle("pin 0") == pytest.approx(0.4, abs=CLOSE)
    assert abs(found.reaction("brake", on="link 0")[1][1]) == pytest.approx(moment, rel=CLOSE)


@pytest.mark.parametrize("size", [1e-4, 1e3])
def test_scenes_of_any_size(size):
    scene = ts.Scene(gravity=DOWN)
    rod = scene.add_body(
        mass=size**3, inertia=np.array([0.02, 0.02, 0.01]) * size**5, position=(0.3 * size, 0, 0.4 * size), name="rod"
    )
    scene.add(C.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    found = scene.equilibrium()
    np.testing.assert_allclose(found.state.position(rod), (0, 0, -0.5 * size), atol=CLOSE * size)
    assert found.smallest_stiffness == pytest.approx(G * 0.5 / (0.27 * size), rel=1e-7)


def test_guess_decides_between_two_wells():
    """A snap-through: two springs to supports on both sides, either up or down."""
    scene = ts.Scene(gravity=(0, 0, 0))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 0.1), name="ball")
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 1, 0)))
    for x in (-1.0, 1.0):
        scene.add(F.Spring(ball, scene.ground, point_b=(x, 0, 0), stiffness=50.0, free_length=1.2))
    height = np.sqrt(1.2**2 - 1.0)
    assert scene.equilibrium().state.q[2] == pytest.approx(height, abs=CLOSE)
    assert scene.equilibrium(guess=[0.0, 0.0, -0.2]).state.q[2] == pytest.approx(-height, abs=CLOSE)
    middle = scene.equilibrium(guess=[0.0, 0.0, 0.0])  # a saddle: left to either side
    assert abs(middle.state.q[2]) == pytest.approx(height, abs=CLOSE)
