"""Friction in other units of length, mass and time: the same phases, instants and places, to rounding."""

from functools import cache

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, TIGHT
from tests.simulation.test_contact_units import Units

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


@cache
def motion(make, u):
    """Instants of phases, and places, in these units."""
    scene, end = make(u)
    method = ts.integrators.Taylor(rtol=1e-12, atol=1e-12 * min(u.length, u.length / u.time, 1.0))
    solution = ts.simulate(scene, (0, end * u.time), integrator=method).raise_if_failed()
    places = [solution.position(body)[-1] / u.length for body in scene.bodies]
    return np.array([start for start, *_ in solution.phases]) / u.time, np.array(places)


@pytest.mark.parametrize("make", [spinning_disc, chain], ids=lambda make: make.__name__)
@pytest.mark.parametrize("u", TWINS, ids=lambda u: "{:g} m, {:g} kg, {:g} s".format(*u))
def test_other_units_change_nothing(make, u):
    """Slips keep their direction below a share of the velocities, whatever the unit of length: axes are no lengths."""
    (starts, places), (own_starts, own_places) = motion(make, Units()), motion(make, u)
    assert len(starts) > 1
    np.testing.assert_allclose(own_starts, starts, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(own_places, places, rtol=0, atol=TIGHT)
