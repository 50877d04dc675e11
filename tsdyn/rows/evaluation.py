"""Row evaluation at the current poses: Phi, H, gamma or Phi_t, zero at redundant rows."""

from ..elements.loops.constraint_rows import call_body_loop
from ..jit.kernels import kernel, long_kernel
from ..sparse.constraint_graph import BIAS, DRIFT, N_COUNT, N_FIRST_INT, N_FIRST_REAL, N_REALS, REDUCED, VALUES
from .axis_rows import clear_axes
from .redundant_rows import clear_redundant, keep_every_row, leave_redundant_rows, restore_selection


@kernel
def run_loops(network, reals, f, t, column, out, H):
    """Call one of the loops of constraint_rows.py for every kind that has it; H is written by REDUCED alone."""
    for i in range(network.kinds.shape[0]):
        kind = network.kinds[i]
        if kind[column] != 0:
            call_body_loop(
                kind[column], kind[N_COUNT], kind[N_REALS], network.table[kind[N_FIRST_INT] :],
                reals[kind[N_FIRST_REAL] :], f.poses, f.poses, t, out, H,
            )  # fmt: skip
    clear_welds(network, out)
    if network.axes.rows.shape[0] > 0:
        clear_axes(network, out)
    if f.dropped[0] > 0:
        if column == REDUCED:
            leave_redundant_rows(f, out, H)
        else:
            clear_redundant(f, out)


@kernel
def clear_welds(network, out):
    """out = 0 of the welds between the parts of a split body."""
    for i in range(network.welds.shape[0]):
        out[network.welds[i, 0]] = 0.0


@kernel
def evaluate_rows(network, system, f, rows, t):
    """f.b = Phi and H = [Phi_r, Phi_pi'], at the poses of f; zero at redundant rows."""
    run_loops(network, system.reals, f, t, REDUCED, f.b, rows.H)


@kernel
def evaluate_all(network, reals, f, rows, t):
    """As `evaluate_every_row`, reals being System.reals."""
    count = keep_every_row(f)
    run_loops(network, reals, f, t, REDUCED, f.b, rows.H)
    restore_selection(f, count)


@long_kernel
def evaluate_every_row(network, system, f, rows, t):
    """f.b = Phi and H at the poses of f, redundant rows included."""
    evaluate_all(network, system.reals, f, rows, t)


@kernel
def evaluate_residuals(network, system, f, t):
    """f.b = Phi, at the poses of f; zero at redundant rows."""
    run_loops(network, system.reals, f, t, VALUES, f.b, f.rows.H)


@kernel
def evaluate_bias(network, system, f, t):
    """f.gamma = gamma, with H (rdd, omega'd) + gamma = 0."""
    run_loops(network, system.reals, f, t, BIAS, f.gamma, f.rows.H)


@kernel
def evaluate_drift(network, system, f, t, out):
    """out = Phi_t, with H (rd, omega') + Phi_t = 0."""
    for e in range(out.size):
        out[e] = 0.0
    run_loops(network, system.reals, f, t, DRIFT, out, f.rows.H)
