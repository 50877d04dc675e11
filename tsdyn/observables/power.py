"""Energy and power of forces along a trajectory, by their Python twins: potential, dissipation, applied power.

    applied = f . xd + dU/dt + dissipation

so that d(kinetic + potential)/dt = applied + driving power - dissipation. dU/dt follows from the potential by truncated
Taylor arithmetic.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..elements.markers import TURN, Point
from ..jit.kernels import twin
from ..maths.power_series import Jet
from ..motions.signals import Signal
from .diagnostics import constraint_rows, marker_jet, marker_jets, starts_of
from .generalised_forces import force_loads
from .reactions import particular


class ForcePowers(NamedTuple):
    """Sums over all forces, (k,) each."""

    potential: np.ndarray  # J
    dissipation: np.ndarray  # W
    applied: np.ndarray  # W


def force_powers(solution):
    """Potential energy, dissipation and applied power of all forces of a solution."""
    total = ForcePowers(*np.zeros((3, solution.t.size)))
    arrays = solution.t, solution.q, solution.qd, solution._memory
    for load in solution.packed.loads:
        for sum_, part in zip(total, load_powers(solution.packed, load, *arrays), strict=True):
            sum_ += part
    return total


def load_powers(packed, load, t, q, qd, memory):
    """Potential energy, dissipation and applied power of one force, over outputs (k,)."""
    kind = type(load.force)
    if hasattr(kind, "powers"):
        return kind.powers(*_lengths(packed, load.force.points, q, qd), load.parameters)
    par = [entry for value in load.parameters for entry in (value.over(t) if isinstance(value, Signal) else [value])]
    if load.slot >= 0:
        par.append(memory[:, load.slot])
    if load.normal >= 0:
        par.append(memory[:, packed.system.memory.size + load.normal])
    x, xd = marker_states(packed, load, q, qd)
    with np.errstate(divide="ignore", invalid="ignore"):
        U = Jet.of(twin(kind.potential)(x, par, t)) if getattr(kind, "potential", None) else Jet(0.0)
        values = [jet.x for jet in x]
        lost = twin(kind.dissipation)(values, xd, par, t) if getattr(kind, "dissipation", None) else 0.0
        if kind.analytic:
            f = [0.0] * len(x)
            twin(kind.law)(values, xd, par, t, f)
            work = sum(a * b for a, b in zip(f, xd, strict=True))
        else:  # user functions don't accept arrays
            system = packed.system._replace(forces=load.alone)
            work = np.einsum("kn,kn->k", force_loads(system, t, q, qd, memory), qd)
    return U.x, lost, work + U.xd + lost


def _lengths(packed, points, q, qd):
    """Length (k,) between points of bodies, and its rate."""
    length, starts = Jet(np.zeros(len(q)), np.zeros(len(q))), starts_of(packed)
    still, point = np.zeros_like(qd), Point("a")
    places = [marker_jet(point, body.dimension, starts.get(body, 0), s, q, qd, still) for body, s in points]
    for one, other in pairwise(places):
        d = [b - a for a, b in zip(one, other, strict=True)]
        length = length + np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    return length.x, length.xd


def marker_states(packed, load, q, qd):
    """x as Jets and xd as arrays, over the outputs."""
    force, starts = load.force, starts_of(packed)
    x, xd = [], []
    jets = marker_jets(starts, force, load.coordinates, q, qd, np.zeros_like(qd))
    for marker, jet in zip(force.markers, jets, strict=True):
        body = force.body_of(marker)
        x += jet
        if marker.code == TURN and body.dimension == 7:
            at = starts[body]
            xd += _turning(q[:, at + 3 : at + 7], qd[:, at + 3 : at + 7])
        else:
            xd += [entry.xd for entry in jet]
    return x, xd


def _turning(p, pd):
    """Angular velocity 2 E(p) pd, ground frame, three arrays."""
    e, ed = p[:, 1:], pd[:, 1:]
    return list((2.0 * (p[:, :1] * ed - pd[:, :1] * e + np.cross(e, ed))).T)


def power_of(solution, item):
    """Power (k,) of a constraint, lam . Phi_t of its rows, or of a force: applied power less dissipation.

    item is a packed.Member or a packed_forces.Load.
    """
    if not hasattr(item, "rows"):
        _, lost, applied = load_powers(solution.packed, item, solution.t, solution.q, solution.qd, solution._memory)
        return applied - lost + np.zeros(solution.t.size)
    return driving_power(solution, item.rows)


def driving_power(solution, rows=slice(None)):
    """Power (k,) of constraints that depend on time, lam . Phi_t; of some rows, a slice."""
    packed, t = solution.packed, solution.t
    if not solution.system.rheonomic[0]:
        return np.zeros(t.size)
    still = np.zeros_like(solution.q)
    Phi_t = constraint_rows(packed, t, solution.q, still, still)[1]
    return (particular(solution.multipliers) * Phi_t)[:, rows].sum(axis=1)
