"""The workspace of constraint rows: named arrays of the basis-free forms."""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import Record


class Rows(NamedTuple):
    """Constraint rows at one configuration: H, Y = W H^T and the factors of S = H W H^T; m rows, none a normalisation.

    Without the redundant rows: these are zero in H and Y, and have a one on the diagonal of S.
    """

    H: np.ndarray  # (pairs * 16,)  [Phi_r, Phi_pi'] of the pairs of sides, m or more; constraint_rows.reduced
    Y: np.ndarray  # (pairs * 16,)  W H^T; schur_complement.weigh_rows
    S: np.ndarray  # H W H^T, then its factors; schur_complement.multiply_rows, factorisation.factor


class Friction(NamedTuple):
    """k frictions of joints; of no size where there are none. "computed by" as in `TangentWorkspace`."""

    g: np.ndarray  # (k * 16,)  W times each for a normal load of one, on bodies a and b; friction_solve
    load: np.ndarray  # (k * 7,)  normal load, and its derivative by the reaction; friction.normal_load
    kept: np.ndarray  # markers, arm and orientation of each at the present configuration; friction.normal_load
    lam: np.ndarray  # (m,)  multipliers, from one evaluation to the next; friction_solve
    Z: np.ndarray  # ((b + 1) * 8,)  accelerations of bodies without friction and reactions; friction_solve
    X: np.ndarray  # (pairs * 16,)  W (H^T - g N_lam); friction_solve
    lower: np.ndarray  # factors of S - H W g N_lam; friction_solve
    upper: np.ndarray
    basis: np.ndarray  # (k, n + rows of Phi)  by each for a load of one, vdd and multipliers; friction_basis
    J: np.ndarray  # (k, k)  I - N_lam lam_N; friction_basis
    pivots: np.ndarray  # int64 (k,)
    numbers: np.ndarray  # (2 (rows of Phi + n + k),)  multipliers without and with friction, scratch; friction_basis


class RedundantRows(NamedTuple):
    """The redundant rows, in the order of `TangentWorkspace.dropped`; of no size where none may be redundant."""

    H: np.ndarray  # (pairs * 16,)  as in `Rows`, at the last evaluation; later terms of sums in their own places
    drift: np.ndarray  # (m,)  Phi_t
    gamma: np.ndarray  # (m,)  acceleration bias


class Landing(Record):
    """The last projection of positions onto the manifold."""

    residual: float  # the largest |Phi| that it met
    moved: float  # the largest displacement of a body, m or rad


class Selection(Record):
    """Quality of the selection of redundant rows, and loads that they are judged by."""

    excess: float  # by how much |Phi| of the redundant rows exceeds HELD of its terms, at most
    push: float  # the largest |W F| of a body, m/s^2
    twist: float  # and rad/s^2


class Indicator(Record):
    """The singularity indicator, see row_selection.py."""

    start: float  # of a step
    end: float
    largest: float  # in the run


class TangentWorkspace(NamedTuple):
    """b bodies and the ground, m rows that are no normalisations; "computed by" names the kernel."""

    poses: np.ndarray  # ((b + 1) * 28,)  see constraint_rows.py; projection, tangent
    rows: Rows  # at the poses; interface.evaluate_rows, factorise_rows
    b: np.ndarray  # (m,)  right-hand sides and solutions
    gamma: np.ndarray  # (m,)  acceleration bias in terms of omega'; constraint_rows.bias
    Z: np.ndarray  # ((b + 1) * 8,)  forces, then accelerations of bodies
    a: np.ndarray  # ((b + 1) * 8,)  accelerations of bodies; taylor
    Q: np.ndarray  # (n,)  applied forces
    p: np.ndarray  # (4,)  scratch
    landing: Landing
    selection: Selection
    indicator: Indicator
    redundant: RedundantRows
    dropped: np.ndarray  # int64 (m + 1,)  how many rows are redundant, and which; independent_rows.select
    best: np.ndarray  # (m,), or (0,)  pivots of S relative to their diagonal entries: the largest since the selection
    saved: np.ndarray  # int64 (m + 1,)  rows before a passing selection; redundant_rows.save_selection
    saved_best: np.ndarray  # and pivots
    chosen: np.ndarray  # int64 (m + 1,)  scratch of independent_rows.select, as the next two
    order: np.ndarray  # int64 (m,)
    block: np.ndarray  # (largest block, or m, squared)
    friction: Friction
    reselection: np.ndarray  # int64 (2,)  addresses of reselect_rows and its `Choice`; 0: not needed


def no_tangent_workspace():
    """The `TangentWorkspace` of nothing, for its type."""
    none, whole, square = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 0))
    friction = Friction(*[none] * 8, square, square, whole, none)
    rows, records = Rows(none, none, none), (Landing(), Selection(), Indicator(), RedundantRows(none, none, none))
    return TangentWorkspace(
        none, rows, *[none] * 6, *records, whole, none, whole, none, whole, whole, none, friction, whole
    )
