"""Driven scenes as a whole: methods and forms agree, energy less work stays; functions of a user's, loads."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.driven import METHODS, Z, everything, held, rotor
from tests.helpers.tolerances import CLOSE, EPS, HELD, NEAR, ROUNDING, TIGHT

C, M = ts.constraints, ts.motions


@pytest.mark.slow
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
    assert np.ptp(solution.energy - solution.work) < NEAR * size


def test_dense_output_of_a_driven_scene_is_on_the_manifold():
    solution = ts.simulate(everything(), (0.0, 1.0), dense_output=True, rtol=1e-10, atol=1e-10)
    again = ts.simulate(everything(), (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 38), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(solution.at(again.t).q, again.q, atol=CLOSE)


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
    assert np.linalg.norm(solution.q[-1]) == pytest.approx(shaken(1.0), abs=ROUNDING)
    series = ts.simulate(scene, (0.0, 1.0), integrator="taylor", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(series.q[-1], solution.q[-1], atol=1e-9)


def wave_rate(t):
    return 0.2 * np.exp(-0.1 * t) * (3.0 * np.cos(3.0 * t) - 0.1 * np.sin(3.0 * t))


def wave_gain(t):
    return 0.2 * np.exp(-0.1 * t) * (-0.6 * np.cos(3.0 * t) + (0.01 - 9.0) * np.sin(3.0 * t))


def test_taylor_names_the_motor_with_a_function_of_a_user():
    scene, *_ = rotor((lambda t: 2.0 * t if t < 9.0 else 18.0, lambda t: 2.0, lambda t: 0.0))
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
        np.testing.assert_allclose(np.arccos(line[:, 2]), angle(solution.t), atol=HELD)


def pushed(load, torque):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 1.1, 1.2), name="body")
    scene.add(ts.forces.Spring(body, scene.ground, point_a=(0.1, 0, 0), point_b=(1, 1, 1), actuator=load, name="left"))
    scene.add(ts.forces.Torque(body, torque=torque))
    return scene


@pytest.mark.slow
def test_loads_may_be_motions():
    """As functions of a user's, without compiling any."""
    wave = M.Sine(2.0, 3.0, 0.1)
    one = pushed(wave, (wave, 0.3, 2.0 * M.time))
    other = pushed(lambda t: 2.0 * np.sin(3.0 * t + 0.1), lambda t: (2.0 * np.sin(3.0 * t + 0.1), 0.3, 2.0 * t))
    first, second = (
        ts.simulate(scene, (0.0, 1.0), rtol=1e-9, atol=1e-9, dense_output=True).raise_if_failed()
        for scene in (one, other)
    )
    assert first.method == second.method
    assert first.method.startswith("Taylor")
    np.testing.assert_allclose(first.q, second.q, atol=HELD)
    np.testing.assert_allclose(first.power, second.power, atol=TIGHT)
    assert np.ptp(first.energy - first.work) < NEAR


@pytest.mark.parametrize("torque", [(M.time, 0.0), (M.time, "x", 0.0), (M.time, 0.0, math.nan), M.time], ids=str)
def test_bad_motions_as_loads(torque):
    with pytest.raises(ts.InvalidForce, match=r"torque must be 3 of ts.motions or finite numbers"):
        pushed(1.0, torque)
