"""Charts of the constraint manifold: made at q0 (Eqs. 5-9, 27), used, and left when they are about to fail.

A chart is left at the end of a step, on signs that have no dimension and that no scene's scale enters:

    contraction    |I - B0 Phi_q U|     how far the normal space has turned since q0; 0 at q0; rows and columns are
                                        weighted so that scaling a constraint changes nothing
    condition      of B and of D^T M D, each divided by what it was at q0
    offset         |U u| / |V v|        how steeply the manifold leaves the tangent plane
"""

import math

from ._kernel import kernel
from .assembly import constraint_jacobian
from .linalg import invert, null_space
from .newton import OK, SINGULAR, normal_matrix, update_b
from .workspace import CHARTS, CONDITION, CONDITION_A0, CONDITION_B0, CONTRACTION, FACTORIZATIONS, FLOOR

# reasons to leave a chart, as stored; REASONS names them
STAY, BY_CONTRACTION, BY_CONDITION_B, BY_CONDITION_M, BY_OFFSET, BY_INTERVAL, BY_FAILURE, AT_START = range(8)
REASONS = (
    "",
    "contraction",
    "condition of B",
    "condition of D^T M D",
    "size of u",
    "chart_interval",
    "failed step",
    "start",
)

CONTRACTION_LIMIT = 0.25
CONTRACTION_LOST = 0.9  # nearer to one B need not exist on the way, and another branch may have been found
CONDITION_LIMIT = 10.0
OFFSET_LIMIT = 0.5
RANK_LIMIT = 1e-11  # smallest singular value of Phi_q, rows scaled to length one, below which it has lost rank


@kernel
def new_chart(s, w, t):
    """Make a chart at the present q: q0, U, V by SVD, B; u = 0, v = 0. Status."""
    n, m, k = w.q.size, w.u.size, w.v.size
    constraint_jacobian(s, w.q, t, w.Phi_q)
    largest = 0.0
    for i in range(n):
        w.q0[i] = w.q[i]
        largest = max(largest, abs(w.q[i]))
    for i in range(m):
        x = 0.0
        for c in range(n):
            x += w.Phi_q[i, c] * w.Phi_q[i, c]
        if not x > 0.0:
            return SINGULAR
        w.scale[i] = math.sqrt(x)
        for c in range(n):
            w.U[c, i] = w.Phi_q[i, c]
            w.householder[c, i] = w.Phi_q[i, c] / w.scale[i]
        w.u[i] = 0.0
        for j in range(k):
            w.T[i, j] = 0.0
    for j in range(k):
        w.v[j] = 0.0
    low, high = null_space(w.householder, n, m, w.V, w.R, w.z)
    if m > 0 and not low > RANK_LIMIT * high:
        return SINGULAR
    normal_matrix(s, w)
    for i in range(m):
        for j in range(m):
            w.R[i, j] = w.N[i, j]
    w.counters[FACTORIZATIONS] += 1
    if not invert(w.R, w.B, m) or update_b(s, w, t) != OK:
        return SINGULAR
    for i in range(m):
        for j in range(m):
            w.B0[i, j] = w.B[i, j]
    w.counters[CHARTS] += 1
    w.control[CONDITION_B0] = 0.0  # measured at the next placement
    w.control[FLOOR] = 4e-16 * (1.0 + largest)
    w.control[CONTRACTION] = 0.0
    w.control[CONDITION] = 1.0
    return OK


@kernel
def tangent_map(s, w, t):
    """Phi_q, N, B, T = B Phi_q V and D = V - U T at the present q, Eqs. 7, 9, 28. Status."""
    n, m, k = w.q.size, w.u.size, w.v.size
    constraint_jacobian(s, w.q, t, w.Phi_q)
    normal_matrix(s, w)
    status = update_b(s, w, t)
    if status != OK:
        return status
    for i in range(m):  # D is scratch for Phi_q V
        for j in range(k):
            w.D[i, j] = 0.0
        for part in range(0, 4, 2):
            begin = s.segments[i, part]
            for c in range(begin, begin + s.segments[i, part + 1]):
                f = w.Phi_q[i, c]
                for j in range(k):
                    w.D[i, j] += f * w.V[c, j]
    for i in range(m):
        for j in range(k):
            w.T[i, j] = 0.0
        for c in range(m):
            f = w.B[i, c]
            for j in range(k):
                w.T[i, j] += f * w.D[c, j]
    for i in range(n):
        for j in range(k):
            w.D[i, j] = w.V[i, j]
        for c in range(m):
            f = w.U[i, c]
            if f != 0.0:
                for j in range(k):
                    w.D[i, j] -= f * w.T[c, j]
    return OK


@kernel
def inspect(w, has_u):
    """Reason to leave the chart at the present placement, or STAY; records contraction and condition."""
    n, m, k = w.q.size, w.u.size, w.v.size
    contraction, size_b, size_n = 0.0, 0.0, 0.0
    for i in range(m):
        row_c, row_b, row_n = 0.0, 0.0, 0.0
        for j in range(m):
            x = 0.0
            for c in range(m):
                x += w.B0[i, c] * w.N[c, j]
            if i == j:
                x -= 1.0
            ratio = w.scale[i] / w.scale[j]
            row_c += abs(x) * ratio
            row_b += abs(w.B[i, j]) * w.scale[i] * w.scale[j]
            row_n += abs(w.N[i, j]) / (w.scale[i] * w.scale[j])
        contraction, size_b, size_n = max(contraction, row_c), max(size_b, row_b), max(size_n, row_n)
    low, high = math.inf, 0.0
    for j in range(k):  # A holds the Cholesky factor of D^T M D
        low, high = min(low, w.A[j, j]), max(high, w.A[j, j])
    condition_b = size_b * size_n
    condition_a = (high / low) ** 2 if k > 0 else 1.0
    if w.control[CONDITION_B0] == 0.0:
        w.control[CONDITION_B0], w.control[CONDITION_A0] = condition_b, condition_a
    growth_b, growth_a = condition_b / w.control[CONDITION_B0], condition_a / w.control[CONDITION_A0]
    w.control[CONTRACTION] = contraction
    w.control[CONDITION] = max(growth_b, growth_a)
    if not contraction < CONTRACTION_LIMIT:
        return BY_CONTRACTION
    if not growth_b < CONDITION_LIMIT and m > 0:
        return BY_CONDITION_B
    if not growth_a < CONDITION_LIMIT:
        return BY_CONDITION_M
    if has_u:
        across, along = 0.0, 0.0
        for i in range(n):
            d = w.base[i] - w.q0[i]
            along += d * d
            d = w.base[i] - w.q[i]
            across += d * d
        if across > OFFSET_LIMIT * OFFSET_LIMIT * along + 1e-20:
            return BY_OFFSET
    return STAY
