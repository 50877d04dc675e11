"""Increments of a configuration by bodies: u = (dr / s, w), s a length of the scene, w a turn in the body frame, rad.

    r + s u_r,    p (x) exp(w / 2)                    dq = P u,  P = s I on r and G(p)^T / 2 on p

Six numbers a rigid body, three a point mass. Euler parameters stay normalised, so normalisation rows drop out.
"""

import numpy as np

from ..elements.bodies import transform_g
from .pattern import Pattern


class Increments:
    """Increments of the bodies of a `Metric`.

    Attributes
    ----------
    size : int
    body : ndarray (size,)
        Number of the body of each.
    translates : ndarray (size,) bool
    """

    def __init__(self, metric, reach):
        self.metric, self.reach, self.size = metric, reach, metric.size
        self.body = np.zeros(metric.size, int)
        self.body[metric.move] = np.arange(len(metric.at))[:, None]
        self.body[metric.turn] = np.flatnonzero(metric.rigid)[:, None]
        self.translates = np.zeros(metric.size, bool)
        self.translates[metric.move] = True
        self._columns = np.full((len(metric.at) + 1, 6), -1)  # of each body, the ground's last
        self._columns[:-1, :3] = metric.move
        self._columns[:-1][metric.rigid, 3:] = metric.turn
        self.own = Pattern.of_blocks(self._columns[:-1], self._columns[:-1], (self.size, self.size))

    def bodies_at(self, places, lengths):
        """Numbers of the bodies whose coordinates begin at some places, and are so many; the ground's is the last."""
        numbers = np.full(self.metric.n + 1, len(self.metric.at))
        numbers[self.metric.at] = np.arange(len(self.metric.at))
        return np.where(lengths > 0, numbers[places], len(self.metric.at))

    def columns_of(self, pairs):
        """Increments (k, 12) of pairs of bodies (k, 2), -1 where there are none."""
        return self._columns[pairs].reshape(len(pairs), 12)

    def at(self, q):
        """P of each body, (b + 1, 7, 6), zero for the ground."""
        P, metric = np.zeros((len(self._columns), 7, 6)), self.metric
        P[:-1, :3, :3] = self.reach * np.eye(3)
        P[:-1][metric.rigid, 3:, 3:] = 0.5 * transform_g(q[metric.p]).swapaxes(1, 2)
        return P

    def load(self, P, Q):
        """Generalised forces (size,) by increments, N m, of those by q (n,)."""
        found, metric = np.zeros(self.size), self.metric
        found[metric.move] = self.reach * Q[metric.r]
        found[metric.turn] = np.einsum("bij,bi->bj", P[:-1][metric.rigid, 3:, 3:], Q[metric.p])
        return found

    def inertia(self):
        """M of each body, (b, 6, 6), kg m^2."""
        system, rigid = self.metric.system, self.metric.rigid
        M = np.zeros((len(rigid), 6, 6))
        M[:, :3, :3] = self.reach**2 * system.mass[:, None, None] * np.eye(3)
        M[rigid, 3:, 3:] = system.inertia[rigid].reshape(-1, 3, 3)
        return M

    def kinetic(self, u):
        """The same in the kinetic metric."""
        metric = self.metric
        return metric.speeds(self.reach * u[metric.move], u[metric.turn])

    def moved(self, q, u):
        """The configuration after an increment."""
        return self.metric.moved(q, self.kinetic(u)[self.metric.columns])

    def extent(self, u):
        """The largest shift, m, and turn, rad."""
        shift, turn = (np.linalg.norm(u[at], axis=1).max(initial=0.0) for at in (self.metric.move, self.metric.turn))
        return self.reach * float(shift), float(turn)

    def accelerations(self, load):
        """Accelerations (b, 3), m/s^2, and of turns (b', 3), rad/s^2, by loads (size,) on bodies without joints.

        Bodies turn about any axis alike, so axes without inertia count as others do.
        """
        metric, system = self.metric, self.metric.system
        mean = np.trace(system.inertia[metric.rigid].reshape(-1, 3, 3), axis1=1, axis2=2)[:, None] / 3.0
        return load[metric.move] / system.mass[:, None] / self.reach, load[metric.turn] / mean

    def of(self, q, dq):
        """The increment that displaces q by dq (n,)."""
        u, metric = np.zeros(self.size), self.metric
        u[metric.move] = dq[metric.r] / self.reach
        u[metric.turn] = metric.spins(q, dq)
        return u
