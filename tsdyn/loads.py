"""Generalised forces along a trajectory, (k, n): applied loads Q_A, velocity terms S, and M qdd."""

import numpy as np

from ._kernel import entry
from .assembly import applied_forces, set_time
from .bodies import transform_g


@entry
def sum_forces(s, t, q, qd, memory, out):
    """out (k, n) += all forces but gravity at every output; memory (k, slots) is what they remember."""
    for row in range(t.size):
        set_time(s, t[row])
        for i in range(s.memory.size):
            s.reals[s.memory[i]] = memory[row, i]
        applied_forces(s, q[row], qd[row], t[row], out[row])


def force_loads(system, t, q, qd, memory=None):
    """Forces without gravity (k, n); no kernel is loaded where there are none."""
    out = np.zeros_like(q)
    if len(system.forces):
        system = system._replace(reals=system.reals.copy())  # signals and memory are written to
        memory = np.zeros((t.size, system.memory.size)) if memory is None else memory
        sum_forces(system, t, q, qd, memory, out)
    return out


def applied_loads(system, t, q, qd, memory=None):
    """Q_A (k, n): forces and gravity."""
    Q = force_loads(system, t, q, qd, memory)
    for (at, _), mass in zip(system.bodies, system.mass, strict=True):
        Q[:, at : at + 3] += mass * system.gravity
    return Q


def velocity_forces(system, q, qd):
    """S (k, n): 8 Gd^T J' Gd p on p."""
    S = np.zeros_like(q)
    for (at, length), J in zip(system.bodies, system.inertia, strict=True):
        if length == 7:
            part = slice(at + 3, at + 7)
            Gd = transform_g(qd[:, part])
            S[:, part] = 8.0 * np.einsum("kji,jl,klm,km->ki", Gd, J.reshape(3, 3), Gd, q[:, part])
    return S


def inertial_forces(system, q, qdd):
    """M qdd (k, n): m rdd on r and 4 G^T J' G pdd on p."""
    f = np.zeros_like(q)
    for (at, length), mass, J in zip(system.bodies, system.mass, system.inertia, strict=True):
        f[:, at : at + 3] = mass * qdd[:, at : at + 3]
        if length == 7:
            part = slice(at + 3, at + 7)
            G = transform_g(q[:, part])
            f[:, part] = 4.0 * np.einsum("kji,jl,klm,km->ki", G, J.reshape(3, 3), G, qdd[:, part])
    return f
