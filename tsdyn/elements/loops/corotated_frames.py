"""Corotated frames of forces: derivatives of a law that are kept from an earlier configuration stay accurate in them.

The stiffness of a spring lies along the spring, that of a bushing along the axes of its body: in such a frame a law
changes little as the mechanism moves. The rotation r (Euler parameters) of the frame since the derivatives were taken
rotates 3-vectors among x and xd by A(r) and takes Euler parameters p to r p.
"""

import math

from ...jit.kernels import kernel, stack, stack2
from ...maths.euler_parameters import matrix_a
from ..markers import PARAMETERS


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
