"""Dense equations and products against NumPy, and their bits with several threads of its linear algebra."""

import numpy as np
import pytest

from tests.helpers.tolerances import CLOSE
from tsdyn.maths.dense_solve import least_squares, null_space, product, solve


@pytest.mark.parametrize(("n", "rank"), [(1, 1), (6, 6), (12, 9), (60, 40)])
def test_the_shortest_solution_of_dependent_equations(n, rank, rng):
    J = rng.normal(size=(n, rank))
    G, x = J @ J.T, rng.normal(size=rank)
    found = least_squares(G, G @ (J @ x), 1e-14)
    np.testing.assert_allclose(found, J @ x, atol=CLOSE * np.abs(J @ x).max() * np.linalg.cond(J) ** 2)


@pytest.mark.parametrize("shape", [(7, 4), (4, 7), (5, 5), (0, 3), (3, 0)])
@pytest.mark.parametrize("rank", [0, 2, 9])
def test_least_squares_of_several_right_sides(shape, rank, rng):
    m, n = shape
    A, B = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n)), rng.normal(size=(m, 3))
    found = least_squares(A, B, 1e-10)
    assert found.shape == (n, 3)
    np.testing.assert_allclose(found, np.linalg.lstsq(A, B, rcond=1e-10)[0], atol=1e-12)


def test_a_generalised_inverse(rng):
    A = rng.normal(size=(9, 4)) @ rng.normal(size=(4, 9))
    np.testing.assert_allclose(least_squares(A, np.eye(9), 1e-12), np.linalg.pinv(A, rcond=1e-12), atol=1e-11)


def test_equations_and_products(rng):
    A, B = rng.normal(size=(12, 12)), rng.normal(size=(12, 5))
    np.testing.assert_allclose(solve(A, B[:, 0]), np.linalg.solve(A, B[:, 0]), rtol=1e-10)
    assert solve(A - np.outer(A[:, 0], np.eye(12)[0]), B[:, 0]) is None
    np.testing.assert_allclose(product(A.T, B), A.T @ B, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("shape", [(7, 4), (4, 7), (5, 5), (0, 3), (3, 0)])
@pytest.mark.parametrize("rank", [0, 2, 9])
def test_an_orthonormal_basis_of_a_null_space(shape, rank, rng):
    m, n = shape
    A = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    Z = null_space(A, 1e-10)
    assert Z.shape == (n, n - min(m, n, rank))
    np.testing.assert_allclose(Z.T @ Z, np.eye(Z.shape[1]), atol=CLOSE)
    np.testing.assert_allclose(A @ Z, 0.0, atol=CLOSE * max(np.abs(A).max(initial=0.0), 1.0))
