"""Newton's increment where the stiffness is not positive, with the signs of its negative eigenvalues changed.

    K v = lambda S v,  v.S v = 1,  A v = 0:        u = sum of v (v.load) / |lambda|

S is the stiffness of each body by its size. The increment leads down along all eigenvectors, whereas Newton's leads to
the saddle (Dauphin et al., Adv. Neural Inf. Process. Syst. 27, 2014). A shift of K would slow soft directions down.
"""

import numpy as np

from .tolerances import CLEARLY, FEW_NEGATIVE, ROUNDED, SMALL, SOFT


def saddle_free(factors, load):
    """The increment u, by the `Factors` at mu = 0; None where there are too many negative eigenvalues."""
    if load.size <= SMALL:
        return _by_all(factors, load)
    if factors.negative > FEW_NEGATIVE:
        return None
    return _by_few(factors, load)


def _by_all(factors, load):
    """By all eigenvectors, dense."""
    K, A = factors.dense()
    Z = np.linalg.qr(A.T, mode="complete")[0][:, len(A) :]
    w, v = np.linalg.eigh(0.5 * Z.T @ (K + K.T) @ Z)
    v, scale = Z @ v, factors.scale
    along = v.T @ (scale * load)
    along[(np.abs(w) <= SOFT) & (np.abs(along) <= ROUNDED * factors.size_of_loads)] = 0.0  # neutral
    return scale * (v @ (along / np.maximum(np.abs(w), CLEARLY)))


def _by_few(factors, load):
    """By Newton's increment and the eigenvectors of negative eigenvalues, by shifted inverse Lanczos iteration."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    newton, shift = factors.newton(load), factors.positive_shift()
    if newton is None or shift is None:
        return None
    size, solve = load.size, factors.solver(shift)
    K = LinearOperator((size, size), factors.stiffness)
    inverse = LinearOperator((size, size), solve)
    try:
        w, v = eigsh(K, factors.negative, sigma=-shift, OPinv=inverse, v0=solve(np.ones(size)), tol=1e-6)
    except ArpackError:
        return None
    v, w = v[:, w < 0.0], w[w < 0.0]
    scale = factors.scale
    return newton + scale * (v @ (2.0 * (v.T @ (scale * load)) / np.maximum(-w, CLEARLY)))
