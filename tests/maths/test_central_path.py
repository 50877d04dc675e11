"""Points deep in Coulomb's cones, against cone programs whose solutions are known."""

import numpy as np
import pytest

from tsdyn.maths.central_path import MARGIN, deepest, proportional


def test_two_cones_that_brace_each_other_share_the_margin():
    """Along (1, 0, -mu', 1, 0, mu') / size the margins of both contacts grow until one is a tenth of the largest."""
    mu, way = np.array([0.5, 0.5]), np.array([1.0, 0.2, 0.0, 1.0, -0.2, 0.0])
    p = np.array([[2.0, 1.0, 0.0], [1.0, 0.1, 0.0]])  # the first one is at its edge
    found = deepest(mu, p, way[:, None] / np.linalg.norm(way))
    moved = (found - p).ravel()
    np.testing.assert_allclose(moved, moved[0] * way, atol=1e-14)
    N, T = found[:, 0], np.hypot(found[:, 1], found[:, 2])
    assert (N - T / mu > 0.1 * MARGIN * N.max()).all()


@pytest.mark.parametrize("edge", [1e-3, 1e-5])
def test_the_end_of_the_path_is_the_one_point_within_both_cones(edge):
    """N_1 = 1 + y, N_2 = 1 - y, both with T = mu (1 - edge): the margins edge + y and edge - y are largest at y = 0."""
    mu, way = np.array([0.3, 0.3]), np.array([1.0, 0.0, 0.0, -1.0, 0.0, 0.0]) / np.sqrt(2.0)
    T = 0.3 * (1.0 - edge)
    p = np.array([[1.0 + 0.5 * edge, T, 0.0], [1.0 - 0.5 * edge, 0.0, T]])
    np.testing.assert_allclose(deepest(mu, p, way[:, None]), [[1.0, T, 0.0], [1.0, 0.0, T]], atol=1e-7)


def test_points_beyond_all_cones_stay_finite():
    """Margins y - 1 and -y - 1: no point lies within; the nearest to both cones is y = 0."""
    mu, way = np.array([1.0, 1.0]), np.array([1.0, 0.0, 0.0, -1.0, 0.0, 0.0]) / np.sqrt(2.0)
    p = np.array([[1.5, 2.0, 0.0], [0.5, 2.0, 0.0]])
    np.testing.assert_allclose(deepest(mu, p, way[:, None])[:, 0], 1.0, atol=1e-7)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_forces_along_one_line_are_in_proportion_to_their_bounds(d):
    """Of three forces in d directions, the first two with the same effect; the third alone in its own."""
    effect = np.zeros((3, d, 2 * d))
    effect[0, :, :d] = effect[1, :, :d] = effect[2, :, d:] = np.eye(d)
    T = np.arange(3.0 * d).reshape(3, d) - 1.0
    found, total = proportional(np.array([1.0, 3.0, 2.0]), effect, T), T[0] + T[1]
    np.testing.assert_allclose(found, [0.25 * total, 0.75 * total, T[2]], atol=1e-13)


def test_a_force_near_its_bound_is_relieved_by_others():
    """Forces (x, 1, x + 1.5) across a rod: in proportion 0.917 of the last bound, at best 0.75, where x = -0.75."""
    effect = np.array([(1.0, -1.0), (1.0, 0.0), (1.0, 1.0)])[:, None]
    T, bounds = np.array([[-0.25], [0.0], [1.25]]), np.array([1.0, 4.0, 1.0])
    found = proportional(bounds, effect, T)
    np.testing.assert_allclose(found.ravel() @ effect[:, 0], T.ravel() @ effect[:, 0], atol=1e-12)
    assert 0.75 < found[2, 0] < 0.9
