"""Linear complementarity: 0 <= z, w = M z + q >= 0, z.w = 0, by Lemke's method with lexicographic pivots."""

import numpy as np

from .tolerances import LEAST_PIVOT, NEGLIGIBLE

# Lemke's method: w - M z - d z0 = q with an artificial z0 >= 0, which enters first and leaves last.
#
# Complementary pivots keep w.z = 0. The row that leaves is the lexicographically smallest of the ratios of (q, I) in
# the present basis, so no basis comes twice. For M positive semidefinite, symmetric or not, a ray of z0 > 0 proves that
# q has no solution (Cottle, Pang, Stone, The Linear Complementarity Problem, 4.4).


def lemke(M, q):
    """Solve a linear complementarity problem.

    Parameters
    ----------
    M : ndarray (n, n)
        Positive semidefinite.
    q : ndarray (n,)

    Returns
    -------
    z : ndarray (n,) or None
        A solution, basic: the rows and columns of M where z is basic are nonsingular. None where there is none.
    basic : ndarray (n,), bool
        Where w is held at zero by z.
    """
    M, q = np.asarray(M, float), np.asarray(q, float)
    n = q.size
    z, basic = np.zeros(n), np.zeros(n, bool)
    if n == 0 or q.min() >= 0.0:
        return z, basic
    if n == 1:
        return (-q / M[0], ~basic) if M[0, 0] > 0.0 else (None, basic)
    # Rows and columns scaled to a unit diagonal, q to one
    scale = np.sqrt(np.where(np.diag(M) > 0.0, np.diag(M), 1.0))
    size = np.abs(q / scale).max()
    # Columns: w, z, z0, then (q, I), by which rows are compared
    own = np.eye(n)
    T = np.hstack([own, -M / scale[:, None] / scale, -np.ones((n, 1)), (q / scale / size)[:, None], own])
    basis, keys, artificial = np.arange(n), slice(2 * n + 1, None), 2 * n
    entering, row = artificial, min(range(n), key=lambda i: tuple(T[i, keys]))
    while True:
        T[row] /= T[row, entering]
        others = np.arange(n) != row
        T[others] -= np.outer(T[others, entering], T[row])
        leaving, basis[row] = basis[row], entering
        if leaving == artificial:
            break
        entering = leaving + n if leaving < n else leaving - n
        rows = np.flatnonzero(T[:, entering] > LEAST_PIVOT)
        if not rows.size:  # a ray; at the boundary of what has a solution z0 is zero but for rounding
            if T[basis == artificial, 2 * n + 1].item() > NEGLIGIBLE:
                return None, basic
            break
        row = min(rows, key=lambda i: (*(T[i, keys] / T[i, entering]), basis[i] != artificial))
    held = basis[(basis >= n) & (basis < artificial)] - n
    basic[held] = True
    # The solution anew from its basis, without the rounding of the pivots
    z[held] = np.linalg.solve(M[np.ix_(held, held)], -q[held])
    return np.maximum(z, 0.0), basic
