"""The driver: steps, outputs, charts. One kernel for every scene, method and formulation; it calls them by address."""

import math

from ._kernel import caller, entry, kernel
from .assembly import is_rheonomic, remember, set_time
from .control import accept, first_step, stretch, watch_stiffness
from .dense import (
    A_ACCELERATE,
    A_CHART,
    A_CHECK,
    A_COMPLETE,
    A_FILL,
    A_PLACE,
    A_STEP,
    B_CHART,
    B_DATA,
    B_END,
    B_H,
    B_START,
    between,
    bring_back,
    call_chart,
    call_complete,
    evaluate,
    keep,
)
from .displacement import turned_most
from .errors import Status
from .implicit import KNOWN, T_BEFORE
from .interpolation import call_fill
from .joint_turns import count_turns
from .linalg import copy
from .local_chart import AT_START, BY_FAILURE, BY_INTERVAL, CONTRACTION_LOST
from .nearness import NEXT_TO, WITHIN_A_STEP, is_below, note_share
from .outputs import record, restore_now, store_now
from .run_state import (
    ADAPTIVE,
    AGAIN,
    BEGUN,
    BLOCKS,
    CHART_ROWS,
    CUTS,
    DENSE,
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
    STORED,
    T_END,
    T_ORIGIN,
    WAITING,
    H,
    T,
    load_run,
    no_record,
)
from .stepping import call_step
from .stops import SHORT, amend, cut_fixed, is_sampled, next_stop, take_pieces
from .turning import GAIN, longest_step, too_far
from .workspace import CONDITION, CONTRACTION, load

STEP_COLLAPSED, STAGE_FAILED = int(Status.STEP_COLLAPSED), int(Status.STAGE_FAILED)
SLICE_DONE, CHART_LOST, NOT_FINITE = int(Status.SLICE_DONE), int(Status.CHART_LOST), int(Status.NOT_FINITE)
JAMMED, PASSAGE = int(Status.JAMMED), int(Status.PASSAGE)
OFF_CHART = CHART_LOST, int(Status.NEWTON_FAILED), int(Status.SINGULAR)  # what a chart that reaches nowhere ends in
LITTLE = 0.1  # |d|: a step that turns bodies by less is no long one, and a chart that it loses a small one

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
def _begin_chart(context, c, r, log, at, reason):
    """A new chart at the present q, qd, qdd; closes the record of the old one. PASSAGE next to a singular place."""
    w, i = c.work, r.numbers[CHART_ROWS]
    if reason != AT_START:
        log.charts[i, 2], log.charts[i, 3], log.charts[i, 4] = (
            w.control[CONDITION],
            w.control[CONTRACTION],
            r.numbers[IN_CHART],
        )
        i += 1
        r.numbers[CHART_ROWS] = i
    log.charts[i, 0], log.charts[i, 1] = r.clock[T], reason
    r.numbers[IN_CHART] = 0
    for j in range(r.x.size):
        r.x_low[j] = 0.0
    for j in range(r.y.size):
        r.y_low[j] = 0.0
    if log.points.shape[0] > 0:
        copy(w.q, log.points[i])
    status = call_chart(at[A_CHART], context, r.clock[T], r.x, r.y, r.yd, r.xd)
    if r.numbers[MAY_PASS] == 1:
        note_share(c.network, c.free, c.local.S0)
        if status == 0 and reason != AT_START and is_below(c.free, NEXT_TO):
            return PASSAGE
    return status


@kernel
def _wanted_within(r, log, t1):
    """Whether the step's inside is asked for."""
    i = r.numbers[NEXT_EVAL]
    return r.numbers[DENSE] != 0 or (i < log.t_eval.size and log.t_eval[i] < t1)


@kernel
def _fill(context, w, r, log, at, t0, h, t1):
    """The block of the step just made. Status."""
    r.block[B_START], r.block[B_H], r.block[B_END], r.block[B_CHART] = t0, h, t1, r.numbers[CHART_ROWS]
    status = call_fill(
        at[A_FILL], context, at[A_PLACE], at[A_ACCELERATE], r.numbers[FIRST_ORDER], t0, h, w.q.size, r.x.size, r.y.size,
        r.x_old, r.y_old, r.yd_old, r.x, r.y, r.yd, r.xd, r.before, r.now, r.tableau, r.memory, r.block[B_DATA:],
    )  # fmt: skip
    copy(r.remembered, r.block[r.block.size - r.remembered.size :])
    if status == 0 and r.numbers[DENSE] == STORED:
        copy(r.block, log.blocks[r.numbers[BLOCKS]])
        r.numbers[BLOCKS] += 1
    return status


@kernel
def _outputs(context, w, r, log, at, t0, h, t1):
    """Record what t_eval asks for in (t0, t1], or the step's end where it asks for nothing. Status."""
    if log.t_eval.size == 0:
        record(r, log, t1, w.q, w.qd, w.qdd)
    within = _wanted_within(r, log, t1)
    if within:
        keep(w, r.warm)
        status = _fill(context, w, r, log, at, t0, h, t1)
        if status != 0:
            return status
    while r.numbers[NEXT_EVAL] < log.t_eval.size and log.t_eval[r.numbers[NEXT_EVAL]] <= t1:
        t = log.t_eval[r.numbers[NEXT_EVAL]]
        r.numbers[NEXT_EVAL] += 1
        if t == t1:
            record(r, log, t1, r.now[0], r.now[1], r.now[2])
            continue
        status = between(context, w, at, t, r.block, r.xs, r.ys, r.yds, r.dx)  # xd is the next step's
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
    if within:
        bring_back(w, r.warm)
        restore_now(w, r)
    return 0


@kernel
def _begin(context, c, r, log, at):
    """The first chart, the accelerations there, and the first output. Status."""
    w, status = c.work, _begin_chart(context, c, r, log, at, AT_START)
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
def _has_hardly_turned(c):
    """Whether bodies have turned on the present chart, but by little."""
    return 0.0 < turned_most(c.local) < LITTLE


@kernel
def _go_back(r):
    """Everything as at the start of the step."""
    copy(r.x_old, r.x)
    copy(r.y_old, r.y)
    copy(r.yd_old, r.yd)
    copy(r.xd_old, r.xd)
    copy(r.x_low_old, r.x_low)
    copy(r.y_low_old, r.y_low)


@entry("pp", no_record(), "wi")
def advance(context, run, log, at, most):
    """Make up to `most` steps. Status: SUCCESS at the end of the interval, SLICE_DONE, or why it stopped.

    context and run are the addresses of a `Context` and a `Run`, log is a `Record`. The first call, but one with
    most = 0, begins the run; with most = -1 it does no more.
    """
    c, r = load(context), load_run(run)
    w = c.work
    nx, ny = r.x.size, r.y.size
    adaptive, implicit = r.numbers[ADAPTIVE] == 1, r.numbers[STAGE_AT] > 0
    driven = is_rheonomic(c.system)
    if r.numbers[BEGUN] == 0 and most != 0:
        take_pieces(c.system, r, log)
        set_time(c.system, r.clock[T])
        remember(c.system, w.q, w.qd, r.clock[T], r.remembered[r.joints.shape[0] :])
        status = _begin(context, c, r, log, at)
        if status != 0:
            return status
        r.numbers[BEGUN] = 1
        if adaptive and r.clock[H] == 0.0:
            r.clock[H] = min(first_step(context, w, r, at), r.clock[MAX_STEP])
    if r.numbers[WAITING] == 1:
        r.numbers[WAITING] = 0
        status = _cross_stop(context, c, r, log, at, False)  # what f was before is known no more
        if status != 0:
            return status
    for _ in range(most):
        if r.numbers[CHART_ROWS] + 2 >= log.charts.shape[0] or r.numbers[HISTORY] >= log.history.shape[0]:
            break
        i, t0 = r.numbers[STEPS], r.clock[T]
        if t0 >= r.clock[T_END]:
            return 0
        stop, wanted, before, cut = next_stop(r, log), r.clock[H], r.clock[ERROR_BEFORE], False
        end = min(stop, r.clock[T_END])
        if adaptive:
            if driven:
                r.clock[H] = min(r.clock[H], r.clock[SHARE] * longest_step(c.system.bodies, r.now))
            t1 = t0 + r.clock[H]
            if not t1 > t0 + 4e-16 * max(abs(t0), 1e-3 * (r.clock[T_END] - r.clock[T_ORIGIN])):
                failed = r.numbers[FAILED]
                if failed in OFF_CHART and r.numbers[MAY_PASS] == 1:
                    return PASSAGE
                return failed if failed in (NOT_FINITE, JAMMED) else STEP_COLLAPSED
            if t1 + stretch(r.clock[H], r.clock[MAX_STEP]) >= end:
                t1 = end
            last = t1 == r.clock[T_END]
        else:
            done = i - r.numbers[CUTS]
            last = done + 1 == r.numbers[STEPS_WANTED]
            t1 = r.clock[T_END] if last else r.clock[T_ORIGIN] + (done + 1) * r.clock[H]
            if stop < math.inf:
                t1, cut = cut_fixed(stop, t1, r.clock[H], last)
                last = last and not cut
        h = t1 - t0
        row = log.history[r.numbers[HISTORY]]
        row[0], row[1], row[2] = t0, h, 0.0
        r.numbers[HISTORY] += 1
        copy(r.x, r.x_old)
        copy(r.y, r.y_old)
        copy(r.yd, r.yd_old)
        if implicit:
            keep(w, r.warm)  # a stage that fails may leave u far away
        if adaptive:
            copy(r.xd, r.xd_old)
            copy(r.x_low, r.x_low_old)
            copy(r.y_low, r.y_low_old)
        status = call_step(
            at[A_STEP], context, at[A_PLACE], at[A_ACCELERATE], t0, h, nx, ny,
            r.x, r.y, r.yd, r.xd, r.tableau, r.memory, r.dx, r.dy,
        )  # fmt: skip
        if status == 0:
            _add(r.x, r.x_low, r.dx)
            _add(r.y, r.y_low, r.dy)
            status = evaluate(context, w, at, t1, r.x, r.y, r.yd, r.xd)
            if implicit:  # the last stage's own accelerations: f would amplify what its iteration has left
                copy(r.memory[r.numbers[STAGE_AT] :][:ny], r.yd)
                call_complete(at[A_COMPLETE], context, r.yd)
        elif adaptive and status == STAGE_FAILED:
            r.numbers[FAILED] = status
            bring_back(w, r.warm)
            restore_now(w, r)
            r.numbers[REJECTED] += 1
            if r.numbers[REJECTED_LAST] == AGAIN:
                c.linear.numbers[KNOWN] = 0.0
            r.numbers[REJECTED_LAST] = AGAIN
            r.clock[H] = 0.5 * h
            continue
        reason = 0
        if status == 0:
            reason = call_check(at[A_CHECK], context)
            if not w.control[CONTRACTION] < CONTRACTION_LOST or (driven and too_far(c.system.bodies, r.now, w.qd, h)):
                status = CHART_LOST
        if status != 0:  # back to the start of the step, on a new chart if this one has been used
            restore_now(w, r)
            r.numbers[REJECTED] += 1
            if r.numbers[IN_CHART] == 0:
                if not adaptive:
                    near = is_below(c.free, WITHIN_A_STEP) or (status in OFF_CHART and _has_hardly_turned(c))
                    return PASSAGE if near and r.numbers[MAY_PASS] == 1 else status
                r.numbers[FAILED] = status
                r.clock[H] = 0.25 * h
                if driven:  # nothing else keeps the next step from being as long
                    r.clock[SHARE] *= 0.5
            retry = _begin_chart(context, c, r, log, at, BY_FAILURE)
            if retry != 0:
                return retry
            continue
        if adaptive and not accept(context, c.linear, r, at, h):
            r.numbers[REJECTED] += 1
            _go_back(r)
            continue
        if adaptive and t1 == stop and h < SHORT * wanted:
            r.clock[H], r.clock[ERROR_BEFORE] = max(r.clock[H], wanted), before
        row[2] = 1.0
        r.numbers[FAILED] = 0
        r.clock[SHARE] = min(GAIN * r.clock[SHARE], 1.0)
        leave = False
        if r.numbers[LAST_STAGE] > 0 and watch_stiffness(r, h):
            leave = r.numbers[LEAVE_WHEN_STIFF] == 1
        if implicit or r.numbers[FIRST_ORDER] == 1:
            for j in range(3):
                copy(r.now[j], r.before[j])
            c.linear.numbers[T_BEFORE] = t0
        count_turns(r, w.q, w.qd, h)
        store_now(w, r)
        remember(c.system, w.q, w.qd, t1, r.remembered[r.joints.shape[0] :])
        r.clock[T] = t1
        r.numbers[STEPS] = i + 1
        r.numbers[CUTS] += 1 if cut else 0
        r.numbers[IN_CHART] += 1
        if reason == 0 and r.numbers[INTERVAL] > 0 and r.numbers[IN_CHART] >= r.numbers[INTERVAL]:
            reason = BY_INTERVAL
        status = _outputs(context, w, r, log, at, t0, h, t1)
        if status != 0:
            return status
        if reason != 0 and not last:
            restore_now(w, r)
            status = _begin_chart(context, c, r, log, at, reason)
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
