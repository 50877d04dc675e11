"""The Taylor driver: series, step length, projection. One kernel serves every scene.

Each step has its own chart: the series gives q and qd at the end of the step to truncation error, and a projection
along W Phi_q^T returns both to the constraint manifold. A step is proposed from the radius of convergence, tried (its
end reached), and taken or tried again with another length: the same series serves all of them.
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, RD
from ..errors import Status
from ..formulations.chart_validity import AT_START, BY_SERIES, extent
from ..jit.kernels import entry, kernel, long_kernel
from ..maths.dense_linalg import copy, is_finite
from ..model.equations import remember
from ..model.joint_turns import count_turns
from ..rows.interface import singularity_indicator
from ..runs.breakpoints import is_sampled, next_stop, take_pieces
from ..runs.outputs import record, store_now
from ..runs.run_log import close_chart, is_full, no_log, note_accepted, open_chart
from ..runs.step_outputs import head_block, is_wanted_before, record_end, store_block
from ..runs.tolerances import AT_LONGEST, TRIES
from ..workspaces.run_state import B_DATA, load_run
from .breakpoints import cross_stop, lower_order
from .step_length import radius, weights
from .step_parts import call_expand, call_reach, hold_accelerations, set_floor, state_within
from .step_trials import go_to_start, make_step, stand_at
from .tolerances import (
    AT_REST,
    FASTER,
    MINUTE,
    SHARP_STEPS,
    SMALL,
    SMALL_STEPS,
    SPARE,
    STILL,
    TIGHTEST,
    TINY,
    WARY,
)
from .workspace import load_series

SLICE_DONE, NOT_FINITE = int(Status.SLICE_DONE), int(Status.NOT_FINITE)


@kernel
def _open_chart(w, r, log, t, reason):
    open_chart(r, log, t, reason)
    w.counters.charts += 1


@long_kernel
def _stand(context, c, r, log, t):
    """Take the present poses as the state at t, with qdd from the series of order zero. Status."""
    w, indicator = c.work, c.tangent.indicator
    # The end of the step is the start of the next
    indicator.start = indicator.end
    indicator.largest = max(indicator.start, indicator.largest)
    # Forces that count turns, and rounding errors of the state
    remember(c.system, w.q, w.qd, t, r.remembered[r.joints.shape[0] :])
    copy(c.expansion.low_end, c.expansion.low)
    status = 0
    # In a singular configuration qdd is that of the old series
    if c.trial.singular == 0:
        status = call_expand(r.kernels.expand, context, 0, 1)
        if status == 0:
            status = hold_accelerations(c, t)
    if not is_finite(w.qdd):
        return NOT_FINITE
    if status != 0:
        return status
    # Accept
    count_turns(r, w.q, w.qd, t - r.clock.t)
    store_now(w, r)
    r.clock.t = t
    record_end(w, r, log, t)
    return 0


@kernel
def _enter(context, c, r, log):
    """Begin the run, with its first output. Status."""
    w, f, t = c.work, c.tangent, r.clock.t
    # Pieces, rounding floor, compensation
    take_pieces(c.system, r, log)
    set_floor(c, w.q)
    c.expansion.low[:] = 0.0
    w.control.condition = 1.0
    c.trial.singular = c.trial.hops = 0
    c.trial.hopped = t
    # Project the start and take its accelerations
    status = stand_at(context, c, r, t)
    f.indicator.end = singularity_indicator(c.graph, f.rows) if status == 0 else 0.0
    _open_chart(w, r, log, t, AT_START)
    if status == 0:
        status = _stand(context, c, r, log, t)
    r.numbers.begun = 1 if status == 0 else 0
    return status


@kernel
def _expand(context, c, r):
    """The series of the next step, order by order."""
    order = c.expansion.order
    order.top = order.next
    call_expand(r.kernels.expand, context, 1, order.top)
    c.work.counters.evaluations += order.top


@kernel
def _mind_singular(c, r):
    """Near a singular configuration: the rest of the run has a tighter tolerance."""
    indicator, clock = c.tangent.indicator, r.clock
    # Once per run: tighter tolerances from here on
    if min(indicator.end, indicator.start) < WARY * indicator.largest:
        if r.numbers.near_steps == 0:
            tol = clock.atol + clock.rtol
            spare = max(SPARE, min(TIGHTEST / tol, 1.0))
            clock.atol, clock.rtol = spare * clock.atol, spare * clock.rtol
        r.numbers.near_steps += 1
        clock.largest_landing = max(clock.largest_landing, c.tangent.landing.moved)


@kernel
def _watch_stiffness(c, r, h):
    """Return True if the motion has just been found stiff: many steps in which nothing rotates or moves far."""
    # Largest rotation of the step, rad, and displacement over the size of the scene
    far, p, most = extent(c.work) / h, c.tangent.poses, 0.0
    # A law close to its singularity limits the step, not stiffness
    if not c.trial.left > STILL:
        most = math.inf
    for b in range(c.graph.bodies.shape[0]):
        at = b * POSE
        for i in range(3):
            most = max(most, abs(p[at + OMEGA + i]) * h, abs(p[at + RD + i]) / far)
        if most > SMALL:
            r.numbers.at_limit = 0
            return False
    # Steps in which little moves are counted; with sharp forces many more are needed
    before, enough, tiny, faster = r.numbers.at_limit, SMALL_STEPS, TINY, FASTER
    if c.trial.sharp == 1:
        enough, tiny, faster = SHARP_STEPS, MINUTE, AT_REST
    r.numbers.at_limit += faster if most < tiny else 1
    if before < enough <= r.numbers.at_limit:
        r.numbers.stiff = 1
        return r.numbers.leave_when_stiff == 1
    return False


@kernel
def _mind_stop(c, r, h):
    """After a step that a stop has cut to h: the order of the next one."""
    x, tol = c.expansion, r.clock.atol + r.clock.rtol
    far, fast, _ = weights(c, r)
    rho = radius(x.bodies, c.graph.bodies.shape[0], x.order.room, x.order.top - 2, far, fast)
    lower_order(x.order, rho, tol, h)


@kernel
def _fill_block(c, r, log, t0, t1):
    """The block of a step: its top order, q at its start, the series of all bodies."""
    data = r.block[B_DATA:]
    head_block(r, t0, t1)
    data[0] = float(c.expansion.order.top)
    copy(r.now[0], data[1:])
    copy(c.expansion.bodies, data[1 + c.work.q.size :])
    store_block(r, log)


@kernel
def _record_within(context, c, r, log, t0, t1):
    """What t_eval asks for in (t0, t1), then back to t1. Status."""
    w = c.work
    while is_wanted_before(r, log, t1):
        # From the start of the step: Euler parameters are followed from there
        t = log.t_eval[r.numbers.next_eval]
        # The end of the step again
        go_to_start(c, r)
        status = state_within(context, c, r.kernels, t, t - t0)
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
        r.numbers.next_eval += 1
    go_to_start(c, r)
    reach = r.kernels.pass_singular if c.trial.singular == 1 else r.kernels.reach
    return call_reach(reach, context, t1, t1 - t0)


@kernel
def _move_on(context, c, r, log, t1):
    """The end of the step is where the run is now, and where the next series begins. Status."""
    r.numbers.in_chart = 1
    if c.trial.last == 0:
        close_chart(r, log, 1.0, 0.0)
        _open_chart(c.work, r, log, t1, BY_SERIES)
    r.numbers.steps += 1
    r.numbers.cuts += c.trial.cut
    return _stand(context, c, r, log, t1)


@entry("pp", no_log(), "i")
def advance_series(context, run, log, most):
    """Make up to `most` steps, as `stepper.advance` does; context is the address of a `SeriesContext`. Status."""
    return advance_by_series(context, load_series(context), load_run(run), log, most)


@kernel
def advance_by_series(context, c, r, log, most):
    """As `advance_series`, for kernels that call it."""
    adaptive, status = r.numbers.adaptive == 1, 0
    # Begin, or go on after Python was asked at a stop
    if r.numbers.begun == 0 and most != 0:
        status = _enter(context, c, r, log)
    elif r.numbers.waiting == 1:
        r.numbers.waiting = 0
        status = cross_stop(context, c, r, log)
    for _ in range(most):
        if status != 0 or is_full(r, log) or r.numbers.history + TRIES > log.history.shape[0]:
            break
        # One step: expand, choose a length, reach the end
        t0, stop = r.clock.t, next_stop(r, log)
        if t0 >= r.clock.t_end:
            break
        _expand(context, c, r)
        status = make_step(context, c, r, log, stop)
        if status != 0:
            break
        # Accepted
        t1 = c.trial.t1
        r.numbers.history += 1
        note_accepted(r, log)
        _mind_singular(c, r)
        if adaptive:
            r.clock.h = t1 - t0
        # Stiffness, unless the step was cut by a bound or a stop
        leave = False
        if t1 != stop and t1 - t0 < AT_LONGEST * r.clock.max_step:
            leave = _watch_stiffness(c, r, t1 - t0)
        elif adaptive and t1 == stop:  # a step that is cut is no sign of stiffness
            _mind_stop(c, r, t1 - t0)
        # Outputs within the step, before its end becomes the state
        if r.numbers.dense != 0:
            _fill_block(c, r, log, t0, t1)
        if is_wanted_before(r, log, t1):
            status = _record_within(context, c, r, log, t0, t1)
        if status == 0:
            status = _move_on(context, c, r, log, t1)
        # At a stop the accelerations change
        if status == 0 and t1 == stop and c.trial.singular == 0:
            if is_sampled(r, log, t1):
                break
            status = cross_stop(context, c, r, log)
        if leave:
            break
    if status != 0:
        return status
    return 0 if r.clock.t >= r.clock.t_end and r.numbers.waiting == 0 else SLICE_DONE
