"""Names and parts of the loops over the instances of a kind, which each kind fills in; marker Jacobians for forces."""

from typing import NamedTuple

import numpy as np

from ...jit.kernels import Record, kernel, part, record_at, stack
from ...maths.vectors import rotate_gradient, rotate_rate
from ..markers import PARAMETERS, POINT, TURN, chain_rule, motion, position, rate

# Marker Jacobians for forces: x and xd, the pull-back of a force to the coordinates, and derivatives of both.
#
# W = xd_qd pulls a force f conjugate to the marker back to Q = W^T f. X = x_q equals W, except for a Turn, where X = 0.
#
#     Point, Vector   A(p) s is quadratic in p: (A s)_p pd = 2 A(p, pd) s, symmetric and bilinear
#     Parameters      W = I
#     Turn            xd = 2 E(p) pd = -2 E(pd) p,   E = [-e, e~ + e0 I]


class MarkerDerivatives(NamedTuple):
    """Derivatives of the markers of an instance by the coordinates of its two bodies."""

    W: np.ndarray  # (size of x, 14)  xd_qd
    X: np.ndarray  # (size of x, 14)  x_q
    Y: np.ndarray  # (size of x, 14)  xd_q


@kernel
def turning(p, pd, out):
    """out = 2 E(p) pd, the angular velocity in the ground frame; p, pd (4,), out (3,)."""
    e0, e1, e2, e3 = 2.0 * p[0], 2.0 * p[1], 2.0 * p[2], 2.0 * p[3]
    out[0] = -e1 * pd[0] + e0 * pd[1] - e3 * pd[2] + e2 * pd[3]
    out[1] = -e2 * pd[0] + e3 * pd[1] + e0 * pd[2] - e1 * pd[3]
    out[2] = -e3 * pd[0] - e2 * pd[1] + e1 * pd[2] + e0 * pd[3]


@kernel
def torque_on_parameters(p, n0, n1, n2, out):
    """out = 2 E(p)^T n; n (3,) by components in the ground frame, out (4,)."""
    e0, e1, e2, e3 = 2.0 * p[0], 2.0 * p[1], 2.0 * p[2], 2.0 * p[3]
    out[0] = -e1 * n0 - e2 * n1 - e3 * n2
    out[1] = e0 * n0 + e3 * n1 - e2 * n2
    out[2] = -e3 * n0 + e0 * n1 + e1 * n2
    out[3] = e2 * n0 - e1 * n1 + e0 * n2


@kernel
def state(code, dimension, at, q, qd, s, x, xd):
    """x and xd of one marker; its body's coordinates begin at q[at]."""
    position(code, dimension, at, q, s, x)
    if code != TURN:
        rate(code, dimension, at, q, qd, s, xd)
    elif dimension == 7:
        turning(q[at + 3 : at + 7], qd[at + 3 : at + 7], xd)
    else:
        for i in range(3):
            xd[i] = 0.0


@kernel
def carry_back(code, dimension, at, q, s, f, Q):
    """Q (n,) += W^T f; f (3,) or (4,)."""
    if code != TURN:
        chain_rule(code, dimension, at, q, s, f, 0, Q[at:])
    elif dimension == 7:
        g = stack(4)
        torque_on_parameters(q[at + 3 : at + 7], f[0], f[1], f[2], g)
        for i in range(4):
            Q[at + 3 + i] += g[i]


@kernel
def _rate(code, p, pd, s, out):
    """out (3,) = xd of a Vector or of a Turn, bilinear in p and pd."""
    if code == TURN:
        turning(p, pd, out)
    else:
        rotate_rate(p, pd, s, out)


@kernel
def derivatives(code, dimension, at, q, qd, s, row, column, out):
    """Set the `MarkerDerivatives` of one marker, from [row, column] on; zero on entry."""
    W, X, Y = out
    if dimension != 0 and code == POINT:
        # A point moves with r
        for i in range(3):
            W[row + i, column + i] = 1.0
            X[row + i, column + i] = 1.0
    if dimension != 7:
        return
    p, pd = q[at + 3 : at + 7], qd[at + 3 : at + 7]
    e, f = stack(4), stack(3)
    for i in range(4):
        e[i] = 0.0
    for j in range(4):
        c = column + 3 + j
        if code == PARAMETERS:
            W[row + j, c] = 1.0
            X[row + j, c] = 1.0
            continue
        # A(p) s is quadratic in p: its derivative along e_j is bilinear in p and e_j
        e[j] = 1.0
        _rate(code, p, e, s, f)
        for i in range(3):
            W[row + i, c] = f[i]
            if code != TURN:
                X[row + i, c] = f[i]
        # xd likewise, with pd in place of p
        _rate(code, e, pd, s, f)
        for i in range(3):
            Y[row + i, c] = f[i]
        e[j] = 0.0


@kernel
def carry_back_derivative(code, dimension, at, s, f, n, Q_q):
    """Q_q (n, n) += (W^T f)_q at constant f; W is linear in p."""
    if dimension != 7 or code == PARAMETERS:
        return
    e, g = stack(4), stack(4)
    for i in range(4):
        e[i] = 0.0
    for j in range(4):
        # W is linear in p: (W^T f)_p along e_j is W^T f at p = e_j
        e[j] = 1.0
        if code == TURN:
            torque_on_parameters(e, f[0], f[1], f[2], g)
        else:
            rotate_gradient(e, s, f[0], f[1], f[2], g)
        for i in range(4):
            Q_q[(at + 3 + i) * n + at + 3 + j] += g[i]
        e[j] = 0.0


# What the loops over the instances of a kind are written in: names that each kind has filled in, and shared parts.
#
# A loop is a template. `specialised` copies it, and the parts that it calls, for one kind of constraint or force, with
# the names below replaced by the constants and kernels of that kind. Parts are inlined, so arguments cost nothing
# there; a loop is given each array by its address.

ROWS = MARKERS = 1  # scalar constraints, and markers, of an instance
RATES_FROM = 1  # number of rows on positions, which those on velocities follow
SIZE = ROOM = 1  # length of x, the concatenated marker coordinates; and with room for a store of four at its end
CODES = OWNERS = STARTS = FIRST = (
    0,
)  # of each marker: its kind, its body (0 a, 1 b, others from 2), its place in x, first of its body
OTHERS = 0  # bodies beyond a and b that an instance reads: three of its parameters each, see `place_of`
OTHERS_AT = 0  # where these begin among the parameters
SPAN = 14  # coordinates of all its bodies
SLOTS = 1  # rows of scratch memory of `series`
AHEAD = False  # whether each instance has the next one's numbers brought into the cache
DRIVEN = False  # whether the series depend on time
SUMMED = False  # whether a row is the sum of several instances, zero before their loops run
TRACED = False  # whether a force is given by a program
SHARP = False  # whether the series of a force are checked against its law
POSITIVE = ()  # rows of the scratch of `series` that are positive where the law of a force is analytic
FRICTIONAL = False  # whether a force is in proportion to a normal load
KEPT = 1  # floats of a force's derivatives kept from step to step
ALONG = -1  # where in x the direction ends that a force's frame follows, or -1: the frame of a body
kernel_drift = kernel_rate = kernel_rate_jacobian = kernel_rate_gamma = kernel_phi_t = None
kernel_phi = kernel_value = kernel_jacobian = kernel_gamma = kernel_series = kernel_series_t = None
kernel_law = kernel_derivatives = kernel_remember = kernel_inputs = None
kernel_normal_load = kernel_normal_series = kernel_arm_series = None
NORMAL = -1  # of a contact: the rows are along this marker and those after it

# what the table of a kind holds for each instance: where its two bodies' coordinates begin, and how many they are
AT, DIMENSION = 0, 2


class Extent(Record):
    """What a loop of series reads of all instances of a kind; the records of their kinds begin with it."""

    count: int
    stride: int  # reals of each
    width: int  # floats of each one's series
    orders: int  # that there is room for


extent = record_at(Extent)


@part
def place_of(own, real, k):
    """Where the coordinates of body k of an instance begin, and how many they are.

    The table has those of a and b; those of others, and their places among the poses, are parameters.
    """
    if OTHERS > 0 and k > 1:
        i = 3 * MARKERS + OTHERS_AT + 3 * (k - 2)
        return int(real[i]), int(real[i + 1])
    return own[AT + k], own[DIMENSION + k]


@part
def place_markers(q, own, real, x):
    """Set x (SIZE,) from q."""
    for j in range(MARKERS):
        at, dimension = place_of(own, real, OWNERS[j])
        position(CODES[j], dimension, at, q, real[3 * j : 3 * j + 3], x[STARTS[j] :])


@part
def move_markers(q, qd, own, real, x, xd, xdd):
    """Set x, xd and, for qdd = 0, xdd."""
    for j in range(MARKERS):
        c, s = STARTS[j], real[3 * j : 3 * j + 3]
        at, dimension = place_of(own, real, OWNERS[j])
        motion(CODES[j], dimension, at, q, qd, s, x[c:], xd[c:], xdd[c:])


@part
def differentiate(x, par, t, Phi_x):
    """Set Phi_x (ROWS, SIZE)."""
    for r in range(ROWS):
        for c in range(SIZE):
            Phi_x[r, c] = 0.0
    kernel_jacobian(x, par, t, Phi_x)


@part
def acceleration_bias(x, xd, xdd, par, t, Phi_x, gamma, out):
    """Set out (ROWS,) = gamma + Phi_x xdd, the bias of Phi_q qdd + out = 0; add it where rows are sums."""
    differentiate(x, par, t, Phi_x)
    kernel_gamma(x, xd, par, t, gamma)
    for r in range(ROWS):
        total = gamma[r]
        for c in range(SIZE):
            total += Phi_x[r, c] * xdd[c]
        out[r] = out[r] + total if SUMMED else total


@part
def force_markers(q, qd, own, real, x, xd):
    """Set x and xd of a force, whose markers may be Turns."""
    for j in range(MARKERS):
        k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
        state(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, x[c:], xd[c:])
