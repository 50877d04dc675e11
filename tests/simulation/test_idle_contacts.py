"""Contacts whose rows depend on those of others: these hold them, while they do."""

import numpy as np
import pytest

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
