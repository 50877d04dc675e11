"""Products of axis rows (massless_axes.py): contributions to S, to matrices of its pattern and right-hand sides.

An axis row is zero in H, since a projection onto the constraint manifold ignores it; in Y = W H^T it is present.
"""

from ..jit.kernels import kernel
from ..jit.simd import four, get, let, put, times, total
from ..sparse.massless_axes import A_AXIS, A_SIDE, A_TARGET, AXIS_BODY, AXIS_H, AXIS_OWN, AXIS_ROW, AXIS_Y


@kernel
def weigh_axes(network, Y):
    """Axis rows of Y = W H^T."""
    axes = network.axes
    for i in range(axes.rows.shape[0]):
        put(Y, 16 * axes.rows[i, AXIS_ROW] + 4, four(axes.values[i], AXIS_Y))


@kernel
def multiply_axes(network, H, Y, values):
    """Their products with the other rows, and their own, into the blocks of the pattern."""
    axes = network.axes
    for i in range(axes.products.shape[0]):
        product, scale = axes.products[i], axes.scales[i]
        side, y = product[A_SIDE], 16 * axes.rows[product[A_AXIS], AXIS_ROW] + 4
        x = get(Y, y - 1 - side) if side < 0 else total(times(four(H, side + 4), four(Y, y)))
        let(values, product[A_TARGET], scale * x)
    for i in range(axes.rows.shape[0]):
        let(values, network.diagonal[axes.rows[i, AXIS_ROW]], axes.values[i, AXIS_OWN])


@kernel
def multiply_axes_both(network, H, X, lower, upper):
    """The same of H X^T, as `factor_lu` takes it; no body is cut."""
    multiply_axes(network, H, X, upper)
    axes = network.axes
    for i in range(axes.products.shape[0]):
        product = axes.products[i]
        h = four(axes.values[product[A_AXIS]], AXIS_H)
        let(lower, product[A_TARGET], total(times(h, four(X, product[A_SIDE] + 4))))
    for i in range(axes.rows.shape[0]):
        let(lower, network.diagonal[axes.rows[i, AXIS_ROW]], axes.values[i, AXIS_OWN])


@kernel
def leave_axes_out(network, values):
    """In place of it minus one on the diagonal: S is that of the inertias given, and their multipliers are zero."""
    axes = network.axes
    for i in range(axes.rows.shape[0]):
        let(values, network.diagonal[axes.rows[i, AXIS_ROW]], -1.0)


@kernel
def gather_axes(network, Z, out):
    """out = c e . Z of the axis rows, Z being accelerations of bodies."""
    axes = network.axes
    for i in range(axes.rows.shape[0]):
        e, b = axes.rows[i, AXIS_ROW], axes.rows[i, AXIS_BODY]
        out[e] = total(times(four(axes.values[i], AXIS_H), four(Z, 8 * b + 4)))


@kernel
def clear_axes(network, out):
    """out = 0 of the axis rows."""
    axes = network.axes
    for i in range(axes.rows.shape[0]):
        out[axes.rows[i, AXIS_ROW]] = 0.0


@kernel
def is_axis(network, values, e):
    """Whether a row that elimination has failed at, or -1, is an axis row; values are what it has left of S."""
    return e >= 0 and values[network.pattern.shape[1] + e] < 0.0
