"""Going on from states, pickles in other processes, functions whose globals change: what must not be stale."""

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from examples import drive_train, driven_pivot, top
from tests.helpers.tolerances import CLOSE, FINE, HELD, NEAR, ROUGH

ROOT = Path(__file__).parents[2]
PRECISE = {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10}
stiffness = 5.0


def pull(t, state):
    return (-stiffness * state[0], 0.0, 0.0)


def push(t):
    return (-stiffness, 0.0, 0.0)


def wound():
    """A wheel that winds up a torsional spring over several turns."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    wheel = scene.add_body(1.0, (0.5, 0.5, 0.5), angular_velocity=(0.0, 0.0, 40.0))
    scene.add(ts.constraints.Spherical(wheel, scene.ground))
    for axis in ((1, 0, 0), (0, 1, 0)):
        scene.add(ts.constraints.Dot1(scene.ground, wheel, axis_a=axis, axis_b=(0, 0, 1)))
    scene.add(
        ts.forces.TorsionalSpring(
            scene.ground, wheel, axis_a=(0, 0, 1), reference_a=(1, 0, 0), reference_b=(1, 0, 0), stiffness=0.5
        )
    )
    return scene


def test_a_state_of_arrays_alone_says_that_it_knows_no_bodies():
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0, position=(1, 0, 0))
    solution = ts.simulate(scene, (0, 1))
    assert isinstance(solution.state, ts.State)
    arrays = ts.State(*solution.state)
    np.testing.assert_array_equal(ts.simulate(scene, (1, 2), state=arrays).q[0], solution.q[-1])
    with pytest.raises(ts.InvalidArgument, match=r"knows no bodies and joints: ask solution\.state"):
        arrays.position(ball)


def test_every_state_of_a_run_goes_on_counting_turns():
    scene, seen = wound(), []

    def late(t, state):
        if t > 0.9:
            seen.append(state)
        return 1.0

    full = ts.simulate(scene, (0.0, 3.0), dense_output=True, events=late, **PRECISE)
    states = {"at": full.at(0.9), "replaced": full.at(0.9)._replace(t=0.9), "event": seen[0]}
    assert full.at([0.5, 0.9]).memory.shape == (2, 1)
    for state in states.values():
        again = ts.simulate(scene, (state.t, 3.0), state=state, **PRECISE)
        np.testing.assert_allclose(again.qd[-1], full.qd[-1], atol=ROUGH)


def test_a_state_that_does_not_say_its_turns_is_refused():
    scene = wound()
    end = ts.simulate(scene, (0.0, 0.9), **PRECISE).state
    with pytest.raises(ts.InvalidArgument, match="turns"):
        ts.simulate(scene, (0.9, 1.0), state=ts.State(*end))


@pytest.mark.slow_for("of time and state")
@pytest.mark.parametrize("force", [pull, push], ids=["of time and state", "of time"])
def test_functions_see_their_globals_as_they_are(force, monkeypatch):
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0, (1.0, 0.0, 0.0))
    scene.add(ts.forces.PointForce(mass, force=force))
    for value in (5.0, 20.0):
        monkeypatch.setattr(sys.modules[__name__], "stiffness", value)
        expected = np.cos(np.sqrt(value)) if force is pull else 1.0 - 0.5 * value
        assert ts.simulate(scene, (0.0, 1.0), **PRECISE).q[-1, 0] == pytest.approx(expected, abs=NEAR)


@pytest.mark.slow
def test_pickles_run_in_another_process(tmp_path):
    """Scenes, and solutions with all that they compute by kernels."""
    solutions = [ts.simulate(module.build(), (0.0, 0.3), **PRECISE) for module in (drive_train, driven_pivot)]
    (tmp_path / "pickle").write_bytes(pickle.dumps([(solution.scene, solution) for solution in solutions]))
    code = f"""
import pickle, sys
import numpy as np
sys.path.insert(0, {str(ROOT)!r})
import tsdyn as ts
for scene, solution in pickle.load(open({str(tmp_path / "pickle")!r}, "rb")):
    again = ts.simulate(scene, (0.0, 0.3), integrator="dop853", rtol=1e-10, atol=1e-10)
    assert (again.q[-1] == solution.q[-1]).all()
    assert (again.multipliers == solution.multipliers).all()
    assert (again.power == solution.power).all()
    for item in (*scene.constraints, *scene.forces):
        mine = [each for each in (*solution.scene.constraints, *solution.scene.forces) if each.name == item.name][0]
        assert (again.reaction(item)[0] == solution.reaction(mine)[0]).all()
print("done")
"""
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert result.stdout.strip() == "done", result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("method", "form"), [(None, "tangent"), ("dop853", "tangent"), ("rk45", "null-space")])
def test_dense_output_is_pickled(method, form, tmp_path):
    solution = ts.simulate(top.build(), (0.0, 0.3), integrator=method, formulation=form, dense_output=True)
    t = np.linspace(0.0, 0.3, 7)
    for twin in (copy.copy(solution), copy.deepcopy(solution), pickle.loads(pickle.dumps(solution))):
        np.testing.assert_array_equal(twin.at(t).q, solution.at(t).q)
        np.testing.assert_array_equal(twin.work, solution.work)
    (tmp_path / "pickle").write_bytes(pickle.dumps((solution, t, solution.at(t))))
    code = f"""
import pickle, sys
sys.path.insert(0, {str(ROOT)!r})
import tsdyn as ts
solution, t, state = pickle.load(open({str(tmp_path / "pickle")!r}, "rb"))
again = solution.at(t)
assert (again.q == state.q).all() and (again.qdd == state.qdd).all() and (again.multipliers == state.multipliers).all()
print("done")
"""
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert result.stdout.strip() == "done", result.stderr


@pytest.mark.slow
def test_charts_have_room_when_a_run_of_many_fails(monkeypatch):
    monkeypatch.setattr("tsdyn.runs.run_log.CHART_ROOM", 8)
    scene = ts.Scene()
    mass = scene.add_point_mass(1.0)

    def breaks(t, a, b, par, out):
        out[0] = np.nan if t > 0.5 else 0.0

    scene.add(ts.forces.UserForce(mass, function=breaks))
    for interval in (1, 2, 3, 5):
        solution = ts.simulate(
            scene, (0.0, 1.0), integrator=ts.integrators.RK45(max_step=0.01), chart_interval=interval
        )
        assert solution.status == ts.Status.NOT_FINITE
        assert solution.t[-1] == pytest.approx(0.5, abs=CLOSE)
        assert solution.charts.t.size >= solution.stats.steps // interval


@pytest.mark.slow
def test_a_stiff_transient_may_change_velocities_at_once():
    """A fixed step far beyond the transient's time, with an L-stable method."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0, (0.01, 0.0, 0.0))
    scene.add(ts.forces.Spring(mass, scene.ground, point_b=(1, 0, 0), stiffness=1e5, damping=1e3, free_length=1.0))
    solution = ts.simulate(scene, (0.0, 0.5), integrator=ts.integrators.SDIRK54(step=0.01)).raise_if_failed()
    assert np.abs(solution.q[-1]).max() < FINE


def test_the_first_step_is_bounded_too():
    scene = driven_pivot.build()
    solution = ts.simulate(scene, (0.0, 0.1), integrator=ts.integrators.RK45(first_step=0.05, max_step=0.001))
    assert solution.steps.h.max() <= 0.001 * (1 + HELD) * 1.001
