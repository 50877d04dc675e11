"""Eigenvalues of M xdd + C xd + K x = 0, exact zeros included.

With unit mass, that is in y = R x where M = R^T R. The null space of K is split off: each of its directions has an
eigenvalue zero, which rounding would otherwise make a pair of the size of its root. Ctrl-C is answered within LAPACK.
What is `nothing`, 1/s^2, is the stiffness up to which a direction belongs to the null space.
"""

from typing import NamedTuple

import numpy as np

from ..jit.interrupts import interruptible
from .tolerances import NEUTRAL_ASYMMETRY, NO_STIFFNESS, SYMMETRIC, ZERO


class Pairs(NamedTuple):
    """2 k eigenvalues and, in their order, vectors of coordinates (k, 2 k) complex, of unit kinetic energy norm."""

    values: np.ndarray
    vectors: np.ndarray


class Stiffnesses(NamedTuple):
    """Eigenvalues of the stiffness, in order, and its null space counted."""

    values: np.ndarray  # (k - neutral,) 1/s^2, of the symmetric part, without the null space
    neutral: int
    symmetric: bool

    @property
    def smallest(self):
        """Zero if all are neutral."""
        return float(self.values[0]) if len(self.values) else 0.0


def stiffnesses(reduced, nothing):
    """The `Stiffnesses` of `Reduced` equations."""
    K = reduced.K_hat
    K_s = 0.5 * (K + K.T)
    if np.abs(K - K.T).max(initial=0.0) <= NEUTRAL_ASYMMETRY * reduced.scale:
        w = interruptible(lambda: np.linalg.eigvalsh(K_s))
        stiff = w[np.abs(w) > nothing]
        return Stiffnesses(stiff, len(w) - len(stiff), True)
    _, s, V = interruptible(lambda: np.linalg.svd(K))
    kept = V[s > nothing]
    return Stiffnesses(interruptible(lambda: np.linalg.eigvalsh(kept @ K_s @ kept.T)), len(s) - len(kept), False)


def eigenpairs(reduced, nothing=None):
    """The `Pairs` of `Reduced` equations."""
    from scipy.linalg import solve_triangular

    C, K, scale = reduced.C_hat, reduced.K_hat, reduced.scale
    nothing = NO_STIFFNESS * scale if nothing is None else nothing
    undamped = np.abs(C).max(initial=0.0) <= SYMMETRIC * np.sqrt(scale)
    if undamped and np.abs(K - K.T).max(initial=0.0) <= SYMMETRIC * scale:
        values, vectors = _symmetric(K, nothing)
    else:
        values, vectors = _general(C, K, nothing)
    values = values + 0.0
    order = np.lexsort((-values.imag, np.abs(values.imag), np.abs(values)))
    values, vectors = values[order], vectors[:, order]
    return Pairs(values, interruptible(lambda: solve_triangular(reduced.R, vectors)))


def _symmetric(K, nothing):
    """Pairs +- of sqrt(-w)."""
    w, vectors = interruptible(lambda: np.linalg.eigh(0.5 * (K + K.T)))
    w = np.where(np.abs(w) <= nothing, 0.0, w)
    roots = np.sqrt(-w.astype(complex))
    return np.concatenate((roots, -roots)), np.concatenate((vectors, vectors), axis=1).astype(complex)


def _general(C, K, nothing):
    """Of the first-order form, without the positions in the null space of K."""
    k = len(K)
    _, s, V = interruptible(lambda: np.linalg.svd(K))
    stiff = s > nothing
    kept, free = V[stiff].T, V[~stiff].T  # K x = (K kept) kept^T x
    A = np.block([[np.zeros((stiff.sum(), stiff.sum())), kept.T], [-K @ kept, -C]])
    values, vectors = interruptible(lambda: np.linalg.eig(A))
    values = np.where(np.abs(values) <= ZERO * np.abs(values).max(initial=0.0), 0.0, values)
    speeds, places = vectors[-k:], kept @ vectors[: len(vectors) - k]
    moving = np.linalg.norm(speeds, axis=0) >= np.linalg.norm(places, axis=0) * np.abs(values) * 0.5
    shapes = np.where(moving & (np.linalg.norm(speeds, axis=0) > 0.0), speeds, places)
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    return np.concatenate((np.zeros(free.shape[1]), values)), np.concatenate((free, shapes), axis=1).astype(complex)
