"""Step-size control: the initial step, acceptance and rejection, stiffness detection."""

import math

from ..jit.kernels import kernel
from ..methods.diagonally_implicit import SOFTEN, G, call_soften
from ..methods.explicit import call_error, call_norm
from .run_state import (
    AT_LIMIT,
    ATOL,
    BELOW_LIMIT,
    ERROR_BEFORE,
    EXPONENT,
    FIRST_ORDER,
    LAST_STAGE,
    MAX_STEP,
    REJECTED_LAST,
    RTOL,
    STABLE,
    STIFF,
    T_END,
    T_ORIGIN,
    H,
    T,
)
from .trajectory import A_ERROR, A_ERROR_2, A_NORM, evaluate

SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0
SHORTEST = 4e-16  # of t, two units in the last place; of t = 0, of a thousandth of the interval
STIFF_STEPS, MILD_STEPS = 15, 6  # at the limit of stability until a motion is called stiff; below it until forgotten


@kernel
def gets_on(r, t0, t1):
    """Whether a step from t0 to t1 is more than the rounding of t."""
    return t1 > t0 + SHORTEST * max(abs(t0), 1e-3 * (r.clock[T_END] - r.clock[T_ORIGIN]))


@kernel
def stretch(h, longest):
    """How much longer than h the last step of a run may be, so that no tiny one is left."""
    if h < 0.999 * longest or longest == math.inf:
        return 1e-3 * h
    return max(longest - h, 1e-9 * h)


@kernel
def first_step(context, w, r, at):
    """A first step from the sizes of y, y' and y'' (Hairer, Norsett, Wanner, Solving ODEs I, II.4)."""
    first = r.xd if r.numbers[FIRST_ORDER] == 1 else r.y
    rtol, atol = r.clock[RTOL], r.clock[ATOL]
    n = w.q.size
    d0 = 0.0
    for i in range(n):
        a, b = w.q[i] / (atol + rtol * abs(w.q[i])), w.qd[i] / (atol + rtol * abs(w.qd[i]))
        d0 += a * a + b * b
    d0 = math.sqrt(d0 / (2 * n))
    d1 = call_norm(at[A_NORM], context, first, r.yd, r.now, rtol, atol)
    span = r.clock[T_END] - r.clock[T]
    h = min(0.01 * d0 / d1 if d1 > 1e-5 and d0 > 1e-5 else 1e-6, 0.1 * span)
    for i in range(r.x.size):
        r.xs[i] = r.x[i] + h * first[i]
    for i in range(r.y.size):
        r.ys[i] = r.y[i] + h * r.yd[i]
    if evaluate(context, w, at, r.clock[T] + h, r.xs, r.ys, r.yds, r.dx) != 0:
        return h
    second = r.dx if r.numbers[FIRST_ORDER] == 1 else r.ys
    for i in range(r.x.size):
        r.dx[i] = second[i] - first[i]
    for i in range(r.y.size):
        r.dy[i] = r.yds[i] - r.yd[i]
    d2 = call_norm(at[A_NORM], context, r.dx, r.dy, r.now, rtol, atol) / h
    size = max(d1, d2)
    return min(100.0 * h, (0.01 / size) ** r.clock[EXPONENT] if size > 1e-15 else 100.0 * h, span)


@kernel
def accept(context, l, r, at, h):
    """Judge the step h just made and choose the next (Gustafsson's PI control). Whether it is accepted."""
    end = r.xd if r.numbers[FIRST_ORDER] == 1 else r.y
    call_error(at[A_ERROR], h, r.x.size, r.y.size, end, r.yd, r.tableau, r.memory, r.dx, r.dy)
    if l.numbers[G] > 0.0:
        call_soften(l.kernels[SOFTEN], context, r.dx, l.numbers[G], r.dy)
    error = call_norm(at[A_NORM], context, r.dx, r.dy, r.now, r.clock[RTOL], r.clock[ATOL])
    if at[A_ERROR_2] != 0:  # Hairer's combination of two orders; nan stays nan
        call_error(at[A_ERROR_2], h, r.x.size, r.y.size, end, r.yd, r.tableau, r.memory, r.dx, r.dy)
        second = call_norm(at[A_NORM], context, r.dx, r.dy, r.now, r.clock[RTOL], r.clock[ATOL])
        if error != 0.0:
            error *= error / math.hypot(error, 0.1 * second)
    power = r.clock[EXPONENT]
    if not error <= 1.0:
        factor = SAFETY * error**-power if error < math.inf else SHRINK
        r.clock[H] = h * max(factor, SHRINK)
        r.numbers[REJECTED_LAST] = 1
        return False
    error = max(error, 1e-10)
    factor = SAFETY * error ** (-0.7 * power) * r.clock[ERROR_BEFORE] ** (0.4 * power)
    factor = min(max(factor, SHRINK), 1.0 if r.numbers[REJECTED_LAST] != 0 else GROW)
    r.clock[ERROR_BEFORE] = max(error, 1e-4)
    r.clock[H] = min(h * factor, r.clock[MAX_STEP])
    r.numbers[REJECTED_LAST] = 0
    return True


@kernel
def watch_stiffness(r, h):
    """Whether the motion has just been found stiff: many steps at the method's limit of stability.

    h |lambda| from the last stage and the step's end, both at the same time (Hairer, Wanner, Solving ODEs II, IV.2).
    """
    n, at = r.x.size, r.numbers[LAST_STAGE]
    rates, speeds = 0.0, 0.0
    for c in range(n):
        speed, rate = r.memory[at + c] - r.y[c], r.memory[at + n + c] - r.yd[c]
        speeds += speed * speed
        rates += rate * rate
    if h * h * rates > r.clock[STABLE] * r.clock[STABLE] * speeds:
        r.numbers[AT_LIMIT] += 1
        r.numbers[BELOW_LIMIT] = 0
        if r.numbers[AT_LIMIT] == STIFF_STEPS:
            r.numbers[STIFF] = 1
            return True
    elif r.numbers[AT_LIMIT] > 0:
        r.numbers[BELOW_LIMIT] += 1
        if r.numbers[BELOW_LIMIT] == MILD_STEPS:
            r.numbers[AT_LIMIT] = 0
    return False
