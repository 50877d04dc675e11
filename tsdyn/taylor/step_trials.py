"""Trials of a Taylor step: its length, its end, and what is tried next near a singular configuration.

A step that ends near a singular configuration is lengthened, at looser tolerances, until it ends beyond; if no length
passes, the step that the tolerance of the run asks for is taken where it serves, or is shortened to end before.

Steps become shorter towards a place where the law of a force is not analytic, such as zero length of a spring. Where
the rounding of time is reached, a step of first order crosses it (`_hop`); the next series have the law beyond.
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, move_bodies, place_bodies
from ..errors import Status
from ..jit.kernels import kernel
from ..maths.dense_linalg import copy
from ..model.equations import set_time
from ..motions.tolerances import SAMPLES
from ..rows.interface import is_near_singular, singularity_indicator
from ..runs.breakpoints import fixed_end
from ..runs.run_log import note_try
from ..runs.step_control import gets_on, stretch
from ..runs.tolerances import FROM_ZERO, SHORTEST
from .step_length import finite_top, is_near, longest, loosest, step_length
from .step_parts import call_expand, call_laws, call_reach, is_singular
from .tolerances import (
    APART,
    AVOID,
    AVOIDING,
    CLOSE,
    CLOSER,
    COARSE,
    HALVED,
    HOP,
    LEAST_STEPS,
    LOOSER,
    MISSED,
    MOST_HOPS,
    MOST_TURN,
    NO_SPEED,
    PASSED,
    PLACES,
    RATES,
    TIGHTER,
    TIGHTEST,
)

STEP_COLLAPSED, PASSAGE, UNHELD = int(Status.STEP_COLLAPSED), int(Status.PASSAGE), int(Status.UNHELD)
NOT_FINITE, SERIES_ENDED = int(Status.NOT_FINITE), int(Status.SERIES_ENDED)


@kernel
def go_to_start(c, r):
    """The poses at the step's start, from where p is followed."""
    copy(r.now[0], c.work.q)
    place_bodies(c.graph.bodies, c.work.q, c.tangent.poses)


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
        s.tol = max(TIGHTER * tol, min(tol, TIGHTEST))
        s.h = longest(c, r, s.tol, s.highest)
    # Bounds that no coefficient knows of: sharp laws, counted turns, the first step
    s.limit = r.clock.max_step
    if s.sharp == 1:
        s.h *= min(1.0, RATES * s.h / (order.top + 2)) ** (1.0 / (order.top + 2))
        s.limit = min(s.limit, (r.clock.t_end - r.clock.t_origin) / LEAST_STEPS)
    if c.system.memory.size > 0:  # what counts turns must see each of them
        s.limit = min(s.limit, MOST_TURN / max(_fastest(c), NO_SPEED))
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
    if s.shorter == AVOIDING or s.last == 1 or not is_near(c, CLOSER if s.looser == 1 else CLOSE):
        return True
    # or it has passed: the indicator rises again
    return s.looser == 1 and c.tangent.indicator.end > s.share and not is_near(c, PASSED)


@kernel
def _choose_next(c, r, landed, tol):
    """Choose the next step to try; False if there is none better than the last one."""
    s, order = c.trial, c.expansion.order
    # The first try ends at a distance that can be gone on from
    if landed and s.share == math.inf and not is_near(c, CLOSE):
        s.serves = 1
    # Lengthen, at a looser tolerance, to end beyond the singular configuration
    longer = 0.0
    if s.looser == 1 and landed and LOOSER * s.tol <= loosest(c, tol):
        s.share, s.tol = c.tangent.indicator.end, LOOSER * s.tol
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
        s.h *= AVOID if landed else HALVED
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
    s.h = max(s.good, 0.5 / PLACES) * h
    s.limit, s.own_h = min(s.limit, s.h), min(s.own_h, s.h)
    if s.sharp == 0:
        order.next = min(order.top + 2, order.highest)
    return False


@kernel
def _hop(context, c, r, log, stop):
    """Cross a point where a law is not analytic: r + rd h + rdd h^2 / 2, and likewise rotations. Status."""
    s, t = c.trial, r.clock.t
    # A few units in the last place of t; twice as long right after another one
    s.h = HOP * SHORTEST * max(abs(t), FROM_ZERO * (r.clock.t_end - r.clock.t_origin))
    s.hops = 0 if t > s.hopped + APART * s.h else s.hops + 1
    if s.hops > MOST_HOPS or s.check == 0 or r.numbers.adaptive == 0:
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
        if not adaptive and s.check != 0:
            call_laws(s.check, context, r.clock.t, s.t1 - r.clock.t, COARSE, COARSE)
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
            go_to_start(c, r)
            _reject(r, log)
            continue
        # A projection that moves further than the tolerance corrects no truncation error: the radius was wrong
        landed = status == 0 and (not adaptive or f.landing.residual <= MISSED * (s.tol + c.work.control.floor))
        if landed:
            f.indicator.end = singularity_indicator(c.graph, f.rows)
        if not adaptive:
            return status
        # Take it, or try another length from the start
        if _is_taken(c, landed) or not _choose_next(c, r, landed, tol):
            return 0
        go_to_start(c, r)
        _reject(r, log)
