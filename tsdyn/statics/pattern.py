"""Sparse matrices of one sparsity and many values: sums of blocks, whose places are found once."""

import numpy as np


class Pattern:
    """Where numbers at (rows, columns), both (k,), of a matrix add up; a negative row or column has none."""

    def __init__(self, rows, columns, shape):
        self._used = np.flatnonzero((rows >= 0) & (columns >= 0))
        keys = columns[self._used].astype(np.int64) * shape[0] + rows[self._used]
        found, self._slots = np.unique(keys, return_inverse=True)
        self.rows, self.shape = (found % shape[0]).astype(np.int32), shape
        self.columns = found // shape[0]
        self._starts = np.searchsorted(self.columns, np.arange(shape[1] + 1)).astype(np.int32)

    @classmethod
    def of_blocks(cls, rows, columns, shape):
        """Of blocks (k, a, b) at rows (k, a) and columns (k, b)."""
        i, j = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
        return cls(i.ravel(), j.ravel(), shape)

    @classmethod
    def of_parts(cls, parts, shape):
        """Of several patterns, each with the row and the column where it begins; values follow one another."""
        rows = np.concatenate([part.rows + first for part, first, _ in parts])
        columns = np.concatenate([part.columns + first for part, _, first in parts])
        return cls(rows, columns, shape)

    def sum(self, values):
        """The numbers of the matrix that are not zero, of values (k,)."""
        return np.bincount(self._slots, values.ravel()[self._used], self.rows.size)

    def matrix(self, data):
        """The matrix, SciPy's CSC, of what `sum` returns."""
        from scipy.sparse import csc_array

        return csc_array((data, self.rows, self._starts), self.shape)
