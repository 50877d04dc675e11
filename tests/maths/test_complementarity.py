"""Linear complementarity: solutions of random problems, degenerate ones included, and proofs that there is none."""

import numpy as np
import pytest
from scipy.optimize import linprog

from tsdyn.maths.complementarity import complement


def residual(M, q, z):
    """The largest violation of 0 <= z, w >= 0, z w = 0, relative to the numbers of the problem."""
    w = M @ z + q
    return max(-z.min(), -w.min(), np.abs(z * w).max()) / (1.0 + np.abs(q).max() * (1.0 + np.abs(z).max()))


@pytest.mark.parametrize("seed", range(300))
def test_positive_semidefinite_problems_are_solved_or_proved_infeasible(seed):
    """Feasible ones have a solution for M positive semidefinite; linear programming decides independently."""
    rng = np.random.default_rng(seed)
    n, rank = rng.integers(1, 13), rng.integers(1, 13)
    A = rng.normal(size=(n, rank)).round(int(rng.integers(0, 3)))  # many ties
    M = A @ A.T
    q = M @ rng.normal(size=n) if seed % 2 else rng.normal(size=n)
    z, basic = complement(M, q)
    feasible = linprog(np.zeros(n), A_ub=-M, b_ub=q, bounds=(0, None)).status == 0
    assert (z is not None) == feasible
    if z is not None:
        assert residual(M, q, z) < 1e-9
        assert not z[~basic].any()
        assert np.linalg.matrix_rank(M[np.ix_(basic, basic)]) == basic.sum()


def test_a_box_on_four_corners_stands_on_three():
    """Four forces of a plane box are redundant: a basic solution carries the weight on three at most."""
    corners = np.array([(1, x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    M = corners @ np.diag([1.0, 3.0, 3.0]) @ corners.T
    z, basic = complement(M, corners @ [-9.81, 0.3, 0.2])
    assert basic.sum() <= 3
    np.testing.assert_allclose(corners.T @ z, [9.81, -0.1, -0.2 / 3], atol=1e-13)


def test_rows_that_nothing_can_move_have_no_solution():
    assert complement(np.zeros((1, 1)), np.array([-1.0]))[0] is None
    assert complement(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1.0, -1.0]))[0] is None
    np.testing.assert_array_equal(complement(np.zeros((2, 2)), np.zeros(2))[0], [0.0, 0.0])
