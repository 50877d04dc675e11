"""Numeric part of the sparse factorisation: block elimination in the panels that blocks.analyse laid out.

    S = U^T D^-1 U    symmetric and positive definite, values hold U
    N = L D^-1 U      any other, without pivoting: `upper` holds U, `lower` holds L^T

D is the diagonal of U and of L; the arrays hold its reciprocals. With U = L^T both are the same, so that one pair of
kernels solves with either, and a matrix's transpose is solved by handing its arrays over in the other order. Only the
upper triangle of a diagonal block is read. After the panels comes room for the diagonal as it was before elimination,
against which pivots are judged.
"""

import math

from ._kernel import kernel


@kernel
def _keep_diagonal(pattern, values):
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    kept = values[pattern.shape[1] :]
    for j in range(heads.size):
        head, step, first = heads[j], widths[j] + 1, starts[j]
        for k in range(starts[j + 1] - first):
            kept[first + k] = values[head + k * step]


@kernel
def factor(pattern, values, limit):
    """Factor S in place; S positive definite.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry.
    """
    if pattern.shape[0] == 1:
        return _eliminate(values, 1, 1, 1, values, limit)
    starts, heads, widths, updates = pattern.starts, pattern.heads, pattern.widths, pattern.updates
    _keep_diagonal(pattern, values)
    kept = values[pattern.shape[1] :]
    for j in range(heads.size):
        first, width, panel = starts[j], widths[j], values[heads[j] :]
        size = starts[j + 1] - first
        if size == 3 and width == 6 and updates[j + 1] - updates[j] == 1:
            failed = _link(panel, values, pattern.records[6 * updates[j] :], kept[first:], limit)
            if failed >= 0:
                return first + failed
            continue
        for k in range(0, size, 3):
            u = panel[k * (width + 1) :]
            failed = _eliminate(u, size - k, width, width - k, kept[first + k :], limit)
            if failed >= 0:
                return first + k + failed
            if size - k > 3:
                out, right = u[3 * (width + 1) :], u[3:]
                _apply(u, 3, width, right, right, out, width, size - k - 3, width - k - 3, True)
        for e in range(updates[j], updates[j + 1]):
            at, rows, run, n, target, stride = _record(pattern, e)
            for k in range(0, size, 3):
                u, r = panel[k * (width + 1) :], panel[k * width :]
                _apply(u, size - k, width, r[at:], r[run:], values[target:], stride, rows, n, at == run)
    return -1


@kernel
def _record(pattern, e):
    """Which products go where: columns of a panel and how many, twice; place and row length of what they change."""
    record = pattern.records[6 * e :]
    return record[0], record[1], record[2], record[3], record[4], record[5]


@kernel
def _eliminate(u, size, width, n, kept, limit):
    """Eliminate up to three rows of a panel, n columns from the diagonal on; which of them fails, or -1."""
    u00 = u[0]
    if not limit * kept[0] < u00 < math.inf:
        return 0
    d0 = 1.0 / u00
    u[0] = d0
    if size == 1:
        return -1
    v = u[width:]
    u01 = u[1]
    f01 = u01 * d0
    u11 = v[1] - f01 * u01
    if not limit * kept[1] < u11 < math.inf:
        return 1
    d1 = 1.0 / u11
    v[1] = d1
    if size == 2:
        for x in range(2, n):
            v[x] -= f01 * u[x]
        return -1
    w = v[width:]
    u02 = u[2]
    f02 = u02 * d0
    u12 = v[2] - f01 * u02
    v[2] = u12
    f12 = u12 * d1
    u22 = w[2] - f02 * u02 - f12 * u12
    if not limit * kept[2] < u22 < math.inf:
        return 2
    w[2] = 1.0 / u22
    u, v, w = u[3:], v[3:], w[3:]
    for x in range(n - 3):
        a = u[x]
        b = v[x] - f01 * a
        v[x] = b
        w[x] -= f02 * a + f12 * b
    return -1


@kernel
def _apply(pivots, size, width, left, right, out, stride, rows, n, diagonal):
    """Subtract from out, up to three pivots: left's columns times right's rows; of a diagonal block the upper part."""
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
def _link(u, values, record, kept, limit):
    """Eliminate a 3 x 3 block that updates one other, as in a chain; which row fails, or -1."""
    stride = record[5]
    v, w = u[6:], u[12:]
    o = values[record[4] :]
    p, q = o[stride:], o[2 * stride :]
    u00, u01, u02 = u[0], u[1], u[2]
    if not limit * kept[0] < u00 < math.inf:
        return 0
    d0 = 1.0 / u00
    f01, f02 = u01 * d0, u02 * d0
    u11, u12 = v[1] - f01 * u01, v[2] - f01 * u02
    if not limit * kept[1] < u11 < math.inf:
        return 1
    d1 = 1.0 / u11
    f12 = u12 * d1
    u22 = w[2] - f02 * u02 - f12 * u12
    if not limit * kept[2] < u22 < math.inf:
        return 2
    d2 = 1.0 / u22
    a0, a1, a2 = u[3], u[4], u[5]
    b0, b1, b2 = v[3] - f01 * a0, v[4] - f01 * a1, v[5] - f01 * a2
    c0, c1, c2 = w[3] - f02 * a0 - f12 * b0, w[4] - f02 * a1 - f12 * b1, w[5] - f02 * a2 - f12 * b2
    u[0], v[1], v[2], w[2] = d0, d1, u12, d2
    v[3], v[4], v[5] = b0, b1, b2
    w[3], w[4], w[5] = c0, c1, c2
    x, y, z = a0 * d0, b0 * d1, c0 * d2
    o[0] -= x * a0 + y * b0 + z * c0
    o[1] -= x * a1 + y * b1 + z * c1
    o[2] -= x * a2 + y * b2 + z * c2
    x, y, z = a1 * d0, b1 * d1, c1 * d2
    p[1] -= x * a1 + y * b1 + z * c1
    p[2] -= x * a2 + y * b2 + z * c2
    x, y, z = a2 * d0, b2 * d1, c2 * d2
    q[2] -= x * a2 + y * b2 + z * c2
    return -1


@kernel
def factor_lu(pattern, lower, upper, limit):
    """Factor N in place, without pivoting.

    Returns -1, or the row of the eliminated vector where elimination leaves less than `limit` of a diagonal entry's
    size, or a number that is not finite.
    """
    if pattern.shape[0] == 1:
        return _eliminate_lu(lower, upper, 1, 1, 1, upper, limit)
    starts, heads, widths, updates = pattern.starts, pattern.heads, pattern.widths, pattern.updates
    _keep_diagonal(pattern, upper)
    kept = upper[pattern.shape[1] :]
    for j in range(heads.size):
        first, width, below, above = starts[j], widths[j], lower[heads[j] :], upper[heads[j] :]
        size = starts[j + 1] - first
        if size == 3 and width == 6 and updates[j + 1] - updates[j] == 1:
            failed = _link_lu(below, above, lower, upper, pattern.records[6 * updates[j] :], kept[first:], limit)
            if failed >= 0:
                return first + failed
            continue
        for k in range(0, size, 3):
            l, u = below[k * (width + 1) :], above[k * (width + 1) :]
            failed = _eliminate_lu(l, u, size - k, width, width - k, kept[first + k :], limit)
            if failed >= 0:
                return first + k + failed
            if size - k > 3:
                left, right, corner = l[3:], u[3:], 3 * (width + 1)
                out, other = u[corner:], l[corner:]
                for _ in range(2):
                    _apply(u, 3, width, left, right, out, width, size - k - 3, width - k - 3, True)
                    left, right, out = right, left, other
        for e in range(updates[j], updates[j + 1]):
            at, rows, run, n, target, stride = _record(pattern, e)
            left, right, out = below, above, upper[target:]
            for _ in range(2):
                for k in range(0, size, 3):
                    u, l, r = above[k * (width + 1) :], left[k * width + at :], right[k * width + run :]
                    _apply(u, size - k, width, l, r, out, stride, rows, n, at == run)
                left, right, out = above, below, lower[target:]
    return -1


@kernel
def _eliminate_lu(l, u, size, width, n, kept, limit):
    """Eliminate up to three rows of upper and columns of lower; which of them fails, or -1."""
    u00 = u[0]
    if not limit * abs(kept[0]) < abs(u00) < math.inf:
        return 0
    d0 = 1.0 / u00
    u[0] = l[0] = d0
    if size == 1:
        return -1
    v, m = u[width:], l[width:]
    u01, l01 = u[1], l[1]
    f01, g01 = l01 * d0, u01 * d0
    u11 = v[1] - f01 * u01
    if not limit * abs(kept[1]) < abs(u11) < math.inf:
        return 1
    d1 = 1.0 / u11
    v[1] = m[1] = d1
    if size == 2:
        for x in range(2, n):
            v[x] -= f01 * u[x]
            m[x] -= g01 * l[x]
        return -1
    w, o = v[width:], m[width:]
    u02, l02 = u[2], l[2]
    f02, g02 = l02 * d0, u02 * d0
    u12, l12 = v[2] - f01 * u02, m[2] - g01 * l02
    v[2], m[2] = u12, l12
    f12, g12 = l12 * d1, u12 * d1
    u22 = w[2] - f02 * u02 - f12 * u12
    if not limit * abs(kept[2]) < abs(u22) < math.inf:
        return 2
    w[2] = o[2] = 1.0 / u22
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
def _link_lu(l, u, lower, upper, record, kept, limit):
    """Eliminate a 3 x 3 block that updates one other, as in a chain; which row fails, or -1."""
    target, stride = record[4], record[5]
    v, w, m, n = u[6:], u[12:], l[6:], l[12:]
    u00, u01, u02, l01, l02 = u[0], u[1], u[2], l[1], l[2]
    if not limit * abs(kept[0]) < abs(u00) < math.inf:
        return 0
    d0 = 1.0 / u00
    f01, f02, g01, g02 = l01 * d0, l02 * d0, u01 * d0, u02 * d0
    u11, u12, l12 = v[1] - f01 * u01, v[2] - f01 * u02, m[2] - g01 * l02
    if not limit * abs(kept[1]) < abs(u11) < math.inf:
        return 1
    d1 = 1.0 / u11
    f12, g12 = l12 * d1, u12 * d1
    u22 = w[2] - f02 * u02 - f12 * u12
    if not limit * abs(kept[2]) < abs(u22) < math.inf:
        return 2
    d2 = 1.0 / u22
    u[0], v[1], v[2], w[2] = d0, d1, u12, d2
    l[0], m[1], m[2], n[2] = d0, d1, l12, d2
    a0, a1, a2 = u[3], u[4], u[5]
    b0, b1, b2 = v[3] - f01 * a0, v[4] - f01 * a1, v[5] - f01 * a2
    c0, c1, c2 = w[3] - f02 * a0 - f12 * b0, w[4] - f02 * a1 - f12 * b1, w[5] - f02 * a2 - f12 * b2
    v[3], v[4], v[5] = b0, b1, b2
    w[3], w[4], w[5] = c0, c1, c2
    x0, x1, x2 = l[3], l[4], l[5]
    y0, y1, y2 = m[3] - g01 * x0, m[4] - g01 * x1, m[5] - g01 * x2
    z0, z1, z2 = n[3] - g02 * x0 - g12 * y0, n[4] - g02 * x1 - g12 * y1, n[5] - g02 * x2 - g12 * y2
    m[3], m[4], m[5] = y0, y1, y2
    n[3], n[4], n[5] = z0, z1, z2
    a0, a1, a2 = a0 * d0, a1 * d0, a2 * d0
    b0, b1, b2 = b0 * d1, b1 * d1, b2 * d1
    c0, c1, c2 = c0 * d2, c1 * d2, c2 * d2
    o = upper[target:]
    p, q = o[stride:], o[2 * stride :]
    o[0] -= x0 * a0 + y0 * b0 + z0 * c0
    o[1] -= x0 * a1 + y0 * b1 + z0 * c1
    o[2] -= x0 * a2 + y0 * b2 + z0 * c2
    p[1] -= x1 * a1 + y1 * b1 + z1 * c1
    p[2] -= x1 * a2 + y1 * b2 + z1 * c2
    q[2] -= x2 * a2 + y2 * b2 + z2 * c2
    o = lower[target:]
    p = o[stride:]
    o[1] -= x1 * a0 + y1 * b0 + z1 * c0
    o[2] -= x2 * a0 + y2 * b0 + z2 * c0
    p[2] -= x2 * a1 + y2 * b1 + z2 * c1
    return -1


@kernel
def solve(pattern, values, b):
    """Solve S x = b in place, b (rows,) in the eliminated order, with what `factor` left."""
    solve_lu(pattern, values, values, b)


@kernel
def solve_lu_transposed(pattern, lower, upper, b):
    """Solve N^T x = b in place, with what `factor_lu` left."""
    solve_lu(pattern, upper, lower, b)


@kernel
def solve_lu(pattern, lower, upper, b):
    """Solve N x = b in place, b (rows,) in the eliminated order, with what `factor_lu` left."""
    if pattern.shape[0] == 1:
        b[0] *= lower[0]
        return
    starts, heads, widths = pattern.starts, pattern.heads, pattern.widths
    columns, segments = pattern.columns, pattern.segments
    for j in range(heads.size):
        first, width, head = starts[j], widths[j], heads[j]
        size, own, u = starts[j + 1] - first, b[first:], lower[head:]
        one = columns[j + 1] - columns[j] == 1
        while True:
            _forward(size, width, u, own)
            if one and width == 6 and size == 3:
                v, w, out = u[6:], u[12:], b[segments[2 * columns[j]] :]
                x, y, z = own[0], own[1], own[2]
                out[0] -= x * u[3] + y * v[3] + z * w[3]
                out[1] -= x * u[4] + y * v[4] + z * w[4]
                out[2] -= x * u[5] + y * v[5] + z * w[5]
                break
            _forward_rest(size, width, u, own, b, columns[j], columns[j + 1], segments)
            if size <= 3:
                break
            u, own, size = u[3 * (width + 1) :], own[3:], size - 3
    for j in range(heads.size - 1, -1, -1):
        first, width, head = starts[j], widths[j], heads[j]
        size = starts[j + 1] - first
        one = columns[j + 1] - columns[j] == 1
        k = (size - 1) // 3 * 3
        while k >= 0:
            own, u = b[first + k :], upper[head + k * (width + 1) :]
            if one and width == 6 and size == 3:
                v, w, out = u[6:], u[12:], b[segments[2 * columns[j]] :]
                e, f, g = out[0], out[1], out[2]
                x, y, z = (
                    e * u[3] + f * u[4] + g * u[5],
                    e * v[3] + f * v[4] + g * v[5],
                    e * w[3] + f * w[4] + g * w[5],
                )
            else:
                x, y, z = _backward_rest(size - k, width, u, own, b, columns[j], columns[j + 1], segments)
            _backward(size - k, width, u, own, x, y, z)
            k -= 3


@kernel
def _forward(size, width, u, own):
    x = own[0] * u[0]
    own[0] = x
    if size > 1:
        v = u[width:]
        y = (own[1] - x * u[1]) * v[1]
        own[1] = y
        if size > 2:
            w = v[width:]
            own[2] = (own[2] - x * u[2] - y * v[2]) * w[2]


@kernel
def _forward_rest(size, width, u, own, b, here, end, segments):
    """Take up to three unknowns from the rows after them."""
    if size == 1:
        x = own[0]
        at = 1
        for e in range(here, end):
            out, n, us = b[segments[2 * e] :], segments[2 * e + 1], u[at:]
            for i in range(n):
                out[i] -= x * us[i]
            at += n
    elif size == 2:
        x, y = own[0], own[1]
        v = u[width:]
        at = 2
        for e in range(here, end):
            out, n, us, vs = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:]
            for i in range(n):
                out[i] -= x * us[i] + y * vs[i]
            at += n
    else:
        x, y, z = own[0], own[1], own[2]
        v, w = u[width:], u[2 * width :]
        for i in range(3, size):
            own[i] -= x * u[i] + y * v[i] + z * w[i]
        at = size
        for e in range(here, end):
            out, n, us, vs, ws = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:], w[at:]
            for i in range(n):
                out[i] -= x * us[i] + y * vs[i] + z * ws[i]
            at += n


@kernel
def _backward(size, width, u, own, x, y, z):
    if size > 1:
        v = u[width:]
        if size > 2:
            w = v[width:]
            z = own[2] - w[2] * z
            own[2] = z
            x += u[2] * z
            y += v[2] * z
        y = own[1] - v[1] * y
        own[1] = y
        x += u[1] * y
    own[0] -= u[0] * x


@kernel
def _backward_rest(size, width, u, own, b, here, end, segments):
    """What the rows after them give to up to three unknowns."""
    x, y, z = 0.0, 0.0, 0.0
    if size == 1:
        at = 1
        for e in range(here, end):
            source, n, us = b[segments[2 * e] :], segments[2 * e + 1], u[at:]
            for i in range(n):
                x += us[i] * source[i]
            at += n
    elif size == 2:
        v = u[width:]
        at = 2
        for e in range(here, end):
            source, n, us, vs = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:]
            for i in range(n):
                x += us[i] * source[i]
                y += vs[i] * source[i]
            at += n
    else:
        v, w = u[width:], u[2 * width :]
        for i in range(3, size):
            x += u[i] * own[i]
            y += v[i] * own[i]
            z += w[i] * own[i]
        at = size
        for e in range(here, end):
            source, n, us, vs, ws = b[segments[2 * e] :], segments[2 * e + 1], u[at:], v[at:], w[at:]
            for i in range(n):
                x += us[i] * source[i]
                y += vs[i] * source[i]
                z += ws[i] * source[i]
            at += n
    return x, y, z
