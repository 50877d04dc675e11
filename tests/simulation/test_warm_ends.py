"""Calls that go by a plan and how they end: in later slices, early, by another method, by Ctrl-C; in threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import jointed
from examples import top
from tests.helpers.calls import by_plan, same_run
from tsdyn.runs import slices
from tsdyn.runs.run_memory import Memory
from tsdyn.runs.step_memory import StepMemory
from tsdyn.taylor.run_memory import SeriesMemory

I = ts.integrators
SPAN = (0.0, 0.3)
WAYS = {
    "default": {},
    "outputs": {"t_eval": SPAN},
    "many outputs": {"t_eval": np.linspace(*SPAN, 17)},
    "dop853": {"integrator": I.DOP853(1e-8, 1e-8)},
    "nystrom4": {"integrator": I.Nystrom4(2e-3)},
    "dense output": {"dense_output": True},
}


@pytest.fixture
def short(monkeypatch):
    """Slices of two steps, so that runs are longer than the first."""
    monkeypatch.setattr(slices, "FIRST_SLICE", 2)


@pytest.mark.parametrize("way", WAYS)
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
    assert "took over" in found.message
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
    scene, ways = top.build(), WAYS
    states = [None, ts.simulate(scene, SPAN).state]
    jobs = [(way, state, end) for way in ways for state in (0, 1) for end in (0.1, 0.3)] * 4

    def run(scene, way, state, end):
        options = {**WAYS[way], "state": states[state]}
        return ts.simulate(scene, (0.0, end), **{**options, "t_eval": None if end < 0.3 else options.get("t_eval")})

    expected = {job: run(top.build(), *job) for job in set(jobs)}
    with ThreadPoolExecutor(12) as pool:
        for job, found in zip(jobs, pool.map(lambda job: run(scene, *job), jobs), strict=True):
            same_run(found, expected[job])
