"""Chunks of cases: what threads and processes are given, and what they give back."""

from typing import NamedTuple

import numpy as np

from ..errors import Status
from .keeping import TIMES
from .runner import PLAIN

NOT_RUN = int(Status.NOT_RUN)
ALWAYS = ("t", "q", "qd")  # of the same shape in every case


OTHER_SHAPE = "keep must return arrays of the same shape for every case, it gave one of shape {}, and {} before."


class Chunk(NamedTuple):
    """Results of cases without a gap."""

    first: int
    status: np.ndarray  # int64 (k,)
    messages: dict  # case -> message, of those that are not the sentence of their status
    arrays: dict  # name -> (k, ...)

    @property
    def count(self):
        """Number of cases."""
        return len(self.status)


def run_chunk(runner, first, count, offset=0):
    """Run cases from `first` on; the `Chunk`, and whether Ctrl-C has ended it early.

    offset: the number of the first case of the study among all.
    """
    study, messages = runner.study, {}
    status, arrays = np.full(count, NOT_RUN), empty(study, count)
    interrupted, k = False, 0
    try:
        room = runner.room(first, status, arrays, messages)
        while (k := runner.run_many(room, k)) < count:
            if study.stopped:
                raise KeyboardInterrupt
            record = runner.run(room, k)
            said = _enter(arrays, k, record.arrays)
            message = said or record.message
            if message is not PLAIN:
                messages[k] = message
            status[k] = record.status if said is None else Status.CASE_FAILED
            k += 1
    except KeyboardInterrupt:
        interrupted = True
    done = int(np.argmax(status == NOT_RUN)) if (status == NOT_RUN).any() else count
    parts = {name: array[:done] for name, array in arrays.items()}
    said = {offset + first + k: message for k, message in messages.items()}
    return Chunk(offset + first, status[:done], said, parts), interrupted


def _enter(arrays, k, found):
    """Write arrays of a case; what is wrong with them, or None."""
    for name, value in found.items():
        if name in ALWAYS:
            arrays[name][k] = value
            continue
        if name not in arrays:
            arrays[name] = np.full((len(arrays["t"]), *np.shape(value)), np.nan)
        if np.shape(value) != arrays[name].shape[1:]:
            return OTHER_SHAPE.format(np.shape(value), arrays[name].shape[1:])
        arrays[name][k] = value
    return None


def empty(study, cases):
    """Arrays by name for so many cases, all NaN."""
    shape = (study.times.size, study.n) if study.keep == TIMES else (study.n,)
    return {"t": np.full(cases, np.nan), "q": np.full((cases, *shape), np.nan), "qd": np.full((cases, *shape), np.nan)}


def fitted(chunk, shapes):
    """A chunk whose arrays have these shapes, by name: its cases have failed where they have others."""
    wrong = {
        name: array.shape[1:]
        for name, array in chunk.arrays.items()
        if array.shape[1:] != shapes.get(name, array.shape[1:])
    }
    if not wrong:
        return chunk
    status, messages = chunk.status.copy(), dict(chunk.messages)
    name = next(iter(wrong))
    for k in np.flatnonzero(np.isin(status, (int(Status.SUCCESS), int(Status.EVENT)))).tolist():
        status[k], messages[chunk.first + k] = Status.CASE_FAILED, OTHER_SHAPE.format(wrong[name], shapes[name])
    return chunk._replace(
        status=status, messages=messages, arrays={k: v for k, v in chunk.arrays.items() if k not in wrong}
    )


class Collected:
    """Results of all cases in memory.

    Parameters
    ----------
    study : Study
    """

    first, is_full, reason = 0, False, ""  # case to begin with; whether to wait; why cases are missing

    def __init__(self, study):
        count = study.cases.count
        self.status, self.messages, self.arrays = np.full(count, int(Status.NOT_RUN)), {}, empty(study, count)

    def add(self, chunk):
        """Take over the results of a chunk; cases that are known already stay as they are."""
        chunk = fitted(chunk, {name: array.shape[1:] for name, array in self.arrays.items()})
        rows = slice(chunk.first, chunk.first + chunk.count)
        fresh = self.status[rows] == Status.NOT_RUN
        self.status[rows][fresh] = chunk.status[fresh]
        self.messages |= {i: message for i, message in chunk.messages.items() if fresh[i - chunk.first]}
        for name, values in chunk.arrays.items():
            if name not in self.arrays:
                self.arrays[name] = np.full((len(self.status), *values.shape[1:]), np.nan)
            self.arrays[name][rows][fresh] = values[fresh]

    def close(self):
        """Do nothing: all is in memory."""
