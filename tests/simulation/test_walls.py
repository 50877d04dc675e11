"""Walls of bricks in running bond: contacts that depend on each other slide, stick and share their reactions."""

import json

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.simulation.phases import UnitModes

C = ts.constraints
G, L, W, H = 9.81, 0.2, 0.1, 0.1
SHIFT = 0.08  # of every second course
BRICKS = [(course, column) for course in range(3) for column in range(3)]
MASS = 2.0


def wall(mu, floor, gravity=(0, 0, -G), velocity=(0, 0, 0), drop=0.0):
    """Three courses of three bricks; contacts at the corners of the faces that two bricks share."""
    scene, law = ts.Scene(gravity=gravity), {"unilateral": True}
    places = {(course, i): i * L + SHIFT * (course % 2) for course, i in BRICKS}
    bricks = {}
    for course, i in BRICKS:
        place = {"position": (places[course, i], 0, H / 2 + H * course + drop), "velocity": velocity}
        bricks[course, i] = scene.add_body(**ts.shapes.box((L, W, H), mass=MASS), **place, name=f"{course}{i}")
    for (course, i), brick in bricks.items():
        below = [j for j in range(3) if course and abs(places[course, i] - places[course - 1, j]) < 0.99 * L]
        for y in (-W / 2, W / 2):
            for x in () if course else (-L / 2, L / 2):
                point = {"point_a": (x, y, -H / 2), "normal_b": (0, 0, 1), "kinetic": floor}
                scene.add(C.PlaneContact(brick, scene.ground, **point, **law))
            for j in below:
                under, own, other = bricks[course - 1, j], places[course, i], places[course - 1, j]
                for x in max(own, other) - L / 2, min(own, other) + L / 2:
                    if np.isclose(abs(x - own), L / 2):
                        corner = {"point_a": (x - own, y, -H / 2), "point_b": (0, 0, H / 2), "normal_b": (0, 0, 1)}
                        scene.add(C.PlaneContact(brick, under, **corner, **law, kinetic=mu))
                    else:
                        corner = {"point_a": (x - other, y, H / 2), "point_b": (0, 0, -H / 2), "normal_b": (0, 0, -1)}
                        scene.add(C.PlaneContact(under, brick, **corner, **law, kinetic=mu))
    return scene


def moved(solution, k):
    """By how much the bricks have moved (9, 3) at output k."""
    return np.array([np.subtract(*solution.position(f"{c}{i}")[[k, 0]]) for c, i in BRICKS])


def demand_within_cones(solution, scene, load):
    """All contacts push, within their cones; the floor carries a load (3,)."""
    contacts = [each for each in scene.constraints if isinstance(each, C.PlaneContact)]
    p, mu = np.stack([solution.reaction(each)[0] for each in contacts]), [[each.kinetic] for each in contacts]
    size = np.linalg.norm(load)
    assert (np.hypot(p[..., 0], p[..., 1]) <= mu * np.abs(p[..., 2]) + 1e-8 * size).all()
    signs = np.array([[each.normal_b[2]] for each in contacts])
    assert (signs * p[..., 2] >= -1e-8 * size).all()
    floor = [not each.b.dimension for each in contacts]
    np.testing.assert_allclose(p[floor].sum(axis=0), np.tile(load, (solution.t.size, 1)), atol=1e-7 * size)


@pytest.mark.parametrize(("along", "mu"), [(0, 0.5), (0, 0.3), (1, 0.5)])
def test_a_wall_that_slides_as_a_whole_stops_where_one_block_does(along, mu):
    """Also where all contacts are as rough as the floor: they are at their bounds without a slip."""
    floor, v = 0.3, np.eye(3)[along]
    scene = wall(mu, floor, velocity=v)
    demand_within_cones(ts.simulate(scene, (0, 0.2)), scene, 9 * MASS * G * np.array([*(-floor * v[:2]), 1.0]))
    solution = ts.simulate(scene, (0, 0.5)).raise_if_failed()
    assert len(solution.phases) == 2
    np.testing.assert_allclose(solution.phases[0][1], 1.0 / (floor * G), rtol=1e-9)
    np.testing.assert_allclose(moved(solution, -1), np.tile(v / (2.0 * floor * G), (9, 1)), atol=1e-9)
    assert np.abs(solution.qd[-1]).max() == 0.0


@pytest.mark.parametrize("along", [0, 1])
def test_a_wall_slides_down_an_incline_as_one_block_does(along):
    floor, angle = 0.3, 0.6
    a = G * (np.sin(angle) - floor * np.cos(angle))
    down = np.eye(3)[along]
    scene = wall(0.5, floor, gravity=G * np.sin(angle) * down - [0, 0, G * np.cos(angle)])
    solution = ts.simulate(scene, (0, 0.2)).raise_if_failed()
    assert len(solution.phases) == 1
    np.testing.assert_allclose(moved(solution, -1), np.tile(0.5 * a * 0.2**2 * down, (9, 1)), atol=1e-10)
    load = 9 * MASS * G * np.cos(angle)
    demand_within_cones(solution, scene, load * (np.array([0, 0, 1.0]) - floor * down))


def test_a_wall_dropped_flat_comes_to_rest_at_once():
    drop = 0.002
    solution = ts.simulate(wall(0.5, 0.5, drop=drop), (0, 0.1)).raise_if_failed()
    np.testing.assert_allclose(moved(solution, -1), np.tile([0, 0, -drop], (9, 1)), atol=1e-12)
    np.testing.assert_allclose(solution.energy[0] - solution.energy[-1], 9 * MASS * G * drop, rtol=1e-12)


def test_modes_of_a_wall_whose_contacts_share_loads_are_the_same_from_a_file():
    modes = UnitModes(closed=[1], idle=[2], spread={1: (0.1, 0.2, 0.3, 0.0, 1.0), 2: (1.0 / 3.0, 0.0, 0.0, 1e-9, 0.5)})
    assert UnitModes.of(json.loads(json.dumps(modes.saved()))).same(modes)
