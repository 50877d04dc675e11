"""Constraint rows for all other packages. Redundant rows are dropped below this module."""

import numpy as np

from ..elements.loops.constraint_rows import POSE
from ..jit.resident import zeros
from .constraint_graph import is_raised
from .elimination import KERNELS as ELIMINATION
from .elimination import lu_factors
from .evaluation import (
    Friction,
    Indicator,
    Landing,
    RedundantRows,
    Rows,
    Selection,
    TangentWorkspace,
    clear_sums,
    evaluate_bias,
    evaluate_drift,
    evaluate_every_row,
    evaluate_residuals,
    evaluate_rows,
    evaluate_without_redundant,
    solve_friction_series,
    solve_series,
)
from .inertia_rows import WIDTH as INERTIA_WIDTH
from .inertia_rows import multiply as multiply_inertia_rows
from .inertia_rows import unbalance as unbalance_inertia_rows
from .redundant_rows import (
    clear_rates,
    clear_redundant,
    keep_every_row,
    list_redundant,
    mark_redundant,
    note_selection,
    rates_hold_along,
    restore_selection,
    return_to_selection,
    save_selection,
    take_noted_selection,
)
from .row_selection import (
    accelerations_hold,
    count_self_stresses,
    doubt_selection,
    factorise_rows,
    has_redundant_rows,
    is_near_singular,
    is_next_to_singular,
    is_singular_within_a_step,
    note_indicator,
    note_loads,
    rates_hold,
    redundant_rows_hold,
    refinements,
    select_rows,
    self_stress,
    singularity_indicator,
    with_reselection,
)
from .saddle_matrix import (
    factorise_complex_saddle,
    factorise_saddle,
    solve_complex_saddle,
    solve_saddle,
    write_saddle_rows,
)
from .schur_complement import (
    DYNAMICS,
    METRIC,
    acceleration_residuals,
    add_multiplier_terms,
    add_products,
    apply_multipliers,
    balance_loads,
    constrain,
    constrain_accelerations,
    factorise_and_constrain,
    factorise_chart_matrix,
    factorise_product,
    factorise_selected_rows,
    find_correction,
    form_selected_rows,
    inner,
    is_axis,
    more,
    multiply_rates,
    multiply_rows,
    pivot_loss,
    project,
    rotate_rate,
    solve_product,
    solve_rows,
    take_reactions,
    weigh,
    weigh_bodies,
    weigh_selected_rows,
)
from .tolerances import ILL_CONDITIONED, MOST_ROWS

# Allocation of the workspace of constraint rows.


def allocate_tangent(graph, n, redundant=False, basis=False):
    """Allocate a `TangentWorkspace`; the ground's pose is set once, and a point mass has its orientation.

    Where rows may be `redundant`, there is room to select among all at once, if they aren't too many. A form with a
    basis needs room for its frictions, too.
    """
    nb, m = len(graph.bodies), len(graph.row)
    redundant = redundant or graph.dropped.size > 0
    choosing, left = redundant and m <= MOST_ROWS, m if redundant else 0
    widest = int(np.diff(graph.pattern.starts).max(initial=0))
    poses = zeros((nb + 1) * POSE)
    poses.reshape(-1, POSE)[:, [0, 5, 10, 24]] = 1.0
    tangent = TangentWorkspace(
        poses, allocate_rows(graph), zeros(m), zeros(m), zeros(8 * (nb + 1)), zeros(8 * (nb + 1)), zeros(n),
        zeros(4), Landing(), Selection(), Indicator(),
        RedundantRows(zeros(16 * len(graph.sides) if redundant else 0), zeros(left), zeros(left)),
        np.zeros(m + 1, np.int64), zeros(left), np.zeros(m + 1, np.int64), zeros(left),
        *(np.zeros(size, np.int64) for size in (m + 1, m)),
        zeros(max(widest, m if choosing else 0) ** 2), _allocate_friction(graph, n, basis), np.zeros(2, np.int64),
    )  # fmt: skip
    reset_selection(graph, tangent)
    return with_reselection(graph, tangent) if redundant else tangent


def with_all_rows(graph):
    """The graph without redundant rows: of a workspace in which those of phases are selected, and no others."""
    return graph._replace(dropped=graph.dropped[:0])


def allocate_rows(graph):
    """Allocate `Rows`."""
    size, inertias = 16 * len(graph.sides), zeros(INERTIA_WIDTH * len(graph.inertias))
    return Rows(zeros(size), zeros(size), zeros(graph.pattern.shape[2]), inertias)


def _allocate_friction(graph, n, basis):
    k, rows = len(graph.frictions), len(graph.row) + int((graph.normals >= 0).sum())
    m, pairs, nb = (len(graph.row), len(graph.sides), len(graph.bodies)) if k else (0, 0, -1)
    factors = lu_factors(graph.pattern) if k else (zeros(0), zeros(0))
    kept = int(graph.frictions[-1].kept + graph.frictions[-1].room) if k else 0
    free = zeros(16 * k), zeros(7 * k), zeros(kept), zeros(m), zeros(8 * (nb + 1)), zeros(16 * pairs), *factors
    if not basis:
        k = n = rows = 0
    matrices = np.zeros((k, n + rows)), np.zeros((k, k)), np.zeros(k, np.int64)
    return Friction(*free, *matrices, np.zeros(2 * (rows + n) + 2 * k if k else 0))


def reset_selection(graph, tangent):
    """Select the rows of the scene's first start again, and forget multipliers and singularity indicators."""
    friction, indicator = tangent.friction, tangent.indicator
    if friction.load.size:
        friction.lam.fill(0.0)
        friction.load.fill(0.0)
    set_selection(tangent, graph.dropped)
    selection = tangent.selection
    selection.push = selection.twist = 0.0
    tangent.best.fill(1.0)
    if tangent.redundant[0].size:
        for array in tangent.redundant:
            array.fill(0.0)
    indicator.start = indicator.end = indicator.largest = 0.0


def selection_parts(tangent):
    """The arrays and the records that `reset_selection` sets."""
    friction = tangent.friction
    arrays = [friction.lam, friction.load, tangent.dropped, tangent.best, *tangent.redundant]
    return arrays, [tangent.selection, tangent.indicator]


def set_selection(tangent, redundant):
    """Drop these rows, int64 (k,), in the order of the graph."""
    tangent.dropped[0] = count = len(redundant)
    if count:
        tangent.dropped[1 : 1 + count] = redundant


def redundant_of(tangent):
    """Rows that are dropped at present, int64 (k,), in the order of the graph."""
    return tangent.dropped[1 : 1 + tangent.dropped[0]].copy()


def redundancy(graph):
    """Number of redundant rows of a scene, which its number of degrees of freedom depends on."""
    return len(graph.dropped)


# Constraint rows for all other packages. Redundant rows are dropped below this module.
#
#   H = [Phi_r, Phi_pi'],    Y = W H^T,    S = H W H^T        `Rows`: f.rows at the poses of f, l.rows0 at q0 of a chart
#
# Evaluate, at the poses of f, t and the velocities:
#     evaluate_rows           f.b = Phi, H            evaluate_residuals      f.b = Phi
#     evaluate_bias           f.gamma = gamma         evaluate_drift          out = Phi_t
# Factorise:
#     factorise_rows          Y, S = L D L^T          factorise_chart_matrix  N = H C Y0 = L D U
#     weigh_selected_rows     Y alone
#     factorise_product       H X^T = L D U
#     write_saddle_rows, factorise_saddle, solve_saddle         of the saddle-point matrix of implicit methods
#     factorise_complex_saddle, solve_complex_saddle            the same with complex steps
# Solve:
#     solve_rows              b <- S^-1 b             solve_product           b <- N^-1 b
#     multiply_rows           out = H Z               apply_multipliers       Z <- Z - Y^T lam
#     add_products            out <- out + H Z
#     find_correction         lam = S^-1 b, Z = -Y^T lam
#     project                 lam = S^-1 H Z, Z <- Z - Y^T lam
#     constrain               lam = S^-1 (H Z + c), Z <- Z - Y^T lam
#     constrain_accelerations the same with axis rows, for Z = W F and c = gamma
#     factorise_and_constrain the same, the factors made with it, of S as form_selected_rows leaves it
#     balance_loads           lam = S^-1 H W F, F <- F - H^T lam
#     take_reactions          F <- F - H^T lam
#     clear_rates             b <- 0 at rows on velocities, which hold nothing in place
#     solve_series            the same for one order of a Taylor series
#     solve_friction_series   the same with joint friction, by N~ of accelerations.py
# Ask:
#     redundant_rows_hold, rates_hold, accelerations_hold       of redundant rows; rates_hold_along a direction
#     mark_redundant, self_stress                               of redundant rows
#     singularity_indicator, is_near_singular, refinements      of the distance to a singular configuration
#
# ELIMINATION are the kernels that factorise and solve, lu_factors the arrays of N.
#
# Right-hand sides and multipliers are in the order of the graph; `ConstraintGraph.row` names the rows of Phi.
