"""Events: by SciPy's rules, at the times of closed forms, and without changing a step."""

from itertools import product

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_forms import LENGTH, compound_pendulum, heavy_top, point_pendulum
from tests.helpers.tolerances import EPS, EXACT, NEAR, ROUNDING, TIGHT
from tsdyn.observables.diagnostics import constraint_error

I = ts.integrators
END = 3.0  # s
REFERENCE = I.DOP853(1e-13, 1e-13)
FORMS = ("tangent", "maggi-kane")


def event(function, **attributes):
    for name, value in attributes.items():
        setattr(function, name, value)
    return function


def lowest(**attributes):
    return event(lambda t, state: state.q[0], **attributes)


def at_time(*times, **attributes):
    """Zero, and of changing sign, at each of these times."""
    return event(lambda t, state: float(np.prod([t - each for each in times])), **attributes)


def run(events, method=None, scene=None, span=(0.0, END), **options):
    scene = scene or point_pendulum()[0]
    return ts.simulate(scene, span, integrator=method or I.DOP853(1e-9, 1e-9), events=events, **options)


# times


@pytest.mark.parametrize("make", [point_pendulum, compound_pendulum])
def test_a_pendulum_passes_its_lowest_point(make):
    scene, quarter = make()
    solution = run(
        [lowest(), lowest(direction=1), lowest(direction=-1)], REFERENCE, scene, (0.0, 10.0)
    ).raise_if_failed()
    both, rising, falling = solution.t_events
    np.testing.assert_allclose(both, (2 * np.arange(both.size) + 1) * quarter, rtol=0, atol=TIGHT)
    assert both[-1] + 2 * quarter > 10.0
    np.testing.assert_array_equal(falling, both[0::2])
    np.testing.assert_array_equal(rising, both[1::2])
    q, qd = solution.q_events[0], solution.qd_events[0]
    assert np.abs(q[:, 0]).max() < ROUNDING
    levels = constraint_error(solution.packed, both, q, qd, np.zeros_like(q))
    assert levels.position.max() < 50 * EPS * (1 + np.abs(q).max())
    assert levels.velocity.max() < 500 * EPS * (1 + np.abs(qd).max())


def test_a_heavy_top_nutates():
    """Its tilt's extremes, the first of them the start, where the function is exactly zero."""
    scene, half = heavy_top()
    vertical = lambda t, state: state.qd[2]  # noqa: E731
    (times,) = run(vertical, REFERENCE, scene, (0.0, 10.0)).raise_if_failed().t_events
    np.testing.assert_allclose(times, np.arange(times.size) * half, rtol=0, atol=TIGHT)
    assert times.size == 1 + int(10.0 / half)


@pytest.mark.parametrize("method", [I.Nystrom4(1e-3), I.RK45(1e-10, 1e-10)])
@pytest.mark.parametrize("formulation", ["tangent", "maggi-kane"])
def test_with_every_method(method, formulation):
    scene, quarter = point_pendulum()
    (times,) = run(lowest(), method, scene, formulation=formulation).t_events
    np.testing.assert_allclose(times, quarter * np.array([1, 3, 5])[: times.size], atol=NEAR)
    assert times.size == int((END / quarter + 1) / 2)


@pytest.mark.parametrize(
    ("method", "formulation"),
    [(I.Taylor(1e-8), "tangent"), *product((I.Nystrom4(1e-2), I.RK45(1e-6, 1e-6), I.DOP853(1e-6, 1e-6)), FORMS)],
)
@pytest.mark.parametrize("t_eval", [None, np.linspace(0.0, END, 31)])
def test_events_change_no_step(method, formulation, t_eval):
    plain = run(None, method, formulation=formulation, t_eval=t_eval)
    watched = run([lowest(), at_time(1.0)], method, formulation=formulation, t_eval=t_eval, dense_output=True)
    assert plain.t_events is plain.q_events is plain.qd_events is None
    for name in ("t", "q", "qd", "qdd", "steps", "charts", "state"):
        one, two = getattr(plain, name), getattr(watched, name)
        for a, b in zip(one, two, strict=True):
            np.testing.assert_array_equal(a, b)


def test_long_runs_and_max_steps():
    """More steps than a slice has."""
    scene, quarter = point_pendulum()
    solution = run(lowest(), I.Nystrom4(2e-4), scene, max_steps=5000)
    assert solution.status == ts.Status.MAX_STEPS
    assert solution.t.size == 5001
    np.testing.assert_allclose(solution.t_events[0], [quarter], atol=NEAR)


# by SciPy's rules


def test_at_a_steps_end_once():
    step = 1 / 64
    solution = run([at_time(0.5), at_time(0.5, 1.0, direction=-1), at_time(7.0)], I.Nystrom4(step))
    assert [times.tolist() for times in solution.t_events] == [[0.5], [0.5], []]
    assert solution.q_events[2].shape == (0, 3)
    row = np.flatnonzero(solution.t == 0.5)
    np.testing.assert_array_equal(solution.q_events[0], solution.q[row])


def test_rules_are_those_of_solve_ivp():
    """A bare oscillation, the same functions of time in both."""
    from scipy.integrate import solve_ivp

    functions = [
        at_time(0.0),
        at_time(0.0, direction=-1),
        at_time(0.3, 1.1, 2.2),
        at_time(0.3, 1.1, 2.2, direction=1),
        at_time(0.3, 1.1, 2.2, direction=-1),
        at_time(0.45, 1.9, terminal=2),
        at_time(2.5, terminal=True),
    ]
    theirs = solve_ivp(lambda t, y: [y[1], -y[0]], (0.0, END), [0.0, 1.0], events=functions, max_step=0.05)
    ours = run(functions, I.RK45(1e-6, 1e-6, max_step=0.05))
    assert theirs.t[-1] == pytest.approx(1.9)
    for a, b in zip(ours.t_events, theirs.t_events, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=ROUNDING)
    assert ours.state.t == pytest.approx(1.9, abs=ROUNDING)


def test_in_order_of_time_and_none_after_a_terminal_one():
    """All within one step of 0.5 s, on either side of the terminal one."""
    events = [at_time(0.4), at_time(0.3), at_time(0.35, terminal=1), at_time(0.1), at_time(0.36, terminal=True)]
    solution = run(events, I.DOP853(step=0.5), point_pendulum(0.2)[0])
    assert [times.size for times in solution.t_events] == [0, 1, 1, 1, 0]
    assert solution.t[-1] == solution.t_events[2][0]


# terminal events


@pytest.mark.parametrize("t_eval", [None, np.linspace(0.0, END, 301)])
def test_a_terminal_event_ends_the_run(t_eval):
    scene, quarter = point_pendulum()
    down = lowest(terminal=2)
    down.__name__ = "down"
    solution = run(down, REFERENCE, scene, t_eval=t_eval, dense_output=True)
    assert (solution.success, solution.status) == (True, ts.Status.EVENT)
    assert solution.raise_if_failed() is solution
    assert "event 0 (down)" in solution.message
    assert f"t = {3 * quarter:.9g} s" in solution.message
    state = solution.state
    assert abs(state.t - 3 * quarter) < TIGHT
    np.testing.assert_array_equal(solution.t_events[0][1], state.t)
    np.testing.assert_array_equal(solution.q_events[0][1], state.q)
    if t_eval is None:
        assert (np.diff(solution.t) > 0.0).all()
        np.testing.assert_array_equal(solution.t[-1], state.t)
        np.testing.assert_array_equal(solution.qdd[-1], state.qdd)
    else:
        np.testing.assert_array_equal(solution.t, t_eval[t_eval <= state.t])
    assert solution.constraint_error.position.max() < ROUNDING
    np.testing.assert_array_equal(solution.at(state.t).q, state.q)
    with pytest.raises(ts.InvalidArgument, match="t must"):
        solution.at(state.t + 1e-6)


def test_going_on_from_a_terminal_event():
    """Each run begins where the event ended the last, and finds the next one, not the same again."""
    scene, quarter = point_pendulum()
    events, times, state, start = lowest(terminal=True), [], None, 0.0
    for _ in range(4):
        solution = run(events, REFERENCE, scene, (start, 10.0), state=state)
        state, start = solution.state, solution.state.t
        times.append(start)
    np.testing.assert_allclose(times, quarter * np.array([1, 3, 5, 7]), rtol=0, atol=TIGHT)


def test_a_terminal_event_at_the_start_and_at_the_end():
    start = run(at_time(0.0, terminal=True))
    assert (start.t.tolist(), start.t_events[0].tolist(), start.state.t) == ([0.0], [0.0], 0.0)
    np.testing.assert_array_equal(start.state.q, start.q[0])
    end = run(at_time(END, terminal=True))
    assert end.status == ts.Status.EVENT
    assert end.t[-1] == END
    np.testing.assert_array_equal(end.q[-1], run(None).q[-1])


# what a function is given, and what it gives


@pytest.mark.slow
def test_a_function_is_given_a_state():
    seen = []

    def tension(t, state):
        assert t == state.t
        time, q, qd, qdd, multipliers = state
        assert len(state) == 5
        assert state[1] is q
        seen.append((time, np.linalg.norm(q), q @ qd, *multipliers, *state.multipliers))
        q[:] = qd[:] = qdd[:] = 0.0  # its own copies
        return multipliers[0] - 1.0

    plain, solution = run(None), run(tension)
    np.testing.assert_array_equal(plain.q, solution.q)
    _, length, along, one, two = np.transpose(seen)
    np.testing.assert_allclose(length, LENGTH, atol=EXACT)
    np.testing.assert_allclose(along, 0.0, atol=ROUNDING)
    np.testing.assert_array_equal(one, two)
    assert solution.t_events[0].size > 2
    for q in solution.q_events[0]:
        assert np.linalg.norm(q) == pytest.approx(LENGTH, abs=EXACT)


@pytest.mark.parametrize("value", [np.nan, np.inf, None, "1", [1.0], 1j, True], ids=str)
def test_no_number_ends_the_run(value):
    def odd(t, state):
        return 1.0 if t < 1.0 else value

    solution = run([lowest(), odd], dense_output=True)
    assert (solution.success, solution.status) == (False, ts.Status.EVENT_FAILED)
    assert "event 1 (odd)" in solution.message
    assert repr(value) in solution.message
    assert 1.0 <= solution.t[-1] < 1.5
    assert solution.t_events[0].size == 1
    assert np.isfinite(solution.at(solution.t).q).all()
    with pytest.raises(ts.StepFailure, match="odd"):
        solution.raise_if_failed()
    with pytest.raises(ts.InvalidArgument, match=r"event 0 \(odd\).*t = 1 s"):
        run(odd, span=(1.0, 2.0))


def test_what_a_function_raises_ends_the_run():
    def late(t, state):
        if t > 1.0:
            raise ZeroDivisionError("oh")
        return t - 2.0

    def inside(t, state):
        if 1.0 < t < 1.5:
            raise KeyError("root")
        return t - 1.2

    solution = run(late)
    assert "event 0 (late) raised ZeroDivisionError at t = 1.0" in solution.message
    assert "oh" in solution.message
    solution = run(inside, I.DOP853(step=1.0), point_pendulum(0.2)[0])
    assert (solution.status, solution.t.tolist()) == (ts.Status.EVENT_FAILED, [0.0, 1.0, 2.0])
    assert "KeyError" in solution.message
    with pytest.raises(ts.InvalidArgument, match="oh"):
        run(late, span=(1.5, 2.0))


def test_an_interrupt_hands_back_what_there_was():
    def impatient(t, state):
        if t > 1.0:
            raise KeyboardInterrupt
        return t - 0.5

    solution = run(impatient)
    assert solution.status == ts.Status.INTERRUPTED
    assert solution.t_events[0] == pytest.approx([0.5])


@pytest.mark.parametrize(
    ("events", "words"),
    [
        (3.0, "events must"),
        ("lowest", "events must"),
        ([lowest(), None], r"events\[1\]"),
        (lowest(terminal=-1), "terminal"),
        (lowest(terminal=1.5), "terminal"),
        (lowest(terminal=np.nan), "terminal"),
        (lowest(terminal="yes"), "terminal"),
        (lowest(direction=np.nan), "direction"),
        (lowest(direction="up"), "direction"),
        (lambda state: 0.0, r"event 0 .* raised TypeError"),
    ],
)
def test_bad_input(events, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        run(events)


def test_no_events_at_all():
    solution = run([])
    assert (solution.t_events, solution.q_events, solution.qd_events) == ([], [], [])
