"""The gallery of hard cases: degrees of freedom, a reference from the literature, and what makes them hard."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_loops import angles as angles_of
from tests.helpers.tolerances import CLOSE, HELD
from tsdyn.stress.gallery.cases import CASES
from tsdyn.stress.gallery.planar_links import four_bars
from tsdyn.stress.gallery.squeezer import angles, squeezer

FREE = {  # degrees of freedom, redundant rows
    "four-bars, one loop": (1, 3),
    "four-bars, 2 loops": (1, 6),
    "four-bars, 5 loops": (1, 15),
    "Bricard's six-bar": (1, 1),
    "Andrews' squeezer": (1, 9),
    "flyball governor": (2, 0),
    "slider-crank": (1, 3),
    "six-bars, 5 loops": (7, 15),
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
