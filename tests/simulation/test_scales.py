"""Scenes far from the origin, and small ones: as exact as those of metres beside it."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, FAIR, FINE, NEAR, ROUGH, ROUNDING
from tsdyn.runs import driver

C, I, F = ts.constraints, ts.integrators, ts.forces
X, _, Z = np.eye(3)
AWAY = np.array([1e6, -7e5, 3e5])


def pendulum(place, joint="Revolute", arm=1.0):
    """A rod on a pin, or a point on a rod, that starts at speed."""
    scene = ts.Scene()
    place = np.array(place, float)
    if joint == "Revolute":
        rod = scene.add_body(1.0, (0.1, 0.1, 0.1), place + arm * X, velocity=(0, 0, 2.0), angular_velocity=(0, -2.0, 0))
        scene.add(C.Revolute.at(scene.ground, rod, point=place, axis=(0.0, 1.0, 0.0)))
    else:
        bob = scene.add_point_mass(mass=1.0, position=place + arm * X, velocity=(0.0, 1.0, 2.0))
        scene.add(C.Distance(scene.ground, bob, point_a=place))
        scene.add(F.Spring(scene.ground, bob, point_a=place + 2.0 * Z, stiffness=3.0))
    return scene


@pytest.mark.parametrize("joint", ["Revolute", "Distance"])
@pytest.mark.parametrize("method", [I.DOP853(1e-12, 1e-12), I.Taylor(tol=1e-13)], ids=str)
def test_a_pendulum_far_away_moves_as_one_at_the_origin(joint, method):
    options = {"integrator": method, "t_eval": np.linspace(0.0, 1.0, 11), "dense_output": True, "events": falls}
    near, far = (ts.simulate(pendulum(place, joint), (0.0, 1.0), **options) for place in (np.zeros(3), AWAY))
    assert near.success
    assert far.success
    assert abs(far.stats.steps - near.stats.steps) <= 2
    body, other = near.scene.bodies[0], far.scene.bodies[0]
    np.testing.assert_allclose(far.position(other) - AWAY, near.position(body), rtol=0.0, atol=2 * CLOSE)
    np.testing.assert_allclose(far.qd, near.qd, rtol=0.0, atol=FINE)
    np.testing.assert_allclose(far.at(0.55).q[:3] - AWAY, near.at(0.55).q[:3], rtol=0.0, atol=2 * CLOSE)
    np.testing.assert_allclose(far.t_events[0], near.t_events[0], rtol=0.0, atol=NEAR)
    np.testing.assert_allclose(far.q_events[0][:, :3] - AWAY, near.q_events[0][:, :3], rtol=0.0, atol=FAIR)
    if joint == "Revolute":  # whose velocity rows know nothing of positions
        assert far.constraint_error.velocity.max() < ROUNDING
    assert far.constraint_error.position.max() < CLOSE
    again = ts.simulate(far.scene, (1.0, 1.5), integrator=method, state=far.state)
    assert again.success


def falls(t, state):
    """Where the velocity changes from up to down."""
    return state.qd[2]


def test_events_see_the_scene_s_own_positions():
    seen = []

    def height(t, state):
        seen.append(state.q[0])
        return state.q[2] - AWAY[2]

    solution = ts.simulate(pendulum(AWAY), (0.0, 1.0), integrator=I.Nystrom4(step=0.02), events=height)
    assert solution.success
    assert min(seen) > AWAY[0] - 3.0


@pytest.mark.slow
def test_a_function_of_the_state_is_given_the_scene_s_own_positions():
    scene = pendulum(AWAY)
    scene.add(F.PointForce(scene.bodies[0], force=attraction))
    solution = ts.simulate(scene, (0.0, 0.01), integrator=I.Nystrom4(step=0.01))
    state = scene.evaluate(solution.q[-1], solution.qd[-1], solution.t[-1])
    np.testing.assert_allclose(solution.qdd[-1], state.qdd, rtol=0.0, atol=ROUGH)


@pytest.mark.slow
def test_where_no_origin_can_be_moved_tolerances_are_what_rounding_allows():
    scene = pendulum(AWAY)
    scene.add(F.PointForce(scene.bodies[0], force=attraction))
    solution = ts.simulate(scene, (0.0, 1.0), integrator=I.DOP853(1e-12, 1e-12), max_steps=1000)
    assert solution.success
    assert "The tolerances were raised to rtol=" in solution.message
    assert "1e+06 m from the origin, where on a lever of 1 m no more digits" in solution.message


def attraction(t, state):
    """Towards the origin."""
    return (-1e-6 * state[0], 0.0, 0.0)


def test_a_run_that_would_never_end_is_ended(monkeypatch):
    """After a number of steps, whatever the machine has made of them in a slice."""
    scene = ts.Scene()
    bob = scene.add_point_mass(mass=1.0, position=(1.0, 0.0, 0.0))
    scene.add(F.Spring(scene.ground, bob, stiffness=1e10, free_length=0.9))
    solution = ts.simulate(scene, (0.0, 1e6), integrator=I.DOP853())
    assert solution.status == ts.Status.STEP_COLLAPSED
    assert "At the pace of the last 2048 steps" in solution.message
    assert solution.stats.steps == 1024 + 2048
    monkeypatch.setattr(driver, "FIRST_SLICE", 3)
    monkeypatch.setattr(driver, "SLICE_SECONDS", 0.002)
    assert ts.simulate(scene, (0.0, 1e6), integrator=I.DOP853()).reached == solution.reached
    assert ts.simulate(scene, (0.0, 1e6), integrator=I.DOP853(), max_steps=5000).status == ts.Status.MAX_STEPS


def four_bar(size, revolute=False):
    """Rods on balls or revolute joints, of density 1000 and of this size in m."""
    scene, corners = ts.Scene(), size * np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.5, 0.0, 1.5), (2.0, 0.0, 0.0)])
    mass = 1e3 * size**3
    bodies = [
        scene.add_body(mass, mass * size**2 * np.array((0.1, 0.1, 0.1)), 0.5 * (a + b)) for a, b in pairwise(corners)
    ]
    around = [scene.ground, *bodies, scene.ground]
    for i, point in enumerate(corners):
        if revolute:
            scene.add(C.Revolute.at(around[i], around[i + 1], point=point, axis=(0.0, 1.0, 0.0)))
        else:
            scene.add(C.Spherical.at(around[i], around[i + 1], point=point))
    for body in [] if revolute else bodies:
        scene.add(C.Dot1.at(scene.ground, body, axis_a=(0.0, 1.0, 0.0), axis_b=(1.0, 0.0, 0.0)))
    return scene


@pytest.mark.slow_for("SDIRK54")
@pytest.mark.parametrize("method", [I.SDIRK54, I.DOP853])
def test_a_four_bar_of_nanometres(method):
    runs = []
    for size in (1.0, 1e-9):
        time = np.sqrt(size)
        solution = ts.simulate(four_bar(size), (0.0, 0.3 * time), integrator=method(step=0.01 * time))
        assert solution.success, solution.message
        runs.append(solution.orientation(solution.scene.bodies[1])[-1])
    np.testing.assert_allclose(runs[1], runs[0], rtol=0.0, atol=CLOSE)


@pytest.mark.slow_for("*implicit*", "nystrom4")
@pytest.mark.parametrize("method", ["default", "dop853", "nystrom4", "implicit_trapezoid"])
def test_revolute_joints_of_micrometres_don_t_come_apart(method):
    """Rows of axes are pure numbers: their rounding is not that of the lengths beside them."""
    size = 1e-6
    step = {"nystrom4": I.Nystrom4(step=1e-5), "implicit_trapezoid": I.ImplicitTrapezoid(step=1e-5)}
    options = {} if method == "default" else {"integrator": step.get(method, method)}
    solution = ts.simulate(four_bar(size, revolute=True), (0.0, 2e-3), t_eval=np.linspace(0.0, 2e-3, 41), **options)
    assert solution.success, solution.message
    for joint in [each for each in solution.scene.constraints if isinstance(each, C.Revolute)]:
        ends = [
            s if body is joint.scene.ground else solution.position(body, s)
            for body, s in zip((joint.a, joint.b), joint.coordinates, strict=False)
        ]
        assert np.linalg.norm(ends[0] - ends[1], axis=-1).max() < ROUNDING * size


def test_velocities_hold_along_a_link_that_is_much_shorter_than_a_small_scene(rng):
    """Two points 4.7 nm apart on links of 0.1 mm: a correction of 1e-15 m turns the line between them by 2e-7."""
    place = np.full(3, 5.766e-5)
    for _ in range(10):
        scene = ts.Scene(gravity=(337.0, 337.0, 337.0))
        a = scene.add_point_mass(mass=1e-10, position=place, velocity=1e-3 * rng.normal(size=3))
        beside = place + 4.7e-9 * np.array((0.4, -0.8, 0.4))
        b = scene.add_point_mass(mass=1e-10, position=beside, velocity=1e-3 * rng.normal(size=3))
        for body, pin in ((a, (6.7e-6, 6.7e-6, 1.15e-5)), (b, (9.1e-6, 6.8e-6, 6.7e-6))):
            scene.add(C.Distance(scene.ground, body, point_a=pin))
            scene.add(F.Spring(scene.ground, body, point_a=2.0 * place, stiffness=1e-3, free_length=1e-4))
        link = scene.add(C.Distance(a, b))
        scene.assemble()
        solution = ts.simulate(scene, (0.0, 1e-4), integrator="taylor")
        assert solution.success, solution.message
        line, rate = solution.position(b) - solution.position(a), solution.velocity(b) - solution.velocity(a)
        along = np.abs((line * rate).sum(axis=1)) / np.linalg.norm(rate, axis=1)
        assert along.max() < FINE * link.length


def falling_stack(L):
    """Three boxes above each other, in units of L, and the time unit, s."""
    scene, low, top, half, size = ts.Scene(), None, 0.0, 0.0, L * np.array((0.6, 0.5, 0.4))
    spread, floor = size @ size - size * size, {"unilateral": True, "restitution": 0.5, "normal_b": Z}
    for i in range(3):
        body = scene.add_body(L**3, L**3 * spread / 12, (0.0, 0.0, top + 0.05 * L * (i + 1) + size[2] / 2))
        for corner in product((-0.5, 0.5), (-0.5, 0.5), (-0.5,)):
            point = size * corner
            scene.add(C.PlaneContact(body, low or scene.ground, point_a=point, point_b=(0, 0, half), **floor))
        low, top, half = body, top + size[2], size[2] / 2
    return scene, np.sqrt(L)


@pytest.mark.parametrize("L", [1e-6, 1e3, 5e5])
def test_a_stack_falls_alike_in_all_units(L):
    phases = []
    for scene, T in map(falling_stack, (1.0, L)):
        solution = ts.simulate(scene, (0.0, 0.6 * T), integrator="dop853", rtol=1e-8, atol=1e-8 * min(L, 1.0))
        assert solution.success
        phases.append(np.array([start / T for start, *_ in solution.phases]))
    np.testing.assert_allclose(*phases, rtol=0.0, atol=1e-8)
    assert len(phases[0]) > 50


def test_a_small_pin_at_the_middle_of_its_eye_is_free():
    """It falls through the clearance of 2e-9 m, by its closed form."""
    scene, clearance = ts.Scene(gravity=(0.0, 0.0, -10.0)), 2e-9
    pin = scene.add_body(1.0, (1e-14, 1e-14, 1e-14))
    eye = {"radius_a": 1e-7, "radius_b": 1e-7 + clearance, "inside": True}
    scene.add(C.SphereContact(pin, scene.ground, **eye))
    solution = ts.simulate(scene, (0.0, 1e-4))
    assert solution.success
    np.testing.assert_allclose(solution.impulses[0][0], np.sqrt(2.0 * clearance / 10.0), rtol=1e-6)


@pytest.mark.parametrize("seed", [0, 3, 4, 7])
def test_a_stop_ends_a_fast_motion_in_large_units(seed):
    """What is left of 1e9 m/s by rounding is no velocity that breaks a constraint."""
    rng, L, rate, scene = np.random.default_rng(seed), 2e5, 7e3, ts.Scene(gravity=np.zeros(3))
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    arm, turned = L * rng.normal(size=3), Rotation.from_rotvec(rng.normal(size=3))
    turn = {"velocity": rate * np.cross(axis, arm), "angular_velocity": turned.inv().apply(rate * axis)}
    body = scene.add_body(1.0, (L * L, L * L, L * L), arm, turned, **turn)
    hinge = scene.add(C.Revolute.at(scene.ground, body, point=(0.0, 0.0, 0.0), axis=axis))
    scene.add(C.Stop(hinge, upper=0.3))
    solution = ts.simulate(scene, (0.0, 1e-4))
    assert solution.success
    np.testing.assert_allclose(solution.impulses[0][0], 0.3 / rate, rtol=1e-9)
    assert np.abs(solution.qd[-1]).max() <= 1e-12 * L * rate


@pytest.mark.parametrize("place", [np.zeros(3), np.array([2e4, -3e4, 1e4])])
def test_a_box_comes_to_rest_where_it_does_at_the_origin(place, tmp_path):
    """Corners stick at points of the ground; v^2 / (2 mu g) from the start."""
    scene, mu, v, corner = ts.Scene(), 0.3, 0.7, np.array([0.2, 0.15, 0.1])
    box = scene.add_body(2.0, (0.02, 0.04, 0.05), place + 0.1 * Z, velocity=(v, 0, 0), name="box")
    for i in range(4):
        point = corner * (1 - 2 * (i & 1), 1 - (i & 2), -1)
        law = {"unilateral": True, "kinetic": mu, "name": f"corner {i}"}
        scene.add(C.PlaneContact(box, scene.ground, point_a=point, point_b=place, normal_b=(0, 0, 1), **law))
    run = ts.simulate(scene, (0, 100), dense_output=True)
    stops = v / (mu * 9.81)
    assert run.success
    assert run.sticking("corner 0")[-1]
    assert run.phases[-1][0] == pytest.approx(stops, abs=1e-12)
    rest = place + v**2 / (2 * mu * 9.81) * X + 0.1 * Z
    np.testing.assert_allclose(run.position(box)[-1], rest, rtol=ROUNDING, atol=1e-14)
    np.testing.assert_allclose(run.at(50.0).position(box), rest, rtol=ROUNDING, atol=1e-14)
    run.save(tmp_path / "rest.h5")
    again = ts.load(tmp_path / "rest.h5", scene)
    np.testing.assert_array_equal(again.at(50.0).position(box), run.at(50.0).position(box))
    assert run.constraint_error.position.max() <= 1e-15 + ROUNDING * np.abs(place).max()


@pytest.mark.parametrize("L", [1.0, 7e5])
def test_a_rope_stops_a_pendulum_with_friction_alike_in_all_units(L):
    """Where the rope is taut, by its geometry; rounding of 1e7 m/s is no velocity that breaks a constraint."""
    scene, lean = ts.Scene(gravity=(0.0, 0.0, -200.0 * L)), 0.5
    inertia = 0.01 * L * L * np.ones(3)
    bob = scene.add_body(1.0, inertia, (L, 0.0, 0.0), Rotation.from_rotvec((0.1, -0.1, 0.6)))
    hinge = scene.add(C.Revolute.at(scene.ground, bob, point=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)))
    friction = scene.add(F.RevoluteFriction(hinge, radius=0.1 * L, kinetic=0.6))
    ends = [(scene.ground, (0.0, 0.0, 0.5 * L)), (bob, (0.0, 0.0, 0.0))]
    scene.add(C.Rope(ends, length=L * np.sqrt(1.25 + np.sin(lean))))
    solution = ts.simulate(scene, (0.0, 0.3), integrator="taylor").raise_if_failed()
    assert solution.sticking(friction)[-1]
    place = L * np.array((np.cos(lean), 0.0, -np.sin(lean)))
    np.testing.assert_allclose(solution.position(bob)[-1], place, rtol=0.0, atol=1e-9 * L)
    assert np.abs(solution.qd[-1]).max() <= 1e-12 * np.abs(solution.qd).max()
