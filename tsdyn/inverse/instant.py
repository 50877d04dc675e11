"""Loads and multipliers of one instant, the loads as small as can be.

    [ -delta M   H^T   -B ] [ mu  ]   [ d ]
    [  H         0      0 ] [ lam ] = [ 0 ]        u = B^T mu,    H: independent rows of Phi_q
    [ -B^T       0      I ] [ u   ]   [ 0 ]

delta is zero, unless actuators can't move the scene in every direction: then a small one leaves what they can't give,
M delta mu, to be refused if it is more than rounding. Matrices are dense, or sparse for many bodies.
"""

import numpy as np

from ..errors import SingularConfiguration
from ..observables.evaluate import mass_matrix_sparse
from ..statics.motion import roots_of_masses
from .tolerances import DELTA, LEAST_DIVISOR, REFINEMENTS, SOLVED


class Instant:
    """The equations of one instant."""

    def __init__(self, system, at, Phi_q, kept, B):
        self.t, q = self.at = at
        self.Phi_q, self.kept, self.B, self.H = Phi_q, kept, B, Phi_q[kept]
        self.system, self.q, self.root = system, q, roots_of_masses(system, q.size)
        self.carried, self.u, self._factors = np.zeros(q.size), None, {}
        self._left, self._delta = np.zeros(q.size), 0.0

    def solve(self, load):
        """(mu, lam) of a load d (n,), lam (m,) with NaN for redundant rows; u of it is kept."""
        n, m = load.size, self.kept.size
        for delta in (0.0, DELTA * float((self.B * self.B).sum(axis=0).max() or 1.0)):
            self._delta = delta
            x = self._refined(load)
            if x is None:
                continue
            largest = max(np.abs(part / self.root**2).max() for part in (load, self.carried))
            if delta or np.abs(self._left / self.root**2).max() <= SOLVED * largest:
                lam = np.full(self.Phi_q.shape[0], np.nan)
                lam[self.kept], self.u = x[n : n + m], x[n + m :]
                return np.concatenate((x[:n], lam))
        raise SingularConfiguration(
            f"inverse_dynamics: Phi_q has lost rank at t = {self.t:g} s, a singular configuration, where loads are not "
            "determined. Leave this time out."
        )

    def effect(self, j):
        """Accelerations by a unit load under the constraints, over those without them."""
        b = self.B[:, [j]] if isinstance(self.B, np.ndarray) else self.B[:, [j]].toarray()
        solve = Instant(self.system, self.at, self.Phi_q, self.kept, self.B[:, :0])._factorised(1.0)
        if solve is None:
            return 1.0
        gains, alone = solve(b[:, 0])[: self.q.size] * self.root, b[:, 0] / self.root
        return np.abs(gains).max() / max(np.abs(alone).max(), LEAST_DIVISOR)

    def missing(self, load):
        """Accelerations (n,) that the actuators can't give."""
        if not self._delta:
            return self._left / self.root**2
        return self._delta * self._factor()(self._left)[: load.size]

    def _refined(self, load):
        solve = self._factor()
        if solve is None:
            return None
        x, n, m = 0.0, load.size, self.kept.size
        self._left = load
        for _ in range(1 + REFINEMENTS):
            x = x + solve(self._left)
            self.carried = self.H.T @ x[n : n + m]
            self._left = load - self.carried + self.B @ x[n + m :]
        return x if np.isfinite(x).all() else None

    def _factor(self):
        """Return solve(d) by a factorisation, None where the matrix is singular."""
        if self._delta not in self._factors:
            self._factors[self._delta] = self._factorised(self._delta)
        return self._factors[self._delta]

    def _factorised(self, delta):
        """The same of the matrix with scaled rows and columns: unit masses, unit rows of H."""
        dense, a = isinstance(self.H, np.ndarray), self.B.shape[1]
        H, B = _scaled(self.H, self.root, axis=1), _scaled(self.B, self.root, axis=0)
        lengths = np.maximum(np.sqrt((H * H).sum(axis=1)), LEAST_DIVISOR)
        H, M = _scaled(H, lengths, axis=0), None
        if delta:
            M = mass_matrix_sparse(self.system, self.q)
            M = -delta * _scaled(_scaled(M.toarray() if dense else M, self.root, axis=0), self.root, axis=1)
        weights = np.concatenate((1.0 / self.root, 1.0 / lengths, np.ones(a)))
        solve = (_dense_factors if dense else _sparse_factors)(M, H, B)
        if solve is None:
            return None
        zeros = np.zeros(len(lengths) + a)
        return lambda d: weights * solve(weights * np.concatenate((d, zeros)))


def _scaled(A, sizes, axis):
    """Rows (axis 0) or columns of a matrix divided by their sizes."""
    if isinstance(A, np.ndarray):
        return A / (sizes[:, None] if axis == 0 else sizes)
    from scipy.sparse import diags_array

    unit = diags_array(1.0 / sizes)
    return unit @ A if axis == 0 else A @ unit


def _dense_factors(M, H, B):
    from scipy.linalg.lapack import dgetrf, dgetrs

    (m, n), a = H.shape, B.shape[1]
    A = np.zeros((n + m + a, n + m + a), order="F")
    if M is not None:
        A[:n, :n] = M
    A[:n, n : n + m], A[n : n + m, :n] = H.T, H
    A[:n, n + m :], A[n + m :, :n] = -B, -B.T
    A[range(n + m, n + m + a), range(n + m, n + m + a)] = 1.0
    factors, pivots, failed = dgetrf(A, overwrite_a=True)
    return None if failed else lambda right: dgetrs(factors, pivots, right)[0]


def _sparse_factors(M, H, B):
    from scipy.sparse import block_array, eye_array
    from scipy.sparse.linalg import splu

    blocks = [[M, H.T, -B], [H, None, None], [-B.T, None, eye_array(B.shape[1])]]
    try:
        return splu(block_array(blocks, format="csc")).solve
    except RuntimeError:
        return None
