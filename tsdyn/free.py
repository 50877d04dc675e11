"""The scratch memory of the basis-free forms."""

from typing import NamedTuple

import numpy as np

from .aligned import zeros
from .poses import POSE


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
    sizes: np.ndarray  # (SIZES,)  numbers about the last landing, below


RESIDUAL, MOVED, SIZES = range(3)


def allocate_free(network, n):
    """Lay it out; the ground's pose is set for good, and a point mass has that orientation."""
    nb, m = len(network.bodies), len(network.row)
    poses = zeros((nb + 1) * POSE)
    poses.reshape(-1, POSE)[:, [0, 5, 10, 24]] = 1.0
    return Free(
        poses, zeros(16 * m), zeros(16 * m), zeros(network.pattern.shape[2]), zeros(m), zeros(m),
        zeros(8 * (nb + 1)), zeros(8 * (nb + 1)), zeros(n), zeros(4), zeros(SIZES),
    )  # fmt: skip
