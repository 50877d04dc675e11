"""Modes named by what moves: shares of the kinetic energy against closed forms."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.journeys import displayed
from tests.helpers.tolerances import HELD

MASS, INERTIA, STIFFNESS = 1000.0, (300.0, 1500.0, 1700.0), 2e4  # kg, kg m^2, N/m
HALF_LENGTH, HALF_WIDTH = 1.2, 0.7  # m


def car():
    """A chassis on four springs, upright without load: bounce, pitch and roll are apart."""
    scene = ts.Scene(gravity=(0, 0, 0))
    chassis = scene.add_body(mass=MASS, inertia=INERTIA, position=(0, 0, 1), name="chassis")
    for x in (HALF_LENGTH, -HALF_LENGTH):
        for y in (HALF_WIDTH, -HALF_WIDTH):
            scene.add(
                ts.forces.Spring(chassis, scene.ground, point_a=(x, y, 0), point_b=(x, y, 0), stiffness=STIFFNESS)
            )
    return scene


def test_bounce_pitch_and_roll_of_a_car():
    modes = car().linearise().modes()
    expected = {
        "z": 4 * STIFFNESS / MASS,
        "rotation y": 4 * STIFFNESS * HALF_LENGTH**2 / INERTIA[1],
        "rotation x": 4 * STIFFNESS * HALF_WIDTH**2 / INERTIA[0],
    }
    found = {motion: frequency for motion, frequency in zip(modes.motions, modes.frequency, strict=True)}
    for direction, squared in expected.items():
        assert found[f"chassis.{direction} 100 %"] == pytest.approx(np.sqrt(squared) / (2 * np.pi), rel=1e-9)
        assert f"chassis.{direction} 100 %" in str(modes)
    for text in (repr(modes), modes._repr_html_()):
        assert "chassis.rotation y 100 %" in text
    displayed(modes)


def test_shares_of_a_rod_turned_in_space():
    """About its end: 3 to 1 of centroid and rotation, whichever frame and axis; shares of all bodies are 1."""
    scene = ts.Scene(gravity=(0, 0, -10))
    turned = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    rod = scene.add_body(
        **ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0, 0, -0.5), orientation=turned, name="rod"
    )
    scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(1, 1, 0), name="pin"))
    modes = scene.linearise().modes()
    expected = [[0.375, 0.375, 0, 0.125, 0.125, 0]]
    for asked in (rod, "rod"):
        np.testing.assert_allclose(modes.participation(asked), expected, atol=100 * HELD)
    assert [part.split()[-2] for part in modes.motions[0].split(", ")] == ["38", "38", "12", "12"]


def test_shares_of_two_masses():
    """m1 = 1, m2 = 2 on springs 1 and 3: eigenvectors of K = [[4, -3], [-3, 3]] in M, energies m_i v_i^2."""
    scene = ts.Scene(gravity=(0, 0, 0))
    one, two = (
        scene.add_body(mass=m, inertia=(1, 1, 1), position=(x, 0, 0), name=f"m{m}") for m, x in ((1, 1), (2, 2))
    )
    for body in (one, two):
        at = body.position
        scene.add(
            ts.constraints.Translational.at(scene.ground, body, point=at, axis=(1, 0, 0), name=f"rail {body.name}")
        )
    scene.add(ts.forces.Spring(scene.ground, one, stiffness=1.0))
    scene.add(ts.forces.Spring(one, two, stiffness=3.0))
    modes = scene.linearise().modes()
    M = np.diag([1.0, 2.0])
    root = np.diag(1 / np.sqrt(np.diag(M)))
    values, vectors = np.linalg.eigh(root @ [[4.0, -3.0], [-3.0, 3.0]] @ root)
    np.testing.assert_allclose(2 * np.pi * modes.frequency, np.sqrt(values), rtol=1e-9)
    for i, body in enumerate((one, two)):
        np.testing.assert_allclose(modes.participation(body)[:, 0], vectors[i] ** 2, rtol=1e-8)
        np.testing.assert_array_equal(modes.participation(body)[:, 3:], 0.0)
    total = sum(modes.participation(body).sum(axis=1) for body in (one, two))
    np.testing.assert_allclose(total, 1.0, rtol=HELD)


def test_a_mass_set_after_the_linearisation_changes_no_share():
    scene = car()
    linear = scene.linearise()
    before = linear.modes().participation("chassis")
    scene["chassis"].mass = 1.0
    np.testing.assert_array_equal(linear.modes().participation("chassis"), before)


def test_handles_of_a_scene_with_other_parameters():
    """A point on the chassis, its centroid and its shares, asked by a handle of that scene."""
    other = car().with_parameters({"chassis.mass": 4.0 * MASS})
    body = other["chassis"]
    linear = other.linearise(outputs=[body, (body, (1.0, 0.0, 0.0))])
    bounce = int(np.argmin(np.abs(linear.modes().frequency - np.sqrt(STIFFNESS / MASS) / (2.0 * np.pi))))
    np.testing.assert_allclose(linear.modes().participation(body)[bounce], [0, 0, 1, 0, 0, 0], atol=HELD)
    places = dict(zip(linear.outputs, linear.state_space().C, strict=True))
    assert places["chassis.z"][linear.coordinates.index("chassis.z")] == pytest.approx(1.0, abs=HELD)
    along = places["chassis(1.0, 0.0, 0.0).z"][linear.coordinates.index("chassis.rotation y")]
    assert along == pytest.approx(-1.0, abs=HELD)  # e_z . (e_y x e_x)


def test_bodies_that_are_none():
    modes = car().linearise().modes()
    with pytest.raises(ts.InvalidBody, match="did you mean 'chassis'"):
        modes.participation("chasis")
    with pytest.raises(ts.InvalidBody, match="is not a body of this scene"):
        modes.participation(3)
