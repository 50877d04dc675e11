"""Linear dependence of constraint rows, joint by joint in the order in which the joints were added."""

import numpy as np

from ..maths.row_rank import farthest_first, rank_of, singular_values, unit_rows
from ..maths.tolerances import RANK_TOL
from .tolerances import FIRM, TAKES_PART


def divide(A, groups):
    """Return kept and redundant rows of A (rows, x), by groups: redundant rows depend on rows before them.

    groups is a list of index arrays. Within a group, pivoted QR chooses the rows to keep.
    """
    from scipy.linalg import qr  # imported here: it would double the time of `import tsdyn`

    unit, rank = unit_rows(A), rank_of(A)
    basis, kept, redundant = np.zeros((0, A.shape[1])), [], []
    for rows in groups:
        left = unit[rows]
        for _ in range(2):
            left = left - (left @ basis.T) @ basis
        Q, R, order = qr(left.T, mode="economic", pivoting=True)
        size = np.abs(np.diagonal(R))
        count = int((size > RANK_TOL * np.sqrt(max(len(unit), 1))).sum())
        basis = np.vstack((basis, Q.T[:count]))
        kept += sorted(rows[order[:count]].tolist())
        redundant += sorted(rows[order[count:]].tolist())
    if len(kept) != rank:  # the rank is ambiguous: choose among all rows at once
        order, _ = farthest_first(unit)
        kept, redundant = sorted(order[:rank].tolist()), sorted(order[rank:].tolist())
    return kept, redundant


def partners(A, kept, redundant):
    """Return, for each redundant row, the kept rows of which it is a combination."""
    unit = unit_rows(A)
    if not (kept and redundant):
        return [[] for _ in redundant]
    weights = np.linalg.lstsq(unit[kept].T, unit[redundant].T, rcond=None)[0]
    return [[row for row, weight in zip(kept, column, strict=True) if abs(weight) > TAKES_PART] for column in weights.T]


def put_aside(A, owners):
    """Remove rows of a sparse A that are certainly independent; return the remaining rows.

    owners (x,) is the body of each column. If the rows of a body are independent in its columns alone, they are
    independent of all other rows, and the body is removed with them, as the links of an open chain are from its end.
    """
    from scipy.sparse import csr_array

    A = csr_array(A)
    of_row = [np.unique(owners[A.indices[A.indptr[i] : A.indptr[i + 1]]]) for i in range(A.shape[0])]
    rows_of = [set() for _ in range(int(owners.max(initial=-1)) + 1)]
    for row, bodies in enumerate(of_row):
        for body in bodies:
            rows_of[body].add(row)
    columns = [np.flatnonzero(owners == body) for body in range(len(rows_of))] if len(rows_of) < 2 else _columns(owners)
    left, queue = set(range(A.shape[0])), list(range(len(rows_of)))
    while queue:
        body = queue.pop()
        rows = sorted(rows_of[body])
        if not 0 < len(rows) <= len(columns[body]):
            continue
        block = unit_rows(A[rows].toarray())[:, columns[body]]
        size = singular_values(block)
        if size[-1] <= FIRM * size[0]:
            continue
        near = {int(other) for row in rows for other in of_row[row]} - {body}
        for row in rows:
            for other in of_row[row]:
                rows_of[other].discard(row)
        left -= set(rows)
        queue += sorted(near)
    return np.array(sorted(left), int)


def _columns(owners):
    order = np.argsort(owners, kind="stable")
    cuts = np.searchsorted(owners[order], np.arange(1, owners.max() + 1))
    return np.split(order, cuts)
