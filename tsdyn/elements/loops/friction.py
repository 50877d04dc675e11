"""Kernels of one friction for the solver: its generalised force for unit normal load, and its normal load."""

from ...jit.kernels import ANY, caller, complex_stack, integers, kernel, stack, stack2, vector
from ...maths.euler_parameters import matrix_a
from ..tolerances import FORCE_STEP
from .marker_jacobians import carry_back
from .template import (
    AT,
    CODES,
    DIMENSION,
    MARKERS,
    OWNERS,
    SIZE,
    STARTS,
    force_markers,
    kernel_law,
    kernel_normal_load,
)

UNIT_FRICTION = "ippppdp"  # floats of the instance, its table, its floats, q, qd, t, out
NORMAL_LOAD = "ippppdiipp"  # the same to t, the side that f is on, whether to derive, f, out
call_unit_friction, call_normal_load = caller(UNIT_FRICTION), caller(NORMAL_LOAD)


def unit_friction(stride, own, real, q, qd, t, out):
    """out (14,) = W^T f for a normal load of one: generalised forces on the coordinates of a, then on those of b."""
    own, real, out = integers(own, ANY), vector(real, ANY), vector(out, ANY)
    q, qd = vector(q, ANY), vector(qd, ANY)
    x, xd, f = stack(SIZE), stack(SIZE), stack(SIZE)
    force_markers(q, qd, own, real, x, xd)
    for c in range(SIZE):
        f[c] = 0.0
    for c in range(14):
        out[c] = 0.0
    load = real[stride - 1]
    real[stride - 1] = 1.0
    kernel_law(x, xd, real[3 * MARKERS : stride], t, f)
    real[stride - 1] = load
    for j in range(MARKERS):
        k, s = OWNERS[j], real[3 * j : 3 * j + 3]
        carry_back(CODES[j], own[DIMENSION + k], 0, q[own[AT + k] :], s, f[STARTS[j] :], out[7 * k :])
    return 0


@kernel
def _about_point(A, s, f, out):
    """out (6,) = force and torque about a point s from the centroid, ground frame, of a force and a body torque."""
    for i in range(3):
        out[i] = f[i]
        out[3 + i] = A[i, 0] * f[3] + A[i, 1] * f[4] + A[i, 2] * f[5]
    out[3] -= s[1] * f[2] - s[2] * f[1]
    out[4] -= s[2] * f[0] - s[0] * f[2]
    out[5] -= s[0] * f[1] - s[1] * f[0]


def normal_load(stride, own, real, q, qd, t, side, derive, f, out):
    """out (7,) = the normal load of a reaction and, with derive = 1, what it changes by with that.

    f (6,) is the force, ground frame, and the torque about the centroid, body frame, on the body of a side.
    """
    own, real, f, out = integers(own, ANY), vector(real, ANY), vector(f, ANY), vector(out, ANY)
    q, qd = vector(q, ANY), vector(qd, ANY)
    x, xd, s, g, z, A = stack(SIZE), stack(SIZE), stack(3), stack(6), complex_stack(6), stack2(3, 3)
    force_markers(q, qd, own, real, x, xd)
    at = own[AT + side]
    for i in range(3):
        s[i] = x[6 * side + i] - q[at + i]
        for j in range(3):
            A[i, j] = 1.0 if i == j else 0.0
    if own[DIMENSION + side] == 7:
        matrix_a(q[at + 3 : at + 7], A)
    _about_point(A, s, f, g)
    for i in range(6):
        z[i] = g[i]
    par = real[3 * MARKERS : stride]
    if derive == 0:
        out[0] = kernel_normal_load(x, g, par)
        return 0
    for i in range(6):
        z[i] = complex(g[i], FORCE_STEP)
        load = kernel_normal_load(x, z, par)
        out[0], g[i] = load.real, load.imag / FORCE_STEP
        z[i] = z[i].real
    for i in range(3):
        out[4 + i] = A[0, i] * g[3] + A[1, i] * g[4] + A[2, i] * g[5]
    out[1] = g[0] - (g[4] * s[2] - g[5] * s[1])
    out[2] = g[1] - (g[5] * s[0] - g[3] * s[2])
    out[3] = g[2] - (g[3] * s[1] - g[4] * s[0])
    return 0
