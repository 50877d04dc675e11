"""Inertia rows: inertia of a joint coordinate c, such as that of a geared rotor, beside that of the bodies.

The kinetic energy cd^2 / 2 adds h^T h to the mass matrix, with h = c_q. Bodies stay apart if the force on the
coordinate is an unknown mu beside the multipliers:

    M a = F - H^T lam - h^T mu,        h a + gamma_h - mu = 0

The second equation is an inertia row of S: products of h with the other rows, and one more on the diagonal. It holds
for accelerations alone. Projections of positions and the chart leave it out: it is zero in H, and one on the diagonal
of N. Projections by the factors of S are those in the metric of M + h^T h.
"""

from ..jit.kernels import kernel
from ..jit.simd import fma, four, get, let, put, splat, times, total

# floats of a row in Rows.h: h of both bodies, gamma_h
BIAS, WIDTH = 16, 20


@kernel
def inner(H, h, Y, y):
    """Return the product of two rows at one body."""
    return total(fma(four(H, h), four(Y, y), times(four(H, h + 4), four(Y, y + 4))))


@kernel
def set_rows_aside(graph, rows):
    """Move the inertia rows from H to h."""
    for i in range(graph.inertias.size):
        for c in range(0, 16, 4):
            put(rows.h, WIDTH * i + c, four(rows.H, 16 * graph.inertias[i] + c))
    clear_rows(graph, rows)


@kernel
def put_rows_back(graph, rows):
    """Write h into H, for products of rows."""
    for i in range(graph.inertias.size):
        for c in range(0, 16, 4):
            put(rows.H, 16 * graph.inertias[i] + c, four(rows.h, WIDTH * i + c))


@kernel
def clear_rows(graph, rows):
    """H = 0 of inertia rows."""
    for i in range(graph.inertias.size):
        for c in range(0, 16, 4):
            put(rows.H, 16 * graph.inertias[i] + c, splat(0.0))


@kernel
def clear_entries(graph, out):
    """out = 0 of inertia rows."""
    for i in range(graph.inertias.size):
        out[graph.inertias[i]] = 0.0


@kernel
def keep_bias(graph, rows, gamma):
    """gamma_h of the inertia rows, from gamma."""
    for i in range(graph.inertias.size):
        let(rows.h, WIDTH * i + BIAS, gamma[graph.inertias[i]])


@kernel
def leave_diagonal(graph, values):
    """One on the diagonal of rows that are zero."""
    for i in range(graph.inertias.size):
        let(values, graph.diagonal[graph.inertias[i]], 1.0)


@kernel
def raise_diagonal(graph, values):
    """h W h^T + 1 on the diagonal."""
    for i in range(graph.inertias.size):
        at = graph.diagonal[graph.inertias[i]]
        let(values, at, get(values, at) + 1.0)


@kernel
def residuals(graph, rows, Z, out):
    """out = h Z + gamma_h of inertia rows."""
    for i in range(graph.inertias.size):
        e, h = graph.inertias[i], WIDTH * i
        product = inner(rows.h, h, Z, 8 * graph.sides[e, 0]) + inner(rows.h, h + 8, Z, 8 * graph.sides[e, 1])
        out[e] = product + get(rows.h, h + BIAS)


@kernel
def multiply(graph, rows, places, Z, out):
    """out[places[e]] = h Z of inertia row e."""
    for i in range(graph.inertias.size):
        e, h = graph.inertias[i], WIDTH * i
        out[places[e]] = inner(rows.h, h, Z, 8 * graph.sides[e, 0]) + inner(rows.h, h + 8, Z, 8 * graph.sides[e, 1])


@kernel
def unbalance(graph, rows, places, mu, out):
    """out[places[e]] <- mu - gamma_h - out[places[e]]."""
    for i in range(graph.inertias.size):
        e = graph.inertias[i]
        out[places[e]] = mu[e] - get(rows.h, WIDTH * i + BIAS) - out[places[e]]


@kernel
def subtract_multipliers(graph, mu, out):
    """out -= mu of inertia rows."""
    for i in range(graph.inertias.size):
        e = graph.inertias[i]
        out[e] -= mu[e]


@kernel
def take_reactions(graph, rows, mu, F):
    """F <- F - h^T mu, loads on bodies."""
    for i in range(graph.inertias.size):
        e, f = graph.inertias[i], splat(-mu[graph.inertias[i]])
        for k in range(2):
            at, z = WIDTH * i + 8 * k, 8 * graph.sides[e, k]
            put(F, z, fma(four(rows.h, at), f, four(F, z)))
            put(F, z + 4, fma(four(rows.h, at + 4), f, four(F, z + 4)))
