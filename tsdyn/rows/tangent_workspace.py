"""The tangent-form workspace: named arrays of the basis-free form."""

from typing import NamedTuple

import numpy as np


class Friction(NamedTuple):
    """k frictions of joints; of no size where there are none. "computed by" as in `Free`."""

    g: np.ndarray  # (k * 16,)  W times each for a normal load of one, on bodies a and b; friction_solve
    load: np.ndarray  # (k * 7,)  normal load, and its derivative by the reaction; friction.normal_load
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

    poses: np.ndarray  # ((b + 1) * 28,)  see body_poses.py; landing, tangent
    H: np.ndarray  # (m * 16,)  rows of [Phi_r, Phi_pi'] of bodies a and b; constraint_rows.reduced
    Y: np.ndarray  # (m * 16,)  W H^T; schur_complement.weigh_rows
    S: np.ndarray  # H W H^T, then its factors; schur_complement.multiply_rows, factorisation.factor
    b: np.ndarray  # (m,)  right-hand sides and solutions
    gamma: np.ndarray  # (m,)  acceleration bias in terms of omega'; constraint_rows.bias
    Z: np.ndarray  # ((b + 1) * 8,)  forces, then accelerations of bodies
    a: np.ndarray  # ((b + 1) * 8,)  accelerations of bodies; taylor
    Q: np.ndarray  # (n,)  applied forces
    p: np.ndarray  # (4,)  scratch
    sizes: np.ndarray  # (SIZES,)  numbers about the last landing and choice of rows, below
    dropped: np.ndarray  # int64 (m + 1,)  how many rows are dropped, and which; independent_rows.select
    chosen: (
        np.ndarray
    )  # int64 (m + 1,), order (m,), block (largest block, or m, squared)  scratch of independent_rows.select
    order: np.ndarray
    block: np.ndarray
    friction: Friction
    anew: np.ndarray  # int64 (2,)  address of evaluation.choose_anew, and of its `Choice`; zero where it isn't needed


# of the landing: |Phi|, and how far it moved a body; the largest |Phi| of dropped rows; what elimination left of the
# weakest of the others, as a share: when they were chosen, at a step's start, at its end, at most at any
RESIDUAL, MOVED, UNHELD, WEAKEST, SHARE, END_SHARE, LARGEST_SHARE, SIZES = range(8)


def no_free():
    """The `Free` of nothing, for its type."""
    none, whole, square = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 0))
    friction = Friction(*[none] * 7, square, square, whole, none)
    return Free(*[none] * 11, whole, whole, whole, none, friction, whole)
