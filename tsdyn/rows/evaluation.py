"""The workspace of rows; their evaluation: Phi, H, gamma or Phi_t, zero at redundant rows; multipliers in series."""

from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import call_body_loop
from ..jit.kernels import Record, kernel, long_kernel
from .inertia_rows import clear_entries, keep_bias, set_rows_aside
from .redundant_rows import clear_redundant, keep_every_row, keep_redundant, leave_redundant_rows, restore_selection
from .schur_complement import (
    add_multiplier_terms,
    apply_columns,
    clear_axes,
    find_correction,
    gather_axes,
    solve_product,
)


class Rows(NamedTuple):
    """Constraint rows at one configuration: H, Y = W H^T and the factors of S = H W H^T; m rows, none a normalisation.

    Without the redundant rows: these are zero in H and Y, and have a one on the diagonal of S.
    """

    H: np.ndarray  # (pairs * 16,)  [Phi_r, Phi_pi'] of the pairs of sides, m or more; constraint_rows.reduced
    Y: np.ndarray  # (pairs * 16,)  W H^T; schur_complement.weigh_rows
    S: np.ndarray  # H W H^T, then its factors; schur_complement.multiply_rows, factorisation.factor
    h: np.ndarray  # (k * 20,)  inertia rows; inertia_rows.py


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
    dropped: np.ndarray  # int64 (m + 1,)  how many rows are redundant, and which; row_selection.select
    best: np.ndarray  # (m,), or (0,)  pivots of S relative to their diagonal entries: the largest since the selection
    saved: np.ndarray  # int64 (m + 1,)  rows before a passing selection; redundant_rows.save_selection
    saved_best: np.ndarray  # and pivots
    chosen: np.ndarray  # int64 (m + 1,)  scratch of row_selection.select, as the next two
    order: np.ndarray  # int64 (m,)
    block: np.ndarray  # (largest block, or m, squared)
    friction: Friction
    reselection: np.ndarray  # int64 (2,)  addresses of reselect_rows and its `Choice`; 0: not needed


def no_tangent_workspace():
    """The `TangentWorkspace` of nothing, for its type."""
    none, whole, square = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 0))
    friction = Friction(*[none] * 8, square, square, whole, none)
    rows, records = Rows(none, none, none, none), (Landing(), Selection(), Indicator(), RedundantRows(none, none, none))
    return TangentWorkspace(
        none, rows, *[none] * 6, *records, whole, none, whole, none, whole, whole, none, friction, whole
    )


# Row evaluation at the current poses: Phi, H, gamma or Phi_t, zero at redundant rows.


@kernel
def _run_loop(graph, reals, f, t, kind, loop, out, H):
    """Call one of the loops of a kind, by its address, or zero for none."""
    if loop != 0:
        call_body_loop(
            loop, kind.count, kind.stride, graph.table[kind.table :], reals[kind.reals :], f.poses, f.poses, t, out, H
        )


@kernel
def _clear_other_rows(graph, out):
    """out = 0 of welds and axis rows, which aren't rows of Phi."""
    clear_welds(graph, out)
    if graph.axes.rows.shape[0] > 0:
        clear_axes(graph, out)
    clear_entries(graph, out)


@kernel
def clear_welds(graph, out):
    """out = 0 of the welds between the parts of a split body."""
    for i in range(graph.welds.shape[0]):
        out[graph.welds[i, 0]] = 0.0


@kernel
def clear_sums(graph, out):
    """out = 0 of rows that several instances add to."""
    for i in range(graph.sums.shape[0]):
        out[graph.sums[i]] = 0.0


@kernel
def evaluate_without_redundant(graph, reals, f, rows, t):
    """As `evaluate_rows`, where no row is redundant; reals being System.reals."""
    # All kinds write their rows of Phi and H
    clear_sums(graph, f.b)
    for i in range(graph.kinds.shape[0]):
        kind = graph.kinds[i]
        _run_loop(graph, reals, f, t, kind, kind.reduced, f.b, rows.H)
    _clear_other_rows(graph, f.b)
    set_rows_aside(graph, rows)


@kernel
def _evaluate(graph, reals, f, rows, t):
    """f.b = Phi and H of every row that is not dropped."""
    evaluate_without_redundant(graph, reals, f, rows, t)
    if f.dropped[0] > 0:
        leave_redundant_rows(graph, f, f.b, rows.H)


@kernel
def evaluate_rows(graph, system, f, rows, t):
    """f.b = Phi and H = [Phi_r, Phi_pi'], at the poses of f; zero at redundant rows."""
    _evaluate(graph, system.reals, f, rows, t)


@kernel
def evaluate_all(graph, reals, f, rows, t):
    """As `evaluate_every_row`, reals being System.reals."""
    count = keep_every_row(f)
    _evaluate(graph, reals, f, rows, t)
    restore_selection(f, count)


@long_kernel
def evaluate_every_row(graph, system, f, rows, t):
    """f.b = Phi and H at the poses of f, redundant rows included."""
    evaluate_all(graph, system.reals, f, rows, t)


@kernel
def evaluate_residuals(graph, system, f, t):
    """f.b = Phi, at the poses of f; zero at redundant rows."""
    clear_sums(graph, f.b)
    for i in range(graph.kinds.shape[0]):
        kind = graph.kinds[i]
        _run_loop(graph, system.reals, f, t, kind, kind.values, f.b, f.rows.H)
    _clear_other_rows(graph, f.b)
    clear_redundant(f, f.b)


@kernel
def evaluate_bias(graph, system, f, t):
    """f.gamma = gamma, with H (rdd, omega'd) + gamma = 0."""
    clear_sums(graph, f.gamma)
    for i in range(graph.kinds.shape[0]):
        kind = graph.kinds[i]
        _run_loop(graph, system.reals, f, t, kind, kind.bias, f.gamma, f.rows.H)
    keep_bias(graph, f.rows, f.gamma)
    _clear_other_rows(graph, f.gamma)
    keep_redundant(f, f.gamma, f.redundant.gamma)


@kernel
def evaluate_drift(graph, system, f, t, out):
    """out = Phi_t, with H (rd, omega') + Phi_t = 0."""
    # Kinds without a motion write nothing
    for e in range(out.size):
        out[e] = 0.0
    for i in range(graph.kinds.shape[0]):
        kind = graph.kinds[i]
        _run_loop(graph, system.reals, f, t, kind, kind.drift, out, f.rows.H)
    keep_redundant(f, out, f.redundant.drift)


# Multipliers of one order of a Taylor series, by the factors of S at order zero.


@kernel
def solve_series(graph, f, omega, at, stride, k, correction):
    """lam of order k from f.b, the residuals of Phi_{k+2}.

    S lam = f.b,    f.Z = -Y^T lam

    Order k + 1 of omega' of body i is at omega[at + stride * i]. With `correction` f.b becomes what f.gamma, a first
    solution, lacks.
    """
    _complete(graph, f, omega, at, stride, k, correction)
    find_correction(graph, f.rows, f.b, f.Z)


@kernel
def solve_friction_series(graph, f, omega, at, stride, k):
    """The same with joint friction, as a correction of f.gamma.

    N~ lam = f.b,    f.Z = -X^T lam,    N~ = H X^T as of accelerations.py
    """
    r = f.friction
    _complete(graph, f, omega, at, stride, k, True)
    # N~ lam = residual,  Z = -X^T lam
    solve_product(graph, r.lower, r.upper, f.b)
    for i in range(f.Z.size):
        f.Z[i] = 0.0
    apply_columns(graph, r.X, f.b, f.Z)


@kernel
def _complete(graph, f, omega, at, stride, k, correction):
    """The residuals f.b of all rows, from those of the primitives."""
    # Welds: zero. Axis rows: (k + 1) c e . omega'_{k+1}, and lam_e of a first solution; inertia rows: less mu of that
    clear_welds(graph, f.b)
    gather_axes(graph, omega, at, stride, k + 1.0, f.b)
    if correction:
        add_multiplier_terms(graph, f.gamma, f.b)
    clear_redundant(f, f.b)
