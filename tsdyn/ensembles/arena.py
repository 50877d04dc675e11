"""The arrays that the runs of one thread share, into which each case writes its numbers; which cases can share them."""

from types import SimpleNamespace

import numpy as np

from ..elements.bodies import PointMass
from ..files.scene_text import TableNumbers
from ..jit.code_hash import is_ours
from ..model.handles import handles_of
from ..model.packed import Derived, System, classes, is_small
from ..motions.signals import Signal
from ..rows.constraint_graph import are_unequal
from ..rows.graph_builder import weights
from ..rows.massless_axes import lean_bodies
from ..runs.task import Task
from ..simulation import prepared_run
from ..simulation.parameters import KEPT
from ..simulation.prepared_run import run_task
from .case_loop import Batch, Finished, FirstSlice, Starts
from .case_numbers import OF_ROWS, pen_of

# Which cases can share arrays: those whose numbers change nothing that is found from them beforehand.


def serves(family, kept, names):
    """Return True if cases with other values of these parameters, all where names is None, can share arrays."""
    packed = family.packed
    driven = {kind for kind, row in zip(classes(packed), packed.system.kinds, strict=True) if row.phi_t}
    if kept.sampled:
        return False
    fields = family.fields.values() if names is None else map(family.field, names)
    for owner in {id(field.owner): field.owner for field in fields}.values():
        if isinstance(owner, TableNumbers) and names is not None:
            return False
        if owner is family.template or isinstance(owner, (PointMass, TableNumbers)):
            continue
        load = family.load_of(owner)
        if load is not None and any(isinstance(value, Signal) for value in load.parameters):
            return False  # numbers beside a function of time are written into the memory of the series
        kinds = {type(part) for part in getattr(owner, "parts", ())}
        if load is None and (kinds & driven or not all(is_ours(kind.__module__) for kind in (type(owner), *kinds))):
            return False
    return True


def have_same_zeros(parameters, base):
    """Whether numbers of constraints are zero where others are: masks of columns depend on these."""
    if parameters is base:
        return True
    changed = [(new, old) for new, old in zip(parameters, base, strict=True) if new is not old]
    return all((x == 0.0) == (y == 0.0) for new, old in changed for x, y in zip(new, old, strict=True))


# The arrays that the runs of one thread have in common: each case writes its numbers into them.
#
# Everything that numbers don't change is made once: constraint graphs, memory of runs, addresses. A case whose numbers
# change more (an axis without inertia, a scene of micrometres) isn't run here; it is run as a scene of its own, with
# the same bits.


class Arena:
    """Arrays of a scene, and the memory of its runs; for one thread.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study):
        self.study, family = study, study.family
        derived = Derived(shared=family.shared)
        for name in KEPT:
            setattr(derived, name, getattr(family.packed.derived, name))
        system = System(*(array.copy() for array in family.packed.system))
        self.base, self.packed = family.packed, family.packed._replace(system=system, derived=derived)
        self.kept, template = study.kept.like(self.packed), family.template
        self.scene = SimpleNamespace(
            packed=self.packed, system=system, bodies=template.bodies, constraints=template.constraints,
            row_names=template.row_names,
        )  # fmt: skip
        self.is_unequal = are_unequal(system)
        self.written, self.starts = set(), Starts(self)
        self._slice = FirstSlice(study) if FirstSlice.serves(study) and not study.retimes else None
        self.pen = None if study.names is None else pen_of(self, study.names)
        self._chunk, self._batch = None, None

    def systems(self):
        """The `System`s whose arrays hold the numbers of a case, but for reals: the scene's, and the memory's."""
        return [self.packed.system, *(memory.context.system for memory in self._memories())]

    def enter(self, packed):
        """Write the numbers of a packed scene; False if they change more than numbers."""
        base, own = self.base, self.packed
        if is_small(packed.size) != is_small(base.size) or not have_same_zeros(packed.parameters, base.parameters):
            return False
        names = [name for name in System._fields if getattr(packed.system, name) is not getattr(base.system, name)]
        moved = packed.coordinates is not base.coordinates
        if (moved or "mass" in names or "inertia" in names) and lean_bodies(packed):
            return False
        for name in {*names, *self.written}:
            array = getattr(packed.system, name)
            getattr(own.system, name)[...] = array
            for memory in self._memories():
                getattr(memory.context.system, name)[...] = array
        if moved or self.kept.packed.coordinates is not base.coordinates:
            own.derived.levers = own.derived.near = own.derived.grounded = None
            own.derived.origin = None, None
        if packed.members is not base.members or self.kept.packed.members is not base.members:
            own.derived.members = own.derived.aligned = None
            own.derived.handles = self.kept.handles = handles_of(packed)
        if OF_ROWS & {*names, *self.written}:
            self._weigh()
        self.written = {*names}
        self.kept.packed = self.scene.packed = packed._replace(system=own.system, derived=own.derived)
        return True

    @property
    def is_brief(self):
        """Whether nothing is asked of runs that end within a slice but their states."""
        return self._slice is not None

    @property
    def has_other_rows(self):
        """Whether the last case had other redundant rows than the first."""
        return self.starts.has_other_rows

    @property
    def is_spoilt(self):
        """Whether a case has left bodies that turn behind, which the next one may not have."""
        return bool(self.packed.derived.turning)

    @property
    def is_immobile(self):
        """Whether redundant rows leave no degree of freedom, which the message of a run says."""
        rows, system = self.packed.derived.redundant, self.packed.system
        return rows is not None and self.kept.n == len(system.segments) - len(rows)

    def _memories(self):
        return [memory for spare in self.kept._spare.values() for memory in spare]

    def graphs(self):
        """The constraint graphs of the arena and of its runs."""
        known, series = self.packed.derived, vars(self.kept).get("series")
        others = [other.packed.derived.graph for other in self.starts.others]
        graphs = [found[0] for found in (known.graph, known.moving_graph, *others) if found is not None]
        return graphs if series is None else [*graphs, series.graph]

    def _weigh(self):
        """Write masses and inertias into the constraint graphs."""
        for graph in self.graphs():
            found = weights(self.packed.system, graph.bodies, {})
            for array, value in zip((graph.inverse, graph.mass, graph.spins), found, strict=True):
                array[...] = value

    def run_cases(self, chunk, k):
        """Run cases of a chunk from k on without Python between them; the first that was not run."""
        if self._batch is None or not self._takes(chunk):
            return k
        return self._batch.run(k, len(chunk.status))

    def _takes(self, chunk):
        """Have the pen lay out a chunk; False if there is none, or the chunk has no values for it."""
        if self.pen is None or chunk.values is None:
            return False
        if chunk is not self._chunk:
            self._chunk = chunk
            self.pen.take(chunk.values, len(chunk.status))
            if self._batch is not None:
                self._batch.enter(chunk)
        return True

    def run_case(self, chunk, k, scene):
        """As `run_packed`, case k of a chunk."""
        self.starts.has_other_rows = False
        if not self._takes(chunk):
            return None
        start, size = self.pen.write(k), self.pen.size(k)
        self.written |= self.pen.written
        if start is None:
            return None
        self.kept.packed = self.scene.packed = self.packed
        if size is not None:
            self.kept.packed = self.scene.packed = self.packed._replace(size=size)
            start = start[0].copy(), start[1].copy()  # of another size, if of the same numbers
        ran = self._run(start, scene, size is not None)
        if self._batch is None and ran is not None and Batch.serves(self):
            if self.study.lanes > 1 and self._slice is not None:
                from .lanes import LaneBatch

                self._batch = LaneBatch(self, ran[0], self._slice, self.study.lanes)
            elif isinstance(ran[1], Finished):
                self._batch = Batch(self, ran[0], self._slice)
            if self._batch is not None:
                self._batch.enter(chunk)
        return ran

    def run_packed(self, packed, start, scene):
        """The `Task` and the `Outcome` of a case, or a `Finished`; None if it can't be run here.

        `scene()` makes it a scene of its own.
        """
        self.starts.has_other_rows = False
        if not self.enter(packed):
            return None
        if packed.coordinates is not self.base.coordinates:
            start = tuple(np.array(array) for array in start)  # of another size, if of the same numbers
        return self._run(start, scene)

    def _run(self, start, scene, is_resized=False):
        if self.written & OF_ROWS and are_unequal(self.packed.system) != self.is_unequal:
            return None
        found = self.starts.start(start)
        if found is None:
            return None
        study, (memory, (q, qd)) = self.study, found
        if is_resized:  # what is packed beside the arrays is that of the base
            if self.packed.derived.redundant is not None:
                return None
            self.packed.derived.origin = q, None  # the pen has looked
        options, method, span = study.options, study.method, study.span
        choose = None
        if options.method is None:
            choose = prepared_run.turns_of(study.scene, self.kept, method, options.form, span, study.within)
        stops = self.kept.stops(*span, method.step is None) if study.retimes else study.stops
        task = Task(
            self.kept, method, options.form, span, q, qd, memory, study.times, study.within,
            options.dense_output, study.events, options.constraint_tol, options.max_steps,
            options.chart_interval or 0, study.report, options.history is not False, choose, stops,
        )  # fmt: skip
        outcome = None if self._slice is None or self.is_immobile else self._slice.run(task)
        if outcome is not None:
            return task, outcome
        if is_resized:
            return None
        outcome = run_task(task, self.scene, options.initial_tol)
        return None if prepared_run.instead(task, outcome.status) is not None else (task, outcome)
