"""The Schur complement S = H W H^T (Delassus operator) of the constraint rows H = [Phi_r, Phi_pi']: factors, solves.

Body quantities are rows of eight floats, (linear, 0, angular in the body frame, 0); the last row is the ground's.
"""

from ..elements.loops.body_poses import POSE, RD
from ..jit.kernels import kernel
from ..jit.simd import add, fma, four, get, let, put, splat, times, total
from ..sparse.constraint_graph import (
    ROWS,
    ROWS_WELD,
    W_MASS,
    W_ROTATION,
    WEIGHTS,
    WELD_ROWS,
)
from ..sparse.elimination import factor, solve
from .axis_rows import gather_axes, leave_axes_out, multiply_axes, weigh_axes
from .redundant_rows import set_redundant_diagonal
from .tolerances import ZERO_PIVOT

# What S is made for. DYNAMICS: W is the inverse of the mass matrix, by way of axis rows where a body has next to no
# inertia about an axis. METRIC: W is that of the raised inertias, without axis rows: a metric for projections.
DYNAMICS, METRIC = 0, 1


@kernel
def weigh(weights, at, values, i, out, o):
    """Set out[o : o + 8] to values[i : i + 8] times 1 / m and J'^-1, or m and J', of one body."""
    w = at * WEIGHTS
    f = times(four(weights, w + W_ROTATION), splat(get(values, i + 4)))
    f = fma(four(weights, w + W_ROTATION + 4), splat(get(values, i + 5)), f)
    f = fma(four(weights, w + W_ROTATION + 8), splat(get(values, i + 6)), f)
    put(out, o, times(four(values, i), splat(get(weights, w + W_MASS))))
    put(out, o + 4, f)


@kernel
def weigh_bodies(graph, Z):
    """Z <- W Z."""
    for b in range(graph.bodies.shape[0]):
        weigh(graph.inverse, b, Z, 8 * b, Z, 8 * b)


@kernel
def weigh_rows(graph, H, Y):
    """Set Y = W H^T, body by body."""
    for e in range(graph.sides.shape[0]):
        for k in range(2):
            at = 16 * e + 8 * k
            weigh(graph.inverse, graph.sides[e, k], H, at, Y, at)


@kernel
def inner(H, h, Y, y):
    """Return the product of two rows at one body."""
    return total(fma(four(H, h), four(Y, y), times(four(H, h + 4), four(Y, y + 4))))


@kernel
def inner_both(H, h, Y, y):
    """Return the product of two rows at both bodies."""
    f = fma(four(H, h), four(Y, y), times(four(H, h + 4), four(Y, y + 4)))
    g = fma(four(H, h + 8), four(Y, y + 8), times(four(H, h + 12), four(Y, y + 12)))
    return total(add(f, g))


@kernel
def more(values, at, x):
    """values[at] += x."""
    let(values, at, get(values, at) + x)


@kernel
def form_schur_complement(graph, H, Y, values):
    """Set the upper triangle of S = H Y^T in the blocks of the pattern, with zeros for fill."""
    products = graph.products
    # Fill is zero
    for i in range(graph.pattern.shape[1]):
        let(values, i, 0.0)
    for i in range(products.shape[0]):
        product = products[i]
        left, right, rows, columns = product.left, product.right, product.rows, product.columns
        target, stride = product.target, product.stride
        # Rows of one primitive share both bodies: upper triangle of the block
        if product.same != 0:
            for r in range(rows):
                for c in range(r, columns):
                    more(values, target + c, inner_both(H, left + 16 * r, Y, right + 16 * c))
                target += stride
        else:
            # Rows of two primitives share one body
            for r in range(rows):
                for c in range(columns):
                    more(values, target + c, inner(H, left + 16 * r, Y, right + 16 * c))
                target += stride
    if graph.parts.shape[0] > 0:
        _multiply_parts(graph, H, Y, values)


@kernel
def _multiply_parts(graph, H, Y, values):
    """Add the products at the parts of split bodies."""
    for i in range(graph.parts.shape[0]):
        # A part of a hub has 1 / scale of its mass and inertia, so W is `scale` times as large
        part, scale = graph.parts[i], graph.scales[i]
        left, rows, right, columns = part.left, part.rows, part.right, part.columns
        target, stride, kind, weights = part.target, part.stride, part.kind, WEIGHTS * part.body
        for r in range(rows):
            for c in range(columns):
                # Rows with rows; with the welds of the part, whose H is +-I; welds with welds
                if kind == ROWS:
                    if left != right or c >= r:
                        more(values, target + r * stride + c, scale * inner(H, left + 16 * r, Y, right + 16 * c))
                elif kind == ROWS_WELD:
                    more(values, target + r * stride + c, scale * get(Y, left + 16 * r + c + c // 3))
                elif kind == WELD_ROWS:
                    more(values, target + c * stride + r, scale * get(Y, left + 16 * r + c + c // 3))
                elif r < 3 and r == c:
                    more(values, target + r * stride + c, scale * get(graph.inverse, weights + W_MASS))
                elif r >= 3 and c >= 3:
                    w = get(graph.inverse, weights + W_ROTATION + 4 * (c - 3) + r - 3)
                    more(values, target + r * stride + c, scale * w)


@kernel
def factorise_selected_rows(graph, f, rows, metric):
    """Set Y = W H^T and the factors of S = H W H^T, the selection being given; return the row that fails, or -1.

    metric as in `factorise_rows`.
    """
    # Y = W H^T,  S = H Y
    weigh_rows(graph, rows.H, rows.Y)
    form_schur_complement(graph, rows.H, rows.Y, rows.S)
    # Dropped rows are zero: one on the diagonal
    if f.dropped[0] > 0:
        set_redundant_diagonal(graph, f, rows.S)
    # Axis rows, for dynamics only
    if graph.axes.rows.shape[0] > 0:
        weigh_axes(graph, rows.Y)
        if metric == METRIC:
            leave_axes_out(graph, rows.S)
        else:
            multiply_axes(graph, rows.H, rows.Y, rows.S)
    return factor(graph.pattern, rows.S, ZERO_PIVOT)


@kernel
def solve_rows(graph, rows, b):
    """b <- S^-1 b."""
    solve(graph.pattern, rows.S, b)


@kernel
def _gather(graph, H, Z, out):
    """out = H Z."""
    for e in range(graph.sides.shape[0]):
        # H_a Z_a + H_b Z_b
        at, a, b = 16 * e, 8 * graph.sides[e, 0], 8 * graph.sides[e, 1]
        f = fma(four(H, at), four(Z, a), times(four(H, at + 4), four(Z, a + 4)))
        g = fma(four(H, at + 8), four(Z, b), times(four(H, at + 12), four(Z, b + 4)))
        out[e] = total(add(f, g))


@kernel
def _scatter(graph, Y, lam, Z):
    """Z <- Z - Y^T lam."""
    for e in range(graph.sides.shape[0]):
        # Z_a and Z_b of each row
        f = splat(-lam[e])
        for k in range(2):
            at, z = 16 * e + 8 * k, 8 * graph.sides[e, k]
            put(Z, z, fma(four(Y, at), f, four(Z, z)))
            put(Z, z + 4, fma(four(Y, at + 4), f, four(Z, z + 4)))


@kernel
def multiply_rows(graph, rows, Z, out):
    """out = H Z."""
    _gather(graph, rows.H, Z, out)


@kernel
def add_products(graph, rows, Z, out):
    """out += H Z."""
    for e in range(graph.sides.shape[0]):
        at = 16 * e
        out[e] += inner(rows.H, at, Z, 8 * graph.sides[e, 0]) + inner(rows.H, at + 8, Z, 8 * graph.sides[e, 1])


@kernel
def multiply_rates(graph, rows, poses, out):
    """out = H (rd, omega') of the poses."""
    H = rows.H
    for e in range(graph.sides.shape[0]):
        at, a, b = 16 * e, graph.sides[e, 0] * POSE + RD, graph.sides[e, 1] * POSE + RD
        g = fma(four(H, at), four(poses, a), times(four(H, at + 4), four(poses, a + 4)))
        g = fma(four(H, at + 8), four(poses, b), fma(four(H, at + 12), four(poses, b + 4), g))
        out[e] = total(g)


@kernel
def apply_multipliers(graph, rows, lam, Z):
    """Z <- Z - Y^T lam."""
    _scatter(graph, rows.Y, lam, Z)


@kernel
def apply_columns(graph, X, lam, Z):
    """Z <- Z - X^T lam, X being of the layout of Y."""
    _scatter(graph, X, lam, Z)


@kernel
def take_reactions(graph, rows, lam, F):
    """F <- F - H^T lam, loads on bodies."""
    _scatter(graph, rows.H, lam, F)


@kernel
def find_correction(graph, rows, b, Z):
    """Smallest Z in the metric with H Z = -b; b becomes its multipliers.

    b <- S^-1 b,    Z = -Y^T b
    """
    solve(graph.pattern, rows.S, b)
    for i in range(Z.size):
        Z[i] = 0.0
    _scatter(graph, rows.Y, b, Z)


@kernel
def project(graph, rows, Z, lam):
    """Project Z onto H Z = 0.

    lam = S^-1 H Z,    Z <- Z - Y^T lam
    """
    _gather(graph, rows.H, Z, lam)
    solve(graph.pattern, rows.S, lam)
    _scatter(graph, rows.Y, lam, Z)


@kernel
def constrain(graph, rows, c, Z, lam):
    """Project Z onto H Z + c = 0; the largest residual that it had.

    lam = S^-1 (H Z + c),    Z <- Z - Y^T lam
    """
    _gather(graph, rows.H, Z, lam)
    # Residual H Z + c
    worst = 0.0
    for e in range(lam.size):
        lam[e] += c[e]
        worst = max(worst, abs(lam[e]))
    solve(graph.pattern, rows.S, lam)
    _scatter(graph, rows.Y, lam, Z)
    return worst


@kernel
def acceleration_residuals(graph, rows, gamma, Z, out):
    """out = H Z + gamma, and of axis rows c e . Z; Z is (rdd, omega'd)."""
    _gather(graph, rows.H, Z, out)
    gather_axes(graph, Z, 4, 8, 1.0, out)
    for e in range(out.size):
        out[e] += gamma[e]


@kernel
def constrain_accelerations(graph, rows, gamma, Z, lam):
    """Accelerations Z and multipliers from Z = W F, with S of DYNAMICS.

    lam = S^-1 (H Z + gamma),    Z <- Z - Y^T lam
    """
    acceleration_residuals(graph, rows, gamma, Z, lam)
    solve(graph.pattern, rows.S, lam)
    _scatter(graph, rows.Y, lam, Z)


@kernel
def balance_loads(graph, rows, F, lam):
    """Multipliers for H^T lam = F by least squares, and what they leave of F, a load of each body.

    lam = S^-1 H W F,    F <- F - H^T lam
    """
    _gather(graph, rows.Y, F, lam)
    solve(graph.pattern, rows.S, lam)
    _scatter(graph, rows.H, lam, F)
