"""What a step gives besides its end: the interpolation block, and the states that t_eval asks for."""

from ..jit.kernels import kernel
from ..maths.dense_linalg import copy
from ..methods.interpolants import call_fill
from .outputs import record, restore_now
from .run_state import BLOCKS, CHART_ROWS, DENSE, FIRST_ORDER, NEXT_EVAL, STORED
from .trajectory import (
    A_ACCELERATE,
    A_FILL,
    A_PLACE,
    B_CHART,
    B_DATA,
    B_END,
    B_H,
    B_START,
    between,
    bring_back,
    keep,
)


@kernel
def _wanted_within(r, log, t1):
    """Whether the step's inside is asked for."""
    i = r.numbers[NEXT_EVAL]
    return r.numbers[DENSE] != 0 or (i < log.t_eval.size and log.t_eval[i] < t1)


@kernel
def _fill(context, w, r, log, at, t0, h, t1):
    """The block of the step just made. Status."""
    r.block[B_START], r.block[B_H], r.block[B_END], r.block[B_CHART] = t0, h, t1, r.numbers[CHART_ROWS]
    status = call_fill(
        at[A_FILL], context, at[A_PLACE], at[A_ACCELERATE], r.numbers[FIRST_ORDER], t0, h, w.q.size, r.x.size, r.y.size,
        r.x_old, r.y_old, r.yd_old, r.x, r.y, r.yd, r.xd, r.before, r.now, r.tableau, r.memory, r.block[B_DATA:],
    )  # fmt: skip
    copy(r.remembered, r.block[r.block.size - r.remembered.size :])
    if status == 0 and r.numbers[DENSE] == STORED:
        copy(r.block, log.blocks[r.numbers[BLOCKS]])
        r.numbers[BLOCKS] += 1
    return status


@kernel
def record_step(context, w, r, log, at, t0, h, t1):
    """Record what t_eval asks for in (t0, t1], or the step's end where it asks for nothing. Status."""
    if log.t_eval.size == 0:
        record(r, log, t1, w.q, w.qd, w.qdd)
    within = _wanted_within(r, log, t1)
    if within:
        keep(w, r.warm)
        status = _fill(context, w, r, log, at, t0, h, t1)
        if status != 0:
            return status
    while r.numbers[NEXT_EVAL] < log.t_eval.size and log.t_eval[r.numbers[NEXT_EVAL]] <= t1:
        t = log.t_eval[r.numbers[NEXT_EVAL]]
        r.numbers[NEXT_EVAL] += 1
        if t == t1:
            record(r, log, t, r.now[0], r.now[1], r.now[2])
            continue
        status = between(context, w, at, t, r.block, r.xs, r.ys, r.yds, r.dx)  # xd is the next step's
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
    if within:
        bring_back(w, r.warm)
        restore_now(w, r)
    return 0
