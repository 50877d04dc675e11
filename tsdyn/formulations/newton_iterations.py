"""The two Newton iterations of Haug (2018), section 5: Eq. 29 for u and Eq. 28 for B, both warm-started."""

import math

from ..errors import Status
from ..jit.kernels import kernel
from ..maths.dense_linalg import invert
from ..model.equations import constraint_jacobian, constraints
from ..workspaces.workspace import B_ITERATIONS, B_TOL, FACTORIZATIONS, FLOOR, NEWTON, RATE, U_TOL

OK = int(Status.SUCCESS)
NEWTON_FAILED = int(Status.NEWTON_FAILED)
NOT_FINITE = int(Status.NOT_FINITE)
SINGULAR = int(Status.SINGULAR)
SWEEPS = 30


@kernel
def solve_positions(s, w, t, v):
    """Find u and q = q0 + V v - U u with Phi(q, t) = 0, Eqs. 19, 20 and 29. Status.

    The start is u + T dv, T = du/dv being left over from the place before. Sweeps go on until |Phi| <= u_tol and what
    the last correction, which costs no further evaluation, is expected to leave is below u_tol^(3/2) or rounding.
    """
    n, m, k = w.q.size, w.u.size, v.size
    for i in range(m):
        d = 0.0
        for j in range(k):
            d += w.T[i, j] * (v[j] - w.v[j])
        w.u[i] += d
    for i in range(n):
        x = 0.0
        for j in range(k):
            x += w.V[i, j] * v[j]
        w.base[i] = w.q0[i] + x
    for j in range(k):
        w.v[j] = v[j]
    floor = w.control[FLOOR]
    tol = max(w.control[U_TOL], floor)
    left = max(tol * math.sqrt(tol), floor)
    before, stuck = math.inf, False
    for _ in range(SWEEPS):
        _step_off(w, n, m)
        constraints(s, w.q, t, w.Phi)
        leave_out(w, w.Phi)
        w.counters[NEWTON] += 1
        worst = 0.0
        for i in range(m):
            size = abs(w.Phi[i])
            if not size < math.inf:
                return NOT_FINITE
            worst = max(worst, size)
        if worst > tol and worst > 0.25 * before:
            if stuck and worst <= 100.0 * floor:
                tol, floor = worst, worst  # a fresh B did not help: this is rounding
            elif not factorise_b(s, w, t):  # B was out of date
                return SINGULAR
            stuck = True
        for i in range(m):
            d = 0.0
            for j in range(m):
                d += w.B[i, j] * w.Phi[j]
            w.u[i] += d
            w.z[i] = d
        if before < math.inf:
            w.control[RATE] = worst / before
        if worst <= floor or (worst <= tol and worst * w.control[RATE] <= left):
            subtract_normal(w, w.q)  # q itself, not all of the sum again: a digit less is lost
            return OK
        before = worst
    return NEWTON_FAILED


@kernel
def leave_out(w, f):
    """Zero what belongs to redundant rows of Phi."""
    for i in range(w.left_out[0]):
        f[w.left_out[1 + i]] = 0.0


@kernel
def leave_rows_out(w):
    """Zero the redundant rows of Phi_q."""
    for i in range(w.left_out[0]):
        for j in range(w.q.size):
            w.Phi_q[w.left_out[1 + i], j] = 0.0


@kernel
def _step_off(w, n, m):
    """q = base - U u."""
    for i in range(n):
        x = w.base[i]
        for j in range(m):
            x -= w.U[i, j] * w.u[j]
        w.q[i] = x


@kernel
def subtract_normal(w, out):
    """out -= U z."""
    for i in range(out.size):
        x = 0.0
        for j in range(w.z.size):
            x += w.U[i, j] * w.z[j]
        out[i] -= x


@kernel
def factorise_b(s, w, t):
    """B = (Phi_q U)^-1 at the present q, from nothing; False where it is singular."""
    constraint_jacobian(s, w.q, t, w.Phi_q)
    leave_rows_out(w)
    normal_matrix(s, w)
    return invert_normal_matrix(w)


@kernel
def invert_normal_matrix(w):
    """B = N^-1, N = Phi_q U being known; False where it is singular."""
    m = w.u.size
    for i in range(m):
        for j in range(m):
            w.R[i, j] = w.N[i, j]
    w.counters[FACTORIZATIONS] += 1
    return invert(w.R, w.B, m)


@kernel
def normal_matrix(s, w):
    """N = Phi_q U, over the nonzero columns of Phi_q."""
    m = w.u.size
    for i in range(m):
        begin, middle = s.segments[i, 0], s.segments[i, 2]
        end, last = begin + s.segments[i, 1], middle + s.segments[i, 3]
        for j in range(m):
            x = 0.0
            for c in range(begin, end):
                x += w.Phi_q[i, c] * w.U[c, j]
            for c in range(middle, last):
                x += w.Phi_q[i, c] * w.U[c, j]
            w.N[i, j] = x
    for i in range(w.left_out[0]):
        row = w.left_out[1 + i]
        w.N[row, row] = 1.0


@kernel
def update_b(w):
    """Bring B to (Phi_q U)^-1 by Eq. 28, B <- 2 B - B (Phi_q U) B, N = Phi_q U being known. Status.

    With R = N B - I the iteration is B <- B - B R and squares R: it ends when the R to come is below B_tol^(3/2), half
    as many digits again as asked for, so that what the last square happens to be does not show in the velocities.
    A start with |R| near one or above is replaced by a factorisation.
    """
    m = w.u.size
    tol = w.control[B_TOL] * math.sqrt(w.control[B_TOL])
    before = math.inf
    for _ in range(SWEEPS):
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
        if worst > 0.5 and before == math.inf:
            before = 1e300  # a factorisation is tried once
            if not invert_normal_matrix(w):
                return SINGULAR
            continue
        w.counters[B_ITERATIONS] += 1
        for i in range(m):  # row i of B R; R is needed whole, B only row by row
            for j in range(m):
                x = 0.0
                for c in range(m):
                    x += w.B[i, c] * w.R[c, j]
                w.z[j] = x
            for j in range(m):
                w.B[i, j] -= w.z[j]
        if worst * worst <= tol or worst > 0.5 * before:  # squared next time; or rounding is all that is left
            return OK if worst < 0.5 else SINGULAR
        before = worst
    return SINGULAR
