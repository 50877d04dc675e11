"""Contacts with friction at the bound of sticking: closed forms of what holds, and of how a slip begins."""

import copy
import itertools

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import tsdyn as ts
from tsdyn.configuration.mobility import mobility_at
from tsdyn.simulation.contact_run import begun

C = ts.constraints
G, Z = 9.81, (0, 0, 1)  # m/s^2


@pytest.mark.parametrize("angle", [0.2, 0.4])
@pytest.mark.parametrize("speed", [0.0, -1.0])
def test_a_contact_that_slides_without_friction_sticks_up_to_its_static_bound(angle, speed):
    """tan(0.2) = 0.203 is below it, tan(0.4) = 0.423 above."""
    scene = ts.Scene(gravity=(G * np.sin(angle), 0, -G * np.cos(angle)))
    block = scene.add_point_mass(2.0, velocity=(speed, 0, 0), name="block")
    scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), unilateral=True, static=0.3, name="floor"))
    solution = ts.simulate(scene, (0, 1))
    a, holds = G * np.sin(angle), angle < 0.3
    place = -(speed**2) / (2 * a) if holds else speed + a / 2
    assert abs(solution.position("block")[-1, 0] - place) < 1e-14
    assert solution.sticking("floor")[-1] == holds
    np.testing.assert_allclose(solution.reaction("floor")[0][-1, 0], -2 * a if holds else 0.0, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("inside", [False, True])
def test_a_point_rests_on_a_ball_and_in_a_bowl(inside):
    scene, turn = ts.Scene(), np.pi if inside else 0.0
    place = [np.sin(0.2 + turn), 0, np.cos(0.2 + turn)]
    body = scene.add_body(2.0, (0.1, 0.1, 0.1), place, name="body")
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.0, radius_b=1.0, inside=inside, kinetic=0.5, name="rough"))
    solution = ts.simulate(scene, (0, 0.1), t_eval=[0.0])
    np.testing.assert_allclose(solution.friction_demand("rough"), np.tan(0.2), rtol=1e-14)
    np.testing.assert_allclose(solution.contact_point("rough"), [place], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("mu", [0.1, 0.2])
def test_a_light_box_slips_on_a_plate_that_shakes(mu):
    """A w^2 = 5 m/s^2; with all four corners at their bounds, three of them alone find no reactions."""
    scene = ts.Scene(gravity=(0, 0, -G))
    plate = scene.add_body(5.0, (1, 1, 1), velocity=(0.5, 0, 0))
    way = scene.add(C.Translational.at(scene.ground, plate, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(way, displacement=ts.motions.Sine(0.05, 10.0)))
    box = scene.add_body(1.0, (0.01, 0.01, 0.01), (0, 0, 0.02), velocity=(0.5, 0, 0), name="box")
    for corner in ((-0.3, -0.3, -0.02), (-0.3, 0.3, -0.02), (0.3, -0.3, -0.02), (0.3, 0.3, -0.02)):
        scene.add(C.PlaneContact(box, plate, point_a=corner, normal_b=(0, 0, 1), unilateral=True, kinetic=mu))
    solution = ts.simulate(scene, (0, 0.1), rtol=1e-12, atol=1e-12)
    begin = np.arcsin(mu * G / 5.0) / 10.0
    assert abs(solution.phases[0][1] - begin) < 1e-14
    speed = 0.5 * np.cos(10.0 * begin) - mu * G * (0.1 - begin)
    np.testing.assert_allclose(solution.velocity("box")[-1], [speed, 0, 0], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("yaw", [0.0, 5e-4, 1e-3])
def test_rows_that_hold_a_box_are_independent_by_far(yaw):
    """A slip along an edge, between two corners of it, is none by a second row but for the yaw."""
    scene, size = ts.Scene(), np.array((0.4, 0.3, 0.2))
    box = scene.add_body(**ts.shapes.box(size, mass=2.0), position=(0, 0, 0.1))
    box.orientation = np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
    for corner in ((-1, -1, -1), (-1, 1, -1), (1, -1, -1), (1, 1, -1)):
        at = {"point_a": size / 2 * corner, "normal_b": Z, "unilateral": True, "kinetic": 0.3}
        scene.add(C.PlaneContact(box, scene.ground, **at))
    scene.add(ts.forces.PointForce(box, point_a=(-0.15, 0, 0.1), force=(0, 0, -30.0)))
    run = begun(scene, 0.0)
    gaps, closed, grips = run.gaps, run.modes.closed, run.modes.grips
    slips = gaps.slopes(0.0, run.q, closed)
    held = [slips[k][j] for k, i in enumerate(closed) for j in range(2) if grips[i][j]]
    rows = np.array([*gaps.normals(0.0, run.q, closed), *held, np.append(np.zeros(3), run.q[3:])])
    assert np.linalg.cond(rows / np.linalg.norm(rows, axis=1)[:, None]) < 20.0
    # With the points where corners are held, which the run remembers
    assert mobility_at(run._scene(), run.q, 0.0, run.filled().packed.system).degrees_of_freedom == 0


def overhanging(aside):
    """Three boxes, each beyond the one below by more than half of its width, `aside` (3,) from the middle; m."""
    scene, size, off, below = ts.Scene(gravity=(0, 0, -G)), np.array((0.2, 0.2, 0.1)), 0.12, None
    for i in range(3):
        box = scene.add_body(**ts.shapes.box(size, density=1000.0), position=(off * i, aside[i], 0.05 + 0.1 * i))
        corners, law = itertools.product((-0.1, 0.1), (-0.1, 0.1)), {"unilateral": True, "kinetic": 0.5}
        for x, y in corners:
            low = {"point_a": (x, y, -0.05), "normal_b": (0, 0, 1)}
            if i == 0:
                scene.add(C.PlaneContact(box, scene.ground, **low, **law))
            elif x < 0.0:
                scene.add(C.PlaneContact(box, below, **low, point_b=(0, 0, 0.05), **law))
            else:
                high = {"point_a": (x, y, 0.05), "point_b": (0, 0, -0.05), "normal_b": (0, 0, -1)}
                scene.add(C.PlaneContact(below, box, **high, **law))
        below = box
    return scene


def test_boxes_that_topple_slip_at_one_corner_first():
    """In line both corners of an edge reach their bounds at once; aside, one before, one after, in proportion."""
    aside, slips = 1e-3 * np.random.default_rng(0).normal(size=3), []
    for share in (0.0, 0.5, 1.0):
        solution = ts.simulate(overhanging(share * aside), (0, 0.163))
        solution.raise_if_failed()
        slips.append(np.array([end for _, end, _ in solution.phases[:-1] if end > 0.15]))
    both, half, whole = slips
    assert half[0] < both[0] - 1e-5
    assert half[1] > both[0] + 1e-5
    np.testing.assert_allclose(whole - both, 2.0 * (half - both), rtol=2e-3)


def gripper(weakens):
    """Two fingers press a box of 1 kg from both sides, with 20 N, which may weaken by so much a second."""
    scene = ts.Scene(gravity=(0, 0, -G))
    box = scene.add_body(**ts.shapes.box((0.1, 0.1, 0.1), mass=1.0), name="box")
    for side, name in (-1, "left"), (1, "right"):
        finger = scene.add_body(0.3, (0.01, 0.01, 0.01), (0.06 * side, 0, 0), name=name)
        scene.add(C.Translational.at(scene.ground, finger, point=finger.position, axis=(1, 0, 0)))
        scene.add(ts.forces.PointForce(finger, force=lambda t, *, side=side: (side * (weakens * t - 20.0), 0.0, 0.0)))
        for k, (y, z) in enumerate(itertools.product((-0.05, 0.05), (-0.05, 0.05))):
            at = {"point_a": (0.05 * side, y, z), "point_b": (-0.01 * side, 0, 0), "normal_b": (-side, 0, 0)}
            scene.add(C.PlaneContact(box, finger, **at, unilateral=True, kinetic=0.4, static=0.5, name=f"{name}{k}"))
    return scene


def test_a_gripper_holds_a_box_by_all_its_points():
    """By those alone whose rows are independent it would turn: which of them carry isn't determined."""
    solution = ts.simulate(gripper(0.0), (0, 100.0), t_eval=[0.0, 50.0, 100.0])
    assert len(solution.phases) == 1
    assert np.abs(solution.position("box")[:, 1:]).max() < 1e-15  # along x nothing holds the whole
    for k, (side, name) in itertools.product(range(4), ((-1, "left"), (1, "right"))):
        np.testing.assert_allclose(solution.reaction(f"{name}{k}")[0], [(-5.0 * side, 0.0, G / 8)] * 3, atol=1e-12)
        assert solution.sticking(f"{name}{k}").all()


def test_a_gripper_that_weakens_lets_a_box_slip_when_all_points_are_at_their_bounds():
    """2 mu F = m g, F = 20 - 10 t."""
    solution = ts.simulate(gripper(10.0), (0, 1.1))
    assert abs(solution.phases[0][1] - (2.0 - G / 10.0)) < 1e-12


def test_a_gripper_that_weakens_drops_a_box_without_a_turn():
    """All eight points carry alike, m z'' = 8 mu N - m g with N = F / 4, F = 20 - 10 t."""
    begin, end = 2.0 - G / 10.0, 1.1
    solution = ts.simulate(gripper(10.0), (0, end), rtol=1e-12, atol=1e-12)
    fall = (16.0 - G) * (end - begin) ** 2 / 2 - 4.0 * (end**3 / 3 - begin**2 * end + 2.0 * begin**3 / 3)
    np.testing.assert_allclose(solution.position("box")[-1], [0, 0, fall], atol=1e-12)
    assert np.abs(solution.angular_velocity("box")).max() < 1e-11
    other = copy.deepcopy(solution)
    for k, (side, name) in itertools.product(range(4), ((-1, "left"), (1, "right"))):
        np.testing.assert_array_equal(other.reaction(f"{name}{k}")[0], solution.reaction(f"{name}{k}")[0])
        load = (20.0 - 10.0 * end) / 4
        np.testing.assert_allclose(solution.reaction(f"{name}{k}")[0][-1], [-side * load, 0, 0.4 * load], atol=1e-9)


def two_slip_at_once(force):
    """What is left at 1/2 of the bounds of two points, 4.905 N each, that share the friction along their line."""
    across = np.array([0.9, 0.1]) * 0.435 * force
    return np.sqrt(4.905**2 / 4 - across**2).sum() - 0.9 * force


def least_power(points, N, at, way):
    """The force at which a motion begins: of all motions the least power of friction 1/2, over that of a unit force."""

    def share(motion):
        v = motion[:2] + motion[2] * np.column_stack([-points[:, 1], points[:, 0]])
        power = (motion[:2] + motion[2] * np.array([-at[1], at[0]])) @ way[:2]
        return 0.5 * (N * np.hypot(*v.T)).sum() / abs(power)

    starts = itertools.product((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (1.0,))
    found = [minimize(share, x, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-15}).fun for x in starts]
    return min(found)


LEGS = np.array([(0.5, 0.3), (-0.5, 0.1), (0.3, -0.3)])
LOADS = 9.81 * np.linalg.solve([[1, 1, 1], *LEGS.T], [1, 0, 0])
PULLS = (
    (((0.5, 0), (-0.5, 0)), (0.5, 0), (0.6, 0.8), lambda: 4.905 / 2 / 0.8),  # one end slips, about the other
    (((0.5, 0), (-0.5, 0)), (0.4, 0), (0.9, 0.435), lambda: brentq(two_slip_at_once, 4.0, 5.0, xtol=1e-14)),
    (LEGS, (0.5, 0.3), (0.3, 0.95), lambda: least_power(LEGS, LOADS, (0.5, 0.3), (0.3, 0.95))),
)  # fmt: skip


@pytest.mark.parametrize(("points", "at", "way", "force"), PULLS, ids=["end", "beside the end", "three legs"])
def test_a_body_that_is_pulled_aside_sticks_as_long_as_friction_can_hold_it(points, at, way, force):
    """Friction in proportion to its bounds would reach one of them sooner: others take over what they can."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(1.0, (0.1, 0.1, 0.1))
    law = {"normal_b": Z, "unilateral": True, "kinetic": 0.5}
    contacts = [scene.add(C.PlaneContact(body, scene.ground, point_a=(*point, 0), **law)) for point in points]
    scene.add(ts.forces.PointForce(body, point_a=(*at, 0), force=lambda t: np.array([*way, 0.0]) * t))
    begin = force()
    solution = ts.simulate(scene, (0, 1.02 * begin))
    np.testing.assert_allclose(solution.phases[0][1], begin, rtol=1e-10)
    resting = solution.t < solution.phases[0][1]
    assert all(solution.sticking(contact)[resting].all() for contact in contacts)
    assert not all(solution.sticking(contact)[~resting][1:].any() for contact in contacts)
    for contact in contacts:
        load, friction = solution.reaction(contact)[0][:, 2], solution.reaction(contact)[0][:, :2]
        assert (np.linalg.norm(friction, axis=1) <= 0.5 * load * (1 + 1e-9)).all()


def test_a_wall_without_friction_braces_a_rod_that_sticks():
    """Pushed at its end, the rod turns about the wall: one end holds half of the force, the other one pulls as much."""
    scene = ts.Scene(gravity=(0, 0, -G))
    rod = scene.add_body(1.0, (0.1, 0.1, 0.1))
    law = {"normal_b": Z, "unilateral": True, "kinetic": 0.5}
    ends = [scene.add(C.PlaneContact(rod, scene.ground, point_a=(x, 0, 0), **law)) for x in (0.5, -0.5)]
    wall = scene.add(C.PlaneContact(rod, scene.ground, normal_b=(0, -1, 0), unilateral=True))
    scene.add(ts.forces.PointForce(rod, point_a=(0.5, 0, 0), force=lambda t: np.array([0.0, t, 0.0])))
    solution = ts.simulate(scene, (0, 5))
    *_, begin = (end for _, end, _ in solution.phases if end < 5)
    assert abs(begin - 4.905) < 1e-9
    resting = solution.t < begin
    np.testing.assert_allclose(solution.q[resting], solution.q[:1].repeat(resting.sum(), axis=0), atol=1e-14)
    force, friction = solution.t[resting], [solution.reaction(end)[0][resting, 1] for end in ends]
    assert (np.abs(friction) <= 2.4525 * (1 + 1e-9)).all()
    balance = friction[0] + friction[1] + solution.reaction(wall)[0][resting, 1] + force
    np.testing.assert_allclose(balance, 0.0, atol=1e-12)
    assert abs(solution.angular_velocity(rod)[-1, 2]) > 1e-3
