"""Motion inside a step of a collocation method: the polynomial x'' through the stages, and its integrals.

x'' = sum_j K_j P_j, P_j the shifted Legendre polynomials; x' and x are its integrals from the step's start, which they
leave and reach exactly. Their errors are of the order of the stages, as the error estimate is.
"""

from functools import cache

from ..jit.kernels import ANY, callback, kernel, stack, vector
from ..maths.dense_linalg import copy
from ..workspaces.run_state import B_DATA, load_run
from .collocation import MOST_STAGES, parts_of
from .interpolants import FILL, VALUE, Interpolant

HEAD = 1 + MOST_STAGES  # the number of stages, and their times
ROOM = MOST_STAGES + 3  # polynomials up to two orders higher


@cache
def interpolant_of(stages):
    """The `Interpolant` of methods with so many stages."""
    return Interpolant(fill_collocation, collocation, lambda n, nx, ny: HEAD + (3 + stages) * nx, stages + 1)


@callback(FILL)
def fill_collocation(context, run):
    """The times of the stages; x, x' and x'' of the start, K_j."""
    r = load_run(run)
    stages, n, p, data = int(r.tableau[0]) - 1, r.x.size, parts_of(r.tableau), r.block[B_DATA:]
    data[0] = stages
    for i in range(stages):
        data[1 + i] = r.tableau[2 + (i + 1) * (3 + stages)]
    data = data[HEAD:]
    copy(r.x_old, data)
    copy(r.y_old, data[n:])
    copy(r.yd_old, data[2 * n :])
    for j in range(stages):
        out = data[(3 + j) * n :]
        for e in range(n):
            out[e] = 0.0
            for i in range(stages):
                out[e] += r.tableau[p.legendre + stages * j + i] * r.memory[(2 * i + 5) * n + e]
    return 0


@kernel
def _polynomials(s, count, P):
    """P[j] = P_j(s) for j < count."""
    x = 2.0 * s - 1.0
    P[0], P[1] = 1.0, x
    for j in range(1, count - 1):
        P[j + 1] = ((2 * j + 1) * x * P[j] - j * P[j - 1]) / (j + 1)


@kernel
def _integrate(first, count, P, Q):
    """Q[j], j < count, the integrals from 0 to s of P_j, or of the integrals that P holds; first is that of P[0]."""
    Q[0] = first
    for j in range(1, count):
        Q[j] = (P[j + 1] - P[j - 1]) / (2.0 * (2 * j + 1))


@callback(VALUE)
def collocation(s, h, n, nx, ny, data, x, y):
    """x = x0 + s h x0' + h^2 sum_j K_j (second integral of P_j), and x'."""
    data, x, y = vector(data, ANY), vector(x, nx), vector(y, nx)
    P, Q, R, stages = stack(ROOM), stack(ROOM), stack(ROOM), int(data[0])
    _polynomials(s, stages + 2, P)
    _integrate(s, stages + 1, P, Q)
    _integrate(0.5 * s * s, stages, Q, R)
    data = data[HEAD:]
    for e in range(nx):
        a, b = 0.0, 0.0
        for j in range(stages - 1, -1, -1):
            k = data[(3 + j) * nx + e]
            a += R[j] * k
            b += Q[j] * k
        x[e] = data[e] + h * (s * data[nx + e] + h * a)
        y[e] = data[nx + e] + h * b
    return 0


@callback(VALUE)
def second_derivative(s, h, n, nx, ny, data, x, y):
    """x'' as y, on the polynomial through the step's start besides; x is left alone."""
    data, y = vector(data, ANY), vector(y, nx)
    P, start, stages, bump = stack(ROOM), stack(ROOM), int(data[0]), 1.0
    _polynomials(s, stages + 1, P)
    _polynomials(0.0, stages + 1, start)
    for i in range(stages):
        bump *= 1.0 - s / data[1 + i]
    data = data[HEAD:]
    for e in range(nx):
        here, there = 0.0, 0.0
        for j in range(stages - 1, -1, -1):
            k = data[(3 + j) * nx + e]
            here += P[j] * k
            there += start[j] * k
        y[e] = here + bump * (data[2 * nx + e] - there)
    return 0
