"""Smooth motions: value, derivatives and series, by their program, by jets and by truncated series; bad input."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.motion_series import ORDER, series
from tests.helpers.tolerances import ALGEBRA, HELD, ROUNDING, TIGHT
from tsdyn.maths.power_series import Truncated

M = ts.motions
t = M.time
MOTIONS = {
    "constant": M.Constant(1.5),
    "ramp": M.Ramp(0.5, -2.0),
    "polynomial": M.Polynomial((1.0, -2.0, 0.5, 3.0, -0.25)),
    "long polynomial": M.Polynomial(1.0 / (1.0 + np.arange(30.0))),
    "sine": M.Sine(0.3, 4.0, phase=0.7, offset=1.0),
    "exponential": M.Exponential(2.0, -0.8, offset=-0.5),
    "sum": M.Sine(0.3, 4.0) + M.Ramp(1.0, 2.0) - 0.5,
    "product": M.Sine(0.3, 4.0) * M.Exponential(1.0, -0.5) * M.Polynomial((1.0, 0.0, 1.0)),
    "quotient": M.Sine(1.0, 2.0) / (2.0 + M.Sine(1.0, 3.0)),
    "reverse": (1.0 - t) + 2.0 / (1.0 + t * t) - (-t) + np.float64(2.0) * t,
    "powers": t**3 + (1.0 + t * t) ** -1.5 + (2.0 + t) ** 0.5 + t**0 + t**1 + t**7,
    "functions": np.sin(t) + np.cos(2.0 * t) + np.exp(-t) + np.sqrt(1.0 + t * t) + np.square(t),
    "more functions": np.tanh(t) + np.arctan(t) + np.log(2.0 + t) + np.tan(0.3 * t) + np.sinh(t) - np.cosh(t),
    "nested": np.sin(np.exp(0.3 * np.cos(t * t)) / (1.0 + np.tanh(t) ** 2)),
}
TIMES = (0.0, 0.37, 1.1)


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_the_program_gives_the_series(motion, time):
    expected = motion(Truncated([time, 1.0, *[0.0] * (ORDER - 2)])).c
    got = series(motion, time)
    scale = np.maximum.accumulate(np.abs(expected)) + 1e-300
    assert (np.abs(got - expected) / scale).max() < HELD
    np.testing.assert_allclose(series(motion, time, 3), got[:3], rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize("motion", [*MOTIONS.values(), np.tanh(3.0 * t)], ids=[*MOTIONS, "steep"])
def test_the_series_sums_to_the_motion(motion, time):
    for step in (0.03, -0.08):
        value = np.polynomial.polynomial.polyval(step, series(motion, time, 30))
        assert value == pytest.approx(motion(time + step), rel=ALGEBRA, abs=ALGEBRA)


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_value_and_derivatives_are_those_of_the_series(motion, time):
    c = series(motion, time, 3)
    given = float(motion(time)), float(motion.rate(time)), float(motion.acceleration(time))
    np.testing.assert_allclose(given, (c[0], c[1], 2.0 * c[2]), rtol=HELD, atol=ALGEBRA)
    step = motion(time + 1e-30j).imag / 1e-30 if not isinstance(motion, M.Constant) else 0.0
    assert given[1] == pytest.approx(step, rel=HELD, abs=ALGEBRA)


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_arrays_of_times(motion):
    times = np.array(TIMES)
    for function in (motion, motion.rate, motion.acceleration):
        assert function(times).shape == times.shape
        np.testing.assert_allclose(function(times), [function(x) for x in TIMES], rtol=ROUNDING, atol=ROUNDING)


def test_what_is_used_twice_is_computed_once():
    motion = t
    for _ in range(40):
        motion = 0.5 * motion * motion + 0.1
    assert len(motion.program()) < 20000
    assert math.isfinite(motion(0.5))
    assert series(motion, 0.5, 3)[0] == pytest.approx(motion(0.5), rel=ALGEBRA)


def test_long_sums():
    motion = sum((M.Sine(1.0 / n, n) for n in range(1, 1200)), M.Constant(0.0))
    assert series(motion, 0.3, 3)[0] == pytest.approx(motion(0.3), rel=TIGHT)


BAD = {
    "no coefficients": lambda: M.Polynomial(()),
    "a number": lambda: M.Polynomial(3.0),
    "text": lambda: M.Polynomial("abc"),
    "nan": lambda: M.Polynomial((1.0, np.nan)),
    "constant": lambda: M.Constant("1"),
    "ramp": lambda: M.Ramp(0.0, math.inf),
    "sine": lambda: M.Sine(1.0, None),
    "phase": lambda: M.Sine(1.0, 1.0, phase=1j),
    "exponential": lambda: M.Exponential(1.0, [1.0]),
    "sum": lambda: t + "1",
    "product": lambda: t * None,
    "power": lambda: t**math.nan,
    "motion to a motion": lambda: t**t,
    "array": lambda: np.ones(3) * t,
}


@pytest.mark.parametrize("call", BAD.values(), ids=BAD)
def test_bad_numbers(call):
    with pytest.raises(ts.InvalidArgument, match=r"finite number"):
        call()


@pytest.mark.parametrize("function", [np.abs, np.sign, np.floor, np.maximum, bool, float, math.sin], ids=str)
def test_what_is_not_smooth(function):
    with pytest.raises(TypeError):
        function(t) if function is not np.maximum else function(t, 0.0)


def branching(x):
    return 1.0 if x < 2.0 else 2.0


def helped(x):
    return _helper(x)


def _helper(x):
    return math.sin(x)


def raising(x):
    raise ValueError("no value")


UNDERIVED = {
    "branch": branching,
    "raising": raising,
    "abs": lambda x: 1.0 + np.abs(x),
    "text": lambda x: "abc",
    "two": lambda x: (x, x),
}


@pytest.mark.parametrize("f", UNDERIVED.values(), ids=UNDERIVED)
def test_what_can_not_be_derived_says_so(f):
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.0))
    with pytest.raises(ts.InvalidConstraint, match=r"string: length.*(\(f, fd, fdd\)|return a number)"):
        ts.constraints.Distance(bead, scene.ground, length=f, name="string")


def imported(x):
    return 1.0 + 0.1 * math.sin(3.0 * x) + 0.1 * math.exp(-x) + 0.1 * math.atan(x) ** 2 + math.pow(1.0 + x, 2) + math.pi


def test_functions_of_math_are_known():
    motion = ts.Motion(imported)
    for time in TIMES:
        value, rate, gain = motion.value(time)
        assert value == pytest.approx(imported(time), rel=ROUNDING)
        c = motion.smooth(Truncated([time, 1.0, 0.0])).c
        assert (rate, gain) == (pytest.approx(c[1], rel=HELD), pytest.approx(2.0 * c[2], rel=HELD))
    assert motion.has_series


def test_functions_in_functions_are_known():
    assert ts.Motion(helped).value(0.3)[1] == pytest.approx(math.cos(0.3), rel=ROUNDING)
    assert ts.Motion(t).has_series


def test_a_motion_is_refused_where_it_is_not_finite():
    with pytest.raises(ts.InvalidConstraint, match="not finite at t = 0"):
        ts.Motion(np.log(t))
    with pytest.raises(ts.InvalidConstraint, match="three functions"):
        ts.Motion(lambda x: x, lambda x: 1.0)
