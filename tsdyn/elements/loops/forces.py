"""Loops over all instances of a force kind: generalised forces, their Jacobians, memory, corotated frames."""

import math

from ...jit.kernels import ANY, Record, complex_stack, integers, kernel, part, record_at, stack, stack2, vector
from ...maths.tolerances import COMPLEX_STEP
from ...maths.vectors import matrix_a
from ..markers import PARAMETERS
from ..tolerances import FORCE_QUOTIENT
from .template import (
    ALONG,
    AT,
    CODES,
    DIMENSION,
    FRICTIONAL,
    KEPT,
    MARKERS,
    OWNERS,
    SIZE,
    STARTS,
    MarkerDerivatives,
    carry_back,
    carry_back_derivative,
    derivatives,
    force_markers,
    kernel_derivatives,
    kernel_law,
    kernel_remember,
    state,
)

# Corotated frames of forces: derivatives of a law that are kept from an earlier configuration stay accurate in them.
#
# The stiffness of a spring lies along the spring, that of a bushing along the axes of its body: in such a frame a law
# changes little as the mechanism moves. The rotation r (Euler parameters) of the frame since the derivatives were taken
# rotates 3-vectors among x and xd by A(r) and takes Euler parameters p to r p.


@kernel
def turn_of_bodies(before, p, r):
    """r = p before*, the turn from one orientation to another; all (4,)."""
    b0, b1, b2, b3 = before[0], -before[1], -before[2], -before[3]
    r[0] = p[0] * b0 - p[1] * b1 - p[2] * b2 - p[3] * b3
    r[1] = p[0] * b1 + p[1] * b0 + p[2] * b3 - p[3] * b2
    r[2] = p[0] * b2 - p[1] * b3 + p[2] * b0 + p[3] * b1
    r[3] = p[0] * b3 + p[1] * b2 - p[2] * b1 + p[3] * b0


@kernel
def turn_of_directions(a, b, r):
    """The least turn r (4,) from direction a to b, (3,) each; none where that says nothing."""
    r[0], r[1], r[2], r[3] = 1.0, 0.0, 0.0, 0.0
    size = math.sqrt((a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) * (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]))
    if not size > 0.0:
        return
    # Half-angle formulas: e0 = cos(phi / 2), e = a x b / (2 |a| |b| e0); no turn beyond 120 degrees
    cosine = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / size
    if cosine < -0.5:
        return
    r[0] = math.sqrt(0.5 * (1.0 + cosine))
    f = 0.5 / (size * r[0])
    r[1] = f * (a[1] * b[2] - a[2] * b[1])
    r[2] = f * (a[2] * b[0] - a[0] * b[2])
    r[3] = f * (a[0] * b[1] - a[1] * b[0])


@kernel
def turn_matrix(code, r, T):
    """T with T x the turned x of one marker, (3, 3) or, for Euler parameters, (4, 4)."""
    e0, e1, e2, e3 = r[0], r[1], r[2], r[3]
    if code == PARAMETERS:
        T[0, 0], T[0, 1], T[0, 2], T[0, 3] = e0, -e1, -e2, -e3
        T[1, 0], T[1, 1], T[1, 2], T[1, 3] = e1, e0, -e3, e2
        T[2, 0], T[2, 1], T[2, 2], T[2, 3] = e2, e3, e0, -e1
        T[3, 0], T[3, 1], T[3, 2], T[3, 3] = e3, -e2, e1, e0
        return
    matrix_a(r, T)


@kernel
def turn_block(code_row, code_column, r, kept, size, row, column, out):
    """out[row:, column:] = T kept T^T for the markers of one pair; kept is (size, size) row by row."""
    A, B, g = stack2(4, 4), stack2(4, 4), stack(4)
    turn_matrix(code_row, r, A)
    turn_matrix(code_column, r, B)
    n, m = 4 if code_row == PARAMETERS else 3, 4 if code_column == PARAMETERS else 3
    # Row i of A kept
    for i in range(n):
        # times B^T
        for j in range(m):
            g[j] = 0.0
            for k in range(n):
                g[j] += A[i, k] * kept[(row + k) * size + column + j]
        for j in range(m):
            total = 0.0
            for k in range(m):
                total += g[k] * B[j, k]
            out[row + i, column + j] = total


# Loops over all instances of a force kind: generalised forces, their Jacobians, memory.
#
#     Q      += W^T f
#     dQ/dq  += W^T (f_x X + f_xd Y) + (W^T f)_q
#     dQ/dqd += W^T f_xd W
#
# with W = xd_qd, X = x_q, Y = xd_q of the markers. f_x and f_xd are complex steps of the force, exact to rounding, or
# central differences where it is not analytic. `force.callbacks` supplies the names in capitals and kernel_*.

FORCE_INTS = 4  # of a kind's table for each instance: template.AT and DIMENSION
JACOBIAN = "pppppdppip"  # extent, table, reals, q, qd, t, Q_q, Q_qd, renew, kept
SPAN = 14  # coordinates of two bodies
FRAME = 7  # floats of an instance's frame: Euler parameters of a body, or a direction


def kept_size(markers):
    """Floats that an instance keeps of its law's derivatives."""
    size = sum(marker.size for marker in markers)
    return 2 * size * size + FRAME


def forces(count, stride, table, reals, q, qd, t, out):
    """out (n,) += W^T f of all instances."""
    table, reals = integers(table, ANY), vector(reals, ANY)
    q, qd, out = vector(q, ANY), vector(qd, ANY), vector(out, ANY)
    x, xd, f = stack(SIZE), stack(SIZE), stack(SIZE)
    for i in range(count):
        own, real = table[i * FORCE_INTS : (i + 1) * FORCE_INTS], reals[i * stride : (i + 1) * stride]
        if FRICTIONAL and real[stride - 1] == 0.0:
            continue  # without a normal load
        # f = law(x, xd), pulled back: Q += W^T f
        force_markers(q, qd, own, real, x, xd)
        for c in range(SIZE):
            f[c] = 0.0
        kernel_law(x, xd, real[3 * MARKERS :], t, f)
        for j in range(MARKERS):
            k, s = OWNERS[j], real[3 * j : 3 * j + 3]
            carry_back(CODES[j], own[DIMENSION + k], own[AT + k], q, s, f[STARTS[j] :], out)
    return 0


def remembers(count, stride, table, reals, q, qd, t, out):
    """Let all instances remember, each in the last of its reals."""
    table, reals, q, qd = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(qd, ANY)
    x, xd = stack(SIZE), stack(SIZE)
    for i in range(count):
        own, real = table[i * FORCE_INTS : (i + 1) * FORCE_INTS], reals[i * stride : (i + 1) * stride]
        force_markers(q, qd, own, real, x, xd)
        real[stride - 1] = kernel_remember(x, xd, real[3 * MARKERS :], t)
    return 0


@part
def _complex_slope(z, zd, along, c, par, t, g, slope):
    """slope[:, c] = f_along, by a complex step of along (z or zd), whose imaginary parts are zero."""
    for r in range(SIZE):
        g[r] = 0.0
    # Im f(x + i h) / h = f' + O(h^2), without cancellation
    here = along[c]
    along[c] = complex(here.real, COMPLEX_STEP)
    kernel_law(z, zd, par, t, g)
    along[c] = here
    for r in range(SIZE):
        slope[r, c] = g[r].imag / COMPLEX_STEP


def complex_steps(x, xd, par, t, fx, fxd):
    """f_x and f_xd (SIZE, SIZE), exact to rounding."""
    z, zd, g = complex_stack(SIZE), complex_stack(SIZE), complex_stack(SIZE)
    for c in range(SIZE):
        z[c], zd[c] = x[c], xd[c]
    for c in range(SIZE):
        _complex_slope(z, zd, z, c, par, t, g, fx)
        _complex_slope(z, zd, zd, c, par, t, g, fxd)


@part
def _central_slope(x, xd, along, c, par, t, g, slope):
    """slope[:, c] = f_along, by differences of fourth order of along (x or xd)."""
    here = along[c]
    h = FORCE_QUOTIENT * max(1.0, abs(here))
    for r in range(SIZE):
        slope[r, c] = 0.0
    for k in range(-2, 3):
        # (f(-2h) - 8 f(-h) + 8 f(h) - f(2h)) / 12 h
        weight = (8.0 * k if k * k == 1 else -0.5 * k) / 12.0
        if k != 0:
            for r in range(SIZE):
                g[r] = 0.0
            along[c] = here + k * h
            kernel_law(x, xd, par, t, g)
            along[c] = here
            for r in range(SIZE):
                slope[r, c] += weight / h * g[r]


def central_differences(x, xd, par, t, fx, fxd):
    """f_x and f_xd by differences of fourth order, error about 1e-12 of the force's size."""
    g = stack(SIZE)
    for c in range(SIZE):
        _central_slope(x, xd, x, c, par, t, g, fx)
        _central_slope(x, xd, xd, c, par, t, g, fxd)


@part
def _differentiate_markers(q, qd, own, real, x, xd, W, X, Y):
    """Set x, xd, and W = xd_qd, X = x_q, Y = xd_q (SIZE, SPAN)."""
    for r in range(SIZE):
        for e in range(SPAN):
            W[r, e], X[r, e], Y[r, e] = 0.0, 0.0, 0.0
    for j in range(MARKERS):
        k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
        state(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, x[c:], xd[c:])
        derivatives(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, c, 7 * k, MarkerDerivatives(W, X, Y))


@part
def _follow_frame(q, own, x, renew, frame, turn):
    """With `renew` store the force's frame, a body's or the direction between two points; else set its rotation."""
    if ALONG >= 0:
        # A law along the line between two points: the frame follows the direction
        d = stack(3)
        for c in range(3):
            d[c] = x[ALONG + c] - x[c]
        if renew != 0:
            for c in range(3):
                frame[4 + c] = d[c]
        else:
            turn_of_directions(frame[4:], d, turn)
        return
    turn[0], turn[1], turn[2], turn[3] = 1.0, 0.0, 0.0, 0.0
    # A law in the axes of a body
    k = 0 if own[DIMENSION] != 3 else 1  # a law has the axes of a; those of the ground stay where they are
    if own[DIMENSION + k] == 7:
        p = q[own[AT + k] + 3 : own[AT + k] + 7]
        if renew != 0:
            for c in range(4):
                frame[c] = p[c]
        else:
            turn_of_bodies(frame, p, turn)


@part
def _law_derivatives(x, xd, q, own, par, t, renew, kept, fx, fxd):
    """f_x and f_xd: evaluated and stored with `renew`, else the stored ones, rotated with the force's frame."""
    turn, old_x, old_xd = stack(4), kept[:], kept[SIZE * SIZE :]
    if renew != 0:
        kernel_derivatives(x, xd, par, t, fx, fxd)
        for k in range(SIZE):
            for c in range(SIZE):
                old_x[k * SIZE + c], old_xd[k * SIZE + c] = fx[k, c], fxd[k, c]
    _follow_frame(q, own, x, renew, kept[2 * SIZE * SIZE :], turn)
    # T f_x T^T with the rotation T of the frame since the derivatives were taken
    if renew == 0:
        for j in range(MARKERS):
            for k in range(MARKERS):
                turn_block(CODES[j], CODES[k], turn, old_x, SIZE, STARTS[j], STARTS[k], fx)
                turn_block(CODES[j], CODES[k], turn, old_xd, SIZE, STARTS[j], STARTS[k], fxd)


@part
def _add_products(own, fx, fxd, W, X, Y, n, Q_q, Q_qd):
    """Q_q += W^T (f_x X + f_xd Y), Q_qd += W^T f_xd W, at the coordinates of the two bodies."""
    h, hd = stack(SIZE), stack(SIZE)
    for c in range(SPAN):
        if c % 7 >= own[DIMENSION + c // 7]:
            continue
        # Columns of f_x X + f_xd Y and of f_xd W
        for r in range(SIZE):
            y, yd = 0.0, 0.0
            for k in range(SIZE):
                y += fx[r, k] * X[k, c] + fxd[r, k] * Y[k, c]
                yd += fxd[r, k] * W[k, c]
            h[r], hd[r] = y, yd
        column = own[AT + c // 7] + c % 7
        # W^T times them
        for r in range(SPAN):
            if r % 7 < own[DIMENSION + r // 7]:
                y, yd = 0.0, 0.0
                for k in range(SIZE):
                    y += W[k, r] * h[k]
                    yd += W[k, r] * hd[k]
                place = (own[AT + r // 7] + r % 7) * n + column
                Q_q[place] += y
                Q_qd[place] += yd


class ForceExtent(Record):
    """What the loop of Jacobians reads of all instances of a kind; the records of their kinds begin with it."""

    count: int
    stride: int  # reals of each
    columns: int  # of Q_q and Q_qd


force_extent = record_at(ForceExtent)


def jacobian(kind, table, reals, q, qd, t, Q_q, Q_qd, renew, kept):
    """Q_q, Q_qd (n, n) += the Jacobians of all instances.

    With `renew` the derivatives of the law are evaluated and stored, (2 SIZE^2 + FRAME) floats an instance; otherwise
    the stored ones are rotated with the force's frame. What follows from geometry is always exact.
    """
    kept, table, reals = vector(kept, ANY), integers(table, ANY), vector(reals, ANY)
    q, qd, Q_q, Q_qd = vector(q, ANY), vector(qd, ANY), vector(Q_q, ANY), vector(Q_qd, ANY)
    kind = force_extent(kind)
    count, stride, n = kind.count, kind.stride, kind.columns
    x, xd, f = stack(SIZE), stack(SIZE), stack(SIZE)
    fx, fxd = stack2(SIZE, SIZE), stack2(SIZE, SIZE)
    W, X, Y = stack2(SIZE, SPAN), stack2(SIZE, SPAN), stack2(SIZE, SPAN)
    for i in range(count):
        own, real = table[i * FORCE_INTS : (i + 1) * FORCE_INTS], reals[i * stride : (i + 1) * stride]
        for r in range(SIZE):
            f[r] = 0.0
        # W, X, Y; the force f; f_x and f_xd
        _differentiate_markers(q, qd, own, real, x, xd, W, X, Y)
        kernel_law(x, xd, real[3 * MARKERS :], t, f)
        _law_derivatives(x, xd, q, own, real[3 * MARKERS :], t, renew, kept[i * KEPT :], fx, fxd)
        # (W^T f)_q at constant f, then the products
        for j in range(MARKERS):
            k, s = OWNERS[j], real[3 * j : 3 * j + 3]
            carry_back_derivative(CODES[j], own[DIMENSION + k], own[AT + k], s, f[STARTS[j] :], n, Q_q)
        _add_products(own, fx, fxd, W, X, Y, n, Q_q, Q_qd)
    return 0
