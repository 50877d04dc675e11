"""Rank of dense rows by singular values, independent rows by pivoted QR; sparse factors by SuperLU."""

from functools import partial

import numpy as np

from ..jit.interrupts import interruptible
from .tolerances import LONG_LU, LONG_SOLVE, NEGLIGIBLE, RANK_TOL

# Rank of dense rows by singular values; selection of independent rows by pivoted QR.


def row_lengths(A):
    """Return the lengths of the rows of A, dense or sparse; rounding counts as zero."""
    squares = (A * A).sum(axis=1) if isinstance(A, np.ndarray) else A.multiply(A).sum(axis=1)
    lengths = np.sqrt(np.asarray(squares).ravel())
    return np.where(lengths > NEGLIGIBLE * lengths.max(initial=0.0), lengths, 0.0)


def unit_rows(A):
    """Return the rows scaled to unit length; zero rows remain zero."""
    lengths = row_lengths(A)
    return A / np.where(lengths > 0.0, lengths, 1.0)[:, None]


def singular_values(rows):
    """Singular values of dense rows, the largest first."""
    return np.linalg.svd(rows, compute_uv=False) if rows.size else np.zeros(0)


def rank_of(A):
    """Return the rank of dense rows, scaled to unit length."""
    size = singular_values(unit_rows(A))
    return int((size > RANK_TOL * size.max(initial=0.0)).sum())


def farthest_first(rows):
    """Return the order of the rows by pivoted QR, and their distances from the span of the rows before them."""
    from scipy.linalg import qr  # imported here: it would double the time of `import tsdyn`

    R, order = qr(rows.T, mode="r", pivoting=True)
    return order, np.abs(R.diagonal())


def range_and_null_space(rows):
    """Orthonormal bases Q1 (n, r) of the span of rows (m, n) and Z (n, n - r) of what is normal to it, by pivoted QR.

    Also R (r, r) and the order (r,) of independent rows: rows[order] = R^T Q1^T.
    """
    from scipy.linalg import qr

    Q, R, order = qr(rows.T, pivoting=True)
    size = np.abs(np.diag(R))
    rank = int((size > RANK_TOL * size.max(initial=0.0)).sum())
    return Q[:, :rank], Q[:, rank:], R[:rank, :rank], order[:rank]


def dependent(A):
    """Return the dependent rows of a dense A; pivoted QR chooses the independent ones."""
    order, far = farthest_first(unit_rows(A))
    return order[(far > RANK_TOL * far.max(initial=0.0)).sum() :]


# Factors of sparse matrices by SuperLU, which takes seconds for some million rows.


def sparse_lu(A, **options):
    """Return the `scipy.sparse.linalg.SuperLU` of a sparse matrix; Ctrl-C is answered meanwhile. Options of `splu`."""
    from scipy.sparse.linalg import splu  # takes a while to import

    call = partial(splu, A, **options)
    return interruptible(call) if A.shape[0] >= LONG_LU else call()


def interruptible_solver(factors):
    """Return solve(b, trans="N") of some factors; Ctrl-C is answered meanwhile where that may take longer."""

    def solve(b, trans="N"):
        call = partial(factors.solve, b, trans)
        return interruptible(call) if b.size >= LONG_SOLVE else call()

    return solve
