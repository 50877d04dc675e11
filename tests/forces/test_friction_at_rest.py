"""Friction at rest: what it holds stays, what it stops stops where the closed form says, by either law."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, TIGHT

C, F, M = ts.constraints, ts.forces, ts.motions
G = 9.81
STILL = 1e-6  # m, in 100 s, by the regularised law at 1e-9 m/s

pytestmark = pytest.mark.slow


def on_a_slope(ratio, mass=3.0, size=0.0, **given):
    """A block on a slope of 10 degrees, which pulls with a part of what friction can hold; its friction is returned."""
    slope = np.radians(10.0)
    turn = Rotation.from_rotvec((0.0, slope, 0.0))
    scene = ts.Scene()
    place = (size, 0.0, 0.0)
    block = scene.add_body(mass, (0.01 * mass,) * 3, place, turn)
    guide = C.Translational.at(scene.ground, block, point=place, axis=turn.apply((1, 0, 0)), name="guide")
    scene.add(guide)
    return scene, scene.add(F.TranslationalFriction(guide, kinetic=np.tan(slope) / ratio, name="friction", **given))


@pytest.mark.parametrize("ratio", [0.35, 0.9, 0.99])
@pytest.mark.parametrize("slip", [0.0, 1e-9])
@pytest.mark.parametrize("given", [{}, {"mass": 1e-6}, {"mass": 1e6}, {"size": 1e-6}, {"size": 1e3}], ids=repr)
def test_a_block_on_a_slope_stays(given, ratio, slip):
    scene, _ = on_a_slope(ratio, slip_velocity=slip, **given)
    solution = ts.simulate(scene, (0.0, 100.0))
    assert abs(solution.displacement("guide")[-1]) < STILL
    assert slip or (solution.q == solution.q[0]).all()


@pytest.mark.parametrize("slip", [1e-3, 1e-9, 1e-11])
def test_a_given_slip_velocity_keeps_its_meaning(slip):
    """The block creeps at v_0 r / sqrt(1 - r^2), r the part of the friction that is needed."""
    scene, _ = on_a_slope(0.6, slip_velocity=slip)
    rate = ts.simulate(scene, (0.0, 100.0)).displacement_rate("guide")[-1]
    assert rate == pytest.approx(0.75 * slip, rel=1e-2)


def pushed(slip):
    """A block of 2 kg at 1 m/s, pushed to and fro with nine tenths of its friction; where it comes to rest, m."""
    scene = ts.Scene()
    block = scene.add_body(2.0, (0.01, 0.01, 0.01), velocity=(1, 0, 0))
    guide = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="guide"))
    scene.add(F.TranslationalFriction(guide, kinetic=0.4, slip_velocity=slip))
    scene.add(F.PointForce(block, force=(M.Sine(0.9 * 0.4 * 2.0 * G, 3.0), 0, 0)))
    w, a, low, high = 3.0, 0.4 * G, 0.0, 1.0
    for _ in range(60):  # v = 1 - a t + 0.9 a (1 - cos w t) / w = 0
        t = 0.5 * (low + high)
        low, high = (t, high) if 1.0 - a * t + 0.9 * a * (1.0 - np.cos(w * t)) / w > 0.0 else (low, t)
    return scene, t - 0.5 * a * t * t + 0.9 * a * (t - np.sin(w * t) / w) / w


@pytest.mark.parametrize("slip", [0.0, 1e-9, 1e-11, 1e-13, 1e-15])
def test_a_block_that_stops_is_held_for_any_slip_velocity(slip):
    scene, end = pushed(slip)
    solution = ts.simulate(scene, (0.0, 10.0))
    solution.raise_if_failed()
    assert solution.displacement("guide")[-1] == pytest.approx(end, abs=2e-9)


@pytest.mark.parametrize("tol", [1e-3, 1e-5, 1e-10])
def test_a_stop_at_any_tolerance(tol):
    """Loose tolerances once left velocities of stages that friction at rest made of what it liked."""
    scene = ts.Scene()
    block = scene.add_point_mass(1.0, velocity=(1.0, 0.5, 0.0))
    table = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    scene.add(F.ContactFriction(table, kinetic=0.3))
    solution = ts.simulate(scene, (0.0, 3.0), rtol=tol, atol=tol)
    way = np.linalg.norm(solution.position(block)[-1])
    assert way == pytest.approx(1.25 / (2 * 0.3 * G), rel=max(tol, 1e-9))
    assert solution.stats.steps < 1000


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3])
def test_a_stop_in_scenes_of_any_size(size):
    scene = ts.Scene()
    block = scene.add_point_mass(1.0, velocity=(np.sqrt(size), 0.0, 0.0))
    table = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    scene.add(F.ContactFriction(table, kinetic=0.3))
    solution = ts.simulate(scene, (0.0, 3.0 * np.sqrt(size)))
    assert solution.position(block)[-1, 0] == pytest.approx(size / (2 * 0.3 * G), rel=1e-6)


def test_a_chain_with_friction_in_all_joints_stays():
    """Links at a tenth of a degree from straight down are held by their pins, which creep as blocks do."""
    scene, last = ts.Scene(), None
    lean = np.radians(0.1)
    down = np.array([np.sin(lean), 0.0, -np.cos(lean)])
    for i in range(4):
        turn = Rotation.from_rotvec((0.0, -lean, 0.0))
        link = scene.add_body(1.0, (0.02, 0.02, 0.001), down * (i + 0.5), turn)
        pin = C.Revolute.at(last or scene.ground, link, point=down * i, axis=(0, 1, 0), name=f"pin {i}")
        scene.add(F.RevoluteFriction(scene.add(pin), radius=0.02, kinetic=0.5))
        last = link
    solution = ts.simulate(scene, (0.0, 100.0))
    assert max(abs(solution.angle(f"pin {i}")[-1]) * 0.02 for i in range(4)) < STILL


def test_a_family_may_set_a_slip_velocity():
    given = ts.simulate(on_a_slope(0.5, slip_velocity=1e-4)[0], (0.0, 1.0))
    cases = ts.ensemble(on_a_slope(0.5, slip_velocity=1e-2)[0], {"friction.slip_velocity": [1e-3, 1e-4]}, (0.0, 1.0))
    np.testing.assert_allclose(cases.q[1], given.q[-1], atol=TIGHT)


def test_the_stribeck_velocity_goes_with_a_slip_velocity_that_is_given():
    assert on_a_slope(0.5)[1].parameters()[2] == 0.0
    assert on_a_slope(0.5, slip_velocity=1e-4)[1].parameters()[2] == pytest.approx(1e-3, rel=CLOSE)
