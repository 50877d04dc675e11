"""Run workspace of a driver, allocated once and reused by successive runs."""

import math

import numpy as np

from ..errors import Status
from ..jit.kernels import resident
from ..rows.interface import reset_selection
from ..workspaces.run_state import enter_joints
from ..workspaces.workspace import hold
from .arguments import step_count
from .run_log import no_log

UNLIMITED = 2**62  # steps wanted of an adaptive run


def words(record):
    """The numbers of a record as an array of words, which is cleared in less time."""
    return np.frombuffer(record, np.int64)


class Memory:
    """System, workspace and state of a run, and where kernels find them; one run at a time.

    A driver's own derives from it, sets `advance_kernel` and allocates the parts.

    Parameters
    ----------
    prepared : Prepared
    graph : ConstraintGraph
        Of the scene, as the form needs it.
    context : Context or SeriesContext
    run : Run
    """

    reason = ""  # of the end of a run: told by its status
    advance_kernel = None  # the compiled driver: (context, run, log, most) -> Status

    def __init__(self, prepared, graph, context, run):
        self.packed, self.weight, self.graph, self.run = prepared.packed, prepared.n, graph, run
        self.work = work = context.work
        self.settle(context)
        self._run, *self._keep_run = resident(run)
        records = work.control, work.counters, run.clock, run.numbers, run.kernels
        self._written = [work.q.base, *map(words, records)]  # what the next run must not find

    def settle(self, context, header=()):
        """Let the kernels find this context, behind the integers of a header."""
        self.context = context
        self._context, *self._keep = resident(context, header)

    @property
    def where(self):
        """Addresses of the context and of the run."""
        return self._context, self._run

    def clear(self, task, system):
        """As if it were new, for this task and a source of its system: what a run before has left behind is gone."""
        own, work, run = self.context.system, self.work, self.run
        for array in self._written:
            array.fill(0)
        reset_selection(self.graph, self.context.tangent)
        own.reals[...] = system.reals  # motions, signals and what forces remember are written there
        enter_joints(run, task.prepared.handles, task.remembered)
        if own.memory.size:
            own.reals[own.memory] = task.remembered[len(run.joints) :]
        work.q[...], work.qd[...] = task.q, task.qd
        run.now[0], run.now[1] = task.q, task.qd
        hold(work.control, task.constraint_tol, task.prepared.packed.size, task.form.basis_free)

    def set_out(self, task, dense, may_pass):
        """The interval, the method's steps and tolerances, and what the run is to do."""
        method, clock, numbers = task.method, self.run.clock, self.run.numbers
        clock.t = clock.t_origin = task.span[0]
        clock.t_end = task.span[1]
        if method.step is None:
            numbers.adaptive, numbers.steps_wanted = 1, UNLIMITED
            clock.rtol, clock.atol = method.step_tolerances()
            clock.max_step = method.max_step or math.inf
            clock.h = min(method.first_step or 0.0, clock.max_step)  # 0: of the driver's own choice
        else:
            clock.h, numbers.steps_wanted = method.step, step_count(*task.span, method.step)
        numbers.dense, numbers.may_pass, numbers.chart_interval = dense, may_pass, task.interval
        numbers.leave_when_stiff = task.choose is not None

    def saved(self):
        """What is to be saved of it beside its arrays: nothing."""
        return {}

    def restore(self, numbers):
        """As it was when it was saved."""

    def load(self):
        """Load the driver, where this process has not called it yet."""
        if not getattr(self.advance_kernel, "overloads", True):
            self.advance_kernel(*self.where, no_log(), 0)

    def advance(self, log, most):
        """Make up to `most` steps; the Status, as of the driver."""
        return Status(self.advance_kernel(self._context, self._run, log, most))
