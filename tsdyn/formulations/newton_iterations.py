"""The two Newton iterations of Haug (2018), section 5: Eq. 29 for u and Eq. 28 for B, both warm-started."""

import math

from ..errors import Status
from ..jit.kernels import kernel
from .dense_rows import evaluate_dense_residuals, factorise_dense_rows, invert_normal_matrix, subtract_normal
from .tolerances import B_OUTDATED, B_SWEEPS, HUGE, ROUNDING_AT_MOST, SLOW, STALLED

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
        if worst > tol and worst > SLOW * before:
            if stuck and worst <= ROUNDING_AT_MOST * floor:
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
        rounding = STALLED * before < worst <= ROUNDING_AT_MOST * floor
        if worst <= floor or (worst <= tol and (rounding or worst * w.control.rate <= left)):
            subtract_normal(w, w.z, w.q)  # q itself, not all of the sum again: a digit less is lost
            return OK
        before = worst
    return NEWTON_FAILED


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
            before = HUGE  # a factorisation is tried once
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
