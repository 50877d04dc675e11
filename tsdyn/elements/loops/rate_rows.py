"""Kernels of a primitive with rows on velocities, A xd + b = 0: to all loops these are rows of Phi that are zero.

    Phi   = (phi, 0),        Phi_x = (phi_x, A)
    Phi_t = (phi_t, b),      gamma = (gamma of phi, (A xd)_x xd + A_t xd + b_x xd + b_t)

So S = K W K^T with K = [H; A], and a correction Z of positions satisfies H Z = -Phi and A Z = 0: it is one that the
rows on velocities admit.
"""

from ...jit.kernels import kernel, stack
from .template import (
    RATES_FROM,
    ROWS,
    SIZE,
    kernel_gamma,
    kernel_jacobian,
    kernel_phi,
    kernel_phi_t,
    kernel_rate,
    kernel_rate_gamma,
    kernel_rate_jacobian,
)


@kernel
def nothing(x, par, t, out):
    """Phi, Phi_x or Phi_t of a primitive that has no rows on positions, or none that depend on time."""


@kernel
def nothing_of_rates(x, xd, par, t, out):
    """The same for gamma."""


def phi(x, par, t, out):
    """Phi, zero for rows on velocities."""
    kernel_phi(x, par, t, out)
    for r in range(RATES_FROM, ROWS):
        out[r] = 0.0


def phi_t(x, par, t, out):
    """Phi_t and b, which is the rate at xd = 0."""
    xd = stack(SIZE)
    for c in range(SIZE):
        xd[c] = 0.0
    for r in range(RATES_FROM):
        out[r] = 0.0
    kernel_phi_t(x, par, t, out)
    kernel_rate(x, xd, par, t, out[RATES_FROM:])


def jacobian(x, par, t, out):
    """Phi_x and A."""
    kernel_jacobian(x, par, t, out)
    kernel_rate_jacobian(x, par, t, out[RATES_FROM:])


def gamma(x, xd, par, t, out):
    """gamma of both."""
    kernel_gamma(x, xd, par, t, out)
    kernel_rate_gamma(x, xd, par, t, out[RATES_FROM:])


KERNELS = {"phi": phi, "jacobian": jacobian, "gamma": gamma, "phi_t": phi_t}
NOTHING = {"kernel_phi": nothing, "kernel_jacobian": nothing, "kernel_phi_t": nothing, "kernel_gamma": nothing_of_rates}
