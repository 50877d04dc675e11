"""Motors and other drivers: full turns without end, closed forms, power, both forms, every method, refusals."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.scenes import EPS
from tsdyn.taylor import layout as expansion_pack

C, M = ts.constraints, ts.motions
X, Y, Z = np.eye(3)
SPEED = 12.0  # rad/s
TURNS = 50
J = 0.3  # kg m^2, of the rotor about its axis
METHODS = {
    "taylor": {"integrator": "taylor", "rtol": 1e-12, "atol": 1e-12},
    "dop853": {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10},
    "null-space": {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10, "formulation": "null-space"},
    "nystrom4": {"integrator": ts.integrators.Nystrom4(step=1e-3)},
    "sdirk54": {"integrator": "sdirk54", "rtol": 1e-8, "atol": 1e-8},
}


def rotor(angle, rate=0.0, start=0.0, arm=0.0):
    """A wheel on a hinge along z, its centroid an arm off it, and its motor."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    centre = arm * np.array([np.cos(start), np.sin(start), 0.0])
    wheel = scene.add_body(
        2.0, (0.2, 0.25, J), centre, (np.cos(start / 2), 0, 0, np.sin(start / 2)),
        velocity=rate * np.cross(Z, centre), angular_velocity=(0, 0, rate), name="wheel",
    )  # fmt: skip
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=Z, name="hinge"))
    motor = scene.add(C.RotationMotor.of(hinge, angle=angle, name="motor"))
    return scene, wheel, motor


def loose(options):
    """What a fixed step's error is larger by."""
    return 1e3 if isinstance(options["integrator"], ts.integrators.Nystrom4) else 1.0


def held(solution):
    """Constraint errors at rounding, on all three levels."""
    solution.raise_if_failed()
    error = solution.constraint_error
    assert error.position.max() < 200 * EPS * (1.0 + np.abs(solution.q).max())
    assert error.velocity.max() < 2e3 * EPS * (1.0 + np.abs(solution.qd).max())
    assert error.acceleration.max() < 2e4 * EPS * (1.0 + np.abs(solution.qdd).max())


def turn(solution, body, axis=2):
    """The angle of a body about z, from its matrix."""
    first = solution.rotation(body)[:, :, 0]
    return np.arctan2(first[:, 1], first[:, 0])


def apart(angle, other):
    """The difference of angles, nearest to zero."""
    return np.abs(np.angle(np.exp(1j * (np.asarray(angle) - other))))


# motors


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_motor_turns_on_and_on(options):
    """Fifty turns at a constant speed: nothing is counted, and nothing is lost."""
    end = TURNS * 2.0 * np.pi / SPEED
    scene, wheel, motor = rotor(M.Ramp(0.0, SPEED), SPEED)
    solution = ts.simulate(scene, (0.0, end), t_eval=np.linspace(0.0, end, 301), **options)
    held(solution)
    assert apart(turn(solution, wheel), SPEED * solution.t).max() < 1e-12
    np.testing.assert_allclose(solution.angular_velocity(wheel)[:, 2], SPEED, rtol=1e-12)
    _, torque = solution.reaction(motor, on=wheel)
    np.testing.assert_allclose(torque, 0.0, atol=1e-9)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_motor_that_goes_to_and_fro(options):
    """Eight turns either way about an off-centre arm: angle, torque and power are the closed form's."""
    amplitude, w, arm = 16.0 * np.pi, 1.3, 0.4
    angle = M.Sine(amplitude, w)
    scene, wheel, motor = rotor(angle, amplitude * w, arm=arm)
    solution = ts.simulate(scene, (0.0, 2.5), t_eval=np.linspace(0.0, 2.5, 101), **options)
    held(solution)
    theta, rate, gain = angle(solution.t), angle.rate(solution.t), angle.acceleration(solution.t)
    assert apart(turn(solution, wheel), theta).max() < 2e-12
    np.testing.assert_allclose(solution.angular_velocity(wheel)[:, 2], rate, atol=1e-11 * amplitude * w)
    expected = (J + 2.0 * arm**2) * gain + 2.0 * 9.81 * arm * np.cos(theta)
    _, torque = solution.reaction(motor, on=wheel)
    np.testing.assert_allclose(torque[:, 2], expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(torque[:, :2], 0.0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(solution.power, expected * rate, atol=1e-9 * np.abs(expected * rate).max())


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
    assert apart(turn(solution, one), theta).max() < 1e-11
    assert apart(turn(solution, other), -math.sqrt(2.0) * theta).max() < 1e-10
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
        assert np.abs(scene.evaluate(t=t).Phi).max() < 1e-12
        with pytest.raises(ts.InconsistentState, match=r"'motor'.*opposite ways"):
            ts.simulate(scene, (t, t + 0.01))
        assert ts.simulate(scene, (t + 1.0, t + 1.01)).success


def test_an_angle_that_is_set_later():
    scene, wheel, motor = rotor(M.Ramp(0.0, 1.0), 1.0)
    motor.angle = lambda t: 1.0 * t + 0.5 * t**2
    solution = ts.simulate(scene, (0.0, 2.0), integrator="dop853", rtol=1e-10, atol=1e-10)
    held(solution)
    assert apart(turn(solution, wheel), solution.t + 0.5 * solution.t**2).max() < 1e-12
    motor.angle = 0.0
    wheel.angular_velocity = (0, 0, 0)
    still = ts.simulate(scene, (0.0, 1.0))
    assert apart(turn(still, wheel), 0.0).max() < 1e-13


def slider(motion):
    scene = ts.Scene()
    block = scene.add_body(2.0, (0.1, 0.1, 0.1), velocity=(0.0, 0.0, 0.6), name="block")
    joint = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=Z, name="guide"))
    return scene, block, scene.add(C.TranslationMotor.of(joint, displacement=motion, name="drive"))


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_translation_motor(options):
    travel = M.Sine(0.2, 3.0)
    scene, block, drive = slider(travel)
    solution = ts.simulate(scene, (0.0, 2.0), **options)
    held(solution)
    np.testing.assert_allclose(solution.position(block)[:, 2], travel(solution.t), atol=1e-13)
    force, _ = solution.reaction(drive, on=block)
    np.testing.assert_allclose(force[:, 2], 2.0 * (travel.acceleration(solution.t) + 9.81), atol=1e-9)
    np.testing.assert_allclose(solution.power, force[:, 2] * travel.rate(solution.t), atol=1e-9)


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
    np.testing.assert_allclose(solution.position(bead), np.einsum("kij,kj->ki", A, r), atol=1e-12)
    w = np.array([0, 0, 2.0])
    inside = rdd + 2.0 * np.cross(w, rd) + np.cross(w, np.cross(w, r))
    force, _ = solution.reaction(driver, on=bead)
    np.testing.assert_allclose(force, 0.7 * np.einsum("kij,kj->ki", A, inside), atol=1e-9)


# threads, racks and gears


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
    np.testing.assert_allclose(solution.position(screw)[:, 2], start + lead * theta, atol=1e-8 * loose(options))
    assert apart(turn(solution, screw), 0.4 + (solution.position(screw)[:, 2] - start) / lead).max() < 1e-11
    force, torque = solution.reaction(joint, on=screw)
    np.testing.assert_allclose(torque[:, 2], 0.002 * gain, rtol=1e-7 * loose(options))
    np.testing.assert_allclose(force[:, 2], 2.0 * (9.81 + lead * gain), rtol=1e-7 * loose(options))


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
    np.testing.assert_allclose(solution.position(rack)[:, 0], x, atol=1e-8 * loose(options))
    assert x[-1] / radius > 12.0
    # rolling: the rack passes under the wheel to +x, so the wheel turns about +z
    assert apart(turn(solution, pinion), solution.position(rack)[:, 0] / radius).max() < 1e-11


def pair(ratio, carrier_rate=None):
    """Two wheels on the ground, or on a carrier that turns about z."""
    scene = ts.Scene(gravity=(0, 0, 0))
    base = scene.ground
    if carrier_rate is not None:
        base = scene.add_body(1.0, (0.1, 0.1, 0.2), angular_velocity=(0, 0, carrier_rate), name="carrier")
        scene.add(C.Revolute.at(scene.ground, base, point=(0, 0, 0), axis=Z, name="main"))
    spin = carrier_rate or 0.0
    one = scene.add_body(1.0, (0.1, 0.1, 0.02), angular_velocity=(0, 0, 5.0 + spin), name="one")
    other = scene.add_body(
        2.0, (0.1, 0.1, 0.05), (0.3, 0.1, 0), velocity=np.cross((0, 0, spin), (0.3, 0.1, 0)),
        angular_velocity=(0, 0, 5.0 * ratio + spin), name="other",
    )  # fmt: skip
    scene.add(C.Revolute.at(base, one, point=(0, 0, 0), axis=Z, name="first"))
    scene.add(C.Revolute.at(base, other, point=other.position, axis=Z, name="second"))
    gear = scene.add(C.Gear.at(one, other, point_a=one.position, point_b=other.position, axis=Z, ratio=ratio, name="g"))
    return scene, one, other, gear


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
    assert apart(turn(solution, one), theta).max() < 1e-7 * loose(options)
    assert apart(turn(solution, other), ratio * np.unwrap(turn(solution, one))).max() < 1e-11
    _, through = solution.reaction(gear, on=other)
    np.testing.assert_allclose(through[:, 2], 0.05 * ratio * gain, rtol=1e-6 * loose(options))


def test_a_planet_gear_needs_its_line_of_centres_only():
    """Turns against a carrier that turns itself, free of torque: the ratio holds against the carrier."""
    scene, one, other, _ = pair(-0.75, 3.0)
    solution = ts.simulate(scene, (0.0, 4.0), rtol=1e-11, atol=1e-11, t_eval=np.linspace(0, 4, 201))
    held(solution)
    carrier = solution.scene.body("carrier")
    angles = [np.unwrap(turn(solution, body)) for body in (carrier, one, other)]
    assert np.ptp(angles[1]) > 25.0
    np.testing.assert_allclose(angles[2] - angles[0], -0.75 * (angles[1] - angles[0]), atol=1e-11)
    assert np.ptp(solution.energy) < 1e-9 * solution.energy[0]


def test_a_gear_goes_on_from_a_state_with_its_turns():
    scene, one, *_ = pair(-math.sqrt(2.0))
    first = ts.simulate(scene, (0.0, 2.0), integrator="dop853", rtol=1e-10, atol=1e-10)
    on = ts.simulate(scene, (2.0, 3.0), state=first.state, integrator="dop853", rtol=1e-10, atol=1e-10)
    held(on)
    assert apart(turn(on, one), 5.0 * on.t).max() < 1e-7
    dense = ts.simulate(scene, (0.0, 3.0), dense_output=True, rtol=1e-11, atol=1e-11)
    state = dense.at(np.linspace(0.0, 3.0, 40))
    ends = 2.0 * np.arctan2(state.q[:, [6, 13]], state.q[:, [3, 10]])
    assert apart(ends[:, 0], 5.0 * state.t).max() < 1e-9
    assert apart(ends[:, 1], -math.sqrt(2.0) * 5.0 * state.t).max() < 1e-9


# all of them


def everything():
    """Motors, a point led, a screw, a rack and gears, loosely coupled by springs."""
    scene, one, other, _ = pair(-0.6)
    scene.gravity = (0.5, -1.0, -9.81)
    screw = scene.add_body(1.0, (0.02, 0.02, 0.01), (1.0, 0.0, 0.2), name="screw")
    scene.add(C.Screw.at(scene.ground, screw, point=screw.position, axis=Z, lead=0.1, name="thread"))
    crank = scene.add_body(1.0, (0.02, 0.02, 0.01), (1.0, 1.0, 0.0), angular_velocity=(0, 0, 4.0), name="crank")
    hinge = scene.add(C.Revolute.at(scene.ground, crank, point=crank.position, axis=Z, name="hinge"))
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(0.3, 4.0) + M.Exponential(0.0, 1.0), name="motor"))
    arm = scene.add_body(0.5, (0.02, 0.01, 0.02), (1.0, 1.3, 0.0), velocity=(0.0, 0.0, 0.0), name="arm")
    path = (1.0, M.Sine(0.1, 2.0, 0.0, 1.3), M.Polynomial((0.0, 0.0, 0.2)))
    arm.velocity = (0.0, 0.2, 0.0)
    scene.add(C.PointDriver(scene.ground, arm, path=path, name="led"))
    link = ts.forces.Spring
    scene.add(link(arm, crank, point_a=(0.2, 0, 0), point_b=(0.3, 0, 0.1), stiffness=20.0, damping=0.5))
    scene.add(link(screw, one, point_a=(0.1, 0, 0), point_b=(0.1, 0, 0.1), stiffness=10.0))
    scene.add(link(screw, other, point_a=(0.1, 0.1, 0), point_b=(0.1, 0, 0.1), stiffness=10.0))
    return scene


def test_all_methods_agree():
    scene = everything()
    end = 1.0
    ends = {
        name: ts.simulate(scene, (0.0, end), **options).raise_if_failed().q[-1]
        for name, options in METHODS.items()
        if name != "nystrom4"
    }
    for name, q in ends.items():
        np.testing.assert_allclose(q, ends["taylor"], atol=1e-6 if name == "sdirk54" else 1e-8, err_msg=name)
    assert ts.simulate(scene, (0.0, 0.1)).method.startswith("Taylor")


def test_series_of_many_bodies_are_the_same(monkeypatch):
    """The loops that bring numbers into the cache ahead."""
    ends = []
    for limit in (expansion_pack.FAR, 0):
        monkeypatch.setattr(expansion_pack, "FAR", limit)
        ends.append(ts.simulate(everything(), (0.0, 0.3), **METHODS["taylor"]).raise_if_failed().q[-1])
    np.testing.assert_array_equal(*ends)


def test_both_forms_agree_to_rounding():
    scene = everything()
    method = ts.integrators.DOP853(step=2e-3)
    one, other = (
        ts.simulate(scene, (0.0, 0.2), integrator=method, formulation=form).raise_if_failed()
        for form in ("tangent", "null-space")
    )
    np.testing.assert_allclose(one.q, other.q, atol=1e4 * EPS * (1.0 + np.abs(one.q).max()))


@pytest.mark.parametrize("options", [METHODS["taylor"], METHODS["dop853"]], ids=["taylor", "dop853"])
def test_energy_less_work_stays(options):
    """What motors put in is what energy and dampers have."""
    solution = ts.simulate(everything(), (0.0, 1.0), dense_output=True, **options)
    held(solution)
    size = np.abs(solution.kinetic_energy).max() + np.ptp(solution.potential_energy)
    assert np.ptp(solution.energy) > 1e-2 * size
    assert np.ptp(solution.energy - solution.work) < 1e-8 * size


def test_dense_output_of_a_driven_scene_is_on_the_manifold():
    solution = ts.simulate(everything(), (0.0, 1.0), dense_output=True, rtol=1e-10, atol=1e-10)
    again = ts.simulate(everything(), (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 38), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(solution.at(again.t).q, again.q, atol=1e-9)


# a user's own functions


def shaken(t):
    return 1.0 + 0.2 * math.sin(3.0 * t) * np.exp(-0.1 * t)


@pytest.mark.parametrize("form", ["one function", "three", "motion"])
def test_a_function_alone_is_derived(form):
    wave = 1.0 + 0.2 * np.sin(3.0 * M.time) * np.exp(-0.1 * M.time)
    length = {
        "one function": shaken,
        "three": (shaken, wave_rate, wave_gain),
        "motion": wave,
    }[form]
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (0.6, 0.0, -0.8), name="bead")
    bead.velocity = np.array((0.6, 0.0, -0.8)) * wave.rate(0.0)
    scene.add(C.Distance(bead, scene.ground, length=length, name="string"))
    solution = ts.simulate(scene, (0.0, 1.0), integrator="dop853", rtol=1e-10, atol=1e-10, t_eval=[0.0, 1.0])
    held(solution)
    assert np.linalg.norm(solution.q[-1]) == pytest.approx(shaken(1.0), abs=1e-14)
    if form == "motion":
        assert ts.simulate(scene, (0.0, 1.0), integrator="taylor").success
    else:
        with pytest.raises(
            ts.InvalidArgument, match=r"Distance 'string': its length is a function of time.*ts.motions"
        ):
            ts.simulate(scene, (0.0, 1.0), integrator="taylor")


def wave_rate(t):
    return 0.2 * np.exp(-0.1 * t) * (3.0 * np.cos(3.0 * t) - 0.1 * np.sin(3.0 * t))


def wave_gain(t):
    return 0.2 * np.exp(-0.1 * t) * (-0.6 * np.cos(3.0 * t) + (0.01 - 9.0) * np.sin(3.0 * t))


def test_taylor_names_the_motor_with_a_function_of_a_user():
    scene, *_ = rotor(lambda t: 2.0 * t)
    with pytest.raises(ts.InvalidArgument, match=r"RotationMotor 'motor' turn.*its angle is a function of time"):
        ts.simulate(scene, (0.0, 1.0), integrator="taylor", initial_tol=10.0)


def test_a_constant_angle_that_is_driven():
    """A cone whose angle opens, about a line that turns freely."""
    angle = M.Sine(0.3, 2.0, 0.0, 1.0)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1.0, 1.1, 1.2), angular_velocity=(0.0, 0.6, 0.2))
    scene.add(C.Spherical(scene.ground, body))
    scene.add(C.ConstantAngle(scene.ground, body, axis_a=Z, axis_b=(np.sin(1.0), 0, np.cos(1.0)), angle=angle))
    scene.assemble()
    for options in (METHODS["taylor"], METHODS["dop853"]):
        solution = ts.simulate(scene, (0.0, 1.0), **options)
        held(solution)
        line = solution.rotation(body) @ (np.sin(1.0), 0, np.cos(1.0))
        np.testing.assert_allclose(np.arccos(line[:, 2]), angle(solution.t), atol=1e-12)


# motions as loads


def pushed(load, torque):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 1.1, 1.2), name="body")
    scene.add(ts.forces.Spring(body, scene.ground, point_a=(0.1, 0, 0), point_b=(1, 1, 1), actuator=load, name="left"))
    scene.add(ts.forces.Torque(body, torque=torque))
    return scene


def test_loads_may_be_motions():
    """As functions of a user's, without compiling any; Taylor has no series of loads."""
    wave = M.Sine(2.0, 3.0, 0.1)
    one = pushed(wave, (wave, 0.3, 2.0 * M.time))
    other = pushed(lambda t: 2.0 * np.sin(3.0 * t + 0.1), lambda t: (2.0 * np.sin(3.0 * t + 0.1), 0.3, 2.0 * t))
    first, second = (
        ts.simulate(scene, (0.0, 1.0), rtol=1e-9, atol=1e-9, dense_output=True).raise_if_failed()
        for scene in (one, other)
    )
    assert first.method == second.method
    assert first.method.startswith("DOP853")
    np.testing.assert_allclose(first.q, second.q, atol=1e-12)
    np.testing.assert_allclose(first.power, second.power, atol=1e-11)
    assert np.ptp(first.energy - first.work) < 1e-8
    with pytest.raises(ts.InvalidArgument, match="'left': its actuator is a function of time"):
        ts.simulate(one, (0.0, 1.0), integrator="taylor")


@pytest.mark.parametrize("torque", [(M.time, 0.0), (M.time, "x", 0.0), (M.time, 0.0, math.nan), M.time], ids=str)
def test_bad_motions_as_loads(torque):
    with pytest.raises(ts.InvalidForce, match=r"torque must be 3 of ts.motions or finite numbers"):
        pushed(1.0, torque)
