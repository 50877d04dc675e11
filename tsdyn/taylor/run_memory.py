"""Run workspace of the Taylor driver, allocated once a scene and reused by successive runs."""

import numpy as np

from ..errors import InvalidArgument, Status
from ..formulations.locked_orientations import moving_parts
from ..jit.kernels import resident
from ..model.packed import System
from ..rows.interface import allocate_free, reset_selection
from ..runs.arguments import step_count
from ..runs.run_state import (
    ADAPTIVE,
    ATOL,
    DENSE,
    LEAVE_WHEN_STIFF,
    MAX_STEP,
    RTOL,
    STEPS_WANTED,
    T_END,
    T_ORIGIN,
    H,
    T,
    enter_joints,
    lay_out,
    no_record,
)
from ..runs.trajectory import B_DATA
from ..sparse.constraint_graph import BIAS, DRIFT, REDUCED, VALUES
from ..sparse.constraint_graphs import with_loops
from ..workspaces.workspace import plain_work
from .layout import allocate_expansion, masks
from .step_parts import PASS, STEPS, pass_singular
from .stepper import advance_series
from .workspace import HIGHEST, LOWEST, NEXT, REFINED, TOP, SeriesContext

MANY = 100  # bodies: errors of a solution by elimination grow with their number


class Series:
    """What the Taylor runs of a packed scene share: its network, with the loops that they need.

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
        network, self.kinds = moving_parts(packed)
        self.constant_columns = masks(network, packed)
        self.network = with_loops(network, self.kinds, REDUCED, VALUES, BIAS, DRIFT)
        self.packed = packed


class SeriesMemory:
    """System, series and state of a run, and where kernels find them; one run at a time.

    Parameters
    ----------
    prepared : Prepared
    highest : int
        The highest order that there is room for.
    """

    reason = ""  # of the end of a run: told by its status

    def __init__(self, prepared, highest):
        self.series, self.packed, self.weight = prepared.series, prepared.packed, prepared.n
        packed = self.packed
        series, n, slots, angles = self.series, prepared.n, packed.system.memory.size, prepared.handles.count
        system = System(*(array.copy() for array in packed.system))
        self.work, free = plain_work(n), allocate_free(series.network, n)
        expansion = allocate_expansion(series.network, series.kinds, packed, highest)
        self.steps = np.zeros(STEPS, np.int64)
        block = B_DATA + 1 + n + expansion.bodies.size + angles + slots
        self.run = lay_out(n, 0, 0, 0, 0, 0, block, slots, angles)
        self.settle(SeriesContext(system, self.work, series.network, free, expansion))
        self._run, *self._keep_run = resident(self.run)
        self.nbytes = 8 * (expansion.bodies.size + expansion.constraints.size + free.rows.S.size + self.run.block.size)

    def settle(self, context, header=()):
        """Let the kernels find this context, behind the integers of a header."""
        self.context = context
        self._context, *self._keep = resident(context, header)

    @property
    def where(self):
        """Addresses of the context and of the run."""
        return self._context, self._run

    def clear(self, task, order, dense):
        """As if it were new, for this task; the order is the first step's, and the two bounds of the others'."""
        system, work, clock, numbers = self.context.system, self.work, self.run.clock, self.run.numbers
        system.reals[:] = task.prepared.packed.system.reals  # what forces remember is written there
        enter_joints(self.run, task.prepared.handles, task.remembered)
        if system.memory.size:
            system.reals[system.memory] = task.remembered[self.run.joints.shape[0] :]
        reset_selection(self.series.network, self.context.free)
        numbers.fill(0)
        clock.fill(0.0)
        work.counters.clear()
        work.q[:], work.qd[:] = task.q, task.qd
        work.control.u_tol, work.control.size = task.constraint_tol, task.prepared.packed.size
        clock[T] = clock[T_ORIGIN] = task.span[0]
        method = task.method
        clock[T_END], clock[MAX_STEP] = task.span[1], method.max_step or np.inf
        clock[H] = method.step or method.first_step or 0.0
        clock[RTOL], clock[ATOL] = method.step_tolerances()
        numbers[ADAPTIVE], numbers[DENSE] = method.step is None, dense
        numbers[STEPS_WANTED] = step_count(*task.span, method.step) if method.step else 2**62
        numbers[LEAVE_WHEN_STIFF] = task.choose is not None
        orders = self.context.expansion.order
        orders[TOP] = order[0]
        orders[NEXT], orders[LOWEST], orders[HIGHEST] = order
        orders[REFINED] = max(method.refined, int(len(self.series.network.bodies) > MANY))

    def load(self):
        """Load the driver, where this process has not called it yet."""
        if not getattr(advance_series, "overloads", True):
            advance_series(self._context, self._run, no_record(), self.steps, 0)

    def advance(self, record, most):
        """Make up to `most` steps; the Status, as of the driver's `advance`."""
        status = Status(advance_series(self._context, self._run, record, self.steps, most))
        if status == Status.PASSAGE:  # the run ends next to a singular configuration
            self.steps[PASS] = pass_singular.address
            status = Status(advance_series(self._context, self._run, record, self.steps, most))
        return status
