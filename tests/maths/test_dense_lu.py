"""The dense LU factorisation against NumPy."""

import numpy as np
import pytest

from tests.helpers.tolerances import CLOSE, EPS
from tsdyn.jit.kernels import entry
from tsdyn.maths.dense_linalg import lu, lu_solve


@entry
def factor_and_solve(A, pivots, b):
    """An entry for `lu` and `lu_solve`."""
    if not lu(A, pivots, b.size):
        return False
    lu_solve(A, pivots, b, b.size)
    return True


@pytest.mark.parametrize("n", [1, 2, 3, 7, 20])
def test_lu(n, rng):
    """Dense, and with a diagonal of zeros, which needs the exchange of rows."""
    matrices = [rng.normal(size=(n, n)), rng.normal(size=(n, n)) * 10.0 ** rng.integers(-8, 8, size=(n, 1))]
    if n > 1:
        matrices.append(matrices[0] - np.diag(np.diag(matrices[0])) if n > 2 else np.array([[0.0, 2.0], [3.0, 0.0]]))
    for A in matrices:
        b = rng.normal(size=n)
        x, pivots = b.copy(), np.zeros(n, np.int64)
        assert factor_and_solve(A.copy(), pivots, x)
        residual = np.abs(A @ x - b)
        assert (residual <= 20 * n * EPS * (np.abs(A) @ np.abs(x) + np.abs(b))).all()
        np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=CLOSE * np.linalg.cond(A / np.abs(A).max(1)[:, None]))


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_lu_refuses(bad):
    A = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [1.0, 1.0, 1.0]]) if bad == 0.0 else np.eye(3)
    if bad != 0.0:
        A[1, 1] = bad
    assert not factor_and_solve(A, np.zeros(3, np.int64), np.ones(3))
