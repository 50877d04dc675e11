"""States inside the last step of a run, for event location."""

import numpy as np

from ..errors import Status
from .events import Failed

ROOM = 64  # states that are kept


class Inside:
    """States within the step that a run has just made."""

    def __init__(self, reader, run, log, t0, before):
        self.t0, self.t1, self.degree = t0, float(run.clock.t), 0
        self._reader, self._log, self._block = reader, log, run.block[None]
        self._known = {t0: before, self.t1: run.now.copy()}

    def states(self, times):
        """States (3, n) at times (k,), None where there is none."""
        times, known = times.tolist(), self._known
        # States that are known already are not read again
        missing = [t for t in times if t not in known]
        if missing:
            found = dict(zip(missing, self._read(np.array(missing)), strict=True))
            if len(known) > ROOM:
                return [found[t] if t in found else known[t] for t in times]
            known.update(found)
        return [known[t] for t in times]

    def _read(self, times):
        rows = np.zeros(times.size, int)
        states, status = self._reader(times, rows, self._block, self._log.charts, self._log.points)
        if status == Status.SUCCESS:
            return states
        return [self._read(times[i : i + 1])[0] for i in range(times.size)] if times.size > 1 else [None]

    def at(self, t):
        """The state (3, n) at t."""
        (state,) = self.states(np.array([t]))
        if state is None:
            raise Failed(f"there is no state at t = {t:.9g} s to evaluate events at.", t)
        return state
