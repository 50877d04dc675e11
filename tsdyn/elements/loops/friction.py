"""Kernels of one friction for the solver: force for unit normal load, normal load, their Taylor series."""

from ...jit.kernels import ANY, caller, complex_stack, data_of, integers, kernel, matrix, part, stack, stack2, vector
from ...maths.recurrences import product, scaled
from ...maths.tolerances import COMPLEX_STEP
from ...maths.vectors import matrix_a
from ..markers import PARAMETERS
from .template import (
    AT,
    CODES,
    DIMENSION,
    MARKERS,
    OWNERS,
    SIZE,
    SLOTS,
    STARTS,
    carry_back,
    force_markers,
    kernel_law,
    kernel_normal_load,
    kernel_normal_series,
)

# Taylor series of friction in proportion to a normal load, which follows from the reaction of its joint.
#
#     f_k = sum_j g_j N_{k-j}     g: the law for a normal load of one, by the kernel `series`      (1)
#     N_k                         the normal load, by the kernel `normal_series`
#
# The reaction of order k is not known before the multipliers of that order are. What is known of it gives f_k up to the
# part g_0 N_k that is linear in them, with the slope of N at order zero, and which the equations of motion take into
# account; f_{k-1} is completed one order later. At order zero friction is in the equations as a whole, and f_0 is zero
# here until then.
#
# The scratch of an instance holds that of its kernels, then the series of g, of N, and of the reaction: force and
# torque about the joint's point, ground frame.

REACTION = 1  # row of the reaction behind that of N
FRICTION_ROWS = REACTION + 6  # of the scratch, beside its kernels' and as many as x has


@part
def _complete(k, wide, par, kept, s, forces):
    """N_k and f_k with the whole reaction of order k; kept: the x and xd of all orders."""
    x, f, N = stack(SIZE), stack(6), SLOTS + SIZE
    for c in range(SIZE):
        x[c] = kept[2 * SIZE * k + c]
    for c in range(6):
        f[c] = s[N + REACTION + c, k]
    # N_k of the whole reaction; f_k lacks g_0 times its change
    load = kernel_normal_series(x, f, par, k, s)
    change = load - s[N, k]
    s[N, k] = load
    for j in range(MARKERS):
        for c in range(4 if CODES[j] == PARAMETERS else 3):
            forces[j * wide + 4 * k + c] += s[SLOTS + STARTS[j] + c, 0] * change


@part
def known_friction(k, wide, x, par, ends, kept, s, forces, f):
    """Replace f, order k of g, by what is known of f_k, Eq. (1), after order k - 1 has been completed.

    ends: of each marker, negative where g is zero up to this order.
    """
    g, N = stack(6), SLOTS + SIZE
    # The law has given g_k: keep it
    for c in range(SIZE):
        s[SLOTS + c, k] = f[c]
        f[c] = 0.0
    s[N, k] = 0.0
    if k == 0:
        return
    # Order k - 1 is complete now that its multipliers are known
    _complete(k - 1, wide, par, kept, s, forces)
    for c in range(6):
        g[c] = s[N + REACTION + c, k]
    s[N, k] = kernel_normal_series(x, g, par, k, s)
    # f_k = sum_j g_j N_{k-j}
    for m in range(MARKERS):
        if ends[m] >= 0.0:
            at = STARTS[m]
            f[at], f[at + 1], f[at + 2] = scaled(s, SLOTS + at, N, k)
            if CODES[m] == PARAMETERS:
                f[at + 3] = product(s[SLOTS + at + 3], s[N], k)


@part
def load_at(tau, known, x, par, s):
    """The normal load of the reaction at tau, by its definition."""
    g, first = stack(6), SLOTS + SIZE + REACTION
    for c in range(6):
        g[c] = 0.0
        for k in range(known - 1, -1, -1):
            # Horner's scheme for the reaction
            g[c] = g[c] * tau + s[first + c, k]
    return kernel_normal_load(x, g, par)


# Kernels of one friction for the solver: its generalised force for unit normal load, and its normal load.

UNIT_FRICTION = "ippppdp"  # floats of the instance, its table, its floats, q, qd, t, out
NORMAL_LOAD = "ippppiipp"  # the same to q, what is kept, the side that f is on, what to do, f, out
LOAD_SLOPE = "ippppdipp"  # the same as the first to t, the side that f is on, f, out
DERIVE, HERE = 1, 2  # what to do besides, added up: the derivative; what is kept is set for q
STAND = 12  # floats kept, besides the markers: the arm of the point, the orientation
call_unit_friction, call_normal_load, call_load_slope = caller(UNIT_FRICTION), caller(NORMAL_LOAD), caller(LOAD_SLOPE)


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
    # The last of the reals is the normal load: one for this evaluation
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
    # T = A tau' - s x F
    for i in range(3):
        out[i] = f[i]
        out[3 + i] = A[i, 0] * f[3] + A[i, 1] * f[4] + A[i, 2] * f[5]
    out[3] -= s[1] * f[2] - s[2] * f[1]
    out[4] -= s[2] * f[0] - s[0] * f[2]
    out[5] -= s[0] * f[1] - s[1] * f[0]


@kernel
def _about_centroid(A, s, g, out):
    """out (6,) = the derivative by a force and a body torque, from that by force and torque about the point."""
    # Transposed: tau' by A^T, F by the moment of T
    for i in range(3):
        out[3 + i] = A[0, i] * g[3] + A[1, i] * g[4] + A[2, i] * g[5]
    out[0] = g[0] - (g[4] * s[2] - g[5] * s[1])
    out[1] = g[1] - (g[5] * s[0] - g[3] * s[2])
    out[2] = g[2] - (g[3] * s[1] - g[4] * s[0])


@part
def _stand(own, real, q, qd, side, x, s, A):
    """Set x; of the body of a side the arm s from the centroid to the point, and the orientation A."""
    xd, at = stack(SIZE), own[AT + side]
    force_markers(q, qd, own, real, x, xd)
    for i in range(3):
        s[i] = x[6 * side + i] - q[at + i]
        for j in range(3):
            A[i, j] = 1.0 if i == j else 0.0
    if own[DIMENSION + side] == 7:
        matrix_a(q[at + 3 : at + 7], A)


def normal_load(stride, own, real, q, kept, side, what, f, out):
    """out (7,) = the normal load of a reaction and, with DERIVE, what it changes by with that.

    f (6,) is the force, ground frame, and the torque about the centroid, body frame, on the body of a side. With HERE
    kept (STAND + SIZE,) is set for q, otherwise used.
    """
    own, real, f, out = integers(own, ANY), vector(real, ANY), vector(f, ANY), vector(out, ANY)
    q, kept, g, z = vector(q, ANY), vector(kept, STAND + SIZE), stack(6), complex_stack(6)
    s, A, x = kept[:3], matrix(data_of(kept[3:]), 3, 3), kept[STAND:]
    if what & HERE:
        _stand(own, real, q, q, side, x, s, A)
    _about_point(A, s, f, g)
    # Complex steps along the six components of the reaction
    for i in range(6):
        z[i] = g[i]
    par = real[3 * MARKERS : stride]
    if not what & DERIVE:
        out[0] = kernel_normal_load(x, g, par)
        return 0
    for i in range(6):
        z[i] = complex(g[i], COMPLEX_STEP)
        load = kernel_normal_load(x, z, par)
        out[0], g[i] = load.real, load.imag / COMPLEX_STEP
        z[i] = z[i].real
    _about_centroid(A, s, g, out[1:])
    return 0


def load_slope(stride, own, real, q, qd, t, side, f, out):
    """out (13,) = as normal_load with DERIVE, by the series of the load; then the reaction about the point.

    What `normal_series` leaves out as negligible is left out here, too.
    """
    own, real, f, out = integers(own, ANY), vector(real, ANY), vector(f, ANY), vector(out, ANY)
    q, qd = vector(q, ANY), vector(qd, ANY)
    x, s, A, scratch = stack(SIZE), stack(3), stack2(3, 3), stack2(SLOTS, 2)
    unit, slope, par = stack(6), stack(6), real[3 * MARKERS : stride]
    _stand(own, real, q, qd, side, x, s, A)
    _about_point(A, s, f, out[7:])
    # Order zero is the load; at constant x coefficient one is its derivative along the reaction
    out[0] = kernel_normal_series(x, out[7:], par, 0, scratch)
    for c in range(SIZE):
        x[c] = 0.0
    for i in range(6):  # coefficient one is linear in that of the reaction
        unit[i] = 0.0
    for i in range(6):
        unit[i] = 1.0
        slope[i] = kernel_normal_series(x, unit, par, 1, scratch)
        unit[i] = 0.0
    _about_centroid(A, s, slope, out[1:])
    return 0
