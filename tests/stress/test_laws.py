"""The laws that judge runs: a sound run keeps them, and each finds the fault that it is for."""

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.stress import judgement, laws
from tsdyn.stress.random_scenes import DrawnCase

C = ts.constraints


def scene(gravity=(0.0, 0.0, -9.81), held=True):
    """A double pendulum in space, or the same two bodies in free fall."""
    made = ts.Scene(gravity=gravity)
    one = made.add_body(1.0, (0.1, 0.2, 0.25), position=(0.5, 0.0, 0.0), angular_velocity=(0.0, 0.0, 0.0), name="one")
    two = made.add_body(2.0, (0.1, 0.2, 0.25), position=(1.5, 0.0, 0.0), name="two")
    if held:
        made.add(C.Revolute.at(made.ground, one, point=(0, 0, 0), axis=(0, 1, 0)))
    else:
        two.angular_velocity = (0.0, 0.0, 2.0)
        two.velocity = (0.0, 1.0, 0.0)
    made.add(C.Spherical.at(one, two, point=(1, 0, 0)))
    return made


def run(**options):
    return ts.simulate(scene(**options), (0.0, 0.5), dense_output=True).raise_if_failed()


def broken(solution):
    return {found.law for found in laws.findings(solution) if found.broken}


def test_a_sound_run_keeps_all_laws():
    assert not broken(run())
    assert not broken(run(held=False))


@pytest.mark.parametrize(
    ("name", "where", "by", "law"),
    [
        ("q", 0, 1e-7, "constraints, position"),
        ("qd", 2, 1e-6, "constraints, velocity"),
        ("qdd", 2, 1e-5, "constraints, acceleration"),
        ("q", 9, np.nan, "finite numbers"),
        ("qdd", 12, 1e-4, "torque balance"),
        ("qdd", 8, 1e-4, "force balance"),
        ("qd", 9, 1e-6, "dense output, qd"),
    ],
)
def test_a_fault_is_found(name, where, by, law):
    solution = run()
    getattr(solution, name)[-1, where] += by
    assert law in broken(solution)


def test_a_motor_that_is_a_turn_off_is_found():
    """No row tells whole turns."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(1.0, (1, 1, 1), angular_velocity=(0, 0, 2))
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    motor = scene.add(C.RotationMotor.of(hinge, angle=ts.motions.Ramp(0.0, 2.0)))
    solution = ts.simulate(scene, (0.0, 5.0))
    found = list(laws.motors(solution))
    assert len(found) == 2
    assert not any(each.broken for each in found)
    motor.angle = ts.motions.Ramp(2.0 * np.pi, 2.0)
    assert all(each.broken for each in laws.motors(solution))


def test_energy_that_is_lost_is_found():
    solution = run()
    sound, size = laws.energy_left(solution)
    assert sound < 1e-7 * size
    solution.qd[-1] *= 1.0 + 1e-4
    del solution.kinetic_energy
    assert laws.energy_left(solution)[0] > 1e-5 * size


def test_momenta_of_a_fall():
    assert max(laws.momentum_left(run(held=False))) < 1e-9
    assert max(laws.momentum_left(run())) > 1e-2  # the ground pushes


def test_momenta_of_a_loaded_scene_are_not_judged():
    made = ts.Scene(gravity=(0, 0, 0))
    body = made.add_body(1.0, (0.1, 0.2, 0.25))
    made.add(ts.forces.PointForce(body, force=(1, 0, 0), point_a=(0, 0.1, 0)))
    case = DrawnCase("loaded", made, (0.0, 0.5), {})
    assert judgement.momenta(case, ts.simulate(made, case.span, dense_output=True), None) == []


def test_an_error_that_does_not_fall_with_the_tolerance_is_found():
    """A method that is wrong whatever its tolerance: its runs end with the velocities of another scene."""
    made, other = scene(), scene(gravity=(0.0, 0.0, -9.80))
    case = DrawnCase("double pendulum", made, (0.0, 0.5), {"rtol": 1e-8, "atol": 1e-8})

    def right(case, **options):
        return ts.simulate(made, case.span, **{"dense_output": True} | case.options | options)

    def wrong(case, **options):
        return ts.simulate(other, case.span, **{"dense_output": True} | case.options | options)

    [found] = judgement.another_method(case, right(case), right)
    assert not found.broken
    [found] = judgement.another_method(
        case, right(case), lambda case, **o: (wrong if "integrator" in o else right)(case, **o)
    )
    assert found.broken
