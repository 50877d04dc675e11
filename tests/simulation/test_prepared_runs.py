"""`ts.prepare`, and repeated calls of `simulate`: the bits of a first call, and what may change between two calls."""

import copy
import dataclasses
import gc
import inspect
import math
import pickle
import threading
import warnings
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import jointed
from examples import door, driven_pivot, four_bar, top
from tests.helpers.calls import same_run
from tsdyn.methods import integrator as methods
from tsdyn.runs import driver as slices
from tsdyn.runs.run_memory import Memory
from tsdyn.runs.step_engine import StepMemory
from tsdyn.simulation.run_options import CHECKS, OF_CALL, OF_RUN, OPTIONS, RunCall
from tsdyn.taylor.series_engine import SeriesMemory

I = ts.integrators
SPAN = (0.0, 0.3)
WAYS = {
    "default": {},
    "tight": {"rtol": 1e-11, "atol": 1e-11},
    "outputs": {"t_eval": (0.0, 0.3)},
    "more outputs": {"t_eval": np.linspace(0.0, 0.3, 17)},
    "dop853": {"integrator": I.DOP853(1e-8, 1e-8)},
    "rk45 by name": {"integrator": "rk45", "rtol": 1e-7},
    "fixed": {"integrator": I.Nystrom4(2e-3)},
    "null-space": {"integrator": I.DOP853(1e-8, 1e-8), "formulation": "null-space"},
    "maggi-kane": {"integrator": "rk45", "formulation": "maggi-kane"},
    "sdirk54": {"integrator": I.SDIRK54(1e-6, 1e-6)},
    "short steps": {"max_step": 0.01},
    "without history": {"history": False},
    "charts": {"chart_interval": 1},
    "dense output": {"dense_output": True},
    "dense output of stages": {"integrator": I.DOP853(1e-8, 1e-8), "dense_output": True, "t_eval": (0.0, 0.1)},
    "events": {"events": lambda t, state: t - 0.1},
}
SCENES = {"top": top.build, "driven": driven_pivot.build, "redundant": door.build}


def split(way):
    """The options of a Run, and those of its calls."""
    given = WAYS[way]
    return {n: v for n, v in given.items() if n in OF_RUN}, {n: v for n, v in given.items() if n in OF_CALL}


@pytest.mark.slow_for("*sdirk54", "*null-space", "*maggi-kane")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_every_call_has_the_bits_of_a_first_one(make, way):
    first, (options, of_call) = ts.simulate(make(), SPAN, **WAYS[way]), split(way)
    scene, run = make(), ts.prepare(make(), **options)
    for _ in range(3):
        same_run(run(SPAN, **of_call), first)
        same_run(ts.simulate(scene, SPAN, **WAYS[way]), first)
    state = first.state
    expected = ts.simulate(make(), (0.3, 0.4), state=state, **options)
    for _ in range(2):
        same_run(run((0.3, 0.4), state=state), expected)
    same_run(run(SPAN, **of_call), first)


def test_signatures_are_those_of_the_options():
    """Names, defaults and annotations; and every option has a check and an entry in the docstrings."""
    annotations = {f.name: f.type for kind in (ts.RunOptions, RunCall) for f in dataclasses.fields(kind)}
    for function, known in ((ts.simulate, OPTIONS), (ts.prepare, OF_RUN), (ts.Run.__call__, OF_CALL)):
        found = inspect.signature(function).parameters
        given = {name: p for name, p in found.items() if p.kind is p.KEYWORD_ONLY}
        assert {name: p.default for name, p in given.items()} == known
        assert {name: p.annotation for name, p in given.items()} == {name: annotations[name] for name in known}
        for name in known:
            assert (
                f"{name} :" in function.__doc__ or f"{name}, " in function.__doc__ or f", {name} :" in function.__doc__
            )
    assert CHECKS.keys() == OF_RUN.keys()
    assert {"t_span", *OF_CALL} == {f.name for f in dataclasses.fields(RunCall)}


def test_options_are_frozen_and_equal_by_value():
    options = ts.prepare(top.build(), rtol=1e-9, events=[lambda t, state: t]).options
    assert (options.rtol, options.atol, options.formulation, options.dense_output) == (1e-9, None, "tangent", False)
    with pytest.raises(dataclasses.FrozenInstanceError):
        options.rtol = 1e-6
    assert dataclasses.replace(options, rtol=1e-8) != options
    assert dataclasses.replace(options, rtol=np.float64(1e-9)) == options
    method = I.RK45(1e-6)
    one = ts.RunOptions(integrator=method)
    assert one == ts.RunOptions(integrator=I.RK45(1e-6))
    method.rtol = 1e-9  # what the options were made of may change, they don't
    assert (one.method.rtol, one.integrator.rtol) == (1e-6, 1e-6)
    assert one != ts.RunOptions(integrator=method)
    assert repr(ts.RunOptions(rtol=1e-10, max_steps=5)) == "RunOptions(rtol=1e-10, max_steps=5)"


def test_a_run_says_what_it_will_do():
    """The tolerances that steps are held to: those of the run over the safety factor of the method, 30 by default."""
    said = str(ts.prepare(top.build(), integrator=I.RK45(3e-7, 6e-9)))
    assert "RK45(rtol=3e-07, atol=6e-09): as asked" in said
    assert f"rtol={3e-7 / I.RK45.safety:.2g}, atol={6e-9 / I.RK45.safety:.2g}" in said
    said = str(ts.prepare(top.build(), formulation="tangent", constraint_tol=1e-11))
    assert "Taylor(rtol=1e-08, atol=1e-08): every constraint and force has a series" in said
    assert "|Phi| to 1e-11 m" in said
    assert "advance_series" in said
    said = ts.prepare(top.build(), integrator=I.Nystrom4(2e-3), formulation="null-space")._repr_html_()
    assert "fixed steps of 0.002 s" in said
    assert "null-space" in said


EDITS = {
    "mass": lambda scene: setattr(scene.body("top"), "mass", 31.0),
    "gravity": lambda scene: setattr(scene, "gravity", (0.0, 0.5, -9.6)),
    "position": lambda scene: setattr(scene.body("top"), "position", (0.5, 0.0, 1.0)),
    "inertia": lambda scene: setattr(scene.body("top"), "inertia", (91.0, 89.0, 31.0)),
    "velocity": lambda scene: setattr(scene.body("top"), "velocity", (0.2, -0.1, 0.0)),
    "spin": lambda scene: setattr(scene.body("top"), "angular_velocity", (0.5, 0.0, 11.0)),
    "name": lambda scene: setattr(scene.body("top"), "name", "spinner"),
    "body": lambda scene: scene.add_point_mass(1.0, name="stone"),
    "no constraint": lambda scene: scene.remove("tip"),
    "force": lambda scene: scene.add(ts.forces.PointForce(scene.body("top"), force=(0.0, 1.0, 0.0))),
}


@pytest.mark.parametrize("way", ["default", "outputs", "fixed"])
@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_of_the_scene(edit, way):
    """`simulate` takes the scene as it is; a Run, which belongs to the scene as it was, is refused."""
    scene, other, (options, of_call) = top.build(), top.build(), split(way)
    run = ts.prepare(scene, **options)
    before = [ts.simulate(scene, SPAN, **WAYS[way]) for _ in range(2)][-1]
    same_run(run(SPAN, **of_call), before)
    for each in (scene, other):
        EDITS[edit](each)
    for _ in range(2):
        with pytest.raises(ts.InvalidArgument, match="has changed since it was prepared"):
            run(SPAN, **of_call)
        found = ts.simulate(scene, SPAN, **WAYS[way])
        same_run(found, ts.simulate(other, SPAN, **WAYS[way]))
        same_run(ts.prepare(scene, **options)(SPAN, **of_call), found)
    assert edit == "name" or found.q.shape != before.q.shape or (found.q[-1] != before.q[-1]).any()


def test_runs_of_other_parameters():
    run, built = ts.prepare(top.build(), rtol=1e-9), top.build()
    built.body("top").mass = 31.0
    first, other = run(SPAN), run.with_parameters({"top.mass": 31.0})
    for _ in range(2):
        same_run(other(SPAN), ts.simulate(built, SPAN, rtol=1e-9))
        same_run(run(SPAN), first)
    assert other.options == run.options
    assert other.scene is not run.scene
    with pytest.raises(ts.TsdynError):
        run.with_parameters({"top.maas": 31.0})


PUSH = 1.0


def test_a_function_whose_globals_have_changed(monkeypatch):
    def push(t):
        return (PUSH, 0.0, 0.0)

    def build():
        scene = top.build()
        scene.add(ts.forces.PointForce(scene.body("top"), force=push))
        return scene

    scene = build()
    run = ts.prepare(scene)
    before = [ts.simulate(scene, SPAN) for _ in range(2)][-1]
    same_run(run(SPAN), before)
    monkeypatch.setitem(globals(), "PUSH", 20.0)
    with pytest.raises(ts.InvalidArgument, match="has changed"):
        run(SPAN)
    found = ts.simulate(scene, SPAN)
    same_run(found, ts.simulate(build(), SPAN))
    assert abs(found.q[-1, 0] - before.q[-1, 0]) > 1e-3


@pytest.mark.parametrize("kind", [list, np.array])
def test_times_that_are_changed_in_place(kind):
    scene, run = top.build(), ts.prepare(top.build())
    times, span = kind([0.0, 0.1, 0.3]), kind([0.0, 0.3])
    inside = (np.array(0.0), 0.3)
    for change in (lambda: None, lambda: times.__setitem__(1, 0.2), lambda: inside[0].__setitem__((), 0.1)):
        change()
        for given in (span, inside):
            t_eval = [float(given[0]), 0.25] if given is inside else times
            expected = ts.simulate(top.build(), copy.deepcopy(given), t_eval=copy.deepcopy(t_eval))
            for _ in range(2):
                same_run(run(given, t_eval=t_eval), expected)
                same_run(ts.simulate(scene, given, t_eval=t_eval), expected)
    assert expected.span == (0.1, 0.3)


def test_outputs_are_those_of_each_call():
    run = ts.prepare(top.build())
    for times in (None, (0.0, 0.3), [0.0, 0.3], (0, 0.3), np.array([0.0, 0.3]), (0.1,), None):
        same_run(run(SPAN, t_eval=times), ts.simulate(top.build(), SPAN, t_eval=times))
    for span in ((0.0, 0.3), (0, 1), (-0.0, 0.3), (0.0, 0.3), (0.1, 0.3), [0.0, 0.3], (np.float64(0.0), 0.3)):
        found = run(span)
        same_run(found, ts.simulate(top.build(), span))
        assert math.copysign(1.0, found.t[0]) == math.copysign(1.0, span[0])
        assert type(found.span[0]) is type(found.span[1]) is float


def test_a_name_stands_for_the_class_that_has_it_now():
    scene = top.build()
    run = ts.prepare(scene, integrator="rk45")
    loose = [ts.simulate(scene, SPAN, integrator="rk45").stats.steps for _ in range(2)][-1]

    class RK45(ts.ExplicitRungeKutta):
        order, tableau, margin = 5, I.RK45.tableau, 1e4

    try:
        assert ts.simulate(scene, SPAN, integrator="rk45").stats.steps > loose
        assert run(SPAN).stats.steps == loose
    finally:
        methods._registry["rk45"] = I.RK45
    assert ts.simulate(scene, SPAN, integrator="rk45").stats.steps == loose


def test_an_event_whose_attributes_have_changed():
    def event(t, state):
        return t - 0.1

    run, scene = ts.prepare(top.build(), events=event), top.build()
    assert run(SPAN).reached == ts.simulate(scene, SPAN, events=event).reached == 0.3
    event.terminal = True
    assert abs(run(SPAN).reached - 0.1) < 1e-12
    assert abs(ts.simulate(scene, SPAN, events=event).reached - 0.1) < 1e-12


def test_a_state_is_told_by_its_numbers():
    run = ts.prepare(top.build())
    state = run(SPAN).state
    first = run((0.3, 0.5), state=state)
    span = (0.3, 0.5)
    for given in (state, state, copy.copy(state), state, state, state):
        same_run(run(span, state=given), first)
    state.qd[0] += 0.25
    found = run(span, state=state)
    same_run(found, ts.simulate(top.build(), span, state=state))
    assert (found.q[-1] != first.q[-1]).any()
    state.q[2] += 1.0
    for _ in range(2):
        with pytest.raises(ts.InconsistentState):
            run((0.3, 0.5), state=state)
    with pytest.raises(ts.InvalidArgument, match="q must be 7 finite"):
        run((0.3, 0.5), state=state._replace(q=state.q[:6]))
    with pytest.raises(ts.InvalidArgument, match="must have q and qd"):
        run((0.3, 0.5), state=state.q)


@pytest.mark.parametrize("build", [door.build, four_bar.build])
def test_angles_of_a_state_are_its_own(build):
    """Two states that differ in the turns that joints have made."""
    scene = build()
    run = ts.prepare(scene)
    state, row = run((0.0, 0.1)).state, scene.constraints[0].name
    turned = run((0.1, 0.2), state=state)
    other = state._replace()
    other.anchor = state.anchor._replace(angles=state.anchor.angles + 2.0 * math.pi)
    for _ in range(2):
        found = run((0.1, 0.2), state=other)
        np.testing.assert_allclose(found.angle(row)[-1] - turned.angle(row)[-1], 2.0 * math.pi, rtol=1e-12)
        same_run(run((0.1, 0.2), state=state), turned)


def test_a_start_is_looked_at_again_at_another_time():
    """Of a scene whose constraints move."""
    run = ts.prepare(driven_pivot.build())
    first = [run(SPAN) for _ in range(2)][-1]
    for _ in range(2):
        with pytest.raises(ts.InconsistentState):
            run((0.1, 0.3))
    same_run(run(SPAN), first)


WRONG = {
    "end before start": ((0.3, 0.0), {}),
    "not finite": ((0.0, math.inf), {}),
    "truth": ((False, True), {}),
    "outside": (SPAN, {"t_eval": (0.0, 0.4)}),
    "empty": (SPAN, {"t_eval": ()}),
    "decreasing": (SPAN, {"t_eval": np.array([0.3, 0.0])}),
    "text": (SPAN, {"t_eval": "0 0.3"}),
    "one for True": (SPAN, {"dense_output": 0}),
    "True for one": (SPAN, {"max_steps": True}),
    "a list": (SPAN, {"rtol": [1e-8]}),
    "not a number": (SPAN, {"atol": math.nan}),
    "negative": (SPAN, {"initial_tol": -1e-9}),
    "both": (SPAN, {"integrator": I.DOP853(), "rtol": 1e-8}),
    "no form": (SPAN, {"formulation": "tangents"}),
    "no method": (SPAN, {"integrator": "rk54"}),
    "no argument": (SPAN, {"rtoll": 1e-8}),
    "too small a step": ((0.0, 1e20), {"integrator": I.Nystrom4(1e-3)}),
}


@pytest.mark.parametrize(("span", "options"), WRONG.values(), ids=WRONG)
def test_what_is_refused_at_first_is_refused_later(span, options):
    scene = top.build()
    ts.simulate(scene, SPAN)
    with pytest.raises(ts.TsdynError) as first:
        ts.simulate(top.build(), span, **options)
    of_call = {name: value for name, value in options.items() if name in OF_CALL}
    for _ in range(2):
        with pytest.raises(type(first.value)) as later:
            ts.simulate(scene, span, **options)
        assert str(later.value) == str(first.value)
        with pytest.raises(type(first.value)) as prepared:
            ts.prepare(scene, **{n: v for n, v in options.items() if n not in of_call})(span, **of_call)
        assert (
            str(prepared.value).split(" It has ")[0]
            == str(first.value).replace("simulate", "prepare").split(" It has ")[0]
        )


def test_wrong_calls_say_what_is_wrong():
    run = ts.prepare(top.build())
    for wrong in (run, lambda: run(SPAN, 1e-8), lambda: run(SPAN, rtol=1e-8), lambda: run(SPAN, t_span=SPAN)):
        with pytest.raises(ts.InvalidCall):
            wrong()
    with pytest.raises(ts.InvalidCall, match=r"given to ts\.prepare"):
        run(SPAN, rtol=1e-8)
    with pytest.raises(ts.InvalidCall, match=r"did you mean t_eval\?"):
        run(SPAN, t_evl=(0.1,))
    with pytest.raises(ts.InvalidCall, match=r"given to the call, run\(t_span"):
        ts.prepare(top.build(), t_eval=(0.1,))
    with pytest.raises(ts.InvalidArgument, match=r"must be a ts\.Scene"):
        ts.prepare(None)
    with pytest.raises(ts.InvalidArgument, match="options must be a RunOptions"):
        ts.Run(top.build(), {"rtol": 1e-9})
    with pytest.raises(ts.InvalidArgument, match="checkpoint needs a store"):
        run(SPAN, checkpoint=1.0)
    with pytest.raises(ts.InvalidArgument, match="solves its stages all at once"):
        ts.prepare(top.build(), integrator="radau", formulation="null-space")


@pytest.mark.parametrize("call", [ts.simulate, lambda scene, span: ts.prepare(scene)(span)])
def test_a_warning_is_given_at_the_call(call):
    scene = top.build()
    ts.forces.Spring(scene.body("top"), scene.ground, point_b=(0, 0, 5), stiffness=1.0)
    with pytest.warns(UserWarning, match="never added") as caught:
        call(scene, SPAN)
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ts.simulate(scene, SPAN)


@pytest.mark.slow
def test_stores_and_progress(tmp_path):
    """A prepared run streams, and goes on from its checkpoint, to the bit."""
    run, heard = ts.prepare(top.build(), rtol=1e-9), []
    first = run((0.0, 3.0), t_eval=np.linspace(0.0, 3.0, 31))
    found = run(
        (0.0, 3.0), t_eval=np.linspace(0.0, 3.0, 31), store=tmp_path / "run.h5", checkpoint=0.0, progress=heard.append
    )
    np.testing.assert_array_equal(found.q, first.q)
    np.testing.assert_array_equal(ts.resume(tmp_path / "run.h5").q, first.q)
    assert heard
    with pytest.raises(ts.InvalidArgument, match="no interpolants"):
        ts.prepare(top.build(), dense_output=True)((0.0, 1.0), store=tmp_path / "other.h5")


@pytest.fixture
def short(monkeypatch):
    """Slices of two steps, so that runs are longer than the first."""
    monkeypatch.setattr(slices, "FIRST_SLICE", 2)


@pytest.mark.parametrize("way", ["default", "outputs", "more outputs", "dop853", "fixed", "dense output"])
def test_a_run_that_is_longer_than_its_first_slice(way, short, monkeypatch):
    options, of_call = split(way)
    run = ts.prepare(top.build(), **options)
    found = [run(SPAN, **of_call), run((0.0, 2e-3)), run(SPAN, **of_call), run(SPAN, **of_call)]
    monkeypatch.setattr(slices, "FIRST_SLICE", 1024)
    expected = ts.simulate(top.build(), SPAN, **WAYS[way])
    for each in (found[0], *found[2:]):
        same_run(each, expected)
    same_run(found[1], ts.simulate(top.build(), (0.0, 2e-3), **options))


def test_a_run_that_ends_early():
    run = ts.prepare(top.build(), max_steps=5)
    run(SPAN)
    found = run((0.0, 3.0))
    same_run(found, ts.simulate(top.build(), (0.0, 3.0), max_steps=5))
    assert (found.status, found.stats.steps) == (ts.Status.MAX_STEPS, 5)
    assert "5 steps" in found.message


@pytest.mark.slow
def test_a_run_that_turns_to_the_implicit_method():
    run = ts.prepare(jointed(), rtol=1e-7, atol=1e-7)
    first = ts.simulate(jointed(), (0.0, 0.3), rtol=1e-7, atol=1e-7)
    for _ in range(2):
        run((0.0, 1e-4))
        found = run((0.0, 0.3))
        assert "took over" in found.message
        same_run(found, first)
    assert " and " in found.method
    assert found[1:].method == found.method


@pytest.mark.parametrize("memory", [SeriesMemory, StepMemory])
@pytest.mark.parametrize("late", [False, True])
def test_interrupt(memory, late, short, monkeypatch):
    """Ctrl-C arrives while the compiled driver runs, in its first slice; late: in the one that ends the run."""
    run = ts.prepare(top.build(), integrator=I.Taylor(1e-8) if memory is SeriesMemory else I.RK45(1e-6))
    whole = [run((0.0, 1e-3)) for _ in range(2)][-1]
    driver = memory.advance_kernel

    def interrupted(*arguments):
        driver(*arguments)
        raise KeyboardInterrupt

    interrupted.overloads = True
    with monkeypatch.context() as patched:
        patched.setattr(memory, "advance_kernel", staticmethod(interrupted))
        found = run((0.0, 1e-3 if late else 0.3))
    if late:
        same_run(found, whole)
    else:
        assert (found.status, found.success) == (ts.Status.INTERRUPTED, False)
        assert found.stats.steps == 2
        assert found.state.t == found.t[-1]
    same_run(run((0.0, 1e-3)), whole)


def test_interrupt_before_the_first_step(monkeypatch):
    run = ts.prepare(top.build())
    expected = run(SPAN)

    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(SeriesMemory, "advance", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run(SPAN)
    same_run(run(SPAN), expected)


def test_threads_that_call_one_run():
    """More of them than a scene keeps memories, by several runs, starts and intervals."""
    ways = ("default", "more outputs", "dop853", "fixed", "dense output")
    scene = top.build()
    runs, state = {way: ts.prepare(scene, **split(way)[0]) for way in ways}, ts.simulate(scene, SPAN).state
    jobs = [(way, start, end) for way in ways for start in (None, state) for end in (0.1, 0.3)] * 4

    def solve(run, way, start, end):
        return run((0.0, end), state=start, t_eval=None if end < 0.3 else split(way)[1].get("t_eval"))

    expected = {(way, end, start is None): solve(ts.prepare(top.build(), **split(way)[0]), way, start, end)
                for way, start, end in jobs[: len(jobs) // 4]}  # fmt: skip
    with ThreadPoolExecutor(12) as pool:
        for (way, start, end), found in zip(jobs, pool.map(lambda job: solve(runs[job[0]], *job), jobs), strict=True):
            same_run(found, expected[way, end, start is None])


def test_threads_that_prepare_a_scene_at_once():
    """What they find is shared: none of their runs belongs to another state of the scene."""
    expected = ts.simulate(top.build(), SPAN)
    for _ in range(10):
        scene, together = top.build(), threading.Barrier(6)

        def work(_, scene=scene, together=together):
            together.wait()
            return ts.prepare(scene)

        with ThreadPoolExecutor(6) as pool:
            runs = list(pool.map(work, range(6)))
        for run in runs:
            same_run(run(SPAN), expected)


def test_solutions_are_of_their_own():
    """Arrays of one are not those of another, nor of the memory; each survives pickling, and so does a Run."""
    scene, expected = top.build(), ts.simulate(top.build(), SPAN)
    run = ts.prepare(scene)
    found = [run(SPAN) for _ in range(4)]
    for array in (found[1].t, found[1].q, *found[1].state[1:], *found[1].steps[:2], found[1].charts.t):
        array[...] = np.nan
    again = pickle.loads(pickle.dumps(run))
    scene.body("top").mass = 1.0
    for each in (found[2], pickle.loads(pickle.dumps(found[3])), again(SPAN)):
        same_run(each, expected)
    assert again.options == run.options


def test_memories_of_runs_that_take_turns(monkeypatch):
    """Each keeps one that is laid out for it; never more than a scene keeps."""
    scene, laid_out = top.build(), []
    runs = [ts.prepare(scene, rtol=rtol) for rtol in 1e-8 * np.arange(1, 6)]
    expected = [run(SPAN) for run in runs]
    for run in runs * 8:
        run(SPAN)
    lay_out = Memory._lay_out
    monkeypatch.setattr(Memory, "_lay_out", lambda *given: laid_out.append(given) or lay_out(*given))
    for run, each in zip(runs, expected, strict=True):
        same_run(run(SPAN), each)
    assert not laid_out


@pytest.mark.usefixtures("few_objects")
def test_what_a_scene_keeps_of_calls():
    """The last few runs, and nothing that was given to them."""
    scene = top.build()
    for k in range(30):
        ts.simulate(scene, SPAN, rtol=1e-8 * (1 + k))
    assert len(scene._prepared.runs) == 8
    method, times = I.RK45(1e-6), np.linspace(*SPAN, 7)
    solution = [ts.simulate(scene, SPAN, integrator=method, t_eval=times) for _ in range(2)][-1]
    gone = [weakref.ref(each) for each in (method, times, solution, scene)]
    del method, times, solution
    gc.collect()
    assert [each() is None for each in gone] == [True, True, True, False]
    del scene
    gc.collect()
    assert gone[3]() is None
