"""Motion inside a step of a collocation method: a polynomial x'' and its integrals.

x'' = sum_j K_j P_j, P_j the shifted Legendre polynomials, has the values of the step's start and of the stages. Its
integrals reach x and x' of the step's end, since the quadrature by the stages alone is exact for them.
"""

from functools import cache

from ..jit.kernels import ANY, callback, kernel, stack, vector
from ..maths.dense_linalg import copy
from ..workspaces.run_state import B_DATA, load_run
from .collocation import MOST_STAGES, parts_of
from .interpolants import FILL, VALUE, Interpolant

ROOM = MOST_STAGES + 4  # polynomials, and two of higher order for the integrals


@cache
def interpolant_of(stages):
    """The `Interpolant` of methods with so many stages."""
    return Interpolant(fill_collocation, collocation, lambda n, nx, ny: 1 + (3 + stages) * nx, stages + 2)


@callback(FILL)
def fill_collocation(context, run):
    """The number of coefficients; x and x' of the start; K_j."""
    r = load_run(run)
    size, n, data, at = int(r.tableau[0]), r.x.size, r.block[B_DATA:], parts_of(r.tableau).output
    data[0] = size
    data = data[1:]
    copy(r.x_old, data)
    copy(r.y_old, data[n:])
    # K_j = sum_i output_ji k_i: values at the nodes to Legendre coefficients
    for j in range(size):
        row, out = r.tableau[at + size * j :], data[(2 + j) * n :]
        for e in range(n):
            k = 0.0
            for i in range(size):
                k += row[i] * r.memory[(2 * i + 3) * n + e]
            out[e] = k
    return 0


@kernel
def _polynomials(s, count, P):
    """P[j] = P_j(s) for j < count."""
    x = 2.0 * s - 1.0
    P[0], P[1] = 1.0, x
    # (j + 1) P_{j+1} = (2 j + 1) x P_j - j P_{j-1}
    for j in range(1, count - 1):
        P[j + 1] = ((2 * j + 1) * x * P[j] - j * P[j - 1]) / (j + 1)


@kernel
def _integrate(first, count, P, Q):
    """Q[j], j < count, the integrals from 0 to s of P_j, or of the integrals that P holds; first is that of P[0]."""
    Q[0] = first
    # int P_j = (P_{j+1} - P_{j-1}) / (2 (2 j + 1)) on [0, s]
    for j in range(1, count):
        Q[j] = (P[j + 1] - P[j - 1]) / (2.0 * (2 * j + 1))


@callback(VALUE)
def collocation(s, h, n, nx, ny, data, x, y):
    """x = x0 + s h x0' + h^2 sum_j K_j (second integral of P_j), and x'."""
    data, x, y = vector(data, ANY), vector(x, nx), vector(y, nx)
    P, Q, R, size = stack(ROOM), stack(ROOM), stack(ROOM), int(data[0])
    # P_j at s, their first integrals Q and second integrals R from 0
    _polynomials(s, size + 2, P)
    _integrate(s, size + 1, P, Q)
    _integrate(0.5 * s * s, size, Q, R)
    data = data[1:]
    # x = x0 + h (s x0' + h sum_j R_j K_j),  x' = x0' + h sum_j Q_j K_j
    for e in range(nx):
        a, b = 0.0, 0.0
        for j in range(size - 1, -1, -1):
            k = data[(2 + j) * nx + e]
            a += R[j] * k
            b += Q[j] * k
        x[e] = data[e] + h * (s * data[nx + e] + h * a)
        y[e] = data[nx + e] + h * b
    return 0


@callback(VALUE)
def second_derivative(s, h, n, nx, ny, data, x, y):
    """x'' as y; x is left alone."""
    data, y = vector(data, ANY), vector(y, nx)
    P, size = stack(ROOM), int(data[0])
    _polynomials(s, size, P)
    # sum_j P_j K_j, the smallest terms first
    for e in range(nx):
        y[e] = 0.0
        for j in range(size - 1, -1, -1):
            y[e] += P[j] * data[1 + (2 + j) * nx + e]
    return 0
