"""Readers of steps serve time and again: none of what one has read before shows in what it reads next."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from examples import door, driven_pivot, top
from tests.helpers.calls import same_run
from tsdyn.runs.dense_output import Reader

I = ts.integrators
SPAN = (0.0, 0.5)
METHODS = {
    "default": {},
    "dop853": {"integrator": I.DOP853(1e-8, 1e-8)},
    "null-space": {"integrator": I.DOP853(1e-8, 1e-8), "formulation": "null-space"},
    "sdirk54": {"integrator": I.SDIRK54(1e-6, 1e-6)},
}


@pytest.mark.slow_for("*null-space", "*sdirk54")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("make", [top.build, driven_pivot.build, door.build], ids=["top", "driven", "door"])
def test_what_is_read_does_not_depend_on_what_was_read_before(make, options, rng, monkeypatch):
    scene = make()
    dense = [ts.simulate(scene, (0.0, end), dense_output=True, **options) for end in (0.3, 0.5)]
    first = dense[0].at(0.1)
    fresh = [pickle.loads(pickle.dumps(solution)) for solution in dense]  # with a reader of their own
    made = []
    monkeypatch.setattr(Reader, "__init__", lambda self, *a, init=Reader.__init__: made.append(self) or init(self, *a))
    times = rng.uniform(0.0, 0.3, 4)
    found = [[solution.at(t) for solution in dense] for t in times]
    assert not made
    for t, states in zip(times, found, strict=True):
        for state, solution in zip(states, fresh, strict=True):
            for a, b in zip(state, pickle.loads(pickle.dumps(solution)).at(t), strict=True):
                np.testing.assert_array_equal(a, b)
    for a, b in zip(first, dense[0].at(0.1), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("options", [METHODS["default"], METHODS["dop853"]], ids=["default", "dop853"])
def test_events_are_those_of_a_first_run(options):
    def level(t, state):
        return state.q[2] - 0.99

    scene, times = top.build(), np.linspace(*SPAN, 7)
    expected = ts.simulate(top.build(), SPAN, events=level, dense_output=True, **options)
    for _ in range(3):
        found = ts.simulate(scene, SPAN, events=level, dense_output=True, **options)
        same_run(found, expected)
        found.at(times)
        np.testing.assert_array_equal(found.t_events[0], expected.t_events[0])
        np.testing.assert_array_equal(found.q_events[0], expected.q_events[0])
    assert found.t_events[0].size
    scene.body("top").mass = 20.0
    other = top.build()
    other.body("top").mass = 20.0
    same_run(
        ts.simulate(scene, SPAN, events=level, dense_output=True, **options),
        ts.simulate(other, SPAN, events=level, dense_output=True, **options),
    )


def test_threads():
    solution = ts.simulate(top.build(), SPAN, dense_output=True)
    times = np.linspace(*SPAN, 64)
    expected = [solution.at(t).q for t in times]
    with ThreadPoolExecutor(8) as pool:
        for a, b in zip(pool.map(lambda t: solution.at(t).q, times), expected, strict=True):
            np.testing.assert_array_equal(a, b)
