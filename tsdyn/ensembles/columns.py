"""Values of bodies for many cases at once, checked as `elements.bodies` checks those of one, to the same bits.

Each function returns what is kept of the values, and which of them are admissible; what is kept of others is undefined.
"""

import numpy as np

from ..elements.bodies import transform_g
from ..elements.tolerances import INERTIA_ROUNDING, LEAST_MASS, MOST_MASS, TRIANGLE, UNIT_LENGTH


def vectors(values):
    """Vectors (k, 3)."""
    if values.shape[1:] != (3,):
        return np.zeros((len(values), 3)), np.zeros(len(values), bool)
    return values, np.isfinite(values).all(axis=1)


def masses(values):
    """Masses (k,)."""
    if values.ndim != 1:
        return np.ones(len(values)), np.zeros(len(values), bool)
    return values, (values >= LEAST_MASS) & (values <= MOST_MASS)


def inertias(values):
    """Inertias (k, 3, 3), of principal values (k, 3) or matrices; those that are not admissible are the identity."""
    if values.shape[1:] == (3,):
        values, principal = np.zeros((len(values), 3, 3)), values
        values[:, range(3), range(3)] = principal
    if values.shape[1:] != (3, 3):
        return np.tile(np.eye(3), (len(values), 1, 1)), np.zeros(len(values), bool)
    fits = np.isfinite(values).all(axis=(1, 2)) & values.any(axis=(1, 2))
    values = np.where(fits[:, None, None], values, np.eye(3))
    scale = np.abs(values).max(axis=(1, 2))
    fits &= (scale >= LEAST_MASS) & (scale <= MOST_MASS)
    unit = values / scale[:, None, None]
    fits &= np.abs(unit - unit.swapaxes(1, 2)).max(axis=(1, 2)) <= INERTIA_ROUNDING
    principal = np.linalg.eigvalsh(unit / 2.0 + unit.swapaxes(1, 2) / 2.0)
    fits &= principal[:, 0] >= -INERTIA_ROUNDING
    fits &= principal[:, 2] <= (principal[:, 0] + principal[:, 1]) * (1.0 + TRIANGLE)
    return values / 2.0 + values.swapaxes(1, 2) / 2.0, fits


def orientations(values):
    """Euler parameters (k, 4)."""
    if values.shape[1:] != (4,):
        return np.zeros((len(values), 4)), np.zeros(len(values), bool)
    length = np.sqrt(_products(values[:, None, :], values)[:, 0])
    return values / length[:, None], np.abs(length - 1.0) <= UNIT_LENGTH


def parameter_rates(p, omega):
    """pd = G(p)^T omega' / 2, (k, 4)."""
    G = np.ascontiguousarray(transform_g(p))  # laid out as one alone is, for the same bits
    return 0.5 * _products(G.swapaxes(1, 2), omega)


def _products(A, x):
    """A x of each, by the routine that multiplies one alone."""
    return (A @ x[:, :, None])[:, :, 0]
