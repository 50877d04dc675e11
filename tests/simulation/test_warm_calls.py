"""Calls that go by a plan: what they cost in calls of Python, and how they end; side by side, interrupted, kept."""

import gc
import pickle
import sys
import tracemalloc
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import jointed
from examples import door, top
from tests.helpers.calls import by_plan, same_run
from tsdyn.runs import slices
from tsdyn.runs.run_memory import Memory
from tsdyn.runs.step_memory import StepMemory
from tsdyn.simulation import plans, scene_cache
from tsdyn.taylor.run_memory import SeriesMemory

I = ts.integrators
SPAN = (0.0, 0.3)
MOST = 48  # calls of Python functions in a warm call: 24 to 46
WAYS = {
    "default": {},
    "tolerances": {"rtol": 1e-8, "atol": 1e-8},
    "outputs": {"t_eval": SPAN},
    "many outputs": {"t_eval": np.linspace(*SPAN, 17)},
    "dop853": {"integrator": I.DOP853(1e-8, 1e-8)},
    "dop853 by name": {"integrator": "dop853"},
    "nystrom4": {"integrator": I.Nystrom4(2e-3)},
    "dense output": {"dense_output": True},
    "sdirk54": {"integrator": I.SDIRK54(1e-6, 1e-6)},
}


def calls_of(call):
    """How many Python functions are called, and what the call returns."""
    count = 0

    def note(frame, event, argument):
        nonlocal count
        count += event == "call"

    sys.setprofile(note)
    try:
        found = call()
    finally:
        sys.setprofile(None)
    return count, found


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("options", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("make", [top.build, door.build], ids=["top", "door"])
def test_a_warm_call_makes_few_calls(make, options):
    scene = make()
    state = ts.simulate(scene, SPAN, **options).state
    for more in ({}, {"state": state}):
        expected = [ts.simulate(scene, SPAN, **options, **more) for _ in range(2)][-1]
        count, found = calls_of(lambda more=more: ts.simulate(scene, SPAN, **options, **more))
        assert count <= MOST
        same_run(found, expected)


@pytest.fixture
def short(monkeypatch):
    """Slices of two steps, so that runs are longer than the first."""
    monkeypatch.setattr(slices, "FIRST_SLICE", 2)


@pytest.mark.parametrize("way", [way for way in WAYS if way != "sdirk54"])
def test_a_run_that_is_longer_than_its_first_slice(way, short, monkeypatch):
    """Where a plan is used that was made of a shorter run, and where there is none."""
    scene, options = top.build(), WAYS[way]
    found = [ts.simulate(scene, SPAN, **options) for _ in range(3)]
    settings = {name: value for name, value in options.items() if name != "t_eval"}
    for _ in range(2):
        ts.simulate(scene, (0.0, 2e-3), **settings)
    found += [by_plan(scene, SPAN, **settings) for _ in range(2)]
    found.append(ts.simulate(scene, SPAN, **options))
    monkeypatch.setattr(slices, "FIRST_SLICE", 1024)
    for each, given in zip(found, [options] * 3 + [settings] * 2 + [options], strict=True):
        same_run(each, ts.simulate(top.build(), SPAN, **given))


def test_a_run_that_ends_early():
    scene = top.build()
    for _ in range(2):
        ts.simulate(scene, SPAN, max_steps=5)
    found = by_plan(scene, (0.0, 3.0), max_steps=5)
    same_run(found, ts.simulate(top.build(), (0.0, 3.0), max_steps=5))
    assert (found.status, found.stats.steps) == (ts.Status.MAX_STEPS, 5)
    assert "5 steps" in found.message


@pytest.mark.slow
def test_a_run_that_turns_to_the_implicit_method():
    """Of a plan that was made of a run which had no time to."""
    scene, options = jointed(), {"rtol": 1e-7, "atol": 1e-7}
    for _ in range(2):
        ts.simulate(scene, (0.0, 1e-4), **options)
    found = by_plan(scene, (0.0, 0.3), **options)
    assert "SDIRK54 took over" in found.message
    same_run(found, ts.simulate(jointed(), (0.0, 0.3), **options))


@pytest.mark.parametrize("memory", [SeriesMemory, StepMemory])
@pytest.mark.parametrize("late", [False, True])
def test_interrupt(memory, late, short, monkeypatch):
    """Ctrl-C arrives while the compiled driver runs, in its first slice; late: in the one that ends the run."""
    options = {"integrator": I.Taylor(1e-8)} if memory is SeriesMemory else {"integrator": I.RK45(1e-6)}
    scene, span = top.build(), (0.0, 1e-3 if late else 0.3)
    whole = [ts.simulate(scene, (0.0, 1e-3), **options) for _ in range(2)][-1]
    driver = memory.advance_kernel

    def interrupted(*arguments):
        driver(*arguments)
        raise KeyboardInterrupt

    interrupted.overloads = True
    with monkeypatch.context() as patched:
        patched.setattr(memory, "advance_kernel", staticmethod(interrupted))
        found = by_plan(scene, span, **options)
    if late:
        same_run(found, whole)
    else:
        assert (found.status, found.success) == (ts.Status.INTERRUPTED, False)
        assert found.stats.steps == 2
        assert found.state.t == found.t[-1]
    same_run(by_plan(scene, (0.0, 1e-3), **options), whole)


def test_interrupt_before_the_first_step(monkeypatch):
    scene = top.build()
    expected = [ts.simulate(scene, SPAN) for _ in range(2)][-1]

    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Memory, "advance", interrupted)
        patched.setattr(SeriesMemory, "advance", interrupted)
        with pytest.raises(KeyboardInterrupt):
            ts.simulate(scene, SPAN)
    same_run(ts.simulate(scene, SPAN), expected)


def test_threads():
    """More of them than a scene keeps memories, by several plans, starts and intervals."""
    scene, ways = top.build(), [way for way in WAYS if way != "sdirk54"]
    states = [None, ts.simulate(scene, SPAN).state]
    jobs = [(way, state, end) for way in ways for state in (0, 1) for end in (0.1, 0.3)] * 4

    def run(scene, way, state, end):
        options = {**WAYS[way], "state": states[state]}
        return ts.simulate(scene, (0.0, end), **{**options, "t_eval": None if end < 0.3 else options.get("t_eval")})

    expected = {job: run(top.build(), *job) for job in set(jobs)}
    with ThreadPoolExecutor(12) as pool:
        for job, found in zip(jobs, pool.map(lambda job: run(scene, *job), jobs), strict=True):
            same_run(found, expected[job])


def test_solutions_are_of_their_own():
    """Arrays of one are not those of another, nor of the memory; each survives pickling, copies, and its scene."""
    scene = top.build()
    expected = ts.simulate(top.build(), SPAN)
    found = [ts.simulate(scene, SPAN) for _ in range(4)]
    for array in (found[1].t, found[1].q, *found[1].state[1:], *found[1].steps[:2], found[1].charts.t):
        array[...] = np.nan
    scene.body("top").mass = 1.0
    ts.simulate(scene, SPAN)
    for each in (found[2], pickle.loads(pickle.dumps(found[3])), pickle.loads(pickle.dumps(found[2]))):
        same_run(each, expected)
    part = ts.simulate(top.build(), SPAN)[1:]
    np.testing.assert_array_equal(part.q, expected.q[1:])
    assert part.message == expected.message


def test_plans_that_take_turns_have_a_memory_each(monkeypatch):
    """After some calls; never more than are kept."""
    scene, laid_out = top.build(), []
    tolerances = 1e-8 * np.arange(1, 6)
    expected = [ts.simulate(top.build(), SPAN, rtol=rtol) for rtol in tolerances]
    for _ in range(8):
        for rtol in tolerances:
            ts.simulate(scene, SPAN, rtol=rtol)
    lay_out = Memory._lay_out
    monkeypatch.setattr(Memory, "_lay_out", lambda *given: laid_out.append(given) or lay_out(*given))
    for rtol, each in zip(tolerances, expected, strict=True):
        same_run(ts.simulate(scene, SPAN, rtol=rtol), each)
    assert not laid_out
    for rtol in 1e-8 * np.arange(1, plans.MOST + 1).repeat(8):
        ts.simulate(scene, SPAN, rtol=rtol)
    idle = [each for kinds in scene._spare.values() for spare in kinds.values() for each in spare]
    assert len(idle) <= scene_cache.SPARE


def test_plans_are_few_and_keep_nothing_alive():
    scene = top.build()
    for k in range(3 * plans.MOST):
        ts.simulate(scene, SPAN, rtol=1e-8 * (1 + k))
    assert len(scene._prepared.plans) == plans.MOST
    method, times = I.RK45(1e-6), np.linspace(*SPAN, 7)
    solution = [ts.simulate(scene, SPAN, integrator=method, t_eval=times) for _ in range(2)][-1]
    gone = [weakref.ref(each) for each in (method, times, solution, scene)]
    del method, times, solution
    gc.collect()
    assert [each() is None for each in gone] == [True, True, True, False]
    del scene
    gc.collect()
    assert gone[3]() is None


@pytest.mark.slow
def test_memory_does_not_grow_over_ten_thousand_calls():
    scene, methods = top.build(), (I.RK45(1e-6), None, "dop853")

    def call(k):
        ts.simulate(scene, (0.0, 0.01 + 1e-6 * (k % 7)), integrator=methods[k % 3], t_eval=[0.0, 0.01])

    for k in range(100):
        call(k)
    gc.collect()
    tracemalloc.start()
    for k in range(100):
        call(k)
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(10_000):
        call(k)
    gc.collect()
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert after < before + 20_000
