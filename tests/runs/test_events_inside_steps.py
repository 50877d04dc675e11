"""Events inside steps: every zero is found, however long the steps are, and touches, kinks and failures there too."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_forms import point_pendulum
from tests.helpers.tolerances import ALGEBRA, CLOSE, EPS, FAIR, FINE, HELD, LOOSE, ROUNDING
from tsdyn.maths.root_isolation import Search

I = ts.integrators
METHODS = [None, I.Taylor(), I.DOP853(1e-9, 1e-9), I.RK45(1e-6, 1e-6), I.Nystrom4(1e-2)]
EXPLICIT = [method for method in METHODS[2:] if method is not None]
every_method = pytest.mark.parametrize("method", METHODS, ids=repr)


def event(function, **attributes):
    for name, value in attributes.items():
        setattr(function, name, value)
    return function


def thrown(height=0.0, speed=5.0):
    """A point mass thrown up, g = 10 m/s^2: one step for Taylor series."""
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    scene.add_point_mass(1.0, position=(0.0, 0.0, height), velocity=(0.0, 0.0, speed))
    return scene


def hum(**attributes):
    return event(lambda t, state: np.sin(200.0 * np.pi * t + 0.1), **attributes)


@every_method
def test_every_zero_of_a_fast_function_of_time(method):
    events = [hum(), hum(direction=1), hum(direction=-1)]
    both, rising, falling = ts.simulate(thrown(), (0.0, 1.0), integrator=method, events=events).t_events
    np.testing.assert_allclose(both, (np.arange(1, 201) * np.pi - 0.1) / (200.0 * np.pi), rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(falling, both[0::2])
    np.testing.assert_array_equal(rising, both[1::2])


@every_method
def test_every_zero_of_the_step_that_begins_at_one(method):
    events = [lambda t, state: np.sin(40.0 * t), lambda t, state: state.q[2]]
    waves, heights = ts.simulate(thrown(), (0.0, 1.05), integrator=method, events=events).t_events
    np.testing.assert_allclose(waves, np.arange(14) * np.pi / 40.0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(heights, [0.0, 1.0], rtol=0, atol=ALGEBRA)


@pytest.mark.parametrize("formulation", ["null-space", "maggi-kane"])
@pytest.mark.parametrize("method", EXPLICIT, ids=repr)
def test_by_every_form(method, formulation):
    (times,) = ts.simulate(
        point_pendulum()[0], (0.0, 1.0), integrator=method, formulation=formulation, events=hum()
    ).t_events
    assert times.size == 200


@every_method
def test_both_passages_of_a_height(method):
    (times,) = ts.simulate(thrown(), (0.0, 1.0), integrator=method, events=lambda t, state: state.q[2] - 1.0).t_events
    np.testing.assert_allclose(times, 0.5 + 0.05**0.5 * np.array([-1.0, 1.0]), rtol=0, atol=ALGEBRA)


@every_method
def test_every_passage_of_a_mass_on_a_spring(method):
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0, position=(1.5, 0.0, 0.0))
    scene.add(ts.forces.Spring(mass, scene.ground, stiffness=4.0 * np.pi**2, free_length=1.0))
    (times,) = ts.simulate(scene, (0.0, 10.0), integrator=method, events=lambda t, state: state.q[0] - 1.0).t_events
    np.testing.assert_allclose(times, 0.25 + 0.5 * np.arange(20), rtol=0, atol=LOOSE)


def test_random_polynomials_and_angles_change_sign_as_often_as_samples_do(rng):
    """A double pendulum in space; 4,000 samples of its dense output."""
    scene = ts.Scene()
    upper = scene.add_body(1.0, (0.1, 0.2, 0.3), position=(0.5, 0.0, 0.0))
    lower = scene.add_body(1.0, (0.1, 0.2, 0.3), position=(1.5, 0.0, 0.0), angular_velocity=(0.0, 0.0, 1.0))
    scene.add(ts.constraints.Spherical(upper, scene.ground, point_a=(-0.5, 0.0, 0.0)))
    scene.add(ts.constraints.Spherical(upper, lower, point_a=(0.5, 0.0, 0.0), point_b=(-0.5, 0.0, 0.0)))
    scene.assemble()
    functions = []
    for _ in range(4):
        a, b, c = rng.normal(size=(3, 14))
        functions.append(lambda t, state, a=a, b=b: (a @ state.q) * (b @ state.q) * (a[::-1] @ state.q) - 0.1)
        functions.append(lambda t, state, a=a, c=c: np.arctan2(a @ state.q, c @ state.qd) - 0.3)
    solution = ts.simulate(scene, (0.0, 2.0), events=functions, dense_output=True).raise_if_failed()
    states = solution.at(np.linspace(0.0, 2.0, 4_001))
    every = [ts.State(*parts) for parts in zip(*states, strict=True)]
    for function, times in zip(functions, solution.t_events, strict=True):
        signs = np.sign([function(state.t, state) for state in every])
        assert times.size >= np.count_nonzero(signs[1:] != signs[:-1])
        assert (times.size - np.count_nonzero(signs[1:] != signs[:-1])) % 2 == 0


# grazing


@pytest.mark.parametrize("gap", [1e-2, 1e-5, 1e-7])
def test_a_pair_of_close_zeros(gap):
    function = lambda t, state: (t - 0.3) * (t - 0.3 - gap)  # noqa: E731
    (times,) = ts.simulate(thrown(), (0.0, 1.0), events=function).t_events
    np.testing.assert_allclose(times, [0.3, 0.3 + gap], rtol=0, atol=CLOSE)


@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("instant", [0.3, 0.5])
def test_a_touch_counts_once_in_either_direction(instant, direction):
    touch = event(lambda t, state: (t - instant) ** 2, direction=direction)
    near = event(lambda t, state: (t - instant) ** 2 + 1e-9, direction=direction)
    touched, missed = ts.simulate(thrown(), (0.0, 1.0), events=[touch, near]).t_events
    np.testing.assert_allclose(touched, [instant], rtol=0, atol=HELD)
    assert missed.size == 0


def test_the_top_of_a_throw():
    """1.25 m is touched, a nanometre less is passed twice, a nanometre more is not reached."""
    events = [lambda t, state, h=h: state.q[2] - h for h in (1.25, 1.25 - 1e-9, 1.25 + 1e-9)]
    touched, passed, missed = ts.simulate(thrown(), (0.0, 1.0), events=events).t_events
    np.testing.assert_allclose(touched, [0.5], rtol=0, atol=FAIR)
    assert (passed.size, missed.size) == (2, 0)


# functions that are not smooth


def test_kinks_and_jumps():
    calls = 0

    def jump(t, state):
        nonlocal calls
        calls += 1
        return np.sign(state.q[2] - 1.0)

    functions = [
        lambda t, state: state.q[2] - 1.0,
        jump,
        lambda t, state: abs(state.q[2] - 1.0),
        lambda t, state: max(state.q[2], 0.9) - 1.0,
        lambda t, state: abs(t - 0.3) - 1e-6,
    ]
    smooth, jumps, kinks, clipped, dips = ts.simulate(thrown(), (0.0, 1.0), events=functions).t_events
    for times in (jumps, kinks, clipped):
        np.testing.assert_allclose(times, smooth, rtol=0, atol=FINE)
    np.testing.assert_allclose(dips, 0.3 + np.array([-1e-6, 1e-6]), rtol=0, atol=HELD)
    assert calls < 1500


@pytest.mark.parametrize("method", [None, I.DOP853(1e-9, 1e-9)], ids=repr)
def test_rounding_is_no_event(method):
    """What is zero but for rounding errors: at the start, as by solve_ivp, and never again; and at a bounded cost."""
    calls = 0

    def aside(t, state):
        nonlocal calls
        calls += 1
        return state.q[1]

    events = [aside, lambda t, state: np.linalg.norm(state.q) - 0.7]
    solution = ts.simulate(point_pendulum()[0], (0.0, 3.0), integrator=method, events=events)
    assert max(times.size for times in solution.t_events) <= 1
    assert calls < 60 * solution.stats.steps


@pytest.mark.parametrize("direction", [-1, 0])
def test_a_bouncing_ball_never_falls_through(direction):
    """Until its bounces are as short as rounding errors of the time."""
    scene, state, t, bounces = thrown(height=1.0, speed=0.0), None, 0.0, 0
    floor = event(lambda t, state: state.q[2], terminal=True, direction=direction)
    while bounces < 60:
        solution = ts.simulate(scene, (t, 10.0), state=state, events=floor)
        assert solution.status == ts.Status.EVENT
        assert solution.q[:, 2].min() > -1e-12
        state, bounces = solution.state, bounces + 1
        assert state.t >= t
        t, state = state.t, state._replace(qd=-0.5 * state.qd)
    fall = 0.2**0.5
    assert t == pytest.approx(3.0 * fall, abs=CLOSE)


@pytest.mark.parametrize("speed", [1e-3, 1e-2])
@pytest.mark.parametrize("first_step", [1e-13, 1e-12, 1e-11])
def test_rounding_of_large_values_hides_no_zero_later(first_step, speed):
    """The mean velocity of a throw from 1 m: in the first step its rounding is larger than its values."""
    events = [lambda t, state: (state.q[2] - 1.0) / t if t else speed]
    end = speed / 5.0
    method = I.Taylor(first_step=first_step)
    (times,) = ts.simulate(thrown(1.0, speed), (0.0, 1.5 * end), integrator=method, events=events).t_events
    assert times[-1] == pytest.approx(end, rel=EPS / (speed * end))
    assert (times[:-1] < 1e3 * first_step).all()


# failures


def test_what_was_found_before_a_failure_is_kept():
    def odd(t, state):
        if 0.4 < t < 0.6:
            raise KeyError("here")
        return t - 0.2

    scene = thrown()
    events = [odd, lambda t, state: t - 0.1, lambda t, state: t - 0.9]
    solution = ts.simulate(scene, (0.0, 1.0), events=events)
    assert solution.status == ts.Status.EVENT_FAILED
    assert "KeyError" in solution.message
    assert [times.tolist() for times in solution.t_events] == [[0.2], [0.1], []]
    first = event(lambda t, state: t - 0.25, terminal=True)
    solution = ts.simulate(scene, (0.0, 1.0), events=[odd, first])
    assert (solution.status, solution.state.t) == (ts.Status.EVENT, pytest.approx(0.25, abs=ROUNDING))
    assert solution.t_events[0] == pytest.approx([0.2])


@pytest.mark.parametrize("method", [None, I.DOP853(1e-9, 1e-9)], ids=repr)
def test_an_interrupt_in_the_last_step_is_no_success(method):
    """The run ends where it has been looked at, so that one that goes on misses nothing."""
    scene, patient = thrown(), False

    def function(t, state):
        if t > 0.99 and not patient:
            raise KeyboardInterrupt
        return t - 0.995

    solution = ts.simulate(scene, (0.0, 1.0), integrator=method, events=function, dense_output=True)
    assert (solution.status, solution.success) == (ts.Status.INTERRUPTED, False)
    assert solution.t[-1] == solution.state.t < 0.995
    np.testing.assert_array_equal(solution.q[-1], solution.state.q)
    np.testing.assert_allclose(solution.at(solution.t).q, solution.q, rtol=0, atol=ROUNDING)
    patient = True
    rest = ts.simulate(scene, (solution.state.t, 1.0), integrator=method, state=solution.state, events=function)
    assert rest.t_events[0] == pytest.approx([0.995])


def test_a_function_with_too_many_turns_says_so(monkeypatch):
    monkeypatch.setattr("tsdyn.maths.root_isolation.MOST", 1000)
    solution = ts.simulate(thrown(), (0.0, 1.0), events=hum())
    assert solution.status == ts.Status.EVENT_FAILED
    assert "too fast" in solution.message
    assert "max_step" in solution.message
    assert ts.simulate(thrown(), (0.0, 1.0), events=hum(), max_step=0.05).t_events[0].size == 200


@pytest.mark.parametrize("start", [0.0, 0.9030472819714618])
def test_a_zero_in_the_middle_of_a_step(start):
    """The top of a flight, which a sample meets to the last digit: no zero of the start, whatever rounding leaves."""

    def rate(t, state):
        return state.qd[2]

    rate.direction = -1
    scene = ts.Scene(gravity=(0, 0, -9.81))
    for speed in np.linspace(0.1, 5.0, 50).tolist():
        scene = ts.Scene(gravity=(0, 0, -9.81))
        scene.add_point_mass(mass=1.0, velocity=(0, 0, speed))
        solution = ts.simulate(scene, (start, start + 2 * speed / 9.81), events=rate)
        np.testing.assert_allclose(solution.t_events[0], [start + speed / 9.81], rtol=1e-14)


# the search itself


@pytest.mark.slow
def test_the_search_finds_what_samples_find(rng):
    """Sums of waves, their powers, angles and absolute values, at random."""
    dense, spent = np.linspace(0.0, 1.0, 5001), 0
    for trial in range(200):
        w, a, p = rng.uniform(0.0, [3.0, 30.0, 90.0][trial % 3], 4), rng.normal(size=4), rng.uniform(0.0, 6.0, 4)
        waves = lambda t, w=w, a=a, p=p: np.cos(np.multiply.outer(t, w) + p) @ a  # noqa: E731
        kinds = [
            lambda t, waves=waves: waves(t) ** 3 - 0.01,
            lambda t, waves=waves: np.arctan2(waves(t), waves(t + 0.1)) - 0.2,
            lambda t, waves=waves: np.abs(waves(t)) - 0.1,
            lambda t, waves=waves: waves(t) * (t - 0.5),
        ]
        f = kinds[trial % 4]
        search = Search(f, lambda t: 0.0)
        search.run(0.0, float(f(0.0)), 1.0, 8)
        times, values = np.array(search.points).T
        assert (np.diff(times) > 0.0).all()
        changes = [np.count_nonzero(np.diff(np.sign(x[x != 0.0]))) for x in (values, f(dense))]
        assert changes[0] >= changes[1]
        assert (changes[0] - changes[1]) % 2 == 0
        spent += search.spent
    assert spent < 200 * 1500
