"""Constraint rows in the coordinates q, one loop a kind: Phi, Phi_t, Phi_q, gamma, and what instances remember.

Phi_q = Phi_x x_q                          (1)
gamma = gamma(x, xd) + Phi_x (x_q qd)_q qd (2), with qdd = 0 in xdd
"""

from ...jit.kernels import ANY, caller, integers, stack, stack2, vector
from ..markers import chain_rule
from .template import (
    AT,
    CODES,
    DIMENSION,
    FIRST,
    MARKERS,
    OWNERS,
    ROWS,
    SIZE,
    STARTS,
    SUMMED,
    acceleration_bias,
    differentiate,
    kernel_value,
    move_markers,
    place_markers,
)

# what the table of a kind holds for each instance behind AT and DIMENSION: where its parts of Phi_q begin, its first
# row, the length of a row of Phi_q
BLOCK, ROW, STRIDE, INTS = 4, 6, 7, 8
SIGNATURE = "iippppdp"  # count, reals per instance, table, reals, q, qd, t, out
call_kind = caller(SIGNATURE)


def values(count, stride, table, reals, q, qd, t, out):
    """out = Phi, or Phi_t."""
    table, reals, q, out = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(out, ANY)
    x, f = stack(SIZE), stack(ROWS)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride :]
        place_markers(q, own, real, x)
        kernel_value(x, real[3 * MARKERS :], t, f)
        for r in range(ROWS):
            out[own[ROW] + r] = out[own[ROW] + r] + f[r] if SUMMED else f[r]
    return 0


def remembers(count, stride, table, reals, q, qd, t, out):
    """The last real of each instance = remember(x, par, t) of its kind, after an accepted step."""
    table, reals, q = integers(table, ANY), vector(reals, ANY), vector(q, ANY)
    x = stack(SIZE)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride :]
        place_markers(q, own, real, x)
        real[stride - 1] = kernel_value(x, real[3 * MARKERS :], t)
    return 0


def jacobian(count, stride, table, reals, q, qd, t, out):
    """out = Phi_q, Eq. (1), the columns of the two bodies only."""
    table, reals, q, out = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(out, ANY)
    x, f = stack(SIZE), stack2(ROWS, SIZE)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride :]
        place_markers(q, own, real, x)
        differentiate(x, real[3 * MARKERS :], t, f)
        for r in range(ROWS):
            for j in range(MARKERS):
                # Phi_x x_q at the coordinates of the marker's body
                k = OWNERS[j]
                if k > 1:
                    continue
                block = own[BLOCK + k] + r * own[STRIDE]
                s, row = real[3 * j : 3 * j + 3], f[r, STARTS[j] :]
                fresh = 0 if SUMMED else FIRST[j]
                chain_rule(CODES[j], own[DIMENSION + k], own[AT + k], q, s, row, fresh, out[block:])
    return 0


def bias(count, stride, table, reals, q, qd, t, out):
    """out = gamma of q, Eq. (2)."""
    table, reals, q, out = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(out, ANY)
    qd = vector(qd, ANY)
    x, xd, xdd = stack(SIZE), stack(SIZE), stack(SIZE)
    f, g = stack2(ROWS, SIZE), stack(ROWS)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride :]
        # xdd holds (x_q qd)_q qd
        move_markers(q, qd, own, real, x, xd, xdd)
        acceleration_bias(x, xd, xdd, real[3 * MARKERS :], t, f, g, out[own[ROW] :])
    return 0
