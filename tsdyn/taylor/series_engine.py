"""The engine of runs by Taylor series: its run workspace and dense output; see runs/driver.py."""

import numpy as np

from ..elements.loops.constraint_rows import place_bodies
from ..elements.loops.constraint_series import BODY_ROW
from ..errors import InvalidArgument, Status
from ..formulations.locked_orientations import moving_parts
from ..jit.kernels import entry
from ..maths.dense_linalg import copy
from ..model.packed import System
from ..rows.constraint_graph import BIAS, DRIFT, REDUCED, VALUES, are_unequal
from ..rows.graph_builder import with_loops
from ..rows.interface import allocate_tangent
from ..runs.dense_output import READ, TrajectoryReading, put_state, recall
from ..runs.run_memory import Memory
from ..workspaces import B_DATA, B_START, lay_out, load_run, plain_work, words
from .joint_friction import accelerate_with_friction_here, expand_friction_series
from .layout import (
    SeriesContext,
    Trial,
    allocate_expansion,
    empty_series,
    is_far,
    kept_multipliers,
    load_series,
    masks,
    refusal,
    room,
    with_ground_contacts,
)
from .step_end import keep_start
from .step_parts import (
    accelerate_here,
    check_laws,
    expand_far_series,
    expand_series,
    pass_singular,
    reach,
    set_floor,
    state_within,
)
from .stepper import advance_series
from .tolerances import MANY_BODIES

# Dense output of a Taylor run: the series of a step, evaluated and projected onto the manifold.


@entry(*READ)
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
    expansion = empty_series(orders, np.zeros((len(graph.bodies) + 1) * BODY_ROW * orders), kept_multipliers(graph))
    return SeriesContext(own, work, graph, allocate_tangent(graph, n), expansion, Trial()), lay_out(n, 0, 0, 0, 0)


# Run workspace of the Taylor driver, and what all Taylor runs of a scene share.

PASSAGE = Status.PASSAGE


class Series:
    """What the Taylor runs of a packed scene share: its graph, with the loops that they need.

    Parameters
    ----------
    packed : Packed
    found : str
        Its `layout.refusal`.

    Raises
    ------
    InvalidArgument
        If a part of the scene has no series, or an inertia has no inverse; names them.
    """

    def __init__(self, packed, found):
        if found:
            raise InvalidArgument(found)
        graph, self.kinds = moving_parts(packed)
        self.constant_columns = _masks_once(graph, packed)
        self.graph = with_ground_contacts(with_loops(graph, self.kinds, REDUCED, VALUES, BIAS, DRIFT), self.kinds)
        self.refined = int(len(graph.bodies) > MANY_BODIES or are_unequal(packed.system))


def _masks_once(graph, packed):
    """As `layout.masks`, which scenes of a family with the same parameters of constraints share."""
    shared = packed.derived.shared
    if shared is None:
        return masks(graph, packed)
    key = masks, graph.row.tobytes(), graph.bodies.tobytes()
    given, table, constant = shared.get(key, (None, None, 0))
    if given == packed.parameters:
        graph.table[...] = table
        return constant
    constant = masks(graph, packed)
    shared[key] = packed.parameters, graph.table.copy(), constant
    return constant


class SeriesMemory(Memory):
    """The memory of a run by series.

    Parameters
    ----------
    prepared : Prepared
    highest : int
        The highest order that there is room for.
    """

    advance_kernel = staticmethod(advance_series)

    def __init__(self, prepared, highest):
        self.series, packed, n = prepared.series, prepared.packed, prepared.n
        graph, system = self.series.graph, System(*(array.copy() for array in packed.system))
        expansion = allocate_expansion(graph, self.series.kinds, packed, highest)
        tangent, trial = allocate_tangent(graph, n), Trial()
        trial.left = 1.0
        if expansion.forces["check"].any():
            trial.check, trial.sharp = check_laws.address, int(expansion.forces["sharp"].any())
        block = 1 + n + expansion.bodies.size
        run = lay_out(n, 0, 0, prepared.handles.count, system.memory.size, block=block)
        context = SeriesContext(system, plain_work(n), graph, tangent, expansion, trial)
        super().__init__(prepared, graph, context, run)
        self.reals = packed.system.reals
        self._laid_out.append(words(expansion.order))
        self.nbytes = 8 * (expansion.bodies.size + expansion.constraints.size + tangent.rows.S.size + run.block.size)

    def advance(self, log, most):
        """As of `Memory`."""
        status = super().advance(log, most)
        if status is PASSAGE:  # the run ends next to a singular configuration
            self.run.kernels.pass_singular = pass_singular.address
            status = super().advance(log, most)
        return status


# The engine of runs by Taylor series; see runs/driver.py.


class SeriesEngine:
    """A run by Taylor series, in the tangent form."""

    layouts, readings = 0, (None, (None, None))

    def __init__(self, prepared, method, form, within):
        self.method, self.form, self.within = method, form, within
        self.series, self.orders = prepared.series, method.orders()
        self.highest = self.orders[2]
        self.kind = "taylor", self.highest
        self.skipped = prepared.spheres, prepared.still, self.series.constant_columns

    def memory(self, prepared):
        """A new `SeriesMemory`."""
        return SeriesMemory(prepared, self.highest)

    def serves(self, memory):
        """Whether the memory is not that of the scene before it was changed."""
        return memory.series is self.series

    def lay_out(self, memory, interval):
        """Enter the orders of the method and the kernels; no chart is forced by an interval."""
        method, graph = self.method, self.series.graph
        order = memory.context.expansion.order
        order.room, (order.top, order.lowest, order.highest) = room(self.highest), self.orders
        order.next = order.top
        order.refined = max(method.refined, self.series.refined)
        if method.step is not None:  # the order follows from tolerances even so
            memory.run.clock.rtol, memory.run.clock.atol = method.step_tolerances()
        _set_kernels(memory.run, graph, self.highest, self.within)

    def reading(self, memory, prepared, constraint_tol):
        """A `Reading` of the steps; a function and its arguments that make it in another process."""
        packed, graph = prepared.packed, self.series.graph
        return _reading(packed, graph, self.highest), (read_again, packed, self.highest)


def read_again(packed, highest):
    """A `Reading` in another process than the run's."""
    return _reading(packed, Series(packed, refusal(packed)).graph, highest)


def _reading(packed, graph, highest):
    def workspace():
        context, run = reading_workspace(system, graph, room(highest), packed.size)
        _set_kernels(run, graph, highest, True)
        return context, run

    system = packed.system
    return TrajectoryReading(read_series, workspace, system, shift=0, degree=16)


def expanding(rough, far):
    """What expands the series; rough: of a scene with joint friction, far: of many bodies."""
    return expand_friction_series if rough else expand_far_series if far else expand_series


def accelerating(rough):
    """What gives accelerations between the steps."""
    return accelerate_with_friction_here if rough else accelerate_here


def _set_kernels(run, graph, highest, within):
    """Addresses that the driver and readers call; within: whether anything is asked for between the steps."""
    kernels, rough = run.kernels, len(graph.frictions) > 0
    kernels.expand, kernels.reach = expanding(rough, is_far(graph, highest)).address, reach.address
    if within:
        kernels.accelerate_here, kernels.pass_singular = accelerating(rough).address, pass_singular.address
