"""Normal loads of frictions, and their forces for unit loads, at one state: kernels, and their workspace."""

import numpy as np

from ..elements.bodies import transform_g
from ..elements.loops.friction import DERIVE, HERE
from ..formulations.accelerations import normal_load, unit_friction
from ..jit.kernels import entry, resident
from ..model.equations import evaluate_constraints, recall, set_time
from ..model.handles import index_of
from ..model.packed import coupled_loads
from ..observables.generalised_forces import sum_forces
from ..observables.reactions import solve_multipliers, solve_normal_loads
from ..rows.constraint_graph import REDUCED, graph_of
from ..workspaces import load_parts, parts
from .contact_rows import find_reactions
from .slip_velocities import slip_velocities


@entry("pdvvvm")
def find_units(context, t, q, qd, memory, out):
    """out (frictions, 14): generalised forces on the coordinates of a, then of b, for unit normal loads."""
    c = load_parts(context)
    recall(c.system, memory)
    set_time(c.system, t)
    for i in range(out.shape[0]):
        unit_friction(c.system, c.graph.frictions[i], q, qd, t, out[i])


@entry("pvmm")
def find_loads(context, q, reactions, out):
    """out (frictions, 7): normal loads of reactions (frictions, 6), and their derivatives by these.

    Reactions: force, ground frame, and torque about the centroid, body frame.
    """
    c = load_parts(context)
    for i in range(out.shape[0]):
        normal_load(c.system, c.tangent, c.graph.frictions[i], q, DERIVE | HERE, reactions[i], out[i])


KERNELS = (
    find_units, find_loads, slip_velocities, sum_forces, evaluate_constraints, solve_normal_loads, solve_multipliers,
    find_reactions,
)  # fmt: skip


class NormalLoads:
    """Frictions of a packed scene that depend on reactions, at one state.

    Parameters
    ----------
    packed : Packed
    t : float, s
    q, qd : ndarray (n,)
    memory : ndarray (slots,)
    Phi_q : ndarray (m, n)

    Attributes
    ----------
    units : ndarray (n, frictions)
        Generalised forces for unit normal loads.
    """

    def __init__(self, packed, t, q, qd, memory, Phi_q):
        own = packed.system._replace(reals=packed.system.reals.copy())
        self.context, *self._keep = resident(parts(own, graph_of(packed, REDUCED), q.size))
        self.q, self.frictions, spans = q, coupled_loads(packed), packed.system.bodies.tolist()
        found = np.zeros((len(self.frictions), 14))
        find_units(self.context, t, q, qd, memory, found)
        self.units, self.wrenches = np.zeros((q.size, len(found))), []
        members = {id(member.constraint): member.rows for member in packed.members}
        for i, load in enumerate(self.frictions):
            force, rows = load.force, members[id(load.force.joint)]
            for k, body in enumerate((force.a, force.b)):
                if body.dimension:
                    at, length = spans[index_of(packed, body)]
                    self.units[at : at + length, i] = found[i, 7 * k : 7 * k + length]
            # The reaction on a body by the multipliers of the joint: -Phi_r^T lam, and -G Phi_p^T lam / 2
            at, length = spans[index_of(packed, force.on)]
            wrench = np.zeros((6, len(Phi_q[rows])))
            wrench[:3] = -Phi_q[rows, at : at + 3].T
            if length == 7:
                wrench[3:] = -0.5 * transform_g(q[at + 3 : at + 7]) @ Phi_q[rows, at + 3 : at + 7].T
            self.wrenches.append((rows, wrench))

    def reactions(self, lam):
        """Reactions (frictions, 6, ...) by multipliers (m, ...)."""
        return np.array([wrench @ lam[rows] for rows, wrench in self.wrenches])

    def loads(self, reactions):
        """Normal loads (frictions,) of reactions (frictions, 6), and their derivatives by these."""
        out = np.zeros((len(reactions), 7))
        find_loads(self.context, self.q, reactions, out)
        return out[:, 0], out[:, 1:]
