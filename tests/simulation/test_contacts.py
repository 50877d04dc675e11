"""Unilateral contacts and stops against closed forms: impact times, rest, openings, energies, refusals."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

import tsdyn as ts
from tests.helpers.contacts import G, bouncing, box, pendulum
from tests.helpers.tolerances import EPS
from tsdyn.simulation.contact_events import Reactions
from tsdyn.simulation.phases import Phases

C = ts.constraints


def penetration(scene, solution):
    """The deepest point of any contact at the outputs, m; negative where it penetrates."""
    deepest = np.inf
    for contact in scene.constraints:
        if isinstance(contact, C.PlaneContact):
            deepest = min(deepest, solution.position(contact.a, point=contact.point_a)[:, 2].min())
    return deepest


# the bouncing ball


@pytest.mark.parametrize("e", [0.8, 0.9])
def test_impact_times_of_a_bouncing_ball(e):
    scene, fall = bouncing(e)
    solution = ts.simulate(scene, (0, 8.4))
    times = np.array([t for t, *_ in solution.impulses[:30]])
    exact = fall * (1 + 2 * np.append(0.0, np.cumsum(e ** np.arange(1, 30))))
    assert np.abs(times - exact).max() < 1e-12
    strengths = np.array([impulse for *_, impulse in solution.impulses[:20]])
    np.testing.assert_allclose(strengths, 0.5 * G * fall * (1 + e) * e ** np.arange(20), rtol=1e-10)
    assert {name for _, name, _ in solution.impulses} == {"floor"}


@pytest.mark.parametrize("speed", [1e-3, 1e-2])
@pytest.mark.parametrize("first_step", [1e-14, 1e-13, 1e-12, 1e-11])
def test_impacts_after_steps_in_which_gaps_are_rounding(first_step, speed):
    """Of a ball that bounces at 1 m without loss: in the first step of a flight it rises by less than a last digit."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(1.0, position=(0, 0, 1), velocity=(0, 0, -speed))
    scene.add(C.PlaneContact(ball, scene.ground, point_b=(0, 0, 1), normal_b=(0, 0, 1), unilateral=True, restitution=1))
    flight = 2 * speed / G
    solution = ts.simulate(scene, (0, 4.5 * flight), integrator=ts.integrators.Taylor(first_step=first_step))
    assert solution.success
    times = np.array([t for t, *_ in solution.impulses])
    assert np.abs(times - flight * np.arange(5)).max() < 16 * EPS / speed
    assert penetration(scene, solution) > 1 - 4 * EPS


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8])
def test_a_bouncing_ball_comes_to_rest_and_slides_on(e):
    scene, fall = bouncing(e)
    solution = ts.simulate(scene, (0, 6.0), dense_output=True)
    start, end, names = solution.phases[-1]
    assert solution.success
    assert names == ("floor",)
    assert abs(start - fall * (1 + 2 * e / (1 - e))) < 3e-12
    assert end == 6.0
    np.testing.assert_allclose(solution.position("ball")[-1], [6.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(solution.at(5.0).reaction("floor")[0], [0.0, 0.0, 0.5 * G], atol=1e-12)
    np.testing.assert_array_equal(solution.at(0.1).reaction("floor")[0], 0.0)
    assert np.diff(solution.energy).max() < 4 * EPS * G
    assert penetration(scene, solution) > -1e-13


@pytest.mark.parametrize("e", [0.1, 0.5, 0.8])
def test_impacts_where_the_gap_has_coarse_digits(e):
    """Of a ball whose centre comes down to 0.1 m: the gap is zero over a whole digit, with flights down to 1e-8 s."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(1.0, position=(0, 0, 1.0), velocity=(1.0, 0, 0))
    scene.add(ts.constraints.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=(0, 0, 1), restitution=e))
    solution = ts.simulate(scene, (0, 5.0))
    fall, count = np.sqrt(1.8 / G), len(solution.impulses)
    times = fall * (1 + 2 * e * (1 - e ** np.arange(count)) / (1 - e))
    np.testing.assert_allclose([t for t, *_ in solution.impulses], times, rtol=0, atol=1e-13)
    assert abs(solution.phases[-1][0] - fall * (1 + e) / (1 - e)) < 1e-13


@pytest.mark.parametrize("feet", [2, 4])
def test_feet_that_land_at_one_instant_come_to_rest_in_time(feet):
    """As one foot does: each impact at its time, to rounding of the time."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(1.0, (1, 1, 1), position=(0, 0, 1.5), name="body")
    for k, (x, y) in enumerate([(1, 1), (-1, -1), (1, -1), (-1, 1)][:feet]):
        foot = {"point_a": (x, y, -0.5), "normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.5}
        scene.add(C.PlaneContact(body, scene.ground, **foot, name=f"foot {k}"))
    solution = ts.simulate(scene, (0, 2.0))
    fall = np.sqrt(2 / G)
    times = np.array(sorted({t for t, *_ in solution.impulses}))
    exact = fall * (1 + 2 * np.append(0.0, np.cumsum(0.5 ** np.arange(1, times.size))))
    assert np.abs(times - exact).max() < 1e-12
    assert abs(solution.phases[-1][0] - 3 * fall) < 1e-12


def test_both_sides_of_an_impact():
    """The outputs have the instant twice; dense output has the later side at it, and the earlier one before."""
    scene, fall = bouncing(0.5)
    solution = ts.simulate(scene, (0, 1.0), dense_output=True)
    t = solution.impulses[0][0]
    (twice,) = np.nonzero(solution.t == t)
    np.testing.assert_allclose(solution.velocity("ball")[twice, 2], [-G * fall, 0.5 * G * fall], rtol=1e-14)
    sides = solution.at([np.nextafter(t, 0.0), t]).velocity("ball")[:, 2]
    np.testing.assert_allclose(sides, [-G * fall, 0.5 * G * fall], rtol=1e-13)


def test_dense_output_has_the_later_side_where_a_segment_ends():
    """A stiff spring has another method try at an impact: the step that begins there has other velocities."""
    height, g = 1e-5, 10.0
    scene = ts.Scene(gravity=(0, 0, -g))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, height))
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, restitution=1.0))
    damped, spring = scene.add_point_mass(mass=1.0, position=(1, 0, 5)), {"stiffness": 1e5, "damping": 1e2}
    scene.add(ts.forces.Spring(damped, scene.ground, point_b=(0, 0, 5), free_length=1.01, **spring))
    solution = ts.simulate(scene, (0, 0.5), dense_output=True)
    rates = solution.at([t for t, *_ in solution.impulses]).velocity(ball)[:, 2]
    assert len(rates) == int(0.5 + 0.25 * np.sqrt(0.5 * g / height))
    np.testing.assert_allclose(rates, np.sqrt(2.0 * g * height), rtol=1e-9)


def test_output_times_across_impacts():
    scene, fall = bouncing(0.5, height=G / 2)  # the first impact is at 1 s
    times = np.array([0.0, 0.5, fall, 1.5, 2.0])
    solution = ts.simulate(scene, (0, 2.0), t_eval=times)
    np.testing.assert_array_equal(solution.t, times)
    np.testing.assert_allclose(solution.position("ball")[:, 0], times, atol=1e-13)
    np.testing.assert_allclose(solution.position("ball")[[1, 3], 2], [0.375 * G, G / 8], atol=1e-12)
    later = solution[2:]
    np.testing.assert_array_equal(later.multipliers, solution.multipliers[2:])


# openings


@pytest.mark.parametrize(("radius_a", "radius_b"), [(0.1, 0.9), (0.0, 1.0), (1.0, 0.0)])
def test_a_particle_leaves_a_ball_where_the_normal_force_vanishes(radius_a, radius_b):
    """cos(theta) = 2/3 + v0^2 / 3 g R; afterwards it flies freely."""
    scene, v0 = ts.Scene(gravity=(0, 0, -G)), 0.5
    globe = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="globe")
    scene.add(C.Fixed.at(globe, scene.ground, point=(0, 0, 0)))
    bead = scene.add_point_mass(mass=0.3, position=(0, 0, 1.0), velocity=(v0, 0, 0), name="bead")
    scene.add(C.SphereContact(bead, globe, radius_a=radius_a, radius_b=radius_b, name="touch"))
    solution = ts.simulate(scene, (0, 1.0), rtol=1e-12, atol=1e-12, dense_output=True)
    (_, t, closed), (_, _, opened) = solution.phases
    assert (closed, opened) == (("touch",), ())
    assert abs(solution.at(t).position(bead)[2] - (2 / 3 + v0**2 / (3 * G))) < 1e-13
    assert solution.impulses == []
    assert np.ptp(solution.energy) < 1e-12
    np.testing.assert_array_equal(solution.reaction("touch")[0][-1], 0.0)


@pytest.mark.parametrize(("values", "said"), [("fast", "too fast"), ("nan", "touch isn't determined")])
def test_a_reaction_that_cannot_be_followed_ends_the_run_with_an_account(values, said, monkeypatch):
    """No more than some ten thousand reactions are evaluated."""
    over, count = Reactions.over, 0

    def spoilt(self, states):
        nonlocal count
        count += states.t.size
        found = over(self, states)
        if values == "nan":  # near the zero
            return np.where(np.abs(found) < 0.1, np.nan, found)
        return found + np.sin(1e9 * states.t[:, None])

    monkeypatch.setattr(Reactions, "over", spoilt)
    monkeypatch.setattr(Reactions, "kernel", None)
    scene = ts.Scene(gravity=(0, 0, -G))
    bead = scene.add_point_mass(mass=0.3, position=(0, 0, 1.0), velocity=(0.5, 0, 0))
    scene.add(C.SphereContact(bead, scene.ground, radius_a=0.0, radius_b=1.0, name="touch"))
    solution = ts.simulate(scene, (0, 1.0), dense_output=True)
    assert solution.status == ts.Status.CONTACT_FAILED
    assert said in solution.message
    assert solution.state.t < 1.0
    assert solution.constraint_error.position.max() < 1e-13
    assert count < 1e5


@pytest.mark.parametrize("rigid", [False, True])
def test_a_point_slides_on_a_plane(rigid):
    """A ball of no radius: friction doesn't turn it, takes mu p at the impact, and stops it after v^2 / 2 mu g."""
    scene = ts.Scene(gravity=(0, 0, -10))
    start = {"position": (0, 0, 0.2), "velocity": (3, 0, 0), "name": "point"}
    point = scene.add_body(1.0, (0.1, 0.1, 0.1), **start) if rigid else scene.add_point_mass(1.0, **start)
    scene.add(C.SphereContact(point, scene.ground, radius_a=0, normal_b=(0, 0, 1), kinetic=0.3, name="floor"))
    solution = ts.simulate(scene, (0, 2))
    ((t, _, impulse),) = solution.impulses
    np.testing.assert_allclose((t, impulse), (0.2, 2.0), rtol=1e-13)
    v = 3 - 0.3 * 2.0  # after the impact
    np.testing.assert_allclose(solution.position("point")[-1], [0.6 + v**2 / 6, 0, 0], atol=1e-12)
    np.testing.assert_allclose(solution.phases[-1][0], 0.2 + v / 3, rtol=1e-12)
    if rigid:
        assert np.abs(solution.angular_velocity("point")).max() < 1e-14


def test_a_ball_within_a_ball():
    """It falls to the bottom without a rebound, along a vertical through the centre, and stays."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 0.5), name="ball")
    shell = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="shell")
    scene.add(C.Fixed.at(shell, scene.ground, point=(0, 0, 0)))
    scene.add(C.SphereContact(ball, shell, radius_a=0.2, radius_b=1.0, inside=True, name="wall"))
    solution = ts.simulate(scene, (0, 1.0))
    assert abs(solution.impulses[0][0] - np.sqrt(2 * 1.3 / G)) < 1e-14
    np.testing.assert_allclose(solution.position(ball)[-1], [0, 0, -0.8], atol=1e-14)
    np.testing.assert_allclose(solution.reaction("wall")[0][-1], [0, 0, G], rtol=1e-12)


# impacts


def test_two_balls():
    """Velocities after a central impact by restitution and momentum."""
    scene = ts.Scene(gravity=(0, 0, 0))
    a = scene.add_point_mass(mass=1.0, position=(0, 0, 0), velocity=(2, 0.5, 0), name="a")
    b = scene.add_point_mass(mass=3.0, position=(1, 0.15, 0), velocity=(-1, 0.5, 0), name="b")
    b.position = (1, 0, 0)
    scene.add(C.SphereContact(a, b, radius_a=0.1, radius_b=0.1, restitution=0.5, name="hit"))
    solution = ts.simulate(scene, (0, 1.0))
    ((t, name, impulse),) = solution.impulses
    assert (round(t, 12), name) == (round(0.8 / 3, 12), "hit")
    assert abs(impulse - 1.5 * 3 * 0.75) < 1e-13
    np.testing.assert_allclose(solution.velocity(a)[-1], [2 - 3.375, 0.5, 0], atol=1e-13)
    np.testing.assert_allclose(solution.linear_momentum, np.tile([-1.0, 2.0, 0.0], (solution.t.size, 1)), atol=1e-13)


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_a_cradle_at_one_instant(law):
    """Balls that touch are hit at once: by both laws the first of three rebounds, and the others go on together."""
    scene = ts.Scene(gravity=(0, 0, 0))
    balls = [scene.add_point_mass(mass=1.0, position=(0.1 * i, 0, 0), name=f"ball{i}") for i in range(3)]
    balls[0].velocity = (1, 0, 0)
    for i, pair in enumerate(pairwise(balls)):
        scene.add(C.SphereContact(*pair, radius_a=0.05, radius_b=0.05, restitution=1.0, name=f"gap{i}"))
    after, impulses = ts.impact(scene, ts.State(0.0, *scene.start), law=law)
    np.testing.assert_allclose(after.qd[::3], [-1 / 3, 2 / 3, 2 / 3], atol=1e-15)
    np.testing.assert_allclose([impulses["gap0"], impulses["gap1"]], [4 / 3, 2 / 3], atol=1e-15)
    plastic, _ = ts.impact(scene, ts.State(0.0, *scene.start), restitution={"gap0": 0.0, "gap1": 0.0}, law=law)
    np.testing.assert_allclose(plastic.qd[::3], [1 / 3, 1 / 3, 1 / 3], atol=1e-15)


def test_a_cradle_with_gaps_hands_the_velocity_on():
    scene = ts.Scene(gravity=(0, 0, 0))
    balls = [scene.add_point_mass(mass=1.0, position=(0.11 * i, 0, 0), name=f"ball{i}") for i in range(5)]
    balls[0].velocity = (1, 0, 0)
    for pair in pairwise(balls):
        scene.add(C.SphereContact(*pair, radius_a=0.05, radius_b=0.05, restitution=1.0))
    solution = ts.simulate(scene, (0, 1.0))
    np.testing.assert_allclose([t for t, *_ in solution.impulses], 0.01 * np.arange(1, 5), atol=1e-14)
    np.testing.assert_allclose([solution.velocity(ball)[-1, 0] for ball in balls], [0, 0, 0, 0, 1], atol=1e-13)


@pytest.mark.parametrize("seed", range(20))
def test_impacts_never_add_energy(seed):
    """Random boxes and velocities, all corners down at once, by both laws and any coefficients."""
    rng = np.random.default_rng(seed)
    scene = ts.Scene()
    box = scene.add_body(
        mass=2.0, inertia=(1, 2, 2.5), velocity=rng.normal(size=3), angular_velocity=rng.normal(size=3)
    )
    other = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(2, 0, 0), velocity=rng.normal(size=3))
    scene.add(C.SphereContact(box, other, radius_a=1.0, radius_b=1.0, restitution=rng.uniform(), name="side"))
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        contact = {"point_a": (x, y, -1), "point_b": (0, 0, -1), "normal_b": (0, 0, 1)}
        scene.add(C.PlaneContact(box, scene.ground, **contact, unilateral=True, restitution=rng.uniform()))
    before = ts.State(0.0, *scene.start)
    M = scene.evaluate().M
    for law in ("newton", "poisson"):
        after, impulses = ts.impact(scene, before, law=law)
        assert after.qd @ M @ after.qd <= before.qd @ M @ before.qd * (1 + 1e-13)
        assert min(impulses.values()) >= 0.0
        again, _ = ts.impact(scene, after, restitution=0.0, law=law)
        np.testing.assert_allclose(again.qd, after.qd, atol=1e-13)  # nothing approaches any more


# stops


def test_a_pendulum_with_a_stop_at_its_lowest_place():
    """Half periods by the complete elliptic integral, with the amplitude that each rebound leaves."""
    scene, period = pendulum(1.0)
    solution = ts.simulate(scene, (0, 10.0), rtol=1e-12, atol=1e-12)
    times = np.array([t for t, *_ in solution.impulses])
    assert np.abs(times - period * (0.25 + 0.5 * np.arange(times.size))).max() < 1e-11
    assert np.ptp(solution.energy) < 1e-10
    assert solution.angle("hinge").min() > -1e-13
    scene, period = pendulum(0.5)
    solution = ts.simulate(scene, (0, 10.0), rtol=1e-12, atol=1e-12)
    first, second = (t for t, *_ in solution.impulses[:2])
    amplitude = 2 * np.arcsin(0.5 * np.sin(0.5))
    assert abs(first - period / 4) < 1e-12
    assert abs(second - first - 2 * ellipk(np.sin(amplitude / 2) ** 2) / np.sqrt(2.0 * G / 2.2)) < 1e-11


@pytest.mark.parametrize("bound", [1.5, 7.0, -20.0])
def test_a_stop_counts_turns(bound):
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.set(hinge, rate=np.sign(bound) * 2.0)
    scene.add(C.Stop(hinge, **{"upper" if bound > 0 else "lower": bound}, name="stop"))
    solution = ts.simulate(scene, (0, 12.0))
    ((t, _, impulse),) = solution.impulses
    assert abs(t - abs(bound) / 2) < 1e-13 * abs(bound)
    assert abs(impulse - 2.0 * 2.0) < 1e-13
    assert abs(solution.angle(hinge)[-1] - bound) < 1e-13 * abs(bound)


def test_an_angle_at_an_impact_after_a_long_step():
    """A rod at rest, which a ball of 10 m/s sets turning at 8 rad/s after 2 s: its turns count from the impact on."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 1.0), name="rod")
    hinge = scene.add(C.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 0, 1)))
    ball = scene.add_point_mass(1.0, position=(0.5, -20.0, 0), velocity=(0, 10.0, 0))
    scene.add(C.PlaneContact(ball, rod, normal_b=(0, -1, 0), unilateral=True, restitution=1.0))
    solution = ts.simulate(scene, (0, 2.1), dense_output=True)
    t = solution.impulses[0][0]
    np.testing.assert_allclose(solution.at([np.nextafter(t, 0), t, t + 0.1]).angle(hinge), (0, 0, 0.8), atol=1e-12)
    assert abs(solution.at(t).angle_rate(hinge) - 8.0) < 1e-12


@pytest.mark.parametrize(
    ("size", "share", "gravity"), [(1.0, 1.0, 0.0), (1e6, 1.0, 0.0), (1e-6, 1.0, 0.0), (1.0, 1e-3, 10.0)]
)
def test_a_wheel_leaves_its_stop_and_comes_back(size, share, gravity):
    """A torque -cos(t) - 0.3, about a hinge and times the inertia and a share, turns a wheel.

    It leaves at cos(t) = -0.3, without a rate. The wheel's place, 1e6 m away, has a rounding that the angle hasn't;
    the hinge carries the weight, whose rounding doesn't delay the wheel.
    """
    scene, inertia = ts.Scene(gravity=(0, 0, -gravity)), 2.0 * size**2
    wheel = scene.add_body(mass=1.0, inertia=(inertia,) * 3, position=(size, 0, 0), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=wheel.position, axis=(0, 0, 1), name="hinge"))
    scene.add(C.Stop(hinge, lower=0.0, restitution=0.5, name="stop"))
    torque = share * inertia * (ts.motions.Sine(-1.0, 1.0, np.pi / 2) - 0.3)
    scene.add(ts.forces.Torque(wheel, torque=(0, 0, torque)))
    solution = ts.simulate(scene, (0, 10.0), rtol=1e-12, atol=1e-12)
    begun = np.arccos(-0.3)

    def angle(t):
        return np.cos(t) - np.cos(begun) + np.sin(begun) * (t - begun) - 0.15 * (t - begun) ** 2

    landed = brentq(angle, begun + 1.0, 10.0, xtol=1e-15)
    rate = -np.sin(landed) + np.sin(begun) - 0.3 * (landed - begun)
    assert abs(solution.phases[0][1] - begun) < 1e-9
    assert abs(solution.impulses[0][0] - landed) < 1e-10
    np.testing.assert_allclose(solution.impulses[0][2], -1.5 * share * inertia * rate, rtol=1e-9)


def test_a_stop_of_a_slide():
    scene = ts.Scene(gravity=(0, 0, 0))
    block = scene.add_body(mass=2.0, inertia=(1, 1, 1), velocity=(0.5, 0, 0))
    slide = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.Stop(slide, lower=-0.1, upper=0.3, restitution=1.0, name="buffers"))
    solution = ts.simulate(scene, (0, 3.0))
    np.testing.assert_allclose(
        [t for t, *_ in solution.impulses], [0.6, 1.4, 2.2, 3.0][: len(solution.impulses)], atol=1e-13
    )
    assert -0.1 - 1e-14 < solution.displacement(slide).min() < solution.displacement(slide).max() < 0.3 + 1e-14


@pytest.mark.parametrize(
    ("which", "t", "impulse"),
    [((), 0.5, 0.4), (("angle",), 0.5, 0.4), (("displacement",), 1.0, 2.0), (("displacement", 0), 1.0, 2.0)],
)
def test_a_stop_of_a_joint_with_both_coordinates(which, t, impulse, tmp_path):
    """The one that is named, elastic: 1 rad at 2 rad/s, or 1 m at 1 m/s. A file keeps it."""
    scene = ts.Scene(gravity=(0, 0, 0))
    rod = scene.add_body(1.0, (0.1, 0.1, 0.1), velocity=(0, 0, 1), angular_velocity=(0, 0, 2), name="rod")
    sleeve = scene.add(C.Cylindrical(scene.ground, rod, axis_a=(0, 0, 1), axis_b=(0, 0, 1), name="sleeve"))
    stop = scene.add(C.Stop((sleeve, *which) if which else sleeve, upper=1.0, restitution=1.0, name="stop"))
    assert (stop.joint, stop.coordinate[0]) == (sleeve, which[0] if which else "angle")
    scene.save(tmp_path / "sleeve.toml")
    for each in (scene, scene.copy(), ts.load(tmp_path / "sleeve.toml")):
        ((at, name, p),) = ts.simulate(each, (0, 2.5)).impulses
        assert name == "stop"
        np.testing.assert_allclose((at, p), (t, impulse), rtol=1e-13)


def test_a_stop_of_the_second_angle():
    scene = ts.Scene(gravity=(0, 0, 0))
    fork = scene.add_body(1.0, (0.1, 0.1, 0.1), angular_velocity=(0, 2, 0), name="fork")
    joint = scene.add(C.Universal.at(scene.ground, fork, point=(0, 0, 0), axis=(1, 0, 0), axis_b=(0, 1, 0)))
    scene.add(C.Stop((joint, "angle", 1), upper=0.5, name="stop"))
    solution = ts.simulate(scene, (0, 1))
    ((t, _, impulse),) = solution.impulses
    np.testing.assert_allclose((t, impulse), (0.25, 0.2), rtol=1e-13)
    with pytest.raises(ts.InvalidConstraint, match="say which coordinate"):
        C.Stop((joint, "displacement"), upper=0.5)


# boxes: redundant contacts


@pytest.mark.parametrize(("tilt", "e", "spin"), [(0.0, 0.3, (0, 0, 0)), (0.2, 0.3, (0, 0, 0)), (0.5, 0.0, (1, 1, -2))])
def test_a_box_falls_and_comes_to_rest_on_four_corners(tilt, e, spin):
    scene = box(tilt, e, spin)
    solution = ts.simulate(scene, (0, 6.0))
    assert solution.success
    assert len(solution.phases[-1][2]) == 4
    reactions = sum(solution.reaction(name)[0][-1] for name in solution.phases[-1][2])
    np.testing.assert_allclose(reactions, [0, 0, 2 * G], atol=1e-10)
    assert np.abs(solution.velocity("box")[-1, 2]) < 1e-14
    assert np.diff(solution.energy).max() < 1e-10 * G
    assert penetration(scene, solution) > -1e-14
    assert solution.constraint_error.position.max() < 1e-14


def test_impulses_account_for_the_momentum_of_a_stack():
    """Also where an impact lifts other corners by less than rounding."""
    scene, below, floor = ts.Scene(gravity=(0, 0, -G)), None, []
    for i, half in enumerate((0.0012, -0.0013)):
        given = {"position": (0, 0, 0.28 + 0.53 * i), "orientation": (np.cos(half), np.sin(half), 0, 0)}
        block = scene.add_body(**ts.shapes.box((1, 1, 0.5), mass=1.0), **given)
        for x, y in product((-0.5, 0.5), repeat=2):
            law = {"unilateral": True, "restitution": 0.5, "normal_b": (0, 0, 1), "point_b": (0, 0, 0.25 * i)}
            corner = scene.add(C.PlaneContact(block, below or scene.ground, point_a=(x, y, -0.25), **law))
            floor += [corner.name] * (below is None)
        below = block
    solution = ts.simulate(scene, (0, 0.6))
    times, first, count = np.unique(solution.t, return_index=True, return_counts=True)
    left = [
        (solution.qd[i + k - 1] - solution.qd[i])[[2, 9]].sum()
        - sum(p for at, name, p in solution.impulses if at == t and name in floor)
        for t, i, k in zip(times, first, count, strict=True)
        if k > 1
    ]
    assert len(left) > 80
    assert np.abs(left).max() < 1e-14


def test_the_instant_of_a_flat_box():
    """All corners together make the bouncing ball."""
    solution = ts.simulate(box(0.0, 0.3), (0, 2.0))
    fall = np.sqrt(1.6 / G)
    assert abs(solution.phases[-1][0] - fall * (1 + 0.6 / 0.7)) < 1e-9  # rounding of a gap, over the last rate


# beside a run without contacts


def test_events_of_the_user_beside_contacts():
    def top(t, state):
        return state.velocity("ball")[2]

    top.direction = -1
    scene, fall = bouncing(0.5)
    solution = ts.simulate(scene, (0, 1.2), events=top)
    np.testing.assert_allclose(solution.t_events[0], fall * np.array([0, 1.5, 2.25, 2.625]), atol=1e-12)
    top.terminal = 3
    ended = ts.simulate(scene, (0, 3.0), events=top)
    assert ended.status is ts.Status.EVENT
    assert abs(ended.reached - 2.25 * fall) < 1e-12


@pytest.mark.parametrize("height", [0.3, 1.0, 100.0])
@pytest.mark.parametrize("direction", [0, -1])
def test_an_event_at_the_instants_of_impacts(height, direction):
    """The height vanishes at the impacts themselves: each is an event, and none is two."""
    scene, fall = bouncing(0.5, height=height)

    def lands(t, state):
        return state.position("ball")[2]

    lands.direction = direction
    solution = ts.simulate(scene, (0, 10 * fall), events=lands)
    impacts = np.array([t for t, *_ in solution.impulses])
    exact = fall * (1 + 2 * np.append(0.0, np.cumsum(0.5 ** np.arange(1, 15))))
    np.testing.assert_allclose(solution.t_events[0][:15], exact, rtol=1e-12)
    np.testing.assert_allclose(solution.t_events[0][:15], impacts[:15], rtol=1e-12)
    np.testing.assert_allclose(solution.qd_events[0][:5, 2], -G * fall * 0.5 ** np.arange(5), rtol=1e-12)


@pytest.mark.parametrize("of_time", [True, False])
def test_a_terminal_event_at_the_instant_of_an_impact(of_time):
    """The run ends before the impact, with which the next run begins."""
    scene, fall = bouncing(0.5)

    def lands(t, state):
        return t - fall if of_time else state.position("ball")[2]

    lands.terminal = True
    solution = ts.simulate(scene, (0, 2.0), events=lands)
    assert solution.status is ts.Status.EVENT
    assert "event 0 (lands)" in solution.message
    assert solution.t[-1] == pytest.approx(fall, rel=1e-15)
    assert solution.velocity("ball")[-1, 2] == pytest.approx(-G * fall, rel=1e-14)
    on = ts.simulate(scene, (solution.t[-1], 2.0), state=solution.state)
    assert next(t for t, *_ in (*solution.impulses, *on.impulses)) == solution.t[-1]


def test_an_event_where_sliding_ends():
    """The velocity vanishes at v / (mu g), where the block begins to stick."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_point_mass(1.0, velocity=(1, 0, 0), name="block")
    floor = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.3}
    scene.add(C.PlaneContact(block, scene.ground, **floor, name="floor"))

    def stops(t, state):
        return state.velocity("block")[0]

    stops.terminal = True
    solution = ts.simulate(scene, (0, 1), events=stops)
    assert solution.t_events[0] == pytest.approx([1 / (0.3 * G)], rel=1e-14)
    assert solution.status is ts.Status.EVENT


def test_a_run_that_ends_at_an_impact_ends_before_it():
    scene, fall = bouncing(0.5)
    solution = ts.simulate(scene, (0, fall))
    assert (solution.message, solution.impulses) == ("The run reached the end of the interval.", [])
    assert solution.velocity("ball")[-1, 2] == pytest.approx(-G * fall, rel=1e-14)


def test_the_text_of_a_solution_counts_its_phases():
    """Friction that turns around beside rows that go on to hold begins no phase."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_body(1.0, (1, 1, 1), position=(2.0, 0, 0), name="block")
    scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(ts.forces.Spring(scene.ground, block, stiffness=10.0, free_length=1.0))
    scene.add(ts.forces.CoulombFriction(block, scene.ground, force=0.1))
    solution = ts.simulate(scene, (0, 5.0))
    assert solution.phases == [(0, 5.0, ())]
    assert "phases  1 phase, 0 impulses" in str(solution)


def test_a_run_goes_on_from_a_state_in_contact():
    scene, _ = bouncing(0.5)
    whole = ts.simulate(scene, (0, 4.0))
    first = ts.simulate(scene, (0, 2.0))
    rest = ts.simulate(scene, (2.0, 4.0), state=first.state)
    assert rest.phases == [(2.0, 4.0, ("floor",))]
    np.testing.assert_allclose(rest.position("ball")[-1], whole.position("ball")[-1], atol=1e-13)


def test_the_same_bits_again():
    one, other = (ts.simulate(box(0.3, 0.4), (0, 1.0)) for _ in range(2))
    np.testing.assert_array_equal(one.q, other.q)
    assert one.impulses == other.impulses


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rk45", "nystrom4", "radau", "taylor"])
def test_every_method(method):
    scene, fall = bouncing(0.8)
    options = {"rtol": 1e-10, "atol": 1e-10} if method != "nystrom4" else {}
    solution = ts.simulate(scene, (0, 5.0), integrator=method, **options)
    assert abs(solution.phases[-1][0] - 9 * fall) < 1e-8
    assert solution.phases[-1][2] == ("floor",)


def test_a_scene_without_contacts_has_one_phase():
    scene = ts.Scene()
    scene.add_point_mass(mass=1.0)
    solution = ts.simulate(scene, (0, 1))
    assert (solution.phases, solution.impulses) == ([(0.0, 1.0, ())], [])


# refusals


def test_a_start_that_penetrates_is_named_and_assembled():
    scene, _ = bouncing(0.5)
    scene.body("ball").position = (0, 0, -0.2)
    with pytest.raises(ts.InconsistentState, match=r"floor penetrates by 0\.2"):
        ts.simulate(scene, (0, 1))
    scene.assemble()
    assert abs(scene.body("ball").position[2]) < 1e-15
    assert ts.simulate(scene, (0, 1)).phases == [(0.0, 1.0, ("floor",))]


def test_coefficients_and_bounds():
    scene, _ = bouncing(0.5)
    ball = scene.body("ball")
    for e in (-0.1, 1.1, np.nan, None):
        with pytest.raises(ts.TsdynError, match="restitution"):
            C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, restitution=e)
    with pytest.raises(ts.InvalidConstraint, match="unilateral=True"):
        C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), restitution=0.5)
    with pytest.raises(ts.InvalidConstraint, match="unilateral=True"):
        C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), kinetic=0.3)
    scene, _ = pendulum(0.0)
    for bounds, match in (
        ((1, 1), "lower must be below"),
        ((2, 1), "lower must be below"),
        ((None, None), "give lower"),
    ):
        with pytest.raises(ts.InvalidConstraint, match=match):
            C.Stop(scene["hinge"], *bounds)
    with pytest.raises(ts.InvalidConstraint, match="angle or a displacement"):
        C.Stop(scene.body("bar"), 0.0)
    place = {"point": (0, 0, 0), "axis": (0, 1, 0), "name": "loose"}
    loose = C.Revolute.at(scene.ground, scene.body("bar"), **place)
    for item in (C.Stop, C.Ratchet):
        with pytest.raises(ts.InvalidConstraint, match="add its joint 'loose' to the scene first"):
            item(loose, 1)


def test_radii():
    scene, _ = bouncing(0.5)
    ball = scene.body("ball")
    for arguments, match in (
        ({"radius_a": 0.1}, "neither"),
        ({"radius_a": 0.1, "radius_b": 1.0, "normal_b": (0, 0, 1)}, "both"),
        ({"radius_a": -0.1, "normal_b": (0, 0, 1)}, "radius_a"),
        ({"radius_a": 0.0, "radius_b": 0.0}, "two points"),
        ({"radius_a": 0.1, "radius_b": 0.1, "inside": True}, "larger than"),
    ):
        with pytest.raises(ts.InvalidConstraint, match=match):
            C.SphereContact(ball, scene.ground, **arguments)


def test_bodies_that_are_squeezed_end_the_run_with_an_account():
    """A ceiling that comes down on a ball on the floor."""
    scene = ts.Scene(gravity=(0, 0, 0))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 0), name="ball")
    press = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1), velocity=(0, 0, -1), name="press")
    slide = scene.add(C.Translational.at(scene.ground, press, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.TranslationMotor.of(slide, displacement=-1.0 * ts.motions.time))
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor"))
    scene.add(C.PlaneContact(ball, press, normal_b=(0, 0, -1), unilateral=True, name="ram"))
    solution = ts.simulate(scene, (0, 2.0))
    assert solution.status is ts.Status.CONTACT_FAILED
    assert abs(solution.reached - 1.0) < 1e-13
    assert "floor" in solution.message
    assert "ram" in solution.message


def test_what_impacts_refuse():
    scene, _ = bouncing(0.5)
    with pytest.raises(ts.InvalidArgument, match="law"):
        ts.impact(scene, ts.State(0.0, *scene.start), law="stronge")
    with pytest.raises(ts.InvalidConstraint, match="wall"):
        ts.impact(scene, ts.State(0.0, *scene.start), contacts=["wall"])
    with pytest.raises(ts.InvalidConstraint, match="'wall'"):
        ts.impact(scene, ts.State(0.0, *scene.start), contacts="wall")


def test_an_impact_of_one_contact_by_its_name_or_itself():
    scene, _ = bouncing(0.5)
    state = ts.State(0.0, scene.start[0], np.array([1.0, 0.0, -2.0]))
    for contacts in ("floor", scene["floor"], ["floor"]):
        after, impulses = ts.impact(scene, state, contacts)
        np.testing.assert_allclose(after.qd, [1.0, 0.0, 1.0], rtol=4 * EPS)
        np.testing.assert_allclose(impulses["floor"], 0.5 * 3.0, rtol=4 * EPS)


def test_a_scene_of_a_file(tmp_path):
    scene, _ = pendulum(0.5)
    read = ts.load(scene.save(tmp_path / "pendulum.toml"))
    one, other = (ts.simulate(each, (0, 2.0)) for each in (scene, read))
    np.testing.assert_array_equal(one.q, other.q)
    assert len(one.impulses) > 1


def test_a_flight_that_another_event_ends_ends_its_phase():
    """From 1.0 s on, where contact was to begin at 1.4 s; at 1.2 s another contact closes."""
    phases = Phases(None, None)
    phases.add(0, 0.0, 0.0, 1.0, ("a",), ((), {}))
    phases.add(1, 1.0, 1.4, 1.2, ("a", "b"), ((), {}))
    phases.add(2, 1.2, 1.2, 2.0, ("b",), ((), {}))
    assert phases.merged() == [(0.0, 1.2, ("a",)), (1.2, 2.0, ("b",))]


@pytest.mark.parametrize("angle", [-0.8, -0.5, 0.6])
def test_forms_agree_on_a_rod_that_falls_on_one_end(angle):
    """After the impact it turns without an acceleration: the first steps are too long, and Newton's method goes astray.

    Those that follow begin with what the last accepted state had.
    """
    scene = ts.Scene(gravity=(0, 0, -9.81))
    turned = np.cos(angle / 2), 0, np.sin(angle / 2), 0
    rod = scene.add_body(1.0, (1e-3, 0.0133, 0.0133), position=(0, 0, 0.5), orientation=turned, name="rod")
    for x in (-0.2, 0.2):
        at = {"point_a": (x, 0, 0), "normal_b": (0, 0, 1)}
        scene.add(C.PlaneContact(rod, scene.ground, **at, unilateral=True))
    given = {"t_eval": np.linspace(0.0, 0.6, 25), "rtol": 1e-8, "atol": 1e-8, "integrator": "rk45"}
    tangent, basis = (ts.simulate(scene, (0, 1), formulation=form, **given) for form in ("tangent", "null-space"))
    assert basis.success
    np.testing.assert_allclose(basis.q, tangent.q, atol=1e-6)
