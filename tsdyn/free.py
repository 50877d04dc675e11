"""The scratch memory of the basis-free forms."""

from typing import NamedTuple

import numpy as np

from .aligned import zeros
from .poses import POSE


class Friction(NamedTuple):
    """k frictions of joints; of no size where there are none. "computed by" as in `Free`."""

    g: np.ndarray  # (k * 16,)  W times each for a normal load of one, on bodies a and b; friction_solve
    load: np.ndarray  # (k * 7,)  normal load, and its derivative by the reaction; friction_loops.normal_load
    lam: np.ndarray  # (m,)  multipliers, from one evaluation to the next; friction_solve
    Z: np.ndarray  # ((b + 1) * 8,)  accelerations of bodies without friction and reactions; friction_solve
    X: np.ndarray  # (m * 16,)  W (H^T - g N_lam); friction_solve
    lower: np.ndarray  # factors of S - H W g N_lam; friction_solve
    upper: np.ndarray
    basis: np.ndarray  # (k, n + rows of Phi)  by each for a load of one, vdd and multipliers; friction_basis
    J: np.ndarray  # (k, k)  I - N_lam lam_N; friction_basis
    pivots: np.ndarray  # int64 (k,)
    numbers: np.ndarray  # (2 (rows of Phi + n + k),)  multipliers without and with friction, scratch; friction_basis


class Free(NamedTuple):
    """b bodies and the ground, m rows that are no normalisations; "computed by" names the kernel."""

    poses: np.ndarray  # ((b + 1) * 28,)  see poses.py; landing, tangent
    H: np.ndarray  # (m * 16,)  rows of [Phi_r, Phi_pi'] of bodies a and b; body_loops.reduced
    Y: np.ndarray  # (m * 16,)  W H^T; normal.weigh_rows
    S: np.ndarray  # H W H^T, then its factors; normal.multiply_rows, block_kernels.factor
    b: np.ndarray  # (m,)  right-hand sides and solutions
    gamma: np.ndarray  # (m,)  acceleration bias in terms of omega'; body_loops.bias
    Z: np.ndarray  # ((b + 1) * 8,)  forces, then accelerations of bodies
    a: np.ndarray  # ((b + 1) * 8,)  accelerations of bodies; taylor
    Q: np.ndarray  # (n,)  applied forces
    p: np.ndarray  # (4,)  scratch
    sizes: np.ndarray  # (SIZES,)  numbers about the last landing and choice of rows, below
    dropped: np.ndarray  # int64 (m + 1,)  how many rows are dropped, and which; selection.select
    chosen: np.ndarray  # int64 (m + 1,), order (m,), block (largest block, or m, squared)  scratch of selection.select
    order: np.ndarray
    block: np.ndarray
    friction: Friction


# of the landing; the largest |Phi| of dropped rows; what elimination left of the weakest of the others, as a share:
# when they were chosen, at a step's start, at its end, at most at any; the last step from a place that isn't singular
RESIDUAL, MOVED, UNHELD, WEAKEST, SHARE, END_SHARE, LARGEST_SHARE, STRIDE, SIZES = range(9)


MOST_ROWS = 700  # of which all are compared when independent ones are chosen


def allocate_free(network, n, redundant=False, basis=False):
    """Lay it out; the ground's pose is set for good, and a point mass has that orientation.

    Where rows are `redundant`, there is room to choose among all at once, if they aren't too many. A form with a basis
    needs room for its frictions, too.
    """
    nb, m = len(network.bodies), len(network.row)
    choosing = (redundant or network.dropped.size > 0) and m <= MOST_ROWS
    widest = int(np.diff(network.pattern.starts).max(initial=0))
    poses = zeros((nb + 1) * POSE)
    poses.reshape(-1, POSE)[:, [0, 5, 10, 24]] = 1.0
    free = Free(
        poses, zeros(16 * m), zeros(16 * m), zeros(network.pattern.shape[2]), zeros(m), zeros(m),
        zeros(8 * (nb + 1)), zeros(8 * (nb + 1)), zeros(n), zeros(4), zeros(SIZES),
        *(np.zeros(size, np.int64) for size in (m + 1, m + 1, m)), zeros(max(widest, m if choosing else 0) ** 2),
        _allocate_friction(network, n, basis),
    )  # fmt: skip
    drop_as_at_first(network, free)
    return free


def _allocate_friction(network, n, basis):
    k, rows = len(network.frictions), len(network.row) + int((network.normals >= 0).sum())
    m, nb, size = (len(network.row), len(network.bodies), network.pattern.shape[2]) if k else (0, -1, 0)
    free = zeros(16 * k), zeros(7 * k), zeros(m), zeros(8 * (nb + 1)), zeros(16 * m), zeros(size), zeros(size)
    if not basis:
        k = n = rows = 0
    matrices = np.zeros((k, n + rows)), np.zeros((k, k)), np.zeros(k, np.int64)
    return Friction(*free, *matrices, np.zeros(2 * (rows + n) + 2 * k if k else 0))


def drop_as_at_first(network, free):
    """Drop the rows that were found redundant at the scene's first start, and forget multipliers."""
    free.friction.lam[:] = 0.0
    free.friction.load[:] = 0.0
    free.dropped[0] = network.dropped.size
    free.dropped[1 : 1 + network.dropped.size] = network.dropped
    free.sizes[WEAKEST] = 1.0
    free.sizes[SHARE] = free.sizes[LARGEST_SHARE] = free.sizes[STRIDE] = 0.0
