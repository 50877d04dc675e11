"""The Schur complement S = H W H^T (Delassus operator) of the constraint rows H = [Phi_r, Phi_pi'], and products by H.

Body quantities are rows of eight floats, (linear, 0, angular in the body frame, 0); the last row is the ground's.
"""

from ..jit.kernels import kernel
from ..jit.simd import add, fma, four, get, let, put, splat, times, total
from ..sparse.constraint_graph import (
    H_BODY,
    H_COLUMNS,
    H_KIND,
    H_LEFT,
    H_RIGHT,
    H_ROWS,
    H_STRIDE,
    H_TARGET,
    P_COLUMNS,
    P_LEFT,
    P_RIGHT,
    P_ROWS,
    P_SAME,
    P_STRIDE,
    P_TARGET,
    ROWS,
    ROWS_WELD,
    W_MASS,
    W_ROTATION,
    WEIGHTS,
    WELD_ROWS,
)


@kernel
def weigh(weights, at, values, i, out, o):
    """out[o : o + 8] = the weights of one body, 1 / m and J'^-1 or m and J', times values[i : i + 8]."""
    w = at * WEIGHTS
    f = times(four(weights, w + W_ROTATION), splat(values[i + 4]))
    f = fma(four(weights, w + W_ROTATION + 4), splat(values[i + 5]), f)
    f = fma(four(weights, w + W_ROTATION + 8), splat(values[i + 6]), f)
    put(out, o, times(four(values, i), splat(weights[w + W_MASS])))
    put(out, o + 4, f)


@kernel
def weigh_rows(network, H, Y):
    """Y = W H^T, side by side."""
    for e in range(network.sides.shape[0]):
        for k in range(2):
            at = 16 * e + 8 * k
            weigh(network.inverse, network.sides[e, k], H, at, Y, at)


@kernel
def inner(H, h, Y, y):
    """The product of two rows at one body."""
    return total(fma(four(H, h), four(Y, y), times(four(H, h + 4), four(Y, y + 4))))


@kernel
def _inner_both(H, h, Y, y):
    """The product of two rows at both bodies."""
    f = fma(four(H, h), four(Y, y), times(four(H, h + 4), four(Y, y + 4)))
    g = fma(four(H, h + 8), four(Y, y + 8), times(four(H, h + 12), four(Y, y + 12)))
    return total(add(f, g))


@kernel
def more(values, at, x):
    """values[at] += x."""
    let(values, at, get(values, at) + x)


@kernel
def multiply_rows(network, H, Y, values):
    """The upper triangle of H Y^T, Y = W H^T, into the blocks of the pattern, with zeros where elimination fills in."""
    products = network.products
    for i in range(network.pattern.shape[1]):
        let(values, i, 0.0)
    for i in range(products.shape[0]):
        product = products[i]
        left, right = get(product, P_LEFT), get(product, P_RIGHT)
        target, stride = get(product, P_TARGET), get(product, P_STRIDE)
        rows, columns = get(product, P_ROWS), get(product, P_COLUMNS)
        if get(product, P_SAME) != 0:
            for r in range(rows):
                for c in range(r, columns):
                    more(values, target + c, _inner_both(H, left + 16 * r, Y, right + 16 * c))
                target += stride
        else:
            for r in range(rows):
                for c in range(columns):
                    more(values, target + c, inner(H, left + 16 * r, Y, right + 16 * c))
                target += stride
    if network.parts.shape[0] > 0:
        _multiply_parts(network, H, Y, values)


@kernel
def _multiply_parts(network, H, Y, values):
    """The products at the parts of hubs."""
    for i in range(network.parts.shape[0]):
        part, scale = network.parts[i], network.scales[i]
        left, rows, right, columns = part[H_LEFT], part[H_ROWS], part[H_RIGHT], part[H_COLUMNS]
        target, stride, kind, weights = part[H_TARGET], part[H_STRIDE], part[H_KIND], WEIGHTS * part[H_BODY]
        for r in range(rows):
            for c in range(columns):
                if kind == ROWS:
                    if left != right or c >= r:
                        more(values, target + r * stride + c, scale * inner(H, left + 16 * r, Y, right + 16 * c))
                elif kind == ROWS_WELD:
                    more(values, target + r * stride + c, scale * get(Y, left + 16 * r + c + c // 3))
                elif kind == WELD_ROWS:
                    more(values, target + c * stride + r, scale * get(Y, left + 16 * r + c + c // 3))
                elif r < 3 and r == c:
                    more(values, target + r * stride + c, scale * get(network.inverse, weights + W_MASS))
                elif r >= 3 and c >= 3:
                    w = get(network.inverse, weights + W_ROTATION + 4 * (c - 3) + r - 3)
                    more(values, target + r * stride + c, scale * w)


@kernel
def multiply_both(network, H, X, lower, upper):
    """H X^T into the blocks of the pattern, as `factor_lu` takes it: its upper triangle, its lower one transposed."""
    products = network.products
    for i in range(network.pattern.shape[1]):
        let(upper, i, 0.0)
        let(lower, i, 0.0)
    for i in range(products.shape[0]):
        product = products[i]
        left, right = get(product, P_LEFT), get(product, P_RIGHT)
        target, stride = get(product, P_TARGET), get(product, P_STRIDE)
        rows, columns = get(product, P_ROWS), get(product, P_COLUMNS)
        if get(product, P_SAME) != 0:
            for r in range(rows):
                more(upper, target + r, _inner_both(H, left + 16 * r, X, right + 16 * r))
                for c in range(r + 1, columns):
                    more(upper, target + c, _inner_both(H, left + 16 * r, X, right + 16 * c))
                    more(lower, target + c, _inner_both(H, right + 16 * c, X, left + 16 * r))
                target += stride
        else:
            for r in range(rows):
                for c in range(columns):
                    more(upper, target + c, inner(H, left + 16 * r, X, right + 16 * c))
                    more(lower, target + c, inner(H, right + 16 * c, X, left + 16 * r))
                target += stride


@kernel
def gather(network, H, Z, out):
    """out = H Z."""
    for e in range(network.sides.shape[0]):
        at, a, b = 16 * e, 8 * network.sides[e, 0], 8 * network.sides[e, 1]
        f = fma(four(H, at), four(Z, a), times(four(H, at + 4), four(Z, a + 4)))
        g = fma(four(H, at + 8), four(Z, b), times(four(H, at + 12), four(Z, b + 4)))
        out[e] = total(add(f, g))


@kernel
def scatter(network, Y, lam, Z):
    """Z -= Y^T lam."""
    for e in range(network.sides.shape[0]):
        f = splat(-lam[e])
        for k in range(2):
            at, z = 16 * e + 8 * k, 8 * network.sides[e, k]
            put(Z, z, fma(four(Y, at), f, four(Z, z)))
            put(Z, z + 4, fma(four(Y, at + 4), f, four(Z, z + 4)))
