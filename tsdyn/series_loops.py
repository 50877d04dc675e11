"""Taylor series of constraints: one loop a kind, over all its instances, order by order.

A primitive says how its Jacobian's series follows from that of x; the rest is the same for all:

    x_k             = r_k + A_k s                        markers
    (Phi_x)_k       by the primitive's kernel `series`
    k Phi_k         = sum_j j (Phi_x)_{k-j} x_j          d/dt Phi = Phi_x xd                         (1)
    f_k             = - sum_j (Phi_x)_j^T lam_{k-j}      force on a marker                           (2)
    T_k             = s x sum_j A_j^T f_{k-j}            its torque about the centroid, body frame   (3)

A series lies in memory order by order. That of a body is A (its columns, 4 floats each), omega', r, J' omega' (4 each);
that of an instance x (4 a marker), Phi_x (4 a row and marker), f (4 a marker), lam (1 a row), then its own scratch. A
marker whose columns of Phi_x are constant, as all of Spherical's, takes no part in (1) beyond order zero, nor in (2);
that of the ground has no force.
"""

from ._four import add, cross, fma, four, lanes, put, splat, times, total
from ._kernel import ANY, caller, data_of, integers, kernel, matrix, stack, stack2, vector
from .body_loops import INTS, MASK, ROW
from .markers import POINT
from .poses import turned

# where the parts of a body's series begin, times the number of orders; floats of an order of all of them
S_OMEGA, S_R, S_SPIN, BODY_ROW = 12, 16, 20, 24
SIGNATURE = "iiiiipppppp"  # mode, k, orders, count, reals per instance, table, reals, bodies, series, b, Z
call_series = caller(SIGNATURE)
UPDATE, HISTORY, RESIDUAL = range(3)
GROUND = 16  # bits of the mask: from 0 on the markers whose columns vary, from 16 on those that are on the ground


def instance_width(markers, rows, slots, orders):
    """Floats of an instance."""
    return orders * (4 * (2 * markers + markers * rows) + 4 * ((rows + 3) // 4)) + 4 * ((slots * orders + 3) // 4)


@kernel
def torque(bodies, at, k, forces, first):
    """sum_j A_j^T f_{k-j}; A_0 is at bodies[at], f_0 at forces[first]."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    u, v, w = splat(0.0), splat(0.0), splat(0.0)
    c, f = at, first + 4 * k
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


# The names in capitals and kernel_series are filled in by primitive._compile.
ROWS = MARKERS = SIZE = ROOM = SLOTS = 1
CODES = OWNERS = STARTS = (0,)
kernel_series = None


def series(mode, k, orders, count, stride, table, reals, bodies, values, b, Z):
    """UPDATE: x_k and (Phi_x)_k, and lam_{k-2} from b. HISTORY: f_k, but for lam_k, onto the bodies' Z.

    RESIDUAL: b = (k + 1)(k + 2) Phi_{k+2} as the bodies' series have it.
    """
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, b, Z = vector(values, ANY), vector(b, ANY), vector(Z, ANY)
    x, f = stack(ROOM), stack2(ROWS, SIZE)
    wide, body_size = 4 * orders, BODY_ROW * orders
    J, F, L = MARKERS * wide, MARKERS * (ROWS + 1) * wide, MARKERS * (ROWS + 2) * wide
    own_scratch = L + 4 * ((ROWS + 3) // 4) * orders
    size = own_scratch + 4 * ((SLOTS * orders + 3) // 4)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        first, mask = i * size, own[MASK]
        if mode == UPDATE:
            for j in range(MARKERS):
                body, s = own[OWNERS[j]] * body_size, real[3 * j : 3 * j + 3]
                place = turned(bodies, body + 12 * k, s[0], s[1], s[2])
                if CODES[j] == POINT:
                    place = add(place, four(bodies, body + S_R * orders + 4 * k))
                put(values, first + j * wide + 4 * k, place)
                put(x, STARTS[j], place)
            for r in range(ROWS):
                for c in range(SIZE):
                    f[r, c] = 0.0
            kernel_series(x, real[3 * MARKERS :], k, matrix(data_of(values[first + own_scratch :]), SLOTS, orders), f)
            for r in range(ROWS):
                for j in range(MARKERS):
                    c, at = STARTS[j], first + J + (r * MARKERS + j) * wide + 4 * k
                    put(values, at, lanes(f[r, c], f[r, c + 1], f[r, c + 2]))
            if k >= 2:
                for r in range(ROWS):
                    values[first + L + r * orders + k - 2] = b[own[ROW] + r]
                for j in range(MARKERS):
                    at = first + F + j * wide + 4 * (k - 2)
                    force = four(values, at) if k > 2 else splat(0.0)
                    for r in range(ROWS):
                        gradient = four(values, first + J + (r * MARKERS + j) * wide)
                        force = fma(gradient, splat(-b[own[ROW] + r]), force)
                    put(values, at, force)
        elif mode == HISTORY:
            for j in range(MARKERS):
                if mask >> (GROUND + j) & 1:
                    continue
                force = splat(0.0)
                if mask >> j & 1:
                    for r in range(ROWS):
                        at, multipliers = first + J + (r * MARKERS + j) * wide, first + L + r * orders + k
                        for l in range(1, k + 1):
                            force = fma(four(values, at + 4 * l), splat(-values[multipliers - l]), force)
                forces = first + F + j * wide
                put(values, forces + 4 * k, force)
                body, s = own[OWNERS[j]], real[3 * j : 3 * j + 3]
                y = torque(bodies, body * body_size, k, values, forces)
                put(Z, 8 * body + 4, add(four(Z, 8 * body + 4), cross(lanes(s[0], s[1], s[2]), y)))
                if CODES[j] == POINT:
                    put(Z, 8 * body, add(four(Z, 8 * body), force))
        else:
            for r in range(ROWS):
                highest, lower = splat(0.0), splat(0.0)
                for j in range(MARKERS):
                    if mask >> (GROUND + j) & 1:
                        continue
                    at, s = first + J + (r * MARKERS + j) * wide, real[3 * j : 3 * j + 3]
                    body = own[OWNERS[j]] * body_size
                    place = turned(bodies, body + 12 * (k + 2), s[0], s[1], s[2])
                    if CODES[j] == POINT:
                        place = add(place, four(bodies, body + S_R * orders + 4 * (k + 2)))
                    highest = fma(four(values, at), place, highest)
                    if mask >> j & 1:
                        places, gradients = first + j * wide, at + 4 * (k + 2)
                        for l in range(1, k + 2):
                            gradient = times(four(values, gradients - 4 * l), splat(float(l)))
                            lower = fma(gradient, four(values, places + 4 * l), lower)
                b[own[ROW] + r] = (k + 1.0) * ((k + 2.0) * total(highest) + total(lower))
    return 0
