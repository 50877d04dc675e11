"""Run workspace of a driver, allocated once and reused by successive runs; Ctrl-C within a step."""

import math
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..jit.interrupts import interruptible
from ..jit.kernels import callback, caller, entry, kernel, loader, resident, seen
from ..maths.dense_linalg import copy
from ..methods.explicit import ACCELERATE, PLACE
from ..model.laws import calls_laws, interrupts_answered
from ..rows.interface import reset_selection, selection_parts, set_selection
from ..workspaces import B_END, FILLED, STORED, LevelControl, divided, enter_joints, load_run, set_tolerances, words
from .run_log import close_chart, no_log
from .task import step_count
from .tolerances import LONG_STEPS, PIECE

# Ctrl-C within a step of a large scene.
#
# A driver calls the parts of a step by addresses in records of its run. Ctrl-C replaces these by kernels that do
# nothing and return a Status with which the driver ends at once. The run is then put back to the end of its last slice,
# which is the last step where steps are long. No kernel polls, so none of this costs anything in smaller scenes.

INTERRUPTED, PASSAGE = int(Status.INTERRUPTED), int(Status.PASSAGE)


@callback(PLACE)
def place_interrupted(context, t, x):
    """Stand-in of `place` and `linearise`."""
    return INTERRUPTED


@callback(ACCELERATE)
def accelerate(context, t, y, yd, xd):
    """In place of `accelerate`."""
    return INTERRUPTED


@callback("pdpppp")
def start_chart(context, t, x, y, yd, xd):
    """In place of `start_chart`."""
    return INTERRUPTED


@callback("pddppp")
def residual(context, t, g, x, y, k):
    """In place of `residual`, with which a stage begins and goes on."""
    return INTERRUPTED


@callback("pd")
def factorise(context, g):
    """In place of `reduce` and `factorise` of implicit methods."""
    return INTERRUPTED


@callback("pdpi")
def factorise_stages(context, h, tableau, i):
    """In place of `factorise_stages`."""
    return INTERRUPTED


@callback("pi")
def expand(context, k):
    """In place of `expand`."""
    return INTERRUPTED


@callback("pdd")
def reach(context, t, h):
    """In place of `reach`, `accelerate_here` and `pass_singular`: any other Status would let shorter steps be tried."""
    return PASSAGE


STAND_INS = {
    "place": place_interrupted, "accelerate": accelerate, "start_chart": start_chart, "reach": reach,
    "stage_place": place_interrupted, "stage_accelerate": accelerate, "accelerate_here": reach, "pass_singular": reach,
    "expand": expand, "linearise": place_interrupted, "reduce": factorise, "factorise": factorise, "residual": residual,
    "factorise_stages": factorise_stages,
}  # fmt: skip


def call(kernel, arguments, called):
    """Return kernel(*arguments); Ctrl-C ends it between two calls by the addresses in the records `called`."""
    # Addresses that the driver calls, and their stand-ins
    places = [(record, name) for record in called for name in STAND_INS if getattr(record, name, 0)]
    addresses = [getattr(*place) for place in places]
    stand_ins = [STAND_INS[name].address for _, name in places]
    try:
        return interruptible(partial(kernel, *arguments), partial(_enter, places, stand_ins))
    except BaseException:
        _enter(places, addresses)
        raise


def _enter(places, addresses):
    """Write addresses into their records."""
    for (record, name), address in zip(places, addresses, strict=True):
        setattr(record, name, address)


def advance(kernel, arguments, run, called):
    """`call` for some steps of a run: interrupted ones leave the run where it was before them."""
    # State at the end of the last slice
    parts = run.now, run.remembered, words(run.clock), words(run.numbers)
    before = [part.copy() for part in parts]
    try:
        return call(kernel, arguments, called)
    except BaseException:
        for part, kept in zip(parts, before, strict=True):
            part[...] = kept
        raise


call_driver = caller("pppi")


@entry("ipp", no_log(), "i")
def advance_run(driver, context, run, log, most):
    """Call the driver at this address: `stepper.advance`, or that of series."""
    return call_driver(driver, context, run, seen(log), most)


class Restart(NamedTuple):
    """Where a run begins again: parts of its context."""

    control: LevelControl
    q: np.ndarray  # (n,)
    qd: np.ndarray
    reals: np.ndarray  # of the system, and which of them forces remember
    memory: np.ndarray


load_restart = loader(Restart(LevelControl(), *np.zeros((3, 0)), np.zeros(0, int)))


@kernel
def go_back(s, r, log):
    """Let a run begin again where it is, from the positions and velocities of `run.now`: before its first step."""
    numbers, t = r.numbers, r.clock.t
    # Outputs and stops from here on are still to come
    while numbers.rows > 0 and log.t_eval.size > 0 and log.out[numbers.rows - 1, 0] >= t:
        numbers.rows -= 1
    while numbers.next_eval > 0 and log.t_eval[numbers.next_eval - 1] >= t:
        numbers.next_eval -= 1
    while numbers.next_stop > 0 and log.stops[numbers.next_stop - 1, 0] > t:
        numbers.next_stop -= 1
    while numbers.next_stop < log.stops.shape[0] and log.stops[numbers.next_stop, 0] <= t:
        numbers.next_stop += 1
    if numbers.in_chart > 0:
        close_chart(r, log, s.control.condition, s.control.contraction)
    copy(r.now[0], s.q)
    copy(r.now[1], s.qd)
    for j in range(s.memory.size):
        s.reals[s.memory[j]] = r.remembered[r.joints.shape[0] + j]
    numbers.begun = 0


@kernel
def is_at_stop(r, log):
    """Whether the last step has ended at a stop, where loads may jump."""
    i = r.numbers.next_stop
    return (i < log.stops.shape[0] and log.stops[i, 0] == r.clock.t) or (i > 0 and log.stops[i - 1, 0] == r.clock.t)


@kernel
def end_step(r, log, t, start, state):
    """Let a run end at t, within the step that began at `start`, with a state (3, n) and what it remembers."""
    numbers, n = r.numbers, r.now.shape[1]
    r.clock.t = t
    for j in range(3):
        copy(state[j], r.now[j])
    if log.t_eval.size > 0:
        while numbers.rows > 0 and log.out[numbers.rows - 1, 0] > t:
            numbers.rows -= 1
    elif t > start:
        row = log.out[numbers.rows - 1]
        row[0] = t
        for j in range(3):
            copy(state[j], row[1 + j * n : 1 + (j + 1) * n])
        copy(r.remembered, row[1 + 3 * n :])
    else:
        numbers.rows -= 1
    if numbers.dense == STORED:
        log.blocks[numbers.blocks - 1, B_END] = t


@entry("pddm", no_log())
def end_run(run, t, start, state, log):
    """As `end_step`."""
    end_step(load_run(run), log, t, start, state)


@entry("pp", no_log())
def begin_again(restart, run, log):
    """As `go_back`."""
    go_back(load_restart(restart), load_run(run), log)
    return 0


UNLIMITED = 2**62  # steps wanted of an adaptive run
STATUSES = {int(status): status for status in Status}


class Layout(NamedTuple):
    """What the records of a run don't say, of a memory as it is laid out."""

    n: int
    remembered: int  # angles and slots
    skipped: tuple  # work that an evaluation leaves out: gyroscopic terms, rotations, constant columns
    has_forces: bool


class Memory:
    """System, workspace and state of a run, and where kernels find them; one run at a time.

    A driver's own derives from it, sets `driver` and allocates the parts.

    Parameters
    ----------
    prepared : Prepared
    graph : ConstraintGraph
        Of the scene, as the form needs it.
    context : Context or SeriesContext
    run : RunState
    """

    reason = ""  # of the end of a run, beyond its status
    engine = None  # that it is laid out for
    arrays = None  # of a first slice: `driver.SliceArrays`
    layout = None  # a `Layout`
    driver = None  # the compiled driver, a `Callback`
    advance_kernel = staticmethod(advance_run)  # which calls it

    def __init__(self, prepared, graph, context, run):
        self.packed, self.weight, self.graph, self.run = prepared.packed, prepared.n, graph, run
        self.work = context.work
        self.bind(context)
        self.calls_laws = calls_laws(prepared.packed)
        self._run, *self._keep_run = resident(run)
        work, tables = context.work, (run.now, run.before, run.remembered, run.frames, run.tableau)
        self.state, rest = divided(work.q.base, work.control, work.counters, work.q, work.qd, work.qdd)
        self.run_state, self._run_scratch = divided(run.now.base, run.clock, run.numbers, run.kernels, *tables)
        self._laid_out = [self.run_state, self.state]  # what a run finds as it was laid out,
        self._scratch = [rest] if rest.size else []  # and what it finds zero
        arrays, records = selection_parts(context.tangent)
        self._selected = [*arrays, *map(words, records)]
        self._asked, self._start, self._images = None, None, []  # what it is laid out for, and how it is then

    def bind(self, context, header=()):
        """Let the kernels find this context, behind the integers of a header."""
        self.context = context
        self._context, *self._keep = resident(context, header)

    @property
    def where(self):
        """Addresses of the context and of the run."""
        return self._context, self._run

    def enter(self, engine, task, may_pass):
        """As if it were new, for an engine and a task: what a run before has left behind is gone.

        It is laid out for an engine and options, and an image of that is copied for further runs of the same.
        """
        asked = (
            task.constraint_tol, task.dense_output, task.events is None, task.interval, task.choose is None, may_pass,
        )  # fmt: skip
        if self._scratch:
            self._clear_scratch()
        if self.engine is not engine or self._asked != asked:
            self._lay_out(engine, task, may_pass)
            self._images = [(array, array.copy()) for array in [*self._laid_out, *self._selected] if array.size]
            self._asked, self._start = asked, (task.q, task.qd)
        else:
            for array, image in self._images:
                array[...] = image
            if task.q is not self._start[0] or task.qd is not self._start[1]:
                self._enter_start(task)
        if task.prepared.off is not None:
            set_selection(self.context.tangent, np.flatnonzero(np.isin(self.graph.row, task.prepared.off)))
        self.context.system.reals[...] = self.reals  # motions, signals and what forces remember are written there
        if task.remembered.size:
            # Angles of joints, and what forces remember
            own, run = self.context.system, self.run
            enter_joints(run, task.prepared.handles, task.remembered)
            if own.memory.size:
                own.reals[own.memory] = task.remembered[len(run.joints) :]
        # The interval, s, and how many fixed steps it takes
        clock, step = self.run.clock, task.method.step
        clock.t = clock.t_origin = task.span[0]
        clock.t_end = task.span[1]
        if step is not None:
            self.run.numbers.steps_wanted = step_count(*task.span, step)

    def entered(self):
        """The arrays that `enter` sets."""
        return [*self._scratch, *self._laid_out, self.context.system.reals, *self._selected]

    def _clear_scratch(self):
        for array in self._scratch:
            if array.size < PIECE:
                array.fill(0)
            else:
                _clear(array)

    def _lay_out(self, engine, task, may_pass):
        """Enter what engine and task say, and load the driver where this process has not called it yet."""
        self.engine = None
        for array in self._laid_out:
            array.fill(0)
        method, clock, numbers = engine.method, self.run.clock, self.run.numbers
        # Steps and tolerances
        if method.step is None:
            numbers.adaptive, numbers.steps_wanted = 1, UNLIMITED
            clock.rtol, clock.atol = method.step_tolerances()
            clock.max_step = method.max_step or math.inf
            clock.h = min(method.first_step or 0.0, clock.max_step)  # 0: of the driver's own choice
        else:
            clock.h = method.step
        engine.lay_out(self, task.interval)
        engine.layouts += 1
        self.engine = engine
        self.layout = Layout(self.run.now.shape[1], self.run.remembered.size, engine.skipped, bool(self.packed.loads))
        self._enter_start(task)
        reset_selection(self.graph, self.context.tangent)
        numbers.dense = STORED if task.dense_output else FILLED if task.events is not None else 0
        numbers.may_pass, numbers.leave_when_stiff = may_pass, task.choose is not None
        self.load()

    def _enter_start(self, task):
        """Positions and velocities, and how closely the constraints are held."""
        work, run = self.work, self.run
        work.q[...], work.qd[...] = task.q, task.qd
        run.now[0], run.now[1] = task.q, task.qd
        set_tolerances(work.control, task.constraint_tol, task.prepared.packed.size, self.engine.form.basis_free)

    @property
    def begins_again(self):
        """Whether a run can begin again where it is: steps on no grid, and that know nothing of those before."""
        return self.run.numbers.adaptive == 1 and self.run.numbers.stage_at == 0

    def begin_again(self, log):
        """Begin again where the run is, from the positions and velocities of `run.now`; the Status."""
        begin_again(self.restart[0], self._run, log)
        return self.advance(log, -1)

    @cached_property
    def restart(self):
        """The address of its `Restart`, and what keeps that."""
        work, system = self.work, self.context.system
        return resident(Restart(work.control, work.q, work.qd, system.reals, system.memory))

    def saved(self):
        """What is to be saved of it beside its arrays: nothing."""
        return {}

    def restore(self, numbers):
        """As it was when it was saved."""

    def load(self):
        """Load the driver, where this process has not called it yet."""
        if not getattr(self.advance_kernel, "overloads", True):
            self._call(self.driver.address, *self.where, no_log(), 0)
        self._driver = self.driver.address

    def advance(self, log, most):
        """Make up to `most` steps; the Status, as of the driver."""
        arguments = self._driver, self._context, self._run, log, most
        # Short steps: Ctrl-C waits for the end of a slice
        if self.weight < LONG_STEPS:
            return STATUSES[self._call(*arguments)]
        # Begin first, alone: Ctrl-C in the first step goes back to a run that has begun
        if not self.run.numbers.begun and most > 0:
            status = self.advance(log, -1)
            if not self.run.numbers.begun:
                return status
        return STATUSES[advance(self._call, arguments, self.run, self.called)]

    def _call(self, *arguments):
        kernel = self.advance_kernel
        return (interrupts_answered()(kernel) if self.calls_laws else kernel)(*arguments)

    @property
    def called(self):
        """The records of addresses that the driver calls."""
        return (self.run.kernels,)


def _clear(array):
    """Zero in pieces: between them Ctrl-C is answered. New memory takes a second for a gigabyte."""
    for first in range(0, array.size, PIECE):
        array[first : first + PIECE].fill(0)
