"""Tables: what is between their values, jumps, warnings, and what is no motion."""

import warnings

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import ALGEBRA, EXACT, FINE

METHODS = one_of_each(tol=1e-11, step=0.03)
TIMES, VALUES = np.array([0.0, 1.0, 2.0, 4.0, 5.0]), np.array([0.0, 2.0, 2.5, 4.0, 3.0])
WITHIN = np.linspace(0.0, 5.0, 97)
KINDS = {
    "cubic": CubicSpline(TIMES, VALUES)(WITHIN),
    "linear": np.interp(WITHIN, TIMES, VALUES),
    "previous": VALUES[np.searchsorted(TIMES, WITHIN, side="right") - 1],
    "pchip": PchipInterpolator(TIMES, VALUES)(WITHIN),
}
FLANKS = (0, 50, 50.001, 50.1, 50.101, 100), (0, 0, 1, 1, 0, 0)  # an area of 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_values_between_are_those_of_the_kind(kind):
    table = ts.Table(TIMES, VALUES, kind=kind)
    np.testing.assert_allclose(table(WITHIN), KINDS[kind], atol=EXACT * 8)
    np.testing.assert_allclose(table(TIMES), VALUES, atol=EXACT)
    vectors = ts.Table(TIMES, np.outer(VALUES, (1.0, -2.0, 0.0)), kind=kind)
    np.testing.assert_allclose(vectors(WITHIN), np.outer(KINDS[kind], (1.0, -2.0, 0.0)), atol=EXACT * 16)
    assert np.isnan(table((-0.1, 5.1))).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_time_given_twice_is_a_jump(kind):
    table = ts.Table((0, 1, 1, 2, 3, 3), (0, 0, 5, 5, 5, 7), kind=kind)
    np.testing.assert_array_equal(table((0.0, 0.999, 1.0, 2.5, 3.0)), (0.0, 0.0, 5.0, 5.0, 7.0))


def moved(force, span, options):
    """Rate of a mass of 2 kg, at rest at first, that a force moves for some time."""
    scene = ts.Scene(gravity=(0, 0, 0))
    ball = scene.add_point_mass(mass=2.0)
    scene.add(ts.forces.PointForce(ball, force=force))
    solution = ts.simulate(scene, span, **options)
    assert solution.success
    return solution.state.velocity(ball)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_the_momentum_of_jumps_and_flanks(options):
    jumps = ts.Table((0, 0.41, 0.41, 0.43, 0.43, 1), (0, 0, 40, 40, 0, 0), kind="linear")
    held = ts.Table((0, 0.25, 0.5, 1), [(1, 0, 0), (0, 4, 0), (0, 0, 8), (0, 0, 0)], kind="previous")
    np.testing.assert_allclose(moved((0, jumps, 0), (0, 1), options), (0, 0.4, 0), atol=FINE)
    np.testing.assert_allclose(moved(held, (0, 1), options), (0.125, 0.5, 2.0), atol=FINE)


@pytest.mark.parametrize("kind", ["linear", "pchip"])
def test_a_pulse_with_steep_flanks(kind):
    table = ts.Table(*FLANKS, kind=kind)
    np.testing.assert_allclose(moved((0, 0, table), (0, 100), {}), (0, 0, 0.05), atol=ALGEBRA)


def test_a_spline_that_overshoots_warns():
    with pytest.warns(UserWarning, match=r"overshoots: it reaches -3\.7.*e\+06 at t = 16\.68.*kind='pchip'") as found:
        ts.Table(*FLANKS)
    assert found[0].filename == __file__
    with pytest.warns(UserWarning, match="overshoots"):  # of one component
        ts.Table(range(6), [(i, 0.0, float(i > 2)) for i in range(6)])
    with pytest.warns(UserWarning, match=r"reaches 250\.5 .* between the values 1 and 1"):
        ts.Table((0, 0.001, 1, 1.001), (0, 1, 1, 0))


def test_a_spline_of_smooth_data_doesnt_warn():
    t = np.linspace(0.0, 10.0, 41)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for values in (np.sin(t), np.cos(4.0 * t), np.tanh(t - 5.0), t**3, 0.0 * t, 1e9 + np.sin(t)):
            ts.Table(t, values)
        ts.Table((0, 1, 1, 2), (0, 0, 1, 1))
        ts.Table((0, 1), (0, 1))


@pytest.mark.parametrize("kind", ["linear", "previous"])
def test_what_is_no_motion(kind):
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0, position=(1, 0, 0))
    table = ts.Table((0, 1), (1, 2), kind=kind)
    with pytest.raises(ts.InvalidConstraint, match=f"{kind}.* is no motion.*kind='cubic' or 'pchip'"):
        ts.constraints.Distance(ball, scene.ground, point_b=(0, 0, 1), length=table)
    with pytest.raises(ts.InvalidConstraint, match="is no motion"):
        ts.constraints.PointDriver(scene.ground, ball, path=ts.Table((0, 1), np.eye(3)[:2], kind=kind))


def test_pchip_is_a_motion():
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0, position=(1, 0, 0))
    table = ts.Table((0, 1, 2), (1, 1.5, 1.5), kind="pchip")
    scene.add(ts.constraints.Distance(ball, scene.ground, length=table))
    scene.assemble()
    solution = ts.simulate(scene, (0, 2), t_eval=[0.5, 2.0])
    np.testing.assert_allclose(np.linalg.norm(solution.position(ball), axis=1), table((0.5, 2.0)), atol=ALGEBRA)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((0, 1, 1, 1, 2), (0,) * 5), "are a jump"),
        (((0, 0), (0, 1)), "are a jump"),
        (((0, 2, 1), (0,) * 3), "each after the one before"),
        (((0, 1), (0, 1), "line"), "kind must be 'cubic' or 'linear'"),
        (((0, 1), (0, 1), None), "kind must be"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        ts.Table(*arguments)
