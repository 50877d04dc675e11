"""Accounts of energy and momentum of every kind of contact: impacts, friction and reactions, to rounding."""

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.observables import diagnostics

C = ts.constraints
G, UP, TIGHT = 9.81, (0, 0, 1), {"rtol": 1e-12, "atol": 1e-12}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def thrown(inertia, height, velocity, spin):
    scene = ts.Scene(gravity=(0, 0, -G))
    given = {"position": (0.02, 0, height), "velocity": velocity, "angular_velocity": spin, "name": "body"}
    return scene, scene.add_body(2.0, inertia, **given)


def box(kinetic):
    """On its corners."""
    scene, body = thrown((0.1, 0.2, 0.15), 0.8, (1, 0.5, 0), (1, 2, 0.5))
    for i in range(8):
        corner = np.array([1.0, 0.6, 0.4]) / 2 * [2 * (i & 1) - 1, (i & 2) - 1, (i & 4) / 2 - 1]
        law = {"unilateral": True, "restitution": 0.3, "kinetic": kinetic}
        scene.add(C.PlaneContact(body, scene.ground, point_a=corner, normal_b=UP, **law))
    return scene


def bowl(kinetic):
    """A ball in a sphere."""
    scene, body = thrown((0.008,) * 3, 0.5, (0.3, 0.5, 0), (1, 2, 0.5))
    law = {"restitution": 0.5, "kinetic": kinetic}
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.1, radius_b=1.0, inside=True, **law))
    return scene


def ball(kinetic):
    """On a plane, by a sphere."""
    scene, body = thrown((0.008,) * 3, 0.3, (1, 0, 0), (0, -20, 5))
    scene.add(C.SphereContact(body, scene.ground, radius_a=0.1, normal_b=UP, restitution=0.5, kinetic=kinetic))
    return scene


def rolling(kind, **shape):
    """What rolls, slips and lifts off."""

    def build(kinetic):
        scene, body = thrown((0.004, 0.005, 0.003), 0.3, (1, 0, 0), (1, 20, 0.5))
        law = {"restitution": 0.2, "kinetic": kinetic}
        scene.add(getattr(C, kind)(body, scene.ground, normal_b=UP, **shape, **law))
        return scene

    return build


def stop(_):
    """A pendulum."""
    scene = ts.Scene(gravity=(0, 0, -G))
    bar = scene.add_body(2.0, (0.2, 0.2, 0.01), (0, 0, -1), name="body")
    hinge = scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.set(hinge, angle=1.0)
    scene.add(C.Stop(hinge, lower=-0.2, restitution=0.6))
    return scene


def rope(_):
    """A particle on a rope that is slack at first."""
    scene = ts.Scene(gravity=(0, 0, -G))
    stone = scene.add_point_mass(1.0, (0.3, 0, -0.5), name="body")
    scene.add(C.Rope([(scene.ground, (0, 0, 0)), (stone, (0, 0, 0))], length=1.0, restitution=0.4))
    return scene


def ratchet(_):
    """A wheel on a spring, held where it would turn back."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(1.0, (1, 1, 1), angular_velocity=(0, 0, 2), name="body")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=UP))
    spring = {"axis_a": UP, "reference_a": (1, 0, 0), "reference_b": (1, 0, 0), "stiffness": 3.0}
    scene.add(ts.forces.TorsionalSpring(scene.ground, wheel, **spring))
    scene.add(C.Ratchet(hinge))
    return scene


ROUGH = {
    "box": box,
    "bowl": bowl,
    "ball": ball,
    "disc": rolling("RollingDisc", axis_a=(0, 1, 0), radius=0.1),
    "rolling ball": rolling("RollingBall", radius=0.1),
    "ellipsoid": rolling("RollingEllipsoid", semi_axes=(0.1, 0.08, 0.05)),
}
CASES = [
    (build, kinetic) for build in ROUGH.values() for kinetic in (0.0, 0.4) if kinetic or build in (box, bowl, ball)
]
CASES += [(build, 0.0) for build in (stop, rope, ratchet)]
NAMES = [f"{name}, {kinetic:g}" for name, build in ROUGH.items() for own, kinetic in CASES if own is build]


@pytest.mark.slow_but("stop", "rope", "ball, 0")
@pytest.mark.parametrize(("build", "kinetic"), CASES, ids=[*NAMES, "stop", "rope", "ratchet"])
def test_energy_is_accounted_for(build, kinetic):
    """Energy less work, of friction and of impacts, is constant; what is lost is more."""
    solution = ts.simulate(build(kinetic), (0, 1.4), dense_output=True, **TIGHT)
    energy, size = solution.energy, solution.kinetic_energy.max() + np.ptp(solution.potential_energy)
    assert np.ptp(energy - solution.work) < 3e-12 * size
    assert energy[0] - energy[-1] > 0.1 * size or build is ratchet


@pytest.mark.slow
@pytest.mark.parametrize("name", [*ROUGH][1:])
def test_momentum_is_accounted_for(name):
    """Impulses, weight and reactions over time make the change of momentum: along z on planes, of all in the bowl.

    Plastic impacts: flights below rounding, as after others and of a box that rocks, end without an impulse.
    """
    build = ROUGH[name]
    scene = build(0.0 if build is bowl else 0.4)
    contacts = [each for each in scene.constraints if getattr(each, "unilateral", False)]
    for contact in contacts:
        contact.restitution = 0.0
    solution = ts.simulate(scene, (0, 0.6), dense_output=True, **TIGHT)
    change = np.diff(solution.linear_momentum[[0, -1]], axis=0)[0] + [0, 0, 2.0 * G * 0.6]
    for start, end, held in solution.phases:
        at = solution.at(start + (end - start) * (NODES + 1) / 2)
        for contact in contacts if held else ():
            change = change - (end - start) / 2 * WEIGHTS @ at.reaction(contact)[0]
    for t, _, p in solution.impulses:
        centre = solution.at(t).position("body")
        change = change - p * (-centre / np.linalg.norm(centre) if build is bowl else np.array(UP))
    assert len(solution.impulses) > 0
    assert solution.phases[-1][2]
    assert np.abs(change if build is bowl else change[2]).max() < 1e-11


@pytest.mark.parametrize("kinetic", [0.0, 0.4])
def test_an_oblique_impact_of_two_bodies_keeps_momenta(kinetic):
    """Linear and angular, whatever the friction between them."""
    scene = ts.Scene(gravity=(0, 0, 0))
    one = scene.add_body(2.0, (0.008,) * 3, velocity=(1, 0, 0), angular_velocity=(1, 2, 0.5))
    two = scene.add_body(1.0, (0.004,) * 3, (0.5, 0.05, 0.02), angular_velocity=(3, -2, 0.5))
    scene.add(C.SphereContact(one, two, radius_a=0.1, radius_b=0.1, restitution=0.5, kinetic=kinetic))
    solution = ts.simulate(scene, (0, 1.0))
    assert len(solution.impulses) == 1
    assert np.ptp(solution.linear_momentum, axis=0).max() < 1e-14
    assert np.ptp(solution.angular_momentum, axis=0).max() < 1e-14
    assert (np.ptp(solution.angular_velocity(one)[:, 0]) > 0.1) == (kinetic > 0.0)  # it turns the bodies


def test_work_of_a_motor_that_turns_without_load_is_integrated_at_once(monkeypatch):
    """Its power is rounding after the ball has left the globe: no halving of pieces, each with calls of its own."""
    scene = ts.Scene(gravity=(0, 0, -G))
    globe = scene.add_body(5.0, (1, 1, 1), angular_velocity=(0, 0, 2.0), name="globe")
    axle = scene.add(C.Revolute.at(scene.ground, globe, point=(0, 0, 0), axis=UP))
    scene.add(C.RotationMotor.of(axle, angle=2.0 * ts.motions.time))
    start = {"position": (0, 0.01, np.sqrt(0.55**2 - 0.01**2)), "name": "ball"}
    ball = scene.add_body(**ts.shapes.sphere(0.05, mass=0.1), **start)
    scene.add(C.SphereContact(ball, globe, radius_a=0.05, radius_b=0.5, kinetic=0.4, static=0.6))
    scene.assemble()
    solution = ts.simulate(scene, (0, 2.0), dense_output=True, **TIGHT)
    assert not solution.phases[-1][2]  # it has left
    asked, powers = [], diagnostics.force_powers
    monkeypatch.setattr(diagnostics, "force_powers", lambda at: asked.append(len(at.t)) or powers(at))
    work = solution.work
    assert len(asked) < 50
    assert np.ptp(solution.energy - work) < 3e-12 * solution.kinetic_energy.max()


def test_contacts_without_friction_have_no_power():
    """Of a stop with two bounds, too."""
    scene = stop(0.0)
    solution = ts.simulate(scene, (0, 0.5), dense_output=True)
    (name,) = [each.name for each in scene.constraints if isinstance(each, C.Stop)]
    for values in (solution.power_of(name), solution.work_of(name), solution.dissipation):
        assert values.tolist() == [0.0] * solution.t.size


def test_work_of_frictions_past_a_singular_configuration_adds_up():
    """A parallelogram passes its flat configuration, next to which reactions of the single hinges are rounding."""
    scene, P = ts.Scene(), np.array([(0, 0, 0), (0, 0, 1), (2, 0, 1), (2, 0, 0)])
    bars = [scene.add_body(1.0, (0.1, 0.1, 0.1), position=(P[i] + P[j]) / 2) for i, j in ((0, 1), (1, 2), (3, 2))]
    crank, coupler, rocker = bars
    hinges = [scene.add(C.Revolute.at(scene.ground, crank, point=P[0], axis=(0, 1, 0), name="hinge"))]
    for pair, point in (((crank, coupler), P[1]), ((coupler, rocker), P[2])):
        scene.add(C.Spherical.at(*pair, point=point))
    hinges.append(scene.add(C.Revolute.at(scene.ground, rocker, point=P[3], axis=(0, 1, 0))))
    frictions = [scene.add(ts.forces.RevoluteFriction(hinge, radius=0.05, kinetic=0.2)) for hinge in hinges]
    scene.set("hinge", rate=2.0)
    solution = ts.simulate(scene, (0, 10), dense_output=True)
    works = [solution.work_of(friction)[-1] for friction in frictions]
    lost = solution.energy[-1] - solution.energy[0]
    assert abs(sum(works) - lost) < 1e-7 * abs(lost)
    assert abs(works[0] - works[1]) < 1e-6 * abs(lost)
