"""Charts with bases U and V (Eqs. 5-9, 27), their dense rows, and the Newton iterations for u and B (Eqs. 28, 29)."""

import math

from ..errors import Status
from ..jit.kernels import kernel
from ..maths.dense_linalg import (
    add_product,
    add_transposed_product,
    clear_matrix,
    invert,
    largest,
    multiply,
    null_space,
)
from ..maths.tolerances import LAST_PLACE, ROUNDING_AT_MOST, SUM_ROUNDING, TINY
from ..model.equations import acceleration_bias, constraint_jacobian, constraints, time_derivative
from ..rows.interface import list_redundant
from .charts import set_base_point
from .tolerances import B_OUTDATED, B_SWEEPS, LAG, SLOW, STALLED, USUAL

# Dense constraint rows of the forms with a basis: evaluate, factorise, solve. Redundant rows are dropped here.
#
#     N = Phi_q U,    B = N^-1
#
# A redundant row of Phi is zero in Phi, Phi_q, Phi_t and gamma, and has a one on the diagonal of N and B, so that its
# u, ud and multiplier are zero. The selection is that of the sparse rows, made with the chart.


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


# The two Newton iterations of Haug (2018), section 5: Eq. 29 for u and Eq. 28 for B, both warm-started.

OK = int(Status.SUCCESS)
NEWTON_FAILED = int(Status.NEWTON_FAILED)
NOT_FINITE = int(Status.NOT_FINITE)
SINGULAR = int(Status.SINGULAR)


@kernel
def solve_positions(system, w, t, v):
    """Find u and q = q0 + V v - U u with Phi(q, t) = 0, Eqs. 19, 20 and 29. Status.

    The start is u + T dv, with T = du/dv of the previous configuration. Stops when |Phi| <= u_tol and the residual
    expected after the last correction is below u_tol^(3/2) or rounding, or when |Phi| has stopped falling at rounding.
    """
    n, m, k = w.q.size, w.u.size, v.size
    # u + T dv: first order in the change of v
    for i in range(m):
        d = 0.0
        for j in range(k):
            d += w.T[i, j] * (v[j] - w.v[j])
        w.u[i] += d
    # base = q0 + V v
    for i in range(n):
        x = 0.0
        for j in range(k):
            x += w.V[i, j] * v[j]
        w.base[i] = w.q0[i] + x
    for j in range(k):
        w.v[j] = v[j]
    # Tolerance of |Phi|, and what may be left after the last correction: u_tol^(3/2), half as many digits again
    floor = w.control.floor
    tol = max(w.control.u_tol, floor)
    left = max(tol * math.sqrt(tol), floor)
    before, stuck = math.inf, False
    for _ in range(B_SWEEPS):
        # Phi at q = base - U u
        _step_off(w, n, m)
        evaluate_dense_residuals(system, w, t)
        w.counters.newton += 1
        worst = 0.0
        for i in range(m):
            size = abs(w.Phi[i])
            if not size < math.inf:
                return NOT_FINITE
            worst = max(worst, size)
        # Slow contraction: B is of a configuration too far away. If a new B did not help, the residual is rounding
        rounding = STALLED * before < worst <= ROUNDING_AT_MOST * floor
        if (worst > tol and worst > SLOW * before) or (worst > STALLED * before and not rounding):
            if stuck and worst <= max(ROUNDING_AT_MOST * floor, LAST_PLACE * _cancelled(w)):
                tol, floor = worst, worst  # a fresh B did not help: this is rounding
            elif not factorise_dense_rows(system, w, t):  # B was out of date
                return SINGULAR
            stuck = True
        # Eq. 29: u <- u + B Phi
        for i in range(m):
            d = 0.0
            for j in range(m):
                d += w.B[i, j] * w.Phi[j]
            w.u[i] += d
            w.z[i] = d
        # The last correction leaves worst * rate
        if before < math.inf:
            w.control.rate = worst / before
        if worst <= floor or (worst <= tol and (rounding or worst * w.control.rate <= left)):
            subtract_normal(w, w.z, w.q)  # q itself, not all of the sum again: a digit less is lost
            return OK
        before = worst
    return NEWTON_FAILED


@kernel
def _cancelled(w):
    """The largest |U| |u|, m: terms that cancel, and whose rounding Phi has; 1e4 m where masses are unequal by 1e6."""
    largest = 0.0
    for i in range(w.q.size):
        x = 0.0
        for j in range(w.u.size):
            x += abs(w.U[i, j] * w.u[j])
        largest = max(largest, x)
    return largest


@kernel
def _step_off(w, n, m):
    """q = base - U u."""
    for i in range(n):
        x = w.base[i]
        for j in range(m):
            x -= w.U[i, j] * w.u[j]
        w.q[i] = x


@kernel
def update_b(w):
    """Bring B to (Phi_q U)^-1 by Eq. 28, B <- 2 B - B (Phi_q U) B, N = Phi_q U being known. Status.

    With R = N B - I the iteration is B <- B - B R, which squares R. It stops when the next R is below B_tol^(3/2), half
    as many digits again as requested, so that the velocities don't depend on the size of the last square. If |R| is
    near one or above at the start, B is factorised instead.
    """
    m = w.u.size
    tol = w.control.b_tol * math.sqrt(w.control.b_tol)
    before = math.inf
    for _ in range(B_SWEEPS):
        # R = N B - I, and its largest row sum
        worst = 0.0
        for i in range(m):
            total = 0.0
            for j in range(m):
                x = 0.0
                for c in range(m):
                    x += w.N[i, c] * w.B[c, j]
                w.R[i, j] = x
            w.R[i, i] -= 1.0
            for j in range(m):
                total += abs(w.R[i, j])
            if not total < math.inf:
                return NOT_FINITE
            worst = max(worst, total)
        # Eq. 28 converges from |R| < 1 only
        if worst > B_OUTDATED and before == math.inf:
            before = 1.0 / TINY  # a factorisation is tried once
            if not invert_normal_matrix(w):
                return SINGULAR
            continue
        w.counters.b_iterations += 1
        for i in range(m):  # row i of B R; R is needed whole, B only row by row
            for j in range(m):
                x = 0.0
                for c in range(m):
                    x += w.B[i, c] * w.R[c, j]
                w.z[j] = x
            for j in range(m):
                w.B[i, j] -= w.z[j]
        if worst * worst <= tol or worst > STALLED * before:  # squared next time; or rounding is all that is left
            return OK if worst < B_OUTDATED else SINGULAR
        before = worst
    return SINGULAR


# Charts with bases U and V (Eqs. 5-9, 27), made at q0; charts.py decides when a chart is abandoned.
#
# U spans W0 Phi_q0^T, W0 being the inverse of the mass matrix with p p^T added: the normal space in the metric of
# kinetic energy, which weights lengths and angles by inertia. (The paper takes U = Phi_q0^T.) Columns are scaled so
# that Phi_q0 U has a unit diagonal; the columns of normalisation rows are p0. V is orthonormal, with positions over the
# `unit` of a scene whose numbers are large or small. With the projection along U, P0 = I - U (Phi_q0 U)^-1 Phi_q0, and
# the pseudoinverse V^+, V^T where the unit is one, L^T is V^+ P0: L^T V = I, L^T U = 0.


@kernel
def new_chart(graph, system, w, f, l, t):
    """Make a chart at the present q: q0, U, V by SVD, B, L; u = 0, v = 0. Status."""
    regular = set_base_point(graph, system, w, f, l, t, largest(w.q))  # of p, too: Phi has the normalisations
    take_selection(graph, w, f)
    return set_bases(graph, system, w, l, t, regular)


@kernel
def set_bases(graph, system, w, l, t, regular):
    """The same at the base point, for the rows of w; regular: whether all rows are independent there. Status."""
    n, m, k = w.q.size, w.u.size, w.v.size
    evaluate_dense_rows(system, w, t)
    kept, metres = 0, unit(w.control.size)
    # Columns Phi_q0^T, positions in the unit of the scene
    for i in range(n):
        w.q0[i] = w.q[i]
        for j in range(m):
            w.householder[i, j] = w.Phi_q[j, i]
    _scale_positions(graph, metres, w.householder)
    for i in range(m):
        # Columns of unit length; those of redundant rows are zero and left out
        x = 0.0
        for c in range(n):
            x += w.householder[c, i] * w.householder[c, i]
        w.u[i] = 0.0
        if x > 0.0:
            x = 1.0 / math.sqrt(x)
            for c in range(n):
                w.householder[c, kept] = w.householder[c, i] * x
            kept += 1
    # The number of redundant rows is that of the scene
    if kept != n - k:
        return SINGULAR
    for j in range(k):
        w.v[j] = 0.0
    # V: the columns of Q that Householder QR of U adds; low and high are the extreme singular values
    low, high = null_space(w.householder, n, kept, w.V, w.R, w.z)
    if m > 0 and not (regular and low > SUM_ROUNDING * high):
        return SINGULAR
    _scale_positions(graph, metres, w.V)
    # U, B = (Phi_q0 U)^-1 with a step of Eq. 28, L
    _normal_space(graph, w, l)
    form_normal_matrix(system, w)
    if not invert_normal_matrix(w) or update_b(w) != OK:
        return SINGULAR
    _left_inverse(graph, w, metres)
    w.control.rate = LAG
    return OK


@kernel
def unit(size):
    """The unit of positions, m: one for numbers of usual size, else the power of two below."""
    if not 0.0 < size < math.inf or 1.0 / USUAL <= size <= USUAL:
        return 1.0
    return 2.0 ** math.floor(math.log2(size))


@kernel
def _scale_positions(graph, factor, A):
    """Multiply the rows of A that are positions of bodies."""
    if factor == 1.0:
        return
    for b in range(graph.bodies.shape[0]):
        for c in range(graph.bodies[b, 0], graph.bodies[b, 0] + 3):
            for j in range(A.shape[1]):
                A[c, j] *= factor


@kernel
def _normal_space(graph, w, l):
    """U from Y0 and p0."""
    clear_matrix(w.U)
    diagonal = l.rows0.S[graph.pattern.shape[1] :]
    # Normalisation rows: p0
    for b in range(graph.bodies.shape[0]):
        if graph.normals[b] >= 0:
            for c in range(4):
                w.U[graph.bodies[b, 0] + 3 + c, graph.normals[b]] = l.base[8 * b + 4 + c]
    for e in range(graph.row.size):
        if graph.row[e] < 0:
            continue
        # Other rows: (r, G^T pi' / 2) of Y0 = W0 H0^T, columns scaled to Phi_q0 U with a unit diagonal
        _add_normal(graph, w, l, e, graph.row[e], 1.0 / diagonal[e])
    for i in range(graph.tails.size):
        head = graph.tails[i]
        _add_normal(graph, w, l, graph.row.size + i, graph.row[head], 1.0 / diagonal[head])


@kernel
def _add_normal(graph, w, l, e, j, scale):
    """Column j of U += scale (r, G^T pi' / 2) of a pair of sides."""
    for side in range(2):
        body, y = graph.sides[e, side], 16 * e + 8 * side
        if body == graph.bodies.shape[0]:
            continue
        i, o = graph.bodies[body, 0], 8 * body + 4
        for c in range(3):
            w.U[i + c, j] += scale * l.rows0.Y[y + c]
        if graph.bodies[body, 1] == 7:
            e0, e1, e2, e3 = l.base[o], l.base[o + 1], l.base[o + 2], l.base[o + 3]
            f = 0.5 * scale
            a0, a1, a2 = f * l.rows0.Y[y + 4], f * l.rows0.Y[y + 5], f * l.rows0.Y[y + 6]
            w.U[i + 3, j] += -e1 * a0 - e2 * a1 - e3 * a2
            w.U[i + 4, j] += e0 * a0 - e3 * a1 + e2 * a2
            w.U[i + 5, j] += e3 * a0 + e0 * a1 - e1 * a2
            w.U[i + 6, j] += -e2 * a0 + e1 * a1 + e0 * a2


@kernel
def _left_inverse(graph, w, metres):
    """L = V^+ - Phi_q^T B^T U^T V^+ at q0; T and X are scratch, T zero at the end, as it is at q0."""
    _copy_matrix(w.V, w.L)
    _scale_positions(graph, 1.0 / (metres * metres), w.L)
    clear_matrix(w.T)
    # T = U^T V^+,  X = B^T T,  L = V^+ - Phi_q^T X
    add_transposed_product(1.0, w.U, w.L, w.T)
    clear_matrix(w.X)
    add_transposed_product(1.0, w.B, w.T, w.X)
    add_transposed_product(-1.0, w.Phi_q, w.X, w.L)
    clear_matrix(w.T)


@kernel
def _copy_matrix(A, out):
    """out = A."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[i, j] = A[i, j]


@kernel
def tangent_map(system, w, t):
    """Phi_q, N, B, T = B Phi_q V and D = V - U T at the present q, Eqs. 7, 9, 28. Status."""
    evaluate_dense_rows(system, w, t)
    form_normal_matrix(system, w)
    return map_tangent(system, w)


@kernel
def map_tangent(system, w):
    """The same, N = Phi_q U being known. Status."""
    m, k = w.u.size, w.v.size
    # B by Eq. 28 from the B of the configuration before
    made = w.counters.factorizations
    status = update_b(w)
    if status != OK:
        return status
    w.counters.kept += 1 if w.counters.factorizations == made and m > 0 else 0
    clear_matrix(w.X)
    for i in range(m):  # X = Phi_q V, over the nonzero columns of Phi_q
        for part in range(0, 4, 2):
            begin = system.segments[i, part]
            for c in range(begin, begin + system.segments[i, part + 1]):
                f = w.Phi_q[i, c]
                for j in range(k):
                    w.X[i, j] += f * w.V[c, j]
    # T = B Phi_q V,    D = V - U T
    multiply(w.B, w.X, w.T)
    _copy_matrix(w.V, w.D)
    add_product(-1.0, w.U, w.T, w.D)
    return OK
