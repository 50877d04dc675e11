"""The step kernel of diagonally implicit Runge-Kutta methods: first guesses of stages, Newton's iteration."""

import math

from ..errors import Status
from ..jit.kernels import ANY, callback, caller, kernel, stack, vector
from ..maths.dense_linalg import copy
from ..maths.tolerances import ROUNDING_AT_MOST
from ..workspaces import load, load_run
from . import tolerances as limits
from .explicit import ERROR, STEP, call_accelerate, call_norm, call_place, combine

# First guesses of the stages of a step, k_i = vdd, on the polynomial through stages that are known already.
#
# Known are the earlier stages of the step, and those of the step before on the same chart. The nearest in time are
# taken, as many as would have predicted the first implicit stage of the last step best: a stiff transient is no
# polynomial.
#
# The memory of it: t, h and the counter of charts of the last attempt; h of the step before, 0 where there is none; the
# number of points; then x'_i and y'_i of each stage of the step before.
#
# With friction velocities are predicted in place of accelerations: at rest they are smooth to a part of the slip
# velocity, and friction beyond it doesn't determine them.

T_LAST, H_LAST, CHART_LAST, STEP_BEFORE, POINTS, BEFORE = range(6)
LEAST_POINTS, MOST_POINTS = 2, 4


def prediction_memory(stages, size):
    """Floats of memory that predictions need, size being nx + ny."""
    return BEFORE + stages * size


@kernel
def begin_prediction(memory, own, stages, size, t, h, charts):
    """Keep the stages of the last attempt if it led to t; the ratio of their step to h, 0 where there are none.

    memory is that of the stages, of which stage i has (x'_i, y'_i) at (i + 1) size; own is that of predictions.
    """
    if own[CHART_LAST] != charts:
        own[STEP_BEFORE] = 0.0
    # The last attempt ended at t: its stages are those of the step before
    elif own[H_LAST] > 0.0 and abs(own[T_LAST] + own[H_LAST] - t) <= limits.SAME_TIME * h:
        own[STEP_BEFORE] = own[H_LAST]
        copy(memory[size:][: stages * size], own[BEFORE:])
    # Neither accepted nor repeated
    elif own[T_LAST] != t:
        own[STEP_BEFORE] = 0.0
    own[T_LAST], own[H_LAST], own[CHART_LAST] = t, h, charts
    return own[STEP_BEFORE] / h


@kernel
def predict(tableau, memory, own, i, ratio, points, size, part, k):  # nine: what is known, and what is asked for
    """y'_i (part nx) or x'_i (part 0) on the polynomial through the `points` nearest of the stages known.

    Of the step before, too, if ratio > 0.
    """
    n, stages = k.size, int(tableau[0])
    times, places = stack(MOST_POINTS), stack(MOST_POINTS)
    found, target = 0, _time(tableau, i)
    # Take the known times in order of their distance, in units of h from the start of this step
    while found < points:
        least, place, time = math.inf, -1, 0.0
        for j in range(i + (stages - 1 if ratio > 0.0 else 0)):
            # Stages of this step, then those of the step before, at (c_j - 1) ratio
            tau = _time(tableau, j) if j < i else (_time(tableau, j - i) - 1.0) * ratio
            distance = abs(tau - target)
            # Times that nearly coincide make Lagrange's weights large
            for m in range(found):
                if abs(tau - times[m]) <= (limits.APART_AT_LEAST * max(ratio, 1.0) if ratio > 0.0 else 0.0):
                    distance = math.inf
            if distance < least:
                least, place, time = distance, j, tau
        if place < 0:
            break
        times[found], places[found] = time, float(place)
        found += 1
    for e in range(n):
        k[e] = 0.0
    for m in range(found):
        # Lagrange's polynomial through them
        weight, source = 1.0, int(places[m])
        for l in range(found):
            if l != m:
                weight *= (target - times[l]) / (times[m] - times[l])
        known = memory[(source + 1) * size + part :] if source < i else own[BEFORE + (source - i) * size + part :]
        for e in range(n):
            k[e] += weight * known[e]


@kernel
def _time(tableau, i):
    """c_i."""
    return tableau[2 + i * (2 + int(tableau[0]))]


@kernel
def extrapolated(own, i):
    """The number of points for stage i: the last of a step are within the earlier ones, or close."""
    return min(max(int(own[POINTS]), LEAST_POINTS), MOST_POINTS) if i < LEAST_POINTS + 1 else MOST_POINTS


@kernel
def choose_points(tableau, memory, own, ratio, size, part, scratch):  # seven: as `predict`
    """Take the number of points that would have predicted the first implicit stage best; scratch is of n floats."""
    n, least = scratch.size, math.inf
    k = memory[2 * size + part :]
    # Squared error of the prediction from so many points
    for points in range(LEAST_POINTS, MOST_POINTS + 1):
        predict(tableau, memory, own, 1, ratio, points, size, part, scratch)
        off = 0.0
        for e in range(n):
            off += (k[e] - scratch[e]) * (k[e] - scratch[e])
        if off < least:
            least, own[POINTS] = off, float(points)


# The step kernel of diagonally implicit Runge-Kutta methods, and its Newton iteration.
#
# Stage i of (v, vd)' = (vd, f) has the unknown k_i = vdd there:
#
#     vd_i = vd + h sum_{j<i} a_ij k_j + g k_i,    v_i = v + h sum_{j<i} a_ij vd_j + g vd_i,    g = h a_ii
#     k_i <- k_i + P^-1 A (f(v_i, vd_i) - k_i),    P = A - g C_hat + g^2 K_hat  (linearisation.py)
#
# In a mixed system, (v, w)' = (vd(v, w), f(v, w)), vd_i is an unknown, too:
#
#     w_i = w + h sum_{j<i} a_ij k_j + g k_i
#     (vd_i, k_i) <- (vd_i, k_i) + (I - g J)^-1 ((vd, f)(v_i, w_i) - (vd_i, k_i))
#
# P is kept over iterations, stages and steps. On poor measured contraction it is rebuilt, first from the same stiffness
# and damping at the current configuration, then from new ones.
#
# The memory of a step, n = nx + ny floats each:  known part of (x_i, y_i);  (x', y') = (vd, k) of each stage;  then
# scratch, below, and what predictions of stages keep.

STAGE_FAILED, JAMMED = int(Status.STAGE_FAILED), int(Status.JAMMED)
SCRATCH = 5  # vectors of it, and a number
# (x', y') at the iterate, then what a correction changes of y_i; what it changes of x_i; x_i, and y_i unless it is x';
# (x', y') at the step before in this chart; the predicted ones of the stage; h before
RATES, MOVED, POINT, LAST, GUESS, H_BEFORE = range(6)

call_linearise = caller("pdp")
call_reduce = caller("pd")
call_solve = caller("pp")
call_soften = caller("ppdp")
call_recall = caller("ppp")
call_residual = caller("pddppp")
call_correct = caller("pdp", "d")


def memory_of(stages, nx, ny):
    """Floats of memory that `implicit_step` needs."""
    return (stages + 1 + SCRATCH) * (nx + ny) + 1 + prediction_memory(stages, nx + ny)


@kernel
def _scratch_at(r):
    """Where the scratch begins in the memory of a step."""
    return (int(r.tableau[0]) + 1) * (r.x.size + r.y.size)


@kernel
def _renew_matrix(context, c, t, g, f, renew, here):
    """P for a stage with accelerations f; with `renew` from new stiffness and damping. Status.

    With `here` those are reduced at the present configuration; otherwise K_hat and C_hat of the last P serve.
    """
    linear, status = c.linear, 0
    # Derivatives of the force laws
    if renew or linear.numbers.known == 0:
        status = call_linearise(linear.kernels.linearise, context, t, f)
        linear.numbers.known = 1 if status == 0 else 0
    if status == 0:
        # K_hat and C_hat at the present configuration; otherwise those of the last matrix
        if here or renew:
            call_reduce(linear.kernels.reduce, context, t)
        status = call_reduce(linear.kernels.factorise, context, g)
    linear.numbers.g, linear.numbers.slow = g if status == 0 else 0.0, 0.0
    linear.numbers.chart = c.work.counters.charts
    return status


@kernel
def _set_stage(g, known, xd, k, xs, ys):
    """y_i = y + g k, x_i = x + g x'; known is (x, y), the parts from earlier stages. x' may be y_i."""
    for c in range(ys.size):
        ys[c] = known[xs.size + c] + g * k[c]
    for c in range(xs.size):
        xs[c] = known[c] + g * xd[c]


@kernel
def _is_direct(c):
    """Whether the form solves a stage's equations for positions, velocities and reactions at the same time."""
    return c.linear.kernels.residual != 0


@kernel
def _evaluate(context, c, r, t, g, xs, ys, k, rates):  # nine: a stage and its equations
    """Evaluate the equations of a stage at (t, xs, ys) and k; rates = (x', y') there, if it needs them. Status."""
    # Positions, velocities, accelerations and reactions are unknowns together
    if _is_direct(c):
        return call_residual(c.linear.kernels.residual, context, t, g, xs, ys, k)
    # Otherwise rates are the right-hand side of the ODE
    status = call_place(r.kernels.place, context, t, xs)
    if status == 0:
        status = call_accelerate(r.kernels.accelerate, context, t, ys, rates[xs.size :], rates)
    return status


@kernel
def _correct(context, c, second, g, stage, rates, moved):
    """Correct k, and x' unless it is y_i (`second`); the size of what changes of x_i and y_i in the error norm."""
    linear, nx = c.linear, moved.size
    begin = nx if second else 0
    # By the saddle-point matrix
    if _is_direct(c):
        return call_correct(linear.kernels.correct, context, g, stage[nx:])
    # k += P^-1 A (f - k)
    for i in range(begin, stage.size):
        rates[i] -= stage[i]
    call_solve(linear.kernels.solve, context, rates[begin:])
    for i in range(begin, stage.size):
        stage[i] += rates[i]
        rates[i] *= g
    # y_i changes by g times the correction, x_i by g times that of x'
    for i in range(nx):
        moved[i] = g * rates[nx + i] if second else rates[i]
    rtol, atol = linear.numbers.rtol, linear.numbers.atol
    return call_norm(linear.kernels.error_norm, context, moved, rates[nx:], linear.now, rtol, atol)


@kernel
def _is_near(context, c, second, g, stage, guess, rates, moved):  # eight: as _correct, and the prediction
    """Return True if the positions of a solution are near to those of its prediction: another one may be far."""
    linear, nx = c.linear, moved.size
    for i in range(nx):
        moved[i] = g * g * (stage[nx + i] - guess[nx + i]) if second else g * (stage[i] - guess[i])
    for i in range(nx, stage.size):
        rates[i] = 0.0  # of velocities a stiff transient may change any amount
    norm = linear.kernels.distance if _is_direct(c) else linear.kernels.error_norm
    return call_norm(norm, context, moved, rates[nx:], linear.now, 1.0, 1.0) < limits.FAR_STAGE


@kernel
def _expected(numbers, size, adaptive):
    """Error expected after a first correction of this size: as last measured, growing with the square of the size."""
    # A first correction leaves an error in proportion to its square, as far as the matrix is exact
    share = max(1.0, size / numbers.first)
    return max(numbers.left * share * share, (limits.LEAST if adaptive else limits.LEAST_FIXED) * size)


@kernel
def _learn(numbers, first, second, renewed):
    """Store what a first correction has left, the size of the second; without a second one, let the old value grow.

    What a new matrix leaves in one stage doesn't predict the stages to come.
    """
    if renewed:
        numbers.left = math.inf
    elif second < math.inf:
        numbers.left = max(second, limits.FORGET * numbers.left if numbers.left < math.inf else 0.0)
        numbers.first = first
    else:
        numbers.left *= limits.AGEING


@kernel
def _begin_iteration(c, r):
    """Nothing is known of the contraction yet; limits of it for the form and the run."""
    numbers, one = c.linear.numbers, c.linear.iteration
    _restart(one)
    one.first, one.trusted, one.renewed, one.poor, one.diverged = 0.0, 1, 0, 0, 0
    one.floor = limits.RESIDUAL_FLOOR / (numbers.rtol + numbers.atol)
    # What stages of fixed steps leave adds up over thousands of steps
    one.limit = limits.SLOW_SPARSE if numbers.every_chart == 1 and r.numbers.adaptive == 1 else limits.SLOW_DENSE
    one.eager = 1 if numbers.eager > 0 else 0
    numbers.eager -= 1


@kernel
def _restart(one):
    """Measure contraction afresh: the matrix is new."""
    one.before, one.theta, one.measured, one.second = math.inf, limits.GUESS, 0, math.inf


@kernel
def _renew_if_needed(context, c, t, g, f):
    """Renew the iteration matrix if it is of another g or chart, or contracts poorly. Status."""
    numbers, one = c.linear.numbers, c.linear.iteration
    sparse, slips, eager = numbers.every_chart == 1, numbers.slips == 1, one.eager == 1
    one.eager = 0
    off_chart = not sparse and numbers.chart != c.work.counters.charts
    poor = one.measured == 1 and one.theta > max(one.limit, numbers.slow)
    stale = eager or off_chart or abs(g - numbers.g) > limits.SAME_STEP * g
    if not (stale or poor):
        return 0
    if not stale:
        # The first poor contraction: the stages to come begin with matrices of their own
        if one.poor == 0 and one.renewed == 0:
            lost = limits.EAGER_LOST if one.theta > limits.DIVERGING else limits.EAGER_SPARSE
            numbers.eager = lost if sparse else limits.EAGER_STAGES
        one.poor += 1
    # The last matrix of a stage has new stiffness and damping
    here = eager or poor or not sparse or numbers.g == 0.0 or numbers.known == 0
    one.renewed = 1
    status = _renew_matrix(context, c, t, g, f, slips or one.poor == limits.MATRICES, here)
    if status != 0:
        return status if status == JAMMED else STAGE_FAILED
    if not slips:  # where friction changes within a correction, Newton's own contraction counts
        _restart(one)
    if eager or poor or off_chart:
        one.trusted = 0
    return 0


@kernel
def _measure(c, size):
    """Contraction by the correction of this size; False if iterations diverge whatever the matrix."""
    numbers, one = c.linear.numbers, c.linear.iteration
    if not one.before < math.inf:
        return True
    if one.measured == 0:
        one.first, one.second = one.before, size
    one.theta, one.measured = size / one.before, 1
    # No other matrix contracts better: that much contraction has to do
    sparse, slips = numbers.every_chart == 1, numbers.slips == 1
    if sparse and not slips and one.poor == limits.MATRICES and numbers.slow == 0.0:
        numbers.slow = min(limits.WORSE_CONTRACTION * one.theta, limits.DIVERGING)
    one.diverged += 1 if one.renewed == 1 and one.theta > limits.DIVERGING else 0
    return one.diverged < (limits.APART_SLIPPING if slips else limits.APART)


@kernel
def _is_solved(c, size, adaptive, is_last):
    """Whether a stage needs no further correction after one of this size.

    The contraction of the last stage is always measured: where stiffness has gone, old matrices make corrections small.
    """
    numbers, one, theta = c.linear.numbers, c.linear.iteration, c.linear.iteration.theta
    # Rounding
    if size <= one.floor or (theta > limits.DIVERGING and size <= ROUNDING_AT_MOST * one.floor):
        return True
    # What is left: the sum of the corrections to come, or what first corrections have left before
    if numbers.slips == 1:
        theta = max(theta, limits.LEAST_SLIPPING)
    left = size * theta / (1.0 - theta) if theta < 1.0 else math.inf
    if one.trusted == 1 and one.measured == 0:
        left = min(left, _expected(numbers, size, adaptive))
    return left <= numbers.kappa and (one.measured == 1 or not is_last)


@kernel
def _solve_stage(context, c, r, i, t, g):
    """Solve stage i at time t: its (x', y') = (vd_i, k_i), predicted on entry. Status."""
    w, linear, nx, n, scratch = c.work, c.linear, r.x.size, r.x.size + r.y.size, r.memory[_scratch_at(r) :]
    known, stage, second = r.memory[:n], r.memory[(1 + i) * n :][:n], r.numbers.first_order == 0
    rates, moved, guess = scratch[:n], scratch[MOVED * n :][:nx], scratch[GUESS * n :][:n]
    xd, k, xs = stage[:nx], stage[nx:], scratch[POINT * n :][:nx]
    ys, adaptive = stage[:nx] if second else scratch[POINT * n + nx :][: n - nx], r.numbers.adaptive == 1
    copy(stage, guess)
    _begin_iteration(c, r)
    for _ in range(limits.ITERATIONS if adaptive else limits.FIXED_ITERATIONS):
        # The equations at x_i, y_i of the iterate
        _set_stage(g, known, xd, k, xs, ys)
        status = _evaluate(context, c, r, t, g, xs, ys, k, rates)
        if status != 0:
            return status
        w.counters.stage_iterations += 1
        # k += P^-1 A (f - k)
        status = _renew_if_needed(context, c, t, g, rates[nx:])
        if status != 0:
            return status
        size = _correct(context, c, second, g, stage, rates, moved)
        if not size < math.inf or not _measure(c, size):
            return STAGE_FAILED
        if _is_solved(c, size, adaptive, i + 1 == int(r.tableau[0])):
            _learn(linear.numbers, linear.iteration.first, linear.iteration.second, linear.iteration.renewed == 1)
            _set_stage(g, known, xd, k, xs, ys)
            return 0 if _is_near(context, c, second, g, stage, guess, rates, moved) else STAGE_FAILED
        linear.iteration.before = size
    return STAGE_FAILED


@kernel
def _see_step_before(context, linear, t, nx, n, scratch):
    """h of the step before, 0 where there is none, and (x', y') of its start in this chart."""
    # -inf: there is none
    h_before = t - linear.numbers.t_before if linear.numbers.t_before > -math.inf else 0.0
    scratch[H_BEFORE * n] = h_before
    if h_before > 0.0:
        call_recall(linear.kernels.recall, context, scratch[LAST * n :], scratch[LAST * n + nx :])
    return h_before


@callback(STEP)
def implicit_step(context, run, t, h):
    """One step of a method whose first stage is explicit; memory as of `memory_of`."""
    c, r = load(context), load_run(run)
    nx, ny, tableau, memory, scratch = r.x.size, r.y.size, r.tableau, r.memory, r.memory[_scratch_at(r) :]
    n, stages, second = nx + ny, int(tableau[0]), r.numbers.first_order == 0
    width = 2 + stages
    x, y, start, last = memory[:nx], memory[nx:n], memory[n : 2 * n], scratch[LAST * n :]
    # Predictions: polynomials through known stages, or at first the line through the step before
    h_before = _see_step_before(context, c.linear, t, nx, n, scratch)
    own = scratch[SCRATCH * n + 1 :]
    ratio = begin_prediction(memory, own, stages, n, t, h, float(c.work.counters.charts))
    part = 0 if second and c.linear.numbers.slips == 1 and ratio > 0.0 else nx
    copy(r.y if second else r.xd, start)
    copy(r.yd, start[nx:])
    for i in range(1, stages):
        # Stage i at t + c_i h
        row = tableau[1 + i * width :]
        stage, points = memory[(1 + i) * n :][:n], extrapolated(own, i)
        k = stage[nx:]
        # the prediction of k_i or vd_i, then the known parts of x_i and y_i
        predict(tableau, memory, own, i, ratio, points, n, part, k)
        if not second:
            predict(tableau, memory, own, i, ratio, points, n, 0, stage[:nx])
        combine(row[2:], i, h, n, memory, memory)
        # x + h sum_j a_ij x'_j,  y + h sum_j a_ij k_j, j < i
        for j in range(nx):
            x[j] += r.x[j]
        for j in range(ny):
            y[j] += r.y[j]
        # Predicted is vd_i; k_i follows
        if part == 0:
            for j in range(ny):
                k[j] = (k[j] - y[j]) / (h * row[2 + i])
        elif i == 1 and ratio == 0.0 and h_before > 0.0:  # along the line through the step before
            for j in range(nx if second else 0, n):
                stage[j] += row[1] * h / h_before * (start[j] - last[j])
        status = _solve_stage(context, c, r, i, t + h * row[1], h * row[2 + i])
        # u, z and lam of a failed stage are of no use
        if status != 0:
            c.linear.numbers.rates_of = 0
            return status
        # The first implicit stage says how many points predict best
        if i == 1 and ratio > 0.0:
            choose_points(tableau, memory, own, ratio, n, part, scratch[:ny])
    # Increments h sum_i b_i (x'_i, y'_i)
    combine(tableau[1 + stages * width :], stages, h, n, memory, memory)
    copy(x, r.dx)
    copy(y, r.dy)
    return 0


@callback(ERROR)
def trapezoid_error(h, nx, ny, y, yd, tableau, memory, ex, ey):  # nine: as plug-ins have it
    """The trapezoidal rule's -h^3 / 12 times the third derivatives of x and y, by differences over two steps.

    Where there is no step before, as if one as long had been without slope: more than the error of a short step.
    """
    n = nx + ny
    memory, ex, ey = vector(memory, ANY), vector(ex, nx), vector(ey, ny)
    before = memory[3 * n :]
    h_before = before[H_BEFORE * n]
    for part, out in ((0, ex), (nx, ey)):
        for c in range(out.size):
            # h^3 / 12 y''' from the values of y' at the starts of two steps and at the end of this one
            now, end, slope = memory[n + part + c], memory[2 * n + part + c], 0.0
            if h_before > 0.0:
                slope = (now - before[LAST * n + part + c]) / h_before
            out[c] = -h * h * ((end - now) - h * slope) / (6.0 * (h + (h_before if h_before > 0.0 else h)))
    return 0


def prepare_implicit(linear, method, addresses, every_chart, slips):
    """Give the step kernel its tolerances and the addresses that it calls, by name.

    every_chart: whether P serves every chart; slips: whether there is friction, to be resolved at rest.
    """
    numbers = linear.numbers
    numbers.every_chart = int(every_chart)
    numbers.rtol, numbers.atol = (limits.LEAST_LEFT, limits.LEAST_LEFT) if method.step else method.step_tolerances()
    numbers.slips = int(slips)
    numbers.kappa = limits.KAPPA_SPARSE if every_chart and not method.step else limits.KAPPA
    if slips:
        numbers.kappa = min(numbers.kappa, limits.LEAST_LEFT / (numbers.rtol + numbers.atol))
    numbers.left, numbers.first, numbers.t_before = math.inf, 1.0, -math.inf
    for name, address in addresses.items():
        setattr(linear.kernels, name, address)
