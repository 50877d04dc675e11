"""Dense output of a Taylor run: the series of a step, evaluated and projected onto the manifold."""

import numpy as np

from ..elements.loops.body_poses import place_bodies
from ..errors import Status
from ..formulations.tolerances import ROUNDING
from ..jit.kernels import entry, resident
from ..maths.dense_linalg import copy
from ..rows.interface import allocate_free
from ..runs.trajectory import B_DATA, B_START
from ..workspaces.workspace import plain_work
from .step_parts import state_within
from .workspace import NUMBERS, ORDERS, TOP, Expansion, SeriesContext, load_series


@entry
def read_series(context, steps, t, rows, blocks, out):
    """out (k, 3, n): q, qd, qdd at t (k,), each within the step blocks[rows]. Status."""
    c = load_series(context)
    w, x, s = c.work, c.expansion, c.system
    slots = s.memory.size
    for i in range(t.size):
        block = blocks[rows[i]]
        x.order[TOP] = int(block[B_DATA])
        copy(block[B_DATA + 1 :][: w.q.size], w.q)
        copy(block[B_DATA + 1 + w.q.size :][: x.bodies.size], x.bodies)
        for j in range(slots):
            s.reals[s.memory[j]] = block[block.size - slots + j]
        largest = 0.0
        for j in range(w.q.size):
            largest = max(largest, abs(w.q[j]))
        w.control.floor = ROUNDING * (w.control.size + largest)
        place_bodies(c.network.bodies, w.q, c.free.poses)  # which of p and -p is meant
        status = state_within(context, steps, t[i], t[i] - block[B_START])
        if status != 0:
            return status
        copy(w.q, out[i, 0])
        copy(w.qd, out[i, 1])
        copy(w.qdd, out[i, 2])
    return 0


class SeriesReader:
    """Reads states between steps; one thread at a time. A block ends with what is remembered at the step's start.

    Parameters
    ----------
    system : System
        As it was run.
    network : Network
    orders : int
        That there was room for in a block.
    size : float
        Of the numbers in the constraints.
    steps : ndarray
        Addresses, step_parts.EXPAND ... WITHIN.
    """

    shift = 0
    degree = 16  # as of dense.Reader

    def __init__(self, system, network, orders, size, steps):
        system = system._replace(reals=system.reals.copy())
        n = int(system.bodies[:, 1].sum())
        work = plain_work(n)
        work.control.size = size
        none, whole, table = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 0), np.int64)
        bodies = np.zeros((len(network.bodies) + 1) * 24 * orders)
        order = np.zeros(NUMBERS, np.int64)
        order[ORDERS] = orders
        expansion = Expansion(order, bodies, none, table, table, whole, none, table)
        context = SeriesContext(system, work, network, allocate_free(network, n), expansion)
        self.steps = steps
        self.n, (self.context, *self._keep) = n, resident(context)

    def __call__(self, t, rows, blocks, charts, points):
        """States (k, 3, n) at times t (k,), in the steps blocks[rows]; and the Status."""
        out = np.zeros((t.size, 3, self.n))
        return out, Status(read_series(self.context, self.steps, t, rows, blocks, out))
