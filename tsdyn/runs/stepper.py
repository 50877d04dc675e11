"""The step driver: steps, stops, charts. One kernel serves every scene, method and formulation by address."""

import math

from ..errors import Status
from ..formulations.accelerations import body_of, unit_friction
from ..formulations.charts import AT_START, BY_FAILURE, BY_INTERVAL, turned_most
from ..formulations.tolerances import CONTRACTION_KEPT, CONTRACTION_LOST
from ..jit.kernels import callback, kernel, long_kernel, stack
from ..maths.dense_linalg import copy
from ..maths.tolerances import TINY
from ..methods.explicit import call_step
from ..model.equations import hold_pieces, is_rheonomic, remember, set_time
from ..model.joint_turns import count_turns
from ..motions.tolerances import TOGETHER
from ..rows.interface import (
    doubt_selection,
    is_next_to_singular,
    is_singular_within_a_step,
    note_indicator,
    note_selection,
)
from ..workspaces import AGAIN, load, load_run
from . import tolerances as limits
from .dense_output import (
    bring_back,
    call_chart,
    call_check,
    call_complete,
    evaluate,
    keep,
    note_normal,
    record,
    record_end,
    record_step,
    restore_now,
    store_now,
)
from .run_log import close_chart, is_full, load_log, note_accepted, note_try, open_chart
from .step_control import accept, call_watch, first_step, forget_scale, gets_on, stretch, watch_stiffness

# Rotation limit of a step in driven scenes.
#
# A prescribed coordinate is exact for any step length, so an error estimate never limits the step; and after a full
# turn a body is back in its orientation, so a chart doesn't either.


@kernel
def longest_step(bodies, now):
    """The step in which nothing turns by more than MOST_TURN; now (3, n) is q, qd, qdd."""
    longest = math.inf
    for b in range(bodies.shape[0]):
        if bodies[b, 1] == 7:
            # |pd| and |pdd| of the Euler parameters
            speed, gain = 0.0, 0.0
            for c in range(bodies[b, 0] + 3, bodies[b, 0] + 7):
                speed += now[1, c] * now[1, c]
                gain += now[2, c] * now[2, c]
            gain = 2.0 * math.sqrt(max(gain - speed * speed, 0.0))  # pdd is pd.pd along p, alpha / 2 across
            speed = 2.0 * math.sqrt(speed)
            # MOST_TURN = speed h + gain h^2 / 2, solved for h without cancellation
            fast = speed + math.sqrt(speed * speed + 2.0 * gain * limits.MOST_TURN)
            if fast > 0.0:
                longest = min(longest, 2.0 * limits.MOST_TURN / fast)
    return longest


@kernel
def too_far(bodies, now, qd, h):
    """Whether a body has turned by more than TOO_FAR, from its speeds at both ends."""
    for b in range(bodies.shape[0]):
        if bodies[b, 1] == 7:
            # Mean speed of both ends times h
            one, other = 0.0, 0.0
            for c in range(bodies[b, 0] + 3, bodies[b, 0] + 7):
                one += now[1, c] * now[1, c]
                other += qd[c] * qd[c]
            if (math.sqrt(one) + math.sqrt(other)) * h > limits.TURNED_TOO_FAR:
                return True
    return False


# Stops: times at which a step must end, such as knots of motions and loads and sampling times.
#
# A step that would pass a stop is shortened to end there. At the stop all piecewise functions switch to their next
# piece, and accelerations are re-evaluated for the output and for the next step. After a shortened step of fixed
# length, the next step ends on the original time grid. A short change of a function is a stop for steps that begin
# before it alone.


@kernel
def next_stop(r, log):
    """The next time at which a step has to end, but for the end of the run; inf where there is none."""
    i = r.numbers.next_stop
    # Stops behind, and changes of functions that begin before t
    while i < log.stops.shape[0] and (log.stops[i, 0] <= r.clock.t or log.stops[i, 2] < r.clock.t):
        i += 1
    r.numbers.next_stop = i
    return log.stops[i, 0] if i < log.stops.shape[0] else math.inf


@kernel
def fixed_end(r, stop):
    """The end of the next step of fixed length, whether it is the run's last, and whether a stop cuts it.

    t_k = t_origin + k h, but for steps that end at stops; a stop within SLIVER h, or rounding, of t_k stands for it.
    """
    # End k of the grid, counted without steps that stops have cut
    done, h = r.numbers.steps + 1 - r.numbers.cuts, r.clock.h
    last = done == r.numbers.steps_wanted
    t1 = r.clock.t_end if last else r.clock.t_origin + done * h
    # A stop within a sliver of the grid point replaces it
    near = max(limits.SLIVER * h, TOGETHER * abs(t1))
    if stop < t1 - near or (last and stop < t1):
        return stop, False, True
    return stop if stop < t1 + near and not last else t1, last, False


@kernel
def take_pieces(system, r, log):
    """Let piecewise motions and loads stay with their pieces up to the next stop."""
    # The piece is the one half way to the next stop
    end = min(next_stop(r, log), r.clock.t_end)
    hold_pieces(system, 0.5 * (r.clock.t + end))


@kernel
def is_sampled(r, log, t1):
    """Whether Python is asked at this stop, before the run goes on."""
    i = r.numbers.next_stop
    if i < log.stops.shape[0] and log.stops[i, 0] == t1 and log.stops[i, 1] != 0.0:
        r.numbers.waiting = 1
        return True
    return False


@kernel
def amend(r, log, q, qd, qdd):
    """The output at a stop, if there is one, with the accelerations after it."""
    i = r.numbers.rows - 1
    if i >= 0 and log.out[i, 0] == r.clock.t:
        r.numbers.rows = i
        record(r, log, r.clock.t, q, qd, qdd)


# New charts along a run, and what is recorded of the old ones.

PASSAGE = int(Status.PASSAGE)


@long_kernel
def begin_chart(context, c, r, log, reason):
    """New chart at the present q, qd, qdd; closes the record of the old one. PASSAGE near a singular configuration."""
    w = c.work
    # Record of the chart before
    if reason != AT_START:
        close_chart(r, log, w.control.condition, w.control.contraction)
    open_chart(r, log, r.clock.t, reason)
    # Chart coordinates begin at zero: nothing is left to compensate
    for j in range(r.x.size):
        r.x_low[j] = 0.0
    for j in range(r.y.size):
        r.y_low[j] = 0.0
    # Dense output rebuilds a chart from q0 and the selection of rows
    kept = log.points.shape[0] > 0
    if kept:
        copy(w.q, log.points[r.numbers.chart_rows])
    status = call_chart(r.kernels.start_chart, context, r.clock.t, r.x, r.y, r.yd, r.xd)
    if kept:
        note_selection(c.tangent, log.points[r.numbers.chart_rows, w.q.size :])
    note_normal(context, r, r.clock.t)
    # Distance to a singular configuration
    if r.numbers.first_order != 1:
        note_indicator(c.graph, c.tangent, c.chart.rows0)
        if r.numbers.may_pass == 1 and status == 0 and reason != AT_START and is_next_to_singular(c.tangent):
            return PASSAGE
    return status


@kernel
def has_hardly_turned(c):
    """Whether bodies have rotated on the present chart, by a small angle."""
    return 0.0 < turned_most(c.chart) < limits.HARDLY_TURNED


# Where friction of the regularised law brings a joint to rest: there its force changes at once, and an implicit step is
# to end just before.
#
# With Q the generalised forces of a friction for unit normal load, -Q . qd = mu |v|. From velocity and deceleration,
#
#     t_rest = |v| / -d|v|/dt
#
# Each step to LANDING of it leaves a tenth of the velocity, until friction at rest is resolved.


@kernel
def _friction_power(c, friction, r, scale, ahead):
    """-Q . qd of a friction at scale qd + ahead qdd."""
    graph, qd, Q, power = c.graph, c.work.qd, stack(14), 0.0
    # Power of friction for unit normal load at scaled velocities
    for i in range(qd.size):
        qd[i] = scale * r.now[1, i] + ahead * r.now[2, i]
    unit_friction(c.system, friction, r.now[0], qd, r.clock.t, Q)
    for k in range(2):
        # -Q.qd, body by body
        b = body_of(friction, k)
        if b < graph.bodies.shape[0]:
            at = graph.bodies[b, 0]
            for j in range(graph.bodies[b, 1]):
                power -= Q[7 * k + j] * qd[at + j]
    return power


@kernel
def until_rest(c, r, h):
    """The step h, or less of it: to just before the first joint comes to rest. Counts those at rest in r.numbers.still.

    c.work.qd is that of r.now after it.
    """
    if c.graph.frictions.shape[0] == 0:
        return h
    r.numbers.still = 0
    for i in range(c.graph.frictions.shape[0]):
        friction = c.graph.frictions[i]
        # mu |v| now
        now = _friction_power(c, friction, r, 1.0, 0.0)
        # The exact law doesn't change with the sign of v: an event is where it does
        if _friction_power(c, friction, r, -1.0, 0.0) < 0.0:
            continue
        # At rest, friction grows faster than in proportion to velocity
        if not _friction_power(c, friction, r, 2.0, 0.0) < limits.SLIDES * now:
            r.numbers.still += 1
        elif now < math.inf:
            # Deceleration by a small part of the step: rest is at h now / slowing parts from here
            slowing = now - _friction_power(c, friction, r, 1.0, limits.LITTLE * h)
            if slowing > limits.LITTLE * now:
                h = min(h, limits.LANDING * limits.LITTLE * h * now / slowing)
    copy(r.now[1], c.work.qd)
    return h


# The step driver: steps, outputs, charts. One kernel serves every scene, method and formulation by address.
#
# A step is proposed (where it ends), attempted (x and y at its end, from the method), and rejected or accepted.

STEP_COLLAPSED, STAGE_FAILED = int(Status.STEP_COLLAPSED), int(Status.STAGE_FAILED)
SLICE_DONE, CHART_LOST, NOT_FINITE = int(Status.SLICE_DONE), int(Status.CHART_LOST), int(Status.NOT_FINITE)
JAMMED, UNHELD = int(Status.JAMMED), int(Status.UNHELD)
OFF_CHART = CHART_LOST, int(Status.NEWTON_FAILED), int(Status.SINGULAR)  # what a chart that reaches nowhere ends in


@kernel
def _add(x, low, dx):
    """x += dx with compensated summation (Kahan); low holds what has been lost."""
    for i in range(x.size):
        # Kahan: add what was lost before, note what is lost now
        y = dx[i] - low[i]
        s = x[i] + y
        low[i] = (s - x[i]) - y
        x[i] = s


@kernel
def _enter(context, c, r, log):
    """Begin the run: the first chart, the accelerations there, the first output and the first step's length. Status."""
    w, t = c.work, r.clock.t
    # Pieces of functions, time, memories of forces
    take_pieces(c.system, r, log)
    set_time(c.system, t)
    remember(c.system, w.q, w.qd, t, r.remembered[r.joints.shape[0] :])
    forget_scale(r)
    r.clock.along = r.clock.square = 0.0
    # First chart and its accelerations
    status = begin_chart(context, c, r, log, AT_START)
    if status == 0:
        status = evaluate(context, w, r, t, r.x, r.y, r.yd, r.xd)
    if status != 0:
        return status
    store_now(w, r)
    count_turns(r, w.q, w.qd, 0.0)
    # Dropped rows must hold at the start
    status = -min(call_check(r.kernels.check, context), 0)
    if status != 0:
        return status
    record_end(w, r, log, t)
    r.numbers.begun = 1
    # A first step, unless one is given
    if r.numbers.adaptive == 1 and r.clock.h == 0.0:
        r.clock.h = min(first_step(context, w, r), r.clock.max_step)
    return 0


@long_kernel
def _cross_stop(context, c, r, log, implicit):
    """At a stop: the accelerations after it, for its output and the next step. Status.

    Of an implicit method those of its last stage change by what f changes by: f itself would amplify what its
    iteration has left.
    """
    w, status = c.work, 0
    forget_scale(r)
    # f before and after the switch, both at the same state
    if implicit:
        status = evaluate(context, w, r, r.clock.t, r.x, r.y, r.dy, r.dx)
    take_pieces(c.system, r, log)
    if status == 0 and implicit:
        status = evaluate(context, w, r, r.clock.t, r.x, r.y, r.yds, r.dx)
        for j in range(r.y.size):
            r.yd[j] += r.yds[j] - r.dy[j]
        call_complete(r.kernels.complete, context, r.yd)
    elif status == 0:
        status = evaluate(context, w, r, r.clock.t, r.x, r.y, r.yd, r.xd)
    for j in range(w.qdd.size):  # what is extrapolated from the step before has no jump
        r.before[2, j] += w.qdd[j] - r.now[2, j]
    store_now(w, r)
    amend(r, log, w.q, w.qd, w.qdd)
    return status


@kernel
def _propose(c, r, stop, driven, implicit):
    """Where the next step ends: a Status, its end t1, whether it is the last one, whether a stop cuts a fixed one."""
    # Fixed steps end on their grid
    if r.numbers.adaptive == 0:
        t1, last, cut = fixed_end(r, stop)
        return 0, t1, last, cut
    t0, end = r.clock.t, min(stop, r.clock.t_end)
    # Nothing else bounds the rotation of driven bodies
    if driven:
        r.clock.h = min(r.clock.h, r.clock.turn_share * longest_step(c.system.bodies, r.now))
    # Steps have collapsed: the reason is that of the last failure
    t1 = t0 + r.clock.h
    if not gets_on(r, t0, t1):
        failed = r.numbers.failed
        if failed in OFF_CHART and r.numbers.may_pass == 1:
            return PASSAGE, t1, False, False
        return failed if failed in (NOT_FINITE, JAMMED, UNHELD) else STEP_COLLAPSED, t1, False, False
    # An implicit step ends before a joint comes to rest
    h = until_rest(c, r, r.clock.h) if implicit else r.clock.h
    t1 = t0 + h if gets_on(r, t0, t0 + h) else t1
    # The last bit before a stop is taken along
    if t1 + stretch(h, r.clock.max_step) >= end:
        t1 = end
    return 0, t1, t1 == r.clock.t_end, False


@kernel
def _keep_start(c, r, implicit):
    """Keep what the start of the step has, for dense output and to go back to."""
    copy(r.x, r.x_old)
    copy(r.y, r.y_old)
    copy(r.yd, r.yd_old)
    if implicit or c.work.B.size > 0:
        keep(c, r.warm)  # what is rejected may leave u far away, with B on another branch of the constraints
    if r.numbers.adaptive == 1 or r.numbers.first_order != 0:
        copy(r.xd, r.xd_old)
    if r.numbers.adaptive == 1:
        copy(r.x_low, r.x_low_old)
        copy(r.y_low, r.y_low_old)


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
def _take_projection(c, r):
    """x and y at the step's end without their normal components, which stages of the next step would keep."""
    # x <- x - Y0 u,  y <- y - Y0 z,  u <- 0
    copy(c.chart.x[: r.x.size], r.x)
    copy(c.chart.y[: r.y.size], r.y)
    for e in range(c.work.u.size):
        c.work.u[e] = 0.0


@kernel
def _attempt(context, run, c, r, t1, implicit):
    """x, y and the accelerations at t1; what the start of the step had is kept. Status."""
    t0 = r.clock.t
    # The method writes increments, added with compensation; then all constraint levels at t1
    _keep_start(c, r, implicit)
    status = call_step(r.kernels.step, context, run, t0, t1 - t0)
    if status == 0:
        _add(r.x, r.x_low, r.dx)
        _add(r.y, r.y_low, r.dy)
        status = evaluate(context, c.work, r, t1, r.x, r.y, r.yd, r.xd)
        if r.numbers.free_stages == 1:
            _take_projection(c, r)
        if implicit:  # the last stage's own accelerations: f would amplify what its iteration has left
            copy(r.memory[r.numbers.stage_at :][: r.y.size], r.yd)
            call_complete(r.kernels.complete, context, r.yd)
    return status


@kernel
def _judge_chart(context, c, r, h, driven):
    """Whether the chart still holds at the end of a step: a Status, and the reason for a new one, 0 for none."""
    # Contraction and rotation since q0; dropped rows
    reason = call_check(r.kernels.check, context)
    if reason < 0:
        return -reason, reason
    # Beyond this another branch of the constraints may have been found
    lost = not c.work.control.contraction < CONTRACTION_LOST
    if lost or (driven and too_far(c.system.bodies, r.now, c.work.qd, h)):
        return CHART_LOST, reason
    return 0, reason


@kernel
def _reach(c, h):
    """The step that contracts a new chart by CONTRACTION_KEPT, from one of h: contraction grows as the step."""
    return h * CONTRACTION_KEPT / max(c.work.control.contraction, TINY)


@kernel
def _is_accepted(context, run, c, r, t1, h):
    """Accept or reject the step h to t1, by its error and by the loads along its path. True if accepted."""
    before = r.clock.error_before
    if not accept(context, c, r, h):
        return False
    if r.kernels.watch == 0:
        return True
    share = call_watch(r.kernels.watch, context, run, t1, h)
    if share < 1.0:
        r.clock.h, r.clock.error_before, r.numbers.rejected_last = share * h, before, 1
        forget_scale(r)
    return share == 1.0


@kernel
def _halve(c, r, h):
    """Reject a step with a stage that was not solved: the next one is half as long."""
    r.numbers.failed = STAGE_FAILED
    # As at the start of the step; after a second failure with new derivatives of the force laws
    bring_back(c, r.warm)
    restore_now(c.work, r)
    r.numbers.rejected += 1
    if r.numbers.rejected_last == AGAIN:
        c.linear.numbers.known = 0
    r.numbers.rejected_last = AGAIN
    r.clock.h = limits.HALVED * h


@kernel
def _change_chart(context, c, r, log, shorter, status, driven):
    """Reject a step that left the chart: back to its start, on a new chart if this one has been used. Status.

    If the chart was new, the next step is `shorter`.
    """
    # q, qd, qdd of the step's start
    restore_now(c.work, r)
    if c.saddle.K.size > 0:  # factors with which stages begin
        bring_back(c, r.warm)
    r.numbers.rejected += 1
    # The chart is new: the step was too long. A fixed step has no other length
    if r.numbers.in_chart == 0:
        if c.work.B.size > 0:
            bring_back(c, r.warm)
        if r.numbers.adaptive == 0:
            near = is_singular_within_a_step(c.tangent) or (status in OFF_CHART and has_hardly_turned(c))
            return PASSAGE if near and r.numbers.may_pass == 1 else status
        r.numbers.failed = status
        r.clock.h = shorter
        if driven:  # nothing else keeps the next step from being as long
            r.clock.turn_share *= limits.HALVED
    # Rows may have become dependent
    doubt_selection(c.tangent)
    return begin_chart(context, c, r, log, BY_FAILURE)


@kernel
def _move_on(c, r, t1, cut, implicit):
    """The end of an accepted step is where the run is now."""
    w, t0 = c.work, r.clock.t
    r.numbers.failed = 0
    r.clock.turn_share = min(limits.TURN_GAIN * r.clock.turn_share, 1.0)
    # Predictions and interpolants use the point before
    if implicit or r.numbers.first_order == 1:
        for j in range(3):
            copy(r.now[j], r.before[j])
        c.linear.numbers.t_before = t0
    # Turn counts, state, memories of forces
    count_turns(r, w.q, w.qd, t1 - t0)
    store_now(w, r)
    remember(c.system, w.q, w.qd, t1, r.remembered[r.joints.shape[0] :])
    r.clock.t = t1
    r.numbers.steps += 1
    r.numbers.cuts += 1 if cut else 0
    r.numbers.in_chart += 1


@kernel
def _finish(context, run, c, r, log, t0, last, reason):
    """After an accepted step from t0: its outputs, and a new chart if there is a reason for one. Status."""
    if reason == 0 and r.numbers.chart_interval > 0 and r.numbers.in_chart >= r.numbers.chart_interval:
        reason = BY_INTERVAL
    # Outputs of the step belong to its chart, so the change of chart comes last
    status = record_step(context, run, c, r, log, t0, r.clock.t)
    if status == 0 and reason != 0 and not last:
        restore_now(c.work, r)
        status = begin_chart(context, c, r, log, reason)
    return status


@callback("pppi")
def advance(context, run, log, most):
    """Make up to `most` steps. Status: SUCCESS at the end of the interval, SLICE_DONE, or the reason to stop.

    Addresses of a `Context`, a `RunState` and a `RunLog`. The first call, but one with
    most = 0, begins the run; with most = -1 it does no more.
    """
    c, r, log = load(context), load_run(run), load_log(log)
    status = 0
    adaptive, implicit, driven = r.numbers.adaptive == 1, r.numbers.stage_at > 0, is_rheonomic(c.system)
    # Begin, or go on after Python was asked at a stop
    if r.numbers.begun == 0 and most != 0:
        status = _enter(context, c, r, log)
    elif r.numbers.waiting == 1:
        r.numbers.waiting = 0
        status = _cross_stop(context, c, r, log, False)  # what f was before is known no more
    for _ in range(most):
        if status != 0 or is_full(r, log):
            break
        # Propose where the step ends
        t0, stop, wanted, before = r.clock.t, next_stop(r, log), r.clock.h, r.clock.error_before
        if t0 >= r.clock.t_end:
            break
        status, t1, last, cut = _propose(c, r, stop, driven, implicit)
        if status != 0:
            break
        # Attempt it
        h = t1 - t0
        note_try(r, log, t0, h)
        r.numbers.history += 1
        status, reason = _attempt(context, run, c, r, t1, implicit), 0
        # Rejected: a stage was not solved
        if adaptive and status == STAGE_FAILED:
            _halve(c, r, h)
            status = 0
            continue
        # Rejected: the step left its chart
        shorter = limits.QUARTERED * h
        if status == 0:
            status, reason = _judge_chart(context, c, r, h, driven)
            if c.work.control.contraction >= CONTRACTION_LOST:
                shorter = max(shorter, _reach(c, h))
        if status != 0:
            status = _change_chart(context, c, r, log, shorter, status, driven)
            continue
        # Rejected: the error is too large, or a load changes between the stages
        if adaptive and not _is_accepted(context, run, c, r, t1, h):
            r.numbers.rejected += 1
            if t0 + r.clock.h >= t1:  # rounding would propose the same step for ever
                r.clock.h = limits.SHRINK * h
            _go_back(r)
            if r.numbers.in_chart == 0 and c.work.B.size > 0:  # that may have been far too long
                bring_back(c, r.warm)
            continue
        # Accepted. A step cut short by a stop doesn't predict the next one
        note_accepted(r, log)
        if adaptive and t1 == stop and h < limits.CUT_SHORT * wanted:
            r.clock.h, r.clock.error_before = max(r.clock.h, wanted), before
        if adaptive and r.numbers.in_chart == 0:
            r.clock.h = min(r.clock.h, _reach(c, h))
        stiff = r.numbers.last_stage > 0 and watch_stiffness(c.system.bodies, c.work, r, h)
        _move_on(c, r, t1, cut, implicit)
        status = _finish(context, run, c, r, log, t0, last, reason)
        # At a stop the accelerations change
        if status == 0 and t1 == stop:
            if is_sampled(r, log, t1):
                break
            status = _cross_stop(context, c, r, log, implicit)
        if stiff and r.numbers.leave_when_stiff == 1:
            break
    if status != 0:
        return status
    return 0 if r.clock.t >= r.clock.t_end and r.numbers.waiting == 0 else SLICE_DONE
