"""Sparse factors are the same in another thread."""

import numpy as np
from scipy.sparse import diags_array

from tsdyn.maths import dense_linalg as module


def test_large_matrices(monkeypatch):
    matrix = diags_array([np.full(9, -1.0), np.full(10, 3.0), np.full(9, -1.0)], offsets=[-1, 0, 1]).tocsc()
    small = module.sparse_lu(matrix)
    monkeypatch.setattr(module, "LONG_LU", 1)
    large = module.sparse_lu(matrix)
    for name in ("L", "U", "perm_c"):
        one, other = getattr(small, name), getattr(large, name)
        assert (one != other).sum() == 0
    np.testing.assert_array_equal(large.solve(np.ones(10)), small.solve(np.ones(10)))
