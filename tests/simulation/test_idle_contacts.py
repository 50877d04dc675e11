"""Contacts whose rows depend on those of others: these hold them, while they do."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tsdyn.simulation.tolerances import PENETRATION

C = ts.constraints
SIZE = np.array([0.2, 0.1, 0.1])


def bricks(across, kinetic=0.5):
    """One that tips over its left edge, and one that lies on a ledge and on it; across: places along the right edge."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    low, up = (
        scene.add_body(**ts.shapes.box(SIZE, density=1000.0), position=(0, 0, z), name=name)
        for name, z in (("low", 0.05), ("up", 0.15))
    )
    up.position = (-0.1, 0, 0.15)
    law = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": kinetic}
    for y in (-0.05, 0.05):
        scene.add(C.PlaneContact(low, scene.ground, point_a=(-0.1, y, -0.05), name=f"low {y}", **law))
        ledge = {"point_a": (-0.1, y, -0.05), "point_b": (0, 0, 0.1), "name": f"ledge {y}"}
        scene.add(C.PlaneContact(up, scene.ground, **ledge, **law))
    for y in across:
        edge = {"point_a": (0.1, y, -0.05), "point_b": (0, 0, 0.05), "name": f"edge {y}"}
        scene.add(C.PlaneContact(up, low, **edge, **law))
    return scene


def gap(solution, y):
    """Gap (k,) of the contact between the bricks at y."""
    above = solution.position("up", point=(0.1, y, -0.05)) - solution.position("low", point=(0, 0, 0.05))
    normal = solution.position("low", point=(0, 0, 1)) - solution.position("low")
    return (above * normal).sum(axis=1)


@pytest.mark.parametrize("kinetic", [0.5, 0.0])
def test_a_contact_that_others_no_longer_hold_ends_the_run_before_it_penetrates(kinetic):
    """Once the lower brick has tipped, the two ends of the edge between the bricks no longer depend on each other."""
    solution = ts.simulate(bricks((-0.05, 0.05), kinetic), (0, 0.1))
    assert solution.status is ts.Status.CONTACT_FAILED
    (fallen,) = [y for y in (-0.05, 0.05) if f"no longer hold edge {y}" in solution.message]
    length = np.hypot(0.1, 0.15)  # of the scene: to the farther centre
    np.testing.assert_allclose(gap(solution, fallen)[-1], -PENETRATION * length, rtol=1e-5)
    assert gap(solution, fallen).argmin() == solution.t.size - 1
    np.testing.assert_allclose(gap(solution, -fallen), 0.0, atol=1e-14)


@pytest.mark.parametrize("kinetic", [0.5, 0.0])
def test_an_edge_with_one_contact_at_its_middle_leaves_bricks_in_their_plane(kinetic):
    solution = ts.simulate(bricks((0.0,), kinetic), (0, 0.05))
    assert solution.success
    np.testing.assert_allclose(gap(solution, 0.0), 0.0, atol=1e-14)
    for name in "low", "up":
        np.testing.assert_allclose(solution.position(name)[:, 1], 0.0, atol=1e-12)
        np.testing.assert_allclose(solution.angular_velocity(name)[:, [0, 2]], 0.0, atol=1e-8)
    assert solution.angular_velocity("low")[-1, 1] > 1.0  # it tips


def plate(speed, kinetic):
    """A plate on its corners, and a mass that slides along it, at first where the edge x = 1 m carries both alone."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    plate = scene.add_body(1.0, (0.1, 0.4, 0.5), name="plate")
    slider = scene.add_body(1.0, (1e-3, 1e-3, 1e-3), position=(2, 0, 0), velocity=(speed, 0, 0), name="slider")
    scene.add(C.Translational.at(plate, slider, point=(0, 0, 0), axis=(1, 0, 0)))
    law = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": kinetic}
    for x in (1, -1):
        for y in (0.5, -0.5):
            scene.add(C.PlaneContact(plate, scene.ground, point_a=(x, y, 0), name=f"{x} {y}", **law))
    return scene


def tipping(t, x):
    """Angle and place of the mass on a plate that turns about its edge, with the rates; place from the edge, m."""
    angle, s, rate, v = x
    inertia = 0.4 + 1e-3 + 1.0 + s * s
    turn = (9.81 * (s - 1.0) * np.cos(angle) - 2.0 * s * v * rate) / inertia
    return rate, v, turn, s * rate**2 + 9.81 * np.sin(angle)


@pytest.mark.parametrize("kinetic", [0.5, 0.0])
@pytest.mark.parametrize("start", [0.0, 100.0])
@pytest.mark.parametrize("speed", [1.0, 50.0])
def test_corners_whose_reactions_begin_at_zero_and_fall_open_at_once(start, kinetic, speed):
    """The friction at the edge holds it: the horizontal loads are those of the mass alone."""
    end = start + 0.2 / speed
    solution = ts.simulate(plate(speed, kinetic), (start, end), rtol=1e-12, atol=1e-12)
    assert solution.phases == [(start, end, ("1 0.5", "1 -0.5"))]
    if kinetic:
        given = solve_ivp(tipping, (start, end), (0.0, 1.0, 0.0, speed), rtol=1e-12, atol=1e-14, method="DOP853")
        normal = solution.position("plate", point=(0, 0, 1)) - solution.position("plate")
        np.testing.assert_allclose(normal[-1, 0], np.sin(given.y[0, -1]), rtol=1e-9)


@pytest.mark.parametrize("kinetic", [0.5, 0.0])
def test_corners_whose_reactions_begin_at_zero_and_rise_stay(kinetic):
    solution = ts.simulate(plate(-1.0, kinetic), (0, 0.5))
    assert solution.phases == [(0.0, 0.5, ("1 0.5", "1 -0.5", "-1 0.5", "-1 -0.5"))]
    loads = [solution.reaction(f"-1 {y}")[0][:, 2] for y in (0.5, -0.5)]
    np.testing.assert_allclose(sum(loads), 9.81 / 2 * solution.t, rtol=1e-9, atol=1e-9)
