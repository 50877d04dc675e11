"""A run from Python's side: its memory, and the driver called slice by slice, with room for what each one records."""

import time

import numpy as np

from .dense import B_DATA, warm_size
from .errors import InconsistentState, SingularConfiguration, Status
from .run import advance
from .run_state import (
    BEGUN,
    BLOCKS,
    CHART_ROWS,
    CLOCKS,
    DENSE,
    FIRST_ORDER,
    HISTORY,
    NUMBERS,
    ROWS,
    STEPS,
    STEPS_WANTED,
    STIFF,
    STORED,
    Run,
    T,
)

SLICE_SECONDS = 0.2  # how often a run comes back to Python: progress, interrupts
FIRST_SLICE, LARGEST_SLICE, CHART_ROOM = 1024, 1 << 17, 4096
BLOCK_ROOM = 1 << 22  # floats of a slice's blocks


def drive(context, run, addresses, max_steps, report, span, watch, choose):
    """Run slice by slice; returns the status, what there is to say about it, and rows of all that was recorded.

    `choose(run)` is asked when the motion is found stiff; where it says so the run ends with Status.STIFF.
    """
    chunks = {"out": [], "history": [], "blocks": []}
    most, limit = FIRST_SLICE, int(run.numbers[STEPS_WANTED]) if max_steps is None else max_steps
    per_step, dense = run.t_eval.size == 0, run.numbers[DENSE] == STORED
    width = 1 + 3 * context.work.q.size + run.remembered.size
    largest = max(BLOCK_ROOM // run.block.size, 1) if dense else LARGEST_SLICE

    def fresh(run, rows):
        """New arrays for the next slice; what the last one filled goes to the chunks."""
        _collect(run, chunks, per_step, dense)
        changes = {"history": np.empty((rows, 3))}
        if per_step:
            changes["out"] = np.empty((rows + 1, width))
        if dense:
            changes["blocks"] = np.empty((rows, run.block.size))
        if run.numbers[CHART_ROWS] + CHART_ROOM > run.charts.shape[0]:
            changes["charts"] = np.resize(run.charts, (2 * run.charts.shape[0], 5))
            if run.points.shape[0] > 0:
                changes["points"] = np.resize(run.points, (2 * run.points.shape[0], run.points.shape[1]))
        return run._replace(**changes)

    status, reason = Status.SLICE_DONE, ""
    try:
        run = fresh(run, min(most, limit))
        while status == Status.SLICE_DONE:
            done = int(run.numbers[STEPS])
            if done >= limit:
                status = Status.MAX_STEPS
                break
            started = time.perf_counter()
            rows = min(most, limit - done)
            if watch is None:
                status = Status(advance(context, run, addresses, rows))
            else:
                status, reason = watch.advance(context, run, addresses, rows)
            seconds = time.perf_counter() - started
            if not run.numbers[BEGUN]:
                singular = status in (Status.SINGULAR, Status.MASS_SINGULAR)
                kind = SingularConfiguration if singular else InconsistentState
                raise kind(f"no step could be made from the start. {status.sentence} {status.remedy}")
            if seconds < SLICE_SECONDS / 2:
                most = min(2 * most, largest)
            elif seconds > 2 * SLICE_SECONDS:
                most = max(most // 2, 1)
            if choose is not None and run.numbers[STIFF] and status == Status.SLICE_DONE:
                if choose(run):
                    status = Status.STIFF
                choose = None
            try:
                report((run.clock[T] - span[0]) / (span[1] - span[0]))
            except Exception as error:  # what has been computed is worth more than a progress bar
                if status == Status.SLICE_DONE:
                    status, reason = Status.INTERRUPTED, f"progress raised {type(error).__name__}: {error}."
            run = fresh(run, min(most, max(limit - int(run.numbers[STEPS]), 1)))
    except KeyboardInterrupt:
        if run.clock[T] >= span[1]:
            status = Status.SUCCESS
        elif status == Status.SLICE_DONE:
            status = Status.INTERRUPTED
    finally:
        report(None)
    _collect(run, chunks, per_step, dense)
    chunks["charts"] = run.charts
    if not per_step:
        chunks["out"] = [run.out[: run.numbers[ROWS]]]
    if dense:
        count = run.numbers[CHART_ROWS] + 1
        chunks["dense"] = np.concatenate(chunks["blocks"]), run.charts[:count].copy(), run.points[:count].copy()
    return status, reason, chunks


def _collect(run, chunks, per_step, dense):
    if per_step:
        chunks["out"].append(run.out[: run.numbers[ROWS]])
        run.numbers[ROWS] = 0
    if dense:
        chunks["blocks"].append(run.blocks[: run.numbers[BLOCKS]])
        run.numbers[BLOCKS] = 0
    chunks["history"].append(run.history[: run.numbers[HISTORY]])
    run.numbers[HISTORY] = 0


def lay_out(work, nx, ny, tableau, memory, times, first_order, width, dense, slots):
    """The `Run` of a system of sizes nx, ny; width is that of the interpolant's data, dense 0, FILLED or STORED.

    slots is how many numbers forces remember.
    """
    n = work.q.size
    zeros = np.zeros
    numbers = zeros(NUMBERS, np.int64)
    numbers[FIRST_ORDER], numbers[DENSE] = first_order, dense
    return Run(
        **{name: zeros(nx) for name in ("x", "xd", "xd_old", "dx", "x_low", "x_low_old", "x_old", "xs")},
        **{name: zeros(ny) for name in ("y", "yd", "dy", "y_low", "y_low_old", "y_old", "yd_old", "ys", "yds")},
        now=zeros((3, n)),
        before=zeros((3, n)),
        warm=zeros(warm_size(work)),
        remembered=zeros(slots),
        tableau=tableau,
        memory=zeros(memory),
        t_eval=times,
        clock=zeros(CLOCKS),
        numbers=numbers,
        out=np.empty((times.size, 1 + 3 * n + slots)),
        history=np.empty((0, 3)),
        charts=zeros((2 * CHART_ROOM, 5)),
        points=zeros((2 * CHART_ROOM if dense else 0, n)),
        block=zeros(B_DATA + width + slots),
        blocks=np.empty((0, B_DATA + width + slots)),
    )
