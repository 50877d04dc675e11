"""Cache of data derived from a packed scene, shared by its runs until the scene changes."""

import copy
from functools import cached_property
from operator import is_not
from threading import RLock

import numpy as np

from ..configuration.initial_conditions import consistent
from ..configuration.motor_starts import demand_aligned
from ..errors import StorageError
from ..formulations.locked_orientations import hold, still
from ..jit.interrupts import CollectionsDeferred
from ..methods.integrator import is_plain
from ..model.equations import (
    depends_on_time,
    sampled_loads,
    user_kinds,
    watched_loads,
    with_curvatures,
    with_force_jacobians,
)
from ..model.handles import handles_of
from ..motions.knots import NO_CHANGES, NO_STOPS, changes, is_noise, sample_times, stops_of, within_step
from ..observables.reactions import demand_unique
from ..rows.constraint_graph import redundant_rows
from ..runs.driver import instants_of, sampled
from ..taylor.layout import pays, refusal
from ..taylor.series_engine import Series, SeriesEngine
from .phase_scenes import demand_bilateral

preparing = RLock()  # threads that prepare a scene at once share what they find
SPARE = 8  # idle memories of a kind that are kept: as many runs at once allocate nothing
OF_NUMBERS = {"implicit", "spheres", "series", "sampled", "off"}  # what `Prepared` derives from them
KINDS = 8  # kinds of memory, and shapes of a scene, at most
LARGEST = 1 << 24  # bytes of a memory that is kept, at most
STARTS = 4  # that are kept: a run with contacts has two, with all of them open and as they are
SMALL = 1 << 20  # the same where engines that take turns have one each
FEW_LAYOUTS = 2  # of memories that other engines have used


def prepared(scene):
    """Return the `Prepared` of the present scene, which is to be run."""
    kept = prepared_numbers(scene)
    demand_bilateral(scene)
    return kept


def prepared_numbers(scene):
    """The same of any scene: one with contacts is not run by it, see contact_run.py."""
    if scene._lacks:
        raise StorageError(scene._lacks)
    if scene._users:
        scene.refresh()
    kept = scene._prepared
    if kept is None:
        with preparing:
            kept = scene._prepared
            if kept is None and scene._base in (None, scene):
                kept = scene._prepared = Prepared(scene, scene.packed)
            elif kept is None:
                kept = scene._prepared = prepared_numbers(scene._base).of_phase(scene.packed)
    return kept


class Prepared:
    """A packed scene, its last consistent starts, and the memory of finished runs.

    The memory belongs to the scene; after a change of numbers alone it is used again.
    """

    @CollectionsDeferred()
    def __init__(self, scene, packed):
        self.packed, self.motions = packed, scene.motions()
        self.n, self.m = int(packed.system.bodies[:, 1].sum()), packed.system.segments.shape[0]
        self._starts = {}  # the last ones that were checked, by what was asked
        self.runs = ()  # the last ones that `simulate` has prepared
        self._changes = None, []  # span, and what `_changes_of` has found of motions in it
        self.remembers = bool(packed.system.memory.size or handles_of(packed).count)
        every = scene.__dict__.setdefault("_spare", {})
        if len(every) >= KINDS:
            every.clear()
        self.handles = handles_of(packed)
        self._spare = every.setdefault((self.handles.count, *(array.shape for array in packed.system)), {})

    def like(self, packed):
        """The same for a scene of the family, packed with other numbers."""
        other = copy.copy(self)
        for name in OF_NUMBERS & vars(other).keys():
            del vars(other)[name]
        other.packed, other._starts, other._spare, other.runs = packed, {}, {}, ()
        other._changes = None, []
        other.handles = handles_of(packed)
        return other

    def of_phase(self, packed):
        """The same for a phase in which other rows hold, with the same series and memory."""
        other = self.like(packed)
        other._spare = self._spare
        if not self.refusal:
            other.series = self.series
        return other

    @cached_property
    def off(self):
        """The rows of Phi that hold nothing in a phase, None where there are no such rows."""
        return None if self.packed.derived.switched is None else redundant_rows(self.packed)

    @cached_property
    def implicit(self):
        """The system with the loops of implicit methods, and floats for forces: by whether the form is basis-free."""
        return {}

    @cached_property
    def spheres(self):
        """Number of rigid bodies with spherical inertia, which have no gyroscopic torque."""
        J = self.packed.system.inertia[self.packed.system.bodies[:, 1] == 7].reshape(-1, 3, 3)
        return int((J[:, :1, :1] * np.eye(3) == J).all(axis=(1, 2)).sum())

    @property
    def still(self):
        """Number of rigid bodies with locked orientation."""
        return len(still(self.packed).bodies)

    @cached_property
    def refusal(self):
        """The reason why the scene has no Taylor series; empty if it has."""
        return refusal(self.packed)

    @cached_property
    def pays(self):
        """Whether Taylor series are quicker than a Runge-Kutta method."""
        return pays(self.packed.constraints, [load.force for load in self.packed.loads])

    @cached_property
    def sharp(self):
        """Whether a force changes within less than its series shows."""
        return any(load.force.sharp for load in self.packed.loads)

    @cached_property
    def slips(self):
        """Whether there is friction, which changes at rest within the slip velocity."""
        return any(load.force.slips for load in self.packed.loads)

    @cached_property
    def rough(self):
        """Titles of the forces that depend on reactions."""
        return [load.force.title for load in self.packed.loads if "normal_load" in load.force.kernels]

    @cached_property
    def veers(self):
        """Whether there is friction of the exact law whose direction turns: fast where the slip is slow."""
        return any(slide.directions > 1 for load in self.packed.loads for slide in getattr(load.force, "slides", ()))

    @cached_property
    def series(self):
        """Data shared by Taylor runs, a `Series`."""
        return Series(self.packed, self.refusal)

    @cached_property
    def sampled(self):
        """The loads whose functions are sampled."""
        return sampled(self.packed)

    @cached_property
    def watched(self):
        """What `watched_loads` gives."""
        return watched_loads(self.packed)

    @cached_property
    def _has_stops(self):
        return bool(self.sampled) or any(each.pieces for given in self.motions for each in given.motions)

    @cached_property
    def _functions(self):
        """The functions of time that may change shortly, and the kinds of forces that run what a user has written."""
        found = [(getattr(motion, "source", None) or (motion.given, motion.smooth), motion) for motion in self.motions]
        return [*dict(pair for pair in found if pair[1].may_change).values()], user_kinds(self.packed)

    @cached_property
    def _changing(self):
        """The same, but for kinds that don't depend on time."""
        motions, kinds = self._functions
        return motions, [(i, force) for i, force in kinds if depends_on_time(force)]

    def stops(self, t0, t1, adaptive=False):
        """The stops of a run from t0 to t1, as of `stops_of`; refuses a motion that the run can't follow.

        adaptive: whether steps may be cut where functions change shortly.
        """
        for motion in self.motions:
            motion.check(t0, t1)
        found = NO_CHANGES
        if adaptive and any(self._changing):
            found = np.unique(np.concatenate([each for _, each in self._changes_of(t0, t1)]), axis=0)
        if not (self._has_stops or found.size):
            return NO_STOPS
        return stops_of(self.motions, instants_of(self.packed, t0, t1), found, t0, t1)

    def _changes_of(self, t0, t1):
        """What functions are, and intervals (k, 2), s, in which each changes shortly.

        Those of motions are kept, of one span; those of loads depend on numbers that cases of an ensemble change.
        """
        (span, known), t, (motions, kinds) = self._changes, sample_times(t0, t1), self._changing
        if span != (t0, t1):
            known = self._changes_in(t, (motions, []))
            self._changes = (t0, t1), known
        return known + self._changes_in(t, ([], kinds))

    def _changes_in(self, t, functions):
        return [(what, changes(t, [values])) for what, values in self._sampled(t, functions)]

    def _sampled(self, t, functions):
        """What functions are, and values (k,) at times t (k,)."""
        motions, kinds = functions
        with np.errstate(all="ignore"):
            found = [(motion.what, values) for motion in motions for values in motion.sampled(t)]
            return found + sampled_loads(self.packed, kinds, t)

    def unresolved(self, t0, t1, h):
        """Say what changes within less than steps of a fixed length h; "" for nothing."""
        if any(self._changing):
            for what, found in self._changes_of(t0, t1):
                for begin, end in found:
                    if end - begin < h:
                        return (
                            f"{what}: the function changes within {end - begin:.2g} s at t = {end:.6g} s, which steps "
                            f"of {h:g} s don't resolve: give a shorter step or max_step, or an adaptive method."
                        )
        return ""

    def noise(self, t, h):
        """What is noise within a step from t to t + h; "" for nothing."""
        if not any(self._functions):
            return ""
        found = self._sampled(within_step(t, h), self._functions)
        return next((what for what, values in found if is_noise(values)), "")

    def engine(self, kind, method, form, within):
        """The engine of a method, as `frozen` returns it, in a form; see runs/driver.py.

        That of a plain method serves again until other rows or bodies take part in the equations.
        """
        known = self.series.engines if kind is SeriesEngine else self.packed.derived.engines
        key = kind, method, form.name, within
        engine = known.get(key)
        if engine is None:
            with CollectionsDeferred():
                engine = kind(self, method, form, within)
            if is_plain(method):
                if len(known) >= KINDS:
                    known.clear()
                known[key] = engine
        return engine

    def system(self, implicit, basis_free):
        """Return the system for a method and a form, and its number of floats for forces."""
        if not implicit:
            return self.packed.system, 0
        if basis_free not in self.implicit:
            system = with_curvatures(self.packed, basis_free)
            self.implicit[basis_free] = with_force_jacobians(self.packed._replace(system=system))
        return self.implicit[basis_free]

    def start(self, scene, given, t, tol, remembered, redundant_allowed):
        """Return given positions and velocities (q, qd) checked and projected, not to be written to.

        The same ones are checked once.
        """
        options = t, tol, remembered.tobytes(), redundant_allowed
        checked, found, start = self._starts.get(options, (None, None, None))
        if checked is None or any(map(is_not, found, self._found)) or not _same(given, checked):
            start = self._projected(scene, *given, t, tol, remembered, redundant_allowed)
            if len(self._starts) >= STARTS:
                self._starts = {}
            self._starts[options] = given, self._found, start
        return start

    @property
    def _found(self):
        """What a start may find out of the packed scene: redundant rows, and bodies that don't turn."""
        return self.packed.derived.redundant, still(self.packed)

    @CollectionsDeferred()
    def _projected(self, scene, q, qd, t, tol, remembered, redundant_allowed):
        system, before = self.packed.system, still(self.packed)
        redundant = self.packed.derived.redundant
        if system.memory.size:
            system = system._replace(reals=system.reals.copy())
            system.reals[system.memory] = remembered[self.handles.count :]
        start = consistent(scene, system, q, qd, t, tol, redundant_allowed)
        if self.packed.derived.redundant is not redundant or still(self.packed) is not before:
            self.__dict__.pop("series", None)  # its graph has other redundant rows
            self._spare.clear()
        demand_aligned(self.packed, start[0], t)
        demand_unique(self.packed, start[0], t)
        return hold(self.packed, *start)

    def take(self, engine):
        """An idle memory for one run by an engine, laid out for it where there is such a one; else a new one.

        Engines that take turns have one each after some runs.
        """
        try:
            spare = self._spare[engine.kind]
            memory = spare.pop()
            if memory.engine is engine:
                return memory
            for other in [*spare]:
                if other.engine is engine:
                    spare.remove(other)  # ValueError if a thread has been quicker
                    spare.append(memory)
                    return other
        except (KeyError, IndexError, ValueError):
            return self.new_memory(engine)
        if not engine.serves(memory):
            return self.new_memory(engine)
        if engine.layouts > FEW_LAYOUTS and self._has_room(memory):
            self.give(engine.kind, memory)
            return self.new_memory(engine)
        return memory

    @CollectionsDeferred()
    def new_memory(self, engine):
        """A memory of its own for a run."""
        return engine.memory(self)

    def _has_room(self, memory):
        """Whether one more memory like this one is kept."""
        return sum(map(len, [*self._spare.values()])) < KINDS - 1 and memory.nbytes <= SMALL

    def give(self, kind, memory):
        """Take back a memory that is no longer in use."""
        if memory.nbytes > LARGEST:
            return
        spare = self._spare.get(kind)
        if spare is None:
            if len(self._spare) >= KINDS:
                self._spare.clear()
            spare = self._spare.setdefault(kind, [])
        if len(spare) < SPARE:
            spare.append(memory)


def _same(one, other):
    """Return True if tuples of arrays are the same, or have the same bits."""
    return one is other or [each.tobytes() for each in one] == [each.tobytes() for each in other]
