"""Row evaluation: Phi, H, gamma or Phi_t, zero at redundant rows; multipliers of one order of a series."""

from ..elements.loops.constraint_rows import call_body_loop
from ..jit.kernels import kernel, long_kernel
from .redundant_rows import clear_redundant, keep_every_row, keep_redundant, leave_redundant_rows, restore_selection
from .schur_complement import (
    add_axis_multipliers,
    apply_columns,
    clear_axes,
    find_correction,
    gather_axes,
    solve_product,
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
    # Welds: zero. Axis rows: (k + 1) c e . omega'_{k+1}, and lam_e of a first solution
    clear_welds(graph, f.b)
    gather_axes(graph, omega, at, stride, k + 1.0, f.b)
    if correction:
        add_axis_multipliers(graph, f.gamma, f.b)
    clear_redundant(f, f.b)
