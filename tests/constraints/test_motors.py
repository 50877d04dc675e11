"""Motors and led points: full turns without end, closed forms, refusals, every method."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.driven import METHODS, SPEED, TURNS, J, apart, held, pair, rotor, slider, turn
from tests.helpers.tolerances import ALGEBRA, CLOSE, EPS, FINE, HELD, TIGHT

C, M = ts.constraints, ts.motions
X, Y, Z = np.eye(3)


# motors


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_motor_turns_on_and_on(options):
    """Fifty turns at a constant speed: nothing is counted, and nothing is lost."""
    end = TURNS * 2.0 * np.pi / SPEED
    scene, wheel, motor = rotor(M.Ramp(0.0, SPEED), SPEED)
    solution = ts.simulate(scene, (0.0, end), t_eval=np.linspace(0.0, end, 301), **options)
    held(solution)
    assert apart(turn(solution, wheel), SPEED * solution.t).max() < HELD
    np.testing.assert_allclose(solution.angular_velocity(wheel)[:, 2], SPEED, rtol=HELD)
    _, torque = solution.reaction(motor, on=wheel)
    np.testing.assert_allclose(torque, 0.0, atol=CLOSE)


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_motor_that_goes_to_and_fro(options):
    """Eight turns either way about an off-centre arm: angle, torque and power are the closed form's."""
    amplitude, w, arm = 16.0 * np.pi, 1.3, 0.4
    angle = M.Sine(amplitude, w)
    scene, wheel, motor = rotor(angle, amplitude * w, arm=arm)
    solution = ts.simulate(scene, (0.0, 2.5), t_eval=np.linspace(0.0, 2.5, 101), **options)
    held(solution)
    theta, rate, gain = angle(solution.t), angle.rate(solution.t), angle.acceleration(solution.t)
    assert apart(turn(solution, wheel), theta).max() < 2 * HELD
    np.testing.assert_allclose(solution.angular_velocity(wheel)[:, 2], rate, atol=TIGHT * amplitude * w)
    expected = (J + 2.0 * arm**2) * gain + 2.0 * 9.81 * arm * np.cos(theta)
    _, torque = solution.reaction(motor, on=wheel)
    np.testing.assert_allclose(torque[:, 2], expected, atol=CLOSE * np.abs(expected).max())
    np.testing.assert_allclose(torque[:, :2], 0.0, atol=CLOSE * np.abs(expected).max())
    np.testing.assert_allclose(solution.power, expected * rate, atol=CLOSE * np.abs(expected * rate).max())


@pytest.mark.parametrize("name", ["dop853", "null-space", "rk45"])
def test_a_driven_step_never_turns_by_a_whole_turn(name):
    """No error would say so: what is driven is where it should be after any step. Wheels of a gear count on it."""
    scene, one, other, _ = pair(-math.sqrt(2.0))
    hinge = next(joint for joint in scene.constraints if joint.name == "first")
    scene.add(C.RotationMotor.of(hinge, angle=M.Polynomial((0.0, 5.0, 40.0, 10.0)), name="motor"))
    options = {"formulation": "null-space", "integrator": "dop853"} if name == "null-space" else {"integrator": name}
    solution = ts.simulate(scene, (0.0, 2.0), rtol=1e-3, atol=1e-3, **options)
    held(solution)
    theta = 5.0 * solution.t + 40.0 * solution.t**2 + 10.0 * solution.t**3
    assert np.diff(theta).max() < 2.0
    assert apart(turn(solution, one), theta).max() < TIGHT
    assert apart(turn(solution, other), -math.sqrt(2.0) * theta).max() < FINE
    assert solution.stats.rejected < 0.2 * solution.stats.steps


def test_references_give_the_zero_of_the_angle():
    scene, wheel, _ = rotor(0.0)
    motor = C.RotationMotor(
        scene.ground, wheel, axis_a=Z, axis_b=Z, reference_a=(1, 0, 2), reference_b=(1, 1, 0), angle=math.pi / 4
    )
    (part,) = motor.parts
    np.testing.assert_allclose(part.reference_a, X, atol=EPS)
    np.testing.assert_allclose(part.across_a, Y, atol=EPS)
    np.testing.assert_allclose(part.reference_b, (math.sqrt(0.5), math.sqrt(0.5), 0), atol=EPS)
    assert motor.axis_a is not None


@pytest.mark.parametrize("given", ["reference_a", "reference_b", None])
def test_what_is_left_out_follows_from_the_bodies(given):
    """The angle now is that at t = 0."""
    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1, 1, 1), orientation=(np.cos(0.6), 0, 0, np.sin(0.6)))
    references = {} if given is None else {given: (1, 2, 3)}
    scene.add(C.RotationMotor(scene.ground, wheel, axis_a=Z, axis_b=Z, angle=M.Ramp(2.5, 1.0), **references))
    assert abs(scene.evaluate().Phi[0]) < 4 * EPS


def test_the_opposed_start_is_refused_at_any_time():
    """Half a turn off meets the row; what is opposed depends on the time of the start."""
    scene, wheel, _ = rotor(M.Ramp(0.0, math.pi))
    ts.simulate(scene, (0.0, 0.01), initial_tol=10.0)
    for t in (0.0, 2.0):
        wheel.orientation, wheel.angular_velocity = (0, 0, 0, 1), (0, 0, math.pi)
        assert np.abs(scene.evaluate(t=t).Phi).max() < HELD
        with pytest.raises(ts.InconsistentState, match=r"'motor'.*opposite ways"):
            ts.simulate(scene, (t, t + 0.01))
        assert ts.simulate(scene, (t + 1.0, t + 1.01)).success


def test_an_angle_that_is_set_later():
    scene, wheel, motor = rotor(M.Ramp(0.0, 1.0), 1.0)
    motor.angle = lambda t: 1.0 * t + 0.5 * t**2
    solution = ts.simulate(scene, (0.0, 2.0), integrator="dop853", rtol=1e-10, atol=1e-10)
    held(solution)
    assert apart(turn(solution, wheel), solution.t + 0.5 * solution.t**2).max() < HELD
    motor.angle = 0.0
    wheel.angular_velocity = (0, 0, 0)
    still = ts.simulate(scene, (0.0, 1.0))
    assert apart(turn(still, wheel), 0.0).max() < ALGEBRA


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_translation_motor(options):
    travel = M.Sine(0.2, 3.0)
    scene, block, drive = slider(travel)
    solution = ts.simulate(scene, (0.0, 2.0), **options)
    held(solution)
    np.testing.assert_allclose(solution.position(block)[:, 2], travel(solution.t), atol=ALGEBRA)
    force, _ = solution.reaction(drive, on=block)
    np.testing.assert_allclose(force[:, 2], 2.0 * (travel.acceleration(solution.t) + 9.81), atol=CLOSE)
    np.testing.assert_allclose(solution.power, force[:, 2] * travel.rate(solution.t), atol=CLOSE)


@pytest.mark.slow_for("*sdirk54*")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_point_is_led_in_the_frame_of_a_body_that_turns(options):
    """A bead led along a path on a turning disc: its place, and the force with Coriolis and all."""
    disc_turn, path = M.Ramp(0.0, 2.0), (M.Sine(0.3, 1.7, 0.2, 0.5), M.Polynomial((0.1, 0.2, -0.3)), 0.25)
    scene = ts.Scene(gravity=(0, 0, 0))
    disc = scene.add_body(1.0, (1, 1, 1), angular_velocity=(0, 0, 2.0), name="disc")
    place = np.array([path[0](0.0), path[1](0.0), 0.25])
    rate = np.array([path[0].rate(0.0), path[1].rate(0.0), 0.0]) + np.cross((0, 0, 2.0), place)
    bead = scene.add_point_mass(0.7, position=place, velocity=rate, name="bead")
    hinge = scene.add(C.Revolute.at(scene.ground, disc, point=(0, 0, 0), axis=Z))
    scene.add(C.RotationMotor.of(hinge, angle=disc_turn))
    driver = scene.add(C.PointDriver(disc, bead, path=path, name="guide"))
    solution = ts.simulate(scene, (0.0, 1.5), **options)
    held(solution)
    t = solution.t
    c, s = np.cos(2.0 * t), np.sin(2.0 * t)
    A = np.array([[c, -s, 0 * t], [s, c, 0 * t], [0 * t, 0 * t, 1 + 0 * t]]).transpose(2, 0, 1)
    r = np.transpose([path[0](t), path[1](t), 0.25 + 0 * t])
    rd = np.transpose([path[0].rate(t), path[1].rate(t), 0 * t])
    rdd = np.transpose([path[0].acceleration(t), path[1].acceleration(t), 0 * t])
    np.testing.assert_allclose(solution.position(bead), np.einsum("kij,kj->ki", A, r), atol=HELD)
    w = np.array([0, 0, 2.0])
    inside = rdd + 2.0 * np.cross(w, rd) + np.cross(w, np.cross(w, r))
    force, _ = solution.reaction(driver, on=bead)
    np.testing.assert_allclose(force, 0.7 * np.einsum("kij,kj->ki", A, inside), atol=CLOSE)
