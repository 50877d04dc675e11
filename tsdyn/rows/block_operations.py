"""Elementary operations of block elimination in local scalars: up to three pivots at a time, and whole links of chains.

An operation works on rows of a panel (see symbolic.py), `width` floats apart, from the first pivot on: in u, and for an
unsymmetric matrix also in l, transposed. It stores the reciprocals of the pivots and returns the index of the pivot
that failed, or -1. `kept` holds the diagonal before elimination; its sign is the sign that the pivot must have.
"""

import math

from ..jit.kernels import kernel
from ..jit.predicates import serves
from ..jit.simd import get, let


@kernel
def eliminate(u, size, width, n, kept, limit):
    """Eliminate up to three rows of a panel, n columns from the diagonal on; which of them fails, or -1."""
    # First pivot
    u00 = u[0]
    if not serves(kept[0], u00, limit):
        return 0
    d0 = 1.0 / u00
    u[0] = d0
    if size == 1:
        return -1
    v = u[width:]
    # Second pivot: u11 - u01^2 / u00
    u01 = u[1]
    f01 = u01 * d0
    u11 = v[1] - f01 * u01
    if not serves(kept[1], u11, limit):
        return 1
    d1 = 1.0 / u11
    v[1] = d1
    # Two rows: the rest of the second
    if size == 2:
        for x in range(2, n):
            v[x] -= f01 * u[x]
        return -1
    w = v[width:]
    # Third pivot, after both rows above it
    u02 = u[2]
    f02 = u02 * d0
    u12 = v[2] - f01 * u02
    v[2] = u12
    f12 = u12 * d1
    u22 = w[2] - f02 * u02 - f12 * u12
    if not serves(kept[2], u22, limit):
        return 2
    w[2] = 1.0 / u22
    # The rest of the rows, to the right of the pivots
    u, v, w = u[3:], v[3:], w[3:]
    for x in range(n - 3):
        a = u[x]
        b = v[x] - f01 * a
        v[x] = b
        w[x] -= f02 * a + f12 * b
    return -1


@kernel
def subtract_products(pivots, size, width, left, right, out, stride, rows, n, diagonal):
    """Subtract from out, up to three pivots: left's columns times right's rows; of a diagonal block the upper part.

    Ten arguments: where the pivots, both factors and the result are, and how many rows and columns they have.
    """
    # out -= left^T D^-1 right, three rows of it at a time: three pivots times three rows fill the registers
    if size >= 3:
        d0, d1, d2 = pivots[0], pivots[width + 1], pivots[2 * width + 2]
        a, b, c = left, left[width:], left[2 * width :]
        u, v, w = right, right[width:], right[2 * width :]
        r = 0
        while r + 3 <= rows:
            skip = r if diagonal else 0
            x0, x1, x2 = a[r] * d0, b[r] * d1, c[r] * d2
            y0, y1, y2 = a[r + 1] * d0, b[r + 1] * d1, c[r + 1] * d2
            z0, z1, z2 = a[r + 2] * d0, b[r + 2] * d1, c[r + 2] * d2
            o = out[r * stride + skip :]
            p, q = o[stride:], o[2 * stride :]
            us, vs, ws = u[skip:], v[skip:], w[skip:]
            for x in range(n - skip):
                e, f, g = us[x], vs[x], ws[x]
                o[x] -= x0 * e + x1 * f + x2 * g
                p[x] -= y0 * e + y1 * f + y2 * g
                q[x] -= z0 * e + z1 * f + z2 * g
            r += 3
        # The rows that are left over
        while r < rows:
            skip = r if diagonal else 0
            x0, x1, x2 = a[r] * d0, b[r] * d1, c[r] * d2
            o = out[r * stride + skip :]
            us, vs, ws = u[skip:], v[skip:], w[skip:]
            for x in range(n - skip):
                o[x] -= x0 * us[x] + x1 * vs[x] + x2 * ws[x]
            r += 1
    elif size == 2:
        d0, d1 = pivots[0], pivots[width + 1]
        b, v = left[width:], right[width:]
        for r in range(rows):
            skip = r if diagonal else 0
            x0, x1 = left[r] * d0, b[r] * d1
            o, us, vs = out[r * stride + skip :], right[skip:], v[skip:]
            for x in range(n - skip):
                o[x] -= x0 * us[x] + x1 * vs[x]
    else:
        d0 = pivots[0]
        for r in range(rows):
            skip = r if diagonal else 0
            x0 = left[r] * d0
            o, us = out[r * stride + skip :], right[skip:]
            for x in range(n - skip):
                o[x] -= x0 * us[x]


@kernel
def link(values, u, target, stride, kept, limit):
    """Eliminate a 3 x 3 block at values[u] that updates one other, as in a chain; which row fails, or -1.

    The other is at values[target], rows `stride` apart; the diagonal before elimination is at values[kept].
    """
    v, w, p, q = u + 6, u + 12, target + stride, target + 2 * stride
    # Three pivots, as in `eliminate`
    k0, k1, k2 = get(values, kept), get(values, kept + 1), get(values, kept + 2)
    u00, u01, u02 = get(values, u), get(values, u + 1), get(values, u + 2)
    if not serves(k0, u00, limit):
        return 0
    d0 = 1.0 / u00
    f01, f02 = u01 * d0, u02 * d0
    u11, u12 = get(values, v + 1) - f01 * u01, get(values, v + 2) - f01 * u02
    if not serves(k1, u11, limit):
        return 1
    d1 = 1.0 / u11
    f12 = u12 * d1
    u22 = get(values, w + 2) - f02 * u02 - f12 * u12
    if not serves(k2, u22, limit):
        return 2
    d2 = 1.0 / u22
    # D^-1 and U of the block
    _store_pivots(values, u, d0, d1, u12, d2)
    # The 3 x 3 block beside it
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = _rest_of_link(values, u, f01, f02, f12)
    # Upper triangle of the other block -= (a, b, c)^T D^-1 (a, b, c)
    x, y, z = a0 * d0, b0 * d1, c0 * d2
    _take(values, target, x * a0 + y * b0 + z * c0)
    _take(values, target + 1, x * a1 + y * b1 + z * c1)
    _take(values, target + 2, x * a2 + y * b2 + z * c2)
    x, y, z = a1 * d0, b1 * d1, c1 * d2
    _take(values, p + 1, x * a1 + y * b1 + z * c1)
    _take(values, p + 2, x * a2 + y * b2 + z * c2)
    x, y, z = a2 * d0, b2 * d1, c2 * d2
    _take(values, q + 2, x * a2 + y * b2 + z * c2)
    return -1


@kernel
def _store(values, i, x, y, z):
    let(values, i, x)
    let(values, i + 1, y)
    let(values, i + 2, z)


@kernel
def _store_pivots(values, u, d0, d1, beside, d2):
    """The reciprocal pivots of the block at values[u], and what is beside the second."""
    let(values, u, d0)
    let(values, u + 7, d1)
    let(values, u + 8, beside)
    let(values, u + 14, d2)


@kernel
def _take(values, i, x):
    let(values, i, get(values, i) - x)


@kernel
def eliminate_lu(l, u, size, width, n, kept, limit):
    """Eliminate up to three rows of upper and columns of lower; which of them fails, or -1."""
    # f are multipliers of L, g those of U, both over the pivots
    u00 = u[0]
    if not limit * abs(kept[0]) < abs(u00) < math.inf:
        return 0
    d0 = 1.0 / u00
    u[0] = l[0] = d0
    if size == 1:
        return -1
    v, m = u[width:], l[width:]
    # Second pivot
    u01, l01 = u[1], l[1]
    f01, g01 = l01 * d0, u01 * d0
    u11 = v[1] - f01 * u01
    if not limit * abs(kept[1]) < abs(u11) < math.inf:
        return 1
    d1 = 1.0 / u11
    v[1] = m[1] = d1
    # Two rows: the rest of the second
    if size == 2:
        for x in range(2, n):
            v[x] -= f01 * u[x]
            m[x] -= g01 * l[x]
        return -1
    w, o = v[width:], m[width:]
    # Third pivot
    u02, l02 = u[2], l[2]
    f02, g02 = l02 * d0, u02 * d0
    u12, l12 = v[2] - f01 * u02, m[2] - g01 * l02
    v[2], m[2] = u12, l12
    f12, g12 = l12 * d1, u12 * d1
    u22 = w[2] - f02 * u02 - f12 * u12
    if not limit * abs(kept[2]) < abs(u22) < math.inf:
        return 2
    w[2] = o[2] = 1.0 / u22
    # The rest of the rows of U and of the columns of L
    u, v, w = u[3:], v[3:], w[3:]
    l, m, o = l[3:], m[3:], o[3:]
    for x in range(n - 3):
        a, b = u[x], l[x]
        c, d = v[x] - f01 * a, m[x] - g01 * b
        v[x], m[x] = c, d
        w[x] -= f02 * a + f12 * c
        o[x] -= g02 * b + g12 * d
    return -1


@kernel
def link_lu(lower, upper, u, target, stride, kept, limit):
    """The same of an unsymmetric matrix; the diagonal before elimination is at upper[kept]."""
    v, w, p, q = u + 6, u + 12, target + stride, target + 2 * stride
    # Three pivots, as in `eliminate_lu`
    u00, u01, u02, l01, l02 = get(upper, u), get(upper, u + 1), get(upper, u + 2), get(lower, u + 1), get(lower, u + 2)
    if not limit * abs(get(upper, kept)) < abs(u00) < math.inf:
        return 0
    d0 = 1.0 / u00
    f01, f02, g01, g02 = l01 * d0, l02 * d0, u01 * d0, u02 * d0
    u11, u12 = get(upper, v + 1) - f01 * u01, get(upper, v + 2) - f01 * u02
    l12 = get(lower, v + 2) - g01 * l02
    if not limit * abs(get(upper, kept + 1)) < abs(u11) < math.inf:
        return 1
    d1 = 1.0 / u11
    f12, g12 = l12 * d1, u12 * d1
    u22 = get(upper, w + 2) - f02 * u02 - f12 * u12
    if not limit * abs(get(upper, kept + 2)) < abs(u22) < math.inf:
        return 2
    d2 = 1.0 / u22
    # D^-1, U and L of the block
    _store_pivots(upper, u, d0, d1, u12, d2)
    _store_pivots(lower, u, d0, d1, l12, d2)
    # The 3 x 3 blocks beside and below it
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = _rest_of_link(upper, u, f01, f02, f12)
    x0, x1, x2, y0, y1, y2, z0, z1, z2 = _rest_of_link(lower, u, g01, g02, g12)
    # Upper triangle, then lower triangle, of the other block -= L D^-1 U
    a0, a1, a2 = a0 * d0, a1 * d0, a2 * d0
    b0, b1, b2 = b0 * d1, b1 * d1, b2 * d1
    c0, c1, c2 = c0 * d2, c1 * d2, c2 * d2
    _take(upper, target, x0 * a0 + y0 * b0 + z0 * c0)
    _take(upper, target + 1, x0 * a1 + y0 * b1 + z0 * c1)
    _take(upper, target + 2, x0 * a2 + y0 * b2 + z0 * c2)
    _take(upper, p + 1, x1 * a1 + y1 * b1 + z1 * c1)
    _take(upper, p + 2, x1 * a2 + y1 * b2 + z1 * c2)
    _take(upper, q + 2, x2 * a2 + y2 * b2 + z2 * c2)
    _take(lower, target + 1, x1 * a0 + y1 * b0 + z1 * c0)
    _take(lower, target + 2, x2 * a0 + y2 * b0 + z2 * c0)
    _take(lower, p + 2, x2 * a1 + y2 * b1 + z2 * c1)
    return -1


@kernel
def _rest_of_link(values, u, f01, f02, f12):
    """The columns beside the block at values[u], eliminated: three rows."""
    v, w = u + 6, u + 12
    # Rows a, b, c, each less its multiples of those before
    a0, a1, a2 = get(values, u + 3), get(values, u + 4), get(values, u + 5)
    b0, b1, b2 = get(values, v + 3) - f01 * a0, get(values, v + 4) - f01 * a1, get(values, v + 5) - f01 * a2
    c0 = get(values, w + 3) - f02 * a0 - f12 * b0
    c1 = get(values, w + 4) - f02 * a1 - f12 * b1
    c2 = get(values, w + 5) - f02 * a2 - f12 * b2
    _store(values, v + 3, b0, b1, b2)
    _store(values, w + 3, c0, c1, c2)
    return a0, a1, a2, b0, b1, b2, c0, c1, c2
