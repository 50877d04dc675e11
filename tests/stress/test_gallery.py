"""The gallery of hard cases: degrees of freedom, a reference from the literature, and what makes them hard."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import CLOSE
from tsdyn.stress.gallery.cases import CASES
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
