"""Reactions: closed forms, weights at rest, Newton and Euler's balance, and the power of driven constraints."""

import numpy as np
import pytest
from scipy.integrate import simpson

import tsdyn as ts
from tests.helpers.pendulums import GRAVITY, INERTIA, LENGTH, MASS, pendulum, run, size
from tests.helpers.scenes import BETWEEN, PRIMITIVES, build, random_chain, random_pair
from tests.helpers.tolerances import EPS, NEAR

C = ts.constraints


def test_pendulum_reaction_against_its_formula():
    """Along the pendulum m (g cos a + L ad^2), across it -m g sin a (1 - m L^2 / (I + m L^2)), in closed form of a."""
    scene, body, hinge = pendulum(2.0)
    solution = run(scene, 3.0)
    force, torque = solution.reaction(hinge)
    axis = solution.rotation(body)[:, :, 2]  # from the centroid to the joint
    angle = np.unwrap(np.arctan2(-axis[:, 0], axis[:, 2]))
    rate = -solution.angular_velocity(body)[:, 1]
    whole = INERTIA[1] + MASS * LENGTH**2
    along = MASS * (GRAVITY * np.cos(angle) + LENGTH * rate**2)
    across = MASS * GRAVITY * np.sin(angle) * INERTIA[1] / whole
    tangent = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=1)
    expected = along[:, None] * axis + across[:, None] * tangent
    tolerance = 1000 * EPS * size(expected)
    np.testing.assert_allclose(force, expected, atol=tolerance)
    np.testing.assert_allclose(torque, 0.0, atol=tolerance)


def at_rest(kind, ground_first):
    """A 2 kg body that one constraint keeps from falling, at rest; the expected multipliers for body first."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    weight = 2.0 * GRAVITY
    body = scene.add_body(2.0, (0.3, 0.2, 0.1), position=(0.5, -0.2, 1.0))
    a, b = (scene.ground, body) if ground_first else (body, scene.ground)
    below, above = (0.0, 0.0, 0.0), (0.5, -0.2, 1.7)  # on the body; on the ground, over it
    point = {"point_a": above, "point_b": below} if ground_first else {"point_a": below, "point_b": above}
    up = (0.0, 0.0, 1.0)
    sign = -1.0 if ground_first else 1.0
    if kind == "Spherical":
        places = {k: (0.0, 0.0, 0.0) if v == below else (0.5, -0.2, 1.0) for k, v in point.items()}
        return scene, body, C.Spherical(a, b, **places), [0.0, 0.0, -sign * weight]
    if kind == "Distance":  # Phi_r = d / L0, d = x_a - x_b: the body is below
        return scene, body, C.Distance(a, b, **point), [weight]
    if kind == "PlaneContact":
        places = {k: (0.0, 0.0, 0.0) if v == below else (0.5, -0.2, 1.0) for k, v in point.items()}
        return scene, body, C.PlaneContact(a, b, **places, normal_b=up), [-sign * weight]
    return scene, body, C.Dot2(a, b, axis_a=up, **point, value=sign * 0.7), [sign * weight]


@pytest.mark.parametrize("kind", ["Spherical", "Distance", "PlaneContact", "Dot2"])
@pytest.mark.parametrize("ground_first", [False, True], ids=["body first", "ground first"])
def test_reaction_at_rest_is_the_weight(kind, ground_first):
    scene, body, constraint, multipliers = at_rest(kind, ground_first)
    scene.add(constraint)
    solution = run(scene, 0.1)
    force, torque = solution.reaction(constraint)
    tolerance = 100 * EPS * 2.0 * GRAVITY
    np.testing.assert_allclose(force, np.tile([0.0, 0.0, 2.0 * GRAVITY], (len(solution.t), 1)), atol=tolerance)
    np.testing.assert_allclose(torque, 0.0, atol=tolerance)
    rows = len(multipliers)
    np.testing.assert_allclose(solution.multipliers[:, :rows], np.tile(multipliers, (101, 1)), atol=tolerance)
    # A(p) a is of degree 2 in p, so a row on it stretches p too; the normalisation holds against that
    stretch = -2 * 0.7 * multipliers[0] if (kind, ground_first) == ("Dot2", False) else 0.0
    np.testing.assert_allclose(solution.multipliers[:, rows:], stretch, atol=tolerance)
    np.testing.assert_allclose(solution.position(body), np.tile(body.position, (101, 1)), atol=10 * EPS)


def test_bodies_of_another_scene_are_said_to_be():
    (scene, body, constraint, _), (other, stranger, _, _) = at_rest("Distance", False), at_rest("Distance", False)
    scene.add(constraint)
    solution = run(scene, 0.1)
    unlike = other.add_point_mass(1.0, name="unlike")
    assert stranger.name == body.name
    for ask in (solution.position, lambda body: solution.reaction(constraint, on=body)):
        with pytest.raises(ts.InvalidBody, match=f"another scene. The name '{body.name}' stands for the body here"):
            ask(stranger)
        with pytest.raises(ts.InvalidBody, match=r"it belongs to another scene\.$"):
            ask(unlike)
    loose = scene.add_point_mass(1.0, position=(3, 3, 3), name="loose")  # after the run
    with pytest.raises(ts.InvalidBody, match=r"not a body of this scene\.$"):
        solution.position(loose)


def test_reaction_torque_of_a_cantilever():
    """A beam held at its end: the joint carries the weight and the moment m g L; Dot1 rows give pure torques."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    beam = scene.add_body(2.0, (0.1, 0.3, 0.3), position=(0.7, 0.0, 0.0))
    pin = scene.add(C.Spherical(beam, scene.ground, point_a=(-0.7, 0.0, 0.0)))
    x, y, z = np.eye(3)
    locks = [scene.add(C.Dot1(beam, scene.ground, axis_a=a, axis_b=b)) for a, b in ((x, z), (x, y), (y, z))]
    solution = run(scene, 0.1)
    tolerance = 1000 * EPS * 2.0 * GRAVITY
    force, torque = solution.reaction(pin)
    np.testing.assert_allclose(force, np.tile([0.0, 0.0, 2.0 * GRAVITY], (101, 1)), atol=tolerance)
    np.testing.assert_allclose(torque, 0.0, atol=tolerance)
    total = sum(solution.reaction(lock)[1] for lock in locks)
    np.testing.assert_allclose(total, np.tile([0.0, -0.7 * 2.0 * GRAVITY, 0.0], (101, 1)), atol=tolerance)
    for lock in locks:
        np.testing.assert_allclose(solution.reaction(lock)[0], 0.0, atol=tolerance)


def held(scene, definition, solution):
    """Newton and Euler for every body, (k, 3) each: what is left over when all reactions act on it."""
    bodies = [scene.ground, *scene.bodies]
    forces = {b: np.array([0.0, 0.0, 0.0]) + b.mass * scene.gravity for b in scene.bodies}
    torques = {b: np.zeros(3) for b in scene.bodies}  # about the centroid, ground frame
    for constraint, (_, i, j, given) in zip(scene.constraints, definition["constraints"], strict=False):
        a, b = bodies[i], bodies[j]
        on, other = (b, a) if a is scene.ground else (a, b)
        force, torque = solution.reaction(constraint)
        point = given.get("point_b" if on is b else "point_a", np.zeros(3))
        x = solution.position(on) + solution.rotation(on) @ point
        for body, sign in ((on, 1.0), (other, -1.0)):  # the other body feels the opposite at the same place
            if body is not scene.ground:
                forces[body] = forces[body] + sign * force
                torques[body] = torques[body] + sign * (torque + np.cross(x - solution.position(body), force))
    for body in scene.bodies:
        A, w, wd = solution.rotation(body), solution.angular_velocity(body), solution.angular_acceleration(body)
        momentum = w @ body.inertia
        rate = wd @ body.inertia + np.cross(w, momentum)
        yield forces[body], body.mass * solution.acceleration(body), torques[body], np.einsum("kij,kj->ki", A, rate)


def check_newton_euler(definition, end=0.5):
    scene = build(definition)
    scene.assemble()
    solution = run(scene, end, 2e-3)
    for force, mass_acceleration, torque, spin_rate in held(scene, definition, solution):
        tolerance = 5000 * EPS * max(map(size, (force, torque, mass_acceleration, spin_rate, *solution.qdd)))
        np.testing.assert_allclose(mass_acceleration, np.broadcast_to(force, mass_acceleration.shape), atol=tolerance)
        np.testing.assert_allclose(spin_rate, np.broadcast_to(torque, spin_rate.shape), atol=tolerance)


@pytest.mark.slow_but("*body to body*")
@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("between", BETWEEN)
def test_newton_euler_balance_of_a_pair(name, between, rng):
    check_newton_euler(random_pair(rng, name, between))


def test_newton_euler_balance_of_a_chain(rng):
    check_newton_euler(random_chain(rng, 5))


def test_energy_comes_from_the_driven_constraint(rng):
    """Power = force along the rod times the rate of its length."""
    definition = random_pair(rng, "Distance, driven", "body to ground")
    scene = build(definition)
    scene.assemble()
    solution = run(scene, 1.0, 1e-3)
    constraint = scene.constraints[0]
    length, rate, _ = PRIMITIVES["Distance, driven"][2]["length"]
    force, _ = solution.reaction(constraint)
    body, given = scene.bodies[0], definition["constraints"][0][3]
    d = solution.position(body) + solution.rotation(body) @ given["point_a"] - given["point_b"]
    power = (force * d).sum(axis=1) / length(solution.t) * rate(solution.t)
    work = simpson(power, x=solution.t)  # of order 4 as well
    gained = solution.energy[-1] - solution.energy[0]
    assert abs(gained) > 0.1
    assert abs(gained - work) < NEAR * size(solution.energy)
