"""Dense equations and products of some hundred rows for Python: the same bits for any number of threads of a BLAS."""

import math

import numpy as np

from ..jit.kernels import entry, kernel
from .dense_linalg import lu, lu_solve, multiply, reflect


@entry("mwv")
def _solve(A, pivots, b):
    if not lu(A, pivots, b.size):
        return False
    lu_solve(A, pivots, b, b.size)
    return True


@entry("mmm")
def _product(A, B, out):
    multiply(A, B, out)


@kernel
def _decompose(A, X, tau, f, order, limit):
    """The rank of A (m, n) = Q [T 0; 0 0] Z P^T, which is destroyed, and Q^T X in place of X; tau, f, order: scratch.

    A complete orthogonal decomposition (Golub and Van Loan, Matrix Computations, 5.4.2).
    """
    m, n, k = A.shape[0], A.shape[1], X.shape[1]
    rank, largest = 0, 0.0
    for j in range(n):
        order[j] = j
    # A P = Q R, the longest of the columns that are left first; Q^T X
    for c in range(min(m, n)):
        for j in range(c, n):
            f[j] = 0.0
        for i in range(c, m):
            for j in range(c, n):
                f[j] += A[i, j] * A[i, j]
        p = c
        for j in range(c + 1, n):
            if f[j] > f[p]:
                p = j
        size = math.sqrt(f[p])
        largest = max(largest, size)
        if not size > limit * largest:
            break
        rank += 1
        if p != c:
            order[c], order[p] = order[p], order[c]
            for i in range(m):
                A[i, c], A[i, p] = A[i, p], A[i, c]
        pivot = -size if A[c, c] > 0.0 else size
        head = A[c, c] - pivot
        for i in range(c + 1, m):
            A[i, c] /= head
        for j in range(c + 1, n):
            reflect(A, c, -head / pivot, A, j, m)
        for j in range(k):
            reflect(A, c, -head / pivot, X, j, m)
        A[c, c] = pivot
    # R = [T 0] Z of the first rows: reflectors of rows, (1, A[c, rank:]), from the last one on
    for c in range(rank - 1, -1, -1):
        square, tau[c] = 0.0, 0.0
        for j in range(rank, n):
            square += A[c, j] * A[c, j]
        if square == 0.0:
            continue
        pivot = -math.copysign(math.sqrt(A[c, c] * A[c, c] + square), A[c, c])
        head = A[c, c] - pivot
        tau[c] = -head / pivot
        for j in range(rank, n):
            A[c, j] /= head
        A[c, c] = pivot
        for i in range(c):
            s = A[i, c]
            for j in range(rank, n):
                s += A[i, j] * A[c, j]
            s *= tau[c]
            A[i, c] -= s
            for j in range(rank, n):
                A[i, j] -= s * A[c, j]
    return rank


@kernel
def _restore(A, X, tau, f, order, rank):
    """P Z^T X in place of X (n, k), as `_decompose` has left A."""
    n, k = A.shape[1], X.shape[1]
    for c in range(rank):
        for j in range(k):
            f[j] = X[c, j]
        for r in range(rank, n):
            for j in range(k):
                f[j] += A[c, r] * X[r, j]
        for j in range(k):
            f[j] *= tau[c]
            X[c, j] -= f[j]
        for r in range(rank, n):
            for j in range(k):
                X[r, j] -= A[c, r] * f[j]
    for c in range(n):
        while order[c] != c:
            p = order[c]
            for j in range(k):
                X[c, j], X[p, j] = X[p, j], X[c, j]
            order[c], order[p] = order[p], p


@entry("mmvvwd")
def _least_squares(A, X, tau, f, order, limit):
    """X (max(m, n), k): b on entry, its first n rows x on return. A (m, n) is destroyed; tau, f, order: scratch."""
    k, rank = X.shape[1], _decompose(A, X, tau, f, order, limit)
    for i in range(rank - 1, -1, -1):
        for r in range(i + 1, rank):
            for j in range(k):
                X[i, j] -= A[i, r] * X[r, j]
        for j in range(k):
            X[i, j] /= A[i, i]
    X[rank:] = 0.0
    _restore(A, X, tau, f, order, rank)


@entry("mmvvwd")
def _null_space(A, X, tau, f, order, limit):
    """The last columns of X (n, n), whose number is returned: P Z^T (0; I). A (m, n) is destroyed, others: scratch."""
    n = A.shape[1]
    rank = _decompose(A, X[:, :0], tau, f, order, limit)
    for i in range(n):
        for j in range(n):
            X[i, j] = 1.0 if i == j else 0.0
    _restore(A, X[:, rank:], tau, f, order, rank)
    return n - rank


def solve(A, b):
    """x of A x = b, A (n, n), b (n,); None if A is singular or not finite."""
    x = np.array(b, float)
    return x if _solve(np.array(A, float, order="C"), np.empty(x.size, np.int64), x) else None


def least_squares(A, b, limit):
    """The shortest x (n,) or (n, k) with the least |A x - b|, A (m, n), b (m,) or (m, k).

    Columns whose distance from the span of the others is not above `limit` of the longest depend on these.
    """
    (m, n), b = A.shape, np.asarray(b)
    X = np.zeros((max(m, n), *(b.shape[1:] or (1,))))
    X[:m] = b.reshape(m, X.shape[1])
    _least_squares(np.array(A, float, order="C"), X, np.empty(n), np.empty(max(X.shape)), np.empty(n, np.int64), limit)
    return X[:n].reshape(n, *b.shape[1:])


def null_space(A, limit):
    """An orthonormal basis (n, k) of the x (n,) with A x = 0, A (m, n); limit: as of `least_squares`."""
    n = A.shape[1]
    X, tau, f, order = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n, np.int64)
    return X[:, n - _null_space(np.array(A, float, order="C"), X, tau, f, order, limit) :]


def product(A, B):
    """A B of matrices (m, n) and (n, k)."""
    out = np.empty((A.shape[0], B.shape[1]))
    _product(np.ascontiguousarray(A), np.ascontiguousarray(B), out)
    return out


KERNELS = _solve, _least_squares, _null_space, _product
