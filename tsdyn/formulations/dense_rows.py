"""Dense constraint rows of the forms with a basis: evaluate, factorise, solve. Redundant rows are dropped here.

    N = Phi_q U,    B = N^-1

A redundant row of Phi is zero in Phi, Phi_q, Phi_t and gamma, and has a one on the diagonal of N and B, so that its
u, ud and multiplier are zero. The selection is that of the sparse rows, made with the chart.
"""

from ..jit.kernels import kernel
from ..maths.dense_linalg import invert
from ..model.equations import acceleration_bias, constraint_jacobian, constraints, time_derivative
from ..rows.interface import list_redundant


@kernel
def take_selection(graph, w, f):
    """Drop the rows of Phi that are redundant in the sparse rows."""
    list_redundant(graph, f, w.redundant)


@kernel
def _zero_redundant(w, out):
    """out = 0 of the redundant rows."""
    for i in range(w.redundant[0]):
        out[w.redundant[1 + i]] = 0.0


@kernel
def evaluate_dense_residuals(system, w, t):
    """Phi at q."""
    constraints(system, w.q, t, w.Phi)
    _zero_redundant(w, w.Phi)


@kernel
def evaluate_dense_rows(system, w, t):
    """Phi_q at q."""
    constraint_jacobian(system, w.q, t, w.Phi_q)
    for i in range(w.redundant[0]):
        for j in range(w.q.size):
            w.Phi_q[w.redundant[1 + i], j] = 0.0


@kernel
def evaluate_dense_drift(system, w, t):
    """Phi_t at q."""
    time_derivative(system, w.q, t, w.Phi_t)
    _zero_redundant(w, w.Phi_t)


@kernel
def evaluate_dense_bias(system, w, t):
    """Acceleration bias gamma at q and qd."""
    acceleration_bias(system, w.q, w.qd, t, w.gamma)
    _zero_redundant(w, w.gamma)


@kernel
def multiply_dense_row(system, w, i, x):
    """Return row i of Phi_q x, over its nonzero columns."""
    total = 0.0
    for part in range(0, 4, 2):
        begin = system.segments[i, part]
        for j in range(begin, begin + system.segments[i, part + 1]):
            total += w.Phi_q[i, j] * x[j]
    return total


@kernel
def form_normal_matrix(system, w):
    """N = Phi_q U, over the nonzero columns of Phi_q."""
    m = w.u.size
    for i in range(m):
        # Row i of Phi_q is zero but for the columns of its two bodies
        begin, middle = system.segments[i, 0], system.segments[i, 2]
        end, last = begin + system.segments[i, 1], middle + system.segments[i, 3]
        for j in range(m):
            x = 0.0
            for c in range(begin, end):
                x += w.Phi_q[i, c] * w.U[c, j]
            for c in range(middle, last):
                x += w.Phi_q[i, c] * w.U[c, j]
            w.N[i, j] = x
    # A redundant row has u = 0
    for i in range(w.redundant[0]):
        row = w.redundant[1 + i]
        w.N[row, row] = 1.0


@kernel
def invert_normal_matrix(w):
    """B = N^-1, N being known; return True if N is nonsingular."""
    m = w.u.size
    for i in range(m):
        for j in range(m):
            w.R[i, j] = w.N[i, j]
    w.counters.factorizations += 1
    return invert(w.R, w.B, m)


@kernel
def factorise_dense_rows(system, w, t):
    """Phi_q, N and B at the present q; return True if N is nonsingular."""
    evaluate_dense_rows(system, w, t)
    form_normal_matrix(system, w)
    return invert_normal_matrix(w)


@kernel
def subtract_normal(w, z, out):
    """out <- out - U z."""
    for i in range(out.size):
        x = 0.0
        for j in range(z.size):
            x += w.U[i, j] * z[j]
        out[i] -= x


@kernel
def correct(w, residuals, out):
    """Correct out along the normal basis.

    z = B residuals,    out <- out - U z
    """
    m = residuals.size
    for i in range(m):
        x = 0.0
        for j in range(m):
            x += w.B[i, j] * residuals[j]
        w.z[i] = x
    subtract_normal(w, w.z, out)
