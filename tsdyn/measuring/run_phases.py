"""Time of a run whose rows come and go, by what its Python code does: steps, searches, impacts, packing."""

from __future__ import annotations

import threading
import time
from collections import Counter
from contextlib import contextmanager
from functools import wraps

from ..runs.events import Watch
from ..runs.run_memory import Memory
from ..simulation import hybrid
from ..simulation.contact_run import _ContactRun
from ..simulation.transitions import Transitions
from .phase_times import Phase

# What is timed: the owner of each function, the function, and the group and part that its own time belongs to: without
# that of other functions of this table that it calls.
TIMED = (
    (Memory, Memory.advance, "steps", "compiled driver"),
    (Watch, Watch._search_step, "events", "searches of steps"),
    (Transitions, Transitions._hit, "events", "impacts"),
    (Transitions, Transitions._bounces, "events", "impacts"),
    (Transitions, Transitions._decide_modes, "events", "contacts and frictions that hold afterwards"),
    (hybrid, hybrid.ask, "events", "actions asked"),
    (hybrid, hybrid.carry_out, "events", "actions carried out"),
    (_ContactRun, _ContactRun._scene_of, "phases", "packed"),
    (_ContactRun, _ContactRun._phase, "phases", "prepared and driven"),
)
GROUPS = tuple(dict.fromkeys(group for _, _, group, _ in TIMED))


class Stopwatch:
    """Own time, and calls, of the functions of the table in this thread while it watches."""

    def __init__(self):
        self.calls, self.seconds, self.inner, self.thread = Counter(), Counter(), [0.0], threading.get_ident()

    def _timed(self, function, part):
        @wraps(function)
        def timed(*arguments, **named):
            if threading.get_ident() != self.thread:
                return function(*arguments, **named)
            began = time.perf_counter()
            self.inner.append(0.0)
            try:
                return function(*arguments, **named)
            finally:
                spent = time.perf_counter() - began
                self.seconds[part] += spent - self.inner.pop()
                self.inner[-1] += spent
                self.calls[part] += 1

        return timed

    @contextmanager
    def watching(self):
        """Time the functions of the table."""
        try:
            for owner, function, *part in TIMED:
                setattr(owner, function.__name__, self._timed(function, tuple(part)))
            yield self
        finally:
            for owner, function, *_ in TIMED:
                setattr(owner, function.__name__, function)

    @property
    def driver(self):
        """Seconds in the compiled driver."""
        return self.seconds[TIMED[0][2:]]

    def phases(self, solution):
        """The `Phase`s of the run of a solution: parts that ran, and how often."""
        counted = {
            "compiled driver": solution.stats.steps,
            "impacts": len({t for t, *_ in solution.impulses}),
            "packed": len(solution._phases.packed),
        }
        parts = dict.fromkeys((group, part) for *_, group, part in TIMED)
        return [
            Phase(*part, counted.get(part[1], self.calls[part]), self.seconds[part])
            for part in parts
            if self.calls[part]
        ]
