"""A run slice by slice: the compiled driver is called, with room for what each slice records."""

import time
from typing import NamedTuple

import numpy as np

from .errors import InconsistentState, SingularConfiguration, Status
from .run_state import BEGUN, BLOCKS, CHART_ROWS, DENSE, HISTORY, ROWS, STEPS, STEPS_WANTED, STIFF, STORED, Record, T

SLICE_SECONDS = 0.2  # how often a run comes back to Python: progress, interrupts
FIRST_SLICE, LARGEST_SLICE, CHART_ROOM = 1024, 1 << 17, 64
BLOCK_ROOM = 1 << 22  # floats of a slice's blocks


class Recorded(NamedTuple):
    """Rows of all that a run has recorded, as in `Record`; charts and points have room left."""

    out: np.ndarray
    history: np.ndarray
    blocks: np.ndarray
    charts: np.ndarray
    points: np.ndarray


def drive(memory, task, watch):
    """Drive a run; the Status, what there is to say about it, and what it `Recorded`.

    `task.choose(run)` is asked when the motion is found stiff; where it says so the run ends with Status.STIFF.
    """
    run, numbers, times, choose = memory.run, memory.run.numbers, task.times, task.choose
    t0, t1 = task.span
    most, limit = FIRST_SLICE, int(numbers[STEPS_WANTED]) if task.max_steps is None else task.max_steps
    per_step, dense = times.size == 0, numbers[DENSE] == STORED
    n, block = run.now.shape[1], run.block.size
    width = 1 + 3 * n + run.remembered.size
    largest = max(BLOCK_ROOM // block, 1) if dense else LARGEST_SLICE
    chunks = {"out": [], "history": [], "blocks": []}
    record = Record(
        t_eval=times,
        out=np.empty((times.size, width)),
        history=np.empty((0, 3)),
        charts=np.empty((2 * CHART_ROOM, 5)),
        points=np.empty((2 * CHART_ROOM if numbers[DENSE] else 0, n)),
        blocks=np.empty((0, block)),
    )

    def fresh(rows):
        """New arrays for the next slice; what the last one filled goes to the chunks."""
        _collect(numbers, record, chunks, per_step, dense)
        out = np.empty((rows + 1, width)) if per_step else record.out
        charts, points = record.charts, record.points
        if numbers[CHART_ROWS] + CHART_ROOM > len(charts):
            charts, points = _doubled(charts), _doubled(points)
        return Record(times, out, np.empty((rows, 3)), charts, points, np.empty((rows if dense else 0, block)))

    status, reason = Status.SLICE_DONE, ""
    try:
        while status == Status.SLICE_DONE:
            done = int(numbers[STEPS])
            if done >= limit:
                status = Status.MAX_STEPS
                break
            rows = min(most, limit - done)
            record = fresh(rows)
            started = time.perf_counter()
            if watch is None:
                status = memory.advance(record, rows)
            else:
                status, reason = watch.advance(memory, record, rows)
            seconds = time.perf_counter() - started
            if not numbers[BEGUN]:
                singular = status in (Status.SINGULAR, Status.MASS_SINGULAR)
                kind = SingularConfiguration if singular else InconsistentState
                raise kind(f"no step could be made from the start. {status.sentence} {status.remedy}")
            if seconds > 2 * SLICE_SECONDS:
                most = max(most // 2, 1)
            elif seconds < SLICE_SECONDS / 2 and numbers[HISTORY] == rows:
                most = min(2 * most, largest)
            if choose is not None and numbers[STIFF] and status == Status.SLICE_DONE:
                if choose(run):
                    status = Status.STIFF
                choose = None
            try:
                task.report((run.clock[T] - t0) / (t1 - t0))
            except Exception as error:  # what has been computed is worth more than a progress bar
                if status == Status.SLICE_DONE:
                    status, reason = Status.INTERRUPTED, f"progress raised {type(error).__name__}: {error}."
    except KeyboardInterrupt:
        if run.clock[T] >= t1:
            status = Status.SUCCESS
        elif status == Status.SLICE_DONE:
            status = Status.INTERRUPTED
    finally:
        task.report(None)
    _collect(numbers, record, chunks, per_step, dense)
    out = np.concatenate((record.out[:0], *chunks["out"])) if per_step else record.out[: numbers[ROWS]]
    history, blocks = (np.concatenate((getattr(record, x)[:0], *chunks[x])) for x in ("history", "blocks"))
    return status, reason, Recorded(out, history, blocks, record.charts, record.points)


def _collect(numbers, record, chunks, per_step, dense):
    if per_step and numbers[ROWS]:
        chunks["out"].append(record.out[: numbers[ROWS]])
        numbers[ROWS] = 0
    if dense and numbers[BLOCKS]:
        chunks["blocks"].append(record.blocks[: numbers[BLOCKS]])
        numbers[BLOCKS] = 0
    if numbers[HISTORY]:
        chunks["history"].append(record.history[: numbers[HISTORY]])
        numbers[HISTORY] = 0


def _doubled(rows):
    return np.concatenate((rows, np.empty_like(rows)))
