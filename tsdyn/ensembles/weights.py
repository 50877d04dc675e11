"""Cases whose masses and inertias ask for other equations than those of the scene they vary."""

import numpy as np

from ..sparse.massless_axes import lean_bodies, levers
from ..sparse.tolerances import FAINT, THIN, UNEQUAL


class Weights:
    """Whether masses and inertias of the cases ask for no other equations than those of the arena.

    They do where a body has next to no inertia about an axis, also beside others (`massless_axes.lean_bodies`), or
    where masses become unequal (`length_metric.are_unequal`).
    """

    def __init__(self, base, is_unequal):
        self._base, self._is_unequal, self.far, self._thin = base, is_unequal, {}, False
        self._moments = np.linalg.eigh(base.system.inertia.reshape(-1, 3, 3))[0]
        self._levers, self._lean = levers(base), lean_bodies(base)
        self.masses, self.moments, self.inertias = {}, {}, {}  # by body, of each case

    def follow(self, body):
        """Look after a body whose mass or inertia differs."""
        if body.dimension == 7:
            self.far[body.index] = float(self._levers[body.index] ** 2)
            self._thin |= body.index in self._lean

    def fit(self, count):
        """Which of so many cases do not."""
        fits = np.full(count, not self._thin)
        if self._thin or not self.far.keys() | self.masses.keys():
            return fits
        for i, far in self.far.items():
            m, moments = self.masses.get(i, self._base.system.mass[i]), self.moments.get(i, self._moments[i : i + 1])
            fits &= ~(moments[:, 0] < THIN * np.maximum(moments[:, 2], m * far))
        return fits & ~self._are_light(count) & (self._are_unequal(count) == self._is_unequal)

    def _are_light(self, count):
        """Which cases may have light bodies that carry others."""
        moments, rigid = self._moments, self._base.system.bodies[:, 1] == 7
        least, most = np.full(count, np.inf), np.zeros(count)
        for i in np.flatnonzero(rigid):
            own = self.moments.get(i, moments[i : i + 1])
            far = self.masses.get(i, self._base.system.mass[i]) * self._levers[i] ** 2
            least, most = np.minimum(least, own[:, 0]), np.maximum(most, np.maximum(own[:, 2], far))
        return least < FAINT * most

    def _are_unequal(self, count):
        """As `length_metric.are_unequal`, of each case."""
        system, found = self._base.system, np.zeros(count, bool)
        for own, varied in ((system.mass, self.masses), (np.abs(system.inertia).max(axis=1), self.inertias)):
            others = own > 0.0  # zero for the inertia of a point mass
            others[list(varied)] = False
            every = [own[others][None], *(column[:, None] for column in varied.values())]
            every = np.hstack([np.broadcast_to(columns, (count, columns.shape[1])) for columns in every])
            if every.size:
                found |= every.max(axis=1) > UNEQUAL * every.min(axis=1)
        return found
