"""The plan of a call: what `simulate` has worked out from its arguments, for later calls with the same ones.

A later call checks an interval or a start that is not the last one, copies the image of the memory and runs the driver.
Whatever else differs, or is refused, is left to the ordinary way of a call.
"""

import time
from typing import NamedTuple

from ..configuration.holonomic import demand_holonomic
from ..jit.compiled import statistics
from ..jit.interrupts import CollectionsDeferred
from ..motions.knots import NO_STOPS
from ..observables.state import remembered
from ..runs.arguments import NO_TIMES, state_arrays
from ..runs.brief import Begun, Remains, begin, has_ended_well, limit_of, rows_of, trajectory_of
from .known_start import Start, bits_of
from .local_origin import origin_of
from .rounding_limit import within_rounding
from .segments import is_relayed, may_pass
from .solution import Solution
from .stretch import Stretch

OF_EVERY_RUN = (  # attributes of a solution; others are set, or made when they are asked for
    "scene", "packed", "formulation", "_method", "_turned", "system", "status", "t_events", "q_events", "qd_events",
    "handles", "_slice", "_stored", "_energy_error", "_reason", "_message",
)  # fmt: skip
FEW_ENTRIES = 2  # of memories that other plans have used
FEW_TIMES = 1 << 12  # output times that are kept to compare those of the next call with


class Unfinished(NamedTuple):
    """A run that has not ended well within its first slice."""

    plan: object
    stretch: Stretch
    start: Start
    memory: object
    begun: Begun
    called: float  # s, of `jit.compiled.clock`
    began: float


class Plan:
    """Of calls with arguments that differ in t_span, t_eval and state alone.

    Parameters
    ----------
    task : Task
        Of a run that has ended well within its first slice.
    kind : type
        Of its engine.
    options : Options
    solution : Solution
    """

    def __init__(self, task, kind, options, solution):
        self.kept, self.kind, self.options = task.prepared, kind, options._replace(times=NO_TIMES)
        choose = None if task.choose is None else True
        self.task = task._replace(times=NO_TIMES, stops=NO_STOPS, choose=choose)
        self.may_pass = is_relayed(task, kind) and may_pass(task)
        self._engines, self._stretch, self._start, self._entries = {}, None, None, 0
        self._derived, self._rows = self.kept.packed.derived, self.kept.packed.derived.engines
        self.mark = object()  # of memories that the plan has entered
        self._told = {name: vars(solution)[name] for name in OF_EVERY_RUN}

    @property
    def serves(self):
        """Whether the same rows and bodies take part in the equations as at first."""
        return self._derived.engines is self._rows

    def learn(self, within):
        """Take the engine of runs that are asked for something, or nothing, between the ends of steps."""
        self._engines[within] = self.kept.engine(self.kind, self.task.method, self.task.form, within)

    def run(self, scene, t_span, t_eval, state):
        """Run it: a `Solution` or the `Unfinished` run; None if the call is to go the ordinary way."""
        called, kept, stretch = time.perf_counter() - statistics["waited"], self.kept, self._stretch  # clock()
        if stretch is None or t_span is not stretch.t_span or t_eval is not stretch.t_eval:
            stretch = Stretch.of(stretch, t_span, t_eval, kept, self.task.method)
            self._stretch = stretch if stretch.times.size <= FEW_TIMES else None
        engine = None if stretch.unresolved else self._engines.get(stretch.within or self.task.dense_output)
        start = None if engine is None else self._start_of(scene, state, stretch.span[0])
        memory = None if start is None else self._memory(engine)
        if memory is None:
            return None
        memory.enter_again(self, engine, stretch, start)
        began = time.perf_counter() - statistics["waited"]
        begun = begin(memory, stretch.times, stretch.stops, limit_of(memory.run, stretch.stops, self.task.max_steps))
        if not has_ended_well(memory, begun):
            return Unfinished(self, stretch, start, memory, begun, called, began)
        rows, remains = rows_of(memory, begun.log), Remains(memory, begun.log, self.task.history)
        trajectory = None
        if self.task.dense_output:
            trajectory = trajectory_of(memory, begun.log, self.task_of(stretch, start, None))
        kept.give(engine.kind, memory)
        solution = object.__new__(Solution)
        vars(solution).update(
            self._told, span=stretch.span, _rows=(rows, kept.n), _remains=remains, _trajectory=trajectory,
            _made=time.time(),
            _seconds={"prepare": began - called, "run": time.perf_counter() - statistics["waited"] - began},
        )  # fmt: skip
        return solution

    def _memory(self, engine):
        """A memory for one run; None if there is none. Plans that take turns have one each after some calls."""
        kept = self.kept
        memory = kept.take(engine.kind, self.mark)
        if memory is None or not engine.serves(memory):
            return None
        if memory.mark is not self.mark:
            self._entries += 1
            if self._entries > FEW_ENTRIES and kept.has_room(memory):
                kept.give(engine.kind, memory)
                with CollectionsDeferred():
                    memory = engine.memory(kept)
        return memory

    def task_of(self, stretch, start, choose):
        """The `Task` of one run."""
        return self.task._replace(
            span=stretch.span, times=stretch.times, stops=stretch.stops, remembered=start.remembered, q=start.q,
            qd=start.qd, choose=choose,
        )  # fmt: skip

    def _start_of(self, scene, state, t):
        """The consistent start of a run; None if the call is to go the ordinary way."""
        known, kept = self._start, self.kept
        if state is None:
            bits, given = None, scene._start or scene._initial()
            if known is not None and given is known.given and t == known.t:
                return known
        else:
            bits, given = bits_of(state, kept, t), None
            if bits is None or (known is not None and bits == known.bits and t == known.t):
                return known if bits else None
        arrays = state_arrays(state, kept.n) if given is None else given
        memory, settings = remembered(state, kept, t, arrays[0]), self.options.settings
        q, qd = kept.start(scene, arrays, t, settings.initial_tol, memory, settings.drop)
        if not self._takes(q, t):
            return None
        self._start = known = Start(given, bits, t, memory, q, qd)
        return known

    def _takes(self, q, t):
        """Whether a start changes nothing of the plan."""
        packed, method, form = self.kept.packed, self.task.method, self.task.form
        if not self.serves or origin_of(packed, q) is not None:
            return False
        if not form.basis_free or method.implicit:
            demand_holonomic(packed, q, t, form.name)
        return within_rounding(method, packed, q)[0] is method
