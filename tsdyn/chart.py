"""Charts of the constraint manifold: made at q0 (Eqs. 5-9, 27), used, and left when they are about to fail.

A chart is left at the end of a step, on signs that have no dimension. Lengths and Euler parameters are measured
together, as in the paper, so a scene is best described in a unit in which its levers are neither tiny nor thousands:

    contraction    |I - R^-T (Phi_q U) R^-1|,  U = Q R: how far the normal space has turned since q0; 0 at q0, and
                   the same however the constraints are scaled or combined
    condition      of D^T M D, divided by what it was after the chart's first step; that of B, as far as it has grown
                   since q0, is at most (1 + c) / (1 - c) for a contraction c, and needs no sign of its own
    offset         |U u| / |V v|        how steeply the manifold leaves the tangent plane; not where constraints move
                                        with time, which carries q along U without turning anything
"""

import math

from ._kernel import kernel
from .assembly import constraint_jacobian
from .linalg import null_space
from .newton import OK, SINGULAR, invert_normal_matrix, normal_matrix, update_b
from .workspace import CHARTS, CONDITION, CONDITION_M0, CONTRACTION, FLOOR, RATE, SIZE

# reasons to leave a chart, as stored; REASONS names them
STAY, BY_CONTRACTION, BY_CONDITION, BY_OFFSET, BY_INTERVAL, BY_FAILURE, AT_START, BY_SERIES = range(8)
REASONS = (
    "",
    "contraction",
    "condition of D^T M D",
    "size of u",
    "chart_interval",
    "failed step",
    "start",
    "step of a series",
)

CONTRACTION_LIMIT = 0.15
CONTRACTION_LOST = 0.9  # nearer to one B need not exist on the way, and another branch may have been found
CONDITION_LIMIT = 10.0
OFFSET_LIMIT = 0.5
ROUNDING = 1e-15  # relative to the numbers that enter Phi: below this a residual says nothing
RANK_LIMIT = 1e-8  # smallest singular value of Phi_q, rows scaled to length one, below which it has lost rank


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
        w.scale[i] = 1.0 / math.sqrt(x)
        for c in range(n):
            w.U[c, i] = w.Phi_q[i, c]
            w.householder[c, i] = w.Phi_q[i, c] * w.scale[i]
        w.u[i] = 0.0
        for j in range(k):
            w.T[i, j] = 0.0
    for j in range(k):
        w.v[j] = 0.0
    low, high = null_space(w.householder, n, m, w.V, w.R, w.z)  # leaves R over the reflectors
    if m > 0 and not low > RANK_LIMIT * high:
        return SINGULAR
    normal_matrix(s, w)
    if not invert_normal_matrix(w) or update_b(w) != OK:
        return SINGULAR
    w.counters[CHARTS] += 1
    w.control[CONDITION_M0] = 0.0  # measured at the next placement
    w.control[FLOOR] = ROUNDING * (w.control[SIZE] + largest)
    w.control[CONTRACTION] = 0.0
    w.control[RATE] = 0.1
    w.control[CONDITION] = 1.0
    return OK


@kernel
def tangent_map(s, w, t):
    """Phi_q, N, B, T = B Phi_q V and D = V - U T at the present q, Eqs. 7, 9, 28. Status."""
    n, m, k = w.q.size, w.u.size, w.v.size
    constraint_jacobian(s, w.q, t, w.Phi_q)
    normal_matrix(s, w)
    status = update_b(w)
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
def _turn(w, m):
    """|I - R^-T N R^-1|, the maximum row sum; N = Phi_q U, and U = Q R."""
    X = w.R
    for i in range(m):
        for j in range(m):
            X[i, j] = w.N[i, j] * (w.scale[i] * w.scale[j])
    for i in range(m):  # R^-T from the left, row by row
        for c in range(i):
            f = w.householder[c, i]
            for j in range(m):
                X[i, j] -= f * X[c, j]
        f = 1.0 / w.householder[i, i]
        for j in range(m):
            X[i, j] *= f
    off = 0.0
    for i in range(m):  # R^-1 from the right
        total = 0.0
        for j in range(m):
            x = X[i, j]
            for c in range(j):
                x -= X[i, c] * w.householder[c, j]
            X[i, j] = x / w.householder[j, j]
        for j in range(m):
            total += abs(X[i, j] - 1.0 if i == j else X[i, j])
        off = max(off, total)
    return off


@kernel
def inspect(w, by_offset):
    """Reason to leave the chart at the present placement, or STAY; records contraction and condition."""
    n, m, k = w.q.size, w.u.size, w.v.size
    contraction = _turn(w, m)
    low, high = math.inf, 0.0
    for j in range(k):  # the diagonal of the Cholesky factor of D^T M D
        low, high = min(low, w.A[j, j]), max(high, w.A[j, j])
    condition = (high / low) ** 2 if k > 0 else 1.0
    if w.control[CONDITION_M0] == 0.0:
        w.control[CONDITION_M0] = condition
    condition /= w.control[CONDITION_M0]
    w.control[CONTRACTION] = contraction
    w.control[CONDITION] = max((1.0 + contraction) / max(1.0 - contraction, 1e-300), condition)
    if not contraction < CONTRACTION_LIMIT:
        return BY_CONTRACTION
    if not condition < CONDITION_LIMIT:
        return BY_CONDITION
    if by_offset:
        across, along = 0.0, 0.0
        for i in range(n):
            d = w.base[i] - w.q0[i]
            along += d * d
            d = w.base[i] - w.q[i]
            across += d * d
        if across > OFFSET_LIMIT * OFFSET_LIMIT * along + 1e-20:
            return BY_OFFSET
    return STAY
