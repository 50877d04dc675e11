"""The Taylor driver: series, step length, projection. One kernel serves every scene.

Each step has its own chart: the series gives q and qd at the end of the step to truncation error, and a projection
along W Phi_q^T returns both to the constraint manifold.
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, RD, move_bodies, place_bodies
from ..errors import Status
from ..formulations.chart_validity import AT_START, BY_SERIES
from ..formulations.tolerances import ROUNDING
from ..jit.kernels import entry, kernel
from ..maths.dense_linalg import copy, is_finite
from ..model.equations import remember, set_time
from ..model.joint_turns import count_turns
from ..rows.interface import is_near_singular, singularity_indicator
from ..runs.breakpoints import cut_fixed, is_sampled, next_stop, take_pieces
from ..runs.outputs import record, store_now
from ..runs.run_state import (
    ADAPTIVE,
    AT_LIMIT,
    ATOL,
    BEGUN,
    BLOCKS,
    CHART_ROWS,
    CUTS,
    DENSE,
    HISTORY,
    LANDED,
    LEAVE_WHEN_STIFF,
    MAX_STEP,
    NEAR_STEPS,
    NEXT_EVAL,
    REJECTED,
    RTOL,
    STEPS,
    STEPS_WANTED,
    STIFF,
    STORED,
    T_END,
    T_ORIGIN,
    WAITING,
    H,
    T,
    load_run,
    no_record,
)
from ..runs.step_control import gets_on, stretch
from ..runs.trajectory import B_CHART, B_DATA, B_END, B_H, B_START
from .breakpoints import cross_stop, lower_order
from .step_length import is_near, longest, loosest, radius, step_length, weights
from .step_parts import EXPAND, PASS, REACH, call_expand, call_reach, is_next_to_singular, state_within
from .workspace import NEXT, ORDERS, TOP, load_series

SLICE_DONE, STEP_COLLAPSED = int(Status.SLICE_DONE), int(Status.STEP_COLLAPSED)
NOT_FINITE, PASSAGE = int(Status.NOT_FINITE), int(Status.PASSAGE)
MISSED = 100.0  # times the tolerance: a landing further away than this is no truncation error
# of the share at a step's start: one that ends next to such a place with less has come closer; too close to go on from;
# too close if it has passed
CLOSER, CLOSE, PASSED = 0.3, 0.1, 0.02
AVOID, AVOIDING = 0.7, 5  # a step that ends there is made shorter by this factor, so many times
TIGHTER, TIGHTEST = 0.01, 1e-16  # times the tolerance of a step from next to such a place; no less than
WARY, SPARE = 0.06, 0.1  # of the largest share: a run that has come to less goes on with this part of its tolerance
LOOSER = 2.0  # times that, as long as the step doesn't pass
MOST_TURN = 1.0  # rad in a step, where turns are counted
SMALL, SMALL_STEPS = 0.02, 40  # a step that turns and moves everything by less; so many of them, and it may be stiff


@kernel
def _mind_singular(c):
    """Record the singularity indicator after a step."""
    indicator = c.free.indicator
    indicator.start = indicator.end
    indicator.largest = max(indicator.start, indicator.largest)


@kernel
def _store_block(c, r, log, t0, h, t1):
    block = r.block
    block[B_START], block[B_H], block[B_END], block[B_CHART] = t0, h, t1, r.numbers[CHART_ROWS]
    block[B_DATA] = float(c.expansion.order[TOP])
    copy(r.now[0], block[B_DATA + 1 :])
    copy(c.expansion.bodies, block[B_DATA + 1 + c.work.q.size :])
    copy(r.remembered, block[block.size - r.remembered.size :])
    if r.numbers[DENSE] == STORED:
        copy(block, log.blocks[r.numbers[BLOCKS]])
        r.numbers[BLOCKS] += 1


@kernel
def _accept(context, c, r, log, steps, t, ended):
    """The poses as they are now are the state at t, and qdd, where the run has `ended` in a singular place. Status."""
    w = c.work
    _mind_singular(c)
    remember(c.system, w.q, w.qd, t, r.remembered[r.joints.shape[0] :])
    if not ended:
        call_expand(steps[EXPAND], context, 0)
    if not is_finite(w.qdd):
        return NOT_FINITE
    count_turns(r, w.q, w.qd, t - r.clock[T])
    store_now(w, r)
    r.clock[T] = t
    if log.t_eval.size == 0:
        record(r, log, t, w.q, w.qd, w.qdd)
    elif r.numbers[NEXT_EVAL] < log.t_eval.size and log.t_eval[r.numbers[NEXT_EVAL]] == t:
        record(r, log, t, w.q, w.qd, w.qdd)
        r.numbers[NEXT_EVAL] += 1
    return 0


@kernel
def _open_chart(w, r, log, t, reason):
    row = log.charts[r.numbers[CHART_ROWS]]
    row[0], row[1], row[2], row[3], row[4] = t, reason, 1.0, 0.0, 0.0
    w.counters.charts += 1


@kernel
def _stand_at(context, c, state, t, steps):
    """Poses, H and the factors of S at q, qd = state[:2], for a series to begin there. Status."""
    w = c.work
    set_time(c.system, t)
    copy(state[0], w.q)
    copy(state[1], w.qd)
    place_bodies(c.network.bodies, w.q, c.free.poses)
    move_bodies(c.network.bodies, w.q, w.qd, c.free.poses)
    return call_reach(steps[REACH], context, t, -1.0)


@kernel
def _begin_run(context, c, r, log, steps):
    w, f = c.work, c.free
    largest = 0.0
    for i in range(w.q.size):
        largest = max(largest, abs(w.q[i]))
    w.control.floor = ROUNDING * (w.control.size + largest)
    copy(w.q, r.now[0])
    copy(w.qd, r.now[1])
    status = _stand_at(context, c, r.now, r.clock[T], steps)
    f.indicator.end = singularity_indicator(c.network, f.rows) if status == 0 else 0.0
    _open_chart(w, r, log, r.clock[T], AT_START)
    return _accept(context, c, r, log, steps, r.clock[T], False) if status == 0 else status


@kernel
def _go_to_start(c, r):
    """The poses at the step's start, from where p is followed."""
    copy(r.now[0], c.work.q)
    place_bodies(c.network.bodies, c.work.q, c.free.poses)


@kernel
def _within(context, c, r, log, steps, t0, t1):
    """What t_eval asks for in (t0, t1). Status."""
    w = c.work
    while r.numbers[NEXT_EVAL] < log.t_eval.size and log.t_eval[r.numbers[NEXT_EVAL]] < t1:
        t = log.t_eval[r.numbers[NEXT_EVAL]]
        _go_to_start(c, r)
        status = state_within(context, steps, t, t - t0)
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
        r.numbers[NEXT_EVAL] += 1
    return 0


@kernel
def _fastest(c):
    """Return the largest angular velocity."""
    square = 0.0
    for b in range(c.network.bodies.shape[0]):
        w = c.free.poses[b * POSE + OMEGA : b * POSE + OMEGA + 3]
        square = max(square, w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    return math.sqrt(square)


@kernel
def _watch(c, r, h):
    """Return True if the motion is found stiff: many steps in which nothing rotates or moves far."""
    far, p = SMALL * c.work.control.floor / (ROUNDING * h), c.free.poses
    for b in range(c.network.bodies.shape[0]):
        at = b * POSE
        for i in range(3):
            if abs(p[at + OMEGA + i]) * h > SMALL or abs(p[at + RD + i]) > far:
                r.numbers[AT_LIMIT] = 0
                return False
    r.numbers[AT_LIMIT] += 1
    if r.numbers[AT_LIMIT] == SMALL_STEPS:
        r.numbers[STIFF] = 1
        return r.numbers[LEAVE_WHEN_STIFF] == 1
    return False


@entry("pp", no_record(), "wi")
def advance_series(context, run, log, steps, most):
    """Make up to `most` steps, as `stepper.advance` does; context is the address of a `SeriesContext`. Status."""
    c, r = load_series(context), load_run(run)
    w, f, x = c.work, c.free, c.expansion
    if r.numbers[BEGUN] == 0 and most != 0:
        take_pieces(c.system, r, log)
        status = _begin_run(context, c, r, log, steps)
        if status != 0:
            return status
        r.numbers[BEGUN] = 1
    adaptive = r.numbers[ADAPTIVE] == 1
    if r.numbers[WAITING] == 1:
        r.numbers[WAITING] = 0
        status = cross_stop(context, c, r, log, steps)
        if status != 0:
            return status
    tol = r.clock[ATOL] + r.clock[RTOL]
    for _ in range(most):
        if r.numbers[CHART_ROWS] + 2 >= log.charts.shape[0] or r.numbers[HISTORY] >= log.history.shape[0]:
            break
        t0 = r.clock[T]
        if t0 >= r.clock[T_END]:
            return 0
        stop = next_stop(r, log)
        end, cut = min(stop, r.clock[T_END]), False
        x.order[TOP] = x.order[NEXT]
        for k in range(1, x.order[TOP]):
            call_expand(steps[EXPAND], context, k)
        w.counters.evaluations += x.order[TOP]
        h, t1, last, shorter, highest, wanted = step_length(c, r), t0, False, 0, x.order[TOP], tol
        if adaptive and is_near_singular(f, f.indicator.start):
            wanted = max(TIGHTER * tol, min(tol, TIGHTEST))
            h = longest(c, r, wanted, highest)
        limit = r.clock[MAX_STEP]
        if not adaptive:
            h = limit = r.clock[H]
        if c.system.memory.size > 0:  # what counts turns must see each of them
            limit = min(limit, MOST_TURN / max(_fastest(c), 1e-300))
        if r.numbers[STEPS] == 0 and r.clock[H] > 0.0:
            limit = min(limit, r.clock[H])
        h = min(h, limit)
        own, top, tight, before, serves, looser = h, x.order[TOP], wanted, math.inf, False, adaptive
        while True:
            t1 = t0 + h
            done = r.numbers[STEPS] + 1 - r.numbers[CUTS]
            if not adaptive:
                t1 = r.clock[T_ORIGIN] + done * r.clock[H]
            if not gets_on(r, t0, t1):
                return STEP_COLLAPSED
            if adaptive:
                if t1 + stretch(h, r.clock[MAX_STEP]) >= end:
                    t1 = end
                last = t1 == r.clock[T_END]
            else:
                last = done == r.numbers[STEPS_WANTED]
                t1 = r.clock[T_END] if last else t1
                if stop < math.inf:
                    t1, cut = cut_fixed(stop, t1, r.clock[H], last)
                    last = last and not cut
            row = log.history[r.numbers[HISTORY]]
            row[0], row[1], row[2] = t0, t1 - t0, 0.0
            status, way = call_reach(steps[REACH], context, t1, t1 - t0), REACH
            if last and is_next_to_singular(c, status):
                if steps[PASS] == 0:  # it isn't loaded before it is needed
                    status = _stand_at(context, c, r.now, r.clock[T], steps)
                    call_expand(steps[EXPAND], context, 0)
                    return PASSAGE if status == 0 else status
                status, way = call_reach(steps[PASS], context, t1, t1 - t0), PASS
            landed = status == 0 and (not adaptive or f.landing.residual <= MISSED * (wanted + w.control.floor))
            if landed:
                f.indicator.end = singularity_indicator(c.network, f.rows)
            if landed and (not adaptive or shorter == AVOIDING or last):
                break
            if not adaptive:
                return status
            if landed and not is_near(c, CLOSER if looser else CLOSE):
                break
            if looser and landed and f.indicator.end > before and not is_near(c, PASSED):
                break
            serves = serves or (landed and before == math.inf and not is_near(c, CLOSE))
            longer = 0.0
            if looser and landed and LOOSER * wanted <= loosest(c, tol):
                before, wanted = f.indicator.end, LOOSER * wanted
                longer = min(longest(c, r, wanted, highest), limit)
            if longer > h:
                h = longer
            elif looser and serves and h == own:
                break
            else:
                if looser:  # no step passes: the own one, or a shorter one
                    h, x.order[TOP], wanted, looser, landed = own, top, tight, False, landed or before < math.inf
                if not serves:
                    shorter += 1 if landed else 0
                    h *= AVOID if landed else 0.5
                serves = False
            _go_to_start(c, r)
            r.numbers[REJECTED] += 1  # the same series serves another step
            if r.numbers[HISTORY] + 1 < log.history.shape[0]:
                r.numbers[HISTORY] += 1
        row[2] = 1.0
        r.numbers[HISTORY] += 1
        if min(f.indicator.end, f.indicator.start) < WARY * f.indicator.largest:
            if r.numbers[NEAR_STEPS] == 0:  # what is lost here is gained elsewhere
                spare = max(SPARE, min(TIGHTEST / tol, 1.0))
                tol, r.clock[ATOL], r.clock[RTOL] = spare * tol, spare * r.clock[ATOL], spare * r.clock[RTOL]
            r.numbers[NEAR_STEPS] += 1
            r.clock[LANDED] = max(r.clock[LANDED], f.landing.moved)
        if adaptive:
            r.clock[H] = t1 - t0
        leave = False
        if t1 != stop:  # which is no sign of stiffness
            leave = _watch(c, r, t1 - t0)
        elif adaptive:
            far, fast = weights(c, r)
            rho = radius(x.bodies, c.network.bodies.shape[0], x.order[ORDERS], x.order[TOP] - 2, far, fast)
            lower_order(x.order, rho, tol, t1 - t0)
        if r.numbers[DENSE] != 0:
            _store_block(c, r, log, t0, t1 - t0, t1)
        if r.numbers[NEXT_EVAL] < log.t_eval.size and log.t_eval[r.numbers[NEXT_EVAL]] < t1:
            status = _within(context, c, r, log, steps, t0, t1)
            if status == 0:
                _go_to_start(c, r)
                status = call_reach(steps[way], context, t1, t1 - t0)
            if status != 0:
                return status
        log.charts[r.numbers[CHART_ROWS], 4] = 1.0
        if not last:
            r.numbers[CHART_ROWS] += 1
            _open_chart(w, r, log, t1, BY_SERIES)
        r.numbers[STEPS] += 1
        r.numbers[CUTS] += 1 if cut else 0
        status = _accept(context, c, r, log, steps, t1, way == PASS)
        if status == 0 and t1 == stop and way == REACH:
            if is_sampled(r, log, t1):
                break
            status = cross_stop(context, c, r, log, steps)
        if status != 0:
            return status
        if leave:
            break
    return 0 if r.clock[T] >= r.clock[T_END] and r.numbers[WAITING] == 0 else SLICE_DONE
