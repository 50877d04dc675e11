"""Which kernels a first run asks for: all that it needs and no more; signatures, refusals, the order."""

import subprocess
import sys
from pathlib import Path

import pytest

import tsdyn as ts
from examples import top
from tests.helpers.processes import python
from tsdyn import ahead
from tsdyn.configuration.initial_conditions import evaluate_start
from tsdyn.jit.compiled import _types
from tsdyn.runs.run_memory import advance_run
from tsdyn.taylor.step_parts import pass_singular
from tsdyn.taylor.stepper import advance_series

ROOT = Path(__file__).parents[2]


class Height(ts.Primitive):
    """A plug-in."""

    rows = 1
    markers = (ts.Point("a"),)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = x[2]

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = 1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 0.0


def test_plug_ins_are_left_to_this_process():
    for kernel in Height.kernels.values():
        assert ahead.name_of(kernel) == ""
    scene = ts.Scene()
    load_ = scene.add(ts.forces.UserForce(scene.add_point_mass(1.0), function=lambda t, a, b, par, out: None))
    ours = {"series", "check"}  # of the program that the function is traced to
    assert {ahead.name_of(kernel) for name, kernel in load_.kernels.items() if name not in ours} == {""}


def test_every_kernel_of_the_package_is_found_by_its_name():
    kernels = list(ahead._all())
    assert len(kernels) > 150
    timers = "tsdyn.measuring"  # made as they are needed
    nameless = [kernel.py_func for kernel in kernels if not ahead.name_of(kernel)]
    assert [function.__qualname__ for function in nameless if not function.__module__.startswith(timers)] == []
    assert {*ahead._default()} <= {*kernels}


def test_longest_first():
    names = ahead.weight(advance_series.py_func), ahead.weight(evaluate_start.py_func)
    small = [ahead.weight(kernel.py_func) for kernel in ts.constraints.EulerNormalization.kernels.values()]
    assert min(names) > max(small)


RUN = """
import importlib, sys
import tsdyn as ts
from tsdyn import ahead
asked = set()
ahead.compile_ahead = asked.update
name, method, form, times = sys.argv[1:]
scene = importlib.import_module(f"examples.{name}").build()
times = [0.0, 0.005, 0.01] if times else None
ts.simulate(scene, (0.0, 0.01), integrator=method or None, formulation=form, t_eval=times)
from tsdyn import ahead
from tsdyn.jit.compiled import is_loaded
label = lambda kernel: kernel.py_func.__module__ + ":" + kernel.py_func.__qualname__
used = {kernel for kernel in ahead._all() if is_loaded(kernel)}
print(sorted(map(label, used - asked)), sorted(map(label, {kernel for kernel in asked if not is_loaded(kernel)})))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method", "form", "times"),
    [
        ("top", "", "tangent", ""),
        ("top", "", "tangent", "within"),
        ("top", "dop853", "tangent", "within"),
        ("slider_crank", "", "tangent", ""),
    ],
)
def test_what_a_run_needs_is_asked_for_and_no_more(tmp_path, name, method, form, times):
    command = [sys.executable, "-c", RUN, name, method, form, times]
    result = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=600)
    assert result.stdout.strip() == "[] []", result.stderr


def test_signatures_are_those_of_the_calls():
    ts.simulate(top.build(), (0.0, 0.01))
    ts.simulate(top.build(), (0.0, 0.01), integrator="dop853")
    for kernel in (evaluate_start, advance_run):
        assert list(kernel.overloads) == [_types(kernel)]


def test_a_prepared_scene_asks_for_nothing(monkeypatch):
    scene = top.build()
    ts.simulate(scene, (0.0, 0.01))
    monkeypatch.setattr(ahead, "compile_ahead", lambda kernels: pytest.fail("asked again"))
    ts.simulate(scene, (0.0, 0.01))


def test_wrong_arguments_are_refused_before_anything_is_compiled(monkeypatch):
    monkeypatch.setattr(ahead, "compile_ahead", lambda kernels: pytest.fail("compiled"))
    for wrong in ({"rtol": -1.0}, {"max_step": 0.0}, {"integrator": "euler"}, {"t_eval": []}, {"history": 2}):
        with pytest.raises(ts.TsdynError):
            ts.simulate(top.build(), (0.0, 1.0), **wrong)
    with pytest.raises(ts.InvalidBody):
        ts.simulate(ts.Scene(), (0.0, 1.0))


@pytest.mark.slow
def test_first_run_leaves_nothing_to_its_own_process(tmp_path):
    code = """
import tsdyn
from tsdyn import ahead
from tsdyn.jit import cache
from examples import top
ahead.processors = lambda: 2
end = tsdyn.simulate(top.build(), (0.0, 0.1)).q[-1]
print(cache.statistics["misses"], end.tobytes().hex())
"""
    out, _ = python("-c", code, folder=tmp_path, TSDYN_QUIET="1")
    expected = ts.simulate(top.build(), (0.0, 0.1)).q[-1]
    assert out == f"0 {expected.tobytes().hex()}"


def fall(count):
    """Balls that fall on a plane."""
    scene = ts.Scene(gravity=(0, 0, -10))
    for i in range(count):
        ball = scene.add_point_mass(mass=1.0, position=(i, 0, 0.2 + 0.1 * i))
        scene.add(ts.constraints.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True))
    return ts.simulate(scene, (0, 0.5))


def test_what_events_need_of_the_method_is_asked_for_at_once(monkeypatch):
    asked = []
    monkeypatch.setattr(ahead, "_known", {})
    monkeypatch.setattr(ahead, "compile_ahead", lambda kernels: asked.append({*kernels}))
    fall(1)
    assert {advance_series, pass_singular} <= asked[0]
    added = set().union(*asked[1:]) - asked[0]
    assert added == {*ahead.of_constraint(ts.constraints.PlaneContact, False)}


def test_kernels_of_phases_are_looked_up_once(monkeypatch):
    """Sets of closed contacts add rows of classes that are known: another scene's phases look for nothing."""
    fall(1)
    monkeypatch.setattr(ahead, "kernels_of", lambda *given: pytest.fail("looked up again"))
    assert len(fall(3).phases) == 4
