"""Run workspace of the step driver, allocated once and reused by successive runs."""

import numpy as np

from ..errors import Status
from ..jit.kernels import resident
from ..methods.diagonally_implicit import prepare_implicit
from ..model.packed import System
from ..rows.interface import redundancy, reset_selection
from ..workspaces.workspace import Context, allocate, allocate_linear, basis_free_parts
from .run_state import (
    ADAPTIVE,
    ATOL,
    DENSE,
    ERROR_BEFORE,
    EXPONENT,
    FIRST_ORDER,
    INTERVAL,
    LAST_STAGE,
    LEAVE_WHEN_STIFF,
    MAX_STEP,
    RTOL,
    SHARE,
    STABLE,
    STAGE_AT,
    STEPS_WANTED,
    T_END,
    T_ORIGIN,
    H,
    T,
    enter_joints,
    lay_out,
    no_record,
)
from .stepper import advance
from .trajectory import B_DATA, warm_size

MATRICES = 500  # matrices of n coordinates cost as much a step as O(N) kernels do with n^3 / MATRICES more of them


class Memory:
    """System, workspace and state of a run, and where kernels find them; one run at a time.

    Parameters
    ----------
    prepared : Prepared
    network : Network
        Of the scene, as the form needs it.
    joint_rows : int or None
        Rows that are no normalisations, for the form without a basis.
    implicit : bool
    kept : int
        Floats that forces keep for an implicit method.
    nx, ny : int
        Sizes of x and y.
    tableau, scratch, width : int
        Floats of the method's numbers, of its memory and of its interpolant.
    """

    reason = ""  # of the end of a run: told by its status

    def __init__(self, prepared, network, joint_rows, implicit, kept, nx, ny, tableau, scratch, width):
        n, m, self.packed = prepared.n, prepared.m, prepared.packed
        self.implicit, self.basis_free = implicit, joint_rows is not None
        self.weight = n if self.basis_free else n + n**3 // MATRICES
        self.source, _ = prepared.system(implicit)
        system = System(*(array.copy() for array in self.source))
        self.network, redundant = network, redundancy(network)
        self.work = allocate(n, m, len(prepared.packed.bodies), 0.0, joint_rows=joint_rows, redundant=redundant)
        slots, angles = system.memory.size, prepared.handles.count
        block = B_DATA + width + angles + slots
        self.run = lay_out(n, nx, ny, tableau, scratch, warm_size(self.work), block, slots, angles)
        linear = allocate_linear(system, n, m, implicit, kept, redundant)
        if implicit:
            linear = linear._replace(now=self.run.now, before=self.run.before)
        self.settle(Context(system, self.work, linear, *basis_free_parts(network, n, not self.basis_free)))
        self.addresses = np.zeros(12, np.int64)
        self._written = [self.work.q.base, self.run.x.base, self.run.numbers]
        self._written += [linear.numbers.base, linear.pivots, linear.kernels]
        self._run, *self._keep_run = resident(self.run)
        self.nbytes = sum(array.nbytes for array in (*self._written, self.context.free.rows.S, self.context.free.poses))

    def settle(self, context, header=()):
        """Let the kernels find this context, behind the integers of a header."""
        self.context = context
        self._context, *self._keep = resident(context, header)

    @property
    def where(self):
        """Addresses of the context and of the run."""
        return self._context, self._run

    def clear(self, task):
        """As if it were new, for this task: whatever a run before has left behind is gone."""
        for array in self._written:
            array.fill(0)
        for record in (self.work.control, self.work.counters, self.context.local.state):
            record.clear()
        reset_selection(self.network, self.context.free)
        system, work = self.context.system, self.work
        source, _ = task.prepared.system(self.implicit)
        if self.source is not source:
            self.source = source
            for own, new in zip(system, source, strict=True):
                own[:] = new
        system.reals[:] = source.reals  # motions, signals and what forces remember are written there
        enter_joints(self.run, task.prepared.handles, task.remembered)
        if system.memory.size:
            system.reals[system.memory] = task.remembered[self.run.joints.shape[0] :]
        work.q[:], work.qd[:] = task.q, task.qd
        self.run.now[0], self.run.now[1] = task.q, task.qd
        control = work.control
        control.u_tol = control.b_tol = task.constraint_tol
        control.size = task.prepared.packed.size

    def give_method(self, task, tableau, steps, dense, addresses):
        """The numbers of the method and what it is to do; steps is None for an adaptive run."""
        method, clock, numbers = task.method, self.run.clock, self.run.numbers
        first_order = task.form.first_order
        self.run.tableau[:] = tableau
        self.addresses[:] = addresses
        clock[T] = clock[T_ORIGIN] = task.span[0]
        clock[T_END] = task.span[1]
        numbers[FIRST_ORDER], numbers[DENSE], numbers[INTERVAL] = first_order, dense, task.interval
        nx = self.run.x.size
        if steps is None:
            numbers[ADAPTIVE], numbers[STEPS_WANTED] = 1, 2**62
            clock[RTOL], clock[ATOL] = method.step_tolerances()
            clock[SHARE] = 1.0
            clock[EXPONENT], clock[ERROR_BEFORE] = 1.0 / (method.embedded_order + 1), 1.0
            clock[MAX_STEP] = longest = method.max_step or np.inf
            clock[H] = min(method.first_step or 0.0, longest)  # 0: of the driver's own choice
            if method.stability_limit and not first_order:
                clock[STABLE] = method.stability_limit
                numbers[LAST_STAGE] = 2 * len(method.tableau.c) * nx
                numbers[LEAVE_WHEN_STIFF] = task.choose is not None
        else:
            clock[H], numbers[STEPS_WANTED] = method.step, steps
        if method.implicit:
            prepare_implicit(self.context.linear, method, task.form.implicit())
            numbers[STAGE_AT] = (2 * len(method.tableau.c) + 1) * nx

    def load(self):
        """Load the driver, where this process has not called it yet."""
        if not getattr(advance, "overloads", True):
            advance(self._context, self._run, no_record(), self.addresses, 0)

    def advance(self, record, most):
        """Make up to `most` steps; the Status, as of the driver's `advance`."""
        return Status(advance(self._context, self._run, record, self.addresses, most))
