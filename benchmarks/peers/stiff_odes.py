"""SciPy's Radau and SUNDIALS CVODE on stiff scenes in minimal coordinates, Jacobians by differences.

chain    angles of the links from the horizontal, as of stiff_chain.py
row      places of the blocks of `stiff.pushed`; the rates are compiled
"""

import numba
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks import stiff
from benchmarks.contender import timed
from benchmarks.stiff_chain import GRAVITY, INERTIA, LENGTH, MASS, reach, spring


def chain(links, times, tol):
    """Positions of the centroids (k, links, 3), m, and seconds, by SciPy."""
    drops = reach(links)
    a, first = MASS * LENGTH**2 * drops.T @ drops, MASS * LENGTH * GRAVITY * drops.sum(axis=0)
    own, (stiffness, damping) = INERTIA * np.eye(links), spring(links)

    def rates(_, y):
        angle, rate = y[:links], y[links:]
        between = angle[:, None] - angle
        bend, turn = np.diff(angle, prepend=0.0), np.diff(rate, prepend=0.0)
        torque = -stiffness * bend - damping * turn
        load = first * np.cos(angle) + torque - np.append(torque[1:], 0.0) - (a * np.sin(between)) @ rate**2
        return np.concatenate((rate, np.linalg.solve(a * np.cos(between) + own, load)))

    found, seconds = _by_scipy(rates, np.zeros(2 * links), times, tol)
    x, z = (LENGTH * f @ drops.T for f in (np.cos(found[:, :links]), -np.sin(found[:, :links])))
    return np.stack((x, np.zeros_like(x), z), axis=2), seconds


def row(times, tol, blocks=8):
    """The same of the row."""
    y = _at_rest(blocks)
    found, seconds = _by_scipy(lambda t, y: _row_rates(t, y, *stiff.ROW), y, times, tol)
    return _in_space(found[:, :blocks]), seconds


def row_by_cvode(times, tol, blocks=8):
    """The same by CVODE, BDF of variable order."""
    from sksundae.cvode import CVODE

    def f(t, y, yd):
        yd[:] = _row_rates(t, y, *stiff.ROW)

    solver = CVODE(f, rtol=tol, atol=tol, method="BDF", max_num_steps=10_000_000)
    solver.solve(times[:2], _at_rest(blocks))  # the first call of a process compiles, and loads
    seconds, found = timed(solver.solve, times, _at_rest(blocks))
    if not found.success:
        raise RuntimeError(str(found.message))
    return _in_space(found.y[:, :blocks]), seconds


def _at_rest(blocks):
    return np.concatenate((0.1 * np.arange(blocks), np.zeros(blocks)))


@numba.njit
def _row_rates(t, y, stiffness, damping, friction, slip, push, rate):
    n = y.size // 2
    out = np.empty(2 * n)
    for i in range(n):
        v = y[n + i]
        out[i], out[n + i] = v, -friction * v / np.sqrt(v * v + slip * slip)
    out[n] += push * np.sin(rate * t)
    for i in range(1, n):
        pull = stiffness * (y[i] - y[i - 1] - 0.1) + damping * (y[n + i] - y[n + i - 1])
        out[n + i - 1] += pull
        out[n + i] -= pull
    return out


def _by_scipy(rates, y, times, tol):
    rates(0.0, y)  # the first call of a process compiles
    options = {"t_eval": times, "rtol": max(tol, 1e-13), "atol": tol}
    seconds, found = timed(solve_ivp, rates, (0.0, times[-1]), y, "Radau", **options)
    if not found.success:
        raise RuntimeError(found.message)
    return found.y.T, seconds


def _in_space(x):
    return np.stack((x, np.zeros_like(x), np.zeros_like(x)), axis=2)
