"""The rank of dense rows, and which of them to keep: by singular values, and by QR with pivoting."""

import numpy as np

from .tolerances import NO_LENGTH, RANK_TOL


def row_lengths(A):
    """Lengths of the rows of A, dense or sparse; next to nothing counts as nothing."""
    squares = (A * A).sum(axis=1) if isinstance(A, np.ndarray) else A.multiply(A).sum(axis=1)
    lengths = np.sqrt(np.asarray(squares).ravel())
    return np.where(lengths > NO_LENGTH * lengths.max(initial=0.0), lengths, 0.0)


def unit_rows(A):
    """The rows at length one; those of length zero stay so."""
    lengths = row_lengths(A)
    return A / np.where(lengths > 0.0, lengths, 1.0)[:, None]


def singular_values(rows):
    """Singular values of dense rows, the largest first."""
    return np.linalg.svd(rows, compute_uv=False) if rows.size else np.zeros(0)


def rank_of(A):
    """The rank of dense rows, scaled to unit length."""
    size = singular_values(unit_rows(A))
    return int((size > RANK_TOL * size.max(initial=0.0)).sum())


def farthest_first(rows):
    """The order in which each row is the farthest from the span of those before it, and how far that is."""
    from scipy.linalg import qr  # imported here: it would double the time of `import tsdyn`

    R, order = qr(rows.T, mode="r", pivoting=True)
    return order, np.abs(R.diagonal())


def dependent(A):
    """Rows of a dense A that follow from the others; those that are farthest from each other are kept."""
    order, far = farthest_first(unit_rows(A))
    return order[(far > RANK_TOL * far.max(initial=0.0)).sum() :]
