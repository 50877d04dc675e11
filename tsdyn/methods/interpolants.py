"""Interpolants: one block of numbers a step, and the motion inside the step from that block.

    fill(context, run)                    the data of the step that the `RunState` has just made, in its block; Status
    value(s, h, n, nx, ny, data, x, y)    x and y at t + s h

In the `RunState`, x, y, yd, xd and now (q, qd, qdd) are those of the step's end, x_old, y_old, yd_old and before those
of its start; start and length are in the block. A fill may evaluate the equations; the caller restores the workspace.
"""

from collections.abc import Callable
from typing import NamedTuple

from ..jit.kernels import Callback, callback, caller, kernel, vector
from ..maths.dense_linalg import copy
from ..workspaces import B_DATA, B_H, B_START, MIXED, load_run
from .explicit import combine, stage

FILL, VALUE = "pp", "ddiiippp"
call_fill = caller(FILL)
call_value = caller(VALUE)


class Interpolant(NamedTuple):
    """Two kernels, the floats that a step's block takes, and the order of the error between the steps."""

    fill: Callback
    value: Callback
    size: Callable  # of n, nx, ny
    order: int = 5  # of x and y together


@kernel
def quintic(s, h, n, d, out, outd):
    """Quintic Hermite interpolation at s in (0, 1) of a step h, and its derivative.

    d holds n values, n first and n second derivatives of the start, then those of the end.
    """
    # Weights of a value difference, of first derivatives (g) and of second ones (k) at both ends
    s2 = s * s
    s3 = s2 * s
    f = s3 * (10.0 + s * (6.0 * s - 15.0))
    fd = 30.0 * s2 * (1.0 + s * (s - 2.0)) / h
    g0, g0d = s + s3 * (s * (8.0 - 3.0 * s) - 6.0), 1.0 + s2 * (s * (32.0 - 15.0 * s) - 18.0)
    g1, g1d = s3 * (s * (7.0 - 3.0 * s) - 4.0), s2 * (s * (28.0 - 15.0 * s) - 12.0)
    k0, k0d = 0.5 * (s2 - s3 * (3.0 + s * (s - 3.0))), s + 0.5 * s2 * (s * (12.0 - 5.0 * s) - 9.0)
    k1, k1d = 0.5 * s3 * (1.0 + s * (s - 2.0)), 0.5 * s2 * (3.0 + s * (5.0 * s - 8.0))
    for i in range(out.size):
        a, ad, add = d[i], d[n + i], d[2 * n + i]
        b, bd, bdd = d[3 * n + i], d[4 * n + i], d[5 * n + i]
        step = b - a
        out[i] = a + f * step + h * (g0 * ad + g1 * bd) + h * h * (k0 * add + k1 * bdd)
        if outd.size > 0:
            outd[i] = fd * step + g0d * ad + g1d * bd + h * (k0d * add + k1d * bdd)


@kernel
def cubic(s, h, d, out):
    """Cubic Hermite interpolation; d holds values and derivatives of the start, then those of the end."""
    n = out.size
    # Weights of the difference of values and of both derivatives
    f = s * s * (3.0 - 2.0 * s)
    g0, g1 = s * (s - 1.0) * (s - 1.0), s * s * (s - 1.0)
    for i in range(n):
        a, b = d[i], d[2 * n + i]
        out[i] = a + f * (b - a) + h * (g0 * d[n + i] + g1 * d[3 * n + i])


@callback(FILL)
def fill_hermite(context, run):
    """x, x', x'' at both ends, x' being y."""
    r = load_run(run)
    data, nx = r.block[B_DATA:], r.x.size
    copy(r.x_old, data)
    copy(r.y_old, data[nx:])
    copy(r.yd_old, data[2 * nx :])
    copy(r.x, data[3 * nx :])
    copy(r.y, data[4 * nx :])
    copy(r.yd, data[5 * nx :])
    return 0


@callback(VALUE)
def hermite(s, h, n, nx, ny, data, x, y):
    """Quintic Hermite interpolation of x, and of y by its derivative."""
    quintic(s, h, nx, vector(data, 6 * nx), vector(x, nx), vector(y, nx))
    return 0


@callback(FILL)
def fill_hermite_first_order(context, run):
    """x, x', x'' at both ends, then y and y' at both; x is q, or x'' is that of the cubic of x and x'."""
    r = load_run(run)
    data, n, ny, h = r.block[B_DATA:], r.x.size, r.y.size, r.block[B_H]
    if r.numbers.first_order == MIXED:
        for i in range(n):
            a, ad, b, bd = r.x_old[i], r.xd_old[i], r.x[i], r.xd[i]
            slope = (b - a) / h
            data[i], data[n + i], data[2 * n + i] = a, ad, (6.0 * slope - 4.0 * ad - 2.0 * bd) / h
            data[3 * n + i], data[4 * n + i], data[5 * n + i] = b, bd, (2.0 * ad + 4.0 * bd - 6.0 * slope) / h
    else:
        for i in range(3):
            copy(r.before[i], data[i * n :])
            copy(r.now[i], data[(3 + i) * n :])
    data = data[6 * n :]
    copy(r.y_old, data)
    copy(r.yd_old, data[ny:])
    copy(r.y, data[2 * ny :])
    copy(r.yd, data[3 * ny :])
    return 0


@callback(VALUE)
def hermite_first_order(s, h, n, nx, ny, data, x, y):
    """Quintic for x, cubic for y, whose second derivative nothing gives."""
    d = vector(data, 6 * nx + 4 * ny)
    quintic(s, h, nx, d, vector(x, nx), vector(y, 0))
    cubic(s, h, d[6 * nx :], vector(y, ny))
    return 0


@callback(VALUE)
def cubic_rate(s, h, n, nx, ny, data, x, y):
    """The derivative of the cubic for y of `hermite_first_order`, as y; x is left alone."""
    d, y = vector(data, 6 * nx + 4 * ny)[6 * nx :], vector(y, ny)
    f, g0, g1 = 6.0 * s * (1.0 - s) / h, 1.0 + s * (3.0 * s - 4.0), s * (3.0 * s - 2.0)
    for i in range(ny):
        y[i] = f * (d[2 * ny + i] - d[i]) + g0 * d[ny + i] + g1 * d[3 * ny + i]
    return 0


@callback(VALUE)
def hermite_second(s, h, n, nx, ny, data, x, y):
    """The second derivative of the quintic for x, as y; x is left alone."""
    d, k, y = vector(data, 6 * nx), nx, vector(y, nx)
    # Second derivatives of the weights of `quintic`, over h^2
    f = 60.0 * s * (1.0 + s * (2.0 * s - 3.0)) / (h * h)
    g0, g1 = s * (s * (96.0 - 60.0 * s) - 36.0) / h, s * (s * (84.0 - 60.0 * s) - 24.0) / h
    k0, k1 = 1.0 + s * (s * (18.0 - 10.0 * s) - 9.0), s * (3.0 + s * (10.0 * s - 12.0))
    for i in range(nx):
        y[i] = f * (d[3 * k + i] - d[i]) + g0 * d[k + i] + g1 * d[4 * k + i] + k0 * d[2 * k + i] + k1 * d[5 * k + i]
    return 0


@callback(VALUE)
def linear_second(s, h, n, nx, ny, data, x, y):
    """In place of `hermite_second` for methods of order two, whose steps' errors it divides by h^2."""
    d, k, y = vector(data, 6 * nx), nx, vector(y, nx)
    for i in range(nx):
        y[i] = (1.0 - s) * d[2 * k + i] + s * d[5 * k + i]
    return 0


HERMITE = Interpolant(fill_hermite, hermite, lambda n, nx, ny: 6 * nx)
HERMITE_FIRST_ORDER = Interpolant(fill_hermite_first_order, hermite_first_order, lambda n, nx, ny: 6 * nx + 4 * ny, 4)

POWER = 7  # rows of the polynomial of DOP853


@callback(FILL)
def fill_dop853(context, run):
    """(x, y) at the start and seven rows F, by three more stages; Hairer, Norsett, Wanner, II.6, Eq. (6.13)."""
    r = load_run(run)
    nx, ny, memory, second = r.x.size, r.y.size, r.memory, r.numbers.first_order == 0
    t, h, size, data = r.block[B_START], r.block[B_H], nx + ny, r.block[B_DATA:]
    stages = int(r.tableau[0])
    numbers = r.tableau[1 + stages * (2 + stages) + stages + 2 * (stages + 1) :]
    # Derivatives at both ends
    first, last = memory[size:], memory[(1 + stages) * size :]
    copy(r.y if second else r.xd, last)
    copy(r.yd, last[nx:])
    copy(r.x_old, data)
    copy(r.y_old, data[nx:])
    for c in range(size):
        # F0 = dx,  F1 = h k_1 - dx,  F2 = 2 dx - h (k_end + k_1)
        step = r.x[c] - r.x_old[c] if c < nx else r.y[c - nx] - r.y_old[c - nx]
        data[size + c] = step
        data[2 * size + c] = h * first[c] - step
        data[3 * size + c] = 2.0 * step - h * (last[c] + first[c])
    # Three more stages
    total = stages + 4
    for i in range(stages + 1, total):
        if stage(context, r, second, t, h, i, numbers) != 0:
            # too long a step, with tolerances as loose: the cubic of its two ends is what it gets
            for c in range(4 * size, (1 + POWER) * size):
                data[c] = 0.0
            return 0
        numbers = numbers[1 + total :]
    # F3 to F6 are combinations of all stages
    for row in range(4, 1 + POWER):
        combine(numbers, total, h, size, memory, data[row * size :])
        numbers = numbers[total:]
    return 0


@callback(VALUE)
def dop853(s, h, n, nx, ny, data, x, y):
    """The polynomial of order seven in (x, y): F0 s + F1 s (1 - s) + F2 s^2 (1 - s) + ..."""
    size = nx + ny
    data, x, y = vector(data, (1 + POWER) * size), vector(x, nx), vector(y, ny)
    for c in range(size):
        # Horner's scheme with factors s and 1 - s in turn
        z = 0.0
        for row in range(POWER, 0, -1):
            z = (z + data[row * size + c]) * (s if row % 2 == 1 else 1.0 - s)
        z += data[c]
        if c < nx:
            x[c] = z
        else:
            y[c - nx] = z
    return 0


DOP853 = Interpolant(fill_dop853, dop853, lambda n, nx, ny: (1 + POWER) * (nx + ny), 7)
