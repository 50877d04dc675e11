"""Taylor series of constraints: one loop a kind over all its instances, order by order.

The kernel `series` of a primitive gives the series of Phi_x from that of x; the rest is common to all primitives:

    x_k             = r_k + A_k s                        markers
    (Phi_x)_k       by the primitive's kernel `series`
    k Phi_k         = sum_j j (Phi_x)_{k-j} x_j          d/dt Phi = Phi_x xd                         (1)
    f_k             = - sum_j (Phi_x)_j^T lam_{k-j}      force on a marker                           (2)
    tau'_k          = s x sum_j A_j^T f_{k-j}            its torque about the centroid, body frame   (3)

Series are stored order by order. The series of a body holds A (by columns, 4 floats each), omega', r, J' omega' (4
each). An instance starts with order zero of x (4 a marker) and Phi_x (4 a row and marker), followed by the series f (4
a marker), lam (1 a row), x and Phi_x, and its scratch. A marker with constant columns of Phi_x, such as every marker of
Spherical, drops out of (1) beyond order zero and out of (2); a marker on the ground has no force. If all markers of a
kind are of these sorts, an instance ends with f.

A prescribed quantity (a length that is a motion) adds the coefficients of Phi_t to (1), by the kernel `series_t`. The
series of the motions are the last rows of the scratch, written at the start of a step.
"""

from typing import NamedTuple

import numpy as np

from ...jit.kernels import ANY, caller, data_of, integers, kernel, matrix, part, stack, stack2, vector
from ...jit.simd import add, cross, fetch, fma, four, get, lanes, let, put, splat, times, total
from ..markers import POINT
from .constraint_rows import INTS, MASK, ROW, pose_of, turned
from .template import (
    AHEAD,
    CODES,
    DRIVEN,
    MARKERS,
    OWNERS,
    ROOM,
    ROWS,
    SIZE,
    SLOTS,
    STARTS,
    SUMMED,
    extent,
    kernel_series,
    kernel_series_t,
)

# where the parts of a body's series begin, times the number of orders; floats of an order of all of them
S_OMEGA, S_R, S_SPIN, BODY_ROW = 12, 16, 20, 24
SIGNATURE = "iippppppp"  # mode, k, extent, table, reals, bodies, values, b, Z
call_series = caller(SIGNATURE)
ADVANCE, RESIDUAL = range(2)
# bits of the mask: from 0 on the markers whose columns vary, from 16 on those that are on the ground or on other bodies
# than a and b, from 32 on those whose body has no use for a torque
GROUND, UNTURNED = 16, 32


class Instance(NamedTuple):
    """An instance of a primitive, and the arrays that it is in."""

    orders: int  # that there is room for
    table: np.ndarray
    own: int  # where its entry of the table begins
    reals: np.ndarray
    real: int  # where its numbers begin
    bodies: np.ndarray  # series of the bodies
    values: np.ndarray
    at: int  # where its own series begin


def instance_width(markers, rows, slots, orders, varies, driven=False):
    """Floats of an instance; whether any column of Phi_x of the kind varies, or it has scratch memory."""
    if not (varies or slots or driven):
        return scratch_at(markers, rows, orders, False)
    room = slots * orders + (rows if driven else 0)
    return scratch_at(markers, rows, orders, True) + 4 * ((room + 3) // 4)


def scratch_at(markers, rows, orders, varies):
    """Where the scratch of an instance begins."""
    width = 4 * markers * (1 + rows) + 4 * markers * orders
    return width + (4 * ((rows * orders + 3) // 4) + 4 * (markers + markers * rows) * orders if varies else 0)


def force_at(marker, markers, rows, orders):
    """Where the series f of a marker begins in an instance."""
    return 4 * markers * (1 + rows) + 4 * marker * orders


@kernel
def torque(bodies, at, k, forces, first):
    """sum_j A_j^T f_{k-j}; A_0 is at bodies[at], f_0 at forces[first]."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    u, v, w = splat(0.0), splat(0.0), splat(0.0)
    c, f = at, first + 4 * k
    # sum_j A_j^T f_{k-j}
    for _ in range((k + 1) // 2):  # two at a time, on accumulators of their own: each waits for its last sum
        g, h = four(forces, f), four(forces, f - 4)
        x, u = fma(four(bodies, c), g, x), fma(four(bodies, c + 12), h, u)
        y, v = fma(four(bodies, c + 4), g, y), fma(four(bodies, c + 16), h, v)
        z, w = fma(four(bodies, c + 8), g, z), fma(four(bodies, c + 20), h, w)
        c += 24
        f -= 8
    if k % 2 == 0:
        g = four(forces, first)
        x = fma(four(bodies, c), g, x)
        y = fma(four(bodies, c + 4), g, y)
        z = fma(four(bodies, c + 8), g, z)
    return lanes(total(add(x, u)), total(add(y, v)), total(add(z, w)))


@part
def offsets(orders):
    """Where the series f, lam, x, Phi_x and the scratch of an instance begin."""
    wide = 4 * orders
    F = 4 * MARKERS * (1 + ROWS)
    L = F + MARKERS * wide
    X = L + 4 * ((ROWS * orders + 3) // 4)
    return F, L, X, X + MARKERS * wide, X + MARKERS * (1 + ROWS) * wide


@part
def _marker_coefficient(j, k, one):
    """Coefficient k of x of a marker."""
    orders, table, own, reals, real, bodies, _, _ = one
    body, s = pose_of(table, own, reals, real, OWNERS[j]) * BODY_ROW * orders, real + 3 * j
    x = turned(bodies, body + 12 * k, get(reals, s), get(reals, s + 1), get(reals, s + 2))
    return add(x, four(bodies, body + S_R * orders + 4 * k)) if CODES[j] == POINT else x


@part
def _fetch_next(mode, k, orders, table, own, bodies, values, at):
    """Bring the numbers of the next instance into the cache; its table and its series are given."""
    wide, (F, _L, _X, _J, _scratch) = 4 * orders, offsets(orders)
    fetch(values, at, F)
    for j in range(MARKERS):
        if OWNERS[j] > 1:
            continue
        body = get(table, own + OWNERS[j]) * BODY_ROW * orders
        if mode == ADVANCE:
            fetch(bodies, body, 12 * (k + 1))
            fetch(values, at + F + j * wide, 4 * (k + 1))
        else:
            fetch(bodies, body + 12 * (k + 2), 12)
            fetch(bodies, body + S_R * orders + 4 * (k + 2), 4)


@part
def _differentiate(k, one, x, f, g):
    """Store x_k, and (Phi_x)_k where columns of it vary."""
    orders, table, own, reals, real, _, values, at = one
    wide, (_F, _L, X, J, own_scratch), mask = 4 * orders, offsets(orders), get(table, own + MASK)
    places, gradients, step = at, at + 4 * MARKERS, 4
    if k > 0:
        places, gradients, step = at + X + 4 * k, at + J + 4 * k, wide
    # x_k
    for j in range(MARKERS):
        place = _marker_coefficient(j, k, one)
        put(values, places + j * step, place)
        put(x, STARTS[j], place)
    # (Phi_x)_k by the primitive, (Phi_t)_k beside it
    for r in range(ROWS):
        for c in range(SIZE):
            f[r, c] = 0.0
    scratch, par = matrix(data_of(values[at + own_scratch :]), SLOTS, orders), reals[real + 3 * MARKERS :]
    kernel_series(x, par, k, scratch, f)
    if DRIVEN:
        kernel_series_t(x, par, k, scratch, g)
        for r in range(ROWS):
            let(values, at + own_scratch + SLOTS * orders + r, g[r])
    # Constant columns are stored at order zero only
    for j in range(MARKERS):
        if k == 0 or mask >> j & 1:
            for r in range(ROWS):
                start, o = STARTS[j], gradients + (r * MARKERS + j) * step
                put(values, o, lanes(f[r, start], f[r, start + 1], f[r, start + 2]))


@part
def _push(k, one, b, Z):
    """f_{k-1} whole, by lam_{k-1} of b; f_k without lam_k, Eq. (2), and its torque, Eq. (3), onto the bodies' Z."""
    orders, table, own, reals, real, bodies, values, at = one
    wide, (F, L, _X, J, _scratch), mask = 4 * orders, offsets(orders), get(table, own + MASK)
    row = get(table, own + ROW)
    for j in range(MARKERS):
        if mask >> (GROUND + j) & 1:
            continue
        # f_{k-1} with the last term of Eq. (2), which lam_{k-1} gives
        forces, force = at + F + j * wide, splat(0.0)
        done = four(values, forces + 4 * k - 4) if k > 1 else splat(0.0)
        for r in range(ROWS):
            o = at + 4 * (MARKERS + r * MARKERS + j)
            done = fma(four(values, o), splat(-get(b, row + r)), done)
            # f_k without lam_k: earlier multipliers times the varying part of Phi_x
            if mask >> j & 1:
                o, multipliers = at + J + (r * MARKERS + j) * wide, at + L + r * orders + k
                for l in range(1, k + 1):
                    force = fma(four(values, o + 4 * l), splat(-get(values, multipliers - l)), force)
        put(values, forces + 4 * k - 4, done)
        put(values, forces + 4 * k, force)
        # Torque s x sum_j A_j^T f_{k-j} and force on the body
        body, s = get(table, own + OWNERS[j]), real + 3 * j
        if mask >> (UNTURNED + j) & 1 == 0:
            y = torque(bodies, body * BODY_ROW * orders, k, values, forces)
            arm = lanes(get(reals, s), get(reals, s + 1), get(reals, s + 2))
            put(Z, 8 * body + 4, add(four(Z, 8 * body + 4), cross(arm, y)))
        if CODES[j] == POINT:
            put(Z, 8 * body, add(four(Z, 8 * body), force))


@part
def _residual(k, one, b, x):
    """b = (k + 1)(k + 2) Phi_{k+2}, Eq. (1)."""
    orders, table, own, _, _, _, values, at = one
    wide, (_F, _L, X, J, own_scratch), mask = 4 * orders, offsets(orders), get(table, own + MASK)
    # x_{k+2} as the bodies have it
    for j in range(MARKERS):
        if mask >> (GROUND + j) & 1 == 0:
            put(x, STARTS[j], _marker_coefficient(j, k + 2, one))
    for r in range(ROWS):
        highest, lower = splat(0.0), splat(0.0)
        for j in range(MARKERS):
            if mask >> (GROUND + j) & 1:
                continue
            # (k + 2) Phi_{k+2} = (k + 2) (Phi_x)_0 x_{k+2} + sum_l l (Phi_x)_{k+2-l} x_l + (Phi_t)_{k+1}
            highest = fma(four(values, at + 4 * (MARKERS + r * MARKERS + j)), four(x, STARTS[j]), highest)
            if mask >> j & 1:
                places, gradients = at + X + j * wide, at + J + (r * MARKERS + j) * wide + 4 * (k + 2)
                for l in range(1, k + 2):
                    gradient = times(four(values, gradients - 4 * l), splat(float(l)))
                    lower = fma(gradient, four(values, places + 4 * l), lower)
        drift = get(values, at + own_scratch + SLOTS * orders + r) if DRIVEN else 0.0
        row, residual = get(table, own + ROW) + r, (k + 1.0) * ((k + 2.0) * total(highest) + total(lower) + drift)
        let(b, row, get(b, row) + residual if SUMMED else residual)


def series(mode, k, kind, table, reals, bodies, values, b, Z):
    """ADVANCE: lam_{k-1} from b, x_{k+1}, (Phi_x)_{k+1}, and f_k, but for lam_k, onto the bodies' Z.

    RESIDUAL: b = (k + 1)(k + 2) Phi_{k+2} as the bodies' series have it.
    """
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, b, Z = vector(values, ANY), vector(b, ANY), vector(Z, ANY)
    kind = extent(kind)
    count, stride, size, orders = kind.count, kind.stride, kind.width, kind.orders
    x, f, g = stack(ROOM), stack2(ROWS, SIZE), stack(ROWS)
    for i in range(count):
        own, real, at = i * INTS, i * stride, i * size
        one = Instance(orders, table, own, reals, real, bodies, values, at)
        if AHEAD and i + 1 < count:
            _fetch_next(mode, k, orders, table, own + INTS, bodies, values, at + size)
        if mode == RESIDUAL:
            _residual(k, one, b, x)
            continue
        # Multipliers of the last order are kept where later orders need them
        varies = get(table, own + MASK) & ((1 << GROUND) - 1) != 0
        for r in range(ROWS if k > 0 and varies else 0):
            let(values, at + offsets(orders)[1] + r * orders + k - 1, get(b, get(table, own + ROW) + r))
        # Orders zero and one at first, then one more each time
        for now in range(0 if k == 0 else k + 1, k + 2 if varies or DRIVEN else 1):
            _differentiate(now, one, x, f, g)
        if k > 0:
            _push(k, one, b, Z)
    return 0
