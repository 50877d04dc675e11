"""Run workspace of a driver, allocated once and reused by successive runs."""

import math

import numpy as np

from ..errors import Status
from ..jit.kernels import resident
from ..rows.interface import reset_selection
from ..workspaces.run_state import enter_joints
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
    engine = None  # that it is laid out for
    advance_kernel = None  # the compiled driver: (context, run, log, most) -> Status

    def __init__(self, prepared, graph, context, run):
        self.packed, self.weight, self.graph, self.run = prepared.packed, prepared.n, graph, run
        self.work = work = context.work
        self.settle(context)
        self._run, *self._keep_run = resident(run)
        records = work.control, work.counters, run.clock, run.numbers, run.kernels
        self._scratch = [work.q.base]  # what a run must not find: zero at its start,
        self._laid_out, self._images = [*map(words, records)], []  # and what is so as the engine has laid it out

    def settle(self, context, header=()):
        """Let the kernels find this context, behind the integers of a header."""
        self.context = context
        self._context, *self._keep = resident(context, header)

    @property
    def where(self):
        """Addresses of the context and of the run."""
        return self._context, self._run

    def enter(self, engine, task, dense, may_pass):
        """As if it were new, for an engine and a task: what a run before has left behind is gone."""
        for array in self._scratch:
            array.fill(0)
        if self.engine is engine:
            for array, image in self._images:
                array[...] = image
        else:
            self._lay_out(engine)
        reset_selection(self.graph, self.context.tangent)
        self._enter_start(task, engine.form)
        self._set_out(task, dense, may_pass)

    def _lay_out(self, engine):
        """Enter what an engine says, and load the driver where this process has not called it yet."""
        self.engine = None
        for array in self._laid_out:
            array.fill(0)
        self._enter_method(engine.method)
        engine.lay_out(self)
        self.load()
        self._images = [(array, array.copy()) for array in self._laid_out]
        self.engine = engine

    def _enter_method(self, method):
        """Steps and tolerances."""
        clock, numbers = self.run.clock, self.run.numbers
        if method.step is None:
            numbers.adaptive, numbers.steps_wanted = 1, UNLIMITED
            clock.rtol, clock.atol = method.step_tolerances()
            clock.max_step = method.max_step or math.inf
            clock.h = min(method.first_step or 0.0, clock.max_step)  # 0: of the driver's own choice
        else:
            clock.h = method.step

    def _enter_start(self, task, form):
        """Positions, velocities, what is remembered, and how closely the constraints are held."""
        own, work, run = self.context.system, self.work, self.run
        own.reals[...] = self.reals  # motions, signals and what forces remember are written there
        enter_joints(run, task.prepared.handles, task.remembered)
        if own.memory.size:
            own.reals[own.memory] = task.remembered[len(run.joints) :]
        work.q[...], work.qd[...] = task.q, task.qd
        run.now[0], run.now[1] = task.q, task.qd
        control = work.control
        control.size = size = task.prepared.packed.size
        control.u_tol = control.b_tol = task.constraint_tol
        if form.basis_free and 0.0 < size < 1.0:  # a small scene is held as closely; no Phi is a normalisation's
            control.u_tol *= size

    def _set_out(self, task, dense, may_pass):
        """The interval, and what the run is to do."""
        method, clock, numbers = task.method, self.run.clock, self.run.numbers
        clock.t = clock.t_origin = task.span[0]
        clock.t_end = task.span[1]
        if method.step is not None:
            numbers.steps_wanted = step_count(*task.span, method.step)
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
