"""Step-size control: the initial step, acceptance and rejection, stiffness detection."""

import math

from ..formulations.chart_validity import extent
from ..jit.kernels import kernel
from ..methods.diagonally_implicit import call_soften
from ..methods.explicit import call_error, call_norm
from ..methods.tolerances import SAME_TIME
from . import tolerances as limits
from .dense_output import evaluate


@kernel
def gets_on(r, t0, t1):
    """Whether a step from t0 to t1 is more than the rounding of t."""
    return t1 > t0 + limits.SHORTEST * max(abs(t0), limits.FROM_ZERO * (r.clock.t_end - r.clock.t_origin))


@kernel
def stretch(h, longest):
    """How much longer than h the last step of a run may be, so that no tiny one is left."""
    # Below max_step the last step may be a little longer; at max_step by rounding only
    if h < limits.AT_LONGEST * longest or longest == math.inf:
        return limits.STRETCH * h
    return max(longest - h, SAME_TIME * h)


@kernel
def first_step(context, w, r):
    """A first step from the sizes of y, y' and y'' (Hairer, Norsett, Wanner, Solving ODEs I, II.4)."""
    first = r.xd if r.numbers.first_order != 0 else r.y
    rtol, atol = r.clock.rtol, r.clock.atol
    n = w.q.size
    # d0 = |(q, qd)|, d1 = |(x', y')|
    d0 = 0.0
    for i in range(n):
        a, b = w.q[i] / (atol + rtol * abs(w.q[i])), w.qd[i] / (atol + rtol * abs(w.qd[i]))
        d0 += a * a + b * b
    d0 = math.sqrt(d0 / (2 * n))
    d1 = call_norm(r.kernels.error_norm, context, first, r.yd, r.now, rtol, atol)
    span = r.clock.t_end - r.clock.t
    h = min(
        limits.FIRST_ERROR * d0 / d1 if d1 * span > limits.TOO_SMALL and d0 > limits.TOO_SMALL else limits.TRIAL * span,
        limits.FIRST_PART * span,
    )
    # d2 = |(x'', y'')|, by an Euler step of h
    for i in range(r.x.size):
        r.xs[i] = r.x[i] + h * first[i]
    for i in range(r.y.size):
        r.ys[i] = r.y[i] + h * r.yd[i]
    if evaluate(context, w, r, r.clock.t + h, r.xs, r.ys, r.yds, r.dx) != 0:
        return h
    second = r.dx if r.numbers.first_order != 0 else r.ys
    for i in range(r.x.size):
        r.dx[i] = second[i] - first[i]
    for i in range(r.y.size):
        r.dy[i] = r.yds[i] - r.yd[i]
    d2 = call_norm(r.kernels.error_norm, context, r.dx, r.dy, r.now, rtol, atol) / h
    # h^(order + 1) max(d1, d2) = FIRST_ERROR
    size, most = max(d1, d2), limits.FIRST_GROWTH * h
    h = min(most, (limits.FIRST_ERROR / size) ** r.clock.exponent if size * span > limits.NO_SLOPE else most, span)
    return max(h, limits.FIRST_LEAST * span, limits.FIRST_SEEN * limits.SHORTEST * abs(r.clock.t))


@kernel
def _estimate(r, error, h, end):
    """One estimate of the error of the step h, in r.dx and r.dy."""
    call_error(error, h, r.x.size, r.y.size, end, r.yd, r.tableau, r.memory, r.dx, r.dy)


@kernel
def _size(context, r):
    """The estimate in r.dx and r.dy, over the tolerance."""
    return call_norm(r.kernels.error_norm, context, r.dx, r.dy, r.now, r.clock.rtol, r.clock.atol)


@kernel
def accept(context, linear, r, h):
    """Accept or reject the step h and choose the next one (Gustafsson's PI control). True if accepted."""
    end = r.xd if r.numbers.first_order != 0 else r.y
    # Error estimate, filtered by (I - g J)^-1 in stiff scenes
    _estimate(r, r.kernels.error, h, end)
    if linear.numbers.g > 0.0:
        call_soften(linear.kernels.soften, context, r.dx, linear.numbers.g, r.dy)
    error = _size(context, r)
    if r.kernels.second_error != 0:  # Hairer's combination of two orders; nan stays nan
        _estimate(r, r.kernels.second_error, h, end)
        second = _size(context, r)
        if error != 0.0:
            error *= error / math.hypot(error, limits.SECOND_ESTIMATE * second)
    # Rejected: h SAFETY error^-power, at least SHRINK h
    power = r.clock.exponent
    if not error <= 1.0:
        factor = limits.SAFETY * error**-power if error < math.inf else limits.SHRINK
        r.clock.h = h * max(factor, limits.SHRINK)
        r.numbers.rejected_last = 1
        return False
    # Accepted: PI control with the error before; no growth right after a rejection
    error = max(error, limits.LEAST_ERROR)
    factor = limits.SAFETY * error ** (-limits.PI_ERROR * power) * r.clock.error_before ** (limits.PI_BEFORE * power)
    factor = min(max(factor, limits.SHRINK), 1.0 if r.numbers.rejected_last != 0 else limits.GROW)
    # An unchanged step keeps the matrix
    if linear.numbers.g > 0.0 and limits.SAME_FROM <= factor <= limits.SAME_TO:
        factor = 1.0
    r.clock.error_before = max(error, limits.LEAST_BEFORE)
    r.clock.h = min(h * factor, r.clock.max_step)
    r.numbers.rejected_last = 0
    return True


@kernel
def watch_stiffness(bodies, w, r, h):
    """Whether the motion has just been found stiff: many steps at the method's limit of stability, or too many.

    h |lambda| from the last stage and the step's end, both at the same time (Hairer, Wanner, Solving ODEs II, IV.2).
    """
    n, at, limit = r.x.size, r.numbers.last_stage, r.clock.stability_limit
    end, rates, speeds = r.xd if r.numbers.first_order != 0 else r.y, 0.0, 0.0
    # Differences of the two last evaluations: |dvdd| / |dvd| estimates |lambda|
    for c in range(n):
        speed = r.memory[at + c] - end[c]
        speeds += speed * speed
    for c in range(r.y.size):
        rate = r.memory[at + n + c] - r.yd[c]
        rates += rate * rate
    found = False
    # At the limit of stability
    if h * h * rates > limit * limit * speeds:
        r.numbers.at_limit += 1
        r.numbers.below_limit = 0
        found = r.numbers.at_limit == limits.STIFF_STEPS
    # Below it for MILD_STEPS steps: forget
    elif r.numbers.at_limit > 0:
        r.numbers.below_limit += 1
        if r.numbers.below_limit == limits.MILD_STEPS:
            r.numbers.at_limit = 0
    # Short steps in which nothing moves are stiff, too
    if r.numbers.leave_when_stiff == 1 and h < limits.AT_LONGEST * r.clock.max_step:
        r.numbers.still = r.numbers.still + 1 if _hardly_moves(bodies, w, h) else 0
        if r.numbers.still == limits.STILL_STEPS:
            r.numbers.at_limit = max(r.numbers.at_limit, 1)
            found = True
    if found:
        r.numbers.stiff = 1
    return found


@kernel
def _hardly_moves(bodies, w, h):
    """Whether nothing turns or moves by more than HARDLY in a step of h."""
    far = limits.HARDLY * extent(w) / h
    for b in range(bodies.shape[0]):
        at = bodies[b, 0]
        # Displacement beside the size of the scene, rotation 2 |pd| h
        for c in range(3):
            if abs(w.qd[at + c]) > far:
                return False
        for c in range(3, bodies[b, 1]):
            if 2.0 * abs(w.qd[at + c]) * h > limits.HARDLY:
                return False
    return True
