"""Stores, checkpoints and saved solutions of runs with contacts and friction: to the bits of a run never stopped."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.calls import same_run
from tests.helpers.contacts import bouncing, box, pendulum
from tests.helpers.resuming import Stop
from tsdyn.runs import driver

C, G = ts.constraints, 9.81


def ball():
    return bouncing(0.5)[0]


def swing():
    return pendulum(0.5)[0]


def tumbling():
    return box(0.3, 0.4)


def belt():
    """A block on a belt of 0.1 m/s, held by a spring: it sticks and slips."""
    scene = ts.Scene(gravity=(0, 0, -G))
    moving = scene.add_body(1.0, (1, 1, 1), position=(0, 0, -0.1), velocity=(0.1, 0, 0), name="belt")
    block = scene.add_body(1.0, (0.1, 0.1, 0.1), name="block")
    guide = scene.add(C.Translational.at(scene.ground, moving, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(guide, displacement=0.1 * ts.motions.time))
    scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(ts.forces.Spring(block, scene.ground, point_b=(-1, 0, 0), stiffness=10.0, free_length=1.0))
    scene.add(ts.forces.CoulombFriction(block, moving, force=1.0, static_force=1.5, name="friction"))
    return scene


def thrown():
    """A ball with backspin: it bounces, slides and rolls."""
    scene = ts.Scene(gravity=(0, 0, -G))
    start = {"position": (0, 0, 0.3), "velocity": (1, 0, 0), "angular_velocity": (0, -20, 0)}
    ball = scene.add_body(1.0, (0.004, 0.004, 0.004), **start, name="ball")
    floor = {"radius_a": 0.1, "normal_b": (0, 0, 1), "restitution": 0.4, "kinetic": 0.2}
    scene.add(C.SphereContact(ball, scene.ground, **floor, name="floor"))
    return scene


def low(t, state):
    return state.q[2] - 0.15


def alike(one, other):
    """Everything that a solution with phases tells."""
    same_run(one, other)
    assert (one.phases, one.impulses, one.method) == (other.phases, other.impulses, other.method)
    np.testing.assert_array_equal(one.constraint_error.position, other.constraint_error.position)
    np.testing.assert_array_equal(one.energy, other.energy)


RUNS = {
    "bouncing": (ball, 3.0, {}),
    "bouncing, events": (ball, 3.0, {"events": low}),
    "bouncing, times": (ball, 3.0, {"t_eval": np.linspace(0.0, 3.0, 17)}),
    "bouncing, rk45": (ball, 3.0, {"integrator": "rk45"}),
    "stop, dop853": (swing, 3.0, {"integrator": "dop853"}),
    "stop, radau": (swing, 3.0, {"integrator": "radau"}),
    "box": (tumbling, 1.0, {}),
    "box, null-space": (tumbling, 1.0, {"formulation": "null-space"}),
    "backspin": (thrown, 1.0, {}),
    "stick-slip": (belt, 4.0, {}),
    "stick-slip, times": (belt, 4.0, {"t_eval": np.linspace(0.0, 4.0, 41), "integrator": "dop853"}),
}


@pytest.mark.slow_but("bouncing-1", "bouncing-5", "bouncing, times-2", "stop, dop853-5", "stick-slip-2")
@pytest.mark.parametrize("stop", [1, 2, 5, 11])
@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_a_run_that_was_stopped_goes_on(run, stop, tmp_path, monkeypatch):
    """Within a phase, and where one has ended."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    build, end, options = run
    whole = ts.simulate(build(), (0.0, end), history=True, **options)
    path, events = tmp_path / f"run.{'h5' if stop % 2 else 'zarr'}", options.get("events")
    given = {"store": path, "checkpoint": 0.0, "history": True, **options}
    stopped = ts.simulate(build(), (0.0, end), progress=Stop(stop), **given)
    if stopped.status is ts.Status.INTERRUPTED:
        assert len(stopped.phases) <= len(whole.phases)
        ts.resume(path, events=events, progress=Stop(stop + 1))
    alike(whole, ts.resume(path, events=events))
    alike(whole, ts.resume(path, events=events))  # a finished run
    if events is None:
        alike(whole, ts.load(path))


@pytest.mark.slow_but("bouncing-h5", "stick-slip-zarr", "backspin-h5")
@pytest.mark.parametrize("suffix", ["h5", "zarr"])
@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_a_saved_solution(run, suffix, tmp_path):
    build, end, options = run
    options = {name: value for name, value in options.items() if name != "events"}
    whole = ts.simulate(build(), (0.0, end), dense_output=True, **options)
    times = np.append(np.linspace(0.0, end, 50), [start for start, *_ in whole.phases])
    known = whole
    for number in range(2):  # a loaded one is saved again
        known = ts.load(known.save(tmp_path / f"run {number}.{suffix}"))
        alike(whole, known)
        for mine, other in zip(whole.at(times), known.at(times), strict=True):
            np.testing.assert_array_equal(mine, other)
        np.testing.assert_array_equal(whole.work, known.work)
        np.testing.assert_array_equal(whole[3:9].multipliers, known[3:9].multipliers)


def test_a_store_tells_what_memory_does(tmp_path):
    """Slices, reactions and phases are read from the file."""
    whole, stored = (ts.simulate(ball(), (0, 3), **given) for given in ({}, {"store": tmp_path / "run.h5"}))
    assert stored.phases == whole.phases
    np.testing.assert_array_equal(stored.reaction("floor")[0], whole.reaction("floor")[0])
    np.testing.assert_array_equal(stored[2:7].multipliers, whole[2:7].multipliers)
    np.testing.assert_array_equal(stored[2:7].to_dataframe(), whole[2:7].to_dataframe())


def test_another_restitution_is_another_scene(tmp_path):
    path = tmp_path / "run.h5"
    ts.simulate(ball(), (0, 1), store=path, checkpoint=60.0)
    with pytest.raises(ts.StorageError, match="the scene is another one"):
        ts.resume(path, scene=bouncing(0.6)[0])


def test_a_disk_that_fills_up_in_a_later_phase(tmp_path, monkeypatch):
    path, free = tmp_path / "run.h5", iter([1 << 30] * 6)
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=next(free, 1 << 20)))
    solution = ts.simulate(tumbling(), (0.0, 1.0), store=path, checkpoint=0.0)
    assert solution.status == ts.Status.STORE_FAILED
    assert len(solution.phases) > 1
    monkeypatch.undo()
    np.testing.assert_array_equal(ts.resume(path).q, ts.simulate(tumbling(), (0.0, 1.0)).q)


def drag(t, a, b, par, out):
    out[0] = -0.1 * a[7]


@pytest.mark.slow
def test_a_scene_of_which_a_part_is_missing(tmp_path):
    """A file keeps no code: phases and impulses are there without, reactions with the scene."""

    def build():
        scene = ball()
        scene.add(ts.forces.UserForce(scene["ball"], function=drag, name="drag"))
        return scene

    stored = ts.simulate(build(), (0, 3), store=tmp_path / "run.h5", checkpoint=60.0)
    saved = ts.simulate(build(), (0, 3)).save(tmp_path / "saved.h5")
    for path in (tmp_path / "run.h5", saved):
        outline, whole = ts.load(path), ts.load(path, scene=build())
        assert (outline.phases, outline.impulses) == (stored.phases, stored.impulses)
        assert whole.phases == stored.phases
        np.testing.assert_array_equal(whole.multipliers, stored.multipliers)
        with pytest.raises(ts.StorageError, match="drag"):
            outline.sticking("floor")


def test_work_has_the_losses_of_impacts():
    """Half of m g h (1 - e^2) and so on: what is left after all impacts is the height of the plane."""
    solution = ts.simulate(ball(), (0, 3.0), dense_output=True)
    assert np.ptp(solution.energy - solution.work) < 1e-13
    np.testing.assert_allclose(solution.work[-1], -0.5 * G, rtol=1e-12)
