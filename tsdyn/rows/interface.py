"""Constraint rows for all other packages. Redundant rows are dropped below this module.

    H = [Phi_r, Phi_pi'],    Y = W H^T,    S = H W H^T        `Rows`: f.rows at the poses of f, l.rows0 at q0 of a chart

Evaluate, at the poses of f, t and the velocities:
    evaluate_rows           f.b = Phi, H            evaluate_residuals      f.b = Phi
    evaluate_bias           f.gamma = gamma         evaluate_drift          out = Phi_t
Factorise:
    factorise_rows          Y, S = L D L^T          factorise_chart_matrix  N = H C Y0 = L D U
    factorise_product       H X^T = L D U
    write_saddle_rows, factorise_saddle, solve_saddle         of the saddle-point matrix of implicit methods
    factorise_complex_saddle, solve_complex_saddle            the same with complex steps
Solve:
    solve_rows              b <- S^-1 b             solve_product           b <- N^-1 b
    multiply_rows           out = H Z               apply_multipliers       Z <- Z - Y^T lam
    add_products            out <- out + H Z
    find_correction         lam = S^-1 b, Z = -Y^T lam
    project                 lam = S^-1 H Z, Z <- Z - Y^T lam
    constrain               lam = S^-1 (H Z + c), Z <- Z - Y^T lam
    constrain_accelerations the same with axis rows, for Z = W F and c = gamma
    balance_loads           lam = S^-1 H W F, F <- F - H^T lam
    take_reactions          F <- F - H^T lam
    solve_series            the same for one order of a Taylor series
    solve_friction_series   the same with joint friction, by N~ of friction_solve.py
Ask:
    redundant_rows_hold, rates_hold, accelerations_hold       of redundant rows
    mark_redundant, self_stress                               of redundant rows
    singularity_indicator, is_near_singular, refinements      of the distance to a singular configuration

ELIMINATION are the kernels that factorise and solve, lu_factors the arrays of N.

Right-hand sides and multipliers are in the order of the graph; `ConstraintGraph.row` names the rows of Phi.
"""

from ..sparse.elimination import KERNELS as ELIMINATION
from ..sparse.elimination import lu_factors
from .axis_rows import add_axis_multipliers, is_axis
from .chart_matrix import factorise_chart_matrix, factorise_product, pivot_loss, rotate_rate, solve_product
from .evaluation import (
    evaluate_bias,
    evaluate_drift,
    evaluate_every_row,
    evaluate_residuals,
    evaluate_rows,
    evaluate_without_redundant,
)
from .held_rows import accelerations_hold, has_redundant_rows, note_loads, rates_hold, redundant_rows_hold
from .redundant_rows import (
    clear_redundant,
    keep_every_row,
    list_redundant,
    mark_redundant,
    note_selection,
    restore_selection,
    return_to_selection,
    save_selection,
    take_noted_selection,
)
from .reselection import doubt_selection, factorise_rows, select_rows, selection_serves, with_reselection
from .row_memory import (
    allocate_rows,
    allocate_tangent,
    redundancy,
    redundant_of,
    reset_selection,
    selection_parts,
    set_selection,
)
from .row_workspace import Rows, TangentWorkspace
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
    add_products,
    apply_multipliers,
    balance_loads,
    constrain,
    constrain_accelerations,
    factorise_selected_rows,
    find_correction,
    inner,
    more,
    multiply_rates,
    multiply_rows,
    project,
    solve_rows,
    take_reactions,
    weigh,
    weigh_bodies,
)
from .self_stress import count_self_stresses, self_stress
from .series import solve_friction_series, solve_series
from .singularity import (
    is_near_singular,
    is_next_to_singular,
    is_singular_within_a_step,
    note_indicator,
    refinements,
    singularity_indicator,
)
from .tolerances import ILL_CONDITIONED, MOST_ROWS

__all__ = [
    "DYNAMICS",
    "ELIMINATION",
    "ILL_CONDITIONED",
    "METRIC",
    "MOST_ROWS",
    "Rows",
    "TangentWorkspace",
    "acceleration_residuals",
    "accelerations_hold",
    "add_axis_multipliers",
    "add_products",
    "allocate_rows",
    "allocate_tangent",
    "apply_multipliers",
    "balance_loads",
    "clear_redundant",
    "constrain",
    "constrain_accelerations",
    "count_self_stresses",
    "doubt_selection",
    "evaluate_bias",
    "evaluate_drift",
    "evaluate_every_row",
    "evaluate_residuals",
    "evaluate_rows",
    "evaluate_without_redundant",
    "factorise_chart_matrix",
    "factorise_complex_saddle",
    "factorise_product",
    "factorise_rows",
    "factorise_saddle",
    "factorise_selected_rows",
    "find_correction",
    "has_redundant_rows",
    "inner",
    "is_axis",
    "is_near_singular",
    "is_next_to_singular",
    "is_singular_within_a_step",
    "keep_every_row",
    "list_redundant",
    "lu_factors",
    "mark_redundant",
    "more",
    "multiply_rates",
    "multiply_rows",
    "note_indicator",
    "note_loads",
    "note_selection",
    "pivot_loss",
    "project",
    "rates_hold",
    "redundancy",
    "redundant_of",
    "redundant_rows_hold",
    "refinements",
    "reset_selection",
    "restore_selection",
    "return_to_selection",
    "rotate_rate",
    "save_selection",
    "select_rows",
    "selection_parts",
    "selection_serves",
    "self_stress",
    "set_selection",
    "singularity_indicator",
    "solve_complex_saddle",
    "solve_friction_series",
    "solve_product",
    "solve_rows",
    "solve_saddle",
    "solve_series",
    "take_noted_selection",
    "take_reactions",
    "weigh",
    "weigh_bodies",
    "with_reselection",
    "write_saddle_rows",
]
