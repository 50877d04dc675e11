"""The driver of the Taylor integrator: series, step length, landing. One kernel for every scene.

Each step is a chart of its own: the series gives q and qd at its end up to the truncation error, and landing puts both
back on the manifold along W Phi_q^T.
"""

import math
from typing import NamedTuple

import numpy as np

from ._kernel import entry, kernel
from .assembly import remember, set_time
from .chart import AT_START, BY_SERIES
from .dense import B_CHART, B_DATA, B_END, B_H, B_START
from .errors import Status
from .expansion import begin, expand, run_loops
from .free import RESIDUAL, Free
from .free_accelerations import accelerate_bodies
from .landing import land, land_velocities, sum_series
from .linalg import copy
from .network import Network
from .outputs import record, store_now
from .poses import move_bodies, place_bodies, write_accelerations, write_positions, write_velocities
from .run_state import (
    BEGUN,
    BLOCKS,
    CHART_ROWS,
    DENSE,
    HISTORY,
    NEXT_EVAL,
    REJECTED,
    RTOL,
    ATOL,
    MAX_STEP,
    STEPS,
    STORED,
    T_END,
    T_ORIGIN,
    H,
    T,
)
from .series_loops import BODY_ROW, S_OMEGA, S_R, UPDATE
from .system import System
from .workspace import CHARTS, EVALUATIONS, Work

SLICE_DONE, STEP_COLLAPSED = int(Status.SLICE_DONE), int(Status.STEP_COLLAPSED)
NOT_FINITE = int(Status.NOT_FINITE)
MISSED = 100.0  # times the tolerance: a landing further away than this is no truncation error


class Expansion(NamedTuple):
    """The series of a step; orders is what fits, from zero to two above the order of the method."""

    order: np.ndarray  # int64 (2,): that of omega' and of the estimates; orders of each series
    bodies: np.ndarray  # (b + 1, orders, 24)  see series_loops
    constraints: np.ndarray  # each kind's instances; series_loops.series
    places: np.ndarray  # int64 (kinds, 2): addresses of the loops; where a kind's series begin
    forces: np.ndarray  # int64 (kinds, 6): address, where its series begin, instances, reals each, first in table, in reals
    table: np.ndarray  # int64: the bodies of each force
    loads: np.ndarray  # each kind of force's instances


class TaylorContext(NamedTuple):
    """All that the driver's kernels use."""

    system: System
    work: Work
    network: Network
    free: Free
    expansion: Expansion


@kernel
def _begin_series(c, t):
    """Orders up to one of omega' and two of r, at the poses; qdd from them."""
    w, x, f = c.work, c.expansion, c.free
    orders = x.order[1]
    begin(c.network, f.poses, orders, x.bodies)
    run_loops(c.network, c.system.reals, UPDATE, 0, orders, x.bodies, x.constraints, x.places, f.b, f.Z)
    run_loops(c.network, c.system.reals, UPDATE, 1, orders, x.bodies, x.constraints, x.places, f.b, f.Z)
    expand(c.network, c.system, 0, orders, x, f)
    for b in range(c.network.bodies.shape[0]):
        at = b * orders * BODY_ROW
        for i in range(3):
            f.Z[8 * b + i] = 2.0 * x.bodies[at + S_R * orders + 8 + i]
            f.Z[8 * b + 4 + i] = x.bodies[at + S_OMEGA * orders + 4 + i]
    write_accelerations(c.network.bodies, f.poses, f.Z, w.qdd)


@kernel
def _land_here(c, t):
    """Put the poses and their velocities on the manifold, and write q and qd. Status."""
    w, f = c.work, c.free
    status = land(c.network, c.system, w, f, t)
    if status == 0:
        land_velocities(c.network, f)
        write_positions(c.network.bodies, f.poses, w.q)
        write_velocities(c.network.bodies, f.poses, w.qd)
        total = 0.0
        for i in range(w.q.size):
            total += abs(w.q[i]) + abs(w.qd[i])
        if not total < math.inf:
            return NOT_FINITE
    return status


@kernel
def state_within(c, h, t):
    """q, qd, qdd at h after the series' origin, t being the time there. Status."""
    sum_series(c.network, c.expansion.bodies, c.expansion.order[1], c.expansion.order[0], h, c.free.poses, c.free.p)
    status = _land_here(c, t)
    if status == 0:
        accelerate_bodies(c.network, c.system, c.work, c.free, t)
    return status


@kernel
def _size(bodies, nb, orders, k, scale):
    """The largest coefficient k of r and A, and k - 1 of omega', each over what is tolerated of it."""
    worst = 0.0
    for b in range(nb):
        at = b * orders * BODY_ROW
        turn = 0.0
        for i in range(12):
            turn = max(turn, abs(bodies[at + 12 * k + i]))
        for i in range(3):
            worst = max(worst, abs(bodies[at + S_R * orders + 4 * k + i]) / scale[0])
            worst = max(worst, abs(bodies[at + S_OMEGA * orders + 4 * (k - 1) + i]) / scale[2])
        worst = max(worst, turn / scale[1])
    return worst


@kernel
def _step_length(c, r):
    """From the last two coefficients (Jorba, Zou, Experiment. Math. 14, 2005, section 3), each over its tolerance."""
    x, nb = c.expansion, c.network.bodies.shape[0]
    top, orders = x.order[0], x.order[1]
    rtol, atol = r.clock[RTOL], r.clock[ATOL]
    scale = c.free.p
    far, fast = 0.0, 0.0
    for b in range(nb):
        at = b * orders * BODY_ROW
        for i in range(3):
            far = max(far, abs(x.bodies[at + S_R * orders + i]))
            fast = max(fast, abs(x.bodies[at + S_OMEGA * orders + i]))
    scale[0], scale[1], scale[2] = atol + rtol * far, atol + rtol, atol + rtol * fast
    last, before = _size(x.bodies, nb, orders, top + 1, scale), _size(x.bodies, nb, orders, top, scale)
    if not (last < math.inf and before < math.inf):
        return 0.0
    h = math.inf
    if last > 0.0:
        h = last ** (-1.0 / (top + 1))
    if before > 0.0:
        h = min(h, before ** (-1.0 / top))
    return h


@kernel
def _store_block(c, r, t0, h, t1):
    block = r.block
    block[B_START], block[B_H], block[B_END], block[B_CHART] = t0, h, t1, r.numbers[CHART_ROWS]
    copy(c.expansion.bodies, block[B_DATA:])
    copy(r.remembered, block[block.size - r.remembered.size :])
    if r.numbers[DENSE] == STORED:
        copy(block, r.blocks[r.numbers[BLOCKS]])
        r.numbers[BLOCKS] += 1


@kernel
def _accept(c, r, t):
    """The poses as they are now are the state at t. Status."""
    w = c.work
    remember(c.system, w.q, w.qd, t, r.remembered)
    _begin_series(c, t)
    total = 0.0
    for i in range(w.q.size):
        total += abs(w.qdd[i])
    if not total < math.inf:
        return NOT_FINITE
    store_now(w, r)
    r.clock[T] = t
    r.charts[r.numbers[CHART_ROWS], 0], r.charts[r.numbers[CHART_ROWS], 2] = t, 1.0
    w.counters[CHARTS] += 1
    if r.t_eval.size == 0:
        record(r, t, w.q, w.qd, w.qdd)
    elif r.numbers[NEXT_EVAL] < r.t_eval.size and r.t_eval[r.numbers[NEXT_EVAL]] == t:
        record(r, t, w.q, w.qd, w.qdd)
        r.numbers[NEXT_EVAL] += 1
    return 0


@kernel
def _begin_run(c, r):
    w, f = c.work, c.free
    set_time(c.system, r.clock[T])
    place_bodies(c.network.bodies, w.q, f.poses)
    move_bodies(c.network.bodies, w.q, w.qd, f.poses)
    status = _land_here(c, r.clock[T])
    r.charts[0, 1] = AT_START
    return _accept(c, r, r.clock[T]) if status == 0 else status


@kernel
def _reach(c, t0, t1):
    """The state at the end of the step, but for qdd. Status."""
    x = c.expansion
    sum_series(c.network, x.bodies, x.order[1], x.order[0], t1 - t0, c.free.poses, c.free.p)
    return _land_here(c, t1)


@kernel
def _within(c, r, t0, t1):
    """What t_eval asks for in (t0, t1). Status."""
    w = c.work
    while r.numbers[NEXT_EVAL] < r.t_eval.size and r.t_eval[r.numbers[NEXT_EVAL]] < t1:
        t = r.t_eval[r.numbers[NEXT_EVAL]]
        status = state_within(c, t - t0, t)
        if status != 0:
            return status
        record(r, t, w.q, w.qd, w.qdd)
        r.numbers[NEXT_EVAL] += 1
    return 0


@entry
def advance_series(c, r, most):
    """Make up to `most` steps, as `run.advance` does. Status."""
    w, f, x = c.work, c.free, c.expansion
    if r.numbers[BEGUN] == 0 and most != 0:
        status = _begin_run(c, r)
        if status != 0:
            return status
        r.numbers[BEGUN] = 1
    far = MISSED * (r.clock[ATOL] + r.clock[RTOL])
    for _ in range(most):
        if r.numbers[CHART_ROWS] + 2 >= r.charts.shape[0] or r.numbers[HISTORY] >= r.history.shape[0]:
            break
        t0 = r.clock[T]
        if t0 >= r.clock[T_END]:
            return 0
        for k in range(1, x.order[0]):
            expand(c.network, c.system, k, x.order[1], x, f)
        w.counters[EVALUATIONS] += x.order[0]
        h, t1, last = min(_step_length(c, r), r.clock[MAX_STEP]), t0, False
        if r.numbers[STEPS] == 0 and r.clock[H] > 0.0:
            h = min(h, r.clock[H])
        while True:
            t1 = t0 + h
            if not t1 > t0 + 4e-16 * max(abs(t0), 1e-3 * (r.clock[T_END] - r.clock[T_ORIGIN])):
                return STEP_COLLAPSED
            last = t1 + 1e-3 * h >= r.clock[T_END]
            if last:
                t1 = r.clock[T_END]
            row = r.history[r.numbers[HISTORY]]
            row[0], row[1], row[2] = t0, t1 - t0, 0.0
            status = _reach(c, t0, t1)
            if status == 0 and f.sizes[RESIDUAL] <= far:
                break
            copy(r.now[0], w.q)
            place_bodies(c.network.bodies, w.q, f.poses)
            r.numbers[REJECTED] += 1  # the same series serves a shorter step
            if r.numbers[HISTORY] + 1 < r.history.shape[0]:
                r.numbers[HISTORY] += 1
            h *= 0.5
        row[2] = 1.0
        r.numbers[HISTORY] += 1
        if r.numbers[DENSE] != 0:
            _store_block(c, r, t0, t1 - t0, t1)
        if r.numbers[NEXT_EVAL] < r.t_eval.size and r.t_eval[r.numbers[NEXT_EVAL]] < t1:
            status = _within(c, r, t0, t1)
            if status == 0:
                status = _reach(c, t0, t1)
            if status != 0:
                return status
        r.charts[r.numbers[CHART_ROWS], 4] = 1.0
        if not last:
            r.numbers[CHART_ROWS] += 1
            r.charts[r.numbers[CHART_ROWS], 1] = BY_SERIES
        r.numbers[STEPS] += 1
        status = _accept(c, r, t1)
        if status != 0:
            return status
    return 0 if r.clock[T] >= r.clock[T_END] else SLICE_DONE
