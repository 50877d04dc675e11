"""What acts on a configuration in steady motion, seen from the turning axes.

The loads that reactions balance are Q_A + Q_v - M D D (q - c), with qd = D (q - c) and qdd = D D (q - c). Their
stiffness is

    M D D - C* D + K*        C* = (Q_A + Q_v)_qd,    K* = (M qdd - Q_A - Q_v)_q + (Phi_q^T lam)_q
"""

from types import SimpleNamespace

import numpy as np

from ..observables.evaluate import mass_matrix_sparse
from ..observables.generalised_forces import velocity_forces
from .reduction import inertia_derivatives
from .rest import Rest


class SteadyRest(Rest):
    """A `Rest` with the velocities of a `SteadyField`; the last argument."""

    def __init__(self, frame, memory, q, field):
        self.field, self.M = field, mass_matrix_sparse(frame.system, q)
        super().__init__(frame, memory, q)

    def _rates(self):
        return self.field.levels(self.q)

    def loads_at(self, q):
        """Q_A + Q_v - M qdd (n,) at other positions."""
        qd, qdd = self.field.levels(q)
        M = self.M if q is self.q else mass_matrix_sparse(self.frame.system, q)
        return self.applied(q, qd) + velocity_forces(self.system, q[None], qd[None])[0] - M @ qdd

    def force_slopes(self, Q_q, Q_qd):
        """The derivative of the forces along with their velocities."""
        frame = self.frame
        D = np.zeros((len(Q_q), 14, 14))
        by_forces, blocks = frame.by_parts[frame.constraints :], self._of_bodies(self.field.D)
        D[:, :7, :7], D[:, 7:, 7:] = blocks[by_forces[:, 0]], blocks[by_forces[:, 1]]
        return Q_q + Q_qd @ D

    def own_slopes(self):
        """The derivative of M qdd - Q_v along with the velocities."""
        levels, metric = (self.q, self.qd, self.qdd), self.frame.metric
        shim = SimpleNamespace(
            q=self.q, system=self.system, rigid=metric.rigid, parameters=lambda level: levels[level][metric.p]
        )
        K, C = inertia_derivatives(shim)
        D = self.field.D
        return self._of_bodies(self.M @ D @ D - C @ D + K)[:-1]

    def _of_bodies(self, matrix):
        """Blocks (b + 1, 7, 7) of a sparse (n, n); zero for the ground."""
        metric, found = self.frame.metric, np.zeros((len(self.frame.metric.at) + 1, 7, 7))
        body = np.zeros(metric.n, int)
        body[metric.r], body[metric.p] = np.arange(len(metric.at))[:, None], np.flatnonzero(metric.rigid)[:, None]
        matrix = matrix.tocoo()
        i, j = matrix.coords
        np.add.at(found, (body[i], i - metric.at[body[i]], j - metric.at[body[i]]), matrix.data)
        return found
