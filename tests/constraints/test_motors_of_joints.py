"""Motors of joints: they prescribe the coordinate of the joint, over any number of turns and wherever it stands."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import ALGEBRA, HELD

C, M = ts.constraints, ts.motions
ANGLED = {"Revolute": {}, "Cylindrical": {}, "Planar": {}, "Screw": {"lead": 0.1}}
SLIDING = {"Translational": {}, "Cylindrical": {}, "Screw": {"lead": 0.1}}
FAR = [0.3, -0.5, 2.0, 3.0, -3.1, 7.0, -20.0]  # rad


def arm(kind="Revolute", **given):
    """A bar of 1 m on a joint with a vertical axis, its two bodies out of line with the ground."""
    scene = ts.Scene(gravity=(0, 0, 0))
    base = scene.add_body(1.0, (1, 1, 1), orientation=(np.cos(0.3), 0, 0, np.sin(0.3)), name="base")
    scene.add(C.Fixed.at(scene.ground, base, point=(0, 0, 0), axis=(0, 0, 1), name="floor"))
    bar = scene.add_body(1.0, (0.01, 0.1, 0.1), position=(0.5, 0, 0), name="bar")
    joint = getattr(C, kind).at(base, bar, point=(0, 0, 0), axis=(0, 0, 1), name="joint", **given)
    return scene, scene.add(joint)


@pytest.mark.parametrize("angle", FAR)
@pytest.mark.parametrize("kind", ANGLED)
def test_assembly_takes_a_joint_to_the_angle_of_its_motor(kind, angle):
    """The angle, its turns and its rate; of a screw the travel, too."""
    scene, joint = arm(kind, **ANGLED[kind])
    motor = scene.add(C.RotationMotor.of(joint, angle=M.Ramp(angle, 2.0), name="motor"))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.0))
    np.testing.assert_allclose(solution.angle(joint), angle + 2.0 * solution.t, atol=HELD)
    np.testing.assert_allclose(solution.angle(motor), angle + 2.0 * solution.t, atol=HELD)
    np.testing.assert_allclose(solution.angle_rate(joint), 2.0, atol=HELD)
    if kind == "Screw":
        np.testing.assert_allclose(solution.displacement(joint), 0.1 * (angle + 2.0 * solution.t), atol=HELD)


@pytest.mark.parametrize("kind", SLIDING)
def test_assembly_takes_a_joint_to_the_displacement_of_its_motor(kind):
    scene, joint = arm(kind, **SLIDING[kind])
    scene.add(C.TranslationMotor.of(joint, displacement=M.Ramp(0.7, -0.2)))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.0))
    np.testing.assert_allclose(solution.displacement(joint), 0.7 - 0.2 * solution.t, atol=ALGEBRA)


@pytest.mark.parametrize("which", [0, 1])
def test_either_angle_of_a_universal_joint(which):
    scene = ts.Scene(gravity=(0, 0, 0))
    shaft = scene.add_body(1.0, (0.01, 0.1, 0.1), position=(0.5, 0, 0))
    cross = scene.add(C.Universal.at(scene.ground, shaft, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.RotationMotor.of(cross, angle=M.Sine(0.4, 3.0, 0.0, 1.0), which=which))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.0))
    np.testing.assert_allclose(solution.angle(cross)[:, which], 1.0 + 0.4 * np.sin(3.0 * solution.t), atol=HELD)
    with pytest.raises(ts.InvalidConstraint, match="which must be from 0 to 1"):
        C.RotationMotor.of(cross, angle=0.0, which=2)


@pytest.mark.parametrize("angle", FAR)
def test_a_start_elsewhere_is_refused(angle):
    """Both angles are named; a joint that stands there by `scene.set` is accepted."""
    scene, hinge = arm()
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(angle, 1.5), name="motor"))
    with pytest.raises(ts.InconsistentState, match=rf"RotationMotor 'motor' prescribes {angle:g} rad.*stands at 0 rad"):
        ts.simulate(scene, (0.0, 1.0))
    scene.set(hinge, angle=angle)
    solution = ts.simulate(scene, (0.0, 1.0))
    np.testing.assert_allclose(solution.angle(hinge), angle + 1.5 * solution.t, atol=HELD)


def test_a_wrong_rate_is_named():
    scene, hinge = arm()
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(0.0, 1.5), name="motor"))
    with pytest.raises(ts.InconsistentState, match=r"'motor' prescribes 1.5 rad/s.*Revolute 'joint' moves at 0 rad/s"):
        ts.simulate(scene, (0.0, 1.0))


def test_a_screw_that_is_a_turn_away_is_refused():
    """The rows of the motor and of the thread hold, and the nut is a pitch away."""
    scene, screw = arm("Screw", lead=0.1)
    motor = scene.add(C.RotationMotor.of(screw, angle=0.7, name="motor"))
    scene.assemble()
    motor.angle = 0.7 + 2.0 * np.pi
    with pytest.raises(ts.InconsistentState, match=r"'motor' prescribes 6\.98318531 rad.*'joint' stands at 0\.7 rad"):
        ts.simulate(scene, (0.0, 1.0))
    scene.assemble()
    assert abs(ts.simulate(scene, (0.0, 1.0)).displacement(screw)[-1] - 0.1 * (0.7 + 2.0 * np.pi)) < ALGEBRA


def test_a_joint_that_has_been_set_has_its_zero_where_it_was():
    scene, hinge = arm()
    scene.set(hinge, angle=0.3)
    scene.add(C.RotationMotor.of(hinge, angle=0.5, name="motor"))
    with pytest.raises(ts.InconsistentState, match=r"'motor' prescribes 0.5 rad.*'joint' stands at 0.3 rad"):
        ts.simulate(scene, (0.0, 1.0))
    with pytest.raises(ts.InconsistentState, match=r"angle=0.4 of Revolute 'joint' contradicts RotationMotor 'motor'"):
        scene.set(hinge, angle=0.4)
    scene.assemble()
    assert abs(ts.simulate(scene, (0.0, 1.0)).angle(hinge)[-1] - 0.5) < ALGEBRA


def four_bar():
    """A crank of 0.2 m, a rod of 0.5 m and a rocker of 0.4 m over 0.5 m, in a plane; the crank can turn."""
    scene = ts.Scene(gravity=(0, 0, 0))
    far, pin = np.array([0.5, 0, 0]), np.array([0.2, 0, 0])
    x = 0.2 + (0.5**2 - 0.4**2 + 0.3**2) / (2 * 0.3)
    top = np.array([x, np.sqrt(0.5**2 - (x - 0.2) ** 2), 0])
    ends = {"crank": (np.zeros(3), pin), "rod": (pin, top), "rocker": (far, top)}
    ground, bodies = scene.ground, {}
    for name, (one, other) in ends.items():
        bodies[name] = scene.add_body(1.0, (0.01, 0.01, 0.01), position=(one + other) / 2, name=name)
    hinge = scene.add(C.Revolute.at(ground, bodies["crank"], point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(C.Spherical.at(bodies["crank"], bodies["rod"], point=pin))
    scene.add(C.Universal.at(bodies["rod"], bodies["rocker"], point=top, axis=(0, 0, 1), axis_b=top - far))
    rocker = scene.add(C.Revolute.at(ground, bodies["rocker"], point=far, axis=(0, 0, 1), name="pivot"))
    return scene, hinge, rocker, np.arctan2(top[1], top[0] - 0.5)


@pytest.mark.parametrize("angle", [0.4, 2.0, 3.0, -2.5, 9.0])
def test_a_crank_in_a_loop_keeps_the_branch(angle):
    """The rocker's angle is the closed form of the open four-bar linkage."""
    scene, hinge, rocker, start = four_bar()
    scene.add(C.RotationMotor.of(hinge, angle=angle))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 0.1))
    pin = 0.2 * np.array([np.cos(angle), np.sin(angle)]) - (0.5, 0.0)
    reach = np.linalg.norm(pin)
    opening = np.arccos((reach**2 + 0.4**2 - 0.5**2) / (2 * reach * 0.4))
    expected = np.arctan2(pin[1], pin[0]) - opening - start
    assert abs(solution.angle(hinge)[-1] - angle) < HELD
    assert abs(np.angle(np.exp(1j * (solution.angle(rocker)[-1] - expected)))) < HELD


@pytest.mark.parametrize("begin", [0.0, 10.0])
def test_a_start_late_counts_the_turns_of_the_motor(begin):
    scene, hinge = arm()
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(0.0, 12.0)))
    scene.assemble(t=begin)
    solution = ts.simulate(scene, (begin, begin + 1.0))
    np.testing.assert_allclose(solution.angle(hinge), 12.0 * solution.t, rtol=HELD)
    later = ts.simulate(scene, (begin + 1.0, begin + 2.0), state=solution.state)
    np.testing.assert_allclose(later.angle(hinge), 12.0 * later.t, rtol=HELD)


def test_a_file_keeps_what_a_motor_prescribes(tmp_path):
    scene, hinge = arm()
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(7.0, 2.0), name="motor"))
    scene.assemble()
    scene.save(tmp_path / "arm.toml")
    solution = ts.simulate(ts.load(tmp_path / "arm.toml"), (0.0, 1.0))
    np.testing.assert_allclose(solution.angle("joint"), 7.0 + 2.0 * solution.t, atol=HELD)


@pytest.mark.slow
def test_a_controller_sees_the_angle_of_the_motor():
    """The motor holds what a torsion bar of 2 N m/rad pulls with at 7 rad."""
    scene, hinge = arm()
    motor = scene.add(C.RotationMotor.of(hinge, angle=7.0))
    scene.assemble()
    scene.add(ts.forces.JointTorque(hinge, function=lambda t, angle, rate: -2.0 * angle, name="bar"))
    _, torque = ts.simulate(scene, (0.0, 0.1)).reaction(motor, on="bar")
    np.testing.assert_allclose(torque[:, 2], 14.0, atol=HELD)
