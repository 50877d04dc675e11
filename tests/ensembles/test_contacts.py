"""Ensembles and scenes with other parameters, where contacts make phases that differ from case to case."""

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints
FALL = np.sqrt(2 * 0.9 / 9.81)


def bouncing(e=0.8, radius=0.1, mass=1.0):
    scene = ts.Scene()
    ball = scene.add_body(mass=mass, inertia=(0.1, 0.1, 0.1), position=(0, 0, 1.0), velocity=(1, 0, 0), name="ball")
    floor = {"radius_a": radius, "normal_b": (0, 0, 1), "restitution": e, "name": "floor"}
    scene.add(C.SphereContact(ball, scene.ground, **floor))
    return scene


def swinging(lower=0.0, e=0.5):
    scene = ts.Scene()
    bar = scene.add_body(mass=2.0, inertia=(0.2, 0.2, 0.01), position=(0, 0, -1), name="bar")
    hinge = scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.set(hinge, angle=1.0)
    scene.add(C.Stop(hinge, lower=lower, restitution=e, name="stop"))
    return scene


@pytest.mark.parametrize(
    ("build", "name", "argument", "value"),
    [
        (bouncing, "floor.restitution", "e", 0.3),
        (bouncing, "floor.radius_a", "radius", 0.25),
        (bouncing, "ball.mass", "mass", 3.0),
        (swinging, "stop.lower", "lower", -0.4),
        (swinging, "stop.restitution", "e", 0.9),
    ],
)
def test_a_scene_with_other_parameters_is_that_built_with_them(build, name, argument, value):
    """To the bit, at rest on closed contacts, too."""
    one, other = (ts.simulate(s, (0, 3)) for s in (build().with_parameters({name: value}), build(**{argument: value})))
    assert one.success
    assert one.phases == other.phases
    assert one.impulses == other.impulses
    np.testing.assert_array_equal(one.q, other.q)
    np.testing.assert_array_equal(one.multipliers, other.multipliers)


def test_an_ensemble_over_restitution():
    """Each case has phases of its own, and the bits of a run alone; heights at the end by the closed form."""
    e = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    found = ts.ensemble(bouncing(), {"floor.restitution": e}, (0, 2 * FALL), threads=2)
    assert found.status.tolist() == [0] * 5
    alone = [ts.simulate(bouncing(value), (0, 2 * FALL)) for value in e]
    np.testing.assert_array_equal(found.q, [solution.q[-1] for solution in alone])
    rises = e * (e >= 0.5)  # at t = 2 fall: the first flight takes 2 e fall
    np.testing.assert_allclose((found.q[:, 2] - 0.1)[rises > 0], 0.9 * (2 * e - 1)[rises > 0], atol=1e-12)
    assert found.case(1).phases == alone[1].phases
    assert len({len(solution.phases) for solution in alone}) > 1


def test_times_channels_and_functions_are_kept():
    e, times = [0.2, 0.9], np.linspace(0, 2, 9)
    states = ts.ensemble(bouncing(), {"floor.restitution": e}, (0, 2), keep="t_eval", t_eval=times)
    impacts = ts.ensemble(bouncing(), {"floor.restitution": e}, (0, 2), keep=lambda solution: len(solution.impulses))
    names = ["ball.position.z", "floor.force.z"]
    channels = ts.ensemble(bouncing(), {"floor.restitution": e}, (0, 2), keep=names, t_eval=times)
    for i, value in enumerate(e):
        alone = ts.simulate(bouncing(value), (0, 2), t_eval=times)
        np.testing.assert_array_equal(states.q[i], alone.q)
        assert impacts.kept[i] == len(alone.impulses)
        np.testing.assert_array_equal(channels.kept["ball.position.z"][i], alone.q[:, 2])
        np.testing.assert_array_equal(channels.kept["floor.force.z"][i], alone.reaction("floor")[0][:, 2])


def test_starts_that_penetrate_fail_alone_and_are_assembled():
    starts = {"ball.position": [[0, 0, 1.0], [0, 0, -1.0], [0, 0, 0.1]]}
    found = ts.ensemble(bouncing(), starts, (0, 1))
    assert found.status.tolist() == [ts.Status.SUCCESS, ts.Status.CASE_FAILED, ts.Status.SUCCESS]
    assert "floor by 1.1" in found.message[1]
    assembled = ts.ensemble(bouncing(), starts, (0, 1), assemble=True)
    assert assembled.status.tolist() == [ts.Status.SUCCESS] * 3
    np.testing.assert_allclose(assembled.q[1:, 2], 0.1, atol=1e-14)


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_stores_and_files_of_ensembles(tmp_path, suffix):
    parameters = {"floor.restitution": np.linspace(0, 1, 6)}
    whole = ts.ensemble(bouncing(), parameters, (0, 1))
    place = {"store": tmp_path / f"run.{suffix}"}
    ts.ensemble(bouncing(), parameters, (0, 1), **place)
    np.testing.assert_array_equal(ts.ensemble(bouncing(), parameters, (0, 1), **place, resume=True).q, whole.q)
    known = ts.load(whole.save(tmp_path / f"saved.{suffix}"))
    np.testing.assert_array_equal(known.q, whole.q)
    assert known.case(4).phases == whole.case(4).phases


@pytest.mark.slow
def test_processes():
    parameters = {"floor.restitution": np.linspace(0, 1, 6)}
    with ProcessPoolExecutor(1) as executor:
        found = ts.ensemble(bouncing(), parameters, (0, 1), executor=executor)
    np.testing.assert_array_equal(found.q, ts.ensemble(bouncing(), parameters, (0, 1)).q)


def test_lanes_are_refused_by_name():
    with pytest.raises(ts.InvalidArgument, match="lanes=4: contacts and exact friction"):
        ts.ensemble(bouncing(), {"floor.restitution": [0.1, 0.2]}, (0, 1), lanes=4)
