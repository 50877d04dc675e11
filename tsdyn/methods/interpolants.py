"""Interpolants: one block of numbers a step, and the motion inside the step from that block.

    fill(context, place, accelerate, first_order, t, h, n, nx, ny,
         x0, y0, yd0, x1, y1, yd1, xd1, before, now, tableau, memory, data)     the block of a step; Status
    value(s, h, n, nx, ny, data, x, y)                                          x and y at t + s h

0 marks the start of the step and 1 its end; before and now hold q, qd, qdd there. A fill may evaluate the equations by
place and accelerate; the caller restores the workspace.
"""

from collections.abc import Callable
from typing import NamedTuple

from ..jit.kernels import ANY, Callback, callback, caller, kernel, vector
from ..maths.dense_linalg import copy
from .explicit import combine, stage

FILL, VALUE = "piiiddiii" + 12 * "p", "ddiiippp"
call_fill = caller(FILL)
call_value = caller(VALUE)


class Interpolant(NamedTuple):
    """Two kernels, the floats that a step's block takes, and the order of the error between the steps."""

    fill: Callback
    value: Callback
    size: Callable  # of n, nx, ny
    order: int = 5  # of x and y together


@kernel
def _quintic(s, h, a, ad, add, b, bd, bdd, out, outd):
    """Quintic Hermite interpolation at s in (0, 1) of a step h, and its derivative."""
    s2 = s * s
    s3 = s2 * s
    f = s3 * (10.0 + s * (6.0 * s - 15.0))
    fd = 30.0 * s2 * (1.0 + s * (s - 2.0)) / h
    g0, g0d = s + s3 * (s * (8.0 - 3.0 * s) - 6.0), 1.0 + s2 * (s * (32.0 - 15.0 * s) - 18.0)
    g1, g1d = s3 * (s * (7.0 - 3.0 * s) - 4.0), s2 * (s * (28.0 - 15.0 * s) - 12.0)
    k0, k0d = 0.5 * (s2 - s3 * (3.0 + s * (s - 3.0))), s + 0.5 * s2 * (s * (12.0 - 5.0 * s) - 9.0)
    k1, k1d = 0.5 * s3 * (1.0 + s * (s - 2.0)), 0.5 * s2 * (3.0 + s * (5.0 * s - 8.0))
    for i in range(out.size):
        step = b[i] - a[i]
        out[i] = a[i] + f * step + h * (g0 * ad[i] + g1 * bd[i]) + h * h * (k0 * add[i] + k1 * bdd[i])
        if outd.size > 0:
            outd[i] = fd * step + g0d * ad[i] + g1d * bd[i] + h * (k0d * add[i] + k1d * bdd[i])


@kernel
def _cubic(s, h, a, ad, b, bd, out):
    """Cubic Hermite interpolation."""
    f = s * s * (3.0 - 2.0 * s)
    g0, g1 = s * (s - 1.0) * (s - 1.0), s * s * (s - 1.0)
    for i in range(out.size):
        out[i] = a[i] + f * (b[i] - a[i]) + h * (g0 * ad[i] + g1 * bd[i])


@callback(FILL)
def fill_hermite(
    context, place, accelerate, first_order, t, h, n, nx, ny,
    x0, y0, yd0, x1, y1, yd1, xd1, before, now, tableau, memory, data,
):  # fmt: skip
    """x, x', x'' at both ends, x' being y."""
    data = vector(data, 6 * nx)
    copy(vector(x0, nx), data)
    copy(vector(y0, nx), data[nx:])
    copy(vector(yd0, nx), data[2 * nx :])
    copy(vector(x1, nx), data[3 * nx :])
    copy(vector(y1, nx), data[4 * nx :])
    copy(vector(yd1, nx), data[5 * nx :])
    return 0


@callback(VALUE)
def hermite(s, h, n, nx, ny, data, x, y):
    """Quintic Hermite interpolation of x, and of y by its derivative."""
    d, k = vector(data, 6 * nx), nx
    _quintic(s, h, d, d[k:], d[2 * k :], d[3 * k :], d[4 * k :], d[5 * k :], vector(x, k), vector(y, k))
    return 0


@callback(FILL)
def fill_hermite_first_order(
    context, place, accelerate, first_order, t, h, n, nx, ny,
    x0, y0, yd0, x1, y1, yd1, xd1, before, now, tableau, memory, data,
):  # fmt: skip
    """q, qd, qdd at both ends, then y and y' at both."""
    data = vector(data, 6 * n + 4 * ny)
    copy(vector(before, 3 * n), data)
    copy(vector(now, 3 * n), data[3 * n :])
    data = data[6 * n :]
    copy(vector(y0, ny), data)
    copy(vector(yd0, ny), data[ny:])
    copy(vector(y1, ny), data[2 * ny :])
    copy(vector(yd1, ny), data[3 * ny :])
    return 0


@callback(VALUE)
def hermite_first_order(s, h, n, nx, ny, data, x, y):
    """Quintic for x = q, cubic for y, whose second derivative nothing gives."""
    d = vector(data, 6 * n + 4 * ny)
    _quintic(s, h, d, d[n:], d[2 * n :], d[3 * n :], d[4 * n :], d[5 * n :], vector(x, n), vector(y, 0))
    d = d[6 * n :]
    _cubic(s, h, d, d[ny:], d[2 * ny :], d[3 * ny :], vector(y, ny))
    return 0


@callback(VALUE)
def hermite_second(s, h, n, nx, ny, data, x, y):
    """The second derivative of the quintic for x, as y; x is left alone."""
    d, k, y = vector(data, 6 * nx), nx, vector(y, nx)
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
HERMITE_FIRST_ORDER = Interpolant(fill_hermite_first_order, hermite_first_order, lambda n, nx, ny: 6 * n + 4 * ny, 4)

POWER = 7  # rows of the polynomial of DOP853


@callback(FILL)
def fill_dop853(
    context, place, accelerate, first_order, t, h, n, nx, ny,
    x0, y0, yd0, x1, y1, yd1, xd1, before, now, tableau, memory, data,
):  # fmt: skip
    """(x, y) at the start and seven rows F, by three more stages; Hairer, Norsett, Wanner, II.6, Eq. (6.13)."""
    x0, y0, x1, y1, yd1 = vector(x0, nx), vector(y0, ny), vector(x1, nx), vector(y1, ny), vector(yd1, ny)
    tableau, memory = vector(tableau, ANY), vector(memory, ANY)
    size = nx + ny
    data = vector(data, (1 + POWER) * size)
    stages = int(tableau[0])
    numbers = tableau[1 + stages * (2 + stages) + stages + 2 * (stages + 1) :]
    first, last = memory[size:], memory[(1 + stages) * size :]
    copy(vector(xd1, nx) if first_order == 1 else y1, last)
    copy(yd1, last[nx:])
    copy(x0, data)
    copy(y0, data[nx:])
    for c in range(size):
        step = x1[c] - x0[c] if c < nx else y1[c - nx] - y0[c - nx]
        data[size + c] = step
        data[2 * size + c] = h * first[c] - step
        data[3 * size + c] = 2.0 * step - h * (last[c] + first[c])
    total = stages + 4
    for i in range(stages + 1, total):
        status = stage(
            context, place, accelerate, first_order == 0, t + h * numbers[0], h, i, nx, ny, x0, y0, numbers[1:], memory
        )
        if status != 0:  # too long a step, with tolerances as loose: the cubic of its two ends is what it gets
            for c in range(4 * size, (1 + POWER) * size):
                data[c] = 0.0
            return 0
        numbers = numbers[1 + total :]
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
