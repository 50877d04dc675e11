"""Factorisation and solution by kernels of their own, which all others call by address; a pattern has the addresses.

Where it is linked in, factorisation.py is most of the code of a kernel, and the longest to compile. That is done for
lanes and complex numbers alone, and for a matrix of one row.
"""

import numpy as np

from ..jit.kernels import DEBUG, callback, caller, kernel, loader, long_kernel, vector
from ..jit.resident import zeros
from .factorisation import factor_blocks, factor_lu_blocks, factor_lu_row, factor_row, solve_blocks, solve_three
from .symbolic import analyse

FACTOR, FACTOR_LU, SOLVE = "pppid", "pppd", "ppppi"
_load_pattern = loader(analyse([], [])[1])


@callback(FACTOR)
def factor_values(pattern, values, b, with_b, limit):
    """Factor S in place, and begin to solve S x = b; which row fails, or -1."""
    p = _load_pattern(pattern)
    return factor_blocks(p, vector(values, p.shape[2]), vector(b, p.shape[0]), with_b, limit)


@callback(FACTOR_LU)
def factor_lu_values(pattern, lower, upper, limit):
    """Factor N in place; which row fails, or -1."""
    p = _load_pattern(pattern)
    return factor_lu_blocks(p, vector(lower, p.shape[2]), vector(upper, p.shape[2]), limit)


@callback(SOLVE)
def solve_values(pattern, lower, upper, b, begun):
    """Solve N x = b, or S x = b, in place."""
    p = _load_pattern(pattern)
    solve_blocks(p, vector(lower, p.shape[2]), vector(upper, p.shape[2]), vector(b, p.shape[0]), begun)
    return 0


@long_kernel
def _solve_linked(pattern, lower, upper, b, begun):
    solve_blocks(pattern, lower, upper, b, begun)
    return 0


KERNELS = {"symmetric": (factor_values, solve_values), "unsymmetric": (factor_lu_values,)}


def with_kernels(pattern, unsymmetric=False):
    """The pattern, for the functions below, with addresses of this process."""
    if DEBUG or pattern.shape[0] < 2:
        return pattern
    addresses = factor_values.address, factor_lu_values.address if unsymmetric else 0, solve_values.address
    return pattern._replace(kernels=np.array(addresses))


def lu_factors(pattern):
    """Arrays for `lower` and `upper`; from now on the pattern serves `factor_lu`."""
    if pattern.kernels.size and not pattern.kernels[1]:
        pattern.kernels[1] = factor_lu_values.address
    return zeros(pattern.shape[2]), zeros(pattern.shape[2])


if DEBUG:
    from .factorisation import factor, factor_and_solve, factor_lu, solve, solve_lu
else:
    _call_factor = caller(FACTOR, linked=factor_blocks)
    _call_factor_lu = caller(FACTOR_LU, linked=factor_lu_blocks)
    _call_solve = caller(SOLVE, linked=_solve_linked)

    @kernel
    def factor(pattern, values, limit):
        """`factorisation.factor`."""
        if pattern.shape[0] < 2:
            return factor_row(pattern, values, limit) if pattern.shape[0] else -1
        return _call_factor(pattern.kernels[0], pattern, values, values, 0, limit)

    @kernel
    def factor_and_solve(pattern, values, b, limit):
        """`factorisation.factor_and_solve`."""
        if pattern.shape[0] < 2:
            failed = factor_row(pattern, values, limit) if pattern.shape[0] else -1
            solve(pattern, values, b)
            return failed
        failed = _call_factor(pattern.kernels[0], pattern, values, b, 1, limit)
        if failed < 0:
            _call_solve(pattern.kernels[2], pattern, values, values, b, 1)
        return failed

    @kernel
    def factor_lu(pattern, lower, upper, limit):
        """`factorisation.factor_lu`."""
        if pattern.shape[0] < 2:
            return factor_lu_row(pattern, lower, upper, limit) if pattern.shape[0] else -1
        return _call_factor_lu(pattern.kernels[1], pattern, lower, upper, limit)

    @kernel
    def solve_lu(pattern, lower, upper, b):
        """`factorisation.solve_lu`."""
        if pattern.shape[0] == 1:
            b[0] *= lower[0]
        elif pattern.shape[0] == 3 and pattern.heads.size == 1:
            solve_three(lower, upper, b)
        elif pattern.shape[0] > 1:
            _call_solve(pattern.kernels[2], pattern, lower, upper, b, 0)

    @kernel
    def solve(pattern, values, b):
        """`factorisation.solve`."""
        solve_lu(pattern, values, values, b)
