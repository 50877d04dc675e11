"""Mechanical work along a trajectory: Gauss quadrature of power on the dense output of every step."""

from types import SimpleNamespace

import numpy as np

from ..observables.friction_reactions import with_normal_loads
from ..observables.power import driving_power, force_powers, power_of
from ..observables.reactions import multipliers
from .tolerances import AGREE, DEEPEST

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
AT_ONCE = 2000  # pieces of the interval, evaluated in one call


def work(solution, trajectory, item=None):
    """Work (k,), J, since the start: of applied and driving forces, less dissipation.

    item restricts it to one constraint or force, as in `power.power_of`.
    """
    edges = np.unique(np.concatenate([[trajectory.start], trajectory.edges, solution.t]))
    pieces = np.zeros(0)
    for first in range(0, edges.size - 1, AT_ONCE):
        some = edges[first : first + AT_ONCE + 1]
        pieces = np.append(pieces, _integrals(solution, trajectory, item, some[:-1], some[1:], 0))
    return np.append(0.0, np.cumsum(pieces))[np.searchsorted(edges, solution.t)]


def _integrals(solution, trajectory, item, a, b, depth, known=None):
    """Return the work from each a to its b, by bisection until halves agree: steps of series are long.

    known: what `_quadrature` gives for them, if it has been asked already.
    """
    done, size = known or _quadrature(solution, trajectory, item, a, b)
    if depth == DEEPEST or not a.size:
        return done
    middle = 0.5 * (a + b)
    halves = [(ends, _quadrature(solution, trajectory, item, *ends)) for ends in ((a, middle), (middle, b))]
    found = sum(part for _, (part, _) in halves)
    off = np.flatnonzero(np.abs(found - done) > AGREE * size)
    found[off] = sum(
        _integrals(solution, trajectory, item, first[off], last[off], depth + 1, (part[off], size[off]))
        for (first, last), (part, size) in halves
    )
    return found


def _quadrature(solution, trajectory, item, a, b):
    """Integrals (k,) of the power and of its size, five nodes each."""
    if not a.size:
        return np.zeros(0), np.zeros(0)
    middle, half = 0.5 * (b + a), 0.5 * (b - a)
    t = (middle[:, None] + half[:, None] * NODES).ravel()
    power = _power(solution, trajectory, item, t).reshape(-1, NODES.size)
    return half * (power @ WEIGHTS), half * (np.abs(power) @ WEIGHTS)


def _power(solution, trajectory, item, t):
    states, memory, status = trajectory(t)
    q, qd, qdd = (np.ascontiguousarray(states[:, i]) for i in range(3))
    system = solution.system
    memory = with_normal_loads(solution.packed, t, q, qd, qdd, memory)
    at = SimpleNamespace(t=t, q=q, qd=qd, _memory=memory, packed=solution.packed, system=system)
    if system.rheonomic[0]:
        at.multipliers = multipliers(solution.packed, t, q, qd, qdd, memory)
    if item is not None:
        power = power_of(at, item)
    else:
        powers = force_powers(at)
        power = powers.applied + driving_power(at) - powers.dissipation
    return power if status == 0 else np.full(t.size, np.nan)
