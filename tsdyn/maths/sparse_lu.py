"""Factors of sparse matrices by SuperLU, which takes seconds for some million rows."""

from functools import partial

from ..jit.interrupts import interruptible
from .tolerances import LONG_LU


def sparse_lu(A, **options):
    """Return the `scipy.sparse.linalg.SuperLU` of a sparse matrix; Ctrl-C is answered meanwhile. Options of `splu`."""
    from scipy.sparse.linalg import splu  # takes a while to import

    call = partial(splu, A, **options)
    return interruptible(call) if A.shape[0] >= LONG_LU else call()
