"""What the loops over the instances of a kind are written in: names that each kind has filled in, and shared parts.

A loop is a template. `specialised` copies it, and the parts that it calls, for one kind of constraint or force, with
the names below replaced by the constants and kernels of that kind. Parts are inlined, so arguments cost nothing there;
a loop is given each array by its address, and may have up to twelve.
"""

from ...jit.kernels import part
from ..markers import motion, position
from .marker_jacobians import state

ROWS = MARKERS = 1  # scalar constraints, and markers, of an instance
SIZE = ROOM = 1  # length of x, the concatenated marker coordinates; and with room for a store of four at its end
CODES = OWNERS = STARTS = FIRST = (
    0,
)  # of each marker: its kind, its body (0 a, 1 b), its place in x, first of its body
SLOTS = 1  # rows of scratch memory of `series`
AHEAD = False  # whether each instance has the next one's numbers brought into the cache
DRIVEN = False  # whether the series depend on time
TRACED = False  # whether a force is given by a program
SHARP = False  # whether the series of a force are checked against its law
POSITIVE = ()  # rows of the scratch of `series` that are positive where the law of a force is analytic
FRICTIONAL = False  # whether a force is in proportion to a normal load
KEPT = 1  # floats of a force's derivatives kept from step to step
ALONG = -1  # where in x the direction ends that a force's frame follows, or -1: the frame of a body
kernel_phi = kernel_value = kernel_jacobian = kernel_gamma = kernel_series = kernel_series_t = None
kernel_law = kernel_derivatives = kernel_remember = kernel_inputs = None
kernel_normal_load = kernel_normal_series = None

# what the table of a kind holds for each instance: where its two bodies' coordinates begin, and how many they are
AT, DIMENSION = 0, 2


@part
def place_markers(q, own, real, x):
    """Set x (SIZE,) from q."""
    for j in range(MARKERS):
        k = OWNERS[j]
        position(CODES[j], own[DIMENSION + k], own[AT + k], q, real[3 * j : 3 * j + 3], x[STARTS[j] :])


@part
def move_markers(q, qd, own, real, x, xd, xdd):
    """Set x, xd and, for qdd = 0, xdd."""
    for j in range(MARKERS):
        k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
        motion(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, x[c:], xd[c:], xdd[c:])


@part
def differentiate(x, par, t, Phi_x):
    """Set Phi_x (ROWS, SIZE)."""
    for r in range(ROWS):
        for c in range(SIZE):
            Phi_x[r, c] = 0.0
    kernel_jacobian(x, par, t, Phi_x)


@part
def acceleration_bias(x, xd, xdd, par, t, Phi_x, gamma, out):
    """Set out (ROWS,) = gamma + Phi_x xdd, the bias of Phi_q qdd + out = 0."""
    differentiate(x, par, t, Phi_x)
    kernel_gamma(x, xd, par, t, gamma)
    for r in range(ROWS):
        total = gamma[r]
        for c in range(SIZE):
            total += Phi_x[r, c] * xdd[c]
        out[r] = total


@part
def force_markers(q, qd, own, real, x, xd):
    """Set x and xd of a force, whose markers may be Turns."""
    for j in range(MARKERS):
        k, c, s = OWNERS[j], STARTS[j], real[3 * j : 3 * j + 3]
        state(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, x[c:], xd[c:])
