"""The step kernel of diagonally implicit Runge-Kutta methods, and its Newton iteration.

Stage i of (v, vd)' = (vd, f) has the unknown k_i = vdd there:

    vd_i = vd + h sum_{j<i} a_ij k_j + g k_i,    v_i = v + h sum_{j<i} a_ij vd_j + g vd_i,    g = h a_ii
    k_i <- k_i + P^-1 A (f(v_i, vd_i) - k_i),    P = A - g C_hat + g^2 K_hat  (linearisation.py)

P is kept over iterations, stages and steps. On poor measured contraction it is rebuilt, first from the same stiffness
and damping at the current configuration, then from new ones.
"""

import math

from ..errors import Status
from ..jit.kernels import ANY, callback, caller, kernel, vector
from ..maths.dense_linalg import copy, transposed_times
from ..workspaces.workspace import ROOM, load
from .explicit import ERROR, STEP, call_accelerate, call_norm, call_place, combine

STAGE_FAILED = int(Status.STAGE_FAILED)
ITERATIONS = 20
FAR = 0.1  # of the state's size: a solution further from its prediction may be another one
STAGES_EAGER = 30.0  # stages with a matrix of their own from the start, after an older one has failed
KAPPA = 0.001  # of what a step may be off by: what a stage's iteration may leave
SLOW = 0.1  # contraction above which the iteration matrix is made anew
GUESS, LEAST = 0.3, 0.02  # contraction taken for granted where none has been measured
DIVERGING = 0.9
TRIES = 3  # new matrices for one stage until stiffness and damping are made anew; diverging iterations until it fails
ROUNDING = 4e-15
# Linear.kernels
LINEARISE, REDUCE, FACTORISE, SOLVE, SOFTEN, COMPLETE, ERROR_NORM, KERNELS = range(8)
# Linear.numbers; CHART is the chart that P belongs to
RTOL, ATOL, G, CHART, KNOWN, THETA, T_BEFORE, EAGER, NUMBERS = range(9)

FIXED_TOL = 1e-12  # of the iteration, where no tolerance sets the step

assert max(KERNELS, NUMBERS) <= ROOM

call_linearise = caller("pd")
call_solve = caller("pp")
call_soften = caller("ppdp")


@kernel
def _matrix(context, w, l, t, g, f, anew):
    """P at the place last taken, f being the accelerations there; with anew, from new stiffness and damping. Status."""
    status = 0
    if anew or l.numbers[KNOWN] == 0.0:
        call_solve(l.kernels[COMPLETE], context, f)
        status = call_linearise(l.kernels[LINEARISE], context, t)
        l.numbers[KNOWN] = 1.0 if status == 0 else 0.0
    if status == 0:
        call_linearise(l.kernels[REDUCE], context, t)
        status = call_linearise(l.kernels[FACTORISE], context, g)
    l.numbers[G] = g if status == 0 else 0.0
    l.numbers[CHART] = w.counters.charts
    return status


@kernel
def _stage(context, place, accelerate, w, l, t, g, x, y, k, xs, ys, f, dx, guess):
    """Solve one stage: x, y are its known parts, k the unknown, predicted on entry. xs, ys at the solution. Status."""
    n = k.size
    copy(k, guess)
    floor = ROUNDING / (l.numbers[RTOL] + l.numbers[ATOL])
    before, theta, measured = math.inf, l.numbers[THETA], False
    slow, apart, stuck, renewed = 0, 0, False, False
    eager = l.numbers[EAGER] > 0.0
    l.numbers[EAGER] -= 1.0
    for _ in range(ITERATIONS):
        for c in range(n):
            ys[c] = y[c] + g * k[c]
            xs[c] = x[c] + g * ys[c]
        status = call_place(place, context, t, xs)
        if status == 0:
            status = call_accelerate(accelerate, context, t, ys, f, f)
        if status != 0:
            return status
        w.counters.stage_iterations += 1
        stale = eager or l.numbers[CHART] != w.counters.charts or abs(g - l.numbers[G]) > 0.3 * g
        eager = False
        if stale or (measured and theta > SLOW):
            if not stale:
                if slow == 0 and not renewed:
                    l.numbers[EAGER] = STAGES_EAGER
                slow += 1
            renewed = True
            if _matrix(context, w, l, t, g, f, slow == TRIES) != 0:
                return STAGE_FAILED
            before, theta, measured = math.inf, GUESS, False
        for c in range(n):
            f[c] -= k[c]
        call_solve(l.kernels[SOLVE], context, f)
        for c in range(n):
            k[c] += f[c]
            f[c] *= g
            dx[c] = g * f[c]
        size = call_norm(l.kernels[ERROR_NORM], context, dx, f, l.now, l.numbers[RTOL], l.numbers[ATOL])
        if not size < math.inf:
            return STAGE_FAILED
        if before < math.inf:
            theta, measured = size / before, True
            stuck = theta > DIVERGING and size <= 100.0 * floor  # this is rounding
            apart += 1 if renewed and theta > DIVERGING else 0
            if apart == TRIES:
                return STAGE_FAILED
        if size <= floor or stuck or (theta < 1.0 and size * theta <= KAPPA * (1.0 - theta)):
            l.numbers[THETA] = min(max(theta, LEAST), GUESS)
            for c in range(n):
                ys[c] = y[c] + g * k[c]
                xs[c] = x[c] + g * ys[c]
                f[c] = 0.0  # of velocities a stiff transient may change any amount
                dx[c] = g * g * (k[c] - guess[c])
            moved = call_norm(l.kernels[ERROR_NORM], context, dx, f, l.now, 1.0, 1.0)
            return 0 if moved < FAR else STAGE_FAILED
        before = size
    return STAGE_FAILED


@callback(STEP)
def implicit_step(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy):
    """One step of a method whose first stage is explicit; memory (stages + 1) 2n + 6n + 1."""
    data = load(context)
    w, l = data.work, data.linear
    n = nx
    x, y, yd, dx, dy = vector(x, n), vector(y, n), vector(yd, n), vector(dx, n), vector(dy, n)
    tableau, memory = vector(tableau, ANY), vector(memory, ANY)
    stages = int(tableau[0])
    width = 2 + stages
    predictor = tableau[1 + stages * width + stages + stages + 1 :]
    scratch = memory[(stages + 1) * 2 * n :]
    bx, by, f, low = memory[:n], memory[n : 2 * n], scratch[:n], scratch[n : 2 * n]
    first = scratch[5 * n + 1 : 6 * n + 1]
    xs, y_before, k_before = scratch[2 * n : 3 * n], scratch[3 * n : 4 * n], scratch[4 * n : 5 * n]
    h_before = t - l.numbers[T_BEFORE] if l.numbers[T_BEFORE] > -math.inf else 0.0
    scratch[5 * n] = h_before
    if h_before > 0.0:
        transposed_times(w.L, l.before[1], y_before)  # v = L^T (q - q0) wherever q is: the point before in this chart
        transposed_times(w.L, l.before[2], k_before)
    copy(y, memory[2 * n : 3 * n])
    copy(yd, memory[3 * n : 4 * n])
    for i in range(1, stages):
        row = tableau[1 + i * width :]
        ys, k = memory[(1 + i) * 2 * n :][:n], memory[(1 + i) * 2 * n + n :][:n]
        combine(predictor[i * stages :], i, 1.0, 2 * n, memory, memory)
        copy(by, k)
        combine(row[2:], i, h, 2 * n, memory, memory)
        for c in range(n):
            bx[c] += x[c]
            by[c] += y[c]
        if i == 1 and h_before > 0.0:  # along the line through the step before
            ratio = row[1] * h / h_before
            for c in range(n):
                k[c] += ratio * (yd[c] - k_before[c])
        status = _stage(
            context, place, accelerate, w, l, t + h * row[1], h * row[2 + i], bx, by, k, xs, ys, f, low, first
        )  # fmt: skip
        if status != 0:
            return status
    combine(tableau[1 + stages * width :], stages, h, 2 * n, memory, memory)
    copy(bx, dx)
    copy(by, dy)
    return 0


@callback(ERROR)
def trapezoid_error(h, nx, ny, y, yd, tableau, memory, ex, ey):
    """The trapezoidal rule's -h^3 / 12 times the third derivatives of v and vd, by differences over two steps.

    Where there is no step before, as if one as long had been without slope: more than the error of a short step.
    """
    n = nx
    memory, ex, ey = vector(memory, ANY), vector(ex, n), vector(ey, n)
    before = memory[6 * n :]
    h_before = before[5 * n]
    for c in range(n):
        for part, out in ((0, ex), (n, ey)):
            now, end, slope = memory[2 * n + part + c], memory[4 * n + part + c], 0.0
            if h_before > 0.0:
                slope = (now - before[3 * n + part + c]) / h_before
            out[c] = -h * h * ((end - now) - h * slope) / (6.0 * (h + (h_before if h_before > 0.0 else h)))
    return 0


def prepare_implicit(linear, method, addresses):
    """Give the step kernel its tolerances and the addresses it calls."""
    tolerances = (FIXED_TOL, FIXED_TOL) if method.step else method.step_tolerances()
    linear.numbers[[RTOL, ATOL, THETA, T_BEFORE]] = *tolerances, GUESS, -math.inf
    linear.kernels[:KERNELS] = addresses
