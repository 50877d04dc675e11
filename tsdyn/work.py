"""Work along a trajectory, by Gauss quadrature of the power on the dense output of every step."""

from types import SimpleNamespace

import numpy as np

from .power import driving_power, force_powers
from .reactions import multipliers

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
AT_ONCE = 2000  # pieces of the interval


def work(solution, trajectory):
    """Work (k,), J, since the start: of applied and driving forces, less what dampers and friction have taken."""
    edges = np.unique(np.concatenate([[trajectory.start], trajectory.edges, solution.t]))
    done = np.zeros(edges.size)
    for first in range(0, edges.size - 1, AT_ONCE):
        some = edges[first : first + AT_ONCE + 1]
        middle, half = 0.5 * (some[1:] + some[:-1]), 0.5 * np.diff(some)
        t = (middle[:, None] + half[:, None] * NODES).ravel()
        power = _power(solution, trajectory, t).reshape(-1, NODES.size)
        done[first + 1 : first + some.size] = half * (power @ WEIGHTS)
    return np.cumsum(done)[np.searchsorted(edges, solution.t)]


def _power(solution, trajectory, t):
    states, memory, status = trajectory(t)
    q, qd, qdd = (np.ascontiguousarray(states[:, i]) for i in range(3))
    system = solution.system
    at = SimpleNamespace(t=t, q=q, qd=qd, _memory=memory, packed=solution.packed, system=system)
    if system.rheonomic[0]:
        at.multipliers = multipliers(solution.packed, t, q, qd, qdd, memory)
    powers = force_powers(at)
    return (powers.applied + driving_power(at) - powers.dissipation) * (1.0 if status == 0 else np.nan)
