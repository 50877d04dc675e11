"""`scene.kinematics`: closed forms, runs of the same scene, branches, turns, and what stops it."""

import pickle

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_loops import bricard, four_bar, parallelogram
from tests.helpers.driven import everything
from tests.helpers.tolerances import ALGEBRA, CLOSE, FINE, HELD, TIGHT

C, M = ts.constraints, ts.motions
X, Y, Z = np.eye(3)
R, L, RATE = 0.2, 0.5, 3.0


def slider_crank(angle=0.0, rate=None):
    """A crank of 0.2 m, a rod of 0.5 m and a slider along x; gravity along -y."""
    scene = ts.Scene(gravity=(0, -9.81, 0))
    knee = R * np.array([np.cos(angle), np.sin(angle), 0.0])
    end = np.array([knee[0] + np.sqrt(L**2 - knee[1] ** 2), 0.0, 0.0])
    turned = [(np.cos(a / 2), 0, 0, np.sin(a / 2)) for a in (angle, -np.arcsin(knee[1] / L))]
    crank = scene.add_body(1.0, (0.001, 0.01, 0.01), knee / 2, turned[0], name="crank")
    rod = scene.add_body(2.0, (0.02, 0.03, 0.04), (knee + end) / 2, turned[1], name="rod")
    slider = scene.add_body(3.0, (0.1, 0.1, 0.1), end, name="slider")
    hinge = scene.add(C.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=Z, name="hinge"))
    scene.add(C.Revolute.at(crank, rod, point=knee, axis=Z, name="knee"))
    scene.add(C.Revolute.at(rod, slider, point=end, axis=Z, name="pin"))
    scene.add(C.Translational.at(scene.ground, slider, point=end, axis=X, name="rail"))
    if rate is not None:
        scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(0.0, rate), name="motor"))
    return scene


def slider_motion(theta):
    """Position, velocity, acceleration of the slider, and angle, rate, acceleration of the rod."""
    sine, cosine = np.sin(theta), np.cos(theta)
    beta = -np.arcsin(R * sine / L)
    rate = -R * RATE * cosine / (L * np.cos(beta))
    gain = (R * RATE**2 * sine + L * rate**2 * np.sin(beta)) / (L * np.cos(beta))
    x = R * cosine + L * np.cos(beta)
    v = -R * RATE * sine - L * rate * np.sin(beta)
    a = -R * RATE**2 * cosine - L * gain * np.sin(beta) - L * rate**2 * np.cos(beta)
    return (x, v, a), (beta, rate, gain)


def test_slider_crank_has_its_closed_form():
    scene, t = slider_crank(rate=RATE), np.linspace(0.0, 5.0, 41)
    found = scene.kinematics(t)
    (x, v, a), (beta, rate, gain) = slider_motion(RATE * t)
    assert found.success
    np.testing.assert_array_equal(found.t, t)
    np.testing.assert_allclose(found.position("slider")[:, 0], x, atol=ALGEBRA)
    np.testing.assert_allclose(found.velocity("slider")[:, 0], v, atol=ALGEBRA)
    np.testing.assert_allclose(found.acceleration("slider")[:, 0], a, atol=HELD)
    np.testing.assert_allclose(found.angle("hinge"), RATE * t, atol=HELD)
    np.testing.assert_allclose(found.angle("knee"), beta - RATE * t, atol=HELD)
    np.testing.assert_allclose(found.angle_rate("knee"), rate - RATE, atol=HELD)
    # the torque of the motor by virtual work; the energy of the crank is constant
    middle = np.stack((-R * RATE * np.sin(RATE * t) - L / 2 * rate * np.sin(beta), L / 2 * rate * np.cos(beta)))
    middle[1] += R * RATE * np.cos(RATE * t)
    gains = np.stack(
        (
            -R * RATE**2 * np.cos(RATE * t) - L / 2 * (gain * np.sin(beta) + rate**2 * np.cos(beta)),
            -R * RATE**2 * np.sin(RATE * t) + L / 2 * (gain * np.cos(beta) - rate**2 * np.sin(beta)),
        )
    )
    power = 2.0 * (middle * gains).sum(axis=0) + 0.04 * rate * gain + 3.0 * v * a
    power += 9.81 * (2.0 * middle[1] + R / 2 * RATE * np.cos(RATE * t))
    torque = found.reaction("motor", on="crank")[1]
    np.testing.assert_allclose(torque[:, 2], power / RATE, atol=TIGHT)
    np.testing.assert_allclose(found.power_of("motor"), power, atol=TIGHT)
    assert max(error.max() for error in found.constraint_error) < HELD


@pytest.mark.parametrize("build", [four_bar, slider_crank, lambda: four_bar(planar=True)])
def test_a_run_of_the_same_scene_agrees(build):
    scene = build()
    rate = 3.0
    scene.add(C.RotationMotor.of(scene.constraints[0], angle=M.Sine(0.7, rate / 0.7), name="motor"))
    t = np.linspace(0.0, 2.0, 21)
    found = scene.kinematics(t)
    scene.place(found.q[0], found.qd[0])
    run = ts.simulate(scene, (0.0, 2.0), t_eval=t, rtol=1e-13, atol=1e-13)
    for name in ("q", "qd", "qdd"):
        np.testing.assert_allclose(getattr(found, name), getattr(run, name), atol=CLOSE, err_msg=name)
    np.testing.assert_allclose(found.reaction("motor")[1], run.reaction("motor")[1], atol=CLOSE)
    np.testing.assert_allclose(found.energy, run.energy, atol=CLOSE)


def test_overconstrained_loop_in_space():
    """Six redundant ways to hold: the Bricard linkage, driven at one joint."""
    scene = bricard()
    joint = scene.constraints[1]
    scene.add(C.RotationMotor.of(joint, angle=M.Sine(0.3, 2.0), name="motor"))
    t = np.linspace(0.0, 3.0, 13)
    found = scene.kinematics(t)
    assert found.success, found.message
    np.testing.assert_allclose(found.angle(joint), 0.3 * np.sin(2.0 * t), atol=HELD)
    assert max(error.max() for error in found.constraint_error) < TIGHT
    scene.place(found.q[0], found.qd[0])
    run = ts.simulate(scene, (0.0, 3.0), rtol=1e-12, atol=1e-12, t_eval=t)
    np.testing.assert_allclose(found.qdd, run.qdd, atol=CLOSE)


@pytest.mark.parametrize("loops", [1, 3])
def test_parallelogram_goes_straight_through_its_flat_positions(loops):
    scene = parallelogram(loops=loops)
    scene.add(C.RotationMotor.of(scene.constraints[0], angle=M.Ramp(0.0, 6.0)))
    found = scene.kinematics(np.linspace(0.0, 1.2, 25))
    assert found.success, found.message
    for body in scene.bodies:
        expected = 6.0 if "crank" in body.name else 0.0
        np.testing.assert_allclose(found.angular_velocity(body)[:, 2], expected, atol=FINE)


def test_turns_are_counted_between_few_times_in_any_order():
    scene = four_bar()
    hinge = scene.constraints[0]
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(0.0, 3.0)))
    t = np.array([0.0, 50.0, 100.0, 20.0])
    found = scene.kinematics(t)
    np.testing.assert_allclose(found.angle(hinge), 3.0 * t, atol=FINE)
    one = scene.kinematics(50.0)  # from the poses at t = 0
    np.testing.assert_allclose(one.q[0], found.q[1], atol=TIGHT)
    on = scene.kinematics([60.0], state=one.state)
    assert on.angle(hinge)[0] == pytest.approx(180.0, abs=FINE)


def test_branch_is_that_of_the_state():
    """The same slider, the crank above the rail or below it."""
    for sign in (1.0, -1.0):
        scene = slider_crank(angle=sign * 1.2)
        x = scene["slider"].position[0]
        scene.add(C.TranslationMotor.of(scene["rail"], displacement=M.Ramp(0.0, -0.1), name="push"))
        found = scene.kinematics([0.0, 1.0, 2.0])
        expected = x - 0.1 * found.t
        cosine = (R**2 + expected**2 - L**2) / (2 * R * expected)
        np.testing.assert_allclose(found.angle("hinge") + sign * 1.2, sign * np.arccos(cosine), atol=FINE)


def test_dead_centre_ends_the_analysis_with_what_it_had():
    scene = slider_crank(angle=1.2)
    x = scene["slider"].position[0]
    scene.add(C.TranslationMotor.of(scene["rail"], displacement=M.Ramp(0.0, 0.1), name="push"))
    found = scene.kinematics(np.linspace(0.0, 5.0, 51))
    end = (R + L - x) / 0.1
    assert not found.success
    assert found.reached == pytest.approx(end, abs=1e-6)
    assert found.t.size == int(end / 0.1) + 1
    assert found.q.shape == (found.t.size, 21)
    for part in (f"t = {found.reached:.9g} s", "of 51 times", "singular configuration", "drive another coordinate"):
        assert part in found.message
    with pytest.raises(ts.StepFailure, match="drive another coordinate"):
        found.raise_if_failed()
    assert "singular configuration" in str(found)


def test_every_kind_of_driver_at_once():
    scene = everything()  # a motor, a path, a screw, gears
    t = np.linspace(0.0, 2.0, 9)
    with pytest.raises(ts.InvalidArgument, match=r"5 degrees of freedom are left: first\.angle, thread\.angle, arm"):
        scene.kinematics(t)
    scene.add(C.RotationMotor.of(scene["first"], angle=M.Sine(0.4, 3.0)))
    scene.add(C.RotationMotor.of(scene["thread"], angle=M.Sine(0.2, 2.0, 0.3, -0.2 * np.sin(0.3))))
    for axis, other in ((X, Y), (Y, Z), (Z, X)):
        scene.add(C.Dot1(scene.ground, scene["arm"], axis_a=axis, axis_b=other, value=M.Polynomial((0.0,))))
    found = scene.kinematics(t)
    assert found.success, found.message
    scene.place(found.q[0], found.qd[0])
    run = ts.simulate(scene, (0.0, 2.0), t_eval=t, rtol=1e-13, atol=1e-13)
    for name in ("q", "qd", "qdd"):
        np.testing.assert_allclose(getattr(found, name), getattr(run, name), atol=CLOSE, err_msg=name)
    np.testing.assert_allclose(found.power, run.power, atol=CLOSE)


@pytest.mark.parametrize("power", [2, 3, 5])
def test_motion_from_rest_of_a_point(power):
    scene = ts.Scene()
    bead = scene.add_point_mass(2.0, name="bead")
    path = (M.Polynomial((0.0,) * power + (1.0,)), 0.0, 0.0)
    driver = scene.add(C.PointDriver(scene.ground, bead, path=path))
    t = np.linspace(0.0, 2.0, 5)
    found = scene.kinematics(t)
    np.testing.assert_allclose(found.position(bead)[:, 0], t**power, atol=ALGEBRA)
    force = 2.0 * power * (power - 1) * t ** (power - 2)
    np.testing.assert_allclose(found.reaction(driver, on=bead)[0][:, 0], force, atol=HELD)


def test_start_at_a_dead_centre_is_refused():
    scene = slider_crank()
    scene.add(C.TranslationMotor.of(scene["rail"], displacement=M.Ramp(0.0, -0.1), name="push"))
    with pytest.raises(ts.SingularConfiguration, match=r"t = 0 s \(.*push.* dead centre"):
        scene.kinematics([0.0, 1.0])


def test_tables_are_followed_over_their_knots():
    t = np.linspace(0.0, 2.0, 9)
    scene = slider_crank()
    table = ts.Table(t, 0.3 * np.sin(2.0 * t))
    scene.add(C.RotationMotor.of(scene["hinge"], angle=table, name="motor"))
    found = scene.kinematics([0.0, 0.3, 1.9])
    expected = ts.Motion(table).over(found.t)
    np.testing.assert_allclose(found.angle("hinge"), expected[0], atol=HELD)
    with pytest.raises(ts.InvalidConstraint, match="covers"):
        scene.kinematics([0.0, 3.0])


def test_result_is_a_solution(tmp_path):
    scene = slider_crank(rate=RATE)
    found = scene.kinematics(np.linspace(0.0, 1.0, 5))
    assert repr(found) == f"<KinematicAnalysis: success at t = 1 s: 5 outputs, {found.stats.steps} steps>"
    assert str(found).startswith("KinematicAnalysis\n  ended")
    assert "<table>" in found._repr_html_()
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.reaction("motor")[1], found.reaction("motor")[1])
    assert found[1:3].t.size == 2
    pytest.importorskip("h5py")
    loaded = ts.load(found.save(tmp_path / "turn.h5"), scene=scene)
    np.testing.assert_array_equal(loaded.reaction("motor")[1], found.reaction("motor")[1])
    assert "Solution" in str(loaded)
    with pytest.raises(ts.InvalidArgument, match="no interpolants"):
        found.at(0.5)
    with pytest.raises(ts.InvalidArgument, match=r"integrate `\.power`"):
        found.work_of("motor")
    run = ts.simulate(scene, (1.0, 1.1), state=found.state)
    assert run.angle("hinge")[-1] == pytest.approx(RATE * 1.1, abs=CLOSE)


def test_what_is_free_is_named():
    with pytest.raises(ts.InvalidArgument, match=r"1 degree of freedom is left: hinge\.angle\. Drive"):
        slider_crank().kinematics([0.0])
    scene = ts.Scene()
    scene.add_body(1.0, (1, 1, 1), name="stone")
    with pytest.raises(ts.InvalidArgument, match=r"6 degrees of freedom are left: stone\.x, stone\.y"):
        scene.kinematics([0.0])


@pytest.mark.parametrize("times", [[], "now", [0.0, np.nan], [[0.0, 1.0]], None])
def test_wrong_times_are_refused(times):
    with pytest.raises(ts.InvalidArgument, match="t must be a finite time"):
        slider_crank(rate=RATE).kinematics(times)


def test_sampled_loads_are_refused():
    scene = slider_crank(rate=RATE)
    scene.add(ts.forces.JointTorque(scene["knee"], function=lambda t, angle, rate: 1.0, period=0.1, name="held"))
    with pytest.raises(ts.InvalidForce, match="held: a sampled load"):
        scene.kinematics([0.0])


def test_inconsistent_start_is_refused_by_name():
    scene = slider_crank(rate=RATE)
    scene["slider"].position = (1.0, 0.0, 0.0)
    with pytest.raises(ts.InconsistentState, match="pin"):
        scene.kinematics([0.0])


def test_motion_that_is_not_finite_ends_the_analysis():
    scene = slider_crank()
    scene.add(C.RotationMotor.of(scene["hinge"], angle=lambda t: np.sqrt(1.0 - t) - 1.0))
    found = scene.kinematics([0.0, 0.5, 1.5])
    assert not found.success
    assert found.t.tolist() == [0.0, 0.5]


@pytest.mark.slow
def test_cost_is_linear_in_the_bodies():
    scene = chain_of_motors(300)
    found = scene.kinematics(np.linspace(0.0, 1.0, 3))
    assert found.stats.steps == 50
    turn = 0.01 * np.sin(2.0 * found.t)[:, None] * np.arange(1, 301)
    np.testing.assert_allclose(found.position("link 299", point=(0.5, 0, 0))[:, 0], np.cos(turn).sum(axis=1), atol=FINE)
    carried = sum(found.acceleration(body) for body in scene.bodies) + 300 * np.array([0.0, 0.0, 9.81])
    np.testing.assert_allclose(found.reaction("pin 0", on="link 0")[0], carried, rtol=CLOSE, atol=1e-6)


def chain_of_motors(count):
    """Rods of 1 m, each driven against the one before."""
    scene, before = ts.Scene(), None
    for i in range(count):
        rod = scene.add_body(1.0, (0.01, 0.1, 0.1), (i + 0.5, 0, 0), name=f"link {i}")
        pin = scene.add(C.Revolute.at(before or scene.ground, rod, point=(i, 0, 0), axis=Y, name=f"pin {i}"))
        scene.add(C.RotationMotor.of(pin, angle=M.Sine(0.01, 2.0)))
        before = rod
    return scene
