"""The first gap that closes in a step, as a kernel finds it: against closed forms, and against the search in Python."""

import numpy as np
import pytest
from scipy.optimize import brentq

import tsdyn as ts
from tests.helpers.contacts import G
from tests.helpers.tolerances import HELD
from tsdyn.runs.group_search import GroupSearch
from tsdyn.simulation.unit_events import Closing

FLOOR = {"normal_b": (0, 0, 1), "restitution": 1.0}
METHODS = {"taylor": {}, "dop853": {"integrator": ts.integrators.DOP853(1e-12, 1e-12)}}


def balls(count, bouncing):
    """Balls in a row, each a little higher than the one before, of which the first ones bounce; their falls, s."""
    scene, heights = ts.Scene(gravity=(0, 0, -G)), 1.0 + 0.013 * np.arange(count)
    for i, height in enumerate(heights):
        ball = scene.add_body(1.0, (1, 1, 1), position=(2 * i, 0, 0.1 + height), angular_velocity=(0.1, 0.2 * i, 0.3))
        if i < bouncing:
            scene.add(ts.constraints.SphereContact(ball, scene.ground, radius_a=0.1, **FLOOR, name=f"ball {i}"))
    return scene, np.sqrt(2.0 * heights / G)


def boxes(restitution):
    """Boxes that tumble onto a floor with their corners."""
    scene, rng = ts.Scene(gravity=(0, 0, -G)), np.random.default_rng(2)
    for i in range(3):
        spin = 4 * rng.normal(size=3)
        body = scene.add_body(**ts.shapes.box((1, 1, 0.5), mass=1.0), position=(3 * i, 0, 2.0), angular_velocity=spin)
        for corner in np.ndindex(2, 2, 2):
            point = (np.array(corner) - 0.5) * [1, 1, 0.5]
            law = {**FLOOR, "restitution": restitution}
            scene.add(ts.constraints.PlaneContact(body, scene.ground, point_a=point, **law, unilateral=True))
    return scene


def bounces(falls):
    """Times of the bounces of balls without loss, within 4 s."""
    return sorted((1 + 2 * k) * fall for fall in falls for k in range(20) if (1 + 2 * k) * fall < 4.0)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_python_evaluates_no_gap_between_bounces(options, monkeypatch):
    monkeypatch.setattr(Closing, "over", lambda self, states: pytest.fail(f"gaps at {states.t}"))
    scene, falls = balls(10, 1)
    solution = ts.simulate(scene, (0.0, 4.0), **options)
    np.testing.assert_allclose([t for t, *_ in solution.impulses], bounces(falls[:1]), rtol=0, atol=HELD)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_bounces_that_follow_soon_on_each_other(options):
    scene, falls = balls(10, 10)
    solution = ts.simulate(scene, (0.0, 4.0), **options)
    np.testing.assert_allclose([t for t, *_ in solution.impulses], bounces(falls), rtol=0, atol=HELD)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("make", [lambda: balls(3, 3)[0], lambda: boxes(0.8)], ids=["balls", "boxes"])
def test_the_search_in_python_finds_the_same(make, options, monkeypatch):
    found = ts.simulate(make(), (0.0, 1.5), **options)
    monkeypatch.setattr(GroupSearch, "find", lambda *_: None)
    expected = ts.simulate(make(), (0.0, 1.5), **options)
    assert len(found.impulses) > 4
    assert [name for _, name, _ in found.impulses] == [name for _, name, _ in expected.impulses]
    times = ([t for t, *_ in solution.impulses] for solution in (found, expected))
    np.testing.assert_allclose(*times, rtol=0, atol=100 * HELD)  # rounding grows by a factor from bounce to bounce


@pytest.mark.parametrize("rate", [0.5, 3.0, 11.0, 40.0, 150.0, 600.0])
def test_the_first_touch_of_a_point_that_turns(rate):
    """z + r sin(w t) of a body that flies up and falls, and whose point touches before, between or after."""
    radius, speed = 0.4, 3.0
    for start in (0.05, 0.3, 0.6):
        scene = ts.Scene(gravity=(0, 0, -G))
        body = scene.add_body(
            1.0, (1, 1, 1), position=(0, 0, radius + start), velocity=(0, 0, speed), angular_velocity=(0, -rate, 0)
        )
        point = {"point_a": (radius, 0, 0), "unilateral": True}
        scene.add(ts.constraints.PlaneContact(body, scene.ground, **point, **FLOOR))

        def gap(t, start=start):
            return radius + start + speed * t - 0.5 * G * t * t + radius * np.sin(rate * t)

        times = np.linspace(0.0, 2.0, 1 << 18)
        first = int((gap(times) < 0.0).argmax())
        expected = brentq(gap, times[first - 1], times[first], xtol=1e-15)
        found = ts.simulate(scene, (0.0, expected + 0.01))
        assert abs(found.impulses[0][0] - expected) < 10 * HELD


def test_corners_that_touch_at_one_instant():
    """All four corners of a flat box, which falls onto them: one event, whose impulses turn the velocity around."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(**ts.shapes.box((1, 1, 0.5), mass=1.0), position=(0, 0, 1.25), velocity=(0.3, 0, 0))
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        point = {"point_a": (0.5 * x, 0.5 * y, -0.25), "unilateral": True}
        scene.add(ts.constraints.PlaneContact(body, scene.ground, **point, **FLOOR))
    solution = ts.simulate(scene, (0.0, 1.0))
    fall = np.sqrt(2.0 / G)
    assert len(solution.phases) == 2
    np.testing.assert_allclose([t for t, *_ in solution.impulses], fall, rtol=0, atol=HELD)
    assert abs(sum(p for *_, p in solution.impulses) - 2.0 * G * fall) < 10 * HELD
