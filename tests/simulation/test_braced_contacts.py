"""Contacts with friction that brace each other: reactions that aren't unique, redundant rows, none without a load."""

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints
G = 9.81


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("pull", [-1.0, 0.1])
def test_a_ball_that_braces_itself_between_floor_and_wall_rests(order, pull):
    """A torque presses it to the wall, which it would leave by gravity alone: for any friction a of the floor.

    Floor (-a, 7 + a), wall (a - pull, 2 - a).
    """
    scene, mu = ts.Scene(gravity=(pull, 0, -9)), 0.3
    ball = scene.add_body(**ts.shapes.sphere(0.1, mass=1.0), position=(0.1, 0, 0.1))
    for name, normal in (("floor", (0, 0, 1)), ("wall", (1, 0, 0)))[::order]:
        law = {"radius_a": 0.1, "normal_b": normal, "kinetic": mu, "name": name}
        scene.add(C.SphereContact(ball, scene.ground, **law))
    scene.add(ts.forces.Torque(ball, torque=(0, -0.2, 0)))
    solution = ts.simulate(scene, (0, 1)).raise_if_failed()
    np.testing.assert_array_equal(solution.position(ball), np.tile([0.1, 0, 0.1], (solution.t.size, 1)))
    floor, wall = (solution.reaction(name)[0] for name in ("floor", "wall"))
    a = -floor[:, 0]
    zero = np.zeros_like(a)
    np.testing.assert_allclose(floor, np.column_stack([-a, zero, 7.0 + a]), atol=1e-12)
    np.testing.assert_allclose(wall, np.column_stack([a - pull, zero, 2.0 - a]), atol=1e-12)
    for N, T in ((floor[:, 2], floor[:, 0]), (wall[:, 0], wall[:, 2])):
        assert (N > 0.0).all()
        assert (np.abs(T) <= mu * N).all()


def test_a_ball_that_touches_a_wall_without_a_load_falls_freely():
    """What neither pushes nor opens has no friction: the ball falls by g t^2 / 2, and doesn't turn."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_body(**ts.shapes.sphere(0.1, mass=1.0), position=(0.1, 0, 0))
    scene.add(C.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=(1, 0, 0), kinetic=0.3, name="wall"))
    solution = ts.simulate(scene, (0, 1)).raise_if_failed()
    np.testing.assert_allclose(solution.position(ball)[:, 2], -0.5 * G * solution.t**2, atol=1e-12 * G)
    np.testing.assert_allclose(solution.angular_velocity(ball), 0.0, atol=1e-12)
    np.testing.assert_allclose(solution.reaction("wall")[0], 0.0, atol=1e-12)


def test_a_ball_held_in_a_corner_is_no_singular_configuration_for_another_that_rolls():
    """Floor and two walls hold it by nine rows, three of which are redundant, wherever the other ball is."""
    mu, scene = 0.9, ts.Scene(gravity=(-3, -2, -G))
    held, rolls = (scene.add_body(**ts.shapes.sphere(0.1, mass=1.0), position=(x, 0.1, 0.1)) for x in (0.1, 5.0))
    law = {"radius_a": 0.1, "kinetic": mu}
    for normal in ((0, 0, 1), (1, 0, 0), (0, 1, 0)):
        scene.add(C.SphereContact(held, scene.ground, normal_b=normal, **law))
    scene.add(C.SphereContact(rolls, scene.ground, normal_b=(0, 0, 1), **law))
    solution = ts.simulate(scene, (0, 1)).raise_if_failed()
    np.testing.assert_allclose(solution.position(held), 0.1, atol=1e-15)
    path = np.array([5.0, 0.1, 0.1]) - 5 / 14 * np.outer(solution.t**2, (3, 2, 0))
    np.testing.assert_allclose(solution.position(rolls), path, atol=1e-11)
