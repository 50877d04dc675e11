"""The plan of a call: what `simulate` has worked out from its arguments, for calls with the same ones.

Of a call that ends well within its first slice the plan keeps the method, the engine, what all solutions have in
common, and the last interval and start. A later call checks an interval or a start that is another one, copies the
image of the memory, and runs the driver. Whatever else differs, or goes wrong, is left to the ordinary way of a call.
"""

import time
from math import copysign
from typing import NamedTuple

import numpy as np

from ..configuration.holonomic import demand_holonomic
from ..errors import TsdynError
from ..observables.state import RememberingState, State, remembered
from ..runs.arguments import interval, output_times, state_arrays, step_count
from ..runs.brief import Remains, begin, has_ended_well, rows_of
from ..runs.task import between
from ..validation import floats
from .local_origin import origin_of
from .rounding_limit import within_rounding
from .segments import is_relayed, may_pass
from .solution import Solution
from .termination import account

OF_ONE_RUN = {"span", "_rows", "_remains", "_seconds", "_made"}  # attributes of a solution
FEW_TIMES = 1 << 12  # output times, or coordinates, that are kept to compare those of the next call with


class Stretch(NamedTuple):
    """An interval and output times that have been checked."""

    given: object  # t_span and t_eval, if these can't change: tuples of floats
    listed: object
    span: tuple
    times: np.ndarray
    bits: bytes  # of the times
    stops: np.ndarray
    engine: object
    steps: int  # of a fixed length; 0 for others


class Start(NamedTuple):
    """A start that has been checked and projected."""

    given: tuple  # q, qd of the scene's bodies, or None
    bits: tuple  # of those of a state, or None
    t: float
    remembered: np.ndarray
    q: np.ndarray
    qd: np.ndarray


class Plan:
    """Of calls with arguments that differ in t_span, t_eval and state alone.

    Parameters
    ----------
    task : Task
        Of a run that has ended well within its first slice.
    engine : type
        Of the run.
    options : Options
    solution : Solution
        Of the run.
    """

    def __init__(self, task, engine, options, solution):
        self.task, self.settings, self.kept, self.method = task, options.settings, task.prepared, task.method
        self.engines, self.image = {}, object()  # by whether anything is asked between steps; the mark of a memory
        self.may_pass = is_relayed(task, engine) and may_pass(task)
        self.derived, self.current = self.kept.packed.derived, self.kept.packed.derived.engines
        self.is_redundant = self.derived.redundant is not None
        self.told = {name: value for name, value in vars(solution).items() if name not in OF_ONE_RUN}
        self.stretch = self.start = None

    @property
    def serves(self):
        """Whether the same rows and bodies take part in the equations as at first."""
        return self.derived.engines is self.current

    def learn(self, options, engine):
        """Take the engine of a run."""
        self.engines[options.within] = self.kept.engine(engine, self.method, self.task.form, options.within)

    def run(self, scene, t_span, t_eval, state):
        """Run it; a `Solution`, or what `go_on` needs of a run that is longer. None if the call goes another way."""
        called = time.perf_counter()
        try:
            stretch = self._stretch(t_span, t_eval)
            start = stretch and self._start(scene, state, stretch.span[0])
            if start is None:
                return None
            memory = self.kept.take(stretch.engine.kind)
            if memory is None or not stretch.engine.serves(memory):
                return None
            memory.enter_again(self, stretch, start)
        except TsdynError:
            return None  # which says so again
        began = time.perf_counter()
        begun = begin(memory, stretch.times, stretch.stops, self._limit(stretch))
        if not has_ended_well(memory, begun):
            return Unfinished(stretch, start, memory, begun, called, began)
        rows, remains = rows_of(memory, begun.log), Remains(memory, begun.log, self.task.history)
        self.kept.give(stretch.engine.kind, memory)
        return self._solution(scene, stretch, rows, remains, called, began)
