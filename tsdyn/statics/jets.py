"""Functions of time to second order along the nominal motion: arrays of value, rate and half the second derivative."""

import numpy as np


def product(a, b, spec):
    """Einstein sum of two jets, (3, ...) each; spec is that of their values."""
    first, rest = spec.split(",")
    second, out = rest.split("->")

    def of(i, j):
        return np.einsum(f"{first},{second}->{out}", a[i], b[j])

    return np.stack((of(0, 0), of(0, 1) + of(1, 0), of(0, 2) + of(1, 1) + of(2, 0)))


def quotient(a, b):
    """A jet (3, ...) over a jet of a number (3,)."""
    c0 = a[0] / b[0]
    c1 = (a[1] - c0 * b[1]) / b[0]
    return np.stack((c0, c1, (a[2] - c1 * b[1] - c0 * b[2]) / b[0]))


def constant(value):
    """The jet of what doesn't change."""
    value = np.asarray(value, float)
    return np.stack((value, np.zeros_like(value), np.zeros_like(value)))


def turning(rate):
    """The jet (3, 3, 3) of R^T, R turning steadily at a rate (3,) from the identity."""
    x, y, z = rate
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.stack((np.eye(3), -cross, 0.5 * cross @ cross))
