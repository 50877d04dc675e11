"""Second derivatives of the constraints, for implicit methods: one loop over all instances of a kind of primitive.

    K  += (Phi_q^T lam)_q                          (n, n)
    G1  = (Phi_q qd)_q + Phi_qt                    (m, n)   derivative of Phi_q qd + Phi_t with respect to q
    G2  = (Phi_q qdd)_q + gamma_q                  (m, n)   derivative of Phi_q qdd + gamma with respect to q

Complex steps of the primitive's jacobian and gamma in the marker coordinates x and xd give its own part, exact to
rounding. The chain rule x(q) is quadratic in q, so its second derivative is `rotate_gradient` with another p.
"""

from ...jit.kernels import ANY, complex_stack, complex_stack2, integers, kernel, matrix, stack, stack2, vector
from ...maths.euler_parameters import rotate_gradient
from ..markers import PARAMETERS, chain_rule, motion, rate

SIGNATURE = "iipppppdpippp"  # count, stride, table, reals, q, qd, qdd, t, lam, n, K, G1, G2
STEP = 1e-100
SPAN = 14  # coordinates of two bodies

# filled in by primitive._compile
ROWS = MARKERS = SIZE = 1
CODES = OWNERS = STARTS = (0,)
AT = DIMENSION = ROW = INTS = 0
kernel_jacobian = kernel_gamma = None


@kernel
def _chain_second(code, dimension, at, w, s, f, out):
    """out += f x_qq w, w (n,) being a velocity or an acceleration."""
    if dimension == 7 and code != PARAMETERS:
        g = stack(4)
        rotate_gradient(w[at + 3 : at + 7], s, f[0], f[1], f[2], g)
        for i in range(4):
            out[3 + i] += g[i]


def loop(count, stride, table, reals, q, qd, qdd, t, lam, n, K, G1, G2):
    """Template of the loop over all instances; the names in capitals and kernel_* are filled in by primitive.py."""
    table, reals, lam = integers(table, ANY), vector(reals, ANY), vector(lam, ANY)
    q, qd, qdd = vector(q, n), vector(qd, n), vector(qdd, n)
    K, G1, G2 = matrix(K, n, n), vector(G1, ANY), vector(G2, ANY)
    x, xd, xdd = stack(SIZE), stack(SIZE), stack(SIZE)
    z, zd = complex_stack(SIZE), complex_stack(SIZE)
    zJ, zg = complex_stack2(ROWS, SIZE), complex_stack(ROWS)
    J, a1, a2, g_xd = stack2(ROWS, SIZE), stack2(ROWS, SIZE), stack2(ROWS, SIZE), stack2(ROWS, SIZE)
    H, HX, XHX, f = stack2(SIZE, SIZE), stack2(SIZE, SPAN), stack2(SPAN, SPAN), stack(SIZE)
    row, e, where, pushed = stack(SPAN), stack(4), stack(4), stack(4)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        par = real[3 * MARKERS :]
        first = own[ROW]
        for j in range(MARKERS):
            k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
            motion(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, x[c:], xd[c:], xdd[c:])
            rate(CODES[j], own[DIMENSION + k], own[AT + k], q, qdd, s, pushed)
            for b in range(4 if CODES[j] == PARAMETERS else 3):
                xdd[c + b] += pushed[b]
        for c in range(SIZE):
            z[c], zd[c] = x[c], xd[c]
            f[c] = 0.0
            for d in range(SIZE):
                H[c, d] = 0.0
        for r in range(ROWS):
            for c in range(SIZE):
                J[r, c] = 0.0
        kernel_jacobian(x, par, t, J)
        for c in range(SIZE):  # along x_c: H = sum lam Phi_xx, a2 = Phi_xx xdd + gamma_x
            z[c] = complex(x[c], STEP)
            for r in range(ROWS):
                for d in range(SIZE):
                    zJ[r, d] = 0.0
            kernel_jacobian(z, par, t, zJ)
            kernel_gamma(z, zd, par, t, zg)
            z[c] = x[c]
            for r in range(ROWS):
                total = zg[r].imag / STEP
                for d in range(SIZE):
                    slope = zJ[r, d].imag / STEP
                    total += slope * xdd[d]
                    H[d, c] += lam[first + r] * slope
                a2[r, c] = total
                f[c] += lam[first + r] * J[r, c]
            zd[c] = complex(xd[c], STEP)  # along xd_c: a1 = Phi_xx xd + Phi_xt = gamma_xd / 2
            kernel_gamma(z, zd, par, t, zg)
            zd[c] = xd[c]
            for r in range(ROWS):
                g_xd[r, c] = zg[r].imag / STEP
                a1[r, c] = 0.5 * g_xd[r, c]
        for r in range(ROWS):
            for out, along_x, along_second in ((G1, a1, J), (G2, a2, g_xd)):
                for c in range(SPAN):
                    row[c] = 0.0
                for j in range(MARKERS):
                    k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
                    code, dimension, at = CODES[j], own[DIMENSION + k], own[AT + k]
                    chain_rule(code, dimension, at, q, s, along_x[r, c:], 0, row[7 * k :])
                    _chain_second(code, dimension, at, qd, s, along_second[r, c:], row[7 * k :])
                for k in range(2):
                    for c in range(own[DIMENSION + k]):
                        out[(first + r) * n + own[AT + k] + c] = row[7 * k + c]
            for j in range(MARKERS):
                k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
                at = (first + r) * n + own[AT + k]
                _chain_second(CODES[j], own[DIMENSION + k], own[AT + k], qdd, s, J[r, c:], G2[at:])
        for c in range(SPAN):
            for d in range(SPAN):
                XHX[c, d] = 0.0
        for c in range(SIZE):
            for d in range(SPAN):
                HX[c, d] = 0.0
            for j in range(MARKERS):
                k, s = OWNERS[j], real[3 * j : 3 * j + 3]
                chain_rule(CODES[j], own[DIMENSION + k], own[AT + k], q, s, H[c, STARTS[j] :], 0, HX[c, 7 * k :])
        for d in range(SPAN):
            for j in range(MARKERS):
                k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
                for b in range(4):
                    where[b] = HX[c + b, d] if c + b < SIZE else 0.0
                for b in range(7):
                    row[b] = 0.0
                chain_rule(CODES[j], own[DIMENSION + k], own[AT + k], q, s, where, 0, row)
                for b in range(own[DIMENSION + k]):
                    XHX[7 * k + b, d] += row[b]
        for j in range(MARKERS):
            k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
            if own[DIMENSION + k] == 7 and CODES[j] != PARAMETERS:
                for d in range(4):
                    for b in range(4):
                        where[b] = 1.0 if b == d else 0.0
                    rotate_gradient(where, s, f[c], f[c + 1], f[c + 2], e)
                    for b in range(4):
                        XHX[7 * k + 3 + b, 7 * k + 3 + d] += e[b]
        for k in range(2):
            for l in range(2):
                for c in range(own[DIMENSION + k]):
                    for d in range(own[DIMENSION + l]):
                        K[own[AT + k] + c, own[AT + l] + d] += XHX[7 * k + c, 7 * l + d]
    return 0
