"""Normal loads of joint friction, from positions, velocities and accelerations."""

import numpy as np

from ..elements.loops.body_poses import take_loads
from ..formulations.friction_solve import find_reactions
from ..jit.kernels import entry, resident
from ..rows.interface import weigh_bodies
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import graph_of
from ..workspaces.workspace import load_parts, parts
from .factorised_rows import factorise_at
from .generalised_forces import applied_loads, inertial_forces, velocity_forces


@entry
def _solve(context, t, q, qd, r, out):
    """out (k, frictions): normal loads with Phi_q^T lam - sum_i g_i N_i = r (k, n); NaN if there are none.

    H W (H^T lam - sum_i g_i N_i(lam)) = H W r: the acceleration equation for the residual forces.
    """
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    for k in range(t.size):
        found = factorise_at(graph, s, f, t[k], q[k])
        take_loads(graph.bodies, q[k], r[k], f.Z)
        weigh_bodies(graph, f.Z)
        for e in range(f.gamma.size):
            f.gamma[e] = 0.0
        found = found and find_reactions(graph, s, f, q[k], qd[k], t[k])
        for i in range(out.shape[1]):
            out[k, i] = f.friction.load[7 * i] if found else np.nan


def with_normal_loads(packed, t, q, qd, qdd, memory):
    """Return the memory of forces (k, slots), then normal loads of joint friction if there is any."""
    system = packed.system
    if not system.normals.size:
        return memory
    memory = np.zeros((t.size, system.memory.size)) if memory is None else memory
    if memory.shape[1] > system.memory.size:
        return memory
    r = applied_loads(system, t, q, qd, memory)
    r += velocity_forces(system, q, qd)
    r -= inertial_forces(system, q, qdd)
    own = system._replace(reals=system.reals.copy())
    context, *_keep = resident(parts(own, graph_of(packed, REDUCED), q.shape[1]))
    loads = np.zeros((t.size, system.normals.size))
    _solve(context, t, q, qd, r, loads)
    return np.hstack((memory, loads))
