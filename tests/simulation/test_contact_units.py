"""Contacts in other units of length, mass and time: the same phases, instants, impulses and places."""

from functools import cache

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.units import Units

C, F = ts.constraints, ts.forces
CORNERS = (-1, -1), (-1, 1), (1, -1), (1, 1)


def stack(u):
    """Two tilted boxes fall and come to rest on each other."""
    scene, size = u.scene(), u.length * np.array((2.4, 2.0, 1.0))
    below, top = scene.ground, 0.0
    for i in range(2):
        half, place = 0.01 * (1 + i), (0, 0, (0.56 + 1.12 * i) * u.length)
        box = scene.add_body(**ts.shapes.box(size, mass=(1 + i) * u.mass), position=place)
        box.orientation = np.cos(half), np.sin(half), 0, 0
        for corner in CORNERS:
            u.floor(box, size / 2 * (*corner, -1), below, (0, 0, top), kinetic=0.3 + 0.2 * i)
        below, top = box, 0.5 * u.length
    return scene, 0.8


def dominoes(u):
    """The first of two is pushed over, and pushes the other one."""
    scene, size, first = u.scene(), u.length * np.array((0.4, 1.0, 2.0)), None
    for i in range(2):
        w = np.array((0, 1.2 * (i == 0), 0)) / u.time
        place = np.array((i, 0, 1)) * u.length
        box = scene.add_body(**ts.shapes.box(size, mass=u.mass), position=place, angular_velocity=w)
        box.velocity = np.cross(w, size / 2 * (-1, 0, 1))
        scene.add(C.Planar.at(scene.ground, box, point=place, axis=(0, 1, 0)))
        for x, z in ((-1, -1), (1, -1), (1, 1)):
            u.floor(box, size / 2 * (x, 0, z), kinetic=0.2)
        if first is not None:
            at = {"point_a": size / 2 * (1, 0, 1), "point_b": size / 2 * (-1, 0, 0), "normal_b": (-1, 0, 0)}
            scene.add(C.PlaneContact(first, box, **at, unilateral=True, kinetic=0.1))
        first = box
    return scene, 1.3


def rope(u):
    """A body thrown at the end of a rope: impacts accumulate, then it swings."""
    scene, inertia = u.scene(), np.array((0.1, 0.2, 0.3)) * u.mass * u.length**2
    place, velocity = np.array((0.4, 0, -0.9)) * u.length, np.array((0.5, 1, 2)) * u.length / u.time
    bob = scene.add_body(u.mass, inertia, place, velocity=velocity)
    ends = [(scene.ground, (0, 0, 0)), (bob, np.array((0.1, 0.05, 0)) * u.length)]
    scene.add(C.Rope(ends, length=1.1 * u.length, restitution=0.3))
    return scene, 3.0


def stick_slip(u):
    """A box that slides and turns, drawn by a spring, comes to rest."""
    scene, size = u.scene(), u.length * np.array((2, 1.2, 0.8))
    box = scene.add_body(**ts.shapes.box(size, mass=u.mass), position=(0, 0, 0.4 * u.length))
    box.velocity, box.angular_velocity = np.array((0.3, 0.4, 0)) * u.length / u.time, (0, 0, 1 / u.time)
    for corner in CORNERS:
        u.floor(box, size / 2 * (*corner, -1), kinetic=0.3, static=0.35)
    end = {"point_b": np.array((3, 0.5, 0.4)) * u.length, "free_length": u.length}
    scene.add(F.Spring(box, scene.ground, **end, stiffness=4 * u.mass / u.time**2))
    return scene, 2.0


def joint(u):
    """A particle in a plane that leans: its slip turns down the slope, and ends."""
    scene = ts.Scene(gravity=np.array((np.sin(0.3), 0, -np.cos(0.3))) * 9.81 * u.length / u.time**2)
    block = scene.add_point_mass(u.mass, (2 * u.length, 0, 0), velocity=(0, u.length / u.time, 0))
    plane = scene.add(C.PlaneContact(block, scene.ground, point_b=(u.length, 0, 0), normal_b=(0, 0, 1)))
    scene.add(F.ContactFriction(plane, kinetic=0.35))
    return scene, 4.0


def shaken(u):
    """A box on a table that is shaken slips and sticks; its corners share friction."""
    scene, L, rate = u.scene(), u.length, 5.0 / u.time
    table = scene.add_body(5 * u.mass, np.ones(3) * u.mass * L**2)
    box = scene.add_body(**ts.shapes.box(L * np.array((0.4, 0.3, 0.2)), mass=u.mass), position=(0, 0, 0.1 * L))
    table.velocity = box.velocity = (0.15 * L * rate, 0, 0)
    slide = scene.add(C.Translational.at(scene.ground, table, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(slide, displacement=ts.motions.Sine(0.15 * L, rate)))
    for x, y in CORNERS:
        u.floor(box, L * np.array((0.2 * x, 0.15 * y, -0.1)), table, kinetic=0.25, static=0.3)
    return scene, 1.0


@cache
def motion(make, u):
    """Phases, and times, impulses and places in these units, of a run whose tolerances have the units, too."""
    solution, places = u.run(make, 1e-14)
    found = solution.phases, solution.impulses
    times = [np.array([each[0] for each in some]) / u.time for some in found]
    p = np.array([float(each[2]) for each in solution.impulses]) * u.time / (u.mass * u.length)
    return [names for *_, names in found[0]], [name for _, name, _ in found[1]], *times, p, places


OTHERS = [
    Units(1e-6, 1e9, 1e3),
    Units(1e6, 1e-6, 1e-3),
    *(pytest.param(Units(**{name: 1e6**power}), marks=pytest.mark.slow) for name in Units._fields for power in (1, -1)),
]


@pytest.mark.parametrize("make", [stack, dominoes, rope, stick_slip, joint], ids=lambda make: make.__name__)
@pytest.mark.parametrize("units", OTHERS, ids=lambda units: "{:g} m, {:g} kg, {:g} s".format(*units))
def test_other_units_change_nothing(make, units):
    demand_same(make, units)


def test_corners_share_friction_within_their_cones_in_small_units():
    """Turning accelerations are 1e8 times the others; the first slip begins at 0.3 of the weight."""
    demand_same(shaken, Units(1e-8, 1e9, 1e3))
    starts = motion(shaken, Units())[2]
    np.testing.assert_allclose(0.15 * 25.0 * np.sin(5.0 * starts[1]), 0.3 * 9.81, rtol=1e-12)


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6, 1e9])
def test_all_corners_of_a_box_that_slides_hold_it_and_ask_for_finite_friction(length):
    """It stops at v / (mu g). Two corners carry it, the reactions of a third are rounding."""
    scene, size = ts.Scene(gravity=(0, 0, -9.81 * length)), length * np.array((0.6, 0.4, 0.2))
    given = {"position": (0, 0, size[2] / 2), "velocity": (0.3 * length, 0.1 * length, 0)}
    box = scene.add_body(**ts.shapes.box(size, mass=2.0), **given, name="box")
    for i, corner in enumerate(CORNERS):
        law = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.3, "name": f"foot {i}"}
        scene.add(C.PlaneContact(box, scene.ground, point_a=size / 2 * (*corner, -1), **law))
    solution = ts.simulate(scene, (0, 0.3)).raise_if_failed()
    np.testing.assert_allclose([t for t, *_ in solution.phases], (0, np.hypot(0.3, 0.1) / 0.3 / 9.81), rtol=1e-9)
    assert np.ptp(solution.position("box")[:, 2]) < 1e-12 * length
    for i in range(4):
        assert solution.friction_demand(f"foot {i}").max() < 0.3 + 1e-9


def demand_same(make, units):
    """To rounding: of the last times of an accumulation, 1e-16 over the flights; of what redundant feet share.

    Slip that turns to its end keeps its direction below 3e-7 of the velocities: it ends right to some share of that.
    """
    phases, hits, starts, instants, p, places = motion(make, Units())
    assert (phases, hits) == motion(make, units)[:2]
    assert len(phases) > 1
    others = motion(make, units)[2:]
    tols = 1e-7, 1e-9, 1e-9, 1e-12
    for own, other, tol in zip((starts, instants, p, places), others, tols, strict=True):
        np.testing.assert_allclose(other, own, rtol=0.0, atol=tol)
