"""Ctrl-C within a slice of a large scene, which is a step where steps are long: the run ends where the slice began.

Small scenes take the way of large ones here. The n-th slice finds its kernels replaced, as by a Ctrl-C as it begins.
"""

import gc
import os
import signal
import threading

import numpy as np
import pytest

import tsdyn as ts
from examples import geared_pair, top
from tests.helpers.methods import one_of_each
from tsdyn.files import archive as archives
from tsdyn.model import packed
from tsdyn.runs import dense_output, driver, run_memory
from tsdyn.stress import rods as mechanisms

OUTPUTS = ("t", "q", "qd", "qdd")
METHODS = one_of_each(1e-9, 1e-2) | {"rk45, maggi-kane": {"integrator": "rk45", "formulation": "maggi-kane"}}
TIMES = np.linspace(0.0, 1.0, 101)


@pytest.fixture
def interrupt(monkeypatch):
    """A function of n: from now on the n-th long call is interrupted at its beginning; None for no call."""
    left = [None]

    def interruptible(call, stop):
        if left[0] is None:
            return call()
        left[0] -= 1
        if left[0] > 0:
            return call()
        stop()
        call()
        raise KeyboardInterrupt

    monkeypatch.setattr(run_memory, "interruptible", interruptible)
    monkeypatch.setattr(driver, "FIRST_SLICE", 1)
    for module in (run_memory, dense_output):
        monkeypatch.setattr(module, "LONG_STEPS", 0)
    return lambda n: left.__setitem__(0, n)


def check_part(part, whole):
    """The outputs of a run that was interrupted are the first ones of the whole run."""
    assert (part.status, part.success) == (ts.Status.INTERRUPTED, False)
    assert 0 < part.t.size < whole.t.size
    for name in OUTPUTS:
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[: part.t.size])


@pytest.mark.slow_but("taylor", "dop853", "nystrom4")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_every_method(options, interrupt):
    """The next run, in the same memory, has the bits of one that was never interrupted."""
    scene = top.build()
    whole = ts.simulate(scene, (0.0, 1.0), **options)
    interrupt(4)
    part = ts.simulate(scene, (0.0, 1.0), **options)
    check_part(part, whole)
    assert part.state.t == part.t[-1]
    np.testing.assert_array_equal(part.state.q, part.q[-1])
    np.testing.assert_array_equal(part.steps.t[part.steps.accepted], part.t[:-1])
    interrupt(None)
    again = ts.simulate(scene, (0.0, 1.0), **options)
    for name in OUTPUTS:
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_outputs_withinterrupts(options, interrupt):
    """No output is lost or doubled by a run that goes on from there."""
    scene = top.build()
    whole = ts.simulate(scene, (0.0, 1.0), t_eval=TIMES, **options)
    interrupt(3)
    part = ts.simulate(scene, (0.0, 1.0), t_eval=TIMES, **options)
    check_part(part, whole)
    assert part.t[-1] <= part.state.t < TIMES[part.t.size]


def test_redundant_rows_and_dense_output(interrupt):
    scene = geared_pair.build()
    whole = ts.simulate(scene, (0.0, 0.2), integrator="dop853", dense_output=True)
    interrupt(4)
    part = ts.simulate(scene, (0.0, 0.2), integrator="dop853", dense_output=True)
    check_part(part, whole)
    interrupt(None)
    np.testing.assert_array_equal(part.at(0.5 * part.t[-1]).q, whole.at(0.5 * part.t[-1]).q)


def test_nothing_is_returned_before_the_first_output(interrupt):
    interrupt(1)
    with pytest.raises(KeyboardInterrupt):
        ts.simulate(top.build(), (0.0, 1.0))


def test_a_store_keeps_what_it_has(interrupt, tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "READERS", 0.0)
    whole = ts.simulate(top.build(), (0.0, 1.0), integrator="dop853")
    interrupt(4)
    given = {"integrator": "dop853", "store": tmp_path / "run.h5", "checkpoint": 0.0}
    check_part(ts.simulate(top.build(), (0.0, 1.0), **given), whole)
    interrupt(None)
    np.testing.assert_array_equal(ts.resume(tmp_path / "run.h5").q, whole.q)


def test_dense_output_is_read_again_after_an_interrupt(interrupt):
    solution = ts.simulate(top.build(), (0.0, 1.0), dense_output=True)
    before = solution.at(TIMES).q
    interrupt(1)
    with pytest.raises(KeyboardInterrupt):
        solution.at(TIMES)
    interrupt(None)
    np.testing.assert_array_equal(solution.at(TIMES).q, before)


def test_no_garbage_is_collected_while_a_scene_is_packed(monkeypatch):
    """A collection of the objects of many bodies takes longer than Ctrl-C may wait."""
    pack, seen = packed.pack_forces, []
    monkeypatch.setattr(packed, "pack_forces", lambda *given: seen.append(gc.isenabled()) or pack(*given))
    for look in (lambda scene: ts.simulate(scene, (0.0, 0.1)), ts.Scene.evaluate, ts.Scene.assemble, ts.Scene.mobility):
        look(top.build())
    assert seen == 4 * [False]
    assert gc.isenabled()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a process can't press its own Ctrl-C")
@pytest.mark.parametrize("method", ["taylor", "dop853", "sdirk54", "radau"])
def test_ctrl_c(method):
    """Pressed while a large scene makes a step."""
    scene = mechanisms.build(mechanisms.chain(1500))

    def progress(fraction):
        if fraction < 1.0 and not pressed:
            pressed.append(threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)))
            pressed[0].start()

    pressed, before = [], signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        solution = ts.simulate(scene, (0.0, 10.0), integrator=method, progress=progress)
    finally:
        signal.signal(signal.SIGINT, before)
    assert solution.status == ts.Status.INTERRUPTED
    assert solution.state.t == solution.t[-1]
    whole = ts.simulate(scene, (0.0, 10.0), integrator=method, max_steps=solution.stats.steps)
    np.testing.assert_array_equal(solution.q, whole.q)
