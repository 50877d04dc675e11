"""Mechanics with a known answer: the sleeping top, what is conserved, closed forms, reactions."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import tsdyn as ts
from tests.helpers.reference import errors, load
from tests.helpers.scenes import BETWEEN, EPS, PRIMITIVES, build, random_chain, random_pair

C = ts.constraints
GRAVITY = 9.6
LEAST_ORDER = 3.85  # of errors that fall with the fourth power of the step, or faster


def run(scene, end, step=1e-3, **options):
    integrator = ts.integrators.Nystrom4(step=step)
    return ts.simulate(scene, (0.0, end), integrator=integrator, **options).raise_if_failed()


def slope(steps, values):
    return np.polyfit(np.log(steps), np.log(values), 1)[0]


def skew(a):
    return np.cross(np.eye(3), a)  # row i is e_i x a


def turn(axis_rate, t):
    """Rotation by axis_rate t."""
    return expm(skew(axis_rate) * t)


def size(x):
    return 1.0 + np.abs(x).max()


# the sleeping top


@cache
def asleep(name):
    scene, reference = load(name)
    return run(scene, 30.0, 5e-4, t_eval=reference.t), reference


def tilt(A):
    """Angle of a body's axis from the vertical; A (..., 3, 3)."""
    return np.arctan2(np.hypot(A[..., 0, 2], A[..., 1, 2]), A[..., 2, 2])


@pytest.mark.parametrize(("time", "tolerance"), [(10.0, 2e-12), (20.0, 1e-9), (30.0, 1e-6)])
def test_sleeping_top_wakes_as_it_should(time, tolerance):
    solution, reference = asleep("sleeping_top_unstable")
    (row,) = np.flatnonzero(solution.t == time)
    (body,) = solution.scene.bodies
    difference = tilt(solution.rotation(body)[row]) - tilt(reference.A[row, 0])
    assert abs(difference) < tolerance
    position, attitude = errors(solution, reference)
    assert np.abs(position[row]).max() < tolerance
    assert np.abs(attitude[row, 0, :, 2]).max() < tolerance  # where the axis points, not only how far it leans
    assert tilt(reference.A[row, 0]) > 1e-10  # it has woken


def test_sleeping_top_turns_as_it_should():
    """The whole rotation matrix: the turn about the axis has the truncation error of 300 rad at this step."""
    solution, reference = asleep("sleeping_top_unstable")
    _, attitude = errors(solution, reference)
    assert np.abs(attitude).max() < 2e-8
    scene, _ = load("sleeping_top_unstable")
    finer = run(scene, 30.0, 2.5e-4, t_eval=reference.t)
    gain = np.abs(attitude[-1]).max() / np.abs(errors(finer, reference)[1][-1]).max()
    assert np.log2(gain) > LEAST_ORDER


def test_fast_top_sleeps_on():
    """Above sqrt(115.2) rad/s upright is stable: the tilt stays where 1e-12 rad/s put it."""
    solution, reference = asleep("sleeping_top_stable")
    (body,) = solution.scene.bodies
    assert tilt(solution.rotation(body)).max() < 1e-11
    assert np.abs(tilt(solution.rotation(body)) - tilt(reference.A[:, 0])).max() < 1e-16
    assert np.abs(errors(solution, reference)[0]).max() < 2e-12


# what is conserved


STEPS = tuple(1 / (100 * 2**j) for j in range(7))


@cache
def sliding(step):
    """The sliding top with a push along the plane."""
    scene, _ = load("sliding_top")
    (body,) = scene.bodies
    body.velocity = (0.3, -0.2, 0.0)
    return run(scene, 10.0, step)


def test_energy_error_falls_with_the_fourth_power_of_the_step():
    energies = [sliding(h).energy for h in STEPS]
    worst = np.array([np.abs(e / e[0] - 1.0).max() for e in energies])
    assert slope(STEPS, worst) > LEAST_ORDER
    assert worst[-1] < 1e-10


def test_energy_at_rounding():
    """Steps so small that truncation is below rounding: what is left is eps a step, and no drift."""
    scene, reference = load("sliding_top")
    solution = run(scene, 1.0, 1 / 16384, t_eval=reference.until(1.0).t)
    assert abs(solution.energy[-1] / solution.energy[0] - 1.0) < EPS * np.sqrt(solution.stats.steps)


@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum", "two_body_pendulum_spatial"])
def test_energy_of_the_references(name):
    scene, reference = load(name)
    solution = run(scene, 10.0, 2.5e-4, t_eval=reference.t)
    assert np.abs(solution.energy / reference.energy - 1.0).max() < 1e-9
    np.testing.assert_array_equal(solution.energy, solution.kinetic_energy + solution.potential_energy)


@pytest.mark.parametrize("step", STEPS)
def test_linear_momentum_along_the_plane_stays(step):
    """It is linear in the velocities and nothing pushes along the plane: rounding only."""
    momentum = sliding(step).linear_momentum[:, :2]
    drift = np.abs(momentum - momentum[0]).max()
    assert drift < EPS * np.sqrt(10.0 / step) * 30.0 * size(sliding(step).qd)


def test_angular_momentum_about_the_vertical_stays_to_the_order():
    """Of the pushed top, about the point under its centroid, which moves along with it."""
    worst = []
    for step in STEPS:
        solution = sliding(step)
        (body,) = solution.scene.bodies
        about_origin, r, v = solution.angular_momentum[:, 2], solution.position(body), solution.velocity(body)
        spin = about_origin - 30.0 * (r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0])
        worst.append(np.abs(spin / spin[0] - 1.0).max())
    assert slope(STEPS, np.array(worst)) > LEAST_ORDER
    assert worst[-1] < 1e-10


# free bodies, no constraint added


def free_top(rng):
    """A free axisymmetric body in general rotation, and its closed form."""
    A, w, (I, I3) = expm(skew(rng.normal(size=3))), np.array([1.5, -0.7, 4.0]), (2.0, 0.8)
    scene = ts.Scene(gravity=(0.1, -0.2, -GRAVITY))
    r, v = rng.normal(size=3), rng.normal(size=3)
    body = scene.add_body(3.0, (I, I, I3), r, Rotation.from_matrix(A), v, w)
    L = A @ ([I, I, I3] * w)

    def exact(t):
        """Precession L / I about the fixed L, and a turn of (1 - I3 / I) w3 about the body's axis."""
        return r + v * t + scene.gravity * t**2 / 2, turn(L / I, t) @ A @ turn((0, 0, (1 - I3 / I) * w[2]), t)

    return scene, body, L, exact


def test_free_axisymmetric_body_precesses_as_in_closed_form(rng):
    scene, body, L, exact = free_top(rng)
    steps, times = 1 / (50 * 2.0 ** np.arange(5)), np.arange(6.0)
    worst = []
    for step in steps:
        solution = run(scene, 5.0, step, t_eval=times)
        r, A = (np.array(x) for x in zip(*map(exact, times), strict=True))
        worst.append(np.abs(solution.rotation(body) - A).max())
        assert np.abs(solution.position(body) - r).max() < EPS * np.sqrt(5.0 / step) * size(r) * 10
    assert abs(slope(steps, np.array(worst)) - 4.0) < 0.15
    spin = solution.angular_momentum - 3.0 * np.cross(solution.position(body), solution.velocity(body))
    assert np.abs(spin - L).max() < 1e-8


def test_free_body_turning_about_a_principal_axis_keeps_to_it():
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1.0, 2.0, 2.5), angular_velocity=(0.0, 0.0, 3.0))
    solution = run(scene, 10.0)
    assert solution.multipliers.shape[1] == 1
    assert np.abs(solution.angular_velocity(body) - [0.0, 0.0, 3.0]).max() < 1e-9
    np.testing.assert_allclose(solution.angular_velocity(body)[:, :2], 0.0, atol=10 * EPS)


def test_projectile():
    """A point mass without any row: the method is exact for a parabola."""
    scene = ts.Scene(gravity=(0.0, 0.5, -9.81))
    r, v = np.array([1.0, 2.0, 3.0]), np.array([4.0, -5.0, 6.0])
    ball = scene.add_point_mass(0.7, position=r, velocity=v)
    solution = run(scene, 3.0, 0.01, t_eval=np.linspace(0.0, 3.0, 37))
    t = solution.t[:, None]
    tolerance = EPS * 300 * size(solution.q)
    np.testing.assert_allclose(solution.position(ball), r + v * t + scene.gravity * t**2 / 2, atol=tolerance)
    np.testing.assert_allclose(solution.velocity(ball), v + scene.gravity * t, atol=tolerance)
    np.testing.assert_allclose(solution.acceleration(ball), np.tile(scene.gravity, (37, 1)), atol=10 * EPS)
    assert solution.multipliers.shape == (37, 0)


# the physical pendulum


LENGTH, MASS, INERTIA = 0.8, 2.0, (0.3, 0.25, 0.1)


def pendulum(angle, joint="Spherical"):
    """A rigid pendulum in the plane y = 0, at rest at an angle from the vertical."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    body = scene.add_body(
        MASS,
        INERTIA,
        position=(LENGTH * np.sin(angle), 0.0, -LENGTH * np.cos(angle)),
        orientation=(np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0),
    )
    hinge = scene.add(C.Spherical(body, scene.ground, point_a=(0.0, 0.0, LENGTH)))
    if joint == "hinge":
        for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
            scene.add(C.Dot1(body, scene.ground, axis_a=(0.0, 1.0, 0.0), axis_b=axis))
    return scene, body, hinge


@pytest.mark.parametrize("joint", ["Spherical", "hinge"])
@pytest.mark.parametrize("angle", [0.3, 1.5, 2.8])
def test_physical_pendulum(angle, joint):
    """Its energy; its period, 4 K / omega; and that it comes to rest where it started."""
    omega = np.sqrt(MASS * GRAVITY * LENGTH / (INERTIA[1] + MASS * LENGTH**2))
    period = 4 * ellipk(np.sin(angle / 2) ** 2) / omega
    scene, body, _ = pendulum(angle, joint)
    steps = period / np.array([400, 800, 1600])
    drift, closure = [], []
    for step in steps:
        solution = run(scene, period, step)
        drift.append(np.abs(solution.energy - solution.energy[0]).max())
        closure.append(max(np.abs(solution.position(body)[-1] - body.position).max(), np.abs(solution.qd[-1]).max()))
        assert np.abs(solution.position(body)[:, 1]).max() < EPS * len(solution.t)
    assert slope(steps, drift) > LEAST_ORDER
    assert slope(steps, closure) > LEAST_ORDER
    assert closure[-1] < 1e-7
    np.testing.assert_allclose(solution.energy[0], -MASS * GRAVITY * LENGTH * np.cos(angle), rtol=10 * EPS)


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


# reactions


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
    assert abs(gained - work) < 1e-8 * size(solution.energy)
