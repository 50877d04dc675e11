"""Taylor series of forces: one loop a kind over all its instances, order by order.

The kernel `series` of a force gives the series of its law from those of x and xd; the rest is common to all forces.
Order k of the law needs x and xd up to k, hence x up to k + 1:

    x_k             = r_k + A_k s                                   Point; of a Vector without r_k
    (k+1) p_{k+1}   = 1/2 sum_j G(p_j)^T omega'_{k-j}               Parameters, x = p                   (1)
    xd_k            = (k+1) x_{k+1};  sum_j A_j omega'_{k-j}        all others; Turn                    (2)
    tau'_k          = s x sum_j A_j^T f_{k-j}                       torque about the centroid, body     (3)
                      sum_j A_j^T f_{k-j};  1/2 sum_j G(p_j) f_{k-j}    frame: of a Turn; of Parameters

The series of an instance holds p and the forces (4 floats a marker and order each, p of Parameters only), then its own
scratch, then for each marker the last order at which its force is not zero: (3) ends there, at order zero for a
constant force. Series that a law doesn't use aren't stored, so the compiler removes their evaluation. Those of a sharp
law are: x and xd follow the last orders, for `law_check`.

Of a force driven by loads, the rows of its scratch from SLOTS on are the series of par, written at the start of a step.
Of a traced function they are those of its arguments, t first, and then the program's own; the program, one for all
instances, stands before the first of them.

Of friction in proportion to a normal load, see friction.py.
"""

from ...jit.kernels import ANY, data_of, integers, kernel, matrix, part, stack, vector
from ...jit.predicates import some, whole
from ...jit.simd import add, cross, fma, four, get, lanes, put, splat, times
from ...motions.tracing import LENGTH, ROWS, T, call_order
from ..markers import PARAMETERS, POINT, TURN
from .constraint_rows import POSE, P, turned
from .constraint_series import BODY_ROW, S_OMEGA, S_R, torque
from .friction import FRICTION_ROWS, known_friction
from .template import (
    CODES,
    DRIVEN,
    FRICTIONAL,
    MARKERS,
    OWNERS,
    ROOM,
    SHARP,
    SIZE,
    SLOTS,
    STARTS,
    TRACED,
    extent,
    kernel_inputs,
    kernel_series,
)

BODY, MASK, INTS = 0, 2, 3  # of the table: the two bodies, and which of them are the ground


def instance_width(markers, rows, orders):
    """Floats of an instance; rows: those of its scratch, and of x and xd where the law is sharp."""
    return 8 * markers * orders + 4 * ((rows * orders + markers + 3) // 4)


@kernel
def _turning(bodies, at, orders, k):
    """Order k of A omega'."""
    f = splat(0.0)
    for j in range(k + 1):
        c, o = at + 12 * j, at + S_OMEGA * orders + 4 * (k - j)
        f = fma(four(bodies, c), splat(get(bodies, o)), f)
        f = fma(four(bodies, c + 4), splat(get(bodies, o + 1)), f)
        f = fma(four(bodies, c + 8), splat(get(bodies, o + 2)), f)
    return f


@kernel
def marker_coefficient(code, bodies, at, orders, k, s):
    """Order k of the x of a Point or Vector; its body's series begins at bodies[at]."""
    f = turned(bodies, at + 12 * k, s[0], s[1], s[2])
    return add(f, four(bodies, at + S_R * orders + 4 * k)) if code == POINT else f


@kernel
def parameters_rate(bodies, omega, k, values, p, out, c):
    """out[c : c + 4] = order k of pd, Eq. (1); p_0 is at values[p], omega'_0 at bodies[omega]."""
    d0, d1, d2, d3 = 0.0, 0.0, 0.0, 0.0
    for j in range(k + 1):
        e, o = p + 4 * j, omega + 4 * (k - j)
        e0, e1, e2, e3 = values[e], values[e + 1], values[e + 2], values[e + 3]
        x, y, z = bodies[o], bodies[o + 1], bodies[o + 2]
        d0 -= e1 * x + e2 * y + e3 * z
        d1 += e0 * x - e3 * y + e2 * z
        d2 += e3 * x + e0 * y - e1 * z
        d3 += e1 * y - e2 * x + e0 * z
    out[c], out[c + 1], out[c + 2], out[c + 3] = 0.5 * d0, 0.5 * d1, 0.5 * d2, 0.5 * d3


@kernel
def _parameters_torque(values, p, f, k, last):
    """1/2 sum_j G(p_{k-j}) f_j, j up to last; p_0 is at values[p], f_0 at values[f]."""
    x, y, z = 0.0, 0.0, 0.0
    for j in range(last + 1):
        e, g = p + 4 * (k - j), f + 4 * j
        e0, e1, e2, e3 = values[e], values[e + 1], values[e + 2], values[e + 3]
        f0, f1, f2, f3 = values[g], values[g + 1], values[g + 2], values[g + 3]
        x += e0 * f1 - e1 * f0 + e3 * f2 - e2 * f3
        y += e0 * f2 - e2 * f0 - e3 * f1 + e1 * f3
        z += e0 * f3 - e3 * f0 + e2 * f1 - e1 * f2
    return lanes(0.5 * x, 0.5 * y, 0.5 * z)


@part
def scratch_rows(stride, values):
    """Rows of an instance's scratch; the values of its kind."""
    if TRACED:
        return int(values[ROWS])
    if FRICTIONAL:
        return SLOTS + SIZE + FRICTION_ROWS
    return SLOTS + (stride - 3 * MARKERS if DRIVEN else 0)


@part
def run_traced(run, program, x, xd, par, k, rows, orders, scratch):
    """Order k of the arguments and of the results of a traced function; `run` runs its program."""
    s = matrix(data_of(scratch), rows, orders)
    s[SLOTS, k] = program[T] if k == 0 else (1.0 if k == 1 else 0.0)
    kernel_inputs(x, xd, par, k, SLOTS + 1, s)
    call_order(run, program, scratch, rows, orders, k)


@part
def _acts(f, c, wider):
    """Whether f isn't zero at a marker that begins at c."""
    return some(f[c]) or some(f[c + 1]) or some(f[c + 2]) or (wider and some(f[c + 3]))


def series(run, k, kind, table, reals, bodies, values, poses, Z):
    """Order k of the forces, onto the bodies' Z; p_0 from the poses."""
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, poses, Z = vector(values, ANY), vector(poses, ANY), vector(Z, ANY)
    kind = extent(kind)
    count, stride, size, orders = kind.count, kind.stride, kind.width, kind.orders
    x, xd, f = stack(ROOM), stack(ROOM), stack(ROOM)
    wide, body_size = 4 * orders, BODY_ROW * orders
    own_scratch, rows = 2 * MARKERS * wide, scratch_rows(stride, values)
    program = int(values[LENGTH]) if TRACED else 0
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        first = program + i * size
        for j in range(MARKERS):
            # x_k and xd_k of the markers
            at, s, c = own[OWNERS[j]] * body_size, real[3 * j : 3 * j + 3], STARTS[j]
            if CODES[j] == PARAMETERS:
                p = first + j * wide
                if k == 0:
                    put(values, p, four(poses, own[OWNERS[j]] * POSE + P))
                parameters_rate(bodies, at + S_OMEGA * orders, k, values, p, xd, c)
                put(values, p + 4 * k + 4, times(four(xd, c), splat(1.0 / (k + 1))))
                put(x, c, four(values, p + 4 * k))
            elif CODES[j] == TURN:
                put(x, c, splat(0.0))
                put(xd, c, _turning(bodies, at, orders, k))
            else:
                put(x, c, marker_coefficient(CODES[j], bodies, at, orders, k, s))
                put(xd, c, times(marker_coefficient(CODES[j], bodies, at, orders, k + 1, s), splat(k + 1.0)))
        for e in range(SIZE):
            f[e] = 0.0
        # f_k by the law
        scratch = matrix(data_of(values[first + own_scratch :]), rows, orders)
        if TRACED:
            run_traced(run, values, x, xd, real[3 * MARKERS :], k, rows, orders, values[first + own_scratch :])
        kernel_series(x, xd, real[3 * MARKERS :], k, scratch, f)
        # In proportion to the normal load: what is known of it
        if FRICTIONAL:
            ends = values[first + own_scratch + rows * orders :]
            for j in range(MARKERS):
                # Once g acts at a marker, its product with N does
                acts = _acts(f, STARTS[j], CODES[j] == PARAMETERS) or (k > 0 and ends[j] >= 0.0)
                ends[j] = float(k) if acts else -1.0
            known_friction(
                k, wide, x, real[3 * MARKERS :], ends, ends[MARKERS:], scratch, values[first + MARKERS * wide :], f
            )
        # x and xd are kept for the comparison with the law
        if SHARP:
            kept = first + own_scratch + rows * orders + MARKERS + 2 * SIZE * k
            for e in range(SIZE):
                values[kept + e] = x[e]
                values[kept + SIZE + e] = xd[e]
        for j in range(MARKERS):
            if own[MASK] >> OWNERS[j] & 1:
                continue
            # The last order whose force is not zero bounds the sum of torques
            c, s, z = STARTS[j], real[3 * j : 3 * j + 3], 8 * own[OWNERS[j]]
            at, forces = own[OWNERS[j]] * body_size, first + (MARKERS + j) * wide
            ends = first + own_scratch + rows * orders + j
            wider = CODES[j] == PARAMETERS
            acts = _acts(f, c, wider)
            if (not FRICTIONAL) and (acts or k == 0):
                values[ends] = float(k) if acts else -1.0
            put(values, forces + 4 * k, four(f, c) if wider else lanes(f[c], f[c + 1], f[c + 2]))
            last = whole(values[ends])
            if last < 0:
                continue
            # Torque of order k, and the force itself, onto the body
            if wider:
                y = _parameters_torque(values, first + j * wide, forces, k, last)
            else:
                y = torque(bodies, at + 12 * (k - last), last, values, forces)
                if CODES[j] != TURN:
                    y = cross(lanes(s[0], s[1], s[2]), y)
            put(Z, z + 4, add(four(Z, z + 4), y))
            if CODES[j] == POINT:
                put(Z, z, add(four(Z, z), four(values, forces + 4 * k)))
    return 0
