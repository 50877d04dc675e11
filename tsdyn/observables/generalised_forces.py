"""Generalised forces along a trajectory, (k, n): applied forces Q_A, velocity forces Q_v, and M qdd."""

import numpy as np

from ..elements.bodies import transform_g
from ..jit.kernels import entry
from ..model.equations import applied_forces, set_time


@entry
def sum_forces(s, t, q, qd, memory, out):
    """out (k, n) += all forces but gravity; memory (k, ...): of forces at each output, then normal loads."""
    for row in range(t.size):
        set_time(s, t[row])
        for i in range(s.memory.size):
            s.reals[s.memory[i]] = memory[row, i]
        for i in range(memory.shape[1] - s.memory.size):
            s.reals[s.normals[i]] = memory[row, s.memory.size + i]
        applied_forces(s, q[row], qd[row], t[row], out[row])


def force_loads(system, t, q, qd, memory=None):
    """Forces without gravity (k, n); without forces no kernel is loaded."""
    out = np.zeros_like(q)
    if len(system.forces):
        system = system._replace(reals=system.reals.copy())  # signals and memory are written to
        memory = np.zeros((t.size, system.memory.size)) if memory is None else memory
        sum_forces(system, t, q, qd, memory, out)
    return out


def applied_loads(system, t, q, qd, memory=None):
    """Q_A (k, n): forces and gravity."""
    Q = force_loads(system, t, q, qd, memory)
    Q[:, _places(system, 0, 3)] += system.mass[:, None] * system.gravity
    return Q


def velocity_forces(system, q, qd):
    """Q_v (k, n): 8 Gd^T J' Gd p on p."""
    S, at = np.zeros_like(q), _places(system, 3, 7)
    if at.size:
        S[:, at] = 8.0 * _turned(qd[:, at], system, q[:, at])
    return S


def inertial_forces(system, q, qdd):
    """M qdd (k, n): m rdd on r and 4 G^T J' G pdd on p."""
    f, at = np.zeros_like(q), _places(system, 0, 3)
    f[:, at] = system.mass[:, None] * qdd[:, at]
    at = _places(system, 3, 7)
    if at.size:
        f[:, at] = 4.0 * _turned(q[:, at], system, qdd[:, at])
    return f


def _places(system, first, end):
    """Return the indices of coordinates first to end of each body that has them, (b, end - first)."""
    bodies = system.bodies[system.bodies[:, 1] >= end, :1]
    return bodies + np.arange(first, end)


def _turned(p, system, x):
    """G(p)^T J' G(p) x of the rigid bodies; p, x (k, b, 4)."""
    G, J = transform_g(p), system.inertia[system.bodies[:, 1] == 7].reshape(-1, 3, 3)
    y = np.einsum("kbij,kbj->kbi", G, x)
    return np.einsum("kbji,kbj->kbi", G, np.einsum("bij,kbj->kbi", J, y))
