"""Common parts of friction laws: slip velocity of a's point over b, reaction on both bodies, friction coefficient.

Markers: Point a, Turn a, Point b, Turn b.
"""

import numpy as np

from ..jit.kernels import kernel


@kernel
def coefficient(vv, par):
    """mu(|v|) / |v| of Coulomb's law with Stribeck's peak, smooth at rest; vv = |v|^2, par = (mu, mu_s, v_s, v_0, ...).

    mu(v) = (mu + (mu_s - mu) exp(-(v / v_s)^2)) v / sqrt(v^2 + v_0^2)
    """
    return (par[0] + (par[1] - par[0]) * np.exp(-vv / (par[2] * par[2]))) / np.sqrt(vv + par[3] * par[3])


@kernel
def slip(x, xd):
    """xd_a - xd_b - omega_b x (x_a - x_b)."""
    d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
    return (
        xd[0] - xd[6] - (xd[10] * d2 - xd[11] * d1),
        xd[1] - xd[7] - (xd[11] * d0 - xd[9] * d2),
        xd[2] - xd[8] - (xd[9] * d1 - xd[10] * d0),
    )


@kernel
def act(x, F0, F1, F2, N0, N1, N2, out):
    """F at x_a and N on a, the opposite on b at the same place."""
    d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
    out[0], out[1], out[2], out[3], out[4], out[5] = F0, F1, F2, N0, N1, N2
    out[6], out[7], out[8] = -F0, -F1, -F2
    out[9] = -N0 - (d1 * F2 - d2 * F1)
    out[10] = -N1 - (d2 * F0 - d0 * F2)
    out[11] = -N2 - (d0 * F1 - d1 * F0)


@kernel
def along_and_across(x, f):
    """Of a force f[0:3] and a torque f[3:6] the parts along the axis x[12:15], and the sizes of those across it."""
    n0, n1, n2 = x[12], x[13], x[14]
    along, turn = n0 * f[0] + n1 * f[1] + n2 * f[2], n0 * f[3] + n1 * f[4] + n2 * f[5]
    f0, f1, f2 = f[0] - along * n0, f[1] - along * n1, f[2] - along * n2
    t0, t1, t2 = f[3] - turn * n0, f[4] - turn * n1, f[5] - turn * n2
    return along, turn, np.sqrt(f0 * f0 + f1 * f1 + f2 * f2), np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)


def demand_bodies(force, torque, name):
    """Refuse what would put a torque on a point mass."""
    if force.b.dimension == 3 or (force.a.dimension == 3 and torque != 0.0):
        body = force.b if force.b.dimension == 3 else force.a
        hint = "make it a, and the other body b" if body is force.b else f"set {name}=0"
        raise force.error(f"{force.name}: the point mass {body.name!r} can't take the torque of it; {hint}.")
