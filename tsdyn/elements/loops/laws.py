"""Laws that see the whole scene: generalised forces, Jacobian, memory and Taylor series.

A law gives values u_i(t, q, qd); each acts as a force or a torque on one or two bodies. Both are one program
(motions/tracing.py) from t, q, qd, the counted angles and the law's numbers to forces F (ground frame) and torques tau'
(body frame) on the bodies. Where the function can't be traced, or is sampled, its values are inputs of the program.

    Q_r += F,    Q_p += 2 G(p)^T tau'                                                                   (1)
    dF = F_x dx + F_u (u_x dx)                    first order of the program along dx                   (2)
    theta_q e = thetad(q, e)                      of a counted angle, an input of the program           (3)
    (k + 1) theta_{k+1} = thetad_k                                                                      (4)

u_x is zero for sampled values, and central differences of fourth order for a function called in Python.

An instance is a pair of bodies, one of which the law acts on: implicit methods and linearisation keep derivatives by
pairs. The first instance has the law's numbers; (2) is at the state of the last evaluation of (1), so a
pair needs no coordinates of other bodies.
"""

from ...jit.kernels import ANY, caller, data_of, integers, kernel, matrix, stack, vector
from ...jit.simd import four, put, splat, times
from ...maths.recurrences import angle_near
from ...maths.tolerances import PIVOT_ROUNDING
from ...maths.vectors import dot, to_body, to_ground
from ...motions.program import DIVIDE, GATE, LOG, POWER, STEP
from ...motions.tracing import COUNT, LENGTH, T, call_order, run_rows
from ...motions.tracing import HEAD as PROGRAM_HEAD
from ...motions.tracing import ROWS as PROGRAM_ROWS
from ..tolerances import FORCE_QUOTIENT, LAW_TOLERANCE
from .constraint_rows import POSE, P
from .constraint_series import BODY_ROW, S_OMEGA, S_R
from .force_series import parameters_rate
from .forces import FORCE_INTS, force_extent
from .law_check import ATOL, LIMITS, MOST, RTOL, TAU, TIME
from .law_check import LENGTH as LENGTH_OF_STEP
from .template import AT, DIMENSION, extent

PAIR = 6  # floats at the end of the reals of an instance:
# distance to the head; the two bodies, -1 for none; whether they have blocks with themselves; whether it is the first
FORWARD, FIRST_OF_PAIR, SECOND_OF_PAIR, FIRST_OWN, SECOND_OWN, LEADS = range(-PAIR, 0)

# the head: counts, and where in it (of PAR: in the first instance) other numbers begin
(
    BODIES,  # that the program reads or acts on
    BODY_LIST,
    COORDINATES,  # of these bodies
    VALUES,  # inputs of the program
    FUNCTION,  # address of what calls the function in Python; 0 for none
    NUMBERS,  # of the function
    PAR,
    MEMORY,
    ANGLES,
    ANGLE_LIST,
    TRACED,  # whether numbers and angles are inputs of the program
    PROGRAM,
    ROWS,
    ROW_COUNT,
    RESULTS,  # their first row
    ACTED,  # bodies
    STATE,
    SLOPES,  # u_x, (values, 2 coordinates)
    THETA,
    HEAD,
) = range(20)
BODY_WIDTH = 3  # where the coordinates begin, how many they are, its place among those acted on or -1
ANGLE_WIDTH = 15  # own and other body: coordinates, how many, place in the list or -1; f, g, h
ORDERS = 2  # of the rows
CALL = "ppppdp"  # q, qd, angles, numbers, t, values
call_law = caller(CALL)


@kernel
def _four(q, at, dimension):
    """Euler parameters; those of the ground."""
    if dimension != 7:
        return 1.0, 0.0, 0.0, 0.0
    return q[at + 3], q[at + 4], q[at + 5], q[at + 6]


@kernel
def _angle(p, o, c, near):
    """The angle that c describes, between bodies with Euler parameters p and o, on the turn nearest to `near`."""
    v = to_body(p, to_ground(o, (c[12], c[13], c[14])))
    return angle_near(dot((c[9], c[10], c[11]), v), dot((c[6], c[7], c[8]), v), near)


@kernel
def _counted(head, j, q, near):
    """Angle j at q."""
    c = head[int(head[ANGLE_LIST]) + ANGLE_WIDTH * j :]
    return _angle(_four(q, int(c[0]), int(c[1])), _four(q, int(c[3]), int(c[4])), c, near)


def forces(count, stride, table, reals, q, qd, t, out):
    """out (n,) += Eq. (1)."""
    reals, q, qd, out = vector(reals, ANY), vector(q, ANY), vector(qd, ANY), vector(out, ANY)
    head = reals[int(reals[stride + FORWARD]) :]
    s, row = matrix(data_of(head[int(head[ROWS]) :]), int(head[ROW_COUNT]), ORDERS), 1
    memory, par = head[int(head[MEMORY]) :], reals[int(head[PAR]) :]
    values, nb = int(head[VALUES]), int(head[BODIES])
    # Inputs: t, values that are given, numbers and angles, q and qd of the bodies
    s[0, 0] = t
    # A function that isn't traced gives the values of the law, at t, q and qd
    if head[FUNCTION] != 0.0:
        given, n = head[int(head[SLOPES]) :], int(head[COORDINATES])
        call_law(int(head[FUNCTION]), q, qd, memory, par, t, given)
        x = head[int(head[STATE]) :]
        for c in range(n):
            x[c], x[n + c] = q[c], qd[c]
        memory = given
    for i in range(values):
        s[row, 0] = memory[i]
        row += 1
    if head[TRACED] != 0.0:
        for i in range(int(head[NUMBERS])):
            s[row, 0] = par[i]
            row += 1
        for j in range(int(head[ANGLES])):
            s[row, 0] = _counted(head, j, q, memory[j])
            row += 1
    for level in range(2):
        x = q if level == 0 else qd
        for b in range(nb):
            body = head[int(head[BODY_LIST]) + BODY_WIDTH * b :]
            for c in range(int(body[1])):
                s[row, 0] = x[int(body[0]) + c]
                row += 1
    # The program: forces and torques of each body, rows from RESULTS on
    run_rows(head[int(head[PROGRAM]) :], s, 0)
    # Eq. (1)
    for b in range(nb):
        body = head[int(head[BODY_LIST]) + BODY_WIDTH * b :]
        at, first = int(body[0]), int(head[RESULTS]) + 6 * int(body[2])
        if body[2] >= 0.0:
            for i in range(3):
                out[at + i] += s[first + i, 0]
            if body[1] == 7.0:
                _add_torque(_four(q, at, 7), s, first + 3, 0, out, at + 3, 1)
    return 0


@kernel
def _add_torque(p, s, row, k, out, at, step):
    """out[at + i step] += 2 G(p)^T tau', tau' of order k in rows from `row` on."""
    x, y, z = 2.0 * s[row, k], 2.0 * s[row + 1, k], 2.0 * s[row + 2, k]
    out[at] -= p[1] * x + p[2] * y + p[3] * z
    out[at + step] += p[0] * x - p[3] * y + p[2] * z
    out[at + 2 * step] += p[3] * x + p[0] * y - p[1] * z
    out[at + 3 * step] += p[1] * y - p[2] * x + p[0] * z


def remembers(count, stride, table, reals, q, qd, t, out):
    """Keep each counted angle on its turn: the one nearest to the angle before."""
    reals, q = vector(reals, ANY), vector(q, ANY)
    head = reals[int(reals[stride + FORWARD]) :]
    memory = head[int(head[MEMORY]) :]
    for j in range(int(head[ANGLES])):
        memory[j] = _counted(head, j, q, memory[j])
    return 0


@kernel
def _difference(head, memory, par, t):
    """Set u_x by central differences of the function, u_(q, qd) of its bodies at the last state."""
    n, values = int(head[COORDINATES]), int(head[VALUES])
    x, u, slopes = head[int(head[STATE]) :], head[int(head[SLOPES]) :], head[int(head[SLOPES]) + values :]
    for c in range(2 * n):
        here = x[c]
        h = FORCE_QUOTIENT * max(1.0, abs(here))
        for i in range(values):
            slopes[i * 2 * n + c] = 0.0
        # (f(-2h) - 8 f(-h) + 8 f(h) - f(2h)) / 12 h
        for k in range(-2, 3):
            if k != 0:
                x[c] = here + k * h
                call_law(int(head[FUNCTION]), x, x[n:], memory, par, t, u)
                weight = (8.0 * k if k * k == 1 else -0.5 * k) / (12.0 * h)
                for i in range(values):
                    slopes[i * 2 * n + c] += weight * u[i]
        x[c] = here


@kernel
def _run_along(head, s, c, level):
    """Order one of the program along coordinate c of those of its bodies (level 0), or its rate (level 1)."""
    n, values = int(head[COORDINATES]), int(head[VALUES])
    row, theta = 1, head[int(head[THETA]) :]
    slopes = head[int(head[SLOPES]) + values :]
    s[0, 1] = 0.0
    for i in range(values):
        s[row, 1] = slopes[i * 2 * n + level * n + c] if head[FUNCTION] != 0.0 else 0.0
        row += 1
    if head[TRACED] != 0.0:
        row += int(head[NUMBERS])
        for j in range(int(head[ANGLES])):
            s[row, 1] = theta[j] if level == 0 else 0.0
            row += 1
    for i in range(2 * n):
        s[row + i, 1] = 1.0 if i == level * n + c else 0.0
    run_rows(head[int(head[PROGRAM]) :], s, 1)
    # Eq. (3), for level 0 afterwards
    if level == 1 and head[TRACED] != 0.0:
        for j in range(int(head[ANGLES])):
            theta[j] = s[int(head[RESULTS]) + 6 * int(head[ACTED]) + j, 1]


@kernel
def _add_column(head, s, of, e, level, along, target, own, n, out):
    """Loads on body `target` (place in the list, first coordinate) by coordinate e of `of` in column `along` of out."""
    b, at = target
    body = head[int(head[BODY_LIST]) + BODY_WIDTH * b :]
    first, row = int(head[RESULTS]) + 6 * int(body[2]), at * n + along
    if body[2] < 0.0:
        return
    for i in range(3):
        out[row + i * n] += s[first + i, 1]
    if body[1] != 7.0:
        return
    # 2 G(p)^T dtau', and 2 G(dp)^T tau' of the body's own Euler parameters
    place = int(own)
    p = s[place + 3, 0], s[place + 4, 0], s[place + 5, 0], s[place + 6, 0]
    _add_torque(p, s, first + 3, 1, out, row + 3 * n, n)
    if level == 0 and of == b and e >= 3:
        unit = 1.0 * (e == 3), 1.0 * (e == 4), 1.0 * (e == 5), 1.0 * (e == 6)
        _add_torque(unit, s, first + 3, 0, out, row + 3 * n, n)


@kernel
def _before(head, b):
    """Number of coordinates of the bodies in the list before b."""
    total = 0
    for i in range(b):
        total += int(head[int(head[BODY_LIST]) + BODY_WIDTH * i + 1])
    return total


@kernel
def _first_row(head):
    """The row of the first coordinate."""
    own = int(head[NUMBERS]) + int(head[ANGLES]) if head[TRACED] != 0.0 else 0
    return 1 + int(head[VALUES]) + own


def jacobian(kind, table, reals, q, qd, t, Q_q, Q_qd, renew, kept):
    """Q_q, Q_qd (n, n) += the blocks of some pairs, Eq. (2), at the state of the last evaluation of the forces.

    With `renew` the first pair evaluates u_x.
    """
    table, reals = integers(table, ANY), vector(reals, ANY)
    Q_q, Q_qd, kind = vector(Q_q, ANY), vector(Q_qd, ANY), force_extent(kind)
    count, stride, n = kind.count, kind.stride, kind.columns
    for i in range(count):
        own, real = table[i * FORCE_INTS : (i + 1) * FORCE_INTS], reals[i * stride : (i + 1) * stride]
        head = reals[i * stride + int(real[stride + FORWARD]) :]
        s, first = matrix(data_of(head[int(head[ROWS]) :]), int(head[ROW_COUNT]), ORDERS), _first_row(head)
        pair = int(real[stride + FIRST_OF_PAIR]), int(real[stride + SECOND_OF_PAIR])
        if renew != 0 and head[FUNCTION] != 0.0 and real[stride + LEADS] != 0.0:
            _difference(head, head[int(head[MEMORY]) :], real[int(head[PAR]) :], t)
        for side in range(2):
            of = pair[0] if side == 0 else pair[1]
            # By each coordinate of a body of the pair, rates first
            for c in range(2 * own[DIMENSION + side]):
                level, e = (1, c // 2) if c % 2 == 0 else (0, c // 2)
                _run_along(head, s, _before(head, of) + e, level)
                for other in range(2):
                    target = pair[0] if other == 0 else pair[1]
                    alone = real[stride + (FIRST_OWN if side == 0 else SECOND_OWN)] != 0.0
                    if own[DIMENSION + other] == 0 or (other == side and not alone):
                        continue
                    place, column = (target, own[AT + other]), own[AT + side] + e
                    row = first + _before(head, target)
                    _add_column(head, s, of, e, level, column, place, row, n, Q_q if level == 0 else Q_qd)
    return 0


def series(run, k, kind, table, reals, bodies, values, poses, Z):
    """Order k of the forces of a traced or sampled law, onto the bodies' Z; p_0 from the poses."""
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, poses, Z = vector(values, ANY), vector(poses, ANY), vector(Z, ANY)
    stride, orders = extent(kind).stride, extent(kind).orders
    head = reals[int(reals[stride + FORWARD]) :]
    rows, nb, n = int(head[ROW_COUNT]), int(head[BODIES]), int(head[COORDINATES])
    first, program = int(head[RESULTS]), int(values[LENGTH])
    scratch, all_p = values[program:], program + (rows * orders + 3) // 4 * 4
    s, xd = matrix(data_of(scratch), rows, orders), stack(4)
    memory, par, row = head[int(head[MEMORY]) :], reals[int(head[PAR]) :], 1
    # t; values that are held, and numbers: constant
    s[0, k] = values[T] if k == 0 else (1.0 if k == 1 else 0.0)
    for i in range(int(head[VALUES])):
        s[row, k] = memory[i] if k == 0 else 0.0
        row += 1
    angles = row + int(head[NUMBERS])
    if head[TRACED] != 0.0:
        for i in range(int(head[NUMBERS])):
            s[row, k] = par[i] if k == 0 else 0.0
            row += 1
        row += int(head[ANGLES])
    for b in range(nb):
        # r_k and rd_k = (k + 1) r_{k+1}; p_k, pd_k by omega'_k, and p_{k+1} = pd_k / (k + 1)
        dimension, at, p = int(head[int(head[BODY_LIST]) + BODY_WIDTH * b + 1]), table[b] * BODY_ROW * orders, 0
        for i in range(3):
            r = at + S_R * orders + 4 * k + i
            s[row + i, k], s[row + n + i, k] = bodies[r], (k + 1.0) * bodies[r + 4]
        if dimension == 7:
            p = all_p + 4 * orders * b
            if k == 0:
                put(values, p, four(poses, table[b] * POSE + P))
            parameters_rate(bodies, at + S_OMEGA * orders, k, values, p, xd, 0)
            put(values, p + 4 * k + 4, times(four(xd, 0), splat(1.0 / (k + 1))))
            for i in range(4):
                s[row + 3 + i, k], s[row + n + 3 + i, k] = values[p + 4 * k + i], xd[i]
        row += dimension
    if head[TRACED] != 0.0:
        for j in range(int(head[ANGLES])):
            # Eq. (4): thetad is a result of the program
            if k > 0:
                s[angles + j, k] = s[first + 6 * int(head[ACTED]) + j, k - 1] / k
            else:
                c = head[int(head[ANGLE_LIST]) + ANGLE_WIDTH * j :]
                # Where q of a body would begin, p being q[3:7]
                own, other = all_p + 4 * orders * int(c[2]) - 3, all_p + 4 * orders * int(c[5]) - 3
                s[angles + j, 0] = _angle(_four(values, own, int(c[1])), _four(values, other, int(c[4])), c, memory[j])
    call_order(run, values, scratch, rows, orders, k)
    # F_k and tau'_k
    for b in range(nb):
        place, z = head[int(head[BODY_LIST]) + BODY_WIDTH * b + 2], 8 * table[b]
        if place >= 0.0:
            for i in range(3):
                Z[z + i] += s[first + 6 * int(place) + i, k]
                Z[z + 4 + i] += s[first + 6 * int(place) + 3 + i, k]
    return 0


# Laws that aren't analytic everywhere, against their series: see law_check.py.


@kernel
def _summed(s, row, known, tau):
    """The series of a row at tau, and the sum of its absolute terms."""
    total, terms, power = 0.0, 0.0, 1.0
    for k in range(known):
        total += s[row, k] * power
        terms += abs(s[row, k] * power)
        power *= tau
    return total, terms


@kernel
def _is_off(s, h, row, known, weight, speed, limits):  # seven: series, law, place, what it is compared with
    """Whether one of three components of a load, in rows from `row` on, is not the law's."""
    tol = limits[ATOL] + limits[RTOL] * speed
    for i in range(3):
        total, terms = _summed(s, row + i, known, limits[TAU])
        off = abs(total - h[row + i, 0])
        small = weight * off * limits[LENGTH_OF_STEP] <= max(limits[MOST] * tol, LAW_TOLERANCE * speed)
        if not small and not off <= max(PIVOT_ROUNDING, limits[ATOL] + limits[RTOL]) * terms:
            return True
    return False


def check(run, known, kind, limits, table, reals, bodies, values, inverse):
    """1 if the series of a law is not what its program gives at a place of the step, else 0."""
    table, reals, values = integers(table, ANY), vector(reals, ANY), vector(values, ANY)
    limits, inverse = vector(limits, LIMITS), vector(inverse, ANY)
    stride, orders = extent(kind).stride, extent(kind).orders
    head = reals[int(reals[stride + FORWARD]) :]
    rows, first = int(head[ROW_COUNT]), int(head[RESULTS])
    s = matrix(data_of(values[int(values[LENGTH]) :]), rows, orders)
    h = matrix(data_of(head[int(head[ROWS]) :]), rows, ORDERS)
    # Inputs at tau, then the program
    for row in range(first):
        h[row, 0], _ = _summed(s, row, known, limits[TAU])
    h[0, 0] = limits[TIME]
    run_rows(head[int(head[PROGRAM]) :], h, 0)
    rate = first - int(head[COORDINATES])  # the row of qd of the body
    for b in range(int(head[BODIES])):
        body, at = head[int(head[BODY_LIST]) + BODY_WIDTH * b :], 16 * table[b]
        place = first + 6 * int(body[2])
        if body[2] >= 0.0:
            # Acceleration per unit of load: 1 / m, and J'^-1, bounded by the trace
            speed = max(abs(h[rate, 0]), abs(h[rate + 1, 0]), abs(h[rate + 2, 0]))
            turning = inverse[at + 4] + inverse[at + 9] + inverse[at + 14]
            if _is_off(s, h, place, known, inverse[at], speed, limits):
                return 1
            if _is_off(s, h, place + 3, known, turning, speed, limits):
                return 1
        rate += int(body[1])
    return 0


def margin(known, kind, h, values, least):
    """least = the minimum of itself and of 1 - sum_{k>0} |a_k| h^k / |a_0| of rows a.

    Those that the program divides by, takes a root or a logarithm of, or that open a gate.
    """
    kind, h, p, least = extent(kind), vector(h, 1), vector(values, ANY), vector(least, 1)
    s = matrix(data_of(p[int(p[LENGTH]) :]), int(p[PROGRAM_ROWS]), kind.orders)
    left = least[0]
    for i in range(int(p[COUNT])):
        at = PROGRAM_HEAD + STEP * i
        what = int(p[at])
        if what in (DIVIDE, POWER, LOG, GATE):
            a, change, power = int(p[at + 3 if what == DIVIDE else at + 2]), 0.0, h[0]
            for k in range(1, known):
                change += abs(s[a, k]) * power
                power *= h[0]
            share = 1.0 - change / abs(s[a, 0]) if s[a, 0] != 0.0 else -1.0
            left = share if not share >= left else left  # NaN, too
    least[0] = left
    return 0
