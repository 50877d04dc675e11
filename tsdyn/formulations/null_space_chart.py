"""Charts with bases U and V (Eqs. 5-9, 27), made at q0; chart_validity.py decides when a chart is abandoned.

U spans W0 Phi_q0^T, W0 being the inverse of the mass matrix with p p^T added: the normal space in the metric of kinetic
energy, which weights lengths and angles by inertia. (The paper takes U = Phi_q0^T.) Columns are scaled so that Phi_q0 U
has a unit diagonal; the columns of normalisation rows are p0. V is orthonormal, with positions over the `unit` of a
scene whose numbers are large or small. With the projection along U, P0 = I - U (Phi_q0 U)^-1 Phi_q0, and the
pseudoinverse V^+, V^T where the unit is one, L^T is V^+ P0: L^T V = I, L^T U = 0.
"""

import math

from ..jit.kernels import kernel
from ..maths.dense_linalg import largest, null_space
from .chart_validity import set_base_point
from .dense_products import add_product, add_transposed_product, clear_matrix, multiply
from .dense_rows import evaluate_dense_rows, form_normal_matrix, invert_normal_matrix, take_selection
from .newton_iterations import OK, SINGULAR, update_b
from .tolerances import FIRST_RATE, RANK_LIMIT, USUAL


@kernel
def new_chart(graph, system, w, f, l, t):
    """Make a chart at the present q: q0, U, V by SVD, B, L; u = 0, v = 0. Status."""
    n, m, k = w.q.size, w.u.size, w.v.size
    regular = set_base_point(graph, system, w, f, l, t, largest(w.q))  # of p, too: Phi has the normalisations
    take_selection(graph, w, f)
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
    if m > 0 and not (regular and low > RANK_LIMIT * high):
        return SINGULAR
    _scale_positions(graph, metres, w.V)
    # U, B = (Phi_q0 U)^-1 with a step of Eq. 28, L
    _normal_space(graph, w, l)
    form_normal_matrix(system, w)
    if not invert_normal_matrix(w) or update_b(w) != OK:
        return SINGULAR
    _left_inverse(graph, w, metres)
    w.control.rate = FIRST_RATE
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
        j, scale = graph.row[e], 1.0 / diagonal[e]
        for side in range(2):
            body, y = graph.sides[e, side], 16 * e + 8 * side
            if body == graph.bodies.shape[0]:
                continue
            i, o = graph.bodies[body, 0], 8 * body + 4
            for c in range(3):
                w.U[i + c, j] = scale * l.rows0.Y[y + c]
            if graph.bodies[body, 1] == 7:
                e0, e1, e2, e3 = l.base[o], l.base[o + 1], l.base[o + 2], l.base[o + 3]
                f = 0.5 * scale
                a0, a1, a2 = f * l.rows0.Y[y + 4], f * l.rows0.Y[y + 5], f * l.rows0.Y[y + 6]
                w.U[i + 3, j] = -e1 * a0 - e2 * a1 - e3 * a2
                w.U[i + 4, j] = e0 * a0 - e3 * a1 + e2 * a2
                w.U[i + 5, j] = e3 * a0 + e0 * a1 - e1 * a2
                w.U[i + 6, j] = -e2 * a0 + e1 * a1 + e0 * a2


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
    m, k = w.u.size, w.v.size
    evaluate_dense_rows(system, w, t)
    form_normal_matrix(system, w)
    # N = Phi_q U, B by Eq. 28 from the B of the configuration before
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
