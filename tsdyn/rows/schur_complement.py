"""The Schur complement S = H W H^T (Delassus operator) of H = [Phi_r, Phi_pi'], and the chart matrix N."""

from ..elements.loops.constraint_rows import POSE, RD
from ..jit.kernels import kernel, long_kernel, stack
from ..jit.simd import add, cross, fma, four, get, lanes, let, put, splat, sub, times, total
from ..maths.tolerances import HALF_DIGITS, PIVOT_ROUNDING
from .constraint_graph import ROWS, ROWS_WELD, W_MASS, W_ROTATION, WEIGHTS, WELD_ROWS, WELDS
from .elimination import factor, factor_and_solve, factor_lu, solve, solve_lu
from .inertia_rows import (
    AXIS_H,
    AXIS_OWN,
    AXIS_Y,
    clear_rows,
    inner,
    leave_diagonal,
    put_rows_back,
    raise_diagonal,
    residuals,
    subtract_multipliers,
)
from .inertia_rows import take_reactions as take_inertia_reactions
from .redundant_rows import set_redundant_diagonal
from .tolerances import COMPENSATED

# Products of axis rows (inertia_rows.py): contributions to S, to matrices of its pattern and right-hand sides.
#
# An axis row is zero in H, since a projection onto the constraint manifold ignores it; in Y = W H^T it is present.


@kernel
def weigh_axes(graph, Y):
    """Set the axis rows of Y = W H^T."""
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        put(Y, 16 * axes.rows[i].row + 4, four(axes.values[i], AXIS_Y))


@kernel
def multiply_axes(graph, H, Y, values):
    """Add the products of axis rows with all rows to the blocks of S."""
    axes = graph.axes
    for i in range(axes.products.shape[0]):
        # c e . (J'^-1 H^T) of a row at the body; of a weld, a component of it
        product, scale = axes.products[i], axes.scales[i]
        side, y = product.side, 16 * axes.rows[product.axis].row + 4
        x = get(Y, y - 1 - side) if side < 0 else total(times(four(H, side + 4), four(Y, y)))
        let(values, product.target, scale * x)
    # Diagonal: -j / J
    for i in range(axes.rows.shape[0]):
        let(values, graph.diagonal[axes.rows[i].row], axes.values[i, AXIS_OWN])


@kernel
def multiply_axes_both(graph, H, X, lower, upper):
    """Add the products of axis rows to H X^T, in the form of `factor_lu`; no body is split."""
    multiply_axes(graph, H, X, upper)
    axes = graph.axes
    for i in range(axes.products.shape[0]):
        # The lower factor takes c e . X
        product = axes.products[i]
        h = four(axes.values[product.axis], AXIS_H)
        let(lower, product.target, total(times(h, four(X, product.side + 4))))
    for i in range(axes.rows.shape[0]):
        let(lower, graph.diagonal[axes.rows[i].row], axes.values[i, AXIS_OWN])


@kernel
def leave_axes_out(graph, values):
    """Replace axis and inertia rows by minus one, or one, on the diagonal, so that their multipliers are zero."""
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        let(values, graph.diagonal[axes.rows[i].row], -1.0)
    leave_diagonal(graph, values)


@kernel
def gather_axes(graph, values, at, stride, scale, out):
    """out = scale c e . z of the axis rows, z at values[at + stride * b] being of body b."""
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        # c e . omega'd
        e, b = axes.rows[i].row, axes.rows[i].body
        out[e] = scale * total(times(four(axes.values[i], AXIS_H), four(values, at + stride * b)))


@kernel
def add_multiplier_terms(graph, lam, out):
    """out += lam of axis rows, -= mu of inertia rows: the last terms of c e . omega'd + lam_e, h a + gamma_h - mu."""
    subtract_multipliers(graph, lam, out)
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        e = axes.rows[i].row
        out[e] += lam[e]


@kernel
def clear_axes(graph, out):
    """out = 0 of the axis rows."""
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        out[axes.rows[i].row] = 0.0


@kernel
def is_axis(graph, rows, e):
    """Return True if the row that failed in the factorisation of S, or -1, is an axis row."""
    return e >= 0 and rows.S[graph.pattern.shape[1] + e] < 0.0


# The Schur complement S = H W H^T (Delassus operator) of the constraint rows H = [Phi_r, Phi_pi']: factors, solves.
#
# Body quantities are rows of eight floats, (linear, 0, angular in the body frame, 0); the last row is the ground's.

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
def weigh_selected_rows(graph, rows):
    """Set Y = W H^T alone, the selection being given."""
    put_rows_back(graph, rows)
    weigh_rows(graph, rows.H, rows.Y)
    clear_rows(graph, rows)
    weigh_axes(graph, rows.Y)


@kernel
def factorise_selected_rows(graph, f, rows, metric):
    """Set Y = W H^T and the factors of S = H W H^T, the selection being given; return the row that fails, or -1.

    metric as in `factorise_rows`.
    """
    form_selected_rows(graph, f, rows, metric)
    return factor(graph.pattern, rows.S, PIVOT_ROUNDING)


@kernel
def form_selected_rows(graph, f, rows, metric):
    """Set Y = W H^T and S = H W H^T, for `factorise_and_constrain`."""
    # Y = W H^T,  S = H Y; inertia rows are for dynamics only
    if metric == DYNAMICS:
        put_rows_back(graph, rows)
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
    if metric == METRIC:
        leave_diagonal(graph, rows.S)
    else:
        raise_diagonal(graph, rows.S)
        clear_rows(graph, rows)


@kernel
def solve_rows(graph, rows, b):
    """b <- S^-1 b."""
    solve(graph.pattern, rows.S, b)


@kernel
def _gather(graph, H, Z, out):
    """out = H Z."""
    for e in range(graph.row.shape[0]):
        # H_a Z_a + H_b Z_b
        at, a, b = 16 * e, 8 * graph.sides[e, 0], 8 * graph.sides[e, 1]
        f = fma(four(H, at), four(Z, a), times(four(H, at + 4), four(Z, a + 4)))
        g = fma(four(H, at + 8), four(Z, b), times(four(H, at + 12), four(Z, b + 4)))
        out[e] = total(add(f, g))
    _gather_tails(graph, H, Z, 8, 0, out)


@kernel
def _gather_tails(graph, H, values, width, first, out):
    """out += H z of the later terms of sums; z of body b is at values[width b + first]."""
    for i in range(graph.tails.shape[0]):
        e = graph.row.shape[0] + i
        for k in range(2):
            out[graph.tails[i]] += inner(H, 16 * e + 8 * k, values, width * graph.sides[e, k] + first)


@kernel
def apply_columns(graph, Y, lam, Z):
    """Z <- Z - Y^T lam, for Y, H, or others of their layout."""
    # Z_a and Z_b stay in registers over the rows of a pair of bodies; then the later terms of sums
    i = j = 0
    a, c, b, d = four(Z, 0), four(Z, 4), four(Z, 0), four(Z, 4)
    for e in range(graph.row.shape[0]):
        f, at, k, l = splat(-lam[e]), 16 * e, 8 * graph.sides[e, 0], 8 * graph.sides[e, 1]
        if k != i or l != j:
            _put_pair(Z, i, a, c, j, b, d)
            i, j = k, l
            a, c, b, d = four(Z, i), four(Z, i + 4), four(Z, j), four(Z, j + 4)
        a, c = fma(four(Y, at), f, a), fma(four(Y, at + 4), f, c)
        b, d = fma(four(Y, at + 8), f, b), fma(four(Y, at + 12), f, d)
    _put_pair(Z, i, a, c, j, b, d)
    for n in range(graph.tails.shape[0]):
        _scatter_pair(graph, Y, graph.row.shape[0] + n, splat(-lam[graph.tails[n]]), Z)


@kernel
def _put_pair(Z, i, a, c, j, b, d):
    """Z of two bodies, at Z[i] and at Z[j]."""
    put(Z, i, a)
    put(Z, i + 4, c)
    put(Z, j, b)
    put(Z, j + 4, d)


@kernel
def _scatter_pair(graph, Y, e, f, Z):
    """Z <- Z + f Y_e at both bodies of a pair of sides."""
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
    for e in range(graph.row.shape[0]):
        at = 16 * e
        out[e] += inner(rows.H, at, Z, 8 * graph.sides[e, 0]) + inner(rows.H, at + 8, Z, 8 * graph.sides[e, 1])
    _gather_tails(graph, rows.H, Z, 8, 0, out)


@kernel
def multiply_rates(graph, rows, poses, out):
    """out = H (rd, omega') of the poses."""
    H = rows.H
    for e in range(graph.row.shape[0]):
        at, a, b = 16 * e, graph.sides[e, 0] * POSE + RD, graph.sides[e, 1] * POSE + RD
        g = fma(four(H, at), four(poses, a), times(four(H, at + 4), four(poses, a + 4)))
        g = fma(four(H, at + 8), four(poses, b), fma(four(H, at + 12), four(poses, b + 4), g))
        out[e] = total(g)
    _gather_tails(graph, H, poses, POSE, RD, out)


@kernel
def apply_multipliers(graph, rows, lam, Z):
    """Z <- Z - Y^T lam."""
    apply_columns(graph, rows.Y, lam, Z)


@kernel
def take_reactions(graph, rows, lam, F):
    """F <- F - H^T lam, loads on bodies."""
    apply_columns(graph, rows.H, lam, F)
    take_inertia_reactions(graph, rows, lam, F)


@kernel
def find_correction(graph, rows, b, Z):
    """Smallest Z in the metric with H Z = -b; b becomes its multipliers.

    b <- S^-1 b,    Z = -Y^T b
    """
    solve(graph.pattern, rows.S, b)
    for i in range(Z.size):
        Z[i] = 0.0
    apply_columns(graph, rows.Y, b, Z)


@kernel
def project(graph, rows, Z, lam):
    """Project Z onto H Z = 0.

    lam = S^-1 H Z,    Z <- Z - Y^T lam
    """
    _gather(graph, rows.H, Z, lam)
    solve(graph.pattern, rows.S, lam)
    apply_columns(graph, rows.Y, lam, Z)


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
    apply_columns(graph, rows.Y, lam, Z)
    return worst


@kernel
def acceleration_residuals(graph, rows, gamma, Z, out):
    """out = H Z + gamma, of axis rows c e . Z, of inertia rows h Z + gamma_h; Z is (rdd, omega'd)."""
    _gather(graph, rows.H, Z, out)
    gather_axes(graph, Z, 4, 8, 1.0, out)
    residuals(graph, rows, Z, out)
    for e in range(out.size):
        out[e] += gamma[e]


@kernel
def constrain_accelerations(graph, rows, gamma, Z, lam):
    """Accelerations Z and multipliers from Z = W F, with S of DYNAMICS.

    lam = S^-1 (H Z + gamma),    Z <- Z - Y^T lam
    """
    acceleration_residuals(graph, rows, gamma, Z, lam)
    solve(graph.pattern, rows.S, lam)
    apply_columns(graph, rows.Y, lam, Z)


@kernel
def factorise_and_constrain(graph, rows, gamma, Z, lam):
    """The same with S of `form_selected_rows`, which is factored; return the row that fails, or -1."""
    acceleration_residuals(graph, rows, gamma, Z, lam)
    failed = factor_and_solve(graph.pattern, rows.S, lam, PIVOT_ROUNDING)
    apply_columns(graph, rows.Y, lam, Z)
    return failed


@kernel
def balance_loads(graph, rows, F, lam):
    """Multipliers for H^T lam = F by least squares, and what they leave of F, a load of each body.

    lam = S^-1 H W F,    F <- F - H^T lam
    """
    _gather(graph, rows.Y, F, lam)
    solve(graph.pattern, rows.S, lam)
    apply_columns(graph, rows.H, lam, F)


# The chart matrix N = H C Y0, the derivative of Phi with respect to -u, and other matrices H X^T.
#
#     omega'  = C etad,       C = d0 I - d~ + d d^T / d0        X^T = C Y0
#
# At the parts of a split body N has the products with the welds, whose rows are W0 at q0 and C W0 at q.


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
        _multiply_chart_parts(graph, f.rows.H, l)
    # Dropped, inertia and axis rows: one, or minus one, on the diagonal
    for values in (l.lower, l.upper):
        set_redundant_diagonal(graph, f, values)
        leave_axes_out(graph, values)
    if factor_lu(graph.pattern, l.lower, l.upper, PIVOT_ROUNDING) >= 0:
        return False
    # A pivot that vanishes beside that of S0, as its own diagonal does: its row points the other way
    least = 1.0
    for at in graph.diagonal:
        least = min(least, abs(get(l.rows0.S, at) / get(l.upper, at)))  # reciprocals of s and n
    return least > HALF_DIGITS


@kernel
def factorise_product(graph, f, X, lower, upper):
    """Set the LU factors of H X^T at the present H, with axis and inertia rows; return True if it is nonsingular."""
    put_rows_back(graph, f.rows)
    _multiply_both(graph, f.rows.H, X, lower, upper)
    multiply_axes_both(graph, f.rows.H, X, lower, upper)
    clear_rows(graph, f.rows)
    set_redundant_diagonal(graph, f, lower)
    set_redundant_diagonal(graph, f, upper)
    raise_diagonal(graph, lower)
    raise_diagonal(graph, upper)
    return factor_lu(graph.pattern, lower, upper, PIVOT_ROUNDING) < 0


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
        if graph.products[i].same != 1:
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
def _multiply_chart_parts(graph, H, l):
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
