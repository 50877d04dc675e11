"""Runs of the default method that turn to the implicit method and back: one run, whoever makes its steps."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import jointed
from tests.helpers.tolerances import CLOSE, NEAR
from tsdyn.runs import driver
from tsdyn.simulation import segments

pytestmark = pytest.mark.slow  # kernels of implicit methods
OPTIONS = {"rtol": 1e-7, "atol": 1e-7}
END = 2.0  # s: Taylor, Radau, and so on, five or more segments


def level(t, state):
    return state.q[2] + 0.45


@pytest.fixture(scope="module", autouse=True)
def impatient():
    """The explicit method is tried after a few steps already, so that runs turn more than once."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(segments.limits, "PATIENCE", 1)
        patched.setattr(segments.Turns, "patience", 1)
        yield


@pytest.fixture(scope="module")
def turned():
    return ts.simulate(jointed(), (0.0, END), dense_output=True, events=level, **OPTIONS)


@pytest.fixture(scope="module")
def fine():
    method = ts.integrators.SDIRK54(1e-9, 1e-9)
    return ts.simulate(jointed(), (0.0, END), dense_output=True, events=level, integrator=method)


def test_every_step_is_an_output_once(turned):
    assert turned.success
    assert "Radau took over 3 times, first at t = 0.0" in turned.message
    assert turned.t.size == turned.stats.steps + 1
    assert (np.diff(turned.t) > 0.0).all()
    np.testing.assert_array_equal(turned.steps.t[turned.steps.accepted], turned.t[:-1])
    assert turned.charts.steps.sum() == turned.stats.steps


def test_the_motion_and_its_events_are_those_of_one_method(turned, fine):
    t = np.linspace(0.0, END, 301)
    np.testing.assert_allclose(turned.at(t).q, fine.at(t).q, rtol=0.0, atol=NEAR)
    assert turned.constraint_error.position.max() < CLOSE
    assert len(turned.t_events[0]) == len(fine.t_events[0])
    np.testing.assert_allclose(turned.t_events[0], fine.t_events[0], rtol=0.0, atol=NEAR)
    np.testing.assert_allclose(turned.at(turned.t).q, turned.q, rtol=0.0, atol=CLOSE)


def test_times_asked_for_are_outputs_once(turned):
    """At turns, too, and without a change of steps."""
    times = np.unique(np.concatenate((np.linspace(0.0, END, 50), turned.t[35:60])))
    asked = ts.simulate(jointed(), (0.0, END), t_eval=times, **OPTIONS)
    np.testing.assert_array_equal(asked.t, times)
    np.testing.assert_array_equal(asked.q[np.isin(times, turned.t)], turned.q[np.isin(turned.t, times)])
    assert asked.stats.steps == turned.stats.steps


def test_what_the_solution_says(turned, tmp_path):
    methods = ["Taylor(rtol=1e-07, atol=1e-07)", "Radau(rtol=1e-07, atol=1e-07, order=9)"]
    assert sorted(turned.method.split(" and ")) == sorted(methods)
    assert turned.stats.stiff
    assert turned.stats.iteration_matrices > 0
    assert turned.stats.charts == turned.charts.t.size
    assert turned.provenance["rtol"] == 1e-7
    assert turned.method in str(turned)
    twin = pickle.loads(pickle.dumps(turned))
    assert twin.method == turned.method
    np.testing.assert_array_equal(twin.at(turned.t).q, turned.at(turned.t).q)
    pytest.importorskip("h5py")
    again = ts.load(turned.save(tmp_path / "run.h5"))
    assert (again.method, again.message) == (turned.method, turned.message)
    np.testing.assert_array_equal(again.at(turned.t).q, turned.at(turned.t).q)


def test_turns_do_not_depend_on_slices(turned, monkeypatch):
    monkeypatch.setattr(driver, "FIRST_SLICE", 3)
    np.testing.assert_array_equal(ts.simulate(jointed(), (0.0, END), **OPTIONS).q, turned.q)


def test_a_won_trial_in_which_stiffness_was_found_is_looked_at_after_a_number_of_steps():
    """Not where the slice ends, though the motion has been found stiff already."""
    scene = jointed()
    turns = segments.Turns(scene, None, ts.integrators.DOP853(), None, (0.0, END), False)
    turns.tried, turns.known, steps = True, np.inf, segments.limits.TRIED
    numbers, clock = SimpleNamespace(steps=steps, stiff=1, at_limit=20), SimpleNamespace(t=1.0, h=1e-9)
    engine = SimpleNamespace(method=ts.integrators.DOP853())
    assert not turns.turns(SimpleNamespace(run=SimpleNamespace(numbers=numbers, clock=clock), engine=engine))
    assert not turns.tried
    assert turns.ask > steps


def test_steps_in_all_segments_count(turned):
    count = turned.stats.steps - 5
    cut = ts.simulate(jointed(), (0.0, END), max_steps=count, **OPTIONS)
    assert (cut.status, cut.stats.steps) == (ts.Status.MAX_STEPS, count)
    np.testing.assert_array_equal(cut.q, turned.q[: count + 1])


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6])
def test_an_interrupted_run_has_what_it_had(share, turned, monkeypatch):
    monkeypatch.setattr(driver, "FIRST_SLICE", 3)
    seen = []

    def stop(fraction):
        seen.append(fraction)
        if fraction > share:
            raise KeyboardInterrupt

    cut = ts.simulate(jointed(), (0.0, END), progress=stop, **OPTIONS)
    assert cut.status == ts.Status.INTERRUPTED
    assert (np.diff(seen) >= 0.0).all()
    np.testing.assert_array_equal(cut.q, turned.q[: len(cut.t)])


def test_the_explicit_method_goes_on_where_the_implicit_one_cannot(monkeypatch, tmp_path):
    def refuse(*given):
        raise ts.InvalidConstraint("no")

    def stop(fraction):
        if fraction > 0.5:
            raise KeyboardInterrupt

    monkeypatch.setattr(segments, "demand_holonomic", refuse)
    monkeypatch.setattr(driver, "FIRST_SLICE", 3)
    solution = ts.simulate(jointed(), (0.0, 0.05), **OPTIONS).raise_if_failed()
    assert solution.method == "Taylor(rtol=1e-07, atol=1e-07)"
    assert solution.t.size == solution.stats.steps + 1
    assert solution.stats.iteration_matrices == 0
    pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    ts.simulate(jointed(), (0.0, 0.05), store=path, checkpoint=0.0, progress=stop, **OPTIONS)
    np.testing.assert_array_equal(ts.resume(path).q, solution.q)


def held(until):
    """A pendulum of 1 m, held level by an overdamped spring that fades, and its rod."""
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    bob = scene.add_point_mass(1.0, position=(1.0, 0.0, 0.0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))

    def hold(t, state):
        return 0.0, 0.0, -(1e7 * state[2] + 1e5 * state[9]) / (1.0 + (t / until) ** 40)

    scene.add(ts.forces.PointForce(bob, force=hold))
    return scene


def test_the_explicit_method_goes_on_where_stiffness_has_gone():
    """Most steps of the implicit method come before, and the swing is made of a few steps of series."""
    solution = ts.simulate(held(0.5), (0.0, 20.0), **OPTIONS).raise_if_failed()
    assert solution.method.startswith("Taylor")
    assert "Radau took over" in solution.message
    h = solution.steps.h[solution.steps.accepted]
    assert h[solution.t[:-1] > 10.0].mean() > 0.05
    fine = ts.simulate(held(0.5), (0.0, 20.0), integrator=ts.integrators.DOP853(1e-10, 1e-10), t_eval=(0.0, 20.0))
    np.testing.assert_allclose(solution.q[-1], fine.q[-1], rtol=0.0, atol=1e-4)


def sprung(x):
    """A level rod on a stiff, damped torsional spring, which counts turns, at (x, 0, 0)."""
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    rod = scene.add_body(1.0, (1e-3, 0.01, 0.01), position=(x + 0.5, 0.0, 0.0), name="rod")
    scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(x, 0.0, 0.0), axis=(0, 1, 0)))
    axes = {"axis_a": (0, 1, 0), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(ts.forces.TorsionalSpring(scene.ground, rod, stiffness=2e4, damping=500.0, **axes))
    return scene


def test_far_from_the_origin_runs_turn_as_there():
    """Turns that forces count were cut off twice: scenes with them, so far away, raised ValueError."""
    near, far = (ts.simulate(sprung(x), (0.0, 1.0), dense_output=True, **OPTIONS) for x in (0.0, 2.0**20))
    assert near.method == far.method
    assert "Radau" in far.method
    np.testing.assert_allclose(far.at(0.5).q[:3] - [2.0**20, 0.0, 0.0], near.at(0.5).q[:3], rtol=0.0, atol=CLOSE)


def test_an_interruption_as_a_segment_ends_is_heeded(turned, monkeypatch):
    """Ctrl-C in the report with which a segment ends: the next one doesn't begin."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 3)
    calls, ended = [], []
    own = segments.Turns.turns
    monkeypatch.setattr(
        segments.Turns, "turns", lambda self, memory: own(self, memory) and not ended.append(len(calls))
    )
    ts.simulate(jointed(), (0.0, END), progress=calls.append, **OPTIONS)
    assert len(ended) == 5
    at, seen = ended[2], []

    def stop(fraction):
        seen.append(fraction)
        if len(seen) == at + 1:
            raise KeyboardInterrupt

    cut = ts.simulate(jointed(), (0.0, END), progress=stop, **OPTIONS)
    assert cut.status == ts.Status.INTERRUPTED
    np.testing.assert_array_equal(cut.q, turned.q[: len(cut.t)])
