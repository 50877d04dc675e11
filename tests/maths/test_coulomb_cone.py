"""Coulomb's cone: random problems against its laws, contact by contact."""

import numpy as np
import pytest

from tsdyn.maths.complementarity import OPEN, SLIDES, STICKS, solve_cone


def problem(seed):
    """Rows of up to eight contacts of a body of up to 20 coordinates, redundant or not, and its velocities."""
    rng = np.random.default_rng(seed)
    k, n = rng.integers(1, 9), rng.integers(2, 20)
    J = rng.normal(size=(3 * k, n))
    G = J @ np.diag(rng.uniform(0.1, 10, n)) @ J.T
    return G, J @ rng.normal(size=n), rng.choice([0.0, 0.1, 0.3, 0.8], k)


@pytest.mark.parametrize("seed", range(200))
def test_the_laws_of_contact_and_friction(seed):
    G, b, mu = problem(seed)
    p, mode = solve_cone(G, b, mu)
    u, size, force = (G @ p + b).reshape(-1, 3), 1e-10 * np.abs(b).max(), 1e-10 * np.abs(p).max()
    N, T = p[::3], p.reshape(-1, 3)[:, 1:]
    assert N.min() >= 0.0
    assert (u[:, 0] >= -size).all()
    np.testing.assert_allclose(u[force < N, 0], 0.0, atol=size)
    assert (np.linalg.norm(T, axis=1) <= mu * N + force).all()
    for i, (kind, slip) in enumerate(zip(mode, u[:, 1:], strict=True)):
        if kind == STICKS:
            np.testing.assert_allclose(slip, 0.0, atol=size)
        elif kind == SLIDES:  # against the slip, with all of the bound
            np.testing.assert_allclose(
                T[i] * np.linalg.norm(slip), -mu[i] * N[i] * slip, atol=10 * force * size / 1e-10
            )
        else:
            assert kind == OPEN
            assert N[i] == 0.0


def test_a_known_direction_of_slip():
    """By hand: N = 1 / (1 - mu c), T = -mu N d, where a tangential force c changes the normal rate."""
    G = np.array([[1.0, 0.2, 0.0], [0.2, 1.0, 0.0], [0.0, 0.0, 1.0]])
    p, mode = solve_cone(G, np.array([-1.0, 5.0, 0.0]), np.array([0.5]), np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(p, np.array([1.0, -0.5, 0.0]) / 0.9, rtol=1e-14)
    assert mode[0] == SLIDES


def test_no_solution_is_none():
    """Painleve: the normal rate falls with the normal force."""
    G = np.array([[1.0, 0.8, 0.0], [0.8, 1.0, 0.0], [0.0, 0.0, 1.0]])
    p, _ = solve_cone(G, np.array([-1.0, 5.0, 0.0]), np.array([2.0]), np.array([[1.0, 0.0]]))
    assert p is None


def test_dependent_rows_that_disagree_by_rounding():
    """A box in free fall that slides on four corners: its accelerations are small differences of large terms."""
    arms = np.array([(x, y, -1) for x in (-1, 1) for y in (-1, 1)]) * 0.5
    rows = np.array([(*e, *np.cross(arm, e)) for arm in arms for e in np.eye(3)[[2, 0, 1]]])
    b = rows @ [1e-6, 2e-6, -2e-8, 1e-9, 2e-9, 0.0]
    b[0] += 3e-15  # rounding of terms of 10
    slip = np.array([(1.0, 0.0), (0.6, 0.8), (0.8, -0.6), (0.0, 1.0)])
    p, mode = solve_cone(rows @ rows.T, b, np.full(4, 0.4), slip, rounding=1e-13)
    assert (mode == SLIDES).all()
    np.testing.assert_allclose((rows @ (rows.T @ p) + b)[::3], 0.0, atol=1e-14)
    np.testing.assert_allclose(p.reshape(-1, 3)[:, 1:], -0.4 * p[::3, None] * slip, rtol=1e-12)
