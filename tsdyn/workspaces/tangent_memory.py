"""Layout of the tangent-form workspace."""

import numpy as np

from ..elements.loops.body_poses import POSE
from ..jit.aligned_arrays import zeros
from ..rows.evaluation import choosing_anew
from ..rows.tangent_workspace import LARGEST_SHARE, SHARE, SIZES, WEAKEST, Free, Friction

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
        _allocate_friction(network, n, basis), np.zeros(2, np.int64),
    )  # fmt: skip
    drop_as_at_first(network, free)
    return choosing_anew(network, free) if redundant or network.dropped.size else free


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
    free.sizes[SHARE] = free.sizes[LARGEST_SHARE] = 0.0
