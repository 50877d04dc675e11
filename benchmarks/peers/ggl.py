"""The index-2 form of a definition (absolute.py, Eq. 3) as solvers of F(t, y, yd) = 0 take it."""

import numpy as np
from scipy.sparse import csc_matrix

from ..contender import Outcome, rotation
from .absolute import STATE, accelerate, differences, pack, residual, unpack


class System:
    """Start, residual, Jacobian with its pattern, and the reading of an end."""

    def __init__(self, definition):
        self.packed, x = pack(definition)
        self.P = P = unpack(*self.packed)
        xd, lam = np.empty_like(x), np.empty(P.row[-1])
        accelerate(*self.packed, x, xd, lam)
        self.n = n = int(P.at.size + x.size + 2 * lam.size)
        self.y, self.yd = np.zeros(n), np.zeros(n)
        state = (P.at[:, None] + np.arange(STATE)).ravel()
        self.y[state], self.yd[state], self.y[P.at_row] = x.ravel(), xd.ravel(), lam
        self.algebraic = np.setdiff1d(np.arange(n), state)
        self.state = state
        pattern = self._pattern()
        self.first, self.rows = pattern.indptr.astype(np.int64), pattern.indices.astype(np.int64)
        self.pattern, self.group = pattern, _colour(pattern)
        self.values = np.zeros(self.rows.size)
        self.columns = np.repeat(np.arange(n), np.diff(self.first))
        self.band = int(np.abs(self.rows - self.columns).max())
        self.jacobian(self.y, self.yd, 1.0)

    def _pattern(self):
        """Bodies and constraints that meet, as blocks."""
        P, n = self.P, self.n
        meets = np.zeros((n, n), bool)
        blocks = [np.arange(P.at[i], P.at[i] + STATE + 1) for i in range(P.at.size)]
        rows = [np.concatenate([P.at_row[a:b], P.at_mu[a:b]]) for a, b in zip(P.row[:-1], P.row[1:], strict=True)]
        for block in blocks:
            meets[np.ix_(block, block)] = True
        for c, row in enumerate(rows):
            one = [blocks[i] for i in P.on[c] if i >= 0]
            for body in one:
                meets[np.ix_(row, body)] = meets[np.ix_(body, row)] = True
            for body in one:  # the direction of a distance depends on both bodies
                for other in one:
                    meets[np.ix_(body, other)] |= P.kind[c] == 1
        return csc_matrix(meets)

    def residual(self, y, yd, out):
        """Fill out with F."""
        residual(*self.packed, y, yd, out)

    def jacobian(self, y, yd, shift):
        """Entries of dF/dy + shift dF/dyd in the order of the pattern (CSC)."""
        differences(self.packed, y, yd, shift, self.group, self.first, self.rows, self.values)
        return self.values

    def outcome(self, seconds, y):
        """Positions and rotation matrices of a state."""
        x = y[self.state].reshape(-1, STATE)
        return Outcome(seconds, x[:, :3], rotation(x[:, 3:7]))


def _colour(pattern):
    """Groups of columns that share no row, greedily."""
    csr = pattern.tocsr()
    group = np.full(pattern.shape[1], -1)
    for j in range(group.size):
        near = csr[pattern.indices[pattern.indptr[j] : pattern.indptr[j + 1]]].indices
        taken = set(group[near])
        group[j] = next(k for k in range(group.size) if k not in taken)
    return group
