"""Chebyshev interpolation on [-1, 1]; tables are made once for each degree."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from .tolerances import REAL

FINE = 4  # cells of the fine grid between two nodes
CHECK = -float(np.cos(0.3 * np.pi))  # far from the nodes of every degree that is a power of two


class Table(NamedTuple):
    """The interpolant of degree N, a power of two, through samples at N + 1 nodes; one more sample checks it."""

    nodes: np.ndarray  # (N + 1,)  Chebyshev points of the second kind, increasing; those of N / 2 are every other one
    points: np.ndarray  # (N + 2,)  nodes and CHECK
    at_nodes: np.ndarray  # (N + 1,)  which of them are nodes
    known: np.ndarray  # (N / 2 + 2,)  which of them are points of N / 2
    fresh: np.ndarray  # (N / 2,)  which are not
    middle: int  # which is 0
    fine: np.ndarray  # (FINE N + 1,)  grid of which the nodes are every FINE-th point
    coefficients: np.ndarray  # (N + 1, N + 1)  samples at nodes -> Chebyshev coefficients
    values: np.ndarray  # (FINE N + 1, N + 2)  samples at points -> values on the fine grid
    errors: np.ndarray  # (N / 2 + 1, N + 2)  samples at points -> error at CHECK, and the higher coefficients


@cache
def table(N):
    """The `Table` of degree N."""
    nodes, fine = (-np.cos(np.pi / k * np.arange(k + 1)) for k in (N, FINE * N))
    nodes[N // 2] = fine[FINE * N // 2] = 0.0
    coefficients = 2.0 / N * chebyshev.chebvander(nodes, N).T
    coefficients[:, [0, -1]] *= 0.5
    coefficients[[0, -1]] *= 0.5
    check = int(np.searchsorted(nodes, CHECK))
    points, widened = np.insert(nodes, check, CHECK), np.insert(coefficients, check, 0.0, axis=1)
    known = np.searchsorted(points, np.append(nodes[::2], CHECK))
    known.sort()
    missed = chebyshev.chebvander(CHECK, N).ravel() @ widened
    missed[check] = -1.0
    return Table(
        nodes,
        points,
        np.delete(np.arange(N + 2), check),
        known,
        np.setdiff1d(np.arange(N + 2), known),
        int(np.searchsorted(points, 0.0)),
        fine,
        coefficients,
        chebyshev.chebvander(fine, N) @ widened,
        np.concatenate((missed[None], widened[N // 2 + 1 :])),
    )


def extremes(coefficients):
    """Real zeros (k,) of the derivative of a Chebyshev series, increasing."""
    slope = np.trim_zeros(chebyshev.chebder(coefficients), "b")
    if slope.size < 2:
        return np.empty(0)
    roots = chebyshev.chebroots(slope)
    return np.sort(roots.real[np.abs(roots.imag) < REAL])
