"""Factors of sparse matrices by SuperLU, which takes seconds for some million rows."""

from functools import partial

from ..jit.interrupts import interruptible
from .tolerances import LONG_LU, LONG_SOLVE


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
