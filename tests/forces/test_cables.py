"""Elastic cables: bounces, tackles, slack, damping, energy, Jacobians, analyses, files."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import FINE, NEAR

F = ts.forces
ORIGIN, G, K = (0.0, 0.0, 0.0), 10.0, 100.0
METHODS = {
    "taylor": {"integrator": "taylor"},
    "dop853": {"integrator": "dop853"},
    "rk45": {"integrator": "rk45"},
    "null-space": {"integrator": "dop853", "formulation": "null-space"},
    "sdirk54": {"integrator": "sdirk54"},
    "radau": {"integrator": "radau"},
    "default": {},
}


def hoist(velocity=0.0, **options):
    """A load in the bight of a cable, both parts of which carry it; at first just not stretched."""
    scene = ts.Scene(gravity=(0, 0, -G))
    load = scene.add_point_mass(mass=1.0, position=(0, 0, -1), velocity=(0, 0, velocity), name="load")
    points = [(scene.ground, ORIGIN), (load, ORIGIN), (scene.ground, ORIGIN)]
    return scene, load, scene.add(F.Cable(points, **{"stiffness": K, **options}, name="cable"))


def bounce(t, v=3.0):
    """Thrown up at v, it falls back on the cable: d'' = g - 4 k d / m below the free length."""
    landed, w = 2.0 * v / G, 2.0 * np.sqrt(K)
    if t < landed:
        return v * t - 0.5 * G * t * t
    return -(G / w**2 * (1.0 - np.cos(w * (t - landed))) + v / w * np.sin(w * (t - landed)))


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("method", METHODS)
def test_a_load_that_is_thrown_up_falls_back_on_a_slack_cable(method):
    scene, load, cable = hoist(3.0)
    assert cable.free_length == 2.0
    solution = ts.simulate(scene, (0.0, 0.7), rtol=1e-9, atol=1e-9, **METHODS[method])
    assert abs(solution.state.position(load)[2] + 1.0 - bounce(0.7)) < 1e-8
    assert np.ptp(solution.energy) < 1e-7


def test_tension_reaction_and_energy():
    scene, load, cable = hoist(free_length=1.5)
    solution = ts.simulate(scene, (0.0, 1e-3))
    assert abs(solution.potential_energy[0] - (-G + 0.5 * K * 0.25)) < FINE
    assert np.abs(solution.reaction(cable, on=load)[0][0] - (0.0, 0.0, 100.0)).max() < FINE  # twice 50 N
    slack = hoist(free_length=3.0)[0]
    assert ts.simulate(slack, (0.0, 1e-3)).potential_energy[0] == -G


def test_damping_takes_energy_while_taut_and_never_pushes():
    scene, load, cable = hoist(free_length=1.8, damping=30.0)
    solution = ts.simulate(scene, (0.0, 2.0), integrator="dop853", rtol=1e-9, atol=1e-9)
    assert (np.diff(solution.energy) < 1e-9).all()
    assert (solution.reaction(cable, on=load)[0][:, 2] >= 0.0).all()
    assert abs(solution.state.position(load)[2] + 0.5 * (1.8 + 0.05)) < 0.01  # hangs on two parts of 5 N


@pytest.mark.parametrize("integrator", ["taylor", pytest.param("radau", marks=pytest.mark.slow)])
def test_swinging_loads_on_cables_that_go_slack_keep_their_energy(integrator):
    scene = ts.Scene()
    one = scene.add_body(2.0, (0.1, 0.2, 0.3), position=(0.2, 0, -1), angular_velocity=(1, 2, 3))
    two = scene.add_body(1.0, (0.1, 0.1, 0.2), position=(1.4, 0.3, -1.2), velocity=(0, 1, 0))
    points = [(scene.ground, ORIGIN), (one, (0.1, 0, 0.2)), (scene.ground, (1, 0, 0)), (two, (0, 0.1, 0.1))]
    cable = scene.add(F.Cable(points, stiffness=500.0))
    scene.add(F.Cable([(one, (0, 0, -0.2)), (two, (0, 0, -0.2))], stiffness=100.0, free_length=1.0))
    solution = ts.simulate(scene, (0.0, 2.0), integrator=integrator, rtol=1e-10, atol=1e-10)
    assert np.ptp(solution.energy) < 1e-8
    force, _ = solution.reaction(cable, on=two)
    assert (force == 0.0).all(axis=1).any()
    assert force.any()
    other = ts.simulate(scene, (0.0, 2.0), integrator="dop853", rtol=1e-10, atol=1e-10)
    assert np.abs(solution.state.q - other.state.q).max() < 1e-7


def test_derivatives_between_all_bodies():
    ts.testing.check_force(F.Cable)


def test_a_stiff_cable_is_a_rope():
    """Atwood's machine over two pulleys, one of them on a beam: tension of the rope, to its stretch."""
    scene = ts.Scene(gravity=(0, 0, -G))
    heavy = scene.add_point_mass(mass=3.0, position=(0, 0, -2))
    light = scene.add_point_mass(mass=1.0, position=(1, 0, -2))
    points = [(heavy, ORIGIN), (scene.ground, ORIGIN), (scene.ground, (1, 0, 0)), (light, ORIGIN)]
    cable = scene.add(F.Cable(points, stiffness=1e7, free_length=5.0 - 15.0 / 1e7))
    solution = ts.simulate(scene, (0.0, 0.4), integrator="dop853", rtol=1e-9, atol=1e-9)
    assert abs(solution.state.velocity(light)[2] - 2.0) < 1e-5
    assert abs(solution.reaction(cable, on=light)[0][-1, 2] - 15.0) < 1e-2


def test_analyses_parameters_and_files(tmp_path):
    scene, load, _ = hoist()
    rest = scene.equilibrium()
    assert abs(rest.state.position(load)[2] + 1.0 + G / (4.0 * K)) < NEAR
    assert rest.stable
    scene.set_start(rest.state)
    assert abs(np.abs(scene.linearise().eigenvalues().imag).max() - 20.0) < NEAR
    scene, load, _ = hoist(3.0)
    scene.save(tmp_path / "scene.toml")
    again = ts.load(tmp_path / "scene.toml")
    assert (ts.simulate(again, (0.0, 0.7)).state.q == ts.simulate(scene, (0.0, 0.7)).state.q).all()
    ensemble = ts.ensemble(scene, {"cable.stiffness": [K, 0.5 * K]}, (0.0, 0.65), rtol=1e-9, atol=1e-9)
    assert abs(ensemble.q[0, 2] + 1.0 - bounce(0.65)) < 1e-7
    assert ensemble.q[1, 2] < ensemble.q[0, 2]


def test_cables_that_cant_be():
    scene, load, cable = hoist()
    with pytest.raises(ts.InvalidForce, match="points can't be set later"):
        cable.points = [(load, ORIGIN)]
    points = [(scene.ground, ORIGIN), (load, ORIGIN)]
    for options in ({"stiffness": -1.0}, {"stiffness": 1.0, "damping": -1.0}, {"stiffness": 1.0, "free_length": -1.0}):
        with pytest.raises(ts.InvalidForce, match="not negative"):
            F.Cable(points, **options)
    with pytest.raises(ts.InvalidForce, match="zero at all times"):
        scene.add(F.Cable(points))
    with pytest.raises(ts.InvalidForce, match="coincide"):
        F.Cable([(scene.ground, (0, 0, -1)), (load, ORIGIN)], stiffness=1.0)
    with pytest.raises(ts.InvalidForce, match="1 point given"):
        F.Cable(points[:1], stiffness=1.0)
