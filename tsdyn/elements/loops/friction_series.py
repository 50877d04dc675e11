"""Taylor series of friction in proportion to a normal load, which follows from the reaction of its joint.

    f_k = sum_j g_j N_{k-j}     g: the law for a normal load of one, by the kernel `series`      (1)
    N_k                         the normal load, by the kernel `normal_series`

The reaction of order k is not known before the multipliers of that order are. What is known of it gives f_k up to the
part g_0 N_k that is linear in them, with the slope of N at order zero, and which the equations of motion take into
account; f_{k-1} is completed one order later. At order zero friction is in the equations as a whole, and f_0 is zero
here until then.

The scratch of an instance holds that of its kernels, then the series of g, of N, and of the reaction: force and torque
about the joint's point, ground frame.
"""

from ...jit.kernels import part, stack
from ..markers import PARAMETERS
from .template import CODES, MARKERS, SIZE, SLOTS, STARTS, kernel_normal_load, kernel_normal_series

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
def known_friction(k, wide, x, par, kept, s, forces, f):
    """Replace f, order k of g, by what is known of f_k, Eq. (1), after order k - 1 has been completed."""
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
    for c in range(SIZE):
        for j in range(k + 1):
            f[c] += s[SLOTS + c, j] * s[N, k - j]


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
