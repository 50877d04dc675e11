"""Calls that go by a plan: what they cost in calls of Python functions, and what is kept."""

import gc
import pickle
import sys
import tracemalloc
import weakref

import numpy as np
import pytest

import tsdyn as ts
from examples import door, top
from tests.helpers.calls import same_run
from tsdyn.runs.run_memory import Memory
from tsdyn.simulation import plans, scene_cache

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


@pytest.mark.slow_for("*sdirk54*")
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
