"""Calls one after the other, side by side and one inside another: the memory that they share shows in no result."""

import gc
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from examples import driven_pivot, top
from tests.helpers.scenes import build as build_scene
from tests.helpers.scenes import random_chain
from tsdyn.runs import recorder
from tsdyn.simulation import scene_cache as prepare

I = ts.integrators
SPAN = (0.0, 0.3)
PARTS = ("t", "q", "qd", "qdd", "multipliers")
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


def same(one, two):
    counts = [{**vars(each.stats), "seconds": None} for each in (one, two)]
    assert counts[0] == counts[1]
    assert (one.status, one.message) == (two.status, two.message)
    arrays = [(*(getattr(each, x) for x in PARTS), *each.steps, *each.charts, *each.state) for each in (one, two)]
    for a, b in zip(*arrays, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.slow_for("*top", "*driven")
@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_a_run_is_the_same_whatever_ran_before(make, ways, rng):
    first = {way: run(make(), way) for way in ways}
    scene = make()
    for way in rng.permutation(ways * 3):
        same(run(scene, way), first[way])


@pytest.mark.slow
def test_a_result_is_not_at_the_mercy_of_later_runs():
    scene = top.build()
    one = run(scene, "dense")
    kept = {name: value.copy() for name, value in vars(one).items() if isinstance(value, np.ndarray)}
    before = one.at(0.2)
    for way in WAYS:
        run(scene, way)
    for name, value in kept.items():
        np.testing.assert_array_equal(getattr(one, name), value, err_msg=name)
    for a, b in zip(before, one.at(0.2), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_result_may_be_written_to():
    scene = top.build()
    expected, spoilt = run(scene, "outputs"), run(scene, "outputs")
    for array in (spoilt.t, spoilt.q, spoilt.qd, spoilt.qdd, *spoilt.steps[:2], *spoilt.state[1:]):
        array[:] = np.nan
    same(run(scene, "outputs"), expected)


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
        same(each, expected)


def test_runs_in_threads_on_one_scene(ways):
    scene = top.build()
    expected = {way: run(scene, way) for way in ways}
    jobs = ways * 4
    with ThreadPoolExecutor(4) as pool:
        for way, each in zip(jobs, pool.map(lambda way: run(scene, way), jobs), strict=True):
            same(each, expected[way])


def test_an_edited_scene_sees_the_edit(ways):
    scene = top.build()
    for mass in (30.0, 31.0, 30.0):
        scene.bodies[0].mass = mass
        fresh = top.build()
        fresh.bodies[0].mass = mass
        for way in ways:
            same(run(scene, way), run(fresh, way))
    scene.add_point_mass(1.0)
    assert run(scene, "charts").q.shape[1] == 10


def test_a_start_is_looked_at_once_and_again_when_it_changes(monkeypatch):
    scene, looked = top.build(), []
    monkeypatch.setattr(prepare, "consistent", lambda *a, look=prepare.consistent: looked.append(a) or look(*a))
    state = run(scene, "default").state
    run(scene, "default")
    assert len(looked) == 1
    ts.simulate(scene, (0.3, 0.4), state=state)
    run(scene, "default")
    assert len(looked) == 3
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
    same(run(scene, "default"), expected)
    assert not any(spare for kinds in scene._spare.values() for spare in kinds.values())


def test_room_for_charts_is_made_as_they_come(monkeypatch):
    expected = {way: run(top.build(), way) for way in ("charts", "dense", "default")}
    monkeypatch.setattr(recorder, "CHART_ROOM", 4)
    for way, each in expected.items():
        same(run(top.build(), way), each)
