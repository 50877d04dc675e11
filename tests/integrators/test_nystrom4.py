"""Nystrom4 against the references: its order, whatever the charts are, and the tableaus that are refused."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.reference import error, load
from tests.helpers.tolerances import ALGEBRA, EPS, FINE, LOOSE
from tsdyn.methods.tableau import NystromTableau, RungeKuttaTableau

SCENES = ("sliding_top", "two_body_pendulum", "two_body_pendulum_spatial")
END = 10.0  # s
STEPS = tuple(1 / (160 * 2**j) for j in range(6))  # s
ORDER_TOL = 0.15


def run(name, step, end=END, **options):
    """A run to the end, and the reference to it."""
    scene, reference = load(name)
    reference = reference.until(end)
    integrator = ts.integrators.Nystrom4(step=step)
    return ts.simulate(scene, (0.0, end), integrator=integrator, t_eval=reference.t, **options), reference


def slope(errors, steps=STEPS):
    """Least-squares slope of log error over log step."""
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def change(one, two):
    """Largest difference in r and A at the end."""
    return max(
        np.abs(a[-1] - b[-1]).max()
        for body_one, body_two in zip(one.scene.bodies, two.scene.bodies, strict=True)
        for a, b in (
            (one.position(body_one), two.position(body_two)),
            (one.rotation(body_one), two.rotation(body_two)),
        )
    )


@pytest.mark.slow_but("sliding_top")
@pytest.mark.parametrize("name", SCENES)
def test_order(name):
    runs = [run(name, step) for step in STEPS]
    errors = np.array([error(*pair) for pair in runs])
    assert 1e-6 < errors[0] < LOOSE
    assert errors[-1] < FINE
    assert abs(slope(errors) - 4.0) < ORDER_TOL
    for solution, _ in runs:
        own = [reason for reason in solution.charts.reason if reason != "start"]
        assert len(own) >= 10


@pytest.mark.slow_but("*sliding_top")
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("interval", [1, 10, 50])
def test_below_truncation_a_chart_changes_rounding_only(name, interval):
    """One second of steps so small that truncation is below 1e-13.

    A new chart rounds the speed to eps of itself, so N of them are a random walk of eps sqrt(N), which turns the body
    by up to that times the angle it has turned.
    """
    step, end = 1 / 16384, 1.0
    free, reference = run(name, step, end)
    assert error(free, reference) < ALGEBRA
    forced, _ = run(name, step, end, chart_interval=interval)
    angle = sum(np.linalg.norm(w) for w in reference.w_body[0]) * end
    assert change(free, forced) < 2 * EPS * np.sqrt(forced.stats.charts) * (1 + angle)


# the tableau itself


def smooth(t, v, vd):
    """A right-hand side in which every partial derivative up to the third is alive."""
    x, y = v
    xd, yd = vd
    return np.array(
        [np.sin(x + 0.5 * y) + xd * yd + 0.3 * xd**2 * y + t * y, np.cos(x * y) - yd**2 * x + xd * np.exp(0.3 * yd) + t]
    )


def one_step(tableau, h, v, vd):
    """A step of a Nystrom tableau from t = 0."""
    a, abar, b, bbar, c = tableau.arrays
    k = np.zeros((len(c), v.size))
    for i in range(len(c)):
        k[i] = smooth(c[i] * h, v + c[i] * h * vd + h * h * abar[i] @ k, vd + h * a[i] @ k)
    return np.concatenate((v + h * vd + h * h * bbar @ k, vd + h * b @ k))


def one_step_first_order(tableau, h, v, vd):
    """A step of a Runge-Kutta tableau from t = 0."""
    a, b, c = tableau.arrays
    y, k = np.concatenate((v, vd)), np.zeros((len(c), 2 * v.size))
    for i in range(len(c)):
        z = y + h * a[i] @ k
        k[i] = np.concatenate((z[v.size :], smooth(c[i] * h, z[: v.size], z[v.size :])))
    return y + h * b @ k


def local_orders(step, tableau):
    """Powers of h of the errors of v and of vd after one step."""
    v, vd = np.array([0.3, -0.7]), np.array([0.9, 0.4])
    errors, steps = [], 0.08 / 2 ** np.arange(4)
    for h in steps:
        exact = solve_ivp(
            lambda t, y: np.concatenate((y[2:], smooth(t, y[:2], y[2:]))),
            (0.0, h), np.concatenate((v, vd)), "DOP853", rtol=1e-13, atol=1e-15,
        ).y[:, -1]  # fmt: skip
        difference = step(tableau, h, v, vd) - exact
        errors.append([np.linalg.norm(difference[:2]), np.linalg.norm(difference[2:])])
    return [slope(np.array(column), steps) for column in zip(*errors, strict=True)]


NYSTROM4 = ts.integrators.Nystrom4
CLASSICAL = NYSTROM4.tableau
RK4 = NYSTROM4.first_order


@pytest.mark.parametrize(("step", "tableau"), [(one_step, CLASSICAL), (one_step_first_order, RK4)])
def test_local_error_of_the_tableau(step, tableau):
    assert min(local_orders(step, tableau)) > 5.0 - ORDER_TOL


def spoilt(tableau):
    """The tableau with one coefficient after the other off by a millionth."""
    for field in dataclasses.fields(tableau):
        value = getattr(tableau, field.name)
        if not isinstance(value, tuple) or not value:
            continue
        for i, entry in enumerate(value):
            if isinstance(entry, tuple):
                for j, x in enumerate(entry):
                    row = (*entry[:j], x + 1e-6, *entry[j + 1 :])
                    yield {field.name: (*value[:i], row, *value[i + 1 :])}
            else:
                yield {field.name: (*value[:i], entry + 1e-6, *value[i + 1 :])}


@pytest.mark.parametrize("tableau", [CLASSICAL, RK4], ids=["NystromTableau", "RungeKuttaTableau"])
def test_every_wrong_coefficient_is_refused(tableau):
    for change in spoilt(tableau):
        with pytest.raises(ts.InvalidArgument, match="condition"):
            dataclasses.replace(tableau, **change)


@pytest.mark.parametrize("tableau", [CLASSICAL, RK4], ids=["NystromTableau", "RungeKuttaTableau"])
def test_an_order_too_high_is_refused(tableau):
    with pytest.raises(ts.InvalidArgument, match="condition"):
        dataclasses.replace(tableau, order=5)


@pytest.mark.parametrize("tableau", [CLASSICAL, RK4], ids=["NystromTableau", "RungeKuttaTableau"])
def test_an_implicit_tableau_is_refused(tableau):
    with pytest.raises(ts.InvalidArgument, match="explicit"):
        dataclasses.replace(tableau, a=((), (1 / 2, 0.0), *tableau.a[2:]))


def test_a_tableau_that_ignores_the_velocity_is_refused():
    """Nystrom's three stages of order 4 for vdd = f(t, v)."""
    none = ((), (0.0,), (0.0, 0.0))
    with pytest.raises(ts.InvalidArgument, match="velocity"):
        NystromTableau(
            a=none, abar=((), (1 / 8,), (0.0, 1 / 2)), b=(1 / 6, 2 / 3, 1 / 6), bbar=(1 / 6, 1 / 3, 0.0),
            c=(0.0, 1 / 2, 1.0), order=4,
        )  # fmt: skip


# Nystrom4 and a fifth stage that vd never sees, its abar zero instead of 1/8: all conditions on vd hold, and on v all
# but bbar abar 1 = 1/24, so a step of v is wrong by h^4
THIRD_ORDER_IN_V = {
    "a": (*CLASSICAL.a, (1 / 2, 0.0, 0.0, 0.0)),
    "abar": (*CLASSICAL.abar, (0.0, 0.0, 0.0, 0.0)),
    "b": (*CLASSICAL.b, 0.0),
    "bbar": (1 / 6, 0.0, 1 / 6, 0.0, 1 / 6),
    "c": (*CLASSICAL.c, 1 / 2),
}


def test_a_tableau_of_lower_order_in_v_is_refused():
    with pytest.raises(ts.InvalidArgument, match="condition"):
        NystromTableau(**THIRD_ORDER_IN_V, order=4)


def test_the_tableau_of_lower_order_in_v_is_of_order_three():
    orders = local_orders(one_step, NystromTableau(**THIRD_ORDER_IN_V, order=3))
    assert abs(orders[0] - 4.0) < ORDER_TOL
    assert orders[1] > 5.0 - ORDER_TOL


def test_tableaus_are_of_the_classes_that_check():
    assert isinstance(CLASSICAL, NystromTableau)
    assert isinstance(RK4, RungeKuttaTableau)
    assert CLASSICAL.order == RK4.order == NYSTROM4.order == 4
