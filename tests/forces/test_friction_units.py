"""Friction in other units of length, mass and time: the same phases, instants and places, to rounding."""

from functools import cache

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, TIGHT
from tests.helpers.units import Units

C, F = ts.constraints, ts.forces
G = 9.81
TWINS = [Units(1e-3), Units(1e3), Units(1e-6, 1e9, 1e3), Units(1e6, 1e-6, 1e-3), Units(1.0, 1.0, 1e3)]


def spinning_disc(u):
    """Nine feet of a disc that slides and turns: slip of all feet ends at once."""
    scene, radius = ts.Scene(gravity=(0, 0, 0)), 0.5 * u.length
    spin = {"velocity": (u.length / u.time, 0, 0), "angular_velocity": (0, 0, 1.0 / (0.15 * u.time))}
    inertia = np.array((0.125, 0.125, 0.25)) * u.mass * u.length**2
    disc = scene.add_body(2.0 * u.mass, inertia, **spin, name="disc")
    scene.add(C.Planar.at(disc, scene.ground, point=(0, 0, 0), axis=(0, 0, 1)))
    for angle in 2.0 * np.pi * (np.arange(9) + 0.1) / 9.0:
        foot, force = (radius * np.cos(angle), radius * np.sin(angle), 0), 0.6 * G / 9.0 * u.mass * u.length / u.time**2
        scene.add(F.CoulombFriction(disc, scene.ground, point_a=foot, force=force))
    return scene, 1.5


def chain(u):
    """Six links on rough pins, released from the horizontal."""
    scene, last = u.scene(), None
    for i in range(6):
        inertia, place = np.array((0.01, 0.1, 0.1)) * u.mass * u.length**2, np.array((i + 0.5, 0, 0)) * u.length
        link = scene.add_body(u.mass, inertia, place)
        pin = C.Revolute.at(last or scene.ground, link, point=np.array((i, 0, 0)) * u.length, axis=(0, 1, 0))
        scene.add(F.RevoluteFriction(scene.add(pin), radius=0.02 * u.length, kinetic=0.3, static=0.4))
        last = link
    return scene, 0.6


def belt(u):
    """A block that a belt of micrometres a second carries along, and its spring draws back, where units are small."""
    scene, speed = u.scene(), 0.5 * u.length / u.time
    band = scene.add_body(10.0 * u.mass, np.ones(3) * u.mass * u.length**2, velocity=(speed, 0, 0))
    way = scene.add(C.Translational.at(scene.ground, band, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(way, displacement=ts.motions.Ramp(0.0, speed)))
    block = scene.add_point_mass(u.mass, velocity=(speed, 0, 0))
    contact = scene.add(C.PlaneContact(block, band, normal_b=(0, 0, 1)))
    scene.add(C.Dot2(scene.ground, block, axis_a=(0, 1, 0)))
    spring = {"stiffness": 100.0 * u.mass / u.time**2, "free_length": 5.0 * u.length}
    scene.add(F.Spring(block, scene.ground, point_b=(-5.0 * u.length, 0, 0), **spring))
    scene.add(F.ContactFriction(contact, kinetic=0.4, static=0.6))
    return scene, 3.0


@cache
def motion(make, u):
    """Instants of phases, and places, in these units."""
    solution, places = u.run(make, 1e-13)
    return np.array([start for start, *_ in solution.phases]) / u.time, places


@pytest.mark.parametrize(
    ("make", "tol"), [(spinning_disc, TIGHT), (chain, CLOSE), (belt, TIGHT)], ids=["disc", "chain", "belt"]
)
@pytest.mark.parametrize("u", TWINS, ids=lambda u: "{:g} m, {:g} kg, {:g} s".format(*u))
def test_other_units_change_nothing(make, tol, u):
    """Slips keep their direction below a share of the velocities, and series are right to a share of these."""
    (starts, places), (own_starts, own_places) = motion(make, Units()), motion(make, u)
    assert len(starts) > 1
    np.testing.assert_allclose(own_starts, starts, rtol=0, atol=tol)
    np.testing.assert_allclose(own_places, places, rtol=0, atol=TIGHT)
