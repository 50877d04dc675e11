"""DAE solvers on the stiff chain of stiff_chain.py, in the plane: poses of all links and multipliers, index 2.

    q' = v - Phi_q^T mu,    M v' = f - Phi_q^T lam,    Phi = 0,    Phi_q v = 0

Of each link (x, z, angle), (vx, vz, rate), lam, mu, one after the other, so that Jacobians are banded. The residual is
compiled.
"""

import numba
import numpy as np

from benchmarks.contender import timed
from benchmarks.stiff_chain import GRAVITY, INERTIA, LENGTH, MASS, reach, spring

LINK = 10  # unknowns of a link
BAND = 2 * LINK


@numba.njit
def residual(y, yd, stiffness, damping, out):
    """The residual of all links."""
    half, links, masses = 0.5 * LENGTH, y.size // LINK, (MASS, MASS, INERTIA)
    sums = np.zeros((2, 3))  # Phi_q^T lam, Phi_q^T mu
    for i in range(links):
        o, n, p = LINK * i, LINK * (i + 1), LINK * (i - 1)
        c, s = half * np.cos(y[o + 2]), half * np.sin(y[o + 2])
        bend, turn = y[o + 2], y[o + 5]
        if i > 0:
            bend, turn = bend - y[p + 2], turn - y[p + 5]
        torque = -stiffness * bend - damping * turn
        for k in range(2):
            a, b = y[o + 6 + 2 * k], y[o + 7 + 2 * k]
            sums[k] = a, b, s * a + c * b
        if i + 1 < links:
            torque += stiffness * (y[n + 2] - y[o + 2]) + damping * (y[n + 5] - y[o + 5])
            for k in range(2):
                a, b = y[n + 6 + 2 * k], y[n + 7 + 2 * k]
                sums[k, 0], sums[k, 1], sums[k, 2] = sums[k, 0] - a, sums[k, 1] - b, sums[k, 2] + s * a + c * b
        loads = 0.0, -MASS * GRAVITY, torque
        for j in range(3):
            out[o + j] = yd[o + j] - y[o + 3 + j] + sums[1, j]
            out[o + 3 + j] = masses[j] * yd[o + 3 + j] - loads[j] + sums[0, j]
        x, z, vx, vz = y[o] - c, y[o + 1] + s, y[o + 3] + s * y[o + 5], y[o + 4] + c * y[o + 5]  # its first end
        if i > 0:
            cp, sp = half * np.cos(y[p + 2]), half * np.sin(y[p + 2])
            x, z = x - y[p] - cp, z - y[p + 1] + sp
            vx, vz = vx - y[p + 3] + sp * y[p + 5], vz - y[p + 4] + cp * y[p + 5]
        out[o + 6], out[o + 7], out[o + 8], out[o + 9] = x, z, vx, vz


def start(links):
    """Unknowns and rates at rest, horizontal; accelerations and multipliers by the linear equations there."""
    y, yd, drops = np.zeros(LINK * links), np.zeros(LINK * links), LENGTH * reach(links)
    y[0::LINK] = LENGTH * (np.arange(links) + 0.5)
    angle = np.linalg.solve(MASS * drops.T @ drops + INERTIA * np.eye(links), MASS * GRAVITY * drops.sum(axis=0))
    yd[4::LINK], yd[5::LINK] = -drops @ angle, angle
    push = MASS * (GRAVITY + yd[4::LINK])  # a joint carries those of all links after it
    y[7::LINK] = -np.cumsum(push[::-1])[::-1]
    return y, yd


def run_ida(links, times, tol):
    """Positions of the centroids (k, links, 3), m, and seconds; SUNDIALS makes the banded Jacobian by differences."""
    from sksundae.ida import IDA

    f, y, yd, algebraic, atol = _problem(links, tol)
    solver = IDA(
        f, algebraic_idx=algebraic, rtol=tol, atol=atol, linsolver="band", lband=BAND, uband=BAND, first_step=1e-7,
        max_num_steps=10_000_000,
    )  # fmt: skip
    solver.solve(times[:2], y, yd)  # the first call of a process compiles, and loads
    seconds, found = timed(solver.solve, times, y, yd)
    if not found.success:
        raise RuntimeError(str(found.message))
    return _places(found.y), seconds


def run_radau(links, times, tol):
    """The same by Radau of order 5, scipy_dae; its Jacobian by differences of groups of columns."""
    from scipy.sparse import eye_array
    from scipy_dae.integrate import solve_dae

    f, y, yd, _, atol = _problem(links, tol)

    def g(t, y, yd):
        out = np.empty(y.size)
        f(t, y, yd, out)
        return out

    near = sum(eye_array(y.size, k=k) for k in range(-BAND, BAND + 1)) if links > 4 else None
    sparsity = {} if near is None else {"jac_sparsity": (near.tocsc(), eye_array(y.size).tocsc())}
    g(0.0, y, yd)  # the first call of a process compiles
    options = {"rtol": max(tol, 1e-13), "atol": atol, "t_eval": times, "first_step": 1e-7, **sparsity}
    seconds, found = timed(solve_dae, g, (0.0, times[-1]), y, yd, method="Radau", **options)
    if not found.success:
        raise RuntimeError(str(found.message))
    return _places(found.y.T), seconds


def _problem(links, tol):
    """The residual f(t, y, yd, out), unknowns and rates at the start, places of the multipliers, tolerances."""
    stiffness, damping = spring(links)
    y, yd = start(links)
    algebraic = np.flatnonzero(np.arange(y.size) % LINK >= 6)
    atol = np.full(y.size, tol)
    atol[algebraic] = 1e6

    def f(t, y, yd, out):
        residual(y, yd, stiffness, damping, out)

    return f, y, yd, algebraic, atol


def _places(y):
    """Of unknowns (k, 10 links)."""
    places = np.zeros((len(y), y.shape[1] // LINK, 3))
    places[:, :, 0], places[:, :, 2] = y[:, 0::LINK], y[:, 1::LINK]
    return places
