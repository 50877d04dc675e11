"""Motions and loads from data: values and series, steps that end at knots, orders, jumps, times not covered."""

import math
import pickle

import numpy as np
import pytest
from scipy.interpolate import (
    Akima1DInterpolator,
    BPoly,
    BSpline,
    CubicSpline,
    PchipInterpolator,
    PPoly,
    make_interp_spline,
)

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.motion_series import series
from tests.helpers.tolerances import ALGEBRA, CLOSE, FINE, HELD, TIGHT

C, F, I, M = ts.constraints, ts.forces, ts.integrators, ts.motions
KNOTS = np.array([0.0, 0.13, 0.3, 0.5, 0.77, 1.0])
LENGTHS = 1.0 + 0.2 * np.sin(5.0 * KNOTS)
ROUND = np.append(LENGTHS[:-1], LENGTHS[0])
SPLINES = {
    "cubic": CubicSpline(KNOTS, LENGTHS),
    "monotone": PchipInterpolator(KNOTS, LENGTHS),
    "akima": Akima1DInterpolator(KNOTS, LENGTHS),
    **{f"B of degree {k}": make_interp_spline(KNOTS, LENGTHS, k=k) for k in (2, 3, 5)},
    "line of degree 1": BSpline([0, 0, 0.4, 1, 1], [1.0, 1.2, 1.5], 1),
    "two knots": CubicSpline([0.0, 1.0], [1.0, 1.5]),
    "uneven": CubicSpline([0.0, 1e-9, 0.6, 0.6 + 1e-7, 1.0], [1.0, 1.0, 1.2, 1.2, 0.9]),
    "Bernstein": BPoly.from_power_basis(CubicSpline(KNOTS, LENGTHS)),
    "periodic": CubicSpline(KNOTS[:4], ROUND[[0, 1, 2, 0]], bc_type="periodic"),
    "periodic B": make_interp_spline(KNOTS, ROUND, bc_type="periodic"),
}
METHODS = one_of_each(tol=1e-11, step=0.01)


def value(spline, t, derivative=0):
    """Of SciPy's object; SciPy writes beyond its memory at derivatives of a BSpline above its degree."""
    if isinstance(spline, BSpline) and derivative > spline.k:
        return np.zeros(np.shape(t))
    spline = PPoly.from_bernstein_basis(spline) if isinstance(spline, BPoly) else spline
    extrapolate = "periodic" if spline.extrapolate == "periodic" else None
    return spline(t, derivative) if extrapolate is None else spline(t, derivative, extrapolate)


@pytest.mark.parametrize("spline", SPLINES.values(), ids=SPLINES)
def test_values_and_series_are_those_of_scipy(spline):
    motion = M.Piecewise(spline)
    beyond = (-0.4, 1.3, 7.7) if spline.extrapolate else ()
    for t in (0.0, 0.05, 0.13, 0.41, 0.77, 0.9, *beyond):
        given = [float(f(t)) for f in (motion, motion.rate, motion.acceleration, motion.jerk)]
        expected = [float(value(spline, t, n)) for n in range(4)]
        scale = np.maximum(np.abs(expected), 1.0)
        np.testing.assert_allclose(given / scale, expected / scale, atol=CLOSE)
        c = series(motion, t, 6) * [math.factorial(n) for n in range(6)]
        np.testing.assert_allclose(c[:4] / scale, expected / scale, atol=CLOSE)
    times = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(motion(times), value(spline, times), atol=HELD)


def test_arithmetic_of_data():
    spline = SPLINES["cubic"]
    motion = 0.5 * M.Piecewise(spline) ** 2 + np.sin(M.time)
    t = np.array([0.2, 0.3, 0.9])
    x, v, a = (spline(t, n) for n in range(3))
    np.testing.assert_allclose(motion.rate(t), x * v + np.cos(t), atol=ALGEBRA)
    np.testing.assert_allclose(motion.acceleration(t), x * a + v * v - np.sin(t), atol=HELD)
    assert pickle.loads(pickle.dumps(motion))(0.3) == motion(0.3)


def bead(length, tangential=0.0):
    """A point mass on a string whose length is prescribed, under gravity."""
    scene = ts.Scene()
    along = np.array([0.6, 0.0, -0.8])
    motion = ts.Motion(length)
    x, v, _ = motion.value(motion.origin)
    body = scene.add_point_mass(1.0, x * along, v * along + [0.0, tangential, 0.0], name="bead")
    scene.add(C.Distance(body, scene.ground, length=length, name="string"))
    return scene, body


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_steps_end_at_knots_and_constraints_hold(options):
    """With jumps of acceleration at every knot: outputs there have the acceleration after it, as SciPy's object has."""
    spline = PchipInterpolator(KNOTS, LENGTHS)
    scene, _ = bead(spline)
    solution = ts.simulate(scene, (0.0, 1.0), dense_output=True, **options).raise_if_failed()
    assert set(KNOTS) <= set(solution.t)
    error = solution.constraint_error
    assert max(error.position.max(), error.velocity.max()) < ALGEBRA
    assert error.acceleration.max() < TIGHT
    inner = np.append(KNOTS[:-1], [0.2, 0.6])
    state = solution.at(inner)
    np.testing.assert_allclose(np.linalg.norm(state.q, axis=1), spline(inner), atol=ALGEBRA)
    r, rd, rdd = state.q, state.qd, state.qdd
    radial = (np.einsum("ki,ki->k", r, rdd) + np.einsum("ki,ki->k", rd, rd) - spline(inner, 1) ** 2) / spline(inner)
    np.testing.assert_allclose(radial, spline(inner, 2), atol=CLOSE)
    loose = 1e-5 if options["integrator"].step else 1e-8
    assert np.ptp(solution.energy - solution.work) < loose


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("name", ["taylor", "dop853", "nystrom4", "sdirk54"])
def test_all_methods_agree_over_knots(name):
    """A quadratic spline: its acceleration jumps, and no method sees that as an error of its own."""
    spline = make_interp_spline(KNOTS, LENGTHS, k=2)
    ends = []
    for options in (METHODS["taylor"], METHODS[name]):
        scene, _ = bead(spline, 0.3)
        ends.append(ts.simulate(scene, (0.0, 1.0), t_eval=(0.0, 1.0), **options).raise_if_failed().q[-1])
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-6 if name == "nystrom4" else 1e-8)


def test_a_fixed_step_keeps_its_order_over_knots():
    """Knots on no grid; steps are cut there, and the grid's other times stay."""
    errors = []
    scene, _ = bead(make_interp_spline(KNOTS, LENGTHS, k=2), 0.3)
    exact = ts.simulate(scene, (0.0, 1.0), t_eval=(0.0, 1.0), **METHODS["taylor"]).q[-1]
    for step in (0.05, 0.025, 0.0125):
        solution = ts.simulate(scene, (0.0, 1.0), integrator=I.Nystrom4(step=step))
        assert solution.stats.steps == round(1.0 / step) + 4 - _on_grid(step)
        errors.append(np.abs(solution.q[-1] - exact).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders.min() > 3.7


def _on_grid(step):
    """How many inner knots are times of the grid."""
    count = KNOTS[1:-1] / step
    return int((np.abs(count - np.round(count)) < 1e-6).sum())


def test_a_fast_crank_by_a_table():
    """An angle over many turns, from arrays; without the knots of it nothing would be lost either, but the order."""
    t = np.linspace(0.0, 2.0, 41)
    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1, 1, 2), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.RotationMotor.of(hinge, angle=(t, 20.0 * t**2)))
    solution = ts.simulate(scene, (0.0, 2.0), t_eval=t).raise_if_failed()
    np.testing.assert_allclose(solution.angle(hinge), 20.0 * t**2, atol=CLOSE)
    assert solution.method.startswith("Taylor")


PATHS = {
    "arrays": (KNOTS, np.stack([LENGTHS, KNOTS**2, -KNOTS], axis=1)),
    "table": ts.Table(KNOTS, np.stack([LENGTHS, KNOTS**2, -KNOTS], axis=1)),
    "spline": CubicSpline(KNOTS, np.stack([LENGTHS, KNOTS**2, -KNOTS], axis=1)),
    "three": [(KNOTS, LENGTHS), CubicSpline(KNOTS, KNOTS**2), -1.0 * M.time],
}


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
def test_a_path_of_data(path):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 1.1, 1.2), (1.0, 0.0, 0.0), velocity=(SPLINES["cubic"](0.0, 1), 0.0, -1.0))
    scene.add(C.PointDriver(scene.ground, body, path=path))
    solution = ts.simulate(scene, (0.0, 1.0), t_eval=KNOTS).raise_if_failed()
    np.testing.assert_allclose(solution.position(body), PATHS["spline"](KNOTS), atol=ALGEBRA)


def test_periods_go_on():
    spline = CubicSpline(0.1 * np.arange(4), [1.0, 1.2, 0.9, 1.0], bc_type="periodic")
    scene, _ = bead(spline)
    solution = ts.simulate(scene, (0.0, 2.0), **METHODS["taylor"]).raise_if_failed()
    assert np.isclose(solution.t[:, None], 0.1 * np.arange(21), atol=HELD).any(axis=0).all()
    assert solution.constraint_error.acceleration.max() < TIGHT


def test_where_runs_begin_and_end():
    """At a knot, between two, at the table's ends; a table that begins later than zero says its angle there."""
    table = ts.Table(5.0 + KNOTS, LENGTHS)
    scene, _ = bead(table)
    for span in ((5.0, 6.0), (5.0, 5.13)):
        assert ts.simulate(scene, span, **METHODS["taylor"]).raise_if_failed().reached == span[1]
    half = ts.simulate(scene, (5.0, 5.3), **METHODS["taylor"])
    rest = ts.simulate(scene, (5.3, 6.0), state=half.state, **METHODS["taylor"])
    whole = ts.simulate(scene, (5.0, 6.0), **METHODS["taylor"])
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=FINE)
    np.testing.assert_allclose(half.qdd[-1], rest.qdd[0], atol=CLOSE)


@pytest.mark.parametrize("name", ["taylor", "dop853"])
def test_events_and_times_within(name):
    scene, _ = bead(PchipInterpolator(KNOTS, LENGTHS), 0.3)
    plain = ts.simulate(scene, (0.0, 1.0), **METHODS[name])
    both = ts.simulate(
        scene, (0.0, 1.0), events=lambda t, s: s.q[2] + 0.9, t_eval=[0.1, 0.13, 0.4, 1.0], **METHODS[name]
    )
    np.testing.assert_array_equal(both.steps.t, plain.steps.t)
    np.testing.assert_array_equal(both.q[[1, 3]], plain.q[np.isin(plain.t, [0.13, 1.0])])
    np.testing.assert_array_equal(both.qdd[1], plain.qdd[plain.t == 0.13][0])


def test_dense_data():
    """Five thousand knots in a second of slow motion: one step each, of low order."""
    t = np.linspace(0.0, 1.0, 5001)
    scene, _ = bead((t, 1.0 + 0.01 * np.sin(3.0 * t)))
    solution = ts.simulate(scene, (0.0, 1.0), t_eval=(0.0, 1.0)).raise_if_failed()
    assert solution.stats.steps == 5000
    assert solution.stats.rejected == 0
    assert not solution.stats.stiff
    assert solution.stats.evaluations < 9 * 5000


LOADS = {
    "cubic": ts.Table(KNOTS, LENGTHS),
    "steps": PPoly([[1.0, -2.0, 5.0]], [0.0, 0.21, 0.53, 1.0]),
    "line": make_interp_spline(KNOTS, LENGTHS, k=1),
    "sum": 2.0 * M.Piecewise(SPLINES["cubic"]) + M.time,
}


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
def test_steps_end_at_knots_of_loads(load):
    """A mass that is pushed: its velocity is the integral of the load, jumps and all, to rounding."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0)
    scene.add(F.PointForce(mass, force=(load, 0.0, 0.0)))
    solution = ts.simulate(scene, (0.0, 1.0), integrator=I.DOP853(1e-10, 1e-10), dense_output=True).raise_if_failed()
    parts = M.Piecewise(SPLINES["cubic"]) if isinstance(load, M.Smooth) else M.Piecewise(load)
    knots = parts.pieces[0].knots
    assert set(knots) <= set(solution.t)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    t = 0.5 * (knots[1:] + knots[:-1])[:, None] + 0.5 * np.diff(knots)[:, None] * nodes
    f = load(t.ravel()) if isinstance(load, M.Smooth) else parts(t.ravel())
    expected = (0.5 * np.diff(knots) * (f.reshape(t.shape) @ weights)).sum()
    assert solution.qd[-1, 0] == pytest.approx(expected, abs=ALGEBRA)
    assert np.ptp(solution.energy - solution.work) < HELD


def hinge_driven(angle):
    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1, 1, 2), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(C.RotationMotor.of(hinge, angle=angle, name="motor"))
    return ts.simulate(scene, (0.0, 2.0), initial_tol=1e3)


X = np.array([0.0, 1.0, 3.0])
BAD = {
    "a corner": (lambda: hinge_driven(make_interp_spline(X, X**2, k=1)), r"motor: angle: its rate jumps .* t = 1 s"),
    "a step": (lambda: hinge_driven(PPoly([[0.0, 1.0]], [0.0, 1.0, 3.0])), r"its value jumps from 0 to 1 at t = 1 s"),
    "too short": (lambda: hinge_driven((X / 2.0, X)), r"covers 0 to 1.5 s and the run 0 to 2 s"),
    "no extrapolation": (lambda: hinge_driven(CubicSpline(X / 2, X, extrapolate=False)), "covers 0 to 1.5 s"),
    "part of a sum": (lambda: hinge_driven(2.0 * M.Piecewise((X / 2, X))), "covers 0 to 1.5 s"),
    "backwards": (lambda: hinge_driven((X[::-1], X)), "each after the one before"),
    "one time": (lambda: hinge_driven(([0.0], [1.0])), "two or more"),
    "lengths": (lambda: hinge_driven((X, X[:2])), "must be 3 finite numbers"),
    "nan": (lambda: hinge_driven((X, X * np.nan)), "finite"),
    "vectors": (lambda: hinge_driven((X, np.ones((3, 3)))), "3 values a time and must have 1"),
    "complex": (lambda: hinge_driven(CubicSpline(X, X * 1j)), "must be real"),
    "decreasing": (lambda: hinge_driven(PPoly([[1.0, 1.0]], [2.0, 1.0, 0.0])), "each after the one before"),
    "nan inside": (lambda: hinge_driven(PPoly([[1.0, np.nan]], [0.0, 1.0, 3.0])), "finite"),
    "wrap": (
        lambda: hinge_driven(PPoly([[1.0], [0.0]], [0.0, 1.0], extrapolate="periodic")),
        "jumps from 1 to 0",
    ),
    "no data": (lambda: M.Piecewise(lambda t: t), "source must be a ts.Table"),
    "ragged": (
        lambda: ts.Table((0, 1), [[1, 2], [3]]),
        r"2 vectors of three, one for each time, got \[\[1, 2\], \[3\]\]",
    ),
    "three in one": (lambda: M.Piecewise(ts.Table(X, np.ones((3, 3)))), "one value a time, it has 3"),
}


@pytest.mark.parametrize(("call", "words"), BAD.values(), ids=BAD)
def test_what_no_constraint_can_follow(call, words):
    with pytest.raises(ts.TsdynError, match=words):
        call()


def test_a_jump_outside_the_run_is_no_matter():
    scene, _ = bead(PPoly([[0.0, 1.0], [1.0, 1.0]], [0.0, 1.5, 3.0]))
    assert ts.simulate(scene, (0.0, 1.0), **METHODS["taylor"]).success
