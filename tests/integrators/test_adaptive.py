"""Adaptive Runge-Kutta methods against the reference solutions, and their names and settings."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.pendulums import pulled_straight
from tests.helpers.reference import demand_every_level, load, run
from tests.helpers.tolerances import HELD

I = ts.integrators
SCENES = ("sliding_top", "two_body_pendulum", "two_body_pendulum_spatial")
TIGHT = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
TOLERANCES = {I.RK45: TIGHT, I.DOP853: TIGHT, I.SDIRK54: TIGHT, I.ImplicitTrapezoid: (1e-3, 1e-5)}


def each(*rows):
    """Parameters, the method first; those of implicit methods are slow: they have kernels of their own."""
    return [
        pytest.param(
            *row, marks=[pytest.mark.slow] * row[0].implicit, id="-".join([row[0].__name__, *map(str, row[1:])])
        )
        for row in rows
    ]


@pytest.mark.parametrize(("method", "tol"), each(*((kind, tol) for kind in TOLERANCES for tol in TOLERANCES[kind])))
@pytest.mark.parametrize("name", SCENES)
def test_error_follows_the_tolerance(name, method, tol):
    """And constraints hold at every output; one Jacobian serves the whole run."""
    solution, off = run(name, method(rtol=tol, atol=tol))
    assert off < max((30.0 if method is I.DOP853 else 100.0) * tol, 3e-11)
    demand_every_level(solution)
    assert solution.stats.jacobians == method.implicit


@pytest.mark.parametrize(
    ("method", "name", "tol", "end"),
    each(
        (I.RK45, "chain_4", 1e-9, 1.0),
        (I.RK45, "chain_16", 1e-6, 0.4),
        (I.SDIRK54, "chain_4", 1e-9, 1.0),
        (I.SDIRK54, "chain_16", 1e-6, 0.4),
        (I.ImplicitTrapezoid, "chain_4", 1e-4, 1.0),
        (I.ImplicitTrapezoid, "chain_16", 1e-3, 0.4),
    ),
)
def test_chains_with_a_force_on_the_last_body(method, name, tol, end):
    solution, off = run(name, method(tol, tol), end)
    assert off < (10.0 if method.implicit else 100.0) * tol
    assert solution.stats.jacobians == method.implicit


@pytest.mark.parametrize(
    ("method", "name", "formulation", "counts"),
    each(
        *((I.RK45, "sliding_top", form, (120, 240, 480, 960)) for form in ("tangent", "maggi-kane")),
        *((I.SDIRK54, name, "tangent", (120, 160, 240, 320)) for name in SCENES),
        *((I.ImplicitTrapezoid, name, "tangent", (200, 400, 800, 1600)) for name in SCENES),
    ),
)
def test_order_with_charts_by_the_criteria(method, name, formulation, counts):
    """On pendulums the next term takes away from that of RK45 in longer steps: order five shows from below."""
    found = [run(name, method(step=1.0 / n), formulation=formulation) for n in counts]
    assert min(solution.stats.charts for solution, _ in found) > 50
    slope = -np.polyfit(np.log(counts), np.log([off for _, off in found]), 1)[0]
    assert abs(slope - method.order) < 0.2


@pytest.mark.parametrize("method", each(*((kind,) for kind in (*TOLERANCES, I.Taylor))))
def test_its_name_stands_for_it_with_the_tolerances_of_simulate(method):
    scene, _ = load("sliding_top")
    for given in ({"rtol": 1e-5, "atol": 1e-5}, {"rtol": 1e-4}, {}):
        one = ts.simulate(scene, (0.0, 0.1), integrator=method.__name__.lower(), **given)
        made = method(**{"rtol": 1e-8, "atol": 1e-8, **given})
        np.testing.assert_array_equal(one.q, ts.simulate(scene, (0.0, 0.1), integrator=made).q)
        assert method.__name__ in str(one)
    with pytest.raises(ts.InvalidArgument, match="rtol"):
        ts.simulate(scene, (0.0, 1.0), integrator=method(), rtol=1e-5)


@pytest.mark.parametrize("method", each(*((kind,) for kind in TOLERANCES)))
def test_fixed_steps(method):
    fixed = ts.simulate(load("sliding_top")[0], (0.0, 1.0), integrator=method(step=0.03))
    np.testing.assert_allclose(fixed.steps.h, [*[0.03] * 33, 0.01], rtol=HELD)
    assert repr(method(step=0.03)) == f"{method.__name__}(step=0.03)"


@pytest.mark.parametrize("method", TOLERANCES)
@pytest.mark.parametrize(
    ("setting", "value"),
    [("rtol", 0.0), ("atol", np.nan), ("step", -1.0), ("max_step", "1"), ("first_step", 0.0), ("rtol", np.inf)],
)
def test_wrong_settings(method, setting, value):
    with pytest.raises(ts.InvalidArgument, match=f"{method.__name__}: {setting}"):
        method(**{setting: value})


def test_evaluations_of_rk45_are_counted():
    solution, _ = run("sliding_top", I.RK45(1e-8, 1e-8))
    tried = solution.stats.steps + solution.stats.rejected
    assert 6 * tried <= solution.stats.evaluations <= 6 * tried + 2 + solution.t.size


def test_a_collapsing_step_says_where_and_hands_back_what_it_had():
    solution = ts.simulate(pulled_straight(), (0.0, 2.0), integrator=I.RK45(1e-8, 1e-8))
    assert not solution.success
    assert 0.9 < solution.t[-1] <= 1.0
    assert np.isfinite(solution.q).all()
    assert "t = " in solution.message
    assert any(name in solution.message for name in ("upper", "lower", "reach"))
