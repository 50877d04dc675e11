"""Dense output: `solution.at(t)` is on the manifold, of its method's order, and changes no step."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.closed_forms import point_pendulum
from tests.helpers.driven_rod import driven
from tests.helpers.pendulums import pulled_straight
from tests.helpers.reference import load
from tests.helpers.tolerances import CLOSE, EPS, EXACT, ROUNDING
from tsdyn.observables.diagnostics import constraint_error

C, I = ts.constraints, ts.integrators
FORMS = ("tangent", "maggi-kane")
METHODS = {
    "nystrom4": I.Nystrom4(0.01),
    "rk45": I.RK45(1e-6, 1e-6),
    "rk45, loose": I.RK45(1e-2, 1e-2),
    "dop853": I.DOP853(1e-9, 1e-9),
    "dop853, loose": I.DOP853(1e-2, 1e-2),
}
methods = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
END = 4.0  # s
SCENES = {
    "sliding_top": lambda: load("sliding_top")[0],
    "spatial": lambda: load("two_body_pendulum_spatial")[0],
    "driven": driven,
}
scenes = pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
parts = ("q", "qd", "qdd")


def run(scene, method, **options):
    return ts.simulate(scene, (0.0, END), integrator=method, **{"dense_output": True, **options}).raise_if_failed()


def demand_on_the_manifold(solution, state):
    levels = constraint_error(solution.packed, state.t, state.q, state.qd, state.qdd)
    for level, values, factor in zip(levels, state[1:4], (50, 500, 5000), strict=True):
        assert (level <= factor * EPS * (1.0 + np.abs(values).max(axis=1))).all()


@methods
@scenes
def test_states_are_on_the_manifold(make, method, rng):
    solution = run(make(), method)
    state = solution.at(rng.uniform(0.0, END, 1000))
    demand_on_the_manifold(solution, state)
    demand_on_the_manifold(solution, solution.at(solution.t))


@pytest.mark.parametrize("formulation", FORMS)
@methods
@scenes
def test_at_the_steps_it_is_the_steps(make, method, formulation):
    """And output or the want of it changes nothing, bit by bit."""
    solution = run(make(), method, formulation=formulation)
    state = solution.at(solution.t)
    for name, growth in zip(parts, (100, 100, 3000), strict=True):
        values = getattr(solution, name)
        np.testing.assert_allclose(getattr(state, name), values, rtol=0, atol=growth * EPS * (1 + np.abs(values).max()))
    np.testing.assert_allclose(
        state.multipliers, solution.multipliers, atol=CLOSE * (1 + np.abs(state.multipliers).max())
    )
    plain = run(make(), method, formulation=formulation, dense_output=False)
    times = run(make(), method, formulation=formulation, t_eval=np.linspace(0.0, END, 37))
    for other in (plain, times):
        ours, theirs = ((*each.steps, *each.charts, *each.state) for each in (solution, other))
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a, b)
    # the times of t_eval and `at` are one path, but for what Newton's method starts from
    between = solution.at(times.t)
    for name, growth in zip(parts, (100, 300, 3000), strict=True):
        values = getattr(times, name)
        np.testing.assert_allclose(
            getattr(between, name), values, rtol=0, atol=growth * EPS * (1 + np.abs(values).max())
        )


def test_shapes_and_any_order(rng):
    scene, _ = load("two_body_pendulum_spatial")
    solution = run(scene, METHODS["dop853"])
    times = rng.uniform(0.0, END, 50)
    state = solution.at(times)
    n, m = solution.q.shape[1], solution.multipliers.shape[1]
    assert [part.shape for part in state] == [(50,), (50, n), (50, n), (50, n), (50, m)]
    for i in (0, 17, 49):  # whatever was asked before
        one = solution.at(times[i])
        assert isinstance(one.t, float)
        assert one.multipliers.shape == (m,)
        for a, b in zip(one, state, strict=True):
            np.testing.assert_array_equal(a, b[i])
    assert solution.at([]).q.shape == (0, n)
    assert solution.at(0).t == 0.0
    np.testing.assert_array_equal(solution.at([END, 0.0]).t, [END, 0.0])


@pytest.mark.parametrize(
    "t", [-1e-9, END + 1e-9, np.nan, np.inf, [[0.1]], "soon", None, [0.1, None], True, 1j], ids=str
)
def test_impossible_times_are_refused(t):
    solution = run(point_pendulum()[0], METHODS["dop853"])
    with pytest.raises(ts.InvalidArgument, match="t must"):
        solution.at(t)


def test_what_was_not_kept_is_refused():
    solution = run(point_pendulum()[0], METHODS["dop853"], dense_output=False)
    with pytest.raises(ts.InvalidArgument, match="dense_output=True"):
        solution.at(1.0)
    with pytest.raises(ts.InvalidArgument, match="dense_output"):
        run(point_pendulum()[0], METHODS["dop853"], dense_output="yes")


@pytest.fixture(scope="module")
def fine():
    scene, _ = load("sliding_top")
    return run(scene, I.DOP853(1e-13, 1e-13))


ORDERS = [
    (I.RK45, "tangent", [60, 120, 240], 5, 3),
    (I.RK45, "maggi-kane", [60, 120, 240], 5, 1),
    (I.Nystrom4, "tangent", [100, 200, 400], 4, 3),
    (I.Nystrom4, "maggi-kane", [100, 200, 400], 4, 3),
    (I.DOP853, "tangent", [30, 40, 60, 80], 8, 3),
    pytest.param(I.ImplicitTrapezoid, "tangent", [200, 400, 800], 2, 3, marks=pytest.mark.slow),
    pytest.param(I.SDIRK54, "tangent", [80, 120, 160, 240], 5, 3, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("method", "formulation", "counts", "order", "levels"), ORDERS)
def test_order_across_charts(method, formulation, counts, order, levels, fine, rng):
    """All along a run of many charts. DOP853: at these steps terms of h^9 and h^10 outweigh that of h^8 for this top.

    Maggi/Kane interpolates w by a cubic: velocities and accelerations are of order four.
    """
    times = rng.uniform(0.0, END, 300)
    exact, off = fine.at(times), []
    for count in counts:
        interval = 4 if method.implicit else None
        solution = run(load("sliding_top")[0], method(step=1 / count), formulation=formulation, chart_interval=interval)
        state = solution.at(times)
        off.append([np.abs(getattr(state, name) - getattr(exact, name)).max() for name in parts[:levels]])
    assert solution.stats.charts > 40
    for column in np.transpose(off):
        above = np.polyfit(-np.log(counts), np.log(column), 1)[0] - order
        assert (-0.3 if method.implicit else -0.5) < above < (2.5 if order == 8 else 0.3 if method.implicit else 0.5)


@pytest.mark.parametrize(("method", "power"), [(I.RK45, 6), (I.Nystrom4, 5), (I.DOP853, 8)])
def test_error_within_one_step(method, power, fine):
    """What an interpolant of order p leaves of one step is h^(p + 1)."""
    steps, off = np.array([0.16, 0.12, 0.08, 0.06]), []
    for h in steps:
        times = np.linspace(0.0, h, 40)
        one = ts.simulate(load("sliding_top")[0], (0.0, h), integrator=method(step=h), dense_output=True)
        assert one.stats.steps == 1
        off.append(np.abs(one.at(times).q - fine.at(times).q).max())
    assert np.polyfit(np.log(steps), np.log(off), 1)[0] > power - 0.5


def bar_on_a_short_link(length):
    """A bar that falls from a pin on a massless link; the curvature of its chart exceeds the link, and two branches of
    the constraint lie within a step's reach of each other."""
    scene = ts.Scene()
    bar = scene.add_body(mass=1.0, inertia=(0.002, 0.09, 0.09), position=(0.5, 0.0, -length), name="bar")
    scene.add(C.Distance(bar, scene.ground, point_a=(-0.5, 0.0, 0.0), length=length))
    return scene


def bar_in_angles(length, times):
    """Its centroid (k, 2) along x and z, by Lagrange's equations of both angles."""
    m, J, l, g = 1.0, 0.09, 0.5, 9.81

    def rates(t, y):
        a, b, ad, bd = y
        x, z = -length * np.sin(a) * ad**2 - l * np.cos(b) * bd**2, length * np.cos(a) * ad**2 - l * np.sin(b) * bd**2
        c = m * length * l * np.sin(a - b)
        right = -length * m * (x * np.cos(a) + (z + g) * np.sin(a)), m * l * (x * np.sin(b) - (z + g) * np.cos(b))
        return (ad, bd, *np.linalg.solve([[m * length**2, c], [c, m * l**2 + J]], right))

    found = solve_ivp(rates, (0.0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-12, atol=1e-12)
    a, b = found.y[:2]
    return np.stack([length * np.sin(a) + l * np.cos(b), -length * np.cos(a) + l * np.sin(b)], axis=1)


@pytest.mark.slow_for("null-space-*")
@pytest.mark.parametrize("method", ["rk45", "dop853", pytest.param("sdirk54", marks=pytest.mark.slow)])
@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_states_are_on_the_branch_of_the_run(formulation, method, rng):
    """Between steps that are long for the constraint's curvature: `at`, t_eval and events."""
    times = np.sort(rng.uniform(0.0, 1.0, 300))
    low = lambda t, state: state.position("bar")[2] + 0.4  # noqa: E731
    for length in (5e-3, 1e-3):
        options = {"integrator": method, "formulation": formulation, "rtol": 1e-8, "atol": 1e-8, "events": low}
        scene, exact = bar_on_a_short_link(length), bar_in_angles(length, times)
        solution = ts.simulate(scene, (0.0, 1.0), dense_output=True, **options).raise_if_failed()
        given = ts.simulate(scene, (0.0, 1.0), t_eval=times, **options).raise_if_failed()
        for q in (solution.at(times).q, given.q):
            np.testing.assert_allclose(q[:, [0, 2]], exact, rtol=0, atol=1e-6)
        crossed = bar_in_angles(length, solution.t_events[0])[:, 1]
        assert crossed.size == np.count_nonzero(np.diff(np.sign(exact[:, 1] + 0.4)))
        np.testing.assert_allclose(crossed, -0.4, rtol=0, atol=1e-6)


def test_a_failed_run_keeps_what_it_had():
    solution = ts.simulate(pulled_straight(), (0.0, 2.0), integrator=I.DOP853(1e-8, 1e-8), dense_output=True)
    assert not solution.success
    state = solution.at(solution.t[-1])
    np.testing.assert_allclose(state.q, solution.q[-1], atol=CLOSE)
    demand_on_the_manifold(solution, solution.at(np.linspace(0.0, 0.9, 30)))
    with pytest.raises(ts.InvalidArgument, match="t must"):
        solution.at(1.9)


def test_an_ended_run_keeps_what_it_had():
    scene, _ = load("sliding_top")
    part = ts.simulate(scene, (0.0, END), integrator=I.Nystrom4(1e-3), dense_output=True, max_steps=1500)
    whole = run(scene, I.Nystrom4(1e-3))
    times = np.linspace(0.0, part.t[-1], 40)
    np.testing.assert_array_equal(part.at(times).q, whole.at(times).q)
    assert part.at(part.state.t).t == 1.5


def test_more_charts_than_there_was_room_for():
    solution = run(point_pendulum()[0], I.Nystrom4(END / 9000), chart_interval=1)
    assert solution.stats.charts == 9000
    np.testing.assert_allclose(solution.at(solution.t[::50]).q, solution.q[::50], rtol=0, atol=ROUNDING)


def test_a_run_of_no_steps():
    """Ended by an event at its very start."""
    start = lambda t, state: t  # noqa: E731
    start.terminal = True
    solution = run(point_pendulum()[0], METHODS["dop853"], events=start)
    np.testing.assert_allclose(solution.at(0.0).q, solution.q[0], atol=EXACT)
    with pytest.raises(ts.InvalidArgument, match="t must"):
        solution.at(1e-9)


def test_a_solution_outlives_a_change_of_its_scene():
    scene = driven()
    one, two = run(scene, METHODS["dop853"]), run(scene, METHODS["dop853"])
    times = np.linspace(0.0, END, 23)
    expected = one.at(times)
    (body,) = scene.bodies
    body.mass, body.position = 9.0, (0.0, 0.0, 1.0)
    scene.gravity = (1.0, 2.0, 3.0)
    run(scene, METHODS["rk45"], initial_tol=10.0)
    for a, b in zip(expected, two.at(times), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.slow
def test_a_method_loads_its_own_interpolant_only():
    code = """
import tsdyn as ts
from tsdyn.methods import interpolants as interpolation
scene = ts.Scene()
scene.add(ts.constraints.Distance(scene.add_point_mass(1.0, (1.0, 0.0, 0.0)), scene.ground))
ts.simulate(scene, (0.0, 0.1))
kinds = interpolation.HERMITE, interpolation.DOP853, interpolation.HERMITE_FIRST_ORDER
loaded = lambda: [int(kind.fill._address is not None) for kind in kinds]
none = loaded()
ts.simulate(scene, (0.0, 0.1), integrator="rk45", dense_output=True)
print(none, loaded())
"""
    root = Path(__file__).parents[2]
    result = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[0, 0, 0] [1, 0, 0]"
