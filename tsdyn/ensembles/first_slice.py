"""Runs by series that end within the driver's first slice, without the bookkeeping that longer ones need."""

from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..runs.recorder import CHART_ROOM, NO_ROWS
from ..runs.run_end import RunEnd
from ..runs.run_log import RunLog
from ..runs.slices import FIRST_SLICE, FIRST_WORK
from ..runs.tolerances import TRIES
from ..simulation.local_origin import origin_of
from ..taylor.series_engine import SeriesEngine
from .tolerances import MOSTLY, TRIED

SUCCESS = Status.SUCCESS


class Finished(NamedTuple):
    """Of an `Outcome` what an ensemble keeps."""

    end: RunEnd  # its `last` (2, n): q, qd
    rows: np.ndarray  # outputs; valid until the next run


class FirstSlice:
    """Runs a `Task` in the memory of an arena, if it ends within one slice.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study):
        n, times = study.n, study.times
        self.rows = min(max(FIRST_WORK // n, 1), FIRST_SLICE)
        width = 1 + 3 * n + study.kept.handles.count + study.family.packed.system.memory.size
        self.out = np.empty((times.size or self.rows + 1, width))
        history, charts = np.empty((self.rows + 2 * TRIES, 3)), np.empty((self.rows + CHART_ROOM, 5))  # one a step
        self._long = self._tried = 0
        self.log = RunLog(times, study.stops, self.out, history, charts, NO_ROWS, NO_ROWS)

    @staticmethod
    def serves(study):
        """Return True if nothing is asked of the runs of a study that needs more."""
        options = study.options
        plain = options.events is None and not options.dense_output and options.max_steps is None
        return plain and study.method.driver == "series" and not len(study.stops) and not callable(study.keep)

    def run(self, task):
        """The `Finished` run; None if it hasn't ended well within the slice, or most haven't: it begins again then."""
        kept = task.prepared
        if self._long * MOSTLY > self._tried > TRIED or origin_of(kept.packed, task.q) is not None:
            return None
        engine = kept.engine(SeriesEngine, task.method, task.form, task.within)
        memory = kept.take(engine)
        memory.enter(engine, task, False)
        status, run = memory.advance(self.log, self.rows), memory.run
        self._tried += 1
        self._long += status is Status.SLICE_DONE
        found = None
        if status is SUCCESS and not run.numbers.near_steps:
            found = Finished(RunEnd(run.clock.t, run.now[:2].copy(), *[None] * 4), self.out[: run.numbers.rows])
        if status is not Status.NOT_FINITE:  # NaN may be left
            kept.give(engine.kind, memory)
        return found
