"""Phases with closed contacts in one kernel call: the same bits as with Python between steps, and closed forms."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

import tsdyn as ts
from benchmarks import friction
from tests.helpers.contacts import G
from tests.helpers.tolerances import HELD
from tsdyn.jit.kernels import twin
from tsdyn.runs.events import Watch
from tsdyn.runs.group_search import SearchedStep, _follow, _is_smooth
from tsdyn.simulation.contact_events import Halting, Reactions
from tsdyn.simulation.flights import Flights

C, F, M = ts.constraints, ts.forces, ts.motions
FLOOR = {"normal_b": (0, 0, 1), "unilateral": True}


def block(velocity=(2.0, 0, 0), **law):
    """A block that slides in a plane, and stops where there is friction."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(2.0, (1, 1, 1), velocity=velocity, name="block")
    scene.add(C.Parallel(body, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
    scene.add(C.PlaneContact(body, scene.ground, **FLOOR, **law, name="floor"))
    return scene


def ball():
    """A ball that slides at first, and rolls at 5/7 of its velocity."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(1.0, (0.1, 0.1, 0.1), (0, 0, 0.5), velocity=(1.0, 0.3, 0), angular_velocity=(0, 0, 2.0))
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.5, normal_b=(0, 0, 1), kinetic=0.2))
    return scene


def bead():
    """A particle that slides off a ball."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_point_mass(0.3, position=(0, 0, 1.0), velocity=(0.5, 0, 0))
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.0, radius_b=1.0))
    return scene


def boxes():
    """Two boxes on three points each, beside springs."""
    scene = ts.Scene(gravity=(0, 0, -G))
    for i in range(2):
        box = scene.add_body(**ts.shapes.box((1, 1, 0.5), mass=1.0), position=(3 * i, 0, 0.25), name=f"box {i}")
        scene.add(F.Spring(box, scene.ground, point_b=(3 * i, 2.0, 0.25), stiffness=40.0 + i, free_length=1.5))
        for x, y in ((-1, -1), (1, -1), (0, 1)):
            scene.add(C.PlaneContact(box, scene.ground, point_a=(0.5 * x, 0.5 * y, -0.25), **FLOOR))
    return scene


def pins():
    """Three links whose pins stick and slide."""
    return friction.build(3, True, 0.0)


SCENES = {"block": lambda: block(kinetic=0.2), "ball": ball, "bead": bead, "boxes": boxes, "pins": pins}
CASES = {
    "steps": {},
    "outputs": {"t_eval": np.linspace(0.0, 1.2, 97)},
    "dense": {"dense_output": True},
    "explicit": {"integrator": ts.integrators.DOP853(1e-9, 1e-9)},
    "implicit": {"integrator": "radau"},
}


@pytest.mark.parametrize(("name", "case"), [*product(SCENES, list(CASES)[:4]), ("block", "implicit")])
def test_the_bits_are_those_of_a_run_with_python_between_steps(name, case, monkeypatch):
    calls, advance = [], Flights.advance
    monkeypatch.setattr(Flights, "advance", lambda *given: calls.append(given) or advance(*given))
    own = ts.simulate(SCENES[name](), (0.0, 1.2), **CASES[case])
    assert own.success
    assert calls
    monkeypatch.setattr(Flights, "serve", lambda *_: False)
    other = ts.simulate(SCENES[name](), (0.0, 1.2), **CASES[case])
    assert own.phases == other.phases
    assert own.stats.steps == other.stats.steps
    for array in ("t", "q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(own, array), getattr(other, array))
    if case == "dense":
        times = np.linspace(0.0, 1.2, 33)
        np.testing.assert_array_equal(own.at(times).q, other.at(times).q)


@pytest.mark.parametrize("case", ["steps", "explicit"])
def test_python_sees_no_step_in_which_nothing_happens(case, monkeypatch):
    """Boxes on springs: y'' = -k (y - 1/2) / m, seen from the anchors; every point pushes all the time."""
    monkeypatch.setattr(Watch, "_search_step", lambda watch, *_: pytest.fail(f"searched at {watch.t}"))
    solution, t = ts.simulate(boxes(), (0.0, 20.0), **CASES[case]), 20.0
    for i in range(2):
        y = 0.5 - 0.5 * np.cos(np.sqrt(40.0 + i) * t)
        assert abs(solution.position(f"box {i}")[-1, 1] - y) < (1e-6 if case == "steps" else 1e-5)
    assert len(solution.phases) == 1


def test_a_straight_slide_ends_after_a_few_evaluations(monkeypatch):
    """What the event of its end watches is as smooth as its velocity: v / (mu g) later, v^2 / (2 mu g) away."""
    asked = []
    for kind in (Halting, Reactions):
        over = kind.over
        monkeypatch.setattr(kind, "over", lambda each, states, over=over: asked.append(states) or over(each, states))
    speed, mu = 2.0, 0.2
    solution = ts.simulate(block((0.6 * speed, 0.8 * speed, 0), kinetic=mu), (0.0, 2.0))
    assert abs(solution.phases[1][0] - speed / (mu * G)) < HELD
    far = np.array([0.6, 0.8, 0.0]) * speed**2 / (2.0 * mu * G)
    np.testing.assert_allclose(solution.position("block")[-1], far, rtol=0, atol=10 * HELD)
    assert len(asked) < 6


@pytest.mark.parametrize("options", [CASES["steps"], CASES["explicit"]], ids=["steps", "explicit"])
@pytest.mark.parametrize(("share", "rate", "ratio"), [(0.6, 41.6, 0.011), (0.65, 6.8, 0.004), (0.55, 28.2, 0.02)])
def test_a_body_that_forces_lift_after_many_periods(share, rate, ratio, options):
    """A body at rest says nothing of the forces on it: the first time at which both together are its weight."""
    slow, weight = 1.01 - share, 2.0 * G
    scene = block(velocity=(0, 0, 0))
    scene.add(F.PointForce(scene.body("block"), force=(0, 0, M.Sine(share * weight, rate))))
    scene.add(F.PointForce(scene.body("block"), force=(0, 0, M.Sine(slow * weight, ratio * rate))))

    def left(t):
        return share * np.sin(rate * t) + slow * np.sin(ratio * rate * t) - 1.0

    times = np.linspace(0.0, 2.0 * np.pi / (ratio * rate), 1 << 18)
    first = int((left(times) > 0.0).argmax())
    expected = brentq(left, times[first - 1], times[first], xtol=1e-15)
    solution = ts.simulate(scene, (0.0, expected + 0.1 / rate), **options)
    assert abs(solution.phases[1][0] - expected) < 10 * HELD


def test_polynomials_through_both_ends_of_a_step():
    """Those of degree five are followed to rounding; an oscillation isn't followed through half a period."""
    c, t0, t1 = np.random.default_rng(0).normal(size=(4, 6)), 0.3, 0.7

    def state(t):
        powers = [np.polynomial.polynomial.polyder(c, k, axis=1) for k in range(3)]
        return np.array([np.polynomial.polynomial.polyval(t, power.T) for power in powers])

    def step(ends):
        none = np.zeros((0, 0))
        return SearchedStep(0, 0, none, none, none, 0, 0, t0, ends(t0), t1, ends(t1))

    found = np.zeros((3, 4))
    for t in (0.3, 0.42, 0.61, 0.7):
        twin(_follow)(step(state), t, found)
        np.testing.assert_allclose(found[:2], state(t)[:2], rtol=0, atol=1e-13)
    for turn in (0.5, 2.0, 3.3, 6.3):
        w = turn / (t1 - t0)
        wave = lambda t, w=w: np.array([[np.sin(w * t)], [w * np.cos(w * t)], [-w * w * np.sin(w * t)]])  # noqa: E731
        assert twin(_is_smooth)(step(wave)) == (turn < np.pi)
