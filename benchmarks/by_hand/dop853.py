"""DOP853 (Hairer, Norsett, Wanner, Solving ODEs I, II.5) with a projection after each accepted step.

`driver` compiles it around the two kernels of a mechanism:

    evaluate(x, work, f)   f = dx/dt; multipliers by elimination
    project(x, work)       x back to where positions and velocities fulfil the constraints
"""

import numba
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as coefficients

from .options import PART

STAGES = coefficients.N_STAGES
A, B = np.ascontiguousarray(coefficients.A[:STAGES, :STAGES]), coefficients.B.copy()
E3, E5 = coefficients.E3[:STAGES].copy(), coefficients.E5[:STAGES].copy()


@numba.njit(**PART)
def combine(x, h, weights, count, k, out):
    """out = x + h sum_j weights_j k_j."""
    for i in range(x.size):
        out[i] = 0.0
    for j in range(count):
        w = weights[j]
        if w != 0.0:
            for i in range(x.size):
                out[i] += w * k[j, i]
    for i in range(x.size):
        out[i] = x[i] + h * out[i]


@numba.njit(**PART)
def error(x, y, k, h, tol, e3, e5):
    """The error of a step in units of the tolerance; e3 and e5 are workspace."""
    for i in range(x.size):
        e3[i], e5[i] = 0.0, 0.0
    for j in range(STAGES):
        a, b = E3[j], E5[j]
        if a != 0.0 or b != 0.0:
            for i in range(x.size):
                e3[i] += a * k[j, i]
                e5[i] += b * k[j, i]
    s3, s5 = 0.0, 0.0
    for i in range(x.size):
        scale = tol * (1.0 + max(abs(x[i]), abs(y[i])))
        s3 += (e3[i] / scale) ** 2
        s5 += (e5[i] / scale) ** 2
    return h * s5 / np.sqrt((s5 + 0.01 * s3) * x.size) if s5 > 0.0 else 0.0


def driver(evaluate, project):
    """Compile run(x, work, end, tol) -> steps, evaluations; x is moved from its start to `end` s."""

    @numba.njit(**PART)
    def run(x, work, end, tol):
        n = x.size
        k, y, e3, e5 = np.zeros((STAGES, n)), np.zeros(n), np.zeros(n), np.zeros(n)
        t, h, steps, evaluations, rejected = 0.0, 0.01 * tol**0.125 * end, 0, 1, False
        evaluate(x, work, k[0])
        while t < end:
            last = t + 1.0000001 * h >= end
            if last:
                h = end - t
            for s in range(1, STAGES):
                combine(x, h, A[s], s, k, y)
                evaluate(y, work, k[s])
            combine(x, h, B, STAGES, k, y)
            off = error(x, y, k, h, tol, e3, e5)
            evaluations += STAGES - 1
            factor = 0.9 * max(off, 1e-10) ** -0.125
            if off < 1.0:
                t = end if last else t + h
                for i in range(n):
                    x[i] = y[i]
                project(x, work)
                evaluate(x, work, k[0])
                steps, evaluations = steps + 1, evaluations + 1
                h *= min(1.0 if rejected else 10.0, max(0.2, factor))
                rejected = False
            else:
                h *= max(0.2, min(factor, 1.0))  # nan makes it 0.2
                rejected = True
                if h < 1e-14 * end:
                    x[:] = np.nan
                    break
        return steps, evaluations

    return run
