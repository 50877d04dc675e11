"""Taylor series of forces: one loop a kind, over all its instances, order by order.

A force says how the series of its law follows from those of x and xd, by its kernel `series`; order k of the law needs
x up to k and xd up to k, which is x up to k + 1. The series of an instance holds for each order x, xd and the forces
(4 floats a marker each), then its own scratch.
"""

from ._four import add, cross, fma, four, lanes, put, splat, times
from ._kernel import ANY, data_of, integers, kernel, matrix, stack, vector
from .markers import POINT, TURN
from .poses import turned
from .series_loops import BODY_ROW, S_OMEGA, S_R, torque

BODY, MASK, INTS = 0, 2, 3  # of the table: the two bodies, and which of them are the ground


def instance_width(markers, slots, orders):
    """Floats of an instance."""
    return orders * 12 * markers + 4 * ((slots * orders + 3) // 4)


@kernel
def _turning(bodies, at, orders, k):
    """Order k of A omega'."""
    f = splat(0.0)
    for j in range(k + 1):
        c, o = at + 12 * j, at + S_OMEGA * orders + 4 * (k - j)
        f = fma(four(bodies, c), splat(bodies[o]), f)
        f = fma(four(bodies, c + 4), splat(bodies[o + 1]), f)
        f = fma(four(bodies, c + 8), splat(bodies[o + 2]), f)
    return f


@kernel
def _place(code, bodies, at, orders, k, s):
    """Order k of a marker's x; its body's series begins at bodies[at]."""
    if code == TURN:
        return splat(0.0)
    f = turned(bodies, at + 12 * k, s[0], s[1], s[2])
    return add(f, four(bodies, at + S_R * orders + 4 * k)) if code == POINT else f


# The names in capitals and kernel_series are filled in by force.callbacks.
MARKERS = SIZE = ROOM = SLOTS = 1
CODES = OWNERS = STARTS = (0,)
kernel_series = None


def series(mode, k, orders, count, stride, table, reals, bodies, values, b, Z):
    """Order k of the forces, onto the bodies' Z."""
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, Z = vector(values, ANY), vector(Z, ANY)
    x, xd, f = stack(ROOM), stack(ROOM), stack(ROOM)
    wide, body_size = 4 * orders, BODY_ROW * orders
    size = 3 * MARKERS * wide + 4 * ((SLOTS * orders + 3) // 4)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        first = i * size
        for j in range(MARKERS):
            at, s, place = own[OWNERS[j]] * body_size, real[3 * j : 3 * j + 3], first + j * wide + 4 * k
            if k == 0:
                put(values, place, _place(CODES[j], bodies, at, orders, 0, s))
            following = _place(CODES[j], bodies, at, orders, k + 1, s)
            put(values, place + 4, following)
            rate = _turning(bodies, at, orders, k) if CODES[j] == TURN else times(following, splat(k + 1.0))
            put(values, place + MARKERS * wide, rate)
            put(x, STARTS[j], four(values, place))
            put(xd, STARTS[j], rate)
        for c in range(SIZE):
            f[c] = 0.0
        scratch = matrix(data_of(values[first + 3 * MARKERS * wide :]), SLOTS, orders)
        kernel_series(x, xd, real[3 * MARKERS :], k, scratch, f)
        for j in range(MARKERS):
            if own[MASK] >> OWNERS[j] & 1:
                continue
            c, s, z = STARTS[j], real[3 * j : 3 * j + 3], 8 * own[OWNERS[j]]
            force, forces = lanes(f[c], f[c + 1], f[c + 2]), first + (2 * MARKERS + j) * wide
            put(values, forces + 4 * k, force)
            y = torque(bodies, own[OWNERS[j]] * body_size, k, values, forces)
            if CODES[j] != TURN:
                y = cross(lanes(s[0], s[1], s[2]), y)
            put(Z, z + 4, add(four(Z, z + 4), y))
            if CODES[j] == POINT:
                put(Z, z, add(four(Z, z), force))
    return 0
