"""Cache of data derived from a packed scene, shared by its runs until the scene changes."""

from functools import cached_property

import numpy as np

from ..configuration.initial_conditions import consistent
from ..configuration.mirrored_branches import demand_aligned
from ..formulations.locked_orientations import hold, still
from ..model.handles import handles_of
from ..model.packed import with_curvatures
from ..model.packed_forces import with_force_jacobians
from ..observables.friction_unique import demand_unique
from ..taylor.layout import refusal
from ..taylor.run_memory import Series

SPARE = 8  # memories of a kind that are kept for further runs: as many may run at once without making new ones
KINDS = 8  # of memory, and of shapes of a scene, before all are dropped
LARGEST = 1 << 24  # bytes of a memory that is kept


def prepared(scene):
    """The `Prepared` of a scene as it is now."""
    scene.refresh()
    packed, kept = scene.packed, scene._prepared
    if kept is None or kept.packed is not packed:
        kept = scene._prepared = Prepared(scene, packed)
    return kept


class Prepared:
    """A packed scene and the start that was last found consistent; and the memory of runs that have ended.

    That memory is the scene's own: one whose numbers have changed, and nothing else, uses it again.
    """

    def __init__(self, scene, packed):
        self.packed, self.motions = packed, scene.motions()
        self.n, self.m = int(packed.system.bodies[:, 1].sum()), packed.system.segments.shape[0]
        self._start, self.explicit = (None, None), {}  # `explicit`: the method last chosen, see method_choice.py
        every = scene.__dict__.setdefault("_spare", {})
        if len(every) >= KINDS:
            every.clear()
        self.handles = handles_of(packed)
        self._spare = every.setdefault((self.handles.count, *(array.shape for array in packed.system)), {})

    @cached_property
    def implicit(self):
        """The system with what implicit methods need, and how many floats they keep for forces."""
        return with_force_jacobians(self.packed._replace(system=with_curvatures(self.packed)))

    @cached_property
    def spheres(self):
        """How many rigid bodies have no gyroscopic torque, whatever they do."""
        J = self.packed.system.inertia[self.packed.system.bodies[:, 1] == 7].reshape(-1, 3, 3)
        return int((J[:, :1, :1] * np.eye(3) == J).all(axis=(1, 2)).sum())

    @property
    def still(self):
        """How many rigid bodies never turn."""
        return len(still(self.packed).bodies)

    @cached_property
    def refusal(self):
        """Why Taylor series can't run the scene; empty where they can."""
        return refusal(self.packed)

    @cached_property
    def series(self):
        """What Taylor runs share, a `Series`."""
        return Series(self.packed, self.refusal)

    def system(self, implicit):
        """The system for a method, and how many floats it keeps for forces."""
        return self.implicit if implicit else (self.packed.system, 0)

    def start(self, scene, q, qd, t, tol, remembered, redundant_allowed):
        """(q, qd) checked against the constraints and freed of rounding; looked at once for the same numbers."""
        given = q.tobytes(), qd.tobytes(), t, tol, remembered.tobytes(), redundant_allowed
        known, start = self._start
        if known != given:
            system, before = self.packed.system, still(self.packed)
            redundant = self.packed.derived.redundant
            if system.memory.size:
                system = system._replace(reals=system.reals.copy())
                system.reals[system.memory] = remembered[self.handles.count :]
            start = consistent(scene, system, q, qd, t, tol, redundant_allowed)
            if self.packed.derived.redundant is not redundant or still(self.packed) is not before:
                self.__dict__.pop("series", None)  # the rows that are left out belong to a network
                self._spare.clear()
            demand_aligned(self.packed, start[0], t)
            demand_unique(self.packed, start[0], t)
            start = hold(self.packed, *start)
            self._start = given, start
        return start

    def take(self, kind, make):
        """A memory of some kind, for one run: one that is spare, or make()."""
        try:
            return self._spare[kind].pop()
        except (KeyError, IndexError):
            return make()

    def give(self, kind, memory):
        """Take back a memory that nothing refers to any more."""
        if memory.nbytes > LARGEST:
            return
        if len(self._spare) >= KINDS:
            self._spare.clear()
        spare = self._spare.setdefault(kind, [])
        if len(spare) < SPARE:
            spare.append(memory)
