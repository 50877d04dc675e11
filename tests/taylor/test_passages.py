"""Taylor runs that pass places where a law is not analytic: zero lengths, kinks, fast passages nearby."""

import math

import numpy as np
import pytest

import tsdyn as ts
from examples import stewart_platform
from tests.helpers.tolerances import FAIR
from tsdyn.plugins import inverse_root, product, square

F, I, M = ts.forces, ts.integrators, ts.motions
K, L0, START = 30.0, 0.5, np.array((1.0, 0.3, 0.2))
METHODS = [None, I.Taylor(1e-8), I.Taylor(1e-11), I.Taylor(1e-13), I.Taylor()]


def flight(miss=0.0, damping=0.0, **start):
    """A mass that is released towards the anchor of its spring, and misses it by about `miss`."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, position=START, velocity=miss * np.array((0.0, -2.0, 3.0)), name="mass")
    scene.add(F.Spring(scene.ground, mass, stiffness=K, damping=damping, free_length=L0, name="spring"))
    return scene


def along(t):
    """Distance from the anchor of a mass released at |START|, until it is at rest on the other side, by hand."""
    w, far = math.sqrt(K), float(np.linalg.norm(START))
    first = math.acos(-L0 / (far - L0)) / w  # x = L0 + (far - L0) cos w t, until x = 0
    if t < first:
        return L0 + (far - L0) * math.cos(w * t)
    rate = w * (far - L0) * math.sin(w * first)
    return -L0 + L0 * math.cos(w * (t - first)) - rate / w * math.sin(w * (t - first))


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_mass_flies_through_the_anchor_of_its_spring(method):
    solution = ts.simulate(flight(), (0, 1.0), integrator=method, dense_output=True)
    assert solution.method.startswith("Taylor")
    t = np.linspace(0.0, 1.0, 41)
    expected = np.outer([along(s) for s in t], START / np.linalg.norm(START))
    np.testing.assert_allclose(solution.at(t).q, expected, atol=FAIR)
    assert np.ptp(solution.energy) < FAIR


def test_a_run_that_comes_to_rest_at_the_anchor_names_the_spring():
    """A constant pull towards the anchor, and a damper: the mass crosses it ever more often."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, (0.3, 0.1, 0))
    scene.add(F.Spring(mass, scene.ground, actuator=5.0, damping=20.0, stiffness=10.0, free_length=0.0, name="pull"))
    scene.add(F.Spring(mass, scene.ground, point_b=(3, 1, 0), stiffness=1.0, free_length=math.sqrt(10), name="far"))
    message = ts.simulate(scene, (0, 5), max_steps=30000).message
    assert "comes to rest where the law of 'pull' changes at once" in message
    mass.position = (0.3, 0.0, 0.1)
    assert "at once" not in ts.simulate(scene, (0, 5), max_steps=3).message


@pytest.mark.parametrize("miss", [1e-12, 1e-9, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_mass_passes_close_by_the_anchor(miss, method):
    scene = flight(miss)
    expected = ts.simulate(scene, (0, 1.0), integrator=I.DOP853(rtol=1e-13, atol=1e-13)).state.q
    solution = ts.simulate(scene, (0, 1.0), integrator=method)
    np.testing.assert_allclose(solution.state.q, expected, atol=FAIR)
    assert np.ptp(solution.energy) < FAIR


def test_a_run_starts_at_the_anchor():
    """Away from it at 1 m/s: l0 + (v / w) sin(w t) - l0 cos(w t)."""
    scene = flight()
    scene.bodies[0].position, scene.bodies[0].velocity = (0, 0, 0), (1, 0, 0)
    w = math.sqrt(K)
    expected = L0 + math.sin(0.4 * w) / w - L0 * math.cos(0.4 * w)
    for method in (*METHODS, I.DOP853(), I.Radau()):
        x = ts.simulate(scene, (0, 0.4), integrator=method).state.q[0]
        assert x == pytest.approx(expected, abs=FAIR)


@pytest.mark.slow
def test_cases_in_lanes_pass_the_anchor():
    scene, k = flight(1e-5), np.linspace(5.0, 60.0, 9)
    found = ts.ensemble(scene, {"spring.stiffness": k}, (0, 1.0), lanes=4).q
    for stiffness, q in zip(k, found, strict=True):
        one = scene.with_parameters({"spring.stiffness": stiffness})
        expected = ts.simulate(one, (0, 1.0), integrator=I.DOP853(rtol=1e-12, atol=1e-12)).state.q
        np.testing.assert_allclose(q, expected, atol=FAIR)


def test_a_pendulum_passes_the_anchor_of_a_spring():
    scene = ts.Scene()
    arm = scene.add_body(0.7, (0.1, 0.12, 0.15), (1, 0, 0))
    scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(F.Spring(scene.ground, arm, point_a=(0.6, 0.0, -0.8), stiffness=30.0, free_length=0.1))
    expected = ts.simulate(scene, (0, 0.6), integrator=I.DOP853(rtol=1e-12, atol=1e-12)).state.q
    for method in METHODS:
        np.testing.assert_allclose(ts.simulate(scene, (0, 0.6), integrator=method).state.q, expected, atol=FAIR)


class Cone(ts.Force):
    """A constant force towards the z axis, with a series of its own and nothing said of where it ends."""

    markers = (ts.Point("a"),)
    slots = 4

    @staticmethod
    def law(x, xd, par, t, out):
        r = np.sqrt(x[0] * x[0] + x[1] * x[1])
        out[0], out[1] = -4.0 * x[0] / r, -4.0 * x[1] / r

    @staticmethod
    def series(x, xd, par, k, s, out):
        s[0, k], s[1, k] = x[0], x[1]
        s[2, k] = square(s[0], k) + square(s[1], k)
        s[3, k] = inverse_root(s[2], s[3], k)
        out[0], out[1] = -4.0 * product(s[0], s[3], k), -4.0 * product(s[1], s[3], k)


@pytest.mark.slow
def test_a_plug_in_that_says_nothing_is_checked():
    """2 m/s inwards from 1 m, then outwards against the force: v^2 = 4 + 8 at the axis, at rest 1.5 m beyond."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, (1.0, 0.0, 0.0), (-2.0, 0.0, 0.0))
    scene.add(Cone(mass))
    v = math.sqrt(12.0)
    t = (v - 2.0) / 4.0 + 0.2
    solution = ts.simulate(scene, (0, t))
    assert solution.method.startswith("Taylor")
    assert solution.state.q[0] == pytest.approx(-(v * 0.2 - 2.0 * 0.2**2), abs=FAIR)


def test_lengths_that_are_analytic_cost_no_step():
    """Roots of waves that stay far from zero: a Stewart platform."""
    solution = ts.simulate(stewart_platform.build(), (0, stewart_platform.END))
    assert (solution.stats.steps, solution.stats.rejected) == (7, 0)
    stewart_platform.check(solution, tol=1e-7)


def test_a_length_that_changes_at_once_is_followed():
    """Its series at the start knows nothing of the change."""
    motion = 1.0 + 0.1 * np.tanh((M.time - 0.6) / 0.02)
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, (float(motion(0.0)), 0, 0), (0, 1, 0))
    scene.add(ts.constraints.Distance(scene.ground, mass, length=motion))
    expected = ts.simulate(scene, (0, 0.9), integrator=I.DOP853(rtol=1e-12, atol=1e-12)).state.q
    np.testing.assert_allclose(ts.simulate(scene, (0, 0.9)).state.q, expected, atol=FAIR)


def test_a_fixed_step_past_the_anchor_ends_the_run():
    solution = ts.simulate(flight(), (0, 1.0), integrator=I.Taylor(step=0.1))
    assert solution.status == ts.Status.SERIES_ENDED
    assert solution.t[-1] == pytest.approx(0.4)
    assert ts.simulate(flight(), (0, 0.4), integrator=I.Taylor(step=0.1)).success


@pytest.mark.parametrize("rows", [3, (4,), (-1,), (0.5,), [3]], ids=repr)
def test_rows_that_there_are_not_are_refused(rows):
    with pytest.raises(ts.TsdynError, match="positive must be a tuple of rows"):
        type("Wrong", (Cone,), {"positive": rows})
