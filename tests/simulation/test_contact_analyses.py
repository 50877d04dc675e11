"""Analyses of scenes with contacts: what holds at a state, equilibria, motions, prepared runs; against closed forms."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.resuming import Stop
from tsdyn.runs import driver

C = ts.constraints
G = 9.81


def ball_on_floor(height=1.0, e=0.5):
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(mass=2.0, position=(0, 0, height), name="ball")
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, restitution=e, name="floor"))
    return scene


def pendulum(**bounds):
    """A bar of 2 kg, its centre 1 m below the hinge, with a stop."""
    scene = ts.Scene(gravity=(0, 0, -G))
    bar = scene.add_body(mass=2.0, inertia=(0.2, 0.2, 0.01), position=(0, 0, -1), name="bar")
    hinge = scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.set(hinge, angle=1.0)
    scene.add(C.Stop(hinge, **bounds, name="stop"))
    return scene


def box():
    scene, size = ts.Scene(gravity=(0, 0, -G)), np.array([1.0, 0.6, 0.4])
    body = scene.add_body(**ts.shapes.box(size, mass=2.0), position=(0, 0, 0.2), name="box")
    for i in range(8):
        corner = size / 2 * [2 * (i & 1) - 1, (i & 2) - 1, (i & 4) / 2 - 1]
        contact = {"normal_b": (0, 0, 1), "unilateral": True, "name": f"corner {i}"}
        scene.add(C.PlaneContact(body, scene.ground, point_a=corner, **contact))
    return scene


# prepared runs


def test_a_prepared_run_has_the_bits_of_simulate():
    scene = ball_on_floor()
    run, whole = ts.prepare(scene, rtol=1e-10), ts.simulate(scene, (0, 2), rtol=1e-10)
    for _ in range(2):
        again = run((0, 2))
        np.testing.assert_array_equal(again.q, whole.q)
        assert (again.phases, again.impulses) == (whole.phases, whole.impulses)
    assert "Taylor" in str(run)
    other = run.with_parameters({"floor.restitution": 0.0})((0, 2))
    assert len(other.impulses) == 1
    scene["floor"].restitution = 0.9
    with pytest.raises(ts.InvalidArgument, match="has changed"):
        run((0, 2))


def test_a_prepared_run_in_threads():
    run = ts.prepare(pendulum(lower=-0.3, upper=2.0, restitution=0.7))
    alone = run((0, 3))
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(run, [(0, 3)] * 8):
            np.testing.assert_array_equal(found.q, alone.q)
            assert found.impulses == alone.impulses


# at a state as it stands


def test_a_state_at_rest_is_linearised_with_its_contacts():
    """A pendulum against its stop has no freedom, away from it that of a pendulum; a ball on a floor slides only."""
    scene = pendulum(lower=0.3)
    resting = ts.simulate(scene, (0, 3.0)).state
    assert scene.linearise(resting).coordinates == ()
    assert scene.linearise().coordinates == ("hinge.angle",)
    ball = ball_on_floor()
    assert ball.linearise(ts.simulate(ball, (0, 3.0)).state).coordinates == ("ball.x", "ball.y")


def test_a_state_before_an_impact_is_not_linearised():
    scene = ball_on_floor()
    before = ts.State(0.5, np.zeros(3), np.array([0, 0, -1.0]), None, None)
    with pytest.raises(ts.InconsistentState, match=r"linearise: velocities jump at this state, by the impact of floor"):
        scene.linearise(before)
    after, _ = ts.impact(scene, before)
    assert len(scene.linearise(after).coordinates) == 3


def test_a_state_becomes_the_start():
    scene = ball_on_floor()
    resting = ts.simulate(scene, (0, 4.0))
    scene.set_start(resting)
    assert ts.simulate(scene, (0, 1.0)).phases == [(0.0, 1.0, ("floor",))]
    with pytest.raises(ts.InconsistentState, match=r"floor penetrates by 0\.5"):
        scene.set_start(resting.state._replace(q=np.array([0, 0, -0.5])))
    assert scene["ball"].position[2] == resting.q[-1, 2]


# equilibria


def test_a_ball_rests_on_the_floor():
    scene = ball_on_floor(height=0.0)
    found = scene.equilibrium()
    assert found.stable
    np.testing.assert_allclose(found.reaction("floor")[0], [0, 0, 2 * G], rtol=1e-13)
    np.testing.assert_allclose(found.state.reaction("floor")[0], [0, 0, 2 * G], rtol=1e-13)
    with pytest.raises(ts.NoEquilibrium, match=r"Open contacts carry no load: floor\. Start where"):
        ball_on_floor().equilibrium()


def test_a_spring_lifts_a_ball_off_the_floor():
    """Closed at the guess, its reaction would pull: the contact opens, and the spring carries the weight alone."""
    scene = ball_on_floor(height=0.0)
    hook = {"point_b": (0, 0, 1), "free_length": 0.5, "name": "hook"}
    scene.add(ts.forces.Spring(scene["ball"], scene.ground, **hook, stiffness=100.0))
    found = scene.equilibrium()
    np.testing.assert_allclose(found.state.position("ball")[2], 0.5 - 2 * G / 100, atol=1e-12)
    np.testing.assert_array_equal(found.reaction("floor")[0], 0.0)
    scene["hook"].stiffness = 10.0  # which doesn't lift it
    np.testing.assert_allclose(scene.equilibrium().reaction("floor")[0][2], 2 * G - 5.0, rtol=1e-13)


def test_a_pendulum_falls_onto_its_stop():
    """Open at the start: the way down meets the stop, whose torque is m g sin(0.3)."""
    found = pendulum(lower=0.3, upper=2.0).equilibrium()
    assert abs(found.state.angle("hinge") - 0.3) < 1e-14
    np.testing.assert_allclose(found.reaction("stop")[1][1], 2 * G * np.sin(0.3), rtol=1e-12)
    free = pendulum(lower=-0.3, upper=2.0).equilibrium()
    assert abs(free.state.angle("hinge")) < 1e-14
    np.testing.assert_allclose(free.smallest_stiffness, 2 * G / 2.2, rtol=1e-10)
    np.testing.assert_array_equal(free.reaction("stop")[1], 0.0)


def test_redundant_contacts_of_a_box():
    """Four corners carry the weight, none pulls; pulled up at a side, those of the other side carry more."""
    scene = box()
    found = scene.equilibrium()
    forces = np.array([found.reaction(f"corner {i}")[0][2] for i in range(8)])
    assert forces.min() > -1e-12
    np.testing.assert_allclose(forces.sum(), 2 * G, rtol=1e-13)
    scene.add(ts.forces.PointForce(scene["box"], point_a=(0.5, 0, 0), force=(0, 0, G / 2)))
    found = scene.equilibrium()
    forces = np.array([found.reaction(f"corner {i}")[0][2] for i in range(4)])
    np.testing.assert_allclose([forces.sum(), forces[1] + forces[3]], [1.5 * G, 0.5 * G], rtol=1e-12)
    assert ts.simulate(scene, (0, 1), state=found.state).phases[0][1] == 1.0


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.02, -0.08, 0.05), (0.2, 0.14, -0.1), (-0.2, -0.3, 0.1)], ids=str)
def test_a_box_on_a_soft_spring_comes_down_on_its_lower_face(tilt):
    """Not turned over about the corner that lands first: no corner passes through the floor on the way down."""
    scene = box()
    scene["box"].position, scene["box"].orientation = (0, 0, 0.6), Rotation.from_rotvec(tilt).as_matrix()
    scene.add(ts.forces.Spring(scene["box"], scene.ground, point_b=(0, 0, 1.5), stiffness=5.0, free_length=0.5))
    found = scene.equilibrium()
    np.testing.assert_allclose(found.state.position("box"), [0, 0, 0.2], atol=1e-12)
    np.testing.assert_allclose(found.state.rotation("box")[2], [0, 0, 1], atol=1e-12)
    forces = np.array([found.reaction(f"corner {i}")[0][2] for i in range(8)])
    np.testing.assert_allclose([forces.sum(), forces[:4].sum()], 2 * G - 5.0 * 0.8, rtol=1e-12)


def test_a_ball_comes_to_rest_in_a_groove():
    """No force but the weight: the way down meets one side, then the other one."""
    scene, sides = ts.Scene(gravity=(0, 0, -G)), np.array([0.4, -0.7])
    ball = scene.add_body(**ts.shapes.sphere(0.1, mass=1.0), position=(0.2, 0, 0.3), name="ball")
    scene.add(C.Dot2(scene.ground, ball, axis_a=(0, 1, 0)))
    normals = np.column_stack([np.sin(sides), 0 * sides, np.cos(sides)])
    for i in range(2):
        scene.add(C.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=normals[i], name=f"side {i}"))
    found = scene.equilibrium()
    forces = [found.reaction(f"side {i}")[0] @ normals[i] for i in range(2)]
    np.testing.assert_allclose(forces @ normals, [0, 0, G], atol=1e-12)


# motions


def test_inverse_dynamics_off_the_stops():
    scene, t = pendulum(lower=0.3, upper=2.0), np.linspace(0, 1, 5)
    motion = scene.inverse_dynamics({"hinge": 1.0 + 0.5 * ts.motions.time}, ["hinge"], t=t)
    np.testing.assert_allclose(motion.load("hinge"), 2 * G * np.sin(1.0 + 0.5 * t), rtol=1e-12)
    with pytest.raises(ts.InvalidArgument, match=r"inverse_dynamics takes contacts as open, and at t = 0\.5 s .* stop"):
        scene.inverse_dynamics({"hinge": 1.0 + 3.0 * ts.motions.time}, ["hinge"], t=t)


def test_kinematics_off_the_stops():
    scene = pendulum(lower=0.3, upper=2.0)
    scene.add(C.RotationMotor.of(scene["hinge"], angle=1.0 + ts.motions.time))
    np.testing.assert_allclose(scene.kinematics([0.0, 0.5]).angle("hinge"), [1.0, 1.5], rtol=1e-14)
    with pytest.raises(ts.InvalidArgument, match="kinematics takes contacts as open, and at t = 2 s this motion meets"):
        scene.kinematics([0.0, 2.0])


# friction of the exact law


def braked(stretch):
    """A block on a guide, with a spring of 10 N/m stretched so far, and a brake of 2 N."""
    scene = ts.Scene(gravity=(0, 0, 0))
    block = scene.add_body(1.0, (1, 1, 1), name="block")
    guide = C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="guide")
    scene.add(guide)
    spring = {"point_b": (-1, 0, 0), "stiffness": 10.0, "free_length": 1.0 - stretch}
    scene.add(ts.forces.Spring(block, scene.ground, **spring))
    scene.add(ts.forces.CoulombFriction(block, scene.ground, force=2.0, name="brake"))
    return scene


def test_a_brake_that_holds_leaves_no_freedom():
    assert braked(0.1).linearise().coordinates == ()
    scene = braked(0.1)
    scene.set("guide", rate=1.0)
    assert scene.linearise().coordinates == ("guide.displacement",)


def test_what_friction_holds_is_an_equilibrium_where_it_stands():
    """The spring pulls with 1 N, the brake holds 2 N; where it pulls with 3 N, it is slack in the equilibrium."""
    found = braked(0.1).equilibrium()
    assert (found.moved, found.stable) == (0.0, True)
    np.testing.assert_allclose(found.reaction("brake")[0], [1.0, 0, 0], rtol=1e-13)
    np.testing.assert_allclose(found.state.reaction("brake")[0], [1.0, 0, 0], rtol=1e-13)
    q = found.state.q + 0.05 * np.eye(7)[0]
    found = braked(0.1).equilibrium(q)  # 1.5 N
    assert (found.moved, found.stable) == (0.0, True)
    np.testing.assert_allclose(found.reaction("brake")[0], [1.5, 0, 0], rtol=1e-13)
    with pytest.raises(ts.InvalidArgument, match="t must be a finite time"):
        braked(0.1).equilibrium(t=np.nan)
    scene = braked(0.3)
    found = scene.equilibrium()
    np.testing.assert_allclose([found.moved, found.smallest_stiffness], [0.3, 10.0], rtol=1e-12)
    np.testing.assert_array_equal(found.reaction("brake")[0], 0.0)
    solution = ts.simulate(scene, (0, 10), state=found.state)
    assert solution.sticking("brake").all()
    with pytest.raises(ts.InvalidArgument, match=r"a spin doesn't go with friction of the exact law \(brake\)"):
        scene.equilibrium(spin=(0, 0, 1.0))


def test_a_contact_with_friction_holds_on_a_slope_or_there_is_no_equilibrium():
    scene = ts.Scene(gravity=(G * np.sin(0.4), 0, -G * np.cos(0.4)))
    block = scene.add_point_mass(mass=2.0, name="block")
    contact = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.4, "static": 0.45, "name": "floor"}
    scene.add(C.PlaneContact(block, scene.ground, **contact))
    found = scene.equilibrium()
    expected = [-2 * G * np.sin(0.4), 0, 2 * G * np.cos(0.4)]
    assert found.moved == 0.0
    np.testing.assert_allclose(found.reaction("floor")[0], expected, rtol=1e-13)
    assert ts.simulate(scene, (0, 5), state=found.state).sticking("floor").all()
    scene["floor"].kinetic = scene["floor"].static = 0.42  # tan(0.4) = 0.4228
    with pytest.raises(ts.NoEquilibrium):
        scene.equilibrium()
    spring = {"point_b": (-1, 0, 0), "stiffness": 50.0, "free_length": 1.0}
    scene.add(ts.forces.Spring(block, scene.ground, **spring))
    scene["floor"].kinetic = scene["floor"].static = 0.1
    found = scene.equilibrium()  # without friction: the spring takes the weight along the slope
    np.testing.assert_allclose(found.state.position("block"), [2 * G * np.sin(0.4) / 50, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.reaction("floor")[0], [0, 0, 2 * G * np.cos(0.4)], atol=1e-12)
    np.testing.assert_allclose(found.state.friction_demand("floor"), 0.0, atol=1e-13)


def test_what_friction_does_not_hold_comes_to_rest_elsewhere():
    """A rough shoulder holds an arm of 2 kg; the elbow is free, and its bar, 1 kg, hangs down."""
    scene = ts.Scene(gravity=(0, 0, -G))
    arm = scene.add_body(2.0, (0.2, 0.3, 0.25), position=(0.8, 0, 0), name="arm")
    shoulder = scene.add(C.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="shoulder"))
    scene.add(ts.forces.RevoluteFriction(shoulder, radius=0.05, kinetic=30.0, name="rough"))
    bar = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(1.6, 0, 0.5), name="bar")
    scene.add(C.Revolute.at(arm, bar, point=(1.6, 0, 0), axis=(0, 1, 0), name="elbow"))
    scene.set("elbow", angle=1.0)
    found = scene.equilibrium()
    assert found.stable
    np.testing.assert_allclose(found.state.position("arm"), [0.8, 0, 0], atol=1e-15)
    np.testing.assert_allclose(found.state.position("bar"), [1.6, 0, -0.5], atol=1e-12)
    np.testing.assert_allclose(found.reaction("rough", on="arm")[1][1], -G * (2 * 0.8 + 1.6), rtol=1e-12)
    assert found.moved > 0.1


@pytest.mark.parametrize("slip", [0.0, 1e-9])
def test_inverse_dynamics_with_kinetic_friction(slip):
    """x = sin t: the spring, the mass, and 2 N against the motion; none where it turns, at t = pi / 2."""
    scene, t = braked(0.1), np.linspace(0.0, np.pi, 5)
    scene["brake"].slip_velocity = slip
    found = scene.inverse_dynamics({"guide": ts.motions.Sine(1.0, 1.0)}, ["guide"], t=t)
    expected = 9.0 * np.sin(t) + 1.0 + 2.0 * np.array([1, 1, 0, -1, -1])
    np.testing.assert_allclose(found.load("guide"), expected, rtol=1e-6)
    np.testing.assert_allclose(found.reaction("brake")[0][:, 0], [-2, -2, 0, 2, 2], atol=1e-6)
    scene.add(C.TranslationMotor.of(scene["guide"], displacement=ts.motions.Sine(1.0, 1.0), name="motor"))
    driven = scene.kinematics(t)
    np.testing.assert_allclose(driven.reaction("motor", on="block")[0][:, 0], expected, rtol=1e-6)


def test_inverse_dynamics_with_friction_by_reactions():
    """A load of 2 kg on a plane, 0.2 of its weight against the motion, in a plane and in a pin."""
    scene, t = ts.Scene(gravity=(0, 0, -G)), np.array([0.0, 0.5, 1.0])
    block = scene.add_point_mass(mass=2.0, name="block")
    plane = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.ContactFriction(plane, kinetic=0.2, name="rub"))
    scene.add(ts.forces.PointForce(block, force=(1, 0, 0), name="push"))
    found = scene.inverse_dynamics({"block.x": ts.motions.Sine(1.0, 1.0), "block.y": ts.motions.time}, ["push"], t=t)
    v = np.array([np.cos(t), 1.0 + 0.0 * t]).T
    friction = -0.4 * G * v / np.linalg.norm(v, axis=1)[:, None]
    np.testing.assert_allclose(found.reaction("rub")[0][:, :2], friction, rtol=1e-12)
    inertia = np.array([-2.0 * np.sin(t), 0.0 * t]).T
    np.testing.assert_allclose(found.load("push")[:, :2], inertia - friction, rtol=1e-12)


def test_a_state_knows_what_holds_a_friction():
    solution = ts.simulate(braked(0.1), (0, 1), dense_output=True)
    np.testing.assert_allclose(solution.state.reaction("brake")[0], [1.0, 0, 0], rtol=1e-13)
    np.testing.assert_allclose(solution.at([0.2, 0.7]).reaction("brake")[0], [[1.0, 0, 0]] * 2, rtol=1e-13)
    scene = braked(0.25)
    stops = ts.simulate(scene, (0, 5), dense_output=True)
    assert stops.sticking("brake")[-1]
    assert not stops.sticking("brake")[0]
    with pytest.raises(ts.InvalidArgument, match="several phases"):
        stops.at([0.0, 5.0]).reaction("brake")


# sampled controllers across events


class Pull:
    """A sampled PI controller of a slide, which notes when it is asked and what it sees."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.sum, self.asked = 0.0, []

    def __call__(self, t, state):
        x = float(state.displacement("slide"))
        self.asked.append((t, x))
        self.sum += 0.1 * (1.0 - x)
        return 30.0 * (1.0 - x) + 2.0 * self.sum


def servo():
    scene, pull = ts.Scene(), Pull()
    block = scene.add_body(1.0, (1, 1, 1), name="block")
    slide = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="slide"))
    scene.add(C.Stop(slide, lower=-0.5, upper=1.3, restitution=0.6, name="stop"))
    scene.add(ts.forces.Control(pull, actuators=["slide"], period=0.1, name="servo"))
    return scene, pull


def test_a_sampled_controller_across_impacts():
    """It is asked once at each instant, sees where the slide is then, and its value is held over impacts."""
    scene, pull = servo()
    for _ in range(2):  # the function is reset at each start
        solution = ts.simulate(scene, (0, 5.0), dense_output=True)
        times, seen = np.array(pull.asked).T
        np.testing.assert_allclose(times, 0.1 * np.arange(50), atol=1e-15)
        np.testing.assert_array_equal(solution.at(times).displacement("slide"), seen)
    assert len(solution.impulses) > 3
    assert solution.displacement("slide").max() < 1.3 + 1e-14
    held = solution.actuation("servo")[:, 0]
    for t, *_ in solution.impulses:
        assert len(set(held[solution.t == t])) == 1
    assert np.ptp(solution.energy - solution.work) < 1e-12


def test_a_phase_that_a_sample_ends_does_not_ask_again():
    """A ramp of 12, 24, 36 N in steps of 0.1 s lifts 2 kg off the floor with the second one."""

    class Ramp:
        def reset(self):
            self.load = 0.0

        def __call__(self, t, state):
            self.load += 12.0
            return self.load

    scene = ts.Scene(gravity=(0, 0, -10))
    block = scene.add_body(2.0, (1, 1, 1), name="block")
    scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(0, 0, 1), name="rail"))
    scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor"))
    scene.add(ts.forces.Control(Ramp(), ["rail"], period=0.1, name="ramp"))
    solution = ts.simulate(scene, (0, 0.3))
    (_, leaves, _), _ = solution.phases
    assert abs(leaves - 0.1) < 1e-15
    # 2 m/s^2 for 0.1 s, then 8 m/s^2
    assert abs(solution.displacement("rail")[-1] - (0.01 + 0.2 * 0.1 + 0.04)) < 1e-14


def test_a_sampled_controller_is_not_asked_beyond_an_event():
    def half(t, state):
        return state.displacement("slide") - 0.5

    half.terminal = True
    scene, pull = servo()
    solution = ts.simulate(scene, (0, 5.0), events=half)
    assert pull.asked[-1][0] <= solution.reached < pull.asked[-1][0] + 0.1


def test_a_servo_goes_on_from_a_checkpoint(tmp_path, monkeypatch):
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    whole = ts.simulate(servo()[0], (0, 5.0))
    for stop in (2, 5, 9):
        path = tmp_path / f"run {stop}.h5"
        stopped = ts.simulate(servo()[0], (0, 5.0), store=path, checkpoint=0.0, progress=Stop(stop))
        assert stopped.status is ts.Status.INTERRUPTED
        resumed = ts.resume(path, scene=servo()[0])
        np.testing.assert_array_equal(resumed.q, whole.q)
        assert (resumed.phases, resumed.impulses) == (whole.phases, whole.impulses)


# ends before the end


def test_ctrl_c_keeps_all_phases(monkeypatch):
    """In a phase, at its end, and between two."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    scene = ball_on_floor()
    whole = ts.simulate(scene, (0, 3.0))
    for stop in (1, 2, 3):
        solution = ts.simulate(scene, (0, 3.0), progress=Stop(stop))
        assert solution.status is ts.Status.INTERRUPTED
        count = len(solution.t)
        assert 0 < count < len(whole.t)
        np.testing.assert_array_equal(solution.q, whole.q[:count])
        rest = ts.simulate(scene, (solution.reached, 3.0), state=solution.state)
        np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=1e-14)


def test_radau_slides_after_a_drop():
    """Friction takes mu (sqrt(2 g h) + g t) off the velocity."""
    scene = ts.Scene()
    stone = scene.add_point_mass(1.0, position=(0, 0, 1), velocity=(30, 0, 0))
    floor = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.3}
    scene.add(ts.constraints.PlaneContact(stone, scene.ground, **floor))
    slid = ts.simulate(scene, (0.0, 2.0), integrator="radau").raise_if_failed()
    np.testing.assert_allclose(slid.qd[-1, 0], 30.0 - 0.3 * 9.81 * 2.0, rtol=1e-7)


def test_an_event_that_fails_in_a_later_phase_is_named():
    def upwards(t, state):
        return float("nan") if state.qd[2] > 0.1 else 1.0

    solution = ts.simulate(ball_on_floor(), (0, 3.0), events=upwards)
    assert solution.status is ts.Status.EVENT_FAILED
    assert "finite" in solution.message


def test_failures_in_a_later_phase_return_the_ones_before():
    def fails(t, state):
        if t > 1.0:
            raise ValueError("no more")
        return 1.0

    solution = ts.simulate(ball_on_floor(), (0, 3.0), events=fails)
    assert solution.status is ts.Status.EVENT_FAILED
    assert "no more" in solution.message
    assert 0.9 < solution.reached <= 1.0
    assert len(solution.phases) == 3
    few = ts.simulate(ball_on_floor(), (0, 3.0), max_steps=5)
    assert few.status is ts.Status.MAX_STEPS
    assert few.stats.steps == 5
    done = []
    ts.simulate(ball_on_floor(), (0, 3.0), progress=done.append)
    assert done == sorted(done)
    assert done[-1] == 1.0
