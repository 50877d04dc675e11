"""Passage through singular configurations: Runge-Kutta methods hand over to the Taylor integrator near the singularity.

Near a singular configuration charts shrink towards zero, while the Taylor series of a motion that passes it smoothly is
regular. If a chart is made near a singularity, or a fixed step fails near one, a Taylor run continues until the
configuration is regular again; the method then restarts (segments.py). A fixed-step method restarts on its own time
grid. Runs that meet no singular configuration load none of this.
"""

import math

from ..errors import Status
from ..formulations.registry import formulation
from ..integrators import Taylor
from .tolerances import FINEST, NO_STEP, REGULAR


def by_series(task):
    """The `Task` of a crossing."""
    rtol, atol = (FINEST if tol is None else min(tol, FINEST) for tol in (task.method.rtol, task.method.atol))
    return task._replace(
        method=Taylor(rtol=rtol, atol=atol, max_step=task.method.max_step), form=formulation("tangent"), choose=None
    )


def crossings(found):
    """Say how often the Taylor series took over, and when first; each with the segment before."""
    passed = [before.end.reached for before, series in found if series.status in (Status.PASSAGE, Status.SUCCESS)]
    if not passed:
        return ""
    times = "once" if len(passed) == 1 else f"{len(passed)} times, the first"
    return f"Taylor series carried the motion past a singular configuration {times} after t = {passed[0]:.6g} s."


class Carrier:
    """The memory of a Taylor run that is advanced until the configuration is regular again.

    Parameters
    ----------
    memory : Memory
    task : Task
        The whole run's.
    share : float
        Pivot share of the weakest row at the start; the method resumes when it has grown.
    """

    def __init__(self, memory, task, share):
        self.memory, self.share = memory, share
        self.run, self.weight, self.context = memory.run, memory.weight, memory.context
        self.origin, self.end = task.span
        self.step = task.method.step
        self.grid = math.nan  # the grid time that is aimed at

    def advance(self, log, most):
        """Advance as `Memory` does; Status.PASSAGE when the configuration is regular again."""
        if most <= 0:
            return self.memory.advance(log, most)
        numbers, clock = self.run.numbers, self.run.clock
        for _ in range(most):
            done = numbers.steps
            status = self.memory.advance(log, 1)
            if status == Status.SUCCESS and clock.t < self.end:
                status = Status.SLICE_DONE
            if status != Status.SLICE_DONE or numbers.steps == done:
                return status
            if not self._is_regular():
                clock.t_end = self.end
            elif self.step is None or clock.t == self.grid:
                return Status.PASSAGE
            else:
                clock.t_end = self.grid = self._next()
        return Status.SLICE_DONE

    def saved(self):
        """The grid time that is aimed at, the share that was met, and what the memory has to say."""
        return {"grid": self.grid, "share": self.share, "memory": self.memory.saved()}

    def restore(self, numbers):
        """As it was when it was saved."""
        self.grid, self.share = numbers["grid"], numbers["share"]
        self.memory.restore(numbers["memory"])

    @property
    def reason(self):
        """A sentence on the end of the run."""
        return self.memory.reason

    def _is_regular(self):
        indicator = self.context.tangent.indicator
        return indicator.start >= max(REGULAR * indicator.largest, self.share)

    def _next(self):
        """Return the next time of the grid."""
        done = (self.run.clock.t - self.origin) / self.step
        return min(self.origin + math.ceil(done + NO_STEP) * self.step, self.end)
