"""Normal loads of frictions, and their forces for unit loads, at one state: kernels, and their workspace."""

import threading

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


def normal_loads_of(packed, t, q, qd, memory, Phi_q):
    """The `NormalLoads` of a packed scene in this thread, at one state."""
    known, key = packed.derived.reactions, (threading.get_ident(), NormalLoads)
    if key not in known:
        known[key] = NormalLoads(packed, q.size)
    known[key].enter(t, q, qd, memory, Phi_q)
    return known[key]


class NormalLoads:
    """Frictions of a packed scene that depend on reactions, at one state at a time.

    Parameters
    ----------
    packed : Packed
    n : int
        Coordinates.

    Attributes
    ----------
    units : ndarray (frictions, n)
        Generalised forces for unit normal loads.
    """

    def __init__(self, packed, n):
        own = packed.system._replace(reals=packed.system.reals.copy())
        self.context, *self._keep = resident(parts(own, graph_of(packed, REDUCED), n))
        loads, spans = coupled_loads(packed), packed.system.bodies.tolist()
        count, members = len(loads), {id(member.constraint): member.rows for member in packed.members}
        # Where the forces on both bodies are, behind the last coordinate of the ground; of a joint the rows, padded
        self._at, self._on = np.full((count, 14), n), np.zeros((count, 2), int)
        rows = [np.r_[members[id(load.force.joint)]] for load in loads]
        self._m = len(packed.system.segments)
        self._rows = np.full((count, max(map(len, rows))), self._m)
        for i, load in enumerate(loads):
            self._rows[i, : len(rows[i])] = rows[i]
            for k, body in enumerate((load.force.a, load.force.b)):
                if body.dimension:
                    at, length = spans[index_of(packed, body)]
                    self._at[i, 7 * k : 7 * k + length] = np.arange(at, at + length)
            self._on[i] = spans[index_of(packed, load.force.on)]
        self._rigid = self._on[:, 1] == 7
        self.units = np.zeros((count, n))

    def enter(self, t, q, qd, memory, Phi_q):
        """Take a state, and Phi_q (m, n) there."""
        self._q, found, count = q, np.zeros((len(self.units), 14)), len(self.units)
        find_units(self.context, t, q, qd, memory, found)
        units = np.zeros((count, q.size + 1))
        np.put_along_axis(units, self._at, found, 1)
        self.units = units[:, :-1].copy()
        # The reaction on a body by the multipliers of the joint: -Phi_r^T lam, and -G Phi_p^T lam / 2
        Phi_q, at, rigid = np.vstack([Phi_q, np.zeros(q.size)]), self._on[:, :1], self._rigid
        self._wrench = np.zeros((count, 6, self._rows.shape[1]))
        self._wrench[:, :3] = -Phi_q[self._rows[:, None], (at + np.arange(3))[:, :, None]]
        p = at[rigid] + np.arange(3, 7)
        self._wrench[rigid, 3:] = -0.5 * transform_g(q[p]) @ Phi_q[self._rows[rigid, None], p[:, :, None]]

    def reactions(self, lam):
        """Reactions (frictions, 6, ...) by multipliers (rows, ...) of the joints' rows, which are the first ones."""
        padded = np.zeros((self._m + 1, *lam.shape[1:]))
        padded[: len(lam)] = lam
        return self._wrench @ padded[self._rows]

    def loads(self, reactions):
        """Normal loads (frictions,) of reactions (frictions, 6), and their derivatives by these."""
        out = np.zeros((len(reactions), 7))
        find_loads(self.context, self._q, reactions, out)
        return out[:, 0], out[:, 1:]
