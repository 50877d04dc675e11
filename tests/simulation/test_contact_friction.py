"""Contacts with Coulomb friction against closed forms: sticking, sliding, rolling, impacts, openings; refusals."""

import pickle
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import tsdyn as ts
from tests.helpers.processes import ROOT
from tests.helpers.rough_boxes import FLOOR, G, boxes

C = ts.constraints


def slope(mu, angle, velocity=(0, 0, 0), static=None):
    """A particle on a plane whose normal is z, tilted about y by the direction of gravity."""
    scene = ts.Scene(gravity=(G * np.sin(angle), 0, -G * np.cos(angle)))
    block = scene.add_point_mass(mass=2.0, velocity=velocity, name="block")
    scene.add(C.PlaneContact(block, scene.ground, **FLOOR, kinetic=mu, static=static, name="floor"))
    return scene


def ball(kind, velocity=(0, 0, 0), spin=(0, 0, 0), mu=0.2, e=0.0, height=0.5, angle=0.0):
    """A solid ball of 0.5 m on the floor."""
    scene = ts.Scene(gravity=(G * np.sin(angle), 0, -G * np.cos(angle)))
    body = scene.add_body(1.0, (0.1, 0.1, 0.1), (0, 0, height), velocity=velocity, angular_velocity=spin, name="ball")
    law = {"kinetic": mu, "restitution": e, "name": "floor", "normal_b": (0, 0, 1)}
    if kind == "sphere":
        scene.add(C.SphereContact(body, scene.ground, radius_a=0.5, **law))
    else:
        scene.add(C.RollingBall(body, scene.ground, radius=0.5, **law))
    return scene


def motion(solution):
    """The largest change of any coordinate from output to output."""
    return np.ptp(solution.q, axis=0).max()


# a particle on a slope


def test_a_block_below_its_angle_does_not_move_by_one_rounding():
    solution = ts.simulate(slope(0.5, 0.4), (0, 1000))
    assert motion(solution) == 0.0
    assert solution.sticking("floor").all()
    assert solution.phases == [(0.0, 1000.0, ("floor",))]
    np.testing.assert_allclose(solution.reaction("floor")[0][-1], [-2 * G * np.sin(0.4), 0, 2 * G * np.cos(0.4)])
    assert abs(solution.friction_demand("floor")[-1] - np.tan(0.4)) < 1e-15


def test_a_block_above_its_angle_slides():
    solution = ts.simulate(slope(0.3, 0.4), (0, 2))
    a = G * (np.sin(0.4) - 0.3 * np.cos(0.4))
    np.testing.assert_allclose(solution.position("block")[-1], [2 * a, 0, 0], atol=1e-13)
    np.testing.assert_allclose(solution.reaction("floor")[0][-1], 2 * G * np.cos(0.4) * np.array([-0.3, 0, 1]))
    assert not solution.sticking("floor").any()


@pytest.mark.parametrize("static", [None, 0.8])
def test_a_block_that_slides_up_stops_or_comes_back(static):
    """tan(0.6) = 0.684: with 0.8 at rest it stays at the top, with 0.5 it comes back."""
    solution = ts.simulate(slope(0.5, 0.6, (-3, 0, 0), static), (0, 4))
    up, down = (G * (np.sin(0.6) + sign * 0.5 * np.cos(0.6)) for sign in (1, -1))
    top = 3 / up
    if static:
        assert abs(solution.phases[0][1] - top) < 1e-13
    place = -9 / (2 * up) + (0.0 if static else down * (4 - top) ** 2 / 2)
    assert abs(solution.position("block")[-1, 0] - place) < 1e-12
    assert solution.sticking("floor")[-1] == (static is not None)


def test_slip_across_a_slope_turns_down_it():
    """With mu = tan(angle) the speed and the velocity down the slope have a constant sum; it ends in half of it."""
    solution = ts.simulate(slope(np.tan(0.3), 0.3, (0, 2, 0)), (0, 30), rtol=1e-11, atol=1e-12)
    v = solution.velocity("block")
    speed = np.hypot(v[:, 0], v[:, 1])
    np.testing.assert_allclose(speed + v[:, 0], 2.0, atol=1e-9)
    assert abs(v[-1, 0] - 1.0) < 1e-6


@pytest.mark.parametrize(("mu", "angle"), [(0.3, np.radians(10)), (0.6, 0.3), (0.35, 0.3)])
def test_slip_across_a_slope_that_turns_down_it_ends_in_time(mu, angle):
    """v = v0 u^(p-1) (1 + u^2) / 2, u = tan(f / 2), p = mu / tan(angle), f from the line of fall: the time of rest."""
    solution = ts.simulate(slope(mu, angle, (0, 1, 0)), (0, 8), integrator=ts.integrators.Taylor(tol=1e-15))
    p = mu / np.tan(angle)
    time = (1 / (p - 1) + 1 / (p + 1)) / (2 * G * np.sin(angle))
    assert len(solution.phases) == 2
    assert abs(solution.phases[1][0] - time) < 1e-10
    assert solution.sticking("floor")[-1]


def test_energy_is_balanced_with_the_work_of_friction():
    solution = ts.simulate(slope(0.5, 0.4, (1, 2, 0)), (0, 6), dense_output=True)
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=1e-12)
    assert solution.dissipation[0] == pytest.approx(0.5 * 2 * G * np.cos(0.4) * 5**0.5, rel=1e-13)
    np.testing.assert_allclose(solution.work_of("floor")[-1], solution.work[-1], atol=1e-13)


# balls


@pytest.mark.parametrize("kind", ["sphere", "rolling"])
@pytest.mark.parametrize("spin", [0.0, -6.0])
def test_a_ball_slides_and_then_rolls(kind, spin):
    """Rolls from t = 2 (v - R w) / 7 mu g on with (5 v + 2 R w) / 7."""
    solution = ts.simulate(ball(kind, (2, 0, 0), (0, spin, 0)), (0, 4))
    begin = 2 * (2 - 0.5 * spin) / (7 * 0.2 * G)
    (_, end, sliding), (_, _, rolling) = solution.phases
    assert abs(end - begin) < 1e-14
    assert sliding == rolling == ("floor",)
    assert (solution.sticking("floor") == (solution.t > end))[solution.t != end].all()
    np.testing.assert_allclose(solution.velocity("ball")[-1], [(10 + spin) / 7, 0, 0], atol=1e-14)
    np.testing.assert_allclose(solution.reaction("floor")[0][[0, -1]], [[-2, 0, 10], [0, 0, 10]], atol=1e-13)
    np.testing.assert_allclose(solution.contact_point("floor")[-1, 2], 0.0, atol=1e-15)


def test_a_bowling_ball_runs_on_a_parabola():
    v, w = np.array([2.0, 0, 0]), np.array([4.0, 1, 0])
    slip = v + np.cross(w, [0, 0, -0.5])
    d, begin = slip / np.linalg.norm(slip), 2 * np.linalg.norm(slip) / (7 * 0.2 * G)
    solution = ts.simulate(ball("sphere", v, w), (0, 3))
    after = v - 0.2 * G * begin * d
    place = v * begin - 0.1 * G * begin**2 * d + after * (3 - begin)
    assert abs(solution.phases[0][1] - begin) < 1e-13
    np.testing.assert_allclose(solution.position("ball")[-1], place + np.array([0, 0, 0.5]), atol=1e-12)
    np.testing.assert_allclose(solution.velocity("ball")[-1], after, atol=1e-13)


@pytest.mark.parametrize(("mu", "rolls"), [(0.1, False), (0.5, True)])
def test_a_ball_on_a_slope(mu, rolls):
    solution = ts.simulate(ball("rolling", mu=mu, angle=0.6), (0, 2))
    a = 5 / 7 * G * np.sin(0.6) if rolls else G * (np.sin(0.6) - mu * np.cos(0.6))
    np.testing.assert_allclose(solution.position("ball")[-1], [2 * a, 0, 0.5], atol=1e-12)
    assert solution.sticking("floor")[-1] == rolls


def test_a_ball_rolls_off_a_ball():
    """Slips where 2 sin = mu (17 cos - 10 cos_0)."""
    scene, mu, start, reach = ts.Scene(gravity=(0, 0, -G)), 0.5, 0.05, 1.25
    place = (reach * np.sin(start), 0, reach * np.cos(start))
    body = scene.add_body(1.0, (0.025, 0.025, 0.025), position=place, name="ball")
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.25, radius_b=1.0, kinetic=mu, name="globe"))
    solution = ts.simulate(scene, (0, 1.6), rtol=1e-12, atol=1e-12, dense_output=True)
    slips = brentq(lambda a: 2 * np.sin(a) - mu * (17 * np.cos(a) - 10 * np.cos(start)), 0.1, 1.0)
    (_, t, rolling), (_, _, sliding), (_, _, flying) = solution.phases
    assert (rolling, sliding, flying) == (("globe",), ("globe",), ())
    assert (solution.sticking("globe") == (solution.t < t))[solution.t != t].all()
    x = solution.at(np.nextafter(t, 0)).position(body)
    assert abs(np.arctan2(x[0], x[2]) - slips) < 1e-13
    assert np.ptp(solution.energy[solution.t <= t]) < 1e-13


def test_a_ball_that_rolls_down_a_ball_slips_and_leaves():
    """It slips where 2/7 g sin = mu (g cos - d w^2), with a slip that begins without acceleration, while n turns."""
    R, r, mu, start = 1.0, 0.2, 0.5, 0.1
    d = R + r
    scene = ts.Scene(gravity=(0, 0, -G))
    place = (d * np.sin(start), 0, d * np.cos(start))
    ball = scene.add_body(1.0, (0.4 * r * r,) * 3, position=place, name="ball")
    scene.add(C.SphereContact(ball, scene.ground, radius_a=r, radius_b=R, kinetic=mu, name="hill"))
    solution = ts.simulate(scene, (0, 2), rtol=1e-12, atol=1e-12)

    def squared(angle):
        return 10 / 7 * G / d * (np.cos(start) - np.cos(angle))

    slips = brentq(lambda x: 2 / 7 * G * np.sin(x) - mu * (G * np.cos(x) - d * squared(x)), start, 1.2, xtol=1e-15)

    def sliding(t, y):
        return [y[1], (G * np.sin(y[0]) - mu * (G * np.cos(y[0]) - d * y[1] ** 2)) / d]

    def leaves(t, y):
        return G * np.cos(y[0]) - d * y[1] ** 2

    leaves.terminal = True
    begin = [slips, np.sqrt(squared(slips))]
    exact = solve_ivp(sliding, (0, 1), begin, method="DOP853", rtol=1e-13, atol=1e-14, max_step=1e-3, events=leaves)
    (_, slip, _), (_, leave, _), *_ = solution.phases
    assert abs(leave - slip - exact.t[-1]) < 1e-12


@pytest.mark.parametrize("method", [None, pytest.param("dop853", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["plane", pytest.param("ball", marks=pytest.mark.slow), "joint"])
def test_a_block_slips_on_a_plate_that_tilts(kind, method):
    """Along the plate: x'' = w^2 x + g sin a - mu N / m, N / m = g cos a - 2 w x' - w^2 h; x'' = 0 where it breaks."""
    w, mu, h = 0.5, 0.4, 0.1 * (kind == "ball")
    scene = ts.Scene(gravity=(0, 0, -G))
    plate = scene.add_body(5.0, (1, 1, 1), angular_velocity=(0, w, 0), name="plate")
    scene.add(C.Revolute.at(scene.ground, plate, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(C.RotationMotor.of(scene["hinge"], angle=ts.motions.Ramp(0, w)))
    block = scene.add_point_mass(mass=1.0, position=(1, 0, h), velocity=(w * h, 0, -w), name="block")
    if kind == "joint":
        scene.add(C.PlaneContact(block, plate, normal_b=(0, 0, 1), name="contact"))
        scene.add(ts.forces.ContactFriction(scene["contact"], kinetic=mu))
    elif kind == "plane":
        scene.add(C.PlaneContact(block, plate, **FLOOR, kinetic=mu))
    else:
        scene.add(C.SphereContact(block, plate, radius_a=h, normal_b=(0, 0, 1), kinetic=mu))
    solution = ts.simulate(scene, (0, 1.2), integrator=method, rtol=1e-12, atol=1e-12)

    def along(t, y):
        return [y[1], w * w * y[0] + G * np.sin(w * t) - mu * (G * np.cos(w * t) - 2 * w * y[1] - w * w * h)]

    breaks = brentq(lambda t: along(t, (1.0, 0.0))[1], 0.1, 1.2, xtol=1e-15)
    exact = solve_ivp(along, (breaks, 1.2), [1.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-14).y[0, -1]
    assert abs(solution.phases[0][1] - breaks) < 1e-13
    assert abs(solution.position("block")[-1] @ [np.cos(1.2 * w), 0, -np.sin(1.2 * w)] - exact) < 2e-11


def test_a_ball_rocks_in_a_bowl():
    """Rolls without slip: a pendulum of 7/5 of the length."""
    scene, reach = ts.Scene(gravity=(0, 0, -G)), 0.75
    place = (reach * np.sin(0.5), 0, -reach * np.cos(0.5))
    body = scene.add_body(1.0, (0.025, 0.025, 0.025), position=place, name="ball")
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.25, radius_b=1.0, inside=True, kinetic=1.0))
    solution = ts.simulate(scene, (0, 5), events=lambda t, state: state.position(body)[0], rtol=1e-12, atol=1e-12)
    period = 4 * np.sqrt(1.4 * reach / G) * ellipk(np.sin(0.25) ** 2)
    expected = period * (0.25 + 0.5 * np.arange(len(solution.t_events[0])))
    np.testing.assert_allclose(solution.t_events[0], expected, atol=1e-12)


# impacts


@pytest.mark.parametrize("law", ["newton", "poisson"])
@pytest.mark.parametrize("mu", [0.05, 0.5])
def test_an_oblique_impact_of_a_ball(mu, law):
    """It slides through the impact with mu (1 + e) v_n, or leaves with no slip: impulse 2/7 of the slip."""
    scene = ball("sphere", (2, 0, -3), (0, -4, 0), mu=mu, e=0.6)
    after, impulses = ts.impact(scene, ts.State(0.0, *scene.start), law=law)
    p, slip = 3 * 1.6, 2 + 0.5 * 4
    T = min(mu * p, 2 / 7 * slip)
    assert abs(impulses["floor"] - p) < 1e-14
    np.testing.assert_allclose(after.velocity("ball"), [2 - T, 0, 1.8], atol=1e-14)
    np.testing.assert_allclose(after.angular_velocity("ball"), [0, -4 + 0.5 * T / 0.1, 0], atol=1e-13)


@pytest.mark.parametrize("mu", [0.02, 0.4])
def test_a_rod_hits_a_plane(mu):
    """Routh's rod: one end at 45 degrees, by the two equations of its impact."""
    scene, s = ts.Scene(gravity=(0, 0, 0)), 2**-0.5
    tilted = Rotation.from_euler("y", -np.pi / 4)
    rod = scene.add_body(1.0, (1e-3, 1 / 3, 1 / 3), (s, 0, s), orientation=tilted, velocity=(-0.4, 0, -1), name="rod")
    scene.add(C.PlaneContact(rod, scene.ground, point_a=(-1, 0, 0), **FLOOR, kinetic=mu, restitution=0.5, name="tip"))
    after, impulses = ts.impact(scene, ts.State(0.0, *scene.start))
    # Of the tip: (x, z) velocities by impulses (T, N), arm (-s, -s) from the centre, inertia 1/3
    B = np.array([[1 + 3 * s * s, -3 * s * s], [-3 * s * s, 1 + 3 * s * s]])
    T, N = np.linalg.solve(B, [0.4, 1.5])  # sticks
    if abs(T) > mu * N:
        N = 1.5 / (B[1, 1] + mu * B[1, 0])
        T = mu * N
    assert abs(impulses["tip"] - N) < 1e-14
    np.testing.assert_allclose(after.velocity("rod"), [-0.4 + T, 0, -1 + N], atol=1e-14)


def test_restitution_is_lowered_where_friction_would_add_energy():
    """A rod that hits the floor at a steep angle, elastically: Newton's law would give it energy."""
    scene, a, w = ts.Scene(gravity=(0, 0, 0)), 1.2443, 1.3122
    start = {"velocity": (0.24285, 0, -1.65635), "angular_velocity": (0, -w, 0)}
    tilted, place = Rotation.from_euler("y", -a), (np.cos(a), 0, np.sin(a) + 0.01)
    rod = scene.add_body(1.0, (1e-3, 0.05, 0.05), place, orientation=tilted, **start)
    law = {"kinetic": 0.6, "restitution": 1.0, "name": "tip"}
    scene.add(C.PlaneContact(rod, scene.ground, point_a=(-1, 0, 0), **FLOOR, **law))
    solution = ts.simulate(scene, (0, 0.05))
    assert solution.success
    assert len(solution.impulses) >= 1
    assert "Restitution was lowered at 1 impact" in solution.message
    assert np.diff(solution.energy).max() <= 1e-13
    assert 0 < solution.energy[-1] <= solution.energy[0]


@pytest.mark.parametrize("law", ["newton", "poisson"])
@pytest.mark.parametrize("kinetic", [0.2, 0.6])
def test_a_pinned_rod_jams_where_it_hits_the_floor_too_steeply(kinetic, law):
    """Its end can't rise without a slip whose friction holds it down, where kinetic times the slope is above one."""
    scene, a, e, w = ts.Scene(gravity=(0, 0, -G)), 1.1, 0.5, 2.0
    tilted = Rotation.from_euler("y", a)
    place, turn = 0.5 * np.array((np.cos(a), 0, -np.sin(a))), np.array((0, w, 0))
    start = {"velocity": np.cross(turn, place), "angular_velocity": turn}
    rod = scene.add_body(1.0, (1e-3, 1 / 12, 1 / 12), place, orientation=tilted, name="rod", **start)
    scene.add(C.Spherical.at(scene.ground, rod, point=(0, 0, 0)))
    level = {"point_a": (0.5, 0, 0), "point_b": (0, 0, -np.sin(a)), "normal_b": (0, 0, 1), "unilateral": True}
    scene.add(C.PlaneContact(rod, scene.ground, kinetic=kinetic, restitution=e, name="tip", **level))
    after, _ = ts.impact(scene, ts.State(0.0, *scene.start), law=law)
    assert np.tan(a) * 0.2 < 1 < np.tan(a) * 0.6
    rises = 0.0 if kinetic == 0.6 else e * w
    if law == "newton" or kinetic == 0.6:
        np.testing.assert_allclose(after.angular_velocity("rod"), [0, -rises, 0], atol=1e-12)
    assert ts.simulate(scene, (0, 0.1), law=law).success


@pytest.mark.parametrize("seed", range(12))
def test_random_impacts_keep_the_laws(seed):
    """Of a box with five contacts: no approach, impulses that push, no energy gained, by both laws."""
    rng = np.random.default_rng(seed)
    scene = ts.Scene()
    start = {"velocity": rng.normal(size=3), "angular_velocity": rng.normal(size=3)}
    box = scene.add_body(mass=2.0, inertia=(1, 2, 2.5), **start)
    other = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(2, 0, 0), velocity=rng.normal(size=3))
    law = {"restitution": rng.uniform(), "kinetic": rng.choice([0.1, 0.5, 1.0])}
    scene.add(C.SphereContact(box, other, radius_a=1.0, radius_b=1.0, **law))
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        law = {"restitution": rng.uniform(), "kinetic": rng.choice([0.0, 0.3, 0.8])}
        corner = {"point_a": (x, y, -1), "point_b": (0, 0, -1)}
        scene.add(C.PlaneContact(box, scene.ground, **corner, **FLOOR, **law))
    before, M = ts.State(0.0, *scene.start), scene.evaluate().M
    for kind in ("newton", "poisson"):
        after, impulses = ts.impact(scene, before, law=kind)
        assert min(impulses.values()) >= 0.0
        assert after.qd @ M @ after.qd <= before.qd @ M @ before.qd * (1 + 1e-13)
        again, _ = ts.impact(scene, after, restitution=0.0, law=kind)
        assert again.qd @ M @ again.qd <= after.qd @ M @ after.qd * (1 + 1e-13)


@pytest.mark.slow_for("poisson-0.1", "newton-0.9")
@pytest.mark.parametrize("mu", [0.1, 0.9])
@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_impulses_of_friction_balance_the_momenta(law, mu, tmp_path):
    """Of a tumbling box: m dv = P, J dw = sum r x P, at every impact, also of a file; |p_t| <= mu p."""
    scene, size = ts.Scene(gravity=(0, 0, -G)), np.array([0.5, 0.3, 0.2])
    start = {"position": (0, 0, 0.7), "orientation": Rotation.from_euler("xyz", (0.3, 0.4, 0.1))}
    start |= {"velocity": (2.0, -1.0, 0.0), "angular_velocity": (1.0, -3.0, 4.0)}
    body = scene.add_body(**ts.shapes.box(size, mass=2.0), **start, name="box")
    corners = size / 2 * np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
    for i, corner in enumerate(corners):
        place = {**FLOOR, "point_a": corner, "restitution": 0.4, "kinetic": mu, "name": f"{i}"}
        scene.add(C.PlaneContact(body, scene.ground, **place))
    solution = ts.simulate(scene, (0, 0.9), law=law)
    solution.save(tmp_path / "box.h5")
    times = np.unique([t for t, *_ in solution.impulses])
    assert len(times) > 3
    for impulses in (solution.impulses, ts.load(tmp_path / "box.h5").impulses):
        for t in times:
            before, *_, after = np.flatnonzero(solution.t == t)
            P, L = np.zeros(3), np.zeros(3)
            for _, name, p in (each for each in impulses if each[0] == t):
                own = p.tangential + np.array([0, 0, p])
                assert np.linalg.norm(p.tangential) <= mu * p * (1.0 + 1e-12)
                P, L = P + own, L + np.cross(solution.rotation(body)[after] @ corners[int(name)], own)
            change = 2.0 * np.diff(solution.velocity(body)[[before, after]], axis=0)[0]
            np.testing.assert_allclose(P, change, atol=1e-13)
            spin = solution.angular_velocity(body)[[before, after]] * np.diagonal(body.inertia)
            np.testing.assert_allclose(solution.rotation(body)[after].T @ L, np.diff(spin, axis=0)[0], atol=1e-13)


def test_the_impulse_of_friction_of_one_impact():
    """Sphere with v = 3, p = m v_n = 4: it slides through mu p = 0.8, or rolls after 2/7 m v."""
    for mu, expected in ((0.2, -0.8), (0.9, -6 / 7)):
        scene = ball("sphere", (3, 0, -4), mu=mu)
        _, impulses = ts.impact(scene, ts.State(0.0, *scene.start))
        np.testing.assert_allclose(impulses["floor"], 4.0, rtol=1e-14)
        np.testing.assert_allclose(impulses["floor"].tangential, [expected, 0, 0], rtol=1e-13, atol=1e-15)


def test_a_ball_that_bounces_with_backspin_comes_back():
    """Without slip after the first impact: v = (5 v_0 + 2 R w_0) / 7."""
    solution = ts.simulate(ball("sphere", (1, 0, 0), (0, -9, 0), mu=0.6, e=0.7, height=1.5), (0, 6))
    assert len(solution.impulses) > 10
    np.testing.assert_allclose(solution.velocity("ball")[-1], [(5 - 9) / 7, 0, 0], atol=1e-13)
    assert np.diff(solution.energy).max() < 1e-13
    assert solution.phases[-1][2] == ("floor",)
    assert solution.sticking("floor")[-1]


# boxes: redundant contacts


@pytest.mark.parametrize("count", [1, 3])
def test_a_stack_on_a_slope_stands_still(count):
    scene = boxes(count, angle=0.4)
    solution = ts.simulate(scene, (0, 1000))
    assert motion(solution) == 0.0
    assert len(solution.phases) == 1
    assert all(solution.sticking(contact).all() for contact in scene.constraints[: 4 * count])


def test_a_box_on_a_slope_slides():
    scene = boxes(1, angle=0.4, mu=0.3)
    solution = ts.simulate(scene, (0, 1))
    a = G * (np.sin(0.4) - 0.3 * np.cos(0.4))
    np.testing.assert_allclose(solution.position("0")[-1], [a / 2, 0, 0.1], atol=1e-11)
    total = sum(solution.reaction(contact)[0][-1] for contact in scene.constraints[:4])
    np.testing.assert_allclose(total, G * np.cos(0.4) * np.array([-0.3, 0, 1]), atol=1e-11)


def test_a_sliding_box_stops():
    solution = ts.simulate(boxes(1, mu=0.3, velocity=(2, 1, 0)), (0, 2))
    assert abs(solution.phases[0][1] - 5**0.5 / 3) < 1e-12
    np.testing.assert_allclose(solution.position("0")[-1], [5**0.5 / 3, 5**0.5 / 6, 0.1], atol=1e-11)


@pytest.mark.parametrize(("mu", "tips"), [(1.0, True), (0.3, False)])
def test_a_tall_box_tips_or_slides(mu, tips):
    """At tan(0.5) = 0.546, with 1/3 as half of its width over half of its height."""
    scene = boxes(1, angle=0.5, mu=mu, size=(0.2, 0.2, 0.6))
    solution = ts.simulate(scene, (0, 0.2))
    turned = np.abs(solution.angular_velocity("0")[-1, 1])
    if tips:  # about its lower edge: inertia m (b^2 + h^2) / 3
        alpha = G * (0.3 * np.sin(0.5) - 0.1 * np.cos(0.5)) / ((0.04 + 0.36) / 3)
        assert abs(solution.angular_acceleration("0")[0, 1] - alpha) < 1e-12
        held = solution.phases[0][2]
        assert len(held) == 2
        assert all(solution.sticking(name)[0] for name in held)
    else:
        assert turned < 1e-10
        assert abs(solution.acceleration("0")[-1, 0] - G * (np.sin(0.5) - 0.3 * np.cos(0.5))) < 1e-10


def test_a_block_that_rocks_to_rest_is_only_pushed():
    """Housner: an impact leaves 1 - 3/2 sin^2 of the rate, the angle that of the diagonal; and so do its impulses."""
    scene, tilt, (b, h) = ts.Scene(gravity=(0, 0, -G)), 1e-3, (0.1, 0.3)
    turned = Rotation.from_euler("y", tilt)
    place = (0, 0, b * np.sin(tilt) + h * np.cos(tilt))
    block = scene.add_body(**ts.shapes.box((2 * b, 0.4, 2 * h), mass=2.0), position=place, orientation=turned)
    for x, y in ((-b, -0.2), (-b, 0.2), (b, -0.2), (b, 0.2)):
        contact = C.PlaneContact(block, scene.ground, point_a=(x, y, -h), **FLOOR, kinetic=0.8, name=f"{x} {y}")
        scene.add(contact)
    solution = ts.simulate(scene, (0, 1.0), rtol=1e-12)
    sums = {}
    for t, _, p in solution.impulses:
        assert p > 0.0
        sums[t] = sums.get(t, 0.0) + p
    left = 1 - 1.5 * b**2 / (b**2 + h**2)
    p = np.array(list(sums.values()))
    assert len(p) > 50
    np.testing.assert_allclose(p[31:41] / p[30:40], left, rtol=1e-6)
    assert len(solution.phases[-1][2]) == 4
    assert not solution.qd[-1].any()


# discs, belts, Painleve


def test_a_coin_slips_and_rolls():
    """Set down upright without spin at 2 m/s: a disc rolls with 2/3 of it."""
    scene = ts.Scene(gravity=(0, 0, -G))
    coin = scene.add_body(1.0, (0.0625, 0.125, 0.0625), position=(0, 0, 0.5), velocity=(2, 0, 0), name="coin")
    contact = C.RollingDisc(coin, scene.ground, radius=0.5, axis_a=(0, 1, 0), normal_b=(0, 0, 1), kinetic=0.1)
    scene.add(contact)
    solution = ts.simulate(scene, (0, 2))
    assert abs(solution.phases[0][1] - 2 / (3 * 0.1 * G)) < 1e-13
    np.testing.assert_allclose(solution.velocity("coin")[-1], [4 / 3, 0, 0], atol=1e-13)


def test_a_block_on_a_belt():
    """Carried along from rest until it sticks to the belt, at v / mu g."""
    scene = ts.Scene(gravity=(0, 0, -G))
    belt = scene.add_body(1.0, (1, 1, 1), velocity=(1.5, 0, 0), name="belt")
    slide = scene.add(C.Translational.at(scene.ground, belt, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(slide, displacement=1.5 * ts.motions.time))
    block = scene.add_point_mass(1.0, name="block")
    scene.add(C.PlaneContact(block, belt, **FLOOR, kinetic=0.3, name="grip"))
    solution = ts.simulate(scene, (0, 2))
    assert abs(solution.phases[0][1] - 0.5) < 1e-13
    assert abs(solution.position("block")[-1, 0] - (0.375 + 1.5 * 1.5)) < 1e-12
    assert solution.phases[-1][2] == ("grip",)
    assert solution.sticking("grip")[-1]


@pytest.mark.parametrize("speed", [1e-7, 1e-8])
def test_a_slow_slip_that_one_direction_forces_turns_to_where_friction_leaves_it(speed):
    """A belt drives the slip across a guide; along it the friction mu N sin(phi) carries the load: v = speed tan(phi).

    Friction turns such a slip within speed / (mu g), some 1e-9 s.
    """
    scene, mu, share = ts.Scene(gravity=(0, 0, -G)), 0.3, 0.6
    belt = scene.add_body(1.0, (1, 1, 1), velocity=(0, speed, 0), name="belt")
    slide = scene.add(C.Translational.at(scene.ground, belt, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.TranslationMotor.of(slide, displacement=speed * ts.motions.time))
    block = scene.add_point_mass(1.0, name="block")
    scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 1, 0)))
    scene.add(C.PlaneContact(block, belt, **FLOOR, kinetic=mu, name="grip"))
    scene.add(ts.forces.PointForce(block, force=(share * mu * G, 0, 0)))
    solution = ts.simulate(scene, (0, 1e-3), max_steps=300).raise_if_failed()
    assert abs(solution.velocity(block)[-1, 0] / speed - 0.75) < 0.05
    friction = solution.reaction("grip")[0][-1]
    np.testing.assert_allclose(friction[:2], mu * G * np.array([-share, np.sqrt(1 - share**2)]), rtol=1e-2)


def test_painleves_rod_ends_with_an_account():
    """A rod that slides with its upper end ahead and mu > 4/3 has no reaction: 1 + 3 cos (cos - mu sin) < 0."""
    scene, a = ts.Scene(gravity=(0, 0, -G)), 1.0
    tilted = Rotation.from_euler("y", -a)
    place = (np.cos(a), 0, np.sin(a))
    rod = scene.add_body(1.0, (1e-3, 1 / 3, 1 / 3), place, orientation=tilted, velocity=(-1, 0, 0))
    contact = C.PlaneContact(rod, scene.ground, point_a=(-1, 0, 0), **FLOOR, kinetic=2.0, name="tip")
    scene.add(contact)
    assert 1 + 3 * np.cos(a) * (np.cos(a) - 2 * np.sin(a)) < 0
    with pytest.raises(ts.InconsistentState, match=r"tip.*Painleve"):
        ts.simulate(scene, (0, 1))
    contact.kinetic = 0.5
    assert ts.simulate(scene, (0, 0.1)).success


# random scenes


def thrown_box(rng):
    """A box with eight corners, any friction and restitution."""
    scene, size = ts.Scene(), rng.uniform(0.2, 1.0, 3)
    start = {"velocity": rng.normal(size=3), "angular_velocity": 3 * rng.normal(size=3)}
    turned = Rotation.from_rotvec(rng.normal(size=3))
    box = scene.add_body(**ts.shapes.box(size, mass=2.0), position=(0, 0, 1), orientation=turned, **start)
    law = {"restitution": float(rng.choice([0.0, 0.3, 0.7])), "kinetic": float(rng.choice([0.1, 0.3, 0.8]))}
    for i in range(8):
        corner = size / 2 * [2 * (i & 1) - 1, (i & 2) - 1, (i & 4) / 2 - 1]
        scene.add(C.PlaneContact(box, scene.ground, point_a=corner, **FLOOR, **law))
    return scene


def thrown_coin(rng):
    """A torus on edge, tilted, with any spin."""
    scene, tilted = ts.Scene(), Rotation.from_rotvec([rng.uniform(-0.6, 0.6), 0, 0])
    start = {"velocity": rng.normal(size=3) * [1, 1, 0], "angular_velocity": 4 * rng.normal(size=3)}
    coin = scene.add_body(1.0, (0.0625, 0.125, 0.0625), (0, 0, 0.7), orientation=tilted, **start)
    law = {"restitution": float(rng.choice([0, 0.5])), "kinetic": float(rng.choice([0.05, 0.3, 0.8]))}
    sizes = {"radius": 0.5, "tyre_radius": 0.02, "axis_a": (0, 1, 0), "normal_b": (0, 0, 1)}
    scene.add(C.RollingDisc(coin, scene.ground, **sizes, **law))
    return scene


def heaped_balls(rng):
    """Balls one above the other, with friction between them and on the floor."""
    scene, found = ts.Scene(), []
    for i in range(rng.integers(2, 5)):
        mass, place = rng.uniform(0.1, 3.0), (*rng.uniform(-0.02, 0.02, 2), 0.3 + 0.3 * i)
        start = {"velocity": rng.normal(size=3), "angular_velocity": 10 * rng.normal(size=3)}
        ball = scene.add_body(mass, [0.004 * mass] * 3, place, **start)
        for other in [None, *found]:
            law = {"restitution": float(rng.choice([0.0, 0.3, 0.8])), "kinetic": float(rng.choice([0, 0.1, 0.3, 0.8]))}
            shape = {"normal_b": (0, 0, 1)} if other is None else {"radius_b": 0.1}
            scene.add(C.SphereContact(ball, other or scene.ground, radius_a=0.1, **shape, **law))
        found.append(ball)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("build", [thrown_box, thrown_coin, heaped_balls])
def test_random_scenes_keep_the_laws(build, seed):
    solution = ts.simulate(build(np.random.default_rng(seed)), (0, 1.5))
    assert solution.success, solution.message
    size = 1.0 + np.abs(solution.energy).max()
    assert np.diff(solution.energy).max() < 1e-7 * size  # the tolerance of the run
    assert solution.constraint_error.position.max() < 1e-11
    assert solution.dissipation.min() > -1e-9 * size
    assert min((impulse for *_, impulse in solution.impulses), default=1.0) > 0.0
    assert all(start < end for start, end, _ in solution.phases)


# methods, files, refusals


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dop853", "rk45", "radau", "sdirk54", "taylor"])
def test_every_method(method):
    scene = ball("rolling", (2, 0, 0), (0, -6, 0))
    solution = ts.simulate(scene, (0, 2), integrator=method, rtol=1e-10, atol=1e-10)
    assert abs(solution.phases[0][1] - 5 / 7) < 1e-9
    np.testing.assert_allclose(solution.velocity("ball")[-1], [4 / 7, 0, 0], atol=1e-8)


def test_the_same_bits_again_and_from_a_file(tmp_path):
    scene = boxes(1, mu=0.3, velocity=(1, 0.5, 0), spin=2.0)
    scene.add(C.SphereContact("0", scene.ground, radius_a=0.05, normal_b=(0, 0, 1), kinetic=0.2, static=0.3, name="x"))
    one = ts.simulate(scene, (0, 0.2))
    for other in (scene, ts.load(scene.save(tmp_path / "box.toml"))):
        np.testing.assert_array_equal(one.q, ts.simulate(other, (0, 0.2)).q)


def test_other_questions():
    """Friction is no constraint; it holds what a run from there would hold."""
    scene = slope(0.5, 0.4)
    assert scene.mobility().degrees_of_freedom == 2
    assert scene.evaluate().Phi.shape == (1,)
    assert scene.with_parameters({"floor.kinetic": 0.0})["floor"].rows == 1
    slides = scene.with_parameters({"floor.kinetic": 0.3})
    down = G * (np.sin(0.4) - 0.3 * np.cos(0.4)) / 2
    assert abs(ts.simulate(slides, (0, 1)).position("block")[-1, 0] - down) < 1e-13
    assert scene.equilibrium().moved == 0.0


def test_a_store_and_a_file_hold_them(tmp_path):
    scene = boxes(1, mu=0.3, velocity=(1, 0.5, 0), spin=1.0)
    plain = ts.simulate(scene, (0, 1))
    stored = ts.simulate(scene, (0, 1), store=tmp_path / "run.h5", checkpoint=0.0)
    plain.save(tmp_path / "saved.h5")
    for other in (stored, ts.load(tmp_path / "run.h5"), ts.load(tmp_path / "saved.h5")):
        np.testing.assert_array_equal(other.multipliers, plain.multipliers)
        np.testing.assert_array_equal(other.dissipation, plain.dissipation)
        assert other.phases == plain.phases


@pytest.mark.slow
def test_a_ball_slides_then_rolls_by_an_implicit_method_in_the_null_space_form():
    """Rows on velocities come in the second phase: it rolls at 5/7 of its first speed."""
    solution = ts.simulate(ball("rolling", (3, 0, 0)), (0, 2), integrator="sdirk54", formulation="null-space")
    assert solution.raise_if_failed().phases[-1][2] == ("floor",)
    np.testing.assert_allclose(solution.velocity("ball")[-1], (15 / 7, 0, 0), rtol=0, atol=1e-6)


@pytest.mark.slow
def test_a_solution_in_another_process(tmp_path):
    """Multipliers of a phase with friction, and of one with a stop: by memory of that process."""
    scene = boxes(1, velocity=(1, 0, 0))
    arm = scene.add_body(1.0, (1, 1, 1), position=(5, 0, 0))
    hinge = scene.add(C.Revolute.at(scene.ground, arm, point=(4, 0, 0), axis=(0, 1, 0)))
    scene.add(C.Stop(hinge, upper=0.3, restitution=0.5))
    solution = ts.simulate(scene, (0, 0.5))
    (tmp_path / "solution").write_bytes(pickle.dumps(solution))
    code = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb')).multipliers.tobytes().hex())"
    command = [sys.executable, "-c", code, str(tmp_path / "solution")]
    found = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=300)
    assert found.returncode == 0, found.stderr
    np.testing.assert_array_equal(np.frombuffer(bytes.fromhex(found.stdout)), solution.multipliers.ravel())


def test_bad_coefficients():
    scene = slope(0.3, 0.0)
    block, ground = scene.body("block"), scene.ground
    for arguments, match in (
        ({"kinetic": -0.1}, "kinetic must be"),
        ({"kinetic": np.nan}, "kinetic must be"),
        ({"kinetic": 0.3, "static": 0.2}, "static must be at least kinetic = 0.3"),
    ):
        with pytest.raises(ts.InvalidConstraint, match=match):
            C.PlaneContact(block, ground, **FLOOR, **arguments)
    with pytest.raises(ts.InvalidConstraint, match="unilateral=True"):
        C.PlaneContact(block, ground, normal_b=(0, 0, 1), kinetic=0.3)
    for bodies, radius in (((block, ground), 0.1), ((ground, block), 0.0)):
        with pytest.raises(ts.InvalidConstraint, match="can't turn the point mass 'block'"):
            C.SphereContact(*bodies, radius_a=radius, radius_b=0.2, kinetic=0.3)
    with pytest.raises(ts.InvalidConstraint, match="share must be 0"):
        C.SphereRolling(block, ground, distance=1.0, share=0.2)
    body = scene.add_body(1.0, (1, 1, 1), position=(0, 0, 3))
    with pytest.raises(ts.InvalidConstraint, match="leave out slip=True"):
        C.RollingBall(body, ground, radius=0.5, normal_b=(0, 0, 1), slip=True, kinetic=0.3)
    for name in ("static", "restitution"):
        with pytest.raises(ts.InvalidConstraint, match=f"{name} is of a constraint that opens; set kinetic, 0 without"):
            C.RollingBall(body, ground, radius=0.5, normal_b=(0, 0, 1), **{name: 0.3})
    with pytest.raises(ts.InvalidForce, match="no friction of the exact law"):
        ts.simulate(scene, (0, 0.1)).sticking(scene.add(ts.forces.PointForce(block, force=(0, 0, 0.1))))


def test_links_that_lie_on_a_floor_hold_each_other():
    """A link of 1 kg leans from a hinge to the floor, another one lies beyond: all is held, across the plane by joints.

    Weights are shared in halves; slips that bilateral constraints hold have no friction.
    """
    scene, height = ts.Scene(gravity=(0, 0, -G)), 0.3
    reach, law = np.sqrt(1.0 - height**2), FLOOR | {"point_a": (0.5, 0, 0), "kinetic": 0.6}
    leaning = Rotation.from_euler("y", np.arcsin(height))
    one = scene.add_body(1.0, (0.01, 0.1, 0.1), (reach / 2, 0, height / 2), leaning)
    two = scene.add_body(1.0, (0.01, 0.1, 0.1), (reach + 0.5, 0, 0))
    scene.add(C.Revolute.at(scene.ground, one, point=(0, 0, height), axis=(0, 1, 0)))
    scene.add(C.Revolute.at(one, two, point=(reach, 0, 0), axis=(0, 1, 0)))
    for body, name in ((one, "first"), (two, "second")):
        scene.add(C.PlaneContact(body, scene.ground, **law, name=name))
    solution = ts.simulate(scene, (0, 1))
    assert motion(solution) == 0.0
    assert np.isfinite(solution.multipliers).all()
    for name, load in (("first", G), ("second", G / 2)):
        np.testing.assert_allclose(solution.reaction(name)[0], np.tile([0, 0, load], (len(solution.t), 1)), atol=1e-9)


@pytest.mark.parametrize("who", ["run", "equilibrium"])
@pytest.mark.parametrize("mu", [(0.5, 0.5, 0.5), (0.2, 0.6, 0.9)])
def test_joints_carry_friction_that_blocks_share(who, mu):
    """Blocks of 1, 2 and 3 kg in a row, on rods; 12 N on the first: friction in proportion to its bounds mu N."""
    scene, masses = ts.Scene(gravity=(0, 0, -G)), np.array([1, 2, 3])
    blocks = [scene.add_point_mass(mass=m, position=(m, 0, 0), name=f"{m}") for m in masses.tolist()]
    for block, own in zip(blocks, mu, strict=True):
        scene.add(C.PlaneContact(block, scene.ground, **FLOOR, kinetic=own, name=f"floor {block.name}"))
    rods = [scene.add(C.Distance(a, b)) for a, b in pairwise(blocks)]
    scene.add(ts.forces.PointForce(blocks[0], force=(-12, 0, 0)))
    found = ts.simulate(scene, (0, 1)).raise_if_failed() if who == "run" else scene.equilibrium()
    T = 12 * masses * mu / (masses @ mu)
    for block, own in zip(blocks, T, strict=True):
        load = np.atleast_2d(found.reaction(f"floor {block.name}")[0])[-1]
        np.testing.assert_allclose(load, (own, 0, G * block.mass), atol=1e-12)
    for rod, a, pull in zip(rods, blocks, 12 - np.cumsum(T), strict=False):
        load = np.atleast_2d(found.reaction(rod, on=a)[0])[-1]
        np.testing.assert_allclose(load, (pull, 0, 0), atol=1e-12)
