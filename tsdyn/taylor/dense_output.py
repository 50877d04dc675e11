"""Dense output of a Taylor run: the series of a step, evaluated and projected onto the manifold."""

import numpy as np

from ..elements.loops.body_poses import place_bodies
from ..elements.loops.constraint_series import BODY_ROW
from ..jit.kernels import entry
from ..maths.dense_linalg import copy
from ..rows.interface import allocate_tangent
from ..runs.dense_output import put_state, recall
from ..workspaces.run_state import B_DATA, B_START, lay_out, load_run
from ..workspaces.workspace import plain_work
from .friction_layout import kept_multipliers
from .step_end import keep_start
from .step_parts import set_floor, state_within
from .workspace import SeriesContext, Trial, load_series, no_series


@entry
def read_series(context, run, t, rows, blocks, charts, points, out):
    """out (k, 3, n): q, qd, qdd at t (k,), each within the step blocks[rows]; as runs.dense_output.read. Status."""
    c, r = load_series(context), load_run(run)
    w, x = c.work, c.expansion
    for i in range(t.size):
        # A block is the whole series of a step
        block = blocks[rows[i]]
        data = block[B_DATA:]
        x.order.top = int(data[0])
        copy(data[1:][: w.q.size], w.q)
        copy(data[1 + w.q.size :][: x.bodies.size], x.bodies)
        # Poses of the start are where Euler parameters are followed from
        recall(c.system, block)
        set_floor(c, w.q)
        place_bodies(c.graph.bodies, w.q, c.tangent.poses)
        keep_start(c.graph, c.tangent.poses, x.start)
        status = state_within(context, c, r.kernels, t[i], t[i] - block[B_START])
        if status != 0:
            return status
        put_state(w, out[i])
    return 0


def reading_workspace(system, graph, orders, size):
    """Context and run of a reader, with room for so many orders; size: of the numbers in the constraints."""
    own = system._replace(reals=system.reals.copy())
    n = int(own.bodies[:, 1].sum())
    work = plain_work(n)
    work.control.size = size
    expansion = no_series(orders, np.zeros((len(graph.bodies) + 1) * BODY_ROW * orders), kept_multipliers(graph))
    return SeriesContext(own, work, graph, allocate_tangent(graph, n), expansion, Trial()), lay_out(n, 0, 0, 0, 0)
