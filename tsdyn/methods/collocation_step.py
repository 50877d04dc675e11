"""The step kernel of collocation methods: Newton's method for all stages of a step at once.

    vd_i = vd + h sum_j a_ij k_j,    v_i = v + h sum_j a_ij vd_j,    k_i = f(t + c_i h, v_i, vd_i)

The iteration is that of formulations/collocation_stages.py. Its matrices are kept over iterations, steps and charts.
They are formed again where the step has changed by more than SAME_STEP, or contraction is poor: from the same stiffness
and damping; in the next step, or at once where iterations diverge, from those of the present configuration; then from
new derivatives of the forces' laws.

The first guess of a step is the polynomial through the last stages of the step before: as many as would have predicted
that step best.

The memory of a step, n floats each: known part of v_i, of vd_i; (vd, k) of the start and of each stage; change of the
last stage's positions, zeros; k of each stage of the step before; then the numbers below.
"""

import math

from ..errors import Status
from ..jit.kernels import callback, caller, kernel
from ..maths.dense_linalg import copy
from ..workspaces import load, load_run
from . import tolerances as limits
from .collocation import parts_of
from .diagonally_implicit import call_linearise, call_reduce, call_residual
from .explicit import STEP, call_norm, combine

STAGE_FAILED, JAMMED = int(Status.STAGE_FAILED), int(Status.JAMMED)
# start, step and chart of the last attempt; the step before, 0 if unknown; points of predictions; step of the matrices,
# 0 if there are none; 1 where stiffness is to be renewed; how many
T_LAST, H_LAST, CHART_LAST, H_BEFORE, POINTS, MADE_FOR, RENEW, OWN = range(8)

call_take = caller("pi")
call_balance = caller("pip")
call_factorise = caller("pdpi")
call_solve = caller("pdpp", "d")


def memory_of(stages, n):
    """Floats of memory that `collocation_step` needs."""
    return (2 + stages) * 2 * n + 2 * n + stages * n + OWN


@kernel
def _rest(r):
    """Where the memory behind that of the stages begins."""
    return 2 * (int(r.tableau[0]) + 1) * r.x.size


@kernel
def _keep_stages(c, r, own, t, h):
    """Keep the stages of the last attempt if it led to t; return whether there are stages to predict from."""
    s, n, charts = c.saddle, r.x.size, float(c.work.counters.charts)
    before = r.memory[_rest(r) + 2 * n :]
    # The last attempt ended at t: its stages are those of the step before. They serve on the same chart only
    if own[H_LAST] > 0.0 and abs(own[T_LAST] + own[H_LAST] - t) <= limits.SAME_TIME * h:
        own[H_BEFORE] = own[H_LAST] if own[CHART_LAST] == charts else 0.0
        for i in range(s.stages.shape[0]):
            copy(r.memory[(2 * i + 5) * n :][:n], before[i * n :])
            copy(s.stages[i], s.last[i])
    # Neither accepted nor repeated: the stages belong to another time
    elif own[T_LAST] != t or own[CHART_LAST] != charts:
        own[H_BEFORE] = 0.0
    own[T_LAST], own[H_LAST], own[CHART_LAST] = t, 0.0, charts
    return own[H_BEFORE] > 0.0


@kernel
def _weight(tableau, ratio, points, i, j):
    """Lagrange's weight at stage i of stage j of the step before, among the last `points` of its stages."""
    stages = int(tableau[0]) - 1
    # Times of the step before in units of its length: its stage j at c_j, stage i of this step at 1 + c_i / ratio
    width, target, weight = 3 + stages, 1.0 + tableau[2 + (i + 1) * (3 + stages)] / ratio, 1.0
    own = tableau[2 + (j + 1) * width]
    for l in range(stages - points, stages):
        if l != j:
            other = tableau[2 + (l + 1) * width]
            weight *= (target - other) / (own - other)
    return weight


@kernel
def _predict(c, r, own, h, known):
    """Set k, u, z and lam of every stage."""
    s, n, m, stages = c.saddle, r.x.size, c.saddle.z.size, c.saddle.stages.shape[0]
    before, ratio = r.memory[_rest(r) + 2 * n :], own[H_BEFORE] / h
    points = min(max(int(own[POINTS]), 1), stages)
    for i in range(stages):
        k = r.memory[(2 * i + 5) * n :][:n]
        # No polynomial: the accelerations of the step's start, u of the chart, no normal velocity
        if not known:
            copy(r.yd, k)
            copy(c.work.u, s.stages[i, :m])
            for e in range(m):
                s.stages[i, m + e] = 0.0
                s.stages[i, 2 * m + e] = s.last[stages - 1, 2 * m + e]
            continue
        # Lagrange's polynomial through the last stages of the step before
        for e in range(n):
            k[e] = 0.0
        for e in range(3 * m):
            s.stages[i, e] = 0.0
        for j in range(stages - points, stages):
            weight = _weight(r.tableau, ratio, points, i, j)
            for e in range(n):
                k[e] += weight * before[j * n + e]
            for e in range(3 * m):
                s.stages[i, e] += weight * s.last[j, e]


@kernel
def _choose_points(c, r, own, h):
    """Take the number of points that would have predicted the last stage best."""
    n, stages, least = r.x.size, c.saddle.stages.shape[0], math.inf
    before, ratio = r.memory[_rest(r) + 2 * n :], own[H_BEFORE] / h
    k = r.memory[(2 * stages + 3) * n :][:n]
    scratch = r.memory[:n]
    # Error of the prediction of the last stage from so many points
    for points in range(1, stages + 1):
        copy(k, scratch)
        for j in range(stages - points, stages):
            weight = _weight(r.tableau, ratio, points, stages - 1, j)
            for e in range(n):
                scratch[e] -= weight * before[j * n + e]
        off = 0.0
        for e in range(n):
            off += scratch[e] * scratch[e]
        if off < least:
            least, own[POINTS] = off, float(points)


@kernel
def _renew_matrices(context, c, r, own, t, h, level):
    """Factors for a step of h; level 1: from new stiffness and damping, level 2: from new derivatives, too. Status."""
    linear, status = c.linear, 0
    # Derivatives of the force laws
    if level > 1 or linear.numbers.known == 0:
        status = call_linearise(linear.kernels.linearise, context, t, r.yd)
        linear.numbers.known = 1 if status == 0 else 0
        level = 2
    # Stiffness and damping at the present configuration
    if status == 0 and level > 0:
        call_reduce(linear.kernels.reduce, context, t)
    # Factors for every eigenvalue, at g = h times the eigenvalue
    for i in range(c.saddle.complex_upper.shape[0] + 1):
        if status == 0:
            status = call_factorise(linear.kernels.factorise_stages, context, h, r.tableau, i)
    own[MADE_FOR] = h if status == 0 else 0.0
    own[RENEW] = 0.0
    linear.numbers.g = h * r.tableau[parts_of(r.tableau).shifts] if status == 0 else 0.0
    return status


@kernel
def _set_rates(r, h):
    """vd of every stage from k."""
    n, stages = r.x.size, int(r.tableau[0]) - 1
    # vd_i = vd + h sum_j a_ij k_j
    for i in range(stages):
        combine(r.tableau[1 + (i + 1) * (3 + stages) + 2 :], stages + 1, h, 2 * n, r.memory, r.memory)
        vd = r.memory[(2 * i + 4) * n : (2 * i + 5) * n]
        for e in range(n):
            vd[e] = r.y[e] + r.memory[n + e]


@kernel
def _sweep(context, c, r, own, t, h, level):  # seven: as _renew_matrices
    """Evaluate the equations of all stages; with level >= 0, matrices are renewed at the middle one. Status."""
    linear, w, n, stages = c.linear, c.work, r.x.size, c.saddle.stages.shape[0]
    width, x = 3 + stages, r.memory[:n]
    _set_rates(r, h)
    for i in range(stages):
        # v_i = v + h sum_j a_ij vd_j
        row, k = r.tableau[1 + (i + 1) * width :], r.memory[(2 * i + 5) * n :][:n]
        combine(row[2:], stages + 1, h, 2 * n, r.memory, r.memory)
        for e in range(n):
            x[e] += r.x[e]
        ti = t + h * row[1]
        # u, z and lam of this stage are where its solves begin
        call_take(linear.kernels.take_stage, context, i)
        linear.numbers.rates_of, linear.numbers.time = w.counters.charts, ti  # as if it had begun already
        vd = r.memory[(2 * i + 4) * n : (2 * i + 5) * n]
        # Loads and residuals of the equations at the stage
        status = call_residual(
            linear.kernels.residual, context, ti, h * r.tableau[parts_of(r.tableau).shifts], x, vd, k
        )
        if status != 0:
            return status
        w.counters.stage_iterations += 1
        # The middle stage stands for the step
        if level >= 0 and i == stages // 2:
            status = _renew_matrices(context, c, r, own, ti, h, level)
            if status != 0:
                return status if status == JAMMED else STAGE_FAILED
        # Right-hand side of Newton's equations
        status = call_balance(linear.kernels.balance_stage, context, i, k)
        if status != 0:
            return STAGE_FAILED
    return 0


@kernel
def _iterate(context, c, r, own, t, h):
    """Newton's method for the stages, predicted on entry. Status."""
    linear, s, n, numbers = c.linear, c.saddle, r.x.size, c.linear.numbers
    moved, zeros, adaptive = r.memory[_rest(r) :][:n], r.memory[_rest(r) + n :][:n], r.numbers.adaptive == 1
    # Sizes of corrections are error norms: rounding of 1 + |value| is RESIDUAL_FLOOR / tol
    tol = numbers.rtol + numbers.atol
    floor, stalled, kappa = limits.RESIDUAL_FLOOR / tol, limits.STALLED_CORRECTION / tol, numbers.kappa
    for e in range(n):
        moved[e] = zeros[e] = 0.0
    before, theta, rate, renewals, fresh, newest = math.inf, 0.0, 1.0, 0, False, False
    # Matrices of nearly the same step are kept
    level = -1 if abs(h - own[MADE_FOR]) <= limits.SAME_STEP * h else 0
    if own[RENEW] > 0.0 or own[MADE_FOR] == 0.0 or numbers.known == 0:
        level = 1
    most = limits.COUPLED_ITERATIONS if adaptive else limits.FIXED_ITERATIONS
    for left in range(most - 1, -1, -1):
        # Equations of all stages, then one correction of all of them
        status = _sweep(context, c, r, own, t, h, level)
        if status != 0:  # where a joint jams, iterates leave the chart
            return STAGE_FAILED if numbers.slips == 1 and before < math.inf and status != JAMMED else status
        fresh, newest = fresh or level > 0, newest or level > 1
        # A new matrix: contraction is measured afresh
        if level >= 0:
            before, renewals = math.inf, renewals + 1
        level = -1
        size = call_solve(linear.kernels.solve_stages, context, h, r.tableau, r.memory)
        if not size < math.inf:
            return STAGE_FAILED
        # How far the last stage is from its prediction
        for e in range(n):
            moved[e] += s.e[e]
        if before < math.inf:
            # Contraction
            rate = size / before
            if rate > limits.TRUSTED and size <= stalled:  # rounding of large forces
                floor = stalled
            else:
                theta = max(theta, rate)
            # Diverging, or too slow for the iterations that are left: renew the matrices, next time with new
            # derivatives
            late = rate > limits.DIVERGING or size * rate**left > kappa * (1.0 - rate)
            if size > floor and (late or (rate > limits.TRUSTED and not newest)):
                if renewals == limits.MATRICES:
                    return STAGE_FAILED
                level = 2 if fresh else 1
        # a joint at rest may contract by 0.9, hidden behind bodies that contract by 1e-7
        sure = max(rate, limits.LEAST_SLIPPING) if numbers.slips == 1 else rate
        # small corrections say nothing by themselves: where stiffness has gone, old matrices make them so
        if size <= floor or (before < math.inf and level < 0 and size * sure <= kappa * (1.0 - sure)):
            # Solved. Slow contraction renews the matrices of the next step
            own[RENEW] = 1.0 if theta > limits.SLOW_COUPLED else 0.0
            if (
                adaptive
                and not call_norm(linear.kernels.distance, context, moved, zeros, linear.now, 1.0, 1.0)
                < limits.FAR_STAGE
            ):
                return STAGE_FAILED
            return 0
        before = size
    return STAGE_FAILED


@callback(STEP)
def collocation_step(context, run, t, h):
    """One step of a collocation method; memory as of `memory_of`."""
    c, r = load(context), load_run(run)
    n, stages = r.x.size, c.saddle.stages.shape[0]
    # Stage 0 is the start of the step
    own = r.memory[_rest(r) + (2 + stages) * n :]
    copy(r.y, r.memory[2 * n : 3 * n])
    known = _keep_stages(c, r, own, t, h)
    copy(r.yd, r.memory[3 * n : 4 * n])
    _predict(c, r, own, h, known)
    status = _iterate(context, c, r, own, t, h)
    # The step will be repeated with new matrices
    if status != 0:
        own[RENEW] = 1.0
        return status
    if known:
        _choose_points(c, r, own, h)
    own[H_LAST] = h
    # Increments of the last stage, which is the end of the step
    _set_rates(r, h)
    combine(r.tableau[1 + stages * (3 + stages) + 2 :], stages + 1, h, 2 * n, r.memory, r.memory)
    copy(r.memory[:n], r.dx)
    copy(r.memory[n : 2 * n], r.dy)
    return 0
