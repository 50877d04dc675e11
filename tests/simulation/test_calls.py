"""Calls one after the other, side by side and one inside another: the memory that they share shows in no result."""

import gc
import tracemalloc

import numpy as np
import pytest

import tsdyn as ts
from examples import driven_pivot, top
from tests.helpers.calls import PARTS, same_run
from tests.helpers.scenes import build as build_scene
from tests.helpers.scenes import random_chain
from tsdyn.configuration.initial_conditions import StartWorkspace
from tsdyn.runs import driver, run_log
from tsdyn.runs.run_memory import Memory
from tsdyn.runs.step_engine import StepEngine
from tsdyn.simulation import scene_cache as prepare
from tsdyn.taylor.series_engine import SeriesEngine

I = ts.integrators
SPAN = (0.0, 0.3)
WAYS = {
    "default": {},
    "tight": {"rtol": 1e-11, "atol": 1e-11},
    "outputs": {"t_eval": [0.0, 0.1, 0.3]},
    "more outputs": {"t_eval": np.linspace(0.0, 0.3, 17)},
    "dense": {"dense_output": True},
    "events": {"events": lambda t, state: t - 0.123},
    "fixed": {"integrator": I.Nystrom4(1e-3)},
    "first order": {"integrator": "rk45", "formulation": "maggi-kane"},
    "implicit": {"integrator": "sdirk54", "rtol": 1e-5, "atol": 1e-5},
    "fails": {"max_steps": 2},
    "charts": {"chart_interval": 1},
}
SCENES = {
    "top": top.build,
    "driven": driven_pivot.build,
    "chain": lambda: build_scene(random_chain(np.random.default_rng(3), 2)),
}


@pytest.fixture(params=["explicit", pytest.param("all", marks=pytest.mark.slow)])
def ways(request):
    """Names of ways: those without implicit methods, whose kernels are many, and all."""
    return [way for way in WAYS if request.param == "all" or way != "implicit"]


def run(scene, way):
    return ts.simulate(scene, SPAN, **WAYS[way])


@pytest.mark.slow_for("*top", "*driven")
@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_a_run_is_the_same_whatever_ran_before(make, ways, rng):
    first = {way: run(make(), way) for way in ways}
    scene = make()
    for way in rng.permutation(ways * 3):
        same_run(run(scene, way), first[way])


@pytest.mark.slow
def test_a_result_is_not_at_the_mercy_of_later_runs():
    scene = top.build()
    one, other = run(scene, "dense"), run(scene, "dense")  # the arrays of the other are not asked for until the end
    kept = {name: getattr(one, name).copy() for name in PARTS}
    before = one.at(0.2)
    for way in WAYS:
        run(scene, way)
    for name, value in kept.items():
        np.testing.assert_array_equal(getattr(one, name), value, err_msg=name)
    same_run(other, one)
    for a, b in zip(before, one.at(0.2), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_method_is_taken_as_it_is_now():
    scene, method = top.build(), I.RK45(rtol=1e-4, atol=1e-4)
    for name, value in (("rtol", 1e-9), ("atol", 1e-9), ("max_step", 1e-3), ("step", 2e-3), ("step", None)):
        loose = ts.simulate(scene, SPAN, integrator=method)
        setattr(method, name, value)
        found = ts.simulate(scene, SPAN, integrator=method)
        same_run(found, ts.simulate(top.build(), SPAN, integrator=method))
        assert found.stats.steps != loose.stats.steps or name == "rtol"
        assert found.method == repr(method)


def test_a_method_of_a_user_is_asked_anew():
    class Own(ts.ExplicitRungeKutta):
        order, tableau = 4, I.RK45.tableau
        margins = None

        def step_tolerances(self):
            return self.rtol * self.margins[0], self.atol * self.margins[0]

    scene, method = top.build(), Own(rtol=1e-6, atol=1e-6)
    method.margins = [1.0]
    loose = ts.simulate(scene, SPAN, integrator=method).stats.steps
    method.margins[0] = 1e-4
    assert ts.simulate(scene, SPAN, integrator=method).stats.steps > 2 * loose


def test_a_repeated_call_lays_nothing_out(monkeypatch):
    scene, made, ways = top.build(), [], ("default", "outputs", "fixed")
    first = [run(scene, way) for way in ways]
    states = [each.state for each in first]
    again = [ts.simulate(scene, SPAN, state=state) for state in states]
    for kind in (SeriesEngine, StepEngine, StartWorkspace, Memory):
        monkeypatch.setattr(kind, "__init__", lambda self, *a, init=kind.__init__: made.append(self) or init(self, *a))
    for way, each in zip(ways, first, strict=True):
        same_run(run(scene, way), each)
    for state, each in zip(states, again, strict=True):
        same_run(ts.simulate(scene, SPAN, state=state), each)
    assert not made


def test_what_a_run_said_does_not_follow_the_scene():
    scene = top.build()
    short, whole = run(scene, "fails"), run(scene, "default")
    expected = run(top.build(), "fails").message, run(top.build(), "default").message
    scene.bodies[0].mass = 1.0
    scene.add_point_mass(1.0)
    assert (short.message, whole.message) == expected
    assert (short[:1].message, whole[:1].message) == expected


def test_runs_inside_a_run():
    scene, inner = top.build(), []
    expected = run(scene, "default")

    def event(t, state):
        inner.append(run(scene, "default"))
        return t - 0.2

    outer = ts.simulate(scene, SPAN, events=event)
    np.testing.assert_array_equal(outer.q, expected.q)
    assert len(inner) > 2
    for each in inner:
        same_run(each, expected)


def test_a_start_is_looked_at_once_and_again_when_it_changes(monkeypatch):
    scene, looked = top.build(), []
    monkeypatch.setattr(prepare, "consistent", lambda *a, look=prepare.consistent: looked.append(a) or look(*a))
    state = run(scene, "default").state
    run(scene, "default")
    assert len(looked) == 1
    ts.simulate(scene, (0.3, 0.4), state=state)
    run(scene, "default")
    assert len(looked) == 2
    with pytest.raises(ts.InconsistentState):
        ts.simulate(scene, SPAN, state=state._replace(q=state.q + 1.0))
    with pytest.raises(ts.InconsistentState):
        ts.simulate(scene, SPAN, state=state._replace(q=state.q + 1.0))
    scene.bodies[0].position = (0.0, 0.0, 2.0)
    with pytest.raises(ts.InconsistentState):
        run(scene, "default")


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_runs():
    scene = top.build()

    def rounds(count):
        for _ in range(count):
            for way in WAYS:
                run(scene, way)
        gc.collect()

    def arrays():
        taken = tracemalloc.take_snapshot().filter_traces([tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)])
        return sum(trace.size for trace in taken.traces)

    rounds(3)
    tracemalloc.start()
    rounds(1)
    before = arrays()
    rounds(10)
    after = arrays()
    tracemalloc.stop()
    assert after <= before
    memories = [each for kinds in scene._spare.values() for spare in kinds.values() for each in spare]
    assert len(memories) <= prepare.KINDS
    assert sum(each.nbytes for each in memories) < 1e6


def test_what_is_kept_is_bounded():
    """Also where a scene changes its shape time and again, and with a memory too large to keep."""
    scene = top.build()
    for _ in range(3 * prepare.KINDS):
        scene.add_point_mass(1.0)
        ts.simulate(scene, (0.0, 1e-3), max_steps=1)
    assert len(scene._spare) <= prepare.KINDS


def test_a_large_memory_is_not_kept(monkeypatch):
    monkeypatch.setattr(prepare, "LARGEST", 1000)
    scene = top.build()
    expected = run(top.build(), "default")
    same_run(run(scene, "default"), expected)
    assert not any(spare for kinds in scene._spare.values() for spare in kinds.values())


def test_room_for_charts_is_made_as_they_come(monkeypatch):
    expected = {way: run(top.build(), way) for way in ("charts", "dense", "default")}
    monkeypatch.setattr(driver, "FIRST_SLICE", 2)
    for module in (driver, run_log):
        monkeypatch.setattr(module, "CHART_ROOM", 4)
    for way, each in expected.items():
        same_run(run(top.build(), way), each)


def test_a_run_of_many_charts_ends_in_its_first_slice(monkeypatch):
    """A chart in each of 300 steps: a second slice and the joining of both took longer than a tenth of the steps."""
    calls = []
    monkeypatch.setattr(Memory, "advance", lambda *given, own=Memory.advance: calls.append(given) or own(*given))
    solution = ts.simulate(top.build(), SPAN, integrator=I.Nystrom4(1e-3), chart_interval=1, t_eval=SPAN)
    assert solution.charts.t.size == solution.steps.t.size == 300
    assert len(calls) == 1
