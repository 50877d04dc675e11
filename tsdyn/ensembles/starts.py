"""Consistent starts of the cases of an arena, checked as those of runs alone are."""

from types import SimpleNamespace

import numpy as np

from ..configuration.initial_conditions import RedundantStarts, RegularStarts, consistent
from ..configuration.mirrored_branches import demand_aligned
from ..formulations.locked_orientations import hold
from ..model.derived import Derived
from ..observables.friction_unique import demand_unique
from ..observables.state import remembered
from ..parameters.edit import KEPT
from ..runs.arguments import state_arrays

OF_ROWS = {"mass", "inertia"}  # what the independence of rows depends on, beside where things are


class Starts:
    """Checks and projects the starts of an arena, one after the other.

    Attributes
    ----------
    others : list
        The scene with other redundant rows, if there are any: unknown, and none.
    has_other_rows : bool
        Whether other rows were redundant at the last start than at the first.
    """

    def __init__(self, arena):
        self._arena, self.others, self.has_other_rows = arena, [], False
        self._known, self._regular, self._redundant = (None, None), None, None

    def start(self, start):
        """The memory of forces and a consistent start; None if the start needs a scene of its own."""
        arena, kept, packed = self._arena, self._arena.kept, self._arena.kept.packed
        study = arena.study
        t, tol, state = study.span[0], study.options.initial_tol, study.call.state
        q, qd = start if state is None else state_arrays(state, kept.n)
        known, found = self._known
        if known is q and not arena.written & OF_ROWS:
            return found
        memory = remembered(state, kept, t, q)
        if packed.system.memory.size:
            packed.system.reals[packed.system.memory] = memory[kept.handles.count :]
        started = self._started(q, qd, t, tol)
        if started is None or arena.is_spoilt:
            return None
        if known is not q:
            demand_aligned(packed, started[0], t)
        demand_unique(packed, started[0], t)
        found = memory, hold(packed, *started)
        self._known = q, found
        return found

    def kernel(self):
        """As of `RegularStarts`, once a start has been checked."""
        return self._regular.kernel()

    def _started(self, q, qd, t, tol):
        """A start as `consistent` returns it; None if it needs a scene of its own."""
        arena, derived = self._arena, self._arena.packed.derived
        if self._regular is None:
            self._regular = RegularStarts(arena.scene, q, qd, t, tol)
        if derived.redundant is None and self._regular.are_plain(q, qd):
            return q, qd
        if arena.kept.packed.coordinates is not arena.base.coordinates:
            return None
        if derived.redundant is None:
            return consistent(arena.scene, arena.packed.system, q, qd, t, tol, True)
        if self._redundant is None:
            self.others = [self._with_redundant(rows) for rows in (None, np.zeros(0, np.int64))]
            self._redundant = RedundantStarts([*self.others, arena.scene], q, qd, t, tol)
        started = self._redundant.landed(q, qd)
        self.has_other_rows = started is None
        return started

    def _with_redundant(self, rows):
        """The scene with the same arrays, and other redundant rows."""
        arena = self._arena
        derived = Derived(redundant=rows, shared=arena.study.family.shared)
        for name in KEPT:
            setattr(derived, name, getattr(arena.packed.derived, name))
        own = SimpleNamespace(**vars(arena.scene))
        own.packed = arena.packed._replace(derived=derived)
        return own
