"""The Taylor driver: series, trials of a step, projection, stops. One kernel serves every scene."""

import math

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, move_bodies, place_bodies
from ..errors import Status
from ..formulations.charts import AT_START, BY_SERIES, extent
from ..jit.kernels import callback, kernel, long_kernel
from ..maths.dense_linalg import copy, is_finite
from ..maths.tolerances import ROUNDING_AT_MOST, TINY
from ..model.equations import remember, set_time
from ..model.joint_turns import count_turns
from ..motions.tolerances import SAMPLES
from ..rows.interface import is_near_singular, singularity_indicator
from ..runs.dense_output import head_block, is_wanted_before, record, record_end, store_block, store_now
from ..runs.run_log import close_chart, is_full, load_log, note_accepted, note_try, open_chart
from ..runs.step_control import gets_on, stretch
from ..runs.stepper import amend, fixed_end, is_sampled, next_stop, take_pieces
from ..runs.tolerances import AT_LONGEST, FROM_ZERO, HALVED, MOST_TURN, SHORTEST, TRIES
from ..workspaces import B_DATA, load_run
from . import tolerances as limits
from .layout import load_series
from .step_length import finite_top, held_sharp, is_near, longest, loosest, radius, step_length, weights
from .step_parts import call_expand, call_laws, call_reach, hold_accelerations, is_singular, set_floor, state_within

# Stops of a Taylor run: continuation after a step that ends at a stop.

NOT_FINITE = int(Status.NOT_FINITE)


@long_kernel
def cross_stop(context, c, r, log):
    """At a stop: poses and accelerations after it, for its output and the next series. Status."""
    w = c.work
    # Functions switch to their next piece; the state is the same, the accelerations are not
    take_pieces(c.system, r, log)
    status = call_reach(r.kernels.reach, context, r.clock.t, -1.0)
    if status == 0:
        status = call_expand(r.kernels.expand, context, 0, 1)
        if status != 0:
            return status
        if not is_finite(w.qdd):
            return NOT_FINITE
        store_now(w, r)
        amend(r, log, w.q, w.qd, w.qdd)
    return status


@kernel
def lower_order(order, rho, tol, h):
    """After a step cut to h: one order less for the next, where two less would have reached as far.

    rho is the radius of convergence as the coefficients up to that order have it.
    """
    # At order top - 2 the step would be rho tol^(1 / top)
    top = order.top
    if top > order.lowest and rho * tol ** (1.0 / top) > h:
        order.next = top - 1


# Trials of a Taylor step: its length, its end, and what is tried next near a singular configuration.
#
# A step that ends near a singular configuration is lengthened, at looser tolerances, until it ends beyond; if no length
# passes, the step that the tolerance of the run asks for is taken where it serves, or is shortened to end before.
#
# Steps become shorter towards a place where the law of a force is not analytic, such as zero length of a spring. Where
# the rounding of time is reached, a step of first order crosses it (`_hop`); the next series have the law beyond.

STEP_COLLAPSED, PASSAGE, UNHELD = int(Status.STEP_COLLAPSED), int(Status.PASSAGE), int(Status.UNHELD)
SERIES_ENDED, CHART_LOST = int(Status.SERIES_ENDED), int(Status.CHART_LOST)


@kernel
def stand_at(context, c, r, t):
    """Poses, H and the factors of S at the last accepted q, qd, for a series to begin there. Status."""
    w = c.work
    set_time(c.system, t)
    copy(r.now[0], w.q)
    copy(r.now[1], w.qd)
    place_bodies(c.graph.bodies, w.q, c.tangent.poses)
    move_bodies(c.graph.bodies, w.q, w.qd, c.tangent.poses)
    return call_reach(r.kernels.reach, context, t, -1.0)


@kernel
def _fastest(c):
    """Return the largest angular velocity."""
    square = 0.0
    for b in range(c.graph.bodies.shape[0]):
        w = c.tangent.poses[b * POSE + OMEGA : b * POSE + OMEGA + 3]
        square = max(square, w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    return math.sqrt(square)


@kernel
def _propose(c, r, tol):
    """The first step to try."""
    s, order = c.trial, c.expansion.order
    # By the tolerance of the run
    s.failed, s.h = 0, step_length(c, r)
    s.shorter, s.share, s.serves, s.looser, s.tol, s.highest = 0, math.inf, 0, r.numbers.adaptive, tol, order.top
    s.spacing = math.inf
    if r.numbers.adaptive == 0:
        s.h = r.clock.h
        return
    s.spacing = (r.clock.t_end - r.clock.t_origin) / SAMPLES
    # By a tighter tolerance and any order
    if is_near_singular(c.tangent, c.tangent.indicator.start):
        s.tol = max(limits.TIGHTER * tol, min(tol, limits.TIGHTEST))
        s.h = held_sharp(c, longest(c, r, s.tol, s.highest), order.top + 2)
    # Bounds that no coefficient knows of: sharp laws, counted turns, the first step
    s.limit = r.clock.max_step
    if s.sharp == 1:
        s.limit = min(s.limit, (r.clock.t_end - r.clock.t_origin) / limits.LEAST_STEPS)
    if c.system.memory.size > 0:  # what counts turns must see each of them
        s.limit = min(s.limit, MOST_TURN / max(_fastest(c), TINY))
    if r.numbers.steps == 0 and r.clock.h > 0.0:
        s.limit = min(s.limit, r.clock.h)
    s.h = min(s.h, s.limit)
    if s.h == math.inf:  # halving it would go on for ever
        s.h = r.clock.t_end - r.clock.t
    # To return to, if no longer step passes a singular configuration
    s.own_h, s.own_top, s.own_tol = s.h, order.top, s.tol


@kernel
def _end(s, r, stop):
    """Where the step tried ends; False if it is no more than the rounding of t."""
    # Fixed steps end on their grid
    if r.numbers.adaptive == 0:
        s.t1, last, cut = fixed_end(r, stop)
        s.last, s.cut = 1 if last else 0, 1 if cut else 0
    else:
        # The last bit before a stop is taken along
        end = min(stop, r.clock.t_end)
        s.t1 = r.clock.t + s.h
        if s.t1 + stretch(s.h, r.clock.max_step) >= end:
            s.t1 = end
        s.last, s.cut = 1 if s.t1 == r.clock.t_end else 0, 0
    return gets_on(r, r.clock.t, r.clock.t + s.h)


@kernel
def _attempt(context, c, r):
    """The state at the end of the step tried. Status; PASSAGE if that takes a kernel that isn't loaded."""
    s, h = c.trial, c.trial.t1 - r.clock.t
    s.singular = 0
    # The last step of a run may end in a singular configuration
    status = call_reach(r.kernels.reach, context, s.t1, h)
    if s.last == 1 and is_singular(c, status):
        if r.kernels.pass_singular == 0:
            return PASSAGE
        s.singular = 1
        status = call_reach(r.kernels.pass_singular, context, s.t1, h)
    return status


@kernel
def _is_taken(c, landed):
    """Whether a step that has landed, or not, is taken as it is."""
    s = c.trial
    if not landed:
        return False
    # Taken: shortened often enough, or the last one, or far enough from a singular configuration
    if s.shorter == limits.AVOIDING or s.last == 1 or not is_near(c, limits.CLOSER if s.looser == 1 else limits.CLOSE):
        return True
    # or it has passed: the indicator rises again
    return s.looser == 1 and c.tangent.indicator.end > s.share and not is_near(c, limits.PASSED)


@kernel
def _choose_next(c, r, landed, tol):
    """Choose the next step to try; False if there is none better than the last one."""
    s, order = c.trial, c.expansion.order
    # The first try ends at a distance that can be gone on from
    if landed and s.share == math.inf and not is_near(c, limits.CLOSE):
        s.serves = 1
    # Lengthen, at a looser tolerance, to end beyond the singular configuration
    longer = 0.0
    if s.looser == 1 and landed and limits.LOOSER * s.tol <= loosest(c, tol):
        s.share, s.tol = c.tangent.indicator.end, limits.LOOSER * s.tol
        longer = min(longest(c, r, s.tol, s.highest), s.limit)
    if longer > s.h:
        s.h = longer
        return True
    if s.looser == 1 and s.serves == 1 and s.h == s.own_h:
        return False
    if s.looser == 1:  # no step passes: the own one, or a shorter one
        landed = landed or s.share < math.inf
        s.h, order.top, s.tol, s.looser = s.own_h, s.own_top, s.own_tol, 0
    # Shorten: to stay away from it, or because the end was not reached
    if s.serves == 0:
        s.shorter += 1 if landed else 0
        s.h *= limits.AVOID if landed else HALVED
    s.serves = 0
    return True


@kernel
def _lower_order(c, r):
    """Omit coefficients that are not finite, and choose the step again; False if all are finite."""
    s, order, top = c.trial, c.expansion.order, finite_top(c)
    if top < 1 or top == order.top:
        return False
    # The same series with the finite coefficients only
    order.top = s.own_top = s.highest = top
    s.h = s.own_h = min(step_length(c, r), s.limit)
    return True


@kernel
def _follows_laws(context, c, r):
    """Whether the forces' series are those of their laws all along the step tried; else it is shortened."""
    s, order, h = c.trial, c.expansion.order, c.trial.t1 - r.clock.t
    # good is the share of the step along which series and laws agree
    call_laws(s.check, context, r.clock.t, h, r.clock.atol, r.clock.rtol)
    if s.good == 1.0:
        return True
    # Nowhere: perhaps the series has overflowed
    if s.good == 0.0 and _lower_order(c, r):
        return False
    # To the last place where they agree
    s.h = max(s.good, 0.5 / limits.PLACES) * h
    s.limit, s.own_h = min(s.limit, s.h), min(s.own_h, s.h)
    if s.sharp == 0:
        order.next = min(order.top + 2, order.highest)
    return False


@kernel
def _hop(context, c, r, log, stop):
    """Cross a point where a law is not analytic: r + rd h + rdd h^2 / 2, and likewise rotations. Status."""
    s, t = c.trial, r.clock.t
    # A few units in the last place of t; twice as long right after another one
    s.h = limits.HOP * SHORTEST * max(abs(t), FROM_ZERO * (r.clock.t_end - r.clock.t_origin))
    s.hops = 0 if t > s.hopped + limits.HOP_APART * s.h else s.hops + 1
    if s.hops > limits.MOST_HOPS or s.check == 0 or r.numbers.adaptive == 0:
        return STEP_COLLAPSED
    s.h *= 2.0**s.hops
    s.hopped, c.expansion.order.top = t, 1
    _end(s, r, stop)
    # Order one: r + rd h + rdd h^2 / 2
    note_try(r, log, t, s.t1 - t)
    status = _attempt(context, c, r)
    if status == 0:
        c.tangent.indicator.end = singularity_indicator(c.graph, c.tangent.rows)
    return status


@kernel
def _reject(r, log):
    r.numbers.rejected += 1
    if r.numbers.history + 1 < log.history.shape[0]:
        r.numbers.history += 1


@kernel
def make_step(context, c, r, log, stop):
    """Reach the end of the next step, t1 of the trial, by a series that has been expanded. Status."""
    f, s, tol = c.tangent, c.trial, r.clock.atol + r.clock.rtol
    adaptive = r.numbers.adaptive == 1
    _propose(c, r, tol)
    while True:
        # Steps have collapsed
        if not _end(s, r, stop):
            return UNHELD if s.failed == UNHELD else _hop(context, c, r, log, stop)
        # Fixed steps end the run where the series leaves a law, adaptive ones are shortened
        note_try(r, log, r.clock.t, s.t1 - r.clock.t)
        # Turns are counted where two bodies together turn by less than half of one
        if not adaptive and c.system.memory.size > 0 and (s.t1 - r.clock.t) * _fastest(c) > 0.5 * math.pi:
            return CHART_LOST
        if not adaptive and s.check != 0:
            call_laws(s.check, context, r.clock.t, s.t1 - r.clock.t, limits.SHARP_TOL, limits.SHARP_TOL)
            if s.good < 1.0:
                return SERIES_ENDED
        if adaptive and s.check != 0 and not _follows_laws(context, c, r):
            _reject(r, log)
            continue
        # Reach the end: sums and projection
        s.failed = status = _attempt(context, c, r)
        if status == PASSAGE:  # back to where the run is
            status = stand_at(context, c, r, r.clock.t)
            if status == 0:
                status = call_expand(r.kernels.expand, context, 0, 1)
            return PASSAGE if status == 0 else status
        # Overflow of the highest coefficients
        if status == NOT_FINITE and adaptive and s.check != 0 and _lower_order(c, r):
            _reject(r, log)
            continue
        # A projection that moves further than the tolerance corrects no truncation error: the radius was wrong
        landed = status == 0 and (
            not adaptive or f.landing.residual <= ROUNDING_AT_MOST * (s.tol + c.work.control.floor)
        )
        if landed:
            f.indicator.end = singularity_indicator(c.graph, f.rows)
        if not adaptive:
            return status
        # Take it, or try another length from the start
        if _is_taken(c, landed) or not _choose_next(c, r, landed, tol):
            return 0
        _reject(r, log)


# The Taylor driver: series, step length, projection. One kernel serves every scene.
#
# Each step has its own chart: the series gives q and qd at the end of the step to truncation error, and a projection
# along W Phi_q^T returns both to the constraint manifold. A step is proposed from the radius of convergence, tried (its
# end reached), and taken or tried again with another length: the same series serves all of them.

SLICE_DONE = int(Status.SLICE_DONE)


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
    if min(indicator.end, indicator.start) < limits.WARY * indicator.largest:
        if r.numbers.near_steps == 0:
            tol = clock.atol + clock.rtol
            spare = max(limits.SPARE, min(limits.TIGHTEST / tol, 1.0))
            clock.atol, clock.rtol = spare * clock.atol, spare * clock.rtol
        r.numbers.near_steps += 1
        clock.largest_landing = max(clock.largest_landing, c.tangent.landing.moved)


@kernel
def _watch_stiffness(c, r, h):
    """Return True if the motion has just been found stiff: many steps in which nothing rotates or moves far."""
    # Largest rotation of the step, rad, and displacement over the size of the scene
    far, p, most = extent(c.work) / h, c.tangent.poses, 0.0
    # A law close to its singularity limits the step, not stiffness
    if not c.trial.left > limits.STILL:
        most = math.inf
    for b in range(c.graph.bodies.shape[0]):
        at = b * POSE
        for i in range(3):
            most = max(most, abs(p[at + OMEGA + i]) * h, abs(p[at + RD + i]) / far)
        if most > limits.SMALL:
            r.numbers.at_limit = 0
            return False
    # Steps in which little moves are counted; with sharp forces many more are needed
    before, enough, tiny, faster = r.numbers.at_limit, limits.SMALL_STEPS, limits.STILL_STEP, limits.FASTER
    if c.trial.sharp == 1:
        enough, tiny, faster = limits.SHARP_STEPS, limits.MINUTE, limits.AT_REST
    r.numbers.at_limit += faster if most < tiny else 1
    if before < enough <= r.numbers.at_limit:
        r.numbers.stiff = 1
        return r.numbers.leave_when_stiff == 1
    return False


@kernel
def _mind_stop(c, r, h):
    """After a step that a stop has cut to h: the order of the next one."""
    x, tol = c.expansion, r.clock.atol + r.clock.rtol
    far, fast, _, _ = weights(c.graph, x, r.clock.atol, r.clock.rtol)
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
        t = log.t_eval[r.numbers.next_eval]
        status = state_within(context, c, r.kernels, t, t - t0, True)
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
        r.numbers.next_eval += 1
    # The end of the step again
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


@callback("pppi")
def advance_series(context, run, log, most):
    """Make up to `most` steps, as `stepper.advance` does; context is the address of a `SeriesContext`. Status."""
    c, r, log = load_series(context), load_run(run), load_log(log)
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
