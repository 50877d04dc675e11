"""What a step gives besides its end: the interpolation block, and the states that t_eval asks for."""

from ..jit.kernels import kernel
from ..maths.dense_linalg import copy
from ..methods.interpolants import call_fill
from ..workspaces.run_state import B_CHART, B_END, B_H, B_START, STORED
from .dense_output import between, bring_back, keep
from .outputs import record, restore_now


@kernel
def is_wanted_before(r, log, t1):
    """Whether t_eval asks for a time before t1."""
    i = r.numbers.next_eval
    return i < log.t_eval.size and log.t_eval[i] < t1


@kernel
def record_end(w, r, log, t):
    """Record the state at the end of a step where every step is asked for, or t by t_eval."""
    if log.t_eval.size == 0:
        record(r, log, t, w.q, w.qd, w.qdd)
    elif r.numbers.next_eval < log.t_eval.size and log.t_eval[r.numbers.next_eval] == t:
        record(r, log, t, w.q, w.qd, w.qdd)
        r.numbers.next_eval += 1


@kernel
def head_block(r, t0, t1):
    """What every block of a step begins and ends with: the step, its chart, and what is remembered."""
    block = r.block
    block[B_START], block[B_H], block[B_END], block[B_CHART] = t0, t1 - t0, t1, r.numbers.chart_rows
    copy(r.remembered, block[block.size - r.remembered.size :])


@kernel
def store_block(r, log):
    """Keep the block of a step, where blocks are kept."""
    if r.numbers.dense == STORED:
        copy(r.block, log.blocks[r.numbers.blocks])
        r.numbers.blocks += 1


@kernel
def record_step(context, run, c, r, log, t0, t1):
    """Record what t_eval asks for in (t0, t1], or the step's end where it asks for nothing. Status."""
    w = c.work
    # Most steps record their end only
    within = r.numbers.dense != 0 or is_wanted_before(r, log, t1)
    if not within:
        record_end(w, r, log, t1)
        return 0
    if log.t_eval.size == 0:
        record(r, log, t1, w.q, w.qd, w.qdd)
    # Dense output moves the workspace: keep what Newton's methods start from, and fill the block
    keep(c, r.warm)
    head_block(r, t0, t1)
    status = call_fill(r.kernels.fill, context, run)
    if status != 0:
        return status
    store_block(r, log)
    while r.numbers.next_eval < log.t_eval.size and log.t_eval[r.numbers.next_eval] <= t1:
        # Requested times up to t1
        t = log.t_eval[r.numbers.next_eval]
        r.numbers.next_eval += 1
        if t == t1:
            record(r, log, t, r.now[0], r.now[1], r.now[2])
            continue
        status = between(context, w, r, t, r.block)
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
    # Back to the end of the step
    bring_back(c, r.warm)
    restore_now(w, r)
    return 0
