"""Multipliers of one order of a Taylor series, by the factors of S at order zero."""

from ..jit.kernels import kernel
from .axis_rows import add_axis_multipliers, gather_axes
from .chart_matrix import solve_product
from .evaluation import clear_welds
from .redundant_rows import clear_redundant
from .schur_complement import apply_columns, find_correction


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

    N~ lam = f.b,    f.Z = -X^T lam,    N~ = H X^T as of friction_solve.py
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
    # Welds: zero. Axis rows: (k + 1) c e . omega'_{k+1}, and lam_e of a first solution
    clear_welds(graph, f.b)
    gather_axes(graph, omega, at, stride, k + 1.0, f.b)
    if correction:
        add_axis_multipliers(graph, f.gamma, f.b)
    clear_redundant(f, f.b)
