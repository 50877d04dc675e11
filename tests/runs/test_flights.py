"""Runs from impact to impact in one kernel call: the same bits as with Python between them, and closed forms."""

from itertools import pairwise, product

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.contacts import G
from tests.helpers.tolerances import HELD
from tsdyn.runs import driver
from tsdyn.simulation.contact_run import _ContactRun
from tsdyn.simulation.flights import Flights
from tsdyn.simulation.unit_events import Closing

FLOOR = {"normal_b": (0, 0, 1), "unilateral": True}


def ball(restitution=1.0, **more):
    """A ball of radius 0.1 m that falls by 1 m."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(1.0, (1, 1, 1), position=(0, 0, 1.1), angular_velocity=(0.1, 0.2, 0.3), **more)
    given = {"radius_a": 0.1, "normal_b": (0, 0, 1), "restitution": restitution}
    scene.add(ts.constraints.SphereContact(body, scene.ground, **given, name="floor"))
    return scene


def two_balls():
    """Two balls above each other, which hit the floor and each other."""
    scene = ball(0.9)
    upper = scene.add_body(0.2, (1, 1, 1), position=(0.05, 0, 1.6), velocity=(0, 0, -0.5))
    given = {"radius_a": 0.1, "radius_b": 0.1, "restitution": 0.95}
    scene.add(ts.constraints.SphereContact(upper, scene.body("body1"), **given))
    scene.add(ts.constraints.SphereContact(upper, scene.ground, radius_a=0.1, normal_b=(0, 0, 1), restitution=0.9))
    return scene


def pendulum():
    """A double pendulum whose tip hits a floor, with a spring at its first joint."""
    scene = ts.Scene(gravity=(0, 0, -G))
    rods = [scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(0.5 + i, 0, 0)) for i in range(2)]
    scene.add(ts.constraints.Revolute.at(scene.ground, rods[0], point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(ts.constraints.Revolute.at(*rods, point=(1, 0, 0), axis=(0, 1, 0)))
    turning = {"axis_a": (0, 1, 0), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(ts.forces.TorsionalSpring(scene.ground, rods[0], **turning, stiffness=3.0))
    tip = {"point_a": (0.5, 0, 0), "point_b": (0, 0, -0.8), "restitution": 0.7}
    scene.add(ts.constraints.PlaneContact(rods[1], scene.ground, **tip, **FLOOR))
    return scene


def collapse():
    """Three balls in a row, the first of which flies: they hit each other until all go on together."""
    scene = ts.Scene(gravity=(0, 0, 0))
    balls = [scene.add_point_mass(1.0, position=(x, 0, 0), velocity=(float(x == 0), 0, 0)) for x in (0.0, 0.3, 0.5)]
    for pair in pairwise(balls):
        scene.add(ts.constraints.SphereContact(*pair, radius_a=0.05, radius_b=0.05, restitution=0.03))
    return scene


SCENES = {"ball": ball, "two balls": two_balls, "pendulum": pendulum, "many": lambda: ball(1.0), "collapse": collapse}
SPANS = {"many": 2000.0}  # more impacts than are made before progress is judged
CASES = {
    "steps": {},
    "outputs": {"t_eval": np.linspace(0.0, 3.0, 97)},
    "dense": {"dense_output": True},
    "explicit": {"integrator": ts.integrators.DOP853(1e-9, 1e-9)},
    "implicit": {"integrator": "radau"},
    "short slices": {},
}


def found(solution):
    """What is compared, as arrays."""
    within = [solution.at(np.linspace(0.0, 2.9, 33)).q] if solution._trajectory is not None else []
    numbers = [[t, p, *p.tangential] for t, _, p in solution.impulses]
    phases = [[start, end] for start, end, _ in solution.phases]
    return [solution.t, solution.q, solution.qd, solution.qdd, solution.energy, numbers, phases, *within]


@pytest.mark.parametrize(
    ("name", "case"), [*product(list(SCENES)[:3], CASES), ("many", "steps"), ("collapse", "steps")]
)
def test_the_bits_are_those_of_a_run_with_python_between_impacts(name, case, monkeypatch):
    if case == "short slices":
        monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    options, span, land, flights = CASES[case], (0.0, SPANS.get(name, 3.0)), _ContactRun.land, []
    monkeypatch.setattr(_ContactRun, "land", lambda run, flown: flights.append(flown.impacts()) or land(run, flown))
    own = ts.simulate(SCENES[name](), span, **options)
    assert own.success
    assert bool(flights) == (options.get("integrator") != "radau")  # its steps know of those before
    monkeypatch.setattr(Flights, "serve", lambda *_: False)
    other = ts.simulate(SCENES[name](), span, **options)
    assert own.stats.steps == other.stats.steps
    for mine, theirs in zip(found(own), found(other), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_python_has_nothing_to_do_between_impacts(monkeypatch):
    monkeypatch.setattr(_ContactRun, "_transit", lambda run, fired: pytest.fail(f"asked at {run.t}"))
    solution, fall = ts.simulate(ball(), (0.0, 20.0)), np.sqrt(2.0 / G)
    times = [(1 + 2 * k) * fall for k in range(100) if (1 + 2 * k) * fall < 20.0]
    np.testing.assert_allclose([t for t, *_ in solution.impulses], times, rtol=0, atol=HELD)
    np.testing.assert_allclose([p for *_, p in solution.impulses], 2.0 * G * fall, rtol=1e-12)


def in_a_box(falls):
    """A point mass between six walls, 2 m apart, and the times of its impacts within 1,000 s if it doesn't fall."""
    scene, start, velocity = ts.Scene(gravity=(0, 0, -G * falls)), np.array([0.1, 0.2, 0.3]), np.array([3.0, 2.1, 1.3])
    body = scene.add_point_mass(1.0, position=start, velocity=velocity)
    for normal in np.concatenate((np.eye(3), -np.eye(3))):
        given = {"point_b": -normal, "normal_b": normal, "restitution": 1.0, "unilateral": True}
        scene.add(ts.constraints.PlaneContact(body, scene.ground, **given))
    return scene, np.sort(
        np.concatenate([np.arange(1 - x, 1000.0 * v, 2) / v for x, v in zip(start, velocity, strict=True)])
    )


def test_steps_that_end_far_beyond_impacts(monkeypatch):
    """A point mass without loss, whose steps have the length of the run: Python sees one impact in a thousand."""
    asked, transit = [], _ContactRun._transit
    monkeypatch.setattr(_ContactRun, "_transit", lambda run, fired: asked.append(run.t) or transit(run, fired))
    scene, times = in_a_box(falls=False)
    solution = ts.simulate(scene, (0.0, 1000.0))
    np.testing.assert_allclose([t for t, *_ in solution.impulses], times, rtol=1e-13)
    scene, _ = in_a_box(falls=True)
    solution = ts.simulate(scene, (0.0, 1000.0))
    assert np.ptp(solution.energy) < 1e-12 * solution.energy[0]
    assert len(asked) < 0.001 * (len(times) + len(solution.impulses))


def test_slices_of_a_run_grow_with_an_impact_a_step(monkeypatch):
    """As many outputs before impacts as after them: 1,000 impacts take some hundred calls at most, not hundreds."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    calls, advance = [], Flights.advance
    monkeypatch.setattr(Flights, "advance", lambda *given: calls.append(given[2]) or advance(*given))
    solution = ts.simulate(ball(), (0.0, 900.0))
    assert len(solution.impulses) > 990
    assert len(calls) < 100


def test_an_angle_that_stops_bound_beyond_a_turn(monkeypatch):
    """A rod that turns to and fro between -7 and 8 rad, by 0.9 of its rate after each impact; Python sees no gap."""
    monkeypatch.setattr(_ContactRun, "_transit", lambda run, fired: pytest.fail(f"asked at {run.t}"))
    monkeypatch.setattr(Closing, "over", lambda self, states: pytest.fail(f"gaps at {states.t}"))
    scene, rate = ts.Scene(gravity=(0, 0, 0)), 3.0
    rod = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), angular_velocity=(0, rate, 0))
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(ts.constraints.Stop(hinge, lower=-7.0, upper=8.0, restitution=0.9))
    solution = ts.simulate(scene, (0.0, 37.0))
    times = 8.0 / rate + np.append(0.0, np.cumsum(15.0 / (rate * 0.9 ** np.arange(1, 5))))
    np.testing.assert_allclose([t for t, *_ in solution.impulses], times, rtol=1e-13)
    end = 8.0 - rate * 0.9**5 * (37.0 - times[-1])  # after the fifth
    np.testing.assert_allclose(solution.state.angle(hinge), end, rtol=0, atol=1e-11)


def beside_a_block(damping, speed=0.0):
    """A ball that falls by 1 m without loss beside a block of 1 kg at rest on a floor, and a damper between them."""
    scene = ball(velocity=(0, 0, -speed))
    block = scene.add_point_mass(1.0, position=(0, 0.3, 0), name="block")
    for axis in np.eye(3)[:2]:
        scene.add(ts.constraints.Dot2(scene.ground, block, axis_a=axis, point_a=(0, 0.3, 0)))
    scene.add(ts.constraints.PlaneContact(block, scene.ground, **FLOOR, name="rest"))
    if damping:
        scene.add(ts.forces.Spring(scene.body("body1"), block, damping=damping))
    return scene


def test_impacts_beside_contacts_that_are_closed(monkeypatch):
    """Where an impact moves no body that they hold, they stay closed, and Python isn't asked."""
    monkeypatch.setattr(_ContactRun, "_transit", lambda run, fired: pytest.fail(f"asked at {run.t}"))
    solution, fall = ts.simulate(beside_a_block(0.0), (0.0, 20.0)), np.sqrt(2.0 / G)
    times = [(1 + 2 * k) * fall for k in range(100) if (1 + 2 * k) * fall < 20.0]
    np.testing.assert_allclose([t for t, *_ in solution.impulses], times, rtol=0, atol=HELD)
    assert all(names == ("rest",) for *_, names in solution.phases)
    np.testing.assert_array_equal(solution.position("block"), np.tile([0.0, 0.3, 0.0], (len(solution.t), 1)))


def test_an_impact_after_which_a_damper_lifts_what_has_been_at_rest():
    """By c u.v u_z - g at once, u from block to ball: the impact moves no body at rest, but ends its contact."""
    solution = ts.simulate(beside_a_block(10.0, speed=40.0), (0.0, 0.1), rtol=1e-12, atol=1e-12)
    hit = solution.impulses[0][0]
    k = np.searchsorted(solution.t, hit, side="right") - 1  # after the impact
    u = (solution.position("body1") - solution.position("block"))[k]
    u /= np.linalg.norm(u)
    gain = 10.0 * (u @ solution.velocity("body1")[k]) * u[2] - G
    assert gain > G
    assert solution.acceleration("block")[k, 2] == pytest.approx(gain, rel=1e-12)
    assert [names for *_, names in solution.phases[:2]] == [("rest",), ()]
