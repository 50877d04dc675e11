"""Chebyshev interpolants through samples on [-1, 1], as tables made once for each degree."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

FINE = 4  # cells of the fine grid between two nodes
CHECK = -float(np.cos(0.3 * np.pi))  # well off the nodes of every degree that is a power of two


class Table(NamedTuple):
    """The interpolant of degree N, a power of two, through N + 1 samples."""

    nodes: np.ndarray  # (N + 1,)  Chebyshev points of the second kind, increasing; those of N / 2 are every other one
    fine: np.ndarray  # (FINE N + 1,)  grid of which the nodes are every FINE-th point
    coefficients: np.ndarray  # (N + 1, N + 1)  samples -> Chebyshev coefficients
    values: (
        np.ndarray
    )  # (FINE N + 2 + N / 2, N + 1)  samples -> values on the fine grid and at CHECK, higher coefficients


@cache
def table(N):
    """The `Table` of degree N."""
    nodes, fine = (-np.cos(np.pi / k * np.arange(k + 1)) for k in (N, FINE * N))
    nodes[N // 2] = fine[FINE * N // 2] = 0.0
    coefficients = 2.0 / N * chebyshev.chebvander(nodes, N).T
    coefficients[:, [0, -1]] *= 0.5
    coefficients[[0, -1]] *= 0.5
    values = chebyshev.chebvander(np.append(fine, CHECK), N) @ coefficients
    return Table(nodes, fine, coefficients, np.concatenate((values, coefficients[N // 2 + 1 :])))


def extremes(coefficients):
    """Zeros (k,) in (-1, 1) of the derivative of a Chebyshev series, increasing."""
    slope = np.trim_zeros(chebyshev.chebder(coefficients), "b")
    if slope.size < 2:
        return np.empty(0)
    roots = chebyshev.chebroots(slope)
    real = roots.real[np.abs(roots.imag) < 1e-6]
    return np.sort(real[np.abs(real) < 1.0])
