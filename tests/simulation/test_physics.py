"""Mechanics with a known answer: the sleeping top, free bodies, a pendulum, what is conserved."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import tsdyn as ts
from tests.helpers.pendulums import GRAVITY, INERTIA, LENGTH, MASS, pendulum, run, size, skew, turn
from tests.helpers.reference import errors, load
from tests.helpers.tolerances import CLOSE, EPS, FAIR, FINE, HELD, NEAR, TIGHT

C = ts.constraints
LEAST_ORDER = 3.85  # of errors that fall with the fourth power of the step, or faster


def slope(steps, values):
    return np.polyfit(np.log(steps), np.log(values), 1)[0]


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
    assert np.abs(attitude).max() < 2 * NEAR
    scene, _ = load("sleeping_top_unstable")
    finer = run(scene, 30.0, 2.5e-4, t_eval=reference.t)
    gain = np.abs(attitude[-1]).max() / np.abs(errors(finer, reference)[1][-1]).max()
    assert np.log2(gain) > LEAST_ORDER


def test_fast_top_sleeps_on():
    """Above sqrt(115.2) rad/s upright is stable: the tilt stays where 1e-12 rad/s put it."""
    solution, reference = asleep("sleeping_top_stable")
    (body,) = solution.scene.bodies
    assert tilt(solution.rotation(body)).max() < TIGHT
    assert np.abs(tilt(solution.rotation(body)) - tilt(reference.A[:, 0])).max() < 1e-16
    assert np.abs(errors(solution, reference)[0]).max() < 2 * HELD


# what is conserved


STEPS = tuple(1 / (100 * 2**j) for j in range(7))


@cache
def sliding(step):
    """The sliding top with a push along the plane."""
    scene, _ = load("sliding_top")
    (body,) = scene.bodies
    body.velocity = (0.3, -0.2, 0.0)
    return run(scene, 3.0, step)


def test_energy_error_falls_with_the_fourth_power_of_the_step():
    energies = [sliding(h).energy for h in STEPS]
    worst = np.array([np.abs(e / e[0] - 1.0).max() for e in energies])
    assert slope(STEPS, worst) > LEAST_ORDER
    assert worst[-1] < FINE


def test_energy_at_rounding():
    """Steps so small that truncation is below rounding: what is left is eps a step, and no drift."""
    scene, reference = load("sliding_top")
    solution = run(scene, 1.0, 1 / 16384, t_eval=reference.until(1.0).t)
    assert abs(solution.energy[-1] / solution.energy[0] - 1.0) < EPS * np.sqrt(solution.stats.steps)


@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum", "two_body_pendulum_spatial"])
def test_energy_of_the_references(name):
    scene, reference = load(name)
    solution = run(scene, 10.0, 2.5e-4, t_eval=reference.t)
    assert np.abs(solution.energy / reference.energy - 1.0).max() < CLOSE
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
    assert worst[-1] < FINE


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
    assert np.abs(spin - L).max() < NEAR


def test_free_body_turning_about_a_principal_axis_keeps_to_it():
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1.0, 2.0, 2.5), angular_velocity=(0.0, 0.0, 3.0))
    solution = run(scene, 10.0)
    assert solution.multipliers.shape[1] == 1
    assert np.abs(solution.angular_velocity(body) - [0.0, 0.0, 3.0]).max() < CLOSE
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
    assert closure[-1] < FAIR
    np.testing.assert_allclose(solution.energy[0], -MASS * GRAVITY * LENGTH * np.cos(angle), rtol=10 * EPS)
