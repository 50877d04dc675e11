"""`scene.inverse_dynamics`: closed forms, minimal coordinates, virtual work, and runs that give the motion back."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import tsdyn as ts
from tests.helpers.closed_loops import four_bar
from tests.helpers.tolerances import ALGEBRA, CLOSE, FINE, HELD, TIGHT

C, F, M = ts.constraints, ts.forces, ts.motions
X, Y, Z = np.eye(3)
G = 9.81
M1, M2, L1, L2, J1, J2 = 2.0, 1.2, 0.8, 0.6, 0.11, 0.04


def arm():
    """Two links that hang from the ground and turn about y; the centroids are in their middles."""
    scene = ts.Scene(gravity=(0, 0, -G))
    upper = scene.add_body(M1, (J1, J1, 1e-3), (0, 0, -L1 / 2), name="upper")
    lower = scene.add_body(M2, (J2, J2, 1e-3), (0, 0, -L1 - L2 / 2), name="lower")
    scene.add(C.Revolute.at(scene.ground, upper, point=(0, 0, 0), axis=-Y, name="shoulder"))
    scene.add(C.Revolute.at(upper, lower, point=(0, 0, -L1), axis=-Y, name="elbow"))
    return scene


def arm_torques(a, b, ad, bd, add, bdd):
    """Lagrange's equations in the angles of the joints, from the vertical."""
    s, h = L1 * L2 / 2 * M2, a + b
    hd, hdd = ad + bd, add + bdd
    cosine, sine = np.cos(b), np.sin(b)
    elbow = (J2 + M2 * L2**2 / 4) * hdd + s * (add * cosine + ad**2 * sine) + M2 * G * L2 / 2 * np.sin(h)
    upper = (J1 + M1 * L1**2 / 4 + M2 * L1**2) * add + s * (hdd * cosine - hd**2 * sine)
    return upper + (M1 / 2 + M2) * G * L1 * np.sin(a) + elbow, elbow


SWING = {"shoulder": M.Sine(0.9, 2.0, 0.0, 0.2), "elbow": M.Sine(0.7, 3.0, 0.4)}


def test_two_links_by_their_lagrangian():
    scene, t = arm(), np.linspace(0.0, 3.0, 61)
    found = scene.inverse_dynamics(SWING, ["shoulder", "elbow"], t)
    (a, ad, add), (b, bd, bdd) = (ts.Motion(motion).over(t) for motion in SWING.values())
    for name, torque in zip(("shoulder", "elbow"), arm_torques(a, b, ad, bd, add, bdd), strict=True):
        np.testing.assert_allclose(found.load(name), torque, atol=HELD)
        assert found.units[f"{name}.angle"] == "N m"
    np.testing.assert_allclose(found.angle("elbow"), b, atol=ALGEBRA)
    np.testing.assert_allclose(found.power_of("elbow"), found.load("elbow") * bd, atol=HELD)
    np.testing.assert_allclose(found.power, found.power_of("shoulder") + found.power_of("elbow"), atol=TIGHT)
    assert found.residual.max() < HELD
    force, _ = found.reaction("shoulder", on="upper")
    moved = M1 * found.acceleration("upper") + M2 * found.acceleration("lower")
    np.testing.assert_allclose(force, moved + (M1 + M2) * G * Z, atol=TIGHT)
    assert scene["upper"].position[2] == -L1 / 2  # the scene is as it was


def test_loads_drive_a_run_along_the_motion():
    """Torques as control laws, from a spline over the times."""
    scene, t = arm(), np.linspace(0.0, 1.0, 2001)
    found = scene.inverse_dynamics(SWING, ["shoulder", "elbow"], t)
    for name, body, other in (("shoulder", "upper", None), ("elbow", "lower", "upper")):
        torque = CubicSpline(t, -found.load(name)[:, None] * Y)
        scene.add(F.Torque(scene[body], torque=torque))
        if other:
            scene.add(F.Torque(scene[other], torque=CubicSpline(t, found.load(name)[:, None] * Y)))
    scene.place(found.q[0], found.qd[0])
    run = ts.simulate(scene, (0.0, 1.0), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.q[-1], found.q[-1], atol=CLOSE)
    np.testing.assert_allclose(run.qd[-1], found.qd[-1], atol=CLOSE)


def test_four_bar_over_and_under_its_freedom():
    """One torque, or two that share it: the least sum of squares is in proportion to the rates."""
    scene, t = four_bar(), np.linspace(0.0, 2.0, 41)
    crank, rocker = scene.constraints[0], scene.constraints[3]
    motion = {crank: M.Ramp(0.0, 3.0)}
    one, other, both = (scene.inverse_dynamics(motion, which, t) for which in ([crank], [rocker], [crank, rocker]))
    ratio = one.angle_rate(rocker) / 3.0
    torque = one.load(crank)
    np.testing.assert_allclose(other.load(rocker) * ratio, torque, atol=TIGHT)
    np.testing.assert_allclose(both.load(crank), torque / (1 + ratio**2), atol=TIGHT)
    np.testing.assert_allclose(both.load(rocker), torque * ratio / (1 + ratio**2), atol=TIGHT)
    np.testing.assert_allclose(both.power, one.power, atol=FINE)
    motor = scene.copy()
    motor.add(C.RotationMotor.of(motor.constraints[0], angle=M.Ramp(0.0, 3.0), name="motor"))
    np.testing.assert_allclose(motor.kinematics(t).reaction("motor", on="crank")[1][:, 2], torque, atol=TIGHT)


def crane():
    """A boom on a hinge, lifted by a ram."""
    scene = ts.Scene(gravity=(0, 0, -G))
    boom = scene.add_body(**ts.shapes.rod(2.0, axis="x", mass=50.0), position=(1, 0, 0), name="boom")
    scene.add(C.Revolute.at(scene.ground, boom, point=(0, 0, 0), axis=-Y, name="hinge"))
    ends = {"point_a": (0, 0, -1), "point_b": (-0.2, 0, 0)}
    scene.add(F.Spring(scene.ground, boom, **ends, stiffness=300.0, damping=20.0, actuator=5.0, name="ram"))
    return scene


def test_ram_beside_its_spring():
    scene, t = crane(), np.linspace(0.0, 2.0, 401)
    lift = M.Polynomial((0.0, 0.0, 0.2, -0.05))
    found = scene.inverse_dynamics({"hinge": lift}, ["ram"], t)
    angle, _, gain = ts.Motion(lift).over(t)
    arm_of_ram = 0.8 * np.cos(angle) / np.hypot(0.8 * np.cos(angle), 1.0 + 0.8 * np.sin(angle))  # about the hinge
    torque = 50.0 * 4.0 / 3.0 * gain + 50.0 * G * np.cos(angle)
    tension = -torque / arm_of_ram
    length = np.hypot(0.8 * np.cos(angle), 1.0 + 0.8 * np.sin(angle))
    rate = 0.8 * np.cos(angle) / length * found.angle_rate("hinge")
    spring = 300.0 * (length - scene["ram"].free_length) + 20.0 * rate
    np.testing.assert_allclose(found.load("ram"), tension - spring, rtol=CLOSE)
    force, _ = found.reaction("ram", on="boom")
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), -tension, rtol=CLOSE)
    np.testing.assert_allclose(found.power_of("ram"), -found.load("ram") * rate - 20.0 * rate**2, atol=CLOSE * 500)
    np.testing.assert_allclose(found.power - found.dissipation, np.gradient(found.energy, t), atol=2.0)
    scene["ram"].actuator = CubicSpline(t, found.load("ram"))
    run = ts.simulate(scene, (0.0, 2.0), rtol=1e-12, atol=1e-12)
    assert run.angle("hinge")[-1] == pytest.approx(angle[-1], abs=CLOSE)


def cart_pole():
    scene = ts.Scene(gravity=(0, 0, -G))
    cart = scene.add_body(2.0, (0.1, 0.1, 0.1), name="cart")
    pole = scene.add_body(0.5, (0.02, 0.02, 1e-3), (0, 0, -0.4), name="pole")
    rail = scene.add(C.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=X, name="rail"))
    scene.add(C.Revolute.at(cart, pole, point=(0, 0, 0), axis=Y, name="pin"))
    return scene, rail


def test_motion_of_a_run_gives_its_force_back():
    """One force and two degrees of freedom: a motion that the force makes is accepted, any other refused."""
    scene, rail = cart_pole()
    push = scene.add(F.PointForce(scene["cart"], force=(M.Sine(3.0, 4.0), 0.0, 0.0), name="push"))
    run = ts.simulate(scene, (0.0, 2.0), rtol=1e-12, atol=1e-12)
    for actuators, name in (([rail], "rail.displacement"), (["push.x"], "push.x")):
        found = scene.inverse_dynamics(run, actuators)
        wanted = 3.0 * np.sin(4.0 * run.t)
        expected = 0.0 * run.t if name.startswith("rail") else wanted
        np.testing.assert_allclose(found.loads[name], expected, atol=CLOSE)
    np.testing.assert_allclose(found.reaction(push)[0][:, 0], wanted, atol=CLOSE)
    np.testing.assert_allclose(found.power, run.power, atol=CLOSE)
    np.testing.assert_array_equal(found.angle("pin"), run.angle("pin"))
    state = scene.inverse_dynamics(run.state, ["push"])
    assert state.load("push").shape == (1, 3)
    np.testing.assert_allclose(state.load("push")[0], (3.0 * np.sin(8.0), 0, 0), atol=CLOSE)


def test_motion_that_actuators_cannot_produce_is_refused_by_name():
    scene, rail = cart_pole()
    both = {"rail": M.Sine(0.2, 3.0), "pin": M.Sine(0.3, 2.0)}
    with pytest.raises(ts.InvalidArgument, match=r"rail\.displacement can't produce .* pin\.angle gets .* from no act"):
        scene.inverse_dynamics(both, [rail], np.linspace(0.0, 1.0, 11))
    with pytest.raises(ts.InvalidArgument, match=r"inverse_dynamics: 1 degree of freedom is left: pin\.angle\. Give"):
        scene.inverse_dynamics({"rail": M.Sine(0.2, 3.0)}, [rail], [0.0, 0.5])
    found = scene.inverse_dynamics(both, [rail, "pin"], [0.0, 0.5])
    assert found.actuators == ("rail.displacement", "pin.angle")
    assert list(found.units.values()) == ["N", "N m"]


def test_point_of_the_arm_follows_a_path():
    """Inverse kinematics: the hand draws an ellipse; the plane holds the third coordinate."""
    scene = arm()
    scene.set("shoulder", angle=0.7)
    scene.set("elbow", angle=-1.0)
    hand = (scene["lower"], (0, 0, -L2 / 2))
    x, _, z = scene.start[0][7:10] + ts.simulate(scene, (0, 1e-6)).rotation("lower")[0] @ hand[1]
    path = (M.Sine(0.1, 3.0, 0.0, x), 0.0, M.Sine(0.05, 3.0, np.pi / 2, z - 0.05))
    t = np.linspace(0.0, 2.0, 21)
    found = scene.inverse_dynamics({hand: path}, ["shoulder", "elbow"], t)
    wanted = np.stack([ts.Motion.always(each, "path").over(t)[0] for each in path], axis=1)
    np.testing.assert_allclose(found.position("lower", point=hand[1]), wanted, atol=HELD)
    angles = [
        [f(joint) for f in (found.angle, found.angle_rate, found.angle_acceleration)] for joint in ("shoulder", "elbow")
    ]
    (a, ad, add), (b, bd, bdd) = angles
    for name, torque in zip(("shoulder", "elbow"), arm_torques(a, b, ad, bd, add, bdd), strict=True):
        np.testing.assert_allclose(found.load(name), torque, atol=FINE)


def test_motion_begins_away_from_the_poses():
    scene, t = arm(), np.array([0.5, 1.0])
    motion = {"shoulder.angle": M.Ramp(7.0, 1.0), "elbow": M.Polynomial((-0.4,))}
    found = scene.inverse_dynamics(motion, ["shoulder", "elbow"], t)
    np.testing.assert_allclose(found.angle("shoulder"), 7.0 + t, atol=HELD)
    for name, torque in zip(("shoulder", "elbow"), arm_torques(7.0 + t, -0.4, 1.0, 0.0, 0.0, 0.0), strict=True):
        np.testing.assert_allclose(found.load(name), torque, atol=HELD)


def test_bodies_by_axes_and_torques_by_components():
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(2.0, name="ball")
    push = scene.add(F.PointForce(ball, force=(1, 0, 0), name="push"))
    t = np.linspace(0.0, 1.0, 5)
    found = scene.inverse_dynamics({"ball.x": M.Sine(1.0, 2.0), "ball.y": 0.0, "ball.z": M.Ramp(0.0, 1.0)}, [push], t)
    expected = np.stack((-8.0 * np.sin(2.0 * t), 0.0 * t, 2.0 * G + 0.0 * t), axis=1)
    np.testing.assert_allclose(found.load(push), expected, atol=HELD)
    np.testing.assert_allclose(found.reaction(push)[0], expected, atol=HELD)


def test_friction_that_depends_on_reactions_is_in_the_torque():
    scene = arm()
    scene.add(F.RevoluteFriction(scene["shoulder"], radius=0.05, kinetic=0.2, slip_velocity=0.01, name="bearing"))
    t = np.linspace(0.1, 2.0, 12)
    found = scene.inverse_dynamics(SWING, ["shoulder", "elbow"], t)
    start = scene.inverse_dynamics(SWING, ["elbow", "shoulder"], 0.0)
    scene.place(start.q[0], start.qd[0])
    for name, angle in SWING.items():  # of which the poses are those at t = 0
        scene.add(C.RotationMotor.of(scene[name], angle=angle, name=f"motor of {name}"))
    driven = scene.kinematics(t)
    for name, body in (("shoulder", "upper"), ("elbow", "lower")):
        torque = -driven.reaction(f"motor of {name}", on=body)[1][:, 1]
        np.testing.assert_allclose(found.load(name), torque, atol=TIGHT)
    assert (
        np.abs(found.load("shoulder") - arm().inverse_dynamics(SWING, ["shoulder", "elbow"], t).load("shoulder")).max()
        > 0.1
    )
    np.testing.assert_allclose(
        found.reaction("bearing", on="upper")[1], driven.reaction("bearing", on="upper")[1], atol=TIGHT
    )


def test_chain_of_many_links_by_sparse_matrices():
    """The torques of joints are those of motors on them."""
    scene, before, count = ts.Scene(), None, 60
    for i in range(count):
        link = scene.add_body(1.0, (0.01, 0.1, 0.1), (i + 0.5, 0, 0), name=f"link {i}")
        scene.add(C.Revolute.at(before or scene.ground, link, point=(i, 0, 0), axis=Y, name=f"pin {i}"))
        before = link
    t, motion = np.array([0.0, 0.4]), {f"pin {i}": M.Sine(0.02, 2.0) for i in range(count)}
    found = scene.inverse_dynamics(motion, list(motion), t)
    driven = scene.copy()
    for name, angle in motion.items():
        driven.add(C.RotationMotor.of(driven[name], angle=angle, name=f"motor of {name}"))
    run = driven.kinematics(t)
    for i in (0, 7, 59):
        torque = run.reaction(f"motor of pin {i}", on=f"link {i}")[1][:, 1]
        np.testing.assert_allclose(found.load(f"pin {i}"), torque, rtol=CLOSE, atol=CLOSE)


def test_singular_position_keeps_what_was_before():
    scene = four_bar(lengths=(1.0, 2.5, 2.0, 2.2))
    rocker = scene.constraints[3]
    found = scene.inverse_dynamics({rocker: M.Ramp(0.0, -1.0)}, [scene.constraints[0]], np.linspace(0.0, 3.0, 31))
    assert not found.success
    assert 0 < found.t.size < 31
    assert found.loads[found.actuators[0]].size == found.t.size
    assert "of 31 times" in found.message


def test_result_is_a_solution():
    found = arm().inverse_dynamics(SWING, ["shoulder", "elbow"], np.linspace(0.0, 1.0, 5))
    assert repr(found) == "<InverseDynamics: success at t = 1 s: 5 outputs>"
    assert "shoulder.angle" in str(found)
    assert "N m" in found._repr_html_()
    part = found[1:3]
    np.testing.assert_array_equal(part.load("elbow"), found.load("elbow")[1:3])
    np.testing.assert_array_equal(part.power, found.power[1:3])
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.loads["elbow.angle"], found.loads["elbow.angle"])
    np.testing.assert_array_equal(again.power, found.power)
    with pytest.raises(ts.InvalidArgument, match="unknown actuator 'wrist'"):
        found.load("wrist")


def test_figure_has_a_panel_for_each_unit(tmp_path):
    pytest.importorskip("matplotlib")
    scene, _ = cart_pole()
    motion = {"rail": M.Sine(0.2, 3.0), "pin": M.Sine(0.3, 2.0)}
    found = scene.inverse_dynamics(motion, ["rail", "pin"], np.linspace(0.0, 1.0, 5))
    figure = found.plot(tmp_path / "loads.png")
    assert [ax.get_ylabel() for ax in figure.axes] == ["force (N)", "torque (N m)"]
    assert (tmp_path / "loads.png").stat().st_size > 0


STILL = SimpleNamespace(t=0.0, q=np.zeros(3), qd=np.zeros(3), qdd=np.zeros(3))


@pytest.mark.parametrize(
    ("motion", "actuators", "t", "said"),
    [
        ({}, ["elbow"], [0.0], "motion is empty"),
        ("elbow", ["elbow"], [0.0], "motion must be a dict"),
        (SWING, ["elbow", "shoulder"], None, "give the times"),
        (SWING, ["elbow", "shoulder"], [np.nan], "t must be a finite time"),
        (SWING, "elbow", [0.0], "actuators must be a sequence"),
        (SWING, [], [0.0], "give one at least"),
        (SWING, ["wrist"], [0.0], "no force or joint is named 'wrist'"),
        (SWING, ["elbow", "elbow"], [0.0], "elbow.angle is given more than once"),
        ({"wrist": 0.0}, ["elbow"], [0.0], "'wrist'"),
        ({"elbow": "fast"}, ["elbow"], [0.0], "motion of elbow.angle must be"),
        ({("lower", (0, 0)): (0, 0, 0)}, ["elbow"], [0.0], "point of lower"),
        (STILL, ["elbow"], None, r"motion.q must be finite numbers of shape \(1, 14\)"),
    ],
)
def test_wrong_arguments_are_refused(motion, actuators, t, said):
    with pytest.raises(ts.TsdynError, match=said):
        arm().inverse_dynamics(motion, actuators, t)


def test_actuator_beside_a_motor_is_refused():
    scene = arm()
    scene.add(C.RotationMotor.of(scene["shoulder"], angle=M.Ramp(0.0, 1.0)))
    with pytest.raises(ts.InvalidArgument, match=r"the actuator shoulder\.angle does no work .* remove the motor"):
        scene.inverse_dynamics({"elbow": M.Ramp(0.0, 1.0)}, ["shoulder", "elbow"], [0.0])
    found = scene.inverse_dynamics({"elbow": M.Ramp(0.0, 1.0)}, ["elbow"], [0.0, 0.3])
    np.testing.assert_allclose(found.load("elbow"), arm_torques(found.t, found.t, 1.0, 1.0, 0.0, 0.0)[1], atol=HELD)


def test_sampled_loads_are_replaced_as_actuators_and_refused_beside_them():
    scene = arm()
    for name in ("shoulder", "elbow"):
        law = {"function": lambda t, angle, rate: 1.0, "period": 0.1}
        scene.add(F.JointTorque(scene[name], **law, name=f"servo of {name}"))
    found = scene.inverse_dynamics(SWING, ["servo of shoulder", "servo of elbow"], [0.0, 0.2])
    plain = arm().inverse_dynamics(SWING, ["shoulder", "elbow"], [0.0, 0.2])
    np.testing.assert_allclose(found.load("servo of elbow"), plain.load("elbow"), atol=HELD)
    np.testing.assert_allclose(found.power, plain.power, atol=HELD)
    with pytest.raises(ts.InvalidForce, match="servo of elbow: a sampled load"):
        scene.inverse_dynamics(SWING, ["servo of shoulder", "elbow"], [0.0, 0.2])


@pytest.mark.slow_for("True")
@pytest.mark.parametrize("by_force", [False, True])
def test_actuators_of_a_scene_with_other_parameters(by_force):
    scene = arm()
    for name in ("shoulder", "elbow") if by_force else ():
        scene.add(F.JointTorque(scene[name], function=lambda t, angle, rate: 1.0, name=f"servo of {name}"))
    other = scene.with_parameters({"gravity": (0.0, 0.0, 0.0)})
    names = [f"servo of {name}" if by_force else name for name in ("shoulder", "elbow")]
    found = other.inverse_dynamics(SWING, [other[name] for name in names], [0.3])
    (a, ad, add), (b, bd, bdd) = (ts.Motion(motion).value(0.3) for motion in SWING.values())
    weight = np.array(arm_torques(a, b, 0.0, 0.0, 0.0, 0.0))
    torques = np.array(arm_torques(a, b, ad, bd, add, bdd)) - weight
    np.testing.assert_allclose([found.load(other[name])[0] for name in names], torques, atol=HELD)
    linear = other.linearise(inputs=[other[name] for name in names])
    np.testing.assert_allclose(linear.F, np.eye(2), atol=ALGEBRA)


def test_times_of_a_solution():
    scene, _ = cart_pole()
    run = ts.simulate(scene, (0.0, 0.5), dense_output=True)
    found = scene.inverse_dynamics(run, ["rail", "pin"], t=[0.1, 0.2])
    np.testing.assert_array_equal(found.t, [0.1, 0.2])
    assert np.abs(found.load("pin")).max() < 1e-6
    with pytest.raises(ts.InvalidArgument, match="this motion has its own"):
        scene.inverse_dynamics(run.state, ["rail"], t=[0.1])


def test_motion_off_the_constraints_is_refused_by_name():
    scene = arm()
    q, qd = scene.start
    moved = SimpleNamespace(t=[0.0], q=q + 0.01, qd=qd, qdd=0.0 * q)
    with pytest.raises(ts.InconsistentState, match=r"the motion violates .* \(position\) at t = 0 s"):
        scene.inverse_dynamics(moved, ["elbow", "shoulder"])
