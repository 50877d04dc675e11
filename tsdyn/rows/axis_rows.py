"""Products of axis rows (massless_axes.py): contributions to S, to matrices of its pattern and right-hand sides.

An axis row is zero in H, since a projection onto the constraint manifold ignores it; in Y = W H^T it is present.
"""

from ..jit.kernels import kernel
from ..jit.simd import four, get, let, put, times, total
from ..sparse.massless_axes import AXIS_H, AXIS_OWN, AXIS_Y


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
    """Replace axis rows by minus one on the diagonal: S for the given inertias, with zero multipliers of axis rows."""
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        let(values, graph.diagonal[axes.rows[i].row], -1.0)


@kernel
def gather_axes(graph, values, at, stride, scale, out):
    """out = scale c e . z of the axis rows, z at values[at + stride * b] being of body b."""
    axes = graph.axes
    for i in range(axes.rows.shape[0]):
        # c e . omega'd
        e, b = axes.rows[i].row, axes.rows[i].body
        out[e] = scale * total(times(four(axes.values[i], AXIS_H), four(values, at + stride * b)))


@kernel
def add_axis_multipliers(graph, lam, out):
    """out += lam of the axis rows: the second term of c e . omega'd + lam_e."""
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
