"""Linear algebra: dense products and factorisations in kernels; rank by singular values; sparse factors by SuperLU."""

import math
from functools import partial

import numpy as np

from ..jit.interrupts import interruptible
from ..jit.kernels import kernel
from ..jit.predicates import below, choose
from ..jit.simd import first, fma, four, fourth, larger, second, splat, third, total
from .tolerances import CONVERGED, LONG_LU, LONG_SOLVE, NEGLIGIBLE, ORTHOGONAL, RANK_TOL


@kernel
def is_finite(x):
    """Return True if all numbers of a vector are finite."""
    fours, off = x.size // 4 * 4, splat(0.0)  # zero times what isn't finite is no number
    for i in range(0, fours, 4):
        off = fma(four(x, i), splat(0.0), off)
    rest = total(off)
    for i in range(fours, x.size):
        rest += 0.0 * x[i]
    return rest == 0.0


@kernel
def copy(a, b):
    """b = a."""
    for i in range(a.size):
        b[i] = a[i]


@kernel
def transposed_times(A, x, out):
    """out = A^T x."""
    for j in range(out.size):
        total = 0.0
        for i in range(x.size):
            total += A[i, j] * x[i]
        out[j] = total


@kernel
def cholesky(A, n, limit):
    """Factor the lower triangle of A (n, n) in place, A = L L^T; the diagonal holds the reciprocals of L's.

    Return False if A is not positive definite: if a pivot is below `limit` times its diagonal entry.
    """
    for j in range(n):
        s = A[j, j]
        for k in range(j):
            s -= A[j, k] * A[j, k]
        if not s > limit * A[j, j]:
            return False
        pivot = 1.0 / math.sqrt(s)
        A[j, j] = pivot
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            A[i, j] = s * pivot
    return True


@kernel
def cholesky_solve(L, b, n):
    """Solve L L^T x = b in place."""
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= L[i, k] * b[k]
        b[i] = s * L[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i] * L[i, i]
        b[i] = s
        for k in range(i):
            b[k] -= L[i, k] * s


@kernel
def invert(A, X, n):
    """X = A^-1 by Gauss-Jordan elimination with partial pivoting; A is destroyed. Return False if A is singular."""
    for i in range(n):
        for j in range(n):
            X[i, j] = 1.0 if i == j else 0.0
    for c in range(n):
        # Largest entry of the column as pivot
        p = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[p, c]):
                p = i
        if not abs(A[p, c]) > 0.0:
            return False
        if p != c:
            for j in range(n):
                A[c, j], A[p, j] = A[p, j], A[c, j]
                X[c, j], X[p, j] = X[p, j], X[c, j]
        # Row c over the pivot, then eliminate column c from all other rows
        pivot = 1.0 / A[c, c]
        for j in range(n):
            A[c, j] *= pivot
            X[c, j] *= pivot
        for i in range(n):
            f = A[i, c]
            if i != c and f != 0.0:
                for j in range(n):
                    A[i, j] -= f * A[c, j]
                    X[i, j] -= f * X[c, j]
    return True


@kernel
def null_space(W, n, m, V, R, tau):
    """Singular values of W (n, m), m <= n, and an orthonormal basis V (n, n - m) of the complement of its columns.

    Householder QR, W = Q [R; 0], then the singular value decomposition of R by one-sided Jacobi rotations (Hestenes
    1958; Drmac and Veselic, SIAM J. Matrix Anal. Appl. 29, 2008): together the full SVD of W, whose left vectors of
    no singular value are the last columns of Q. W is destroyed; R (m, m) and tau (m,) are scratch.
    Returns the smallest and the largest singular value.
    """
    for j in range(m):
        # Reflector of column j: its part below the diagonal becomes zero
        s = 0.0
        for i in range(j, n):
            s += W[i, j] * W[i, j]
        s = math.sqrt(s)
        if W[j, j] > 0.0:
            s = -s
        head = W[j, j] - s
        tau[j] = 0.0
        if s != 0.0:
            tau[j] = -head / s  # reflector I - tau w w^T, w = (1, W[j+1:, j])
            for i in range(j + 1, n):
                W[i, j] /= head
        W[j, j] = s
        for c in range(j + 1, m):
            reflect(W, j, tau[j], W, c, n)
    # Q times the last unit vectors spans the complement
    for j in range(n - m):
        for i in range(n):
            V[i, j] = 0.0
        V[m + j, j] = 1.0
        for c in range(m - 1, -1, -1):
            reflect(W, c, tau[c], V, j, n)
    for i in range(m):
        for j in range(m):
            R[i, j] = W[i, j] if j >= i else 0.0
    return _jacobi(R, m)


@kernel
def reflect(W, c, tau, X, j, n):
    """Column j of X = (I - tau w w^T) X, w = (1, W[c+1:, c]) from row c on, of n rows."""
    s = X[c, j]
    for i in range(c + 1, n):
        s += W[i, c] * X[i, j]
    s *= tau
    X[c, j] -= s
    for i in range(c + 1, n):
        X[i, j] -= s * W[i, c]


@kernel
def _jacobi(R, m):
    """Smallest and largest singular value of R (m, m), by rotations of its rows until they are orthogonal."""
    for _ in range(30):
        worst = 0.0
        for i in range(m - 1):
            for j in range(i + 1, m):
                # Inner products of two rows
                a, b, c = 0.0, 0.0, 0.0
                for k in range(m):
                    a += R[i, k] * R[i, k]
                    b += R[j, k] * R[j, k]
                    c += R[i, k] * R[j, k]
                if c == 0.0:
                    continue
                size = abs(c) / math.sqrt(a * b)
                worst = max(worst, size)
                if size < ORTHOGONAL:
                    continue
                # The smaller of the two rotations that make them orthogonal
                zeta = (b - a) / (2.0 * c)
                t = 1.0 / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                if zeta < 0.0:
                    t = -t
                cosine = 1.0 / math.sqrt(1.0 + t * t)
                sine = cosine * t
                # Their lengths are the singular values
                for k in range(m):
                    x, y = R[i, k], R[j, k]
                    R[i, k] = cosine * x - sine * y
                    R[j, k] = sine * x + cosine * y
        if not worst > CONVERGED:
            break
    smallest, largest = math.inf, 0.0
    for i in range(m):
        s = 0.0
        for k in range(m):
            s += R[i, k] * R[i, k]
        s = math.sqrt(s)
        smallest, largest = min(smallest, s), max(largest, s)
    return smallest, largest


@kernel
def lu(A, pivots, n):
    """Factor A (n, n) in place with partial pivoting; return False if it is singular or not finite."""
    for c in range(n):
        # Largest entry of the column as pivot
        p = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[p, c]):
                p = i
        pivots[c] = p
        if not 0.0 < abs(A[p, c]) < math.inf:
            return False
        if p != c:
            for j in range(n):
                A[c, j], A[p, j] = A[p, j], A[c, j]
        for i in range(c + 1, n):
            f = A[i, c] / A[c, c]
            A[i, c] = f
            if f != 0.0:
                for j in range(c + 1, n):
                    A[i, j] -= f * A[c, j]
    return True


@kernel
def lu_solve(A, pivots, b, n):
    """Solve in place with the factors of `lu`."""
    for i in range(n):
        # L, with exchanges
        p = pivots[i]
        if p != i:
            b[i], b[p] = b[p], b[i]
        for j in range(i):
            b[i] -= A[i, j] * b[j]
    # U
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= A[i, j] * b[j]
        b[i] /= A[i, i]


@kernel
def largest_of(values, marked, weight):
    """As `largest`, where those that are marked with one count times a weight."""
    worst = rest = 0.0 * weight
    for i in range(values.size):
        # Not finite: 0 x is then no zero
        size = abs(values[i]) * (weight if marked[i] == 1.0 else 1.0)
        worst, rest = max(worst, size), rest + 0.0 * size
    return choose(below(-1.0, rest), worst, math.inf)


@kernel
def largest(values):
    """Return the largest magnitude; infinity if an entry is not finite."""
    fours, most, off = values.size // 4 * 4, splat(0.0), splat(0.0)
    for i in range(0, fours, 4):
        f = four(values, i)
        most, off = larger(f, most), fma(f, splat(0.0), off)
    worst = max(max(first(most), second(most)), max(third(most), fourth(most)))
    rest = total(off)
    for i in range(fours, values.size):
        worst, rest = max(worst, abs(values[i])), rest + 0.0 * values[i]
    return choose(below(-1.0, rest), worst, math.inf)


# Products of dense matrices, over the nonzero entries of the first factor.


@kernel
def clear_matrix(out):
    """out = 0."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0


@kernel
def add_product(scale, A, B, out):
    """out += scale A B."""
    for i in range(A.shape[0]):
        for c in range(A.shape[1]):
            f = scale * A[i, c]
            if f != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += f * B[c, j]


@kernel
def add_transposed_product(scale, A, B, out):
    """out += scale A^T B."""
    for c in range(A.shape[0]):
        for i in range(A.shape[1]):
            f = scale * A[c, i]
            if f != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += f * B[c, j]


@kernel
def multiply(A, B, out):
    """out = A B."""
    clear_matrix(out)
    add_product(1.0, A, B, out)


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
