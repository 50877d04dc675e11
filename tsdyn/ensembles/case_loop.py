"""The compiled loop over cases: each is written into the arrays of an arena and run by series, without Python."""

from typing import NamedTuple

import numpy as np

from ..configuration.start_kernels import LANDED
from ..errors import Status
from ..jit.kernels import Record, caller, data_of, entry, integers, kernel, loader, vector
from ..maths.dense_linalg import copy
from ..runs.run_log import RunLog, no_log
from ..taylor.stepper import advance_by_series
from ..taylor.workspace import load_series
from ..workspaces.run_state import load_run

SUCCESS = int(Status.SUCCESS)
call_take = caller("pppppidd")


class LoopNumbers(Record):
    """Settings of a loop, and how it ended."""

    most: int  # steps of a case; a longer one is left to Python
    moves: int  # whether starts differ
    may_land: int  # whether they may be projected
    grid: int  # whether outputs are kept, in place of the last state
    take_start: int  # address of start_kernels.take_start; 0 where starts need no check
    start_context: int  # its arguments
    start_rates: int
    start_at: int
    start_count: int
    start_t: float
    start_tol: float
    ran: int  # whether the case at which the loop has ended was run
    status: int  # Status of that run


class Plan(NamedTuple):
    """What cases have in common."""

    numbers: LoopNumbers
    images: np.ndarray  # int64 (k, 3)  what a run finds as it was: address, that of its image or 0 for zeros, words
    places: np.ndarray  # int64 (k, 3)  address, first number in a row of the table, words
    start: np.ndarray  # (2, n)  q, qd of the present case
    log: RunLog


class CaseArrays(NamedTuple):
    """The cases of a chunk, and their results."""

    table: np.ndarray  # (k, width)
    starts: np.ndarray  # (k, 2, n), or (1, 2, n) of all
    fits: np.ndarray  # int64 (k,)  whether a case may be run here
    t: np.ndarray  # (k,)
    q: np.ndarray  # (k, n), or (k, times n)
    qd: np.ndarray
    status: np.ndarray  # int64 (k,)
    stopped: np.ndarray  # int64 (1,)  not 0: the loop ends


def _example():
    integers_, none = np.zeros((0, 3), np.int64), np.zeros((0, 1))
    ones = np.zeros(0, np.int64)
    plan = Plan(LoopNumbers(), integers_, integers_, none, no_log())
    return plan, CaseArrays(none, np.zeros((0, 2, 1)), ones, np.zeros(0), none, none, ones, ones)


load_plan, load_chunk = map(loader, _example())


@kernel
def enter_case(plan, chunk, k):
    """Memory as a run finds it, with the numbers of case k."""
    for i in range(plan.images.shape[0]):
        address, source, count = plan.images[i]
        words = integers(address, count)
        if source == 0:
            for j in range(count):
                words[j] = 0
        else:
            image = integers(source, count)
            for j in range(count):
                words[j] = image[j]
    for i in range(plan.places.shape[0]):
        address, first, count = plan.places[i]
        to = vector(address, count)
        for j in range(count):
            to[j] = chunk.table[k, first + j]


@kernel
def take_start(plan, chunk, k, c, r):
    """The start of case k, made consistent; False if that is left to Python."""
    n, start, given = plan.numbers, plan.start, chunk.starts[min(k, chunk.starts.shape[0] - 1)]
    if n.take_start == 0:
        return True
    for i in range(2):
        copy(given[i], start[i])
    q, qd = data_of(start[0]), data_of(start[1])
    done = call_take(
        n.take_start, n.start_context, q, qd, n.start_rates, n.start_at, n.start_count, n.start_t, n.start_tol
    )
    if done == 0 or (done == LANDED and n.may_land == 0):
        return False
    if n.moves == 1 or done == LANDED:
        for to in (c.work.q, r.now[0]):
            copy(start[0], to)
        for to in (c.work.qd, r.now[1]):
            copy(start[1], to)
    return True


@kernel
def _keep(plan, chunk, k, r):
    """The results of case k."""
    n, q, qd = r.now.shape[1], chunk.q[k], chunk.qd[k]
    chunk.t[k] = r.clock.t
    if plan.numbers.grid == 0:
        for j in range(n):
            q[j], qd[j] = r.now[0, j], r.now[1, j]
    else:
        for i in range(r.numbers.rows):
            row = plan.log.out[i]
            for j in range(n):
                q[i * n + j], qd[i * n + j] = row[1 + j], row[1 + n + j]
    chunk.status[k] = SUCCESS


@entry("ppppii")
def run_cases(context, run, where, chunk_at, first, end):
    """Run cases from `first` on; the first one that was left to Python, or `end`."""
    c, r, plan, chunk = load_series(context), load_run(run), load_plan(where), load_chunk(chunk_at)
    numbers = plan.numbers
    numbers.ran = 0
    for k in range(first, end):
        if chunk.stopped[0] != 0 or chunk.fits[k] == 0:
            return k
        enter_case(plan, chunk, k)
        if not take_start(plan, chunk, k, c, r):
            return k
        status = advance_by_series(context, c, r, plan.log, numbers.most)
        if status != SUCCESS or r.numbers.near_steps != 0:
            numbers.ran, numbers.status = 1, status
            return k
        _keep(plan, chunk, k, r)
    return end
