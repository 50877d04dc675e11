"""Sparse Phi_q: 14 numbers a row, 7 for body a and 7 for body b; storage and products cost O(N)."""

import numpy as np

from ..elements.loops.coordinate_rows import BLOCK, INTS, ROW, STRIDE

WIDTH = 14  # floats of a row; those of body b begin in the middle


def with_short_rows(packed):
    """The system, to whose kernels Phi_q is an array (m, 14); made once."""
    known = packed.derived
    if known.short_rows is None:
        system = packed.system
        table = system.table.copy()
        for kind in system.kinds:
            first, count = kind.table, kind.count
            own = table[first : first + INTS * count].reshape(count, INTS)
            own[:, BLOCK] = WIDTH * own[:, ROW]
            own[:, BLOCK + 1] = WIDTH * own[:, ROW] + WIDTH // 2
            own[:, STRIDE] = WIDTH
        known.short_rows = system._replace(table=table)
    return known.short_rows


def places(packed):
    """Where in q the two halves of each row belong, (m, 2), and their lengths, (m, 2)."""
    segments = packed.system.segments
    return segments[:, 0::2].copy(), segments[:, 1::2].copy()


def as_csr(packed, rows):
    """Phi_q (m, n) as a SciPy sparse array, of rows (m, 14)."""
    from scipy.sparse import csr_array

    at, length = places(packed)
    half = np.arange(WIDTH // 2)
    columns = (at[:, :, None] + half).reshape(len(at), WIDTH)
    used = (half < length[:, :, None]).reshape(len(at), WIDTH)
    i = np.broadcast_to(np.arange(len(at))[:, None], used.shape)
    n = int(packed.system.bodies[:, 1].sum())
    return csr_array((rows[used], (i[used], columns[used])), shape=(len(at), n))
