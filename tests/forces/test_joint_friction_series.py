"""Friction of joints by Taylor series: closed forms, minimal coordinates, stages, kinks of the normal load."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.rough_joints import (
    G,
    SmoothBall,
    chain,
    demand_balance,
    four_bar,
    pendulum,
    pendulum_rates,
)
from tests.helpers.tolerances import ALGEBRA, CLOSE, HELD, NEAR
from tsdyn.jit.kernels import twin
from tsdyn.testing.plug_in_checks import check_friction_series

C, F, I = ts.constraints, ts.forces, ts.integrators
PRECISE = {"integrator": "taylor", "rtol": 1e-13, "atol": 1e-13}
STAGES = PRECISE | {"integrator": "dop853"}


def wheel(push, **more):
    """A wheel on a horizontal shaft, pushed along it."""
    scene = ts.Scene()
    turn = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)  # its z along -y
    body = scene.add_body(3.0, (0.2, 0.2, 0.1), orientation=turn, angular_velocity=(0, 0, 20.0), name="wheel")
    shaft = scene.add(C.Revolute.at(body, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(F.RevoluteFriction(shaft, radius=0.02, collar_radius=0.03, **more))
    scene.add(F.PointForce(body, force=push))
    return scene, body


def test_checker_names_the_coefficient():
    of_law, of_load = twin(F.ContactFriction.series), twin(F.ContactFriction.normal_series)

    class Wrong(F.ContactFriction):
        @staticmethod
        def normal_series(x, f, par, k, s):
            return of_load(x, f, par, k, s) + (1e-8 if k == 3 else 0.0)

    class Double(F.ContactFriction):
        @staticmethod
        def series(x, xd, par, k, s, out):
            of_law(x, xd, par, k, s, out)
            out[1] += 1e-8 if k == 2 else 0.0

    for kind, message in ((Wrong, "3 of the normal load, by normal_series"), (Double, r"2 of out\[1\] \(conjugate to")):
        scene = ts.Scene()
        force = kind.example(np.random.default_rng(1), scene.add_body(1.0, (1, 1, 1)), scene.ground)
        with pytest.raises(ts.testing.CheckFailed, match=f"coefficient {message}"):
            check_friction_series(scene, scene.add(force), "Broken", np.random.default_rng(2))


def test_a_pendulum_against_minimal_coordinates_and_stages():
    scene, bar, pin, friction = pendulum()
    solution, other = (ts.simulate(scene, (0.0, 1.5), **given) for given in (PRECISE, STAGES))
    angle, rate = solve_ivp(pendulum_rates, (0, 1.5), (0, 0), method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    place = 0.8 * np.cos(angle), 0, -0.8 * np.sin(angle)
    np.testing.assert_allclose(solution.position(bar)[-1], place, atol=HELD)
    np.testing.assert_allclose(solution.angular_velocity(bar)[-1], (0, rate, 0), atol=10 * HELD)
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=HELD)
    assert 5 * solution.stats.steps < other.stats.steps
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max(), errors.acceleration.max()) < ALGEBRA
    demand_balance(scene, solution, (pin, friction))


def test_few_steps_are_longer_than_the_law_allows():
    """Orders are chosen by what bounds the steps of sharp laws; a step that is cut is cut to what the law allows."""
    scene, bar, *_ = pendulum()
    solution = ts.simulate(scene, (0.0, 6.0), integrator=I.Taylor(rtol=1e-6, atol=1e-6), t_eval=[6.0])
    angle, _ = solve_ivp(pendulum_rates, (0, 6), (0, 0), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(solution.position(bar)[-1], (0.8 * np.cos(angle), 0, -0.8 * np.sin(angle)), atol=1e-7)
    assert 10 * solution.stats.rejected < solution.stats.steps


@pytest.mark.parametrize("build", [lambda: chain(4)[0], lambda: four_bar()[0]], ids=["chain", "redundant four-bar"])
def test_mechanisms_against_stages(build):
    scene = build()
    solution, other = (ts.simulate(scene, (0.0, 0.3), **given) for given in (PRECISE, STAGES))
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=HELD)
    np.testing.assert_allclose(solution.qd[-1], other.qd[-1], atol=10 * HELD)
    np.testing.assert_allclose(solution.qdd[-1], other.qdd[-1], atol=1000 * HELD)


@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_a_part_of_the_load_that_passes_zero(phase):
    """The push against the collar reverses, or begins at zero: its part of the load has a kink there."""
    scene, body = wheel(lambda t: (0, 40.0 * np.sin(3.0 * t + phase), 0), kinetic=0.3, slip_velocity=1e-9)
    solution = ts.simulate(scene, (0.0, 2.0), **PRECISE | {"rtol": 1e-11, "atol": 1e-11})
    start, end = (2.0 * (x // np.pi) + 1.0 - np.cos(x % np.pi) for x in (phase, 6.0 + phase))  # integrals of |sin|
    impulse = 0.3 * 0.02 * (3.0 * G * 2.0 + 1.5 * 40.0 * (end - start) / 3.0)
    np.testing.assert_allclose(solution.angular_velocity(body)[-1, 2], 20.0 - impulse / 0.1, atol=HELD)


def test_the_default_method_and_what_is_between_its_steps():
    scene, *_ = pendulum()
    times = np.linspace(0.0, 0.5, 7)
    solution = ts.simulate(scene, (0.0, 0.5), dense_output=True)
    asked = ts.simulate(scene, (0.0, 0.5), t_eval=times)
    assert solution.method.startswith("Taylor")
    assert asked.q[-1].tobytes() == solution.q[-1].tobytes()
    there = [solution.at(t).qdd for t in times]
    back = [solution.at(t).qdd for t in times[::-1]][::-1]
    assert np.array(there).tobytes() == np.array(back).tobytes()
    np.testing.assert_allclose(there, asked.qdd, atol=CLOSE)
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=NEAR)


@pytest.mark.slow
def test_a_plug_in_with_series():
    ts.testing.check_force(SmoothBall, states=1)
    scene = ts.Scene()
    body = scene.add_body(1.0, (0.1, 0.2, 0.15), position=(0.5, 0, 0), angular_velocity=(1, 2, 3))
    body.velocity = np.cross((1, 2, 3), (0.5, 0, 0))
    ball = scene.add(C.Spherical(body, scene.ground, point_a=(-0.5, 0, 0)))
    scene.add(SmoothBall(ball, radius=0.05, kinetic=0.2, slip_velocity=0.01))
    solution, other = (ts.simulate(scene, (0.0, 0.5), **given) for given in (PRECISE, STAGES))
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=HELD)


@pytest.mark.slow
def test_a_law_that_is_written_anew_has_no_series():
    class Wet(SmoothBall):
        @staticmethod
        def normal_load(x, f, par):
            return 1.0

    scene = ts.Scene()
    body = scene.add_body(2.0, (1, 1, 1), angular_velocity=(1, 0, 0))
    ball = scene.add(C.Spherical(body, scene.ground))
    scene.add(Wet(ball, radius=0.1, kinetic=0.5, name="wet"))
    with pytest.raises(ts.InvalidArgument, match="Wet 'wet': Wet has no kernel `series` and `normal_series`"):
        ts.simulate(scene, (0.0, 1.0), integrator="taylor")
    assert ts.simulate(scene, (0.0, 1.0), max_steps=1).method.startswith("DOP853")
