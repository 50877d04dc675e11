"""Sizes of vectors, four numbers at a time: what isn't finite is found wherever it is."""

import numpy as np
import pytest

from tsdyn.maths.dense_linalg import is_finite, largest


@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 8, 11])
def test_largest_magnitude_and_numbers_that_are_not_finite(n):
    x = np.random.default_rng(n).normal(size=n)
    assert is_finite(x)
    assert largest(x) == np.abs(x).max(initial=0.0)
    for i in range(n):
        for bad in (np.nan, np.inf, -np.inf):
            y = x.copy()
            y[i] = bad
            assert not is_finite(y)
            assert largest(y) == np.inf


def test_numbers_whose_sum_overflows_are_finite():
    x = np.full(6, 1.5e308)
    assert is_finite(x)
    assert largest(x) == 1.5e308
