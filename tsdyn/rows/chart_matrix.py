"""The chart matrix N = H C Y0, the derivative of Phi with respect to -u, and other matrices H X^T.

    omega'  = C etad,       C = d0 I - d~ + d d^T / d0        X^T = C Y0

At the parts of a split body N has the products with the welds, whose rows are W0 at q0 and C W0 at q.
"""

from ..jit.kernels import kernel, long_kernel, stack
from ..jit.simd import add, cross, fma, four, get, lanes, let, put, splat, sub, times, total
from ..sparse.constraint_graph import (
    ROWS,
    ROWS_WELD,
    W_MASS,
    W_ROTATION,
    WEIGHTS,
    WELDS,
)
from ..sparse.elimination import factor_lu, solve_lu
from .axis_rows import leave_axes_out, multiply_axes_both
from .redundant_rows import set_redundant_diagonal
from .schur_complement import inner, inner_both, more
from .tolerances import COMPENSATED, ZERO_PIVOT


@kernel
def _multiply_both(graph, H, X, lower, upper):
    """Set H X^T in the blocks of the pattern as `factor_lu` expects: upper triangle, lower triangle transposed."""
    products = graph.products
    # Blocks that no product reaches are fill
    for i in range(graph.pattern.shape[1]):
        let(upper, i, 0.0)
        let(lower, i, 0.0)
    for i in range(products.shape[0]):
        product = products[i]
        left, right, rows, columns = product.left, product.right, product.rows, product.columns
        target, stride = product.target, product.stride
        # A primitive with itself shares both bodies
        if product.same != 0:
            for r in range(rows):
                more(upper, target + r, inner_both(H, left + 16 * r, X, right + 16 * r))
                for c in range(r + 1, columns):
                    more(upper, target + c, inner_both(H, left + 16 * r, X, right + 16 * c))
                    more(lower, target + c, inner_both(H, right + 16 * c, X, left + 16 * r))
                target += stride
        else:
            # Two primitives at one common body
            for r in range(rows):
                for c in range(columns):
                    more(upper, target + c, inner(H, left + 16 * r, X, right + 16 * c))
                    more(lower, target + c, inner(H, right + 16 * c, X, left + 16 * r))
                target += stride


@kernel
def rotate_rate(l, b, rate):
    """Return C rate of body b, rate in four lanes."""
    x, y, z, w = get(l.d, 4 * b), get(l.d, 4 * b + 1), get(l.d, 4 * b + 2), get(l.d, 4 * b + 3)
    # C = d0 I - d~ + d d^T / d0, with d0 - 1 = w
    d = lanes(x, y, z)
    along = total(times(d, rate)) / (1.0 + w)
    return add(rate, sub(fma(d, splat(along), times(rate, splat(w))), cross(d, rate)))


@long_kernel
def factorise_chart_matrix(graph, f, l):
    """Set the LU factors of N = H C Y0 at the present H; return True if N is nonsingular."""
    Y0 = l.rows0.Y
    for e in range(graph.sides.shape[0]):
        for k in range(2):
            # X^T = C Y0, body by body
            at = 16 * e + 8 * k
            put(l.X, at, four(Y0, at))
            put(l.X, at + 4, rotate_rate(l, graph.sides[e, k], four(Y0, at + 4)))
    _multiply_both(graph, f.rows.H, l.X, l.lower, l.upper)
    if graph.parts.shape[0] > 0:
        _multiply_parts(graph, f.rows.H, l)
    # Dropped and axis rows: one, or minus one, on the diagonal
    for values in (l.lower, l.upper):
        set_redundant_diagonal(graph, f, values)
        leave_axes_out(graph, values)
    return factor_lu(graph.pattern, l.lower, l.upper, ZERO_PIVOT) < 0


@kernel
def factorise_product(graph, f, X, lower, upper):
    """Set the LU factors of H X^T at the present H, with axis rows; return True if the matrix is nonsingular."""
    _multiply_both(graph, f.rows.H, X, lower, upper)
    multiply_axes_both(graph, f.rows.H, X, lower, upper)
    set_redundant_diagonal(graph, f, lower)
    set_redundant_diagonal(graph, f, upper)
    return factor_lu(graph.pattern, lower, upper, ZERO_PIVOT) < 0


@kernel
def solve_product(graph, lower, upper, b):
    """b <- (H X^T)^-1 b, by the factors of `factorise_chart_matrix` or `factorise_product`; those of S serve twice."""
    solve_lu(graph.pattern, lower, upper, b)


@kernel
def pivot_loss(graph, l):
    """Return max |1 - n / s|, with n and s the products of the pivots of a primitive's rows in N and in S0.

    Single pivots of a spherical joint depend on the axes of the ground frame; their product does not.
    """
    worst, axes = 0.0, graph.axes.rows
    # Primitives, then welds, then axes
    for i in range(graph.products.shape[0]):
        if graph.products[i].same == 0:
            break  # those of a primitive with itself come first
        worst = max(worst, _loss(graph, l, graph.products[i].left // 16, graph.products[i].rows))
    for i in range(0, graph.welds.shape[0], 3):  # three displacements, three rotations
        worst = max(worst, _loss(graph, l, graph.welds[i, 0], 3))
    for i in range(axes.shape[0]):
        worst = max(worst, _loss(graph, l, axes[i].row, 1))
    return worst


@kernel
def _loss(graph, l, e, rows):
    """|1 - n / s| of successive rows."""
    share = 1.0
    for r in range(e, e + rows):
        share *= get(l.rows0.S, graph.diagonal[r]) / get(l.upper, graph.diagonal[r])  # reciprocals of s and n
    return abs(1.0 - share) * (COMPENSATED if rows > 1 else 1.0)


@kernel
def _multiply_parts(graph, H, l):
    """Add the products at the parts of split bodies."""
    t, lower, upper = stack(12), l.lower, l.upper  # t: C W0 of a body
    for i in range(graph.parts.shape[0]):
        # A part of a hub has 1 / scale of its mass and inertia, so W is `scale` times as large
        part, scale = graph.parts[i], graph.scales[i]
        left, rows, right, columns = part.left, part.rows, part.right, part.columns
        target, stride, kind, b = part.target, part.stride, part.kind, part.body
        light, w = graph.inverse[WEIGHTS * b + W_MASS], WEIGHTS * b + W_ROTATION
        # C W0 of the rotations of a weld
        if kind != ROWS and graph.bodies[b, 1] == 7:
            for c in range(3):
                put(t, 4 * c, rotate_rate(l, b, four(graph.inverse, w + 4 * c)))
        for r in range(rows):
            for c in range(columns):
                at, h = target + r * stride + c, left + 16 * r
                # Two sets of rows at the part
                if kind == ROWS:
                    other = right + 16 * c
                    if left != right or c >= r:
                        more(upper, at, scale * inner(H, h, l.X, other))
                    if left != right or c > r:
                        more(lower, at, scale * inner(H, other, l.X, h))
                # Two welds: +-W0 on the translations, +-C W0 on the rotations
                elif kind == WELDS:
                    if r < 3 and r == c:
                        more(upper, at, scale * light)
                        more(lower, at, scale * light)
                    elif r >= 3 and c >= 3:
                        more(upper, at, scale * t[4 * (c - 3) + r - 3])
                        more(lower, at, scale * t[4 * (r - 3) + c - 3])
                else:
                    # Rows and a weld: H C W0 in one factor, W0 H^T C^T in the other
                    turned = light * H[h + c]
                    if c >= 3:
                        o = 4 * (c - 3)
                        turned = H[h + 4] * t[o] + H[h + 5] * t[o + 1] + H[h + 6] * t[o + 2]
                    placed = l.X[h + c + c // 3]
                    if kind == ROWS_WELD:
                        more(upper, at, scale * turned)
                        more(lower, at, scale * placed)
                    else:
                        more(upper, target + c * stride + r, scale * placed)
                        more(lower, target + c * stride + r, scale * turned)
