"""Second derivatives of the constraints, for implicit methods: loops over all instances of a kind of primitive.

    K  += (Phi_q^T lam)_q                          (n, n)
    G1  = (Phi_q qd)_q + Phi_qt                    (m, n)   derivative of Phi_q qd + Phi_t with respect to q
    G2  = (Phi_q qdd)_q + gamma_q                  (m, n)   derivative of Phi_q qdd + gamma with respect to q

Complex steps of the primitive's jacobian and gamma in the marker coordinates x and xd give its own part, exact to
rounding. The chain rule x(q) is quadratic in q, so its second derivative is `rotate_gradient` with another p.
"""

from typing import NamedTuple

import numpy as np

from ...jit.kernels import ANY, complex_stack, complex_stack2, integers, kernel, part, stack, stack2, vector
from ...maths.vectors import rotate_gradient
from ..markers import PARAMETERS, chain_rule, rate
from ..tolerances import CONSTRAINT_STEP
from .coordinate_rows import INTS, ROW, STRIDE
from .template import (
    CODES,
    MARKERS,
    OTHERS,
    OWNERS,
    RATES_FROM,
    ROWS,
    SIZE,
    SPAN,
    STARTS,
    SUMMED,
    differentiate,
    kernel_drift,
    kernel_gamma,
    kernel_jacobian,
    move_markers,
    place_markers,
    place_of,
)

STIFFNESS = "iipppdpp"  # count, stride, table, reals, q, t, lam, K
SLOPES = "iipppppdpp"  # count, stride, table, reals, q, qd, qdd, t, G1, G2


class Slopes(NamedTuple):
    """Derivatives of one instance with respect to its markers, each (ROWS, SIZE)."""

    J: np.ndarray  # Phi_x
    a1: np.ndarray  # Phi_xx xd + Phi_xt = (Phi_x xd + Phi_t)_x
    a2: np.ndarray  # Phi_xx xdd + gamma_x
    g_xd: np.ndarray  # gamma_xd


@kernel
def _chain_second(code, dimension, at, w, s, f, out):
    """out += f x_qq w, w (n,) being a velocity or an acceleration."""
    if dimension == 7 and code != PARAMETERS:
        g = stack(4)
        rotate_gradient(w[at + 3 : at + 7], s, f[0], f[1], f[2], g)
        for i in range(4):
            out[3 + i] += g[i]


@part
def _accelerate_markers(q, qdd, own, real, xdd):
    """xdd += x_q qdd."""
    pushed = stack(4)
    for j in range(MARKERS):
        c, s = STARTS[j], real[3 * j : 3 * j + 3]
        at, dimension = place_of(own, real, OWNERS[j])
        rate(CODES[j], dimension, at, q, qdd, s, pushed)
        for b in range(4 if CODES[j] == PARAMETERS else 3):
            xdd[c + b] += pushed[b]


@part
def _slope_of_jacobian(z, x, c, par, t, zJ):
    """Im zJ = h Phi_x,x_c by a step along x_c; z = x on entry, but for that step on exit."""
    z[c] = complex(x[c], CONSTRAINT_STEP)
    for r in range(ROWS):
        for d in range(SIZE):
            zJ[r, d] = 0.0
    kernel_jacobian(z, par, t, zJ)


@part
def _derive_rates(x, xd, xdd, par, t, slopes):
    """The `Slopes`, by complex steps along x_c and xd_c.

    gamma_xd = 2 (Phi_xx xd + Phi_xt), since gamma is quadratic in xd. Of a row on velocities A_x isn't symmetric, and
    a1 = (A xd + b)_x.
    """
    J, a1, a2, g_xd = slopes
    z, zd = complex_stack(SIZE), complex_stack(SIZE)
    zJ, zg, zb = complex_stack2(ROWS, SIZE), complex_stack(ROWS), complex_stack(ROWS)
    for c in range(SIZE):
        z[c], zd[c] = x[c], xd[c]
    differentiate(x, par, t, J)
    for c in range(SIZE):
        # Along x_c: a2 = Phi_xx xdd + gamma_x
        _slope_of_jacobian(z, x, c, par, t, zJ)
        kernel_gamma(z, zd, par, t, zg)
        kernel_drift(z, par, t, zb)
        z[c] = x[c]
        for r in range(RATES_FROM, ROWS):
            a1[r, c] = zb[r].imag / CONSTRAINT_STEP
            for d in range(SIZE):
                a1[r, c] += zJ[r, d].imag / CONSTRAINT_STEP * xd[d]
        for r in range(ROWS):
            total = zg[r].imag / CONSTRAINT_STEP
            for d in range(SIZE):
                total += zJ[r, d].imag / CONSTRAINT_STEP * xdd[d]
            a2[r, c] = total
        # Along xd_c: gamma_xd
        zd[c] = complex(xd[c], CONSTRAINT_STEP)
        kernel_gamma(z, zd, par, t, zg)
        zd[c] = xd[c]
        for r in range(ROWS):
            g_xd[r, c] = zg[r].imag / CONSTRAINT_STEP
        for r in range(RATES_FROM):
            a1[r, c] = 0.5 * g_xd[r, c]


@part
def _derive_reaction(x, par, t, lam, J, H):
    """J = Phi_x and H (SIZE, SIZE) = (Phi_x^T lam)_x, by complex steps along x_c."""
    z, zJ = complex_stack(SIZE), complex_stack2(ROWS, SIZE)
    for c in range(SIZE):
        z[c] = x[c]
        for d in range(SIZE):
            H[c, d] = 0.0
    differentiate(x, par, t, J)
    for c in range(SIZE):
        _slope_of_jacobian(z, x, c, par, t, zJ)
        z[c] = x[c]
        for r in range(ROWS):
            for d in range(SIZE):
                H[d, c] += lam[r] * (zJ[r, d].imag / CONSTRAINT_STEP)


@part
def _fill_row(q, qd, own, real, along_x, along_second, out):
    """out (n,) = along_x x_q + along_second x_qq qd, for one row of G1 or G2, at its bodies; added to a sum."""
    row = stack(SPAN)
    for i in range(SPAN):
        row[i] = 0.0
    for j in range(MARKERS):
        # First order: along_x x_q. Second order: along_second x_qq qd
        k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
        code, (at, dimension) = CODES[j], place_of(own, real, k)
        chain_rule(code, dimension, at, q, s, along_x[c:], 0, row[7 * k :])
        _chain_second(code, dimension, at, qd, s, along_second[c:], row[7 * k :])
    for body in range(2 + OTHERS):
        first, dimension = place_of(own, real, body)
        for i in range(dimension):
            out[first + i] = out[first + i] + row[7 * body + i] if SUMMED else row[7 * body + i]


@part
def _pull_back(q, own, real, H, XHX):
    """XHX (SPAN, SPAN) = x_q^T H x_q."""
    HX, where, row = stack2(SIZE, SPAN), stack(4), stack(SPAN)
    for i in range(SPAN):
        for d in range(SPAN):
            XHX[i, d] = 0.0
    # HX = H x_q, row by row
    for i in range(SIZE):
        for d in range(SPAN):
            HX[i, d] = 0.0
        for j in range(MARKERS):
            k, s = OWNERS[j], real[3 * j : 3 * j + 3]
            at, dimension = place_of(own, real, k)
            chain_rule(CODES[j], dimension, at, q, s, H[i, STARTS[j] :], 0, HX[i, 7 * k :])
    # x_q^T HX, column by column
    for d in range(SPAN):
        for j in range(MARKERS):
            k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
            at, dimension = place_of(own, real, k)
            for b in range(4):
                where[b] = HX[c + b, d] if c + b < SIZE else 0.0
            for b in range(7):
                row[b] = 0.0
            chain_rule(CODES[j], dimension, at, q, s, where, 0, row)
            for b in range(dimension):
                XHX[7 * k + b, d] += row[b]


@part
def _add_geometric(own, real, lam, J, XHX):
    """XHX += (Phi_x^T lam) x_qq: an orientation bends the path of a marker."""
    where, e = stack(4), stack(4)
    for j in range(MARKERS):
        k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
        if place_of(own, real, k)[1] == 7 and CODES[j] != PARAMETERS:
            # f = Phi_x^T lam, the force on the marker
            x, y, z = 0.0, 0.0, 0.0
            for r in range(ROWS):
                x += lam[r] * J[r, c]
                y += lam[r] * J[r, c + 1]
                z += lam[r] * J[r, c + 2]
            # (A(p) s)_p p is quadratic in p: its derivative by p_d is the pull-back of f at p = e_d
            for d in range(4):
                for b in range(4):
                    where[b] = 1.0 if b == d else 0.0
                rotate_gradient(where, s, x, y, z, e)
                for b in range(4):
                    XHX[7 * k + 3 + b, 7 * k + 3 + d] += e[b]


def geometric_stiffness(count, stride, table, reals, q, t, lam, K):
    """All instances: K += (Phi_q^T lam)_q."""
    table, reals, q = integers(table, ANY), vector(reals, ANY), vector(q, ANY)
    lam, K = vector(lam, ANY), vector(K, ANY)
    x, J, H, XHX = stack(SIZE), stack2(ROWS, SIZE), stack2(SIZE, SIZE), stack2(SPAN, SPAN)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride :]
        own_lam, n = lam[own[ROW] :], own[STRIDE]
        place_markers(q, own, real, x)
        _derive_reaction(x, real[3 * MARKERS :], t, own_lam, J, H)
        # K += x_q^T H x_q + f x_qq
        _pull_back(q, own, real, H, XHX)
        _add_geometric(own, real, own_lam, J, XHX)
        for one in range(2 + OTHERS):
            for other in range(2 + OTHERS):
                (at, dimension), (to, width) = place_of(own, real, one), place_of(own, real, other)
                for e in range(dimension):
                    for d in range(width):
                        K[(at + e) * n + to + d] += XHX[7 * one + e, 7 * other + d]
    return 0


def rate_slopes(count, stride, table, reals, q, qd, qdd, t, G1, G2):
    """All instances: their rows of G1 and G2."""
    table, reals, qdd = integers(table, ANY), vector(reals, ANY), vector(qdd, ANY)
    q, qd, G1, G2 = vector(q, ANY), vector(qd, ANY), vector(G1, ANY), vector(G2, ANY)
    x, xd, xdd = stack(SIZE), stack(SIZE), stack(SIZE)
    J, a1, a2, g_xd = stack2(ROWS, SIZE), stack2(ROWS, SIZE), stack2(ROWS, SIZE), stack2(ROWS, SIZE)
    slopes = Slopes(J, a1, a2, g_xd)
    for i in range(count):
        # Markers at q and qd, and their accelerations with qdd
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride :]
        move_markers(q, qd, own, real, x, xd, xdd)
        _accelerate_markers(q, qdd, own, real, xdd)
        _derive_rates(x, xd, xdd, real[3 * MARKERS :], t, slopes)
        for r in range(ROWS):
            row = (own[ROW] + r) * own[STRIDE]
            _fill_row(q, qd, own, real, a1[r], J[r], G1[row:])
            _fill_row(q, qd, own, real, a2[r], g_xd[r], G2[row:])
            for j in range(MARKERS):
                c, s = STARTS[j], real[3 * j : 3 * j + 3]
                at, dimension = place_of(own, real, OWNERS[j])
                _chain_second(CODES[j], dimension, at, qdd, s, J[r, c:], G2[row + at :])
    return 0
