"""Arguments of calls that have plans: what changes in place is seen, and what is refused is refused later, too."""

import copy
import math
import warnings

import numpy as np
import pytest

import tsdyn as ts
from examples import door, driven_pivot, four_bar, top
from tests.helpers.calls import by_plan, same_run
from tsdyn.methods import integrator as methods

I = ts.integrators
SPAN = (0.0, 0.3)


@pytest.fixture
def scene():
    """A scene that the default call has a plan of, and one with outputs."""
    made = top.build()
    for _ in range(2):
        ts.simulate(made, SPAN)
        ts.simulate(made, SPAN, t_eval=np.linspace(*SPAN, 7))
    return made


def check(scene, *arguments, **options):
    """A call, twice, has the bits of one of a new scene; return what the second one does."""
    expected = ts.simulate(top.build(), *copy.deepcopy(arguments), **options)
    found = [ts.simulate(scene, *arguments, **options) for _ in range(2)]
    for each in found:
        same_run(each, expected)
        np.testing.assert_array_equal(np.signbit(each.t), np.signbit(expected.t))
    return found[1]


@pytest.mark.parametrize("kind", [list, np.array])
def test_times_that_are_changed_in_place(scene, kind):
    times, span = kind([0.0, 0.1, 0.3]), kind([0.0, 0.3])
    assert check(scene, span, t_eval=times).t[1] == 0.1
    times[1] = 0.2
    assert check(scene, span, t_eval=times).t[1] == 0.2
    span[1] = 0.4
    assert check(scene, span, t_eval=times).span == (0.0, 0.4)
    np.testing.assert_array_equal(check(scene, span, t_eval=times[:2]).t, [0.0, 0.2])
    inside = (np.array(0.0), 0.3)
    check(scene, inside)
    inside[0][...] = 0.1
    assert check(scene, inside).span == (0.1, 0.3)


def test_outputs_are_those_of_each_call(scene):
    for times in (None, (0.0, 0.3), [0.0, 0.3], (0, 0.3), np.array([0.0, 0.3]), np.linspace(0.0, 0.3, 7), (0.1,), None):
        check(scene, SPAN, t_eval=times)
    for span in ((0.0, 0.3), (0, 1), (-0.0, 0.3), (0.0, 0.3), (0.1, 0.3), [0.0, 0.3], (np.float64(0.0), 0.3)):
        found = check(scene, span)
        assert math.copysign(1.0, found.t[0]) == math.copysign(1.0, span[0])
        assert type(found.span[0]) is type(found.span[1]) is float


def test_a_method_is_told_by_its_numbers(scene):
    method = I.RK45(rtol=1e-5, atol=1e-5)
    first = check(scene, SPAN, integrator=method)
    same_run(by_plan(scene, SPAN, integrator=I.RK45(rtol=1e-5, atol=1e-5)), first)
    method.rtol = 1e-9
    assert check(scene, SPAN, integrator=method).stats.steps > first.stats.steps
    method.step = 1e-3
    assert check(scene, SPAN, integrator=method).stats.steps == 300
    assert ts.simulate(scene, SPAN, integrator=method).method == repr(method)


def test_a_name_stands_for_the_class_that_has_it_now(scene):
    loose = [ts.simulate(scene, SPAN, integrator="rk45").stats.steps for _ in range(2)][-1]

    class RK45(ts.ExplicitRungeKutta):
        order, tableau, margin = 5, I.RK45.tableau, 1e4

    try:
        assert ts.simulate(scene, SPAN, integrator="rk45").stats.steps > loose
    finally:
        methods._registry["rk45"] = I.RK45
    assert ts.simulate(scene, SPAN, integrator="rk45").stats.steps == loose


def test_a_state_is_told_by_its_numbers(scene):
    state = ts.simulate(scene, SPAN).state
    first = check(scene, (0.3, 0.5), state=state)
    same_run(by_plan(scene, (0.3, 0.5), state=copy.copy(state)), first)
    state.qd[0] += 0.25
    assert (check(scene, (0.3, 0.5), state=state).q[-1] != first.q[-1]).any()
    state.q[2] += 1.0
    for _ in range(2):
        with pytest.raises(ts.InconsistentState):
            ts.simulate(scene, (0.3, 0.5), state=state)
    with pytest.raises(ts.InvalidArgument, match="q must be 7 finite"):
        ts.simulate(scene, (0.3, 0.5), state=state._replace(q=state.q[:6]))
    with pytest.raises(ts.InvalidArgument, match="must have q and qd"):
        ts.simulate(scene, (0.3, 0.5), state=state.q)


@pytest.mark.parametrize("build", [door.build, four_bar.build])
def test_angles_of_a_state_are_its_own(build):
    """Two states that differ in the turns that joints have made."""
    scene = build()
    state = ts.simulate(scene, (0.0, 0.1)).state
    row = scene.constraints[0].name
    turned = ts.simulate(scene, (0.1, 0.2), state=state)
    anchor = state.anchor._replace(angles=state.anchor.angles + 2.0 * math.pi)
    other = state._replace()
    other.anchor = anchor
    for _ in range(2):
        found = ts.simulate(scene, (0.1, 0.2), state=other)
        np.testing.assert_allclose(found.angle(row)[-1] - turned.angle(row)[-1], 2.0 * math.pi, rtol=1e-12)
        same_run(ts.simulate(scene, (0.1, 0.2), state=state), turned)


def test_a_start_is_looked_at_again_at_another_time():
    """Of a scene whose constraints move."""
    scene = driven_pivot.build()
    for _ in range(2):
        ts.simulate(scene, SPAN)
    for _ in range(2):
        with pytest.raises(ts.InconsistentState):
            ts.simulate(scene, (0.1, 0.3))


WRONG = {
    "end before start": ((0.3, 0.0), {}),
    "not finite": ((0.0, math.inf), {}),
    "truth": ((False, True), {}),
    "three": ((0.0, 0.1, 0.3), {}),
    "outside": (SPAN, {"t_eval": (0.0, 0.4)}),
    "empty": (SPAN, {"t_eval": ()}),
    "empty list": (SPAN, {"t_eval": []}),
    "decreasing": (SPAN, {"t_eval": np.array([0.3, 0.0])}),
    "text": (SPAN, {"t_eval": "0 0.3"}),
    "one for True": (SPAN, {"dense_output": 0}),
    "True for one": (SPAN, {"max_steps": True}),
    "a list": (SPAN, {"rtol": [1e-8]}),
    "negative": (SPAN, {"initial_tol": -1e-9}),
    "both": (SPAN, {"integrator": I.DOP853(), "rtol": 1e-8}),
    "no form": (SPAN, {"formulation": "tangents"}),
    "no method": (SPAN, {"integrator": "rk54"}),
    "no argument": (SPAN, {"rtoll": 1e-8}),
    "too small a step": ((0.0, 1e20), {"integrator": I.Nystrom4(1e-3)}),
}


@pytest.mark.parametrize(("span", "options"), WRONG.values(), ids=WRONG)
def test_what_is_refused_at_first_is_refused_later(scene, span, options):
    if isinstance(options.get("integrator"), ts.Integrator):
        for _ in range(2):
            ts.simulate(scene, SPAN, integrator=options["integrator"])
    with pytest.raises(ts.TsdynError) as first:
        ts.simulate(top.build(), span, **options)
    for _ in range(2):
        with pytest.raises(type(first.value)) as later:
            ts.simulate(scene, span, **options)
        assert str(later.value) == str(first.value)


def test_wrong_calls_say_what_is_wrong(scene):
    for wrong in (lambda: ts.simulate(scene), lambda: ts.simulate(scene, SPAN, 1e-8), lambda: ts.simulate(None, SPAN)):
        with pytest.raises((ts.InvalidCall, ts.InvalidArgument)):
            wrong()
    for wrong in ({}, {"t_span": SPAN, "integrator": "rk45", "rtoll": 1.0}):
        with pytest.raises(ts.InvalidCall):
            ts.simulate(scene, **wrong)
    with pytest.raises(ts.InvalidCall):
        ts.simulate(scene, SPAN, t_span=SPAN)
    same_run(by_plan(scene, t_span=SPAN), by_plan(scene, SPAN))
    same_run(ts.simulate(scene=scene, t_span=SPAN), ts.simulate(scene, SPAN))


def test_a_warning_is_given_at_the_call(scene):
    ts.forces.Spring(scene.body("top"), scene.ground, point_b=(0, 0, 5), stiffness=1.0)
    with pytest.warns(UserWarning, match="never added") as caught:
        ts.simulate(scene, SPAN)
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        by_plan(scene, SPAN)
