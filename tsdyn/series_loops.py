"""Taylor series of constraints: one loop a kind, over all its instances, order by order.

A primitive says how its Jacobian's series follows from that of x; the rest is the same for all:

    x_k             = r_k + A_k s                        markers
    (Phi_x)_k       by the primitive's kernel `series`
    k Phi_k         = sum_j j (Phi_x)_{k-j} x_j          d/dt Phi = Phi_x xd                         (1)
    f_k             = - sum_j (Phi_x)_j^T lam_{k-j}      force on a marker                           (2)
    T_k             = s x sum_j A_j^T f_{k-j}            its torque about the centroid, body frame   (3)

The series of an instance holds for each order x (4 floats a marker), Phi_x (4 a marker and row), f (4 a marker) and
lam, then its own scratch. A marker whose columns of Phi_x are constant, as all of Spherical's, takes no part in (1)
beyond order zero, nor in (2); that of the ground has no force.
"""

from ._four import add, cross, fma, four, lanes, put, splat, times, total
from ._kernel import ANY, caller, data_of, integers, kernel, matrix, stack, stack2, vector
from .body_loops import INTS, MASK, ROW
from .markers import POINT
from .poses import turned

# a row of a body's series: columns of A, r, omega', J' omega'
S_R, S_OMEGA, S_SPIN, BODY_ROW = 12, 16, 20, 24
SIGNATURE = "iiiiipppppp"  # mode, k, orders, count, reals per instance, table, reals, bodies, series, b, Z
call_series = caller(SIGNATURE)
UPDATE, HISTORY, RESIDUAL = range(3)
GROUND = 16  # bits of the mask: from 0 on the markers whose columns vary, from 16 on those that are on the ground


def row_width(markers, rows):
    """Floats of one order of an instance."""
    return 4 * (2 * markers + markers * rows + (rows + 3) // 4)


def instance_width(markers, rows, slots, orders):
    """Floats of an instance."""
    return orders * row_width(markers, rows) + 4 * ((slots * orders + 3) // 4)


@kernel
def torque(bodies, at, k, forces, first, width):
    """sum_j A_j^T f_{k-j}; A_j from bodies[at] on, f_j from forces[first] on, `width` floats apart."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    for j in range(k + 1):
        f, c = four(forces, first + (k - j) * width), at + j * BODY_ROW
        x = fma(four(bodies, c), f, x)
        y = fma(four(bodies, c + 4), f, y)
        z = fma(four(bodies, c + 8), f, z)
    return lanes(total(x), total(y), total(z))


# The names in capitals and kernel_series are filled in by primitive._compile.
ROWS = MARKERS = SIZE = ROOM = WIDTH = SLOTS = 1
CODES = OWNERS = STARTS = (0,)
kernel_series = None


def series(mode, k, orders, count, stride, table, reals, bodies, values, b, Z):
    """UPDATE: x_k and (Phi_x)_k, and lam_{k-2} from b. HISTORY: f_k, but for lam_k, onto the bodies' Z.

    RESIDUAL: b = (k + 1)(k + 2) Phi_{k+2} as the bodies' series have it.
    """
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, b, Z = vector(values, ANY), vector(b, ANY), vector(Z, ANY)
    x, f = stack(ROOM), stack2(ROWS, SIZE)
    size = orders * WIDTH + 4 * ((SLOTS * orders + 3) // 4)
    J, F, L = 4 * MARKERS, 4 * MARKERS * (ROWS + 1), 4 * MARKERS * (ROWS + 2)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        first, mask = i * size, own[MASK]
        row = first + k * WIDTH
        if mode == UPDATE:
            for j in range(MARKERS):
                at, s = (own[OWNERS[j]] * orders + k) * BODY_ROW, real[3 * j : 3 * j + 3]
                place = turned(bodies, at, s[0], s[1], s[2])
                if CODES[j] == POINT:
                    place = add(place, four(bodies, at + S_R))
                put(values, row + 4 * j, place)
                put(x, STARTS[j], place)
            for r in range(ROWS):
                for c in range(SIZE):
                    f[r, c] = 0.0
            kernel_series(x, real[3 * MARKERS :], k, matrix(data_of(values[first + orders * WIDTH :]), SLOTS, orders), f)
            for r in range(ROWS):
                for j in range(MARKERS):
                    c = STARTS[j]
                    put(values, row + J + 4 * (r * MARKERS + j), lanes(f[r, c], f[r, c + 1], f[r, c + 2]))
            if k >= 2:
                done = row - 2 * WIDTH
                for r in range(ROWS):
                    values[done + L + r] = b[own[ROW] + r]
                for j in range(MARKERS):
                    force = four(values, done + F + 4 * j) if k > 2 else splat(0.0)
                    for r in range(ROWS):
                        gradient = four(values, first + J + 4 * (r * MARKERS + j))
                        force = fma(gradient, splat(-b[own[ROW] + r]), force)
                    put(values, done + F + 4 * j, force)
        elif mode == HISTORY:
            for j in range(MARKERS):
                if mask >> (GROUND + j) & 1:
                    continue
                force = splat(0.0)
                if mask >> j & 1:
                    for r in range(ROWS):
                        at = first + J + 4 * (r * MARKERS + j)
                        for l in range(1, k + 1):
                            multiplier = splat(-values[row - l * WIDTH + L + r])
                            force = fma(four(values, at + l * WIDTH), multiplier, force)
                put(values, row + F + 4 * j, force)
                body, s = own[OWNERS[j]], real[3 * j : 3 * j + 3]
                y = torque(bodies, body * orders * BODY_ROW, k, values, first + F + 4 * j, WIDTH)
                put(Z, 8 * body + 4, add(four(Z, 8 * body + 4), cross(lanes(s[0], s[1], s[2]), y)))
                if CODES[j] == POINT:
                    put(Z, 8 * body, add(four(Z, 8 * body), force))
        else:
            for r in range(ROWS):
                highest, lower = splat(0.0), splat(0.0)
                for j in range(MARKERS):
                    at = first + J + 4 * (r * MARKERS + j)
                    if not mask >> (GROUND + j) & 1:
                        body, s = (own[OWNERS[j]] * orders + k + 2) * BODY_ROW, real[3 * j : 3 * j + 3]
                        place = turned(bodies, body, s[0], s[1], s[2])
                        if CODES[j] == POINT:
                            place = add(place, four(bodies, body + S_R))
                        highest = fma(four(values, at), place, highest)
                    if mask >> j & 1 and not mask >> (GROUND + j) & 1:
                        for l in range(1, k + 2):
                            gradient = times(four(values, at + (k + 2 - l) * WIDTH), splat(float(l)))
                            lower = fma(gradient, four(values, first + l * WIDTH + 4 * j), lower)
                b[own[ROW] + r] = (k + 1.0) * ((k + 2.0) * total(highest) + total(lower))
    return 0
