"""The gallery of hard cases: degrees of freedom, a reference from the literature, and what makes them hard."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_loops import angles as angles_of
from tests.helpers.tolerances import CLOSE, HELD
from tsdyn.stress.gallery import CASES, bricard, driven_six_bar, four_bars
from tsdyn.stress.squeezer import angles, squeezer

FREE = {  # degrees of freedom, redundant rows
    "four-bars, one loop": (1, 3),
    "four-bars, 2 loops": (1, 6),
    "four-bars, 5 loops": (1, 15),
    "Bricard's six-bar": (1, 1),
    "Andrews' squeezer": (1, 9),
    "flyball governor": (2, 0),
    "slider-crank": (1, 3),
    "six-bars, 5 loops": (7, 15),
    "driven six-bar": (2, 8),
    "sleeping top": (5, 0),
    "Kapitza's pendulum": (3, 0),
    "struck pendulum": (1, 0),
}


@pytest.mark.parametrize("case", [case for case in CASES if case.name in FREE], ids=lambda case: case.name)
def test_mobility(case):
    found = case.build().mobility()
    assert (found.degrees_of_freedom, len(found.redundant)) == FREE[case.name]


def test_the_squeezer_ends_where_hairer_and_wanner_say():
    """Table of the test set for IVP solvers: beta, gamma, delta, epsilon at 0.03 s."""
    solution = ts.simulate(squeezer(), (0.0, 0.03), rtol=1e-11, atol=1e-11).raise_if_failed()
    expected = 15.81077119629904, 0.04082224013073101, 0.5244099658805304, 1.048080741042263
    np.testing.assert_allclose(angles(solution)[-1], expected, atol=CLOSE)


def test_large_cases_have_their_sizes():
    sizes = {case.name: len(case.build().bodies) for case in CASES if case.name.startswith(("hub", "net"))}
    assert sizes == {"hub of 500 bodies": 500, "net of 500 loops": 1045}


@pytest.mark.slow
@pytest.mark.parametrize(
    "integrator",
    [ts.integrators.DOP853(1e-10, 1e-10), ts.integrators.RK45(1e-9, 1e-9), ts.integrators.Nystrom4(step=2e-3), None],
    ids=lambda method: type(method).__name__,
)
def test_rows_of_sixty_loops_pass_their_flat_positions(integrator):
    """1026 rows, 180 of them redundant: the selection next to the flat position is among all of them."""
    solution = ts.simulate(four_bars(60), (0.0, 1.6), integrator=integrator).raise_if_failed()
    turned = angles_of(solution)
    assert turned[0][-1] - turned[0][0] < -1.5 * np.pi
    assert max(np.abs(one - turned[0]).max() for one in turned) < CLOSE
    assert np.ptp(solution.energy) < CLOSE * solution.kinetic_energy.max()
    assert solution.constraint_error.position.max() < HELD


I = ts.integrators
SMOOTH = {  # options, steps at most, distance of q from the motion at 1e-12
    "taylor": ({"rtol": 1e-9, "atol": 1e-9}, 60, 1e-7),
    "dop853": ({"integrator": I.DOP853(1e-9, 1e-9)}, 250, 1e-8),
    "rk45": ({"integrator": I.RK45(1e-8, 1e-8)}, 400, 1e-6),
    "nystrom4": ({"integrator": I.Nystrom4(step=2e-3)}, 1000, 3e-6),
    "dop853, null-space": ({"integrator": I.DOP853(1e-9, 1e-9), "formulation": "null-space"}, 250, 1e-8),
    "radau": ({"integrator": I.Radau(1e-8, 1e-8)}, 250, 1e-5),
    "sdirk54": ({"integrator": I.SDIRK54(1e-8, 1e-8)}, 700, 1e-6),
}


@pytest.mark.slow_but("rk45", "dop853, null-space")
@pytest.mark.parametrize("method", SMOOTH)
def test_all_methods_make_one_motion_of_a_linkage_whose_kept_rows_become_dependent(method):
    """Phi_q keeps its rank; steps are those of a smooth motion, and nothing passes for a singular configuration."""
    options, most, error = SMOOTH[method]
    expected = ts.simulate(driven_six_bar(), (0.0, 2.0), rtol=1e-12, atol=1e-12).raise_if_failed()
    solution = ts.simulate(driven_six_bar(), (0.0, 2.0), **options).raise_if_failed()
    assert "singular" not in solution.message
    assert solution.stats.steps <= most
    np.testing.assert_allclose(solution.q[-1], expected.q[-1], rtol=0.0, atol=error)
    assert solution.constraint_error.position.max() < HELD


@pytest.mark.slow
@pytest.mark.parametrize("tol", 10.0 ** -np.arange(6.0, 11.5, 0.5))
@pytest.mark.parametrize("order", [5, 9, 13])
def test_radau_follows_a_loop_whose_redundant_row_changes(order, tol):
    """Bricard's six-bar falls freely: its energy stays, and it ends where Taylor's method says."""
    end = 20.0 if order > 5 else 5.0
    expected = ts.simulate(bricard(), (0.0, end), rtol=1e-13, atol=1e-13).raise_if_failed()
    solution = ts.simulate(bricard(), (0.0, end), integrator=I.Radau(tol, tol, order=order)).raise_if_failed()
    assert np.ptp(solution.energy) < 3e4 * tol  # of 100 J, and as rods turn 60 rad
    np.testing.assert_allclose(solution.q[-1], expected.q[-1], rtol=0.0, atol=1e5 * tol)
