"""Surveys of several functions at once: those without a zero, and where others cross zero first."""

import numpy as np
import pytest

from tsdyn.maths.root_isolation import survey


def polynomials(rng, m):
    """Random functions of one variable, m of them, and the first crossing of each from above within [0, 1], or inf."""
    roots = rng.uniform(-0.5, 1.6, (m, 3)).round(3)
    scale = 10.0 ** rng.uniform(-3, 3, m)

    def values(t):
        return scale * np.prod(t[:, None, None] - roots, axis=-1)

    first = [min((r for r in own if 0.0 < r <= 1.0), default=np.inf) for own in roots]
    return values, np.array(first)


@pytest.mark.parametrize("seed", range(300))
def test_a_survey_misses_no_zero(seed):
    """Functions that it calls clear have none; each clear stretch ends before the first, a bracket holds it."""
    rng = np.random.default_rng(seed)
    values, first = polynomials(rng, 12)
    seen = survey(values, 0.0, values(np.zeros(1))[0], 1.0, 4, np.zeros(12))
    for j, root in enumerate(first):
        assert seen.since[j] <= root
        assert (seen.since[j] == np.inf) <= (root == np.inf)
        if seen.until[j] == seen.until[j]:
            assert seen.since[j] <= root <= seen.until[j]
            t, slope = seen.root(j)
            assert abs(t - root) < 1e-9
            step = 1e-6
            difference = (values(np.array([t + step])) - values(np.array([t - step])))[0, j] / (2 * step)
            assert abs(slope - difference) <= 1e-5 * (abs(slope) + abs(difference))
    np.testing.assert_array_equal(seen.samples[-1], values(np.ones(1))[0])


def test_a_survey_refines_its_interpolants_as_far_as_functions_need():
    calls = []

    def values(t):
        calls.append(t.size)
        return np.stack((2.0 + np.sin(20 * t), 1.0 - 0.5 * t), axis=1)

    seen = survey(values, 0.0, values(np.zeros(1))[0], 1.0, 4, np.zeros(2))
    assert seen.degree == 32
    assert seen.since == [np.inf, np.inf]
    assert sum(calls) == 1 + 33  # no value is asked for twice
    broken = survey(lambda t: np.full((t.size, 1), np.nan), 0.0, np.ones(1), 1.0, 4, np.zeros(1))
    assert broken.since == [0.0]
