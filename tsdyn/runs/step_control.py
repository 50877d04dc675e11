"""Step-size control: initial step, acceptance and rejection, stiffness, loads between the stages of a step."""

import math

from ..elements.loops.coordinate_rows import call_kind
from ..formulations.charts import extent
from ..jit.kernels import callback, caller, kernel, stack
from ..maths.tolerances import PIVOT_ROUNDING
from ..methods.diagonally_implicit import call_soften
from ..methods.explicit import call_error, call_norm
from ..methods.interpolants import quintic
from ..methods.tolerances import SAME_TIME
from ..model.equations import set_time
from ..motions.tolerances import SAMPLES
from ..workspaces import load, load_run
from . import tolerances as limits
from .dense_output import evaluate
from .tolerances import DISTINCT, IMPLICIT_PLACES, LEAST_PLACES


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


# The time scale of the motion: an error shows that it has changed after a step that was too long, accelerations before.
#
#     h <- h (a0 / a1)^s,      a0, a1 = |qdd| at both ends of a step
#
# Where a path is run through twice as fast, accelerations are four times as large: s = 1/2. A linear spring changes
# accelerations, but not the time scale: s = 0. So s is fitted to the steps of the run, by least squares:
#
#     log H_i - log H_(i-1) = s log(a0 / a1)_(i-1),      H = h e^(-1/k) the step with an error e of the tolerance


@kernel
def _change_of_scale(w, r, h, error):
    """Return (a0 / a1)^s of an accepted step h; 1 for implicit methods, since stiff accelerations don't show it."""
    clock = r.clock
    if r.numbers.stage_at > 0:
        return 1.0
    # The change of H that this step shows
    ideal, known = math.log(h) - clock.exponent * math.log(error), clock.acceleration > 0.0
    if known:
        clock.along = limits.FADING * clock.along + clock.change * (ideal - clock.ideal)
        clock.square = limits.FADING * clock.square + clock.change * clock.change
    before, after = clock.acceleration if known else _length(r.now[2]), _length(w.qdd)
    clock.acceleration, clock.ideal, clock.change = after, ideal, 0.0
    if after < limits.JUMP * before and before < limits.JUMP * after:
        clock.change = math.log(before / after)
    s = (clock.along + limits.SCALE * limits.LEARNED) / (clock.square + limits.LEARNED)
    return math.exp(min(max(s, 0.0), limits.STEEPEST) * clock.change)


@kernel
def forget_scale(r):
    """Leave the next step out of the fit, since accelerations have changed before it."""
    r.clock.acceleration = 0.0


@kernel
def _length(x):
    """|x|."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * x[i]
    return math.sqrt(total)


@kernel
def accept(context, c, r, h):
    """Accept or reject the step h and choose the next one (Gustafsson's PI control). True if accepted."""
    linear = c.linear
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
    # Accepted: PI control with the error before, and the time scale; no growth right after a rejection
    error = max(error, limits.LEAST_ERROR)
    factor = limits.SAFETY * error ** (-limits.PI_ERROR * power) * r.clock.error_before ** (limits.PI_BEFORE * power)
    factor *= _change_of_scale(c.work, r, h, error)
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


# Loads along the path of a step: what a user's function of the state does between the stages.
#
# A method sees the loads at its stages, and flies over a bump, a notch or a wall between them. So the loads that users
# have written are sampled along the quintic Hermite polynomial of the ends of a step, as densely as functions of time
# are (motions/knots.py). Eighth differences of the samples, and of each 4th, 16th and 64th of them, must be those of a
# load that a step as long resolves:
#
#     |d| <= max(DISTINCT (atol + rtol |qd|) / (s dt), (atol + rtol) |f|)     s dt: between the samples of a difference
#
# f is the sum of what the loads accelerate all coordinates by. A step with larger ones is rejected, and the next one
# ends before them. Steps of less than the distance of samples of functions of time are left alone.

WATCH = "ppdd"
ORDER = 8  # of the differences
ROOM = SAMPLES + 2
call_watch = caller(WATCH, "d")


@kernel
def _gather(s, r, q, qd, qdd, d, weights):
    """d (6, k): q, qd, qdd at both ends of the step, of all coordinates that loads act on; their weights.

    Weights 1 + 0.37 j: loads that cancel in a plain sum, such as those on both ends of a spring, don't. Those of Euler
    parameters are of angular accelerations. Returns the largest rate at the ends.
    """
    k, j, speed = weights.size, 0, 0.0
    for i in range(r.loaded.size):
        b = r.loaded[i]
        at, size = s.bodies[b, 0], s.bodies[b, 1]
        trace = s.inertia[b, 0] + s.inertia[b, 4] + s.inertia[b, 8] if size == 7 else 0.0
        for part in range(size):
            c = at + part
            for level in range(3):
                d[level * k + j] = r.now[level, c]
            d[3 * k + j], d[4 * k + j], d[5 * k + j] = q[c], qd[c], qdd[c]
            speed = max(speed, abs(r.now[1, c]), abs(qd[c]))
            per_load = 1.0 / s.mass[b] if part < 3 else (1.5 / trace if trace > 0.0 else 0.0)
            weights[j] = (1.0 + 0.37 * j) * per_load
            j += 1
    return speed


@kernel
def _sample(s, r, h, t0, places, d, weights, f):
    """f (places + 1,): the weighted sum of the loads at so many places of the step, equally far apart. The largest."""
    n, k, largest = r.now.shape[1], weights.size, 0.0
    x, xd = r.path[7 * k : 8 * k], r.path[8 * k : 9 * k]
    Q, q, qd = r.path[9 * k : 9 * k + n], r.path[9 * k + n : 9 * k + 2 * n], r.path[9 * k + 2 * n :]
    for place in range(places + 1):
        # Quintic Hermite polynomial of the coordinates of loaded bodies, at t0 + share h
        share = place / places
        quintic(share, h, k, d, x, xd)
        j = 0
        for i in range(r.loaded.size):
            at, size = s.bodies[r.loaded[i], 0], s.bodies[r.loaded[i], 1]
            for c in range(at, at + size):
                q[c], qd[c] = x[j], xd[j]
                j += 1
        set_time(s, t0 + share * h)
        # Q: generalised forces of the watched loads
        for i in range(r.watched.size):
            kind = s.forces[r.watched[i]]
            table, reals = s.table[kind.table :], s.reals[kind.reals :]
            call_kind(kind.force, kind.count, kind.stride, table, reals, q, qd, t0 + share * h, Q)
        # f = sum_c weights_c Q_c
        total, j = 0.0, 0
        for i in range(r.loaded.size):
            at, size = s.bodies[r.loaded[i], 0], s.bodies[r.loaded[i], 1]
            for c in range(at, at + size):
                total += weights[j] * Q[c]
                Q[c] = 0.0
                j += 1
        f[place] = total
        largest = max(largest, abs(total))
    return largest


@kernel
def _first_large(f, places, stride, limit):
    """Where the first difference begins that is above the limit, or not a number; -1 for none."""
    s = stride
    for i in range(0, places - ORDER * s + 1, s):
        outer = f[i] + f[i + 8 * s] - 8.0 * (f[i + s] + f[i + 7 * s]) + 28.0 * (f[i + 2 * s] + f[i + 6 * s])
        d = outer - 56.0 * (f[i + 3 * s] + f[i + 5 * s]) + 70.0 * f[i + 4 * s]
        if not abs(d) <= limit:
            return i
    return -1


@callback(WATCH, "d")
def watch(context, run, t1, h):
    """The share of a step of h that ends at t1 up to which its stages see its loads; 1 for all of it."""
    c, r = load(context), load_run(run)
    density, k = SAMPLES * h / (r.clock.t_end - r.clock.t_origin), 0
    if density < 1.0:
        return 1.0
    for i in range(r.loaded.size):
        k += c.system.bodies[r.loaded[i], 1]
    f, d, weights = stack(ROOM), r.path[: 6 * k], r.path[6 * k : 7 * k]
    tol = r.clock.atol + r.clock.rtol * _gather(c.system, r, c.work.q, c.work.qd, c.work.qdd, d, weights)
    places = min(max(IMPLICIT_PLACES if r.numbers.stage_at > 0 else LEAST_PLACES, math.ceil(density)), ROOM - 1)
    noise = max(PIVOT_ROUNDING, r.clock.atol + r.clock.rtol)
    noise *= _sample(c.system, r, h, t1 - h, places, d, weights, f)
    set_time(c.system, t1)
    stride = 1
    while ORDER * stride <= places:
        first = _first_large(f, places, stride, max(DISTINCT * tol * places / (stride * h), noise))
        if first >= 0:
            return (first + (ORDER - 1) * stride if first > 0 else stride) / places
        stride *= 4
    return 1.0
