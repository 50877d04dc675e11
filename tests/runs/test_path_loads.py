"""Loads that change within a small part of the path: no method passes over them, wherever they are."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import FAIR, FINE, LOOSE
from tsdyn.model.equations import watched_loads

F, C = ts.forces, ts.constraints
TOLERANCES = {"rtol": 1e-8, "atol": 1e-10}
METHODS = {
    "default": {},
    **{name: {"integrator": name} for name in ("taylor", "dop853", "rk45", "radau", "sdirk54")},
    "null-space": {"integrator": "dop853", "formulation": "null-space"},
    "maggi-kane": {"integrator": "rk45", "formulation": "maggi-kane"},
}
STAGES = [name for name in METHODS if name != "taylor"]


def bump(t, state, *, at=0.5, width=1e-3, work=0.3):
    """A force of so much work over its whole width, J."""
    return (work / (width * math.sqrt(math.pi)) * np.exp(-(((state[0] - at) / width) ** 2)), 0.0, 0.0)


def bump_of_joint(t, coordinate, rate, *, at=0.5, width=1e-3, work=0.3):
    return work / (width * math.sqrt(math.pi)) * np.exp(-(((coordinate - at) / width) ** 2))


def box(t, state, *, at=0.5, width=1e-3, work=0.3):
    return (work / width if at < state[0] < at + width else 0.0, 0.0, 0.0)


def bump_of_rate(t, state, *, at=1.5, width=1e-3, height=20.0):
    return (1.0 + height * np.exp(-(((state[7] - at) / width) ** 2)), 0.0, 0.0)


def train(t, state, *, at=0.5, width=1e-4, work=0.03):
    """Eleven bumps, six widths apart."""
    x = state[0] - at
    x -= 6.0 * width * round(x / (6.0 * width)) if abs(x) < 33.0 * width else 0.0
    return (work / (width * math.sqrt(math.pi)) * np.exp(-((x / width) ** 2)), 0.0, 0.0)


def mass(force, **values):
    """A mass of 1 kg that flies along x at 1 m/s."""
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_point_mass(1.0, velocity=(1, 0, 0))
    scene.add(F.PointForce(body, force=force, name="push"))
    return scene.with_parameters({f"push.force.{name}": value for name, value in values.items()})


def arm(function, **values):
    """A body of 1 kg m^2 on a hinge, at 1 rad/s."""
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1, 1, 1), angular_velocity=(0, 0, 1))
    hinge = scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(F.JointTorque(hinge, function=function, name="push"))
    return scene.with_parameters({f"push.function.{name}": value for name, value in values.items()})


def run(scene, name, span=(0.0, 1.0), **options):
    solution = ts.simulate(scene, span, **{**TOLERANCES, **METHODS[name], **options})
    assert solution.success, solution.message
    return solution


def speed(solution):
    """Of the only body: m/s along x of a mass, rad/s of an arm."""
    return np.linalg.norm(solution.qd[-1]) * (1.0 if solution.qd.shape[1] == 3 else 2.0)


@pytest.mark.slow_but("*-taylor", "*-dop853", "*-rk45", "bump-default")
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("make", [bump, bump_of_joint], ids=["bump", "joint"])
def test_the_work_of_bumps_and_notches_anywhere(make, name):
    """v^2 = 1 + 2 work, from a bump and a notch of a ten-thousandth to a tenth of the way."""
    rng = np.random.default_rng(3)
    for i in range(12):
        width, work = 10.0 ** rng.uniform(-4, -1.3), (0.3, -0.3)[i % 2]
        values = {"at": rng.uniform(0.05, 0.4) + 3.0 * width, "width": width, "work": work}
        found = run((mass if make is bump else arm)(make, **values), name, (0.0, 1.5))
        assert speed(found) == pytest.approx(math.sqrt(1.0 + 2.0 * work), abs=LOOSE)


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_a_box_of_a_thousandth_of_the_way(name):
    for at in (0.1, 0.3217, 0.9):
        found = run(mass(box, at=at), name)
        assert speed(found) == pytest.approx(math.sqrt(1.6), abs=LOOSE)


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_a_bump_in_velocity(name):
    """A force of 1 N is 21 N while the speed is within 1e-3 of 1.5 m/s: the time that this takes is less."""
    v = 1.5 + np.linspace(-0.01, 0.01, 4001)
    saved = np.trapezoid(1.0 - 1.0 / (1.0 + 20.0 * np.exp(-(((v - 1.5) / 1e-3) ** 2))), v)
    assert speed(run(mass(bump_of_rate), name)) == pytest.approx(2.0 + saved, abs=FAIR)


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_a_train_with_gaps_below_a_thousandth_of_the_run(name):
    found = run(mass(train), name)
    assert speed(found) == pytest.approx(math.sqrt(1.0 + 2.0 * 11 * 0.03), abs=LOOSE)


def wall(t, state, *, at=0.9, stiffness=1e5):
    return (-state[0] - stiffness * max(0.0, state[0] - at), 0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_a_wall_that_an_oscillation_grazes(name):
    """x = sin t meets a wall at cos(w / 2), and leaves it after a half period of the wall's spring, w being 0.02."""
    half, stiffness = 0.01, 1e5
    at, rate, omega = math.cos(half), math.sin(half), math.sqrt(1.0 + stiffness)
    contact = 2.0 / omega * math.atan2(rate / omega, at - stiffness * at / omega**2)
    left = 3.0 - (0.5 * math.pi - half) - contact
    found = run(mass(wall, at=at, stiffness=stiffness), name, (0.0, 3.0))
    assert found.q[-1, 0] == pytest.approx(at * math.cos(left) - rate * math.sin(left), abs=LOOSE)


class Bump(ts.Force):
    """A plug-in whose law is a bump in the x of its point."""

    markers = (ts.Point("a"),)

    @staticmethod
    def law(x, xd, par, t, out):
        """A work of 0.3 J."""
        out[0] = 0.3 / (1e-3 * math.sqrt(math.pi)) * math.exp(-(((x[0] - 0.5) / 1e-3) ** 2))


def user(t, a, b, par, out):
    d = a[0] - b[0]
    out[0] = 0.3 / (par[1] * math.sqrt(math.pi)) * np.exp(-(((d - par[0]) / par[1]) ** 2))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dop853", "taylor"])
def test_user_forces_between_two_bodies(name):
    """Both masses of 1 kg get half of the work: (1 + 2 u)^2 / 2 = 1 / 2 + 2 work."""
    scene = ts.Scene(gravity=(0, 0, 0))
    a, b = scene.add_point_mass(1.0, velocity=(1, 0, 0)), scene.add_point_mass(1.0)
    scene.add(F.UserForce(a, b, function=user, parameters=(0.4, 1e-3)))
    found = run(scene, name)
    assert found.velocity(a)[-1, 0] - found.velocity(b)[-1, 0] == pytest.approx(math.sqrt(2.2), abs=LOOSE)
    assert found.velocity(a)[-1, 0] + found.velocity(b)[-1, 0] == pytest.approx(1.0, abs=FINE)


def test_laws_of_plug_ins():
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add(Bump(scene.add_point_mass(1.0, velocity=(1, 0, 0))))
    assert speed(run(scene, "dop853")) == pytest.approx(math.sqrt(1.6), abs=LOOSE)


def test_cases_of_an_ensemble():
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_point_mass(1.0, velocity=(1, 0, 0), name="ball")
    scene.add(F.PointForce(body, force=bump, name="push"))
    found = ts.ensemble(scene, {"push.force.at": [0.2, 0.43, 0.7], "ball.mass": [1.0, 2.0, 4.0]}, (0, 1), **TOLERANCES)
    np.testing.assert_allclose(found.qd[:, 0], np.sqrt(1.0 + 0.6 / np.array([1.0, 2.0, 4.0])), atol=LOOSE)


def smooth(t, state, *, k=1.0):
    return (-k * np.tanh(3.0 * state[0]) - 0.1 * state[7], 0.3 * np.exp(-state[0]), -k * state[2] ** 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in STAGES if name != "default"])
@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_smooth_loads_reject_no_step(name, tol, monkeypatch):
    """The same bits with and without samples."""

    def ends():
        found = run(mass(smooth), name, (0.0, 20.0), rtol=tol, atol=0.01 * tol)
        return found.q[-1].tobytes(), found.stats.rejected

    with_samples = ends()
    monkeypatch.setattr("tsdyn.simulation.scene_cache.watched_loads", lambda packed: np.empty((2, 0), np.int64))
    assert ends() == with_samples


def entire(t, state):
    return (-np.sin(3.0 * state[0]) - 0.5 * state[7], state[1] ** 2 / 3.0, -2.0 * t)


def high_power(t, state):
    return (-((state[0] / 0.9) ** 40), 0.0, 0.0)


@pytest.mark.slow
def test_what_tells_all_at_one_place_is_not_sampled():
    """Sums, sines and products of a few factors; a power of 40 is a wall."""
    for force, count in ((entire, 0), (high_power, 1), (bump, 1), (box, 1)):
        assert len(mass(force).packed.system.forces) == 1
        assert len(watched_loads(mass(force).packed)[0]) == count


def noise(t, state):
    x = math.sin(state[0] * 12.9898e6) * 43758.5453e3
    return (1e-3 * (x - math.floor(x)), 0.0, 0.0)


@pytest.mark.slow
def test_noise_costs_no_more_steps_than_there_are_samples():
    found = run(mass(noise), "rk45", rtol=1e-3, atol=1e-3)
    assert found.stats.steps + found.stats.rejected < 6000
