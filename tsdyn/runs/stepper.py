"""The step driver: steps, outputs, charts. One kernel serves every scene, method and formulation by address.

A step is proposed (where it ends), attempted (x and y at its end, from the method), and rejected or accepted.
"""

import math

from ..errors import Status
from ..formulations.chart_validity import AT_START, BY_FAILURE, BY_INTERVAL
from ..formulations.tolerances import CONTRACTION_LOST
from ..jit.kernels import caller, entry, kernel
from ..maths.dense_linalg import copy
from ..methods.diagonally_implicit import KNOWN, T_BEFORE
from ..methods.explicit import call_step
from ..model.equations import is_rheonomic, remember, set_time
from ..model.joint_turns import count_turns
from ..rows.interface import is_singular_within_a_step
from ..workspaces.workspace import load
from .breakpoints import SHORT, amend, cut_fixed, is_sampled, next_stop, take_pieces
from .chart_changes import begin_chart, has_hardly_turned
from .outputs import record, restore_now, store_now
from .rotation_limit import GAIN, longest_step, too_far
from .run_state import (
    ADAPTIVE,
    AGAIN,
    BEGUN,
    CHART_ROWS,
    CUTS,
    ERROR_BEFORE,
    FAILED,
    FIRST_ORDER,
    HISTORY,
    IN_CHART,
    INTERVAL,
    LAST_STAGE,
    LEAVE_WHEN_STIFF,
    MAX_STEP,
    MAY_PASS,
    NEXT_EVAL,
    REJECTED,
    REJECTED_LAST,
    SHARE,
    STAGE_AT,
    STEPS,
    STEPS_WANTED,
    T_END,
    T_ORIGIN,
    WAITING,
    H,
    T,
    load_run,
    no_record,
)
from .step_control import accept, first_step, gets_on, stretch, watch_stiffness
from .step_outputs import record_step
from .trajectory import A_ACCELERATE, A_CHECK, A_COMPLETE, A_PLACE, A_STEP, bring_back, call_complete, evaluate, keep

STEP_COLLAPSED, STAGE_FAILED = int(Status.STEP_COLLAPSED), int(Status.STAGE_FAILED)
SLICE_DONE, CHART_LOST, NOT_FINITE = int(Status.SLICE_DONE), int(Status.CHART_LOST), int(Status.NOT_FINITE)
JAMMED, PASSAGE = int(Status.JAMMED), int(Status.PASSAGE)
OFF_CHART = CHART_LOST, int(Status.NEWTON_FAILED), int(Status.SINGULAR)  # what a chart that reaches nowhere ends in

call_check = caller("p")


@kernel
def _add(x, low, dx):
    """x += dx with compensated summation (Kahan); low holds what has been lost."""
    for i in range(x.size):
        y = dx[i] - low[i]
        s = x[i] + y
        low[i] = (s - x[i]) - y
        x[i] = s


@kernel
def _begin(context, c, r, log, at):
    """The first chart, the accelerations there, and the first output. Status."""
    w, status = c.work, begin_chart(context, c, r, log, at, AT_START)
    if status == 0:
        status = evaluate(context, w, at, r.clock[T], r.x, r.y, r.yd, r.xd)
    if status == 0:
        store_now(w, r)
        count_turns(r, w.q, w.qd, 0.0)
        call_check(at[A_CHECK], context)
        wanted = log.t_eval.size == 0
        if not wanted and log.t_eval[0] == r.clock[T]:
            wanted = True
            r.numbers[NEXT_EVAL] = 1
        if wanted:
            record(r, log, r.clock[T], w.q, w.qd, w.qdd)
    return status


@kernel
def _cross_stop(context, c, r, log, at, implicit):
    """At a stop: the accelerations after it, for its output and the next step. Status.

    Of an implicit method those of its last stage change by what f changes by: f itself would amplify what its
    iteration has left.
    """
    w, status = c.work, 0
    if implicit:
        status = evaluate(context, w, at, r.clock[T], r.x, r.y, r.dy, r.dx)
    take_pieces(c.system, r, log)
    if status == 0 and implicit:
        status = evaluate(context, w, at, r.clock[T], r.x, r.y, r.yds, r.dx)
        for j in range(r.y.size):
            r.yd[j] += r.yds[j] - r.dy[j]
        call_complete(at[A_COMPLETE], context, r.yd)
    elif status == 0:
        status = evaluate(context, w, at, r.clock[T], r.x, r.y, r.yd, r.xd)
    for j in range(w.qdd.size):  # what is extrapolated from the step before has no jump
        r.before[2, j] += w.qdd[j] - r.now[2, j]
    store_now(w, r)
    amend(r, log, w.q, w.qd, w.qdd)
    return status


@kernel
def _go_back(r):
    """Everything as at the start of the step."""
    copy(r.x_old, r.x)
    copy(r.y_old, r.y)
    copy(r.yd_old, r.yd)
    copy(r.xd_old, r.xd)
    copy(r.x_low_old, r.x_low)
    copy(r.y_low_old, r.y_low)


@kernel
def _propose(c, r, stop, driven):
    """Where the next step ends: a Status, its end t1, whether it is the last one, whether a stop cuts a fixed one."""
    t0, end = r.clock[T], min(stop, r.clock[T_END])
    if r.numbers[ADAPTIVE] == 1:
        if driven:
            r.clock[H] = min(r.clock[H], r.clock[SHARE] * longest_step(c.system.bodies, r.now))
        t1 = t0 + r.clock[H]
        if not gets_on(r, t0, t1):
            failed = r.numbers[FAILED]
            if failed in OFF_CHART and r.numbers[MAY_PASS] == 1:
                return PASSAGE, t1, False, False
            return failed if failed in (NOT_FINITE, JAMMED) else STEP_COLLAPSED, t1, False, False
        if t1 + stretch(r.clock[H], r.clock[MAX_STEP]) >= end:
            t1 = end
        return 0, t1, t1 == r.clock[T_END], False
    cut, done = False, r.numbers[STEPS] - r.numbers[CUTS]
    last = done + 1 == r.numbers[STEPS_WANTED]
    t1 = r.clock[T_END] if last else r.clock[T_ORIGIN] + (done + 1) * r.clock[H]
    if stop < math.inf:
        t1, cut = cut_fixed(stop, t1, r.clock[H], last)
        last = last and not cut
    return 0, t1, last, cut


@kernel
def _attempt(context, w, r, at, t0, t1, adaptive, implicit):
    """x, y and the accelerations at t1; what the start of the step had is kept. Status."""
    copy(r.x, r.x_old)
    copy(r.y, r.y_old)
    copy(r.yd, r.yd_old)
    if implicit:
        keep(w, r.warm)  # a stage that fails may leave u far away
    if adaptive:
        copy(r.xd, r.xd_old)
        copy(r.x_low, r.x_low_old)
        copy(r.y_low, r.y_low_old)
    ny = r.y.size
    status = call_step(
        at[A_STEP], context, at[A_PLACE], at[A_ACCELERATE], t0, t1 - t0, r.x.size, ny,
        r.x, r.y, r.yd, r.xd, r.tableau, r.memory, r.dx, r.dy,
    )  # fmt: skip
    if status == 0:
        _add(r.x, r.x_low, r.dx)
        _add(r.y, r.y_low, r.dy)
        status = evaluate(context, w, at, t1, r.x, r.y, r.yd, r.xd)
        if implicit:  # the last stage's own accelerations: f would amplify what its iteration has left
            copy(r.memory[r.numbers[STAGE_AT] :][:ny], r.yd)
            call_complete(at[A_COMPLETE], context, r.yd)
    return status


@kernel
def _halve(c, r, h, status):
    """Reject a step with a stage that was not solved: the next one is half as long."""
    r.numbers[FAILED] = status
    bring_back(c.work, r.warm)
    restore_now(c.work, r)
    r.numbers[REJECTED] += 1
    if r.numbers[REJECTED_LAST] == AGAIN:
        c.linear.numbers[KNOWN] = 0.0
    r.numbers[REJECTED_LAST] = AGAIN
    r.clock[H] = 0.5 * h


@kernel
def _change_chart(context, c, r, log, at, h, status, driven):
    """Reject a step that left the chart: back to its start, on a new chart if this one has been used. Status."""
    restore_now(c.work, r)
    r.numbers[REJECTED] += 1
    if r.numbers[IN_CHART] == 0:
        if r.numbers[ADAPTIVE] == 0:
            near = is_singular_within_a_step(c.free) or (status in OFF_CHART and has_hardly_turned(c))
            return PASSAGE if near and r.numbers[MAY_PASS] == 1 else status
        r.numbers[FAILED] = status
        r.clock[H] = 0.25 * h
        if driven:  # nothing else keeps the next step from being as long
            r.clock[SHARE] *= 0.5
    return begin_chart(context, c, r, log, at, BY_FAILURE)


@kernel
def _move_on(c, r, t1, cut, implicit):
    """Accept the step: its end is where the run is now."""
    w, t0 = c.work, r.clock[T]
    if implicit or r.numbers[FIRST_ORDER] == 1:
        for j in range(3):
            copy(r.now[j], r.before[j])
        c.linear.numbers[T_BEFORE] = t0
    count_turns(r, w.q, w.qd, t1 - t0)
    store_now(w, r)
    remember(c.system, w.q, w.qd, t1, r.remembered[r.joints.shape[0] :])
    r.clock[T] = t1
    r.numbers[STEPS] += 1
    r.numbers[CUTS] += 1 if cut else 0
    r.numbers[IN_CHART] += 1


@kernel
def _enter(context, c, r, log, at):
    """Begin the run, with its first output and the first step's length. Status."""
    w = c.work
    take_pieces(c.system, r, log)
    set_time(c.system, r.clock[T])
    remember(c.system, w.q, w.qd, r.clock[T], r.remembered[r.joints.shape[0] :])
    status = _begin(context, c, r, log, at)
    if status != 0:
        return status
    r.numbers[BEGUN] = 1
    if r.numbers[ADAPTIVE] == 1 and r.clock[H] == 0.0:
        r.clock[H] = min(first_step(context, w, r, at), r.clock[MAX_STEP])
    return 0


@entry("pp", no_record(), "wi")
def advance(context, run, log, at, most):
    """Make up to `most` steps. Status: SUCCESS at the end of the interval, SLICE_DONE, or the reason to stop.

    context and run are the addresses of a `Context` and a `Run`, log is a `Record`. The first call, but one with
    most = 0, begins the run; with most = -1 it does no more.
    """
    c, r = load(context), load_run(run)
    w = c.work
    adaptive, implicit = r.numbers[ADAPTIVE] == 1, r.numbers[STAGE_AT] > 0
    driven = is_rheonomic(c.system)
    if r.numbers[BEGUN] == 0 and most != 0:
        status = _enter(context, c, r, log, at)
        if status != 0:
            return status
    if r.numbers[WAITING] == 1:
        r.numbers[WAITING] = 0
        status = _cross_stop(context, c, r, log, at, False)  # what f was before is known no more
        if status != 0:
            return status
    for _ in range(most):
        if r.numbers[CHART_ROWS] + 2 >= log.charts.shape[0] or r.numbers[HISTORY] >= log.history.shape[0]:
            break
        t0 = r.clock[T]
        if t0 >= r.clock[T_END]:
            return 0
        stop, wanted, before = next_stop(r, log), r.clock[H], r.clock[ERROR_BEFORE]
        status, t1, last, cut = _propose(c, r, stop, driven)
        if status != 0:
            return status
        h = t1 - t0
        row = log.history[r.numbers[HISTORY]]
        row[0], row[1], row[2] = t0, h, 0.0
        r.numbers[HISTORY] += 1
        status = _attempt(context, w, r, at, t0, t1, adaptive, implicit)
        if adaptive and status == STAGE_FAILED:
            _halve(c, r, h, status)
            continue
        reason = 0
        if status == 0:
            reason = call_check(at[A_CHECK], context)
            if not w.control.contraction < CONTRACTION_LOST or (driven and too_far(c.system.bodies, r.now, w.qd, h)):
                status = CHART_LOST
        if status != 0:
            status = _change_chart(context, c, r, log, at, h, status, driven)
            if status != 0:
                return status
            continue
        if adaptive and not accept(context, c.linear, r, at, h):
            r.numbers[REJECTED] += 1
            _go_back(r)
            continue
        row[2] = 1.0
        if adaptive and t1 == stop and h < SHORT * wanted:
            r.clock[H], r.clock[ERROR_BEFORE] = max(r.clock[H], wanted), before
        r.numbers[FAILED] = 0
        r.clock[SHARE] = min(GAIN * r.clock[SHARE], 1.0)
        leave = r.numbers[LAST_STAGE] > 0 and watch_stiffness(r, h) and r.numbers[LEAVE_WHEN_STIFF] == 1
        _move_on(c, r, t1, cut, implicit)
        if reason == 0 and r.numbers[INTERVAL] > 0 and r.numbers[IN_CHART] >= r.numbers[INTERVAL]:
            reason = BY_INTERVAL
        status = record_step(context, w, r, log, at, t0, h, t1)
        if status != 0:
            return status
        if reason != 0 and not last:
            restore_now(w, r)
            status = begin_chart(context, c, r, log, at, reason)
            if status != 0:
                return status
        if t1 == stop:
            if is_sampled(r, log, t1):
                break
            status = _cross_stop(context, c, r, log, at, implicit)
            if status != 0:
                return status
        if leave:
            break
    return 0 if r.clock[T] >= r.clock[T_END] and r.numbers[WAITING] == 0 else SLICE_DONE
