"""The work along increments u of a configuration at rest to second order, and what makes it a minimum.

    load.u - u.(K + mu D + floor) u / 2,    A u = 0        K = (Phi_q^T lam)_q - Q_q by increments

D is of each constraint and force by itself, for turns of its bodies about any axis and differences of their shifts:
the size of the geometric stiffness of a reaction, and of the negative part of the stiffness of a force. K + mu D is
positive for mu near one at the latest, whatever the size of the scene and the number of bodies; D is nothing where
nothing can be negative, as of springs that are stretched.
"""

from functools import cached_property

import numpy as np

from .signed_factors import Factors
from .tolerances import MASSLESS, NEUTRAL_ASYMMETRY, NOTHING


class Quadratic:
    """Of a `Rest`.

    Attributes
    ----------
    K : ndarray
        Numbers for `Frame.blocks`, N m.
    D : ndarray
        The same of D.
    shift : ndarray (b, 2)
        Its size by shifts and by turns of each body, N m.
    """

    def __init__(self, rest):
        frame, P = rest.frame, rest.P
        self.rest, self.frame = rest, frame
        K, _, Q_q, Q_qd = frame.pairs.blocks(rest, rest.lam)
        whole = np.concatenate((K, -rest.force_slopes(Q_q, Q_qd)))[frame.parts]
        T = np.zeros((len(whole), 14, 12))
        T[:, :7, :6], T[:, 7:, 6:] = P[frame.by_parts[:, 0]], P[frame.by_parts[:, 1]]
        blocks = T.swapaxes(1, 2) @ whole @ T
        inertial = P[:-1].swapaxes(1, 2) @ rest.own_slopes() @ P[:-1]
        self.K = frame.stiffness(blocks, inertial + self._normalised())
        norms, negative = self._sizes(blocks)
        self.shift = self._of_bodies(negative) + np.linalg.norm(inertial.reshape(-1, 2, 3, 6), axis=(2, 3))
        self.D = frame.stiffness(self._structured(negative), _diagonal(self.shift - self._of_bodies(negative)))
        self._norms = norms
        self.whole = frame.blocks.matrix(self.K)

    def _normalised(self):
        """(lam p) by p of the normalisations, of each body (b, 6, 6)."""
        rest, frame = self.rest, self.frame
        found = np.zeros((len(frame.metric.at) + 1, 7, 7))
        found[frame.normal_bodies, 3:, 3:] = rest.lam[frame.normals][:, None, None] * np.eye(4)
        P = rest.P[:-1]
        return P.swapaxes(1, 2) @ found[:-1] @ P

    def _sizes(self, blocks):
        """Of each part, by shifts and turns of its bodies, N m (e, 4): the size of K, and of what may be negative."""
        norms, first = np.linalg.norm(blocks.reshape(-1, 4, 3, 12), axis=(2, 3)), self.frame.constraints
        negative, forces = norms.copy(), blocks[first:]
        least, some = np.zeros(len(forces)), np.flatnonzero(forces.any(axis=(1, 2)))
        if some.size:
            least[some] = -np.linalg.eigvalsh(0.5 * (forces[some] + forces[some].swapaxes(1, 2)))[:, 0]
        least = np.where(least > NOTHING * np.abs(forces).max(axis=(1, 2), initial=0.0), least, 0.0)
        has = norms > NOTHING * norms.max(axis=1, initial=0.0)[:, None]
        negative[first:] = np.where(has[first:], least[:, None], 0.0)
        return norms, negative

    def _of_bodies(self, sizes):
        """Sums (b, 2) of sizes (e, 4)."""
        found = np.zeros((len(self.frame.metric.at) + 1, 2))
        for half in range(2):
            np.add.at(found, self.frame.by_parts[:, half], sizes[:, 2 * half : 2 * half + 2])
        return found[:-1]

    def _structured(self, sizes):
        """Blocks (e, 12, 12) of sizes (e, 4): of turns, and of the difference of shifts, which alone strains a part."""
        shifts, one = np.maximum(sizes[:, 0], sizes[:, 2])[:, None, None], np.eye(3)
        found = np.zeros((len(sizes), 12, 12))
        found[:, :3, :3] = found[:, 6:9, 6:9] = shifts * one
        found[:, :3, 6:9] = found[:, 6:9, :3] = -shifts * one
        found[:, 3:6, 3:6], found[:, 9:, 9:] = sizes[:, 1, None, None] * one, sizes[:, 3, None, None] * one
        return found

    @cached_property
    def strain(self):
        """Numbers for `Frame.blocks` of a norm that exceeds K, in which increments of little strain are small."""
        return self.frame.stiffness(self._structured(self._norms), _diagonal(MASSLESS * self.local))

    @cached_property
    def rate(self):
        """The largest entry of K over that of M, 1/s^2."""
        frame = self.frame
        M = np.einsum("bii->bi", frame.increments.inertia())
        mass = np.repeat(M.reshape(-1, 2, 3).mean(axis=2)[:, :, None], 3, axis=2)
        root = np.ones(frame.increments.size)
        root[frame.metric.move], root[frame.metric.turn] = mass[:, 0], mass[frame.metric.rigid, 1]
        root = np.sqrt(root)
        return float(np.abs(self.K / root[frame.blocks.rows] / root[frame.blocks.columns]).max(initial=0.0))

    @cached_property
    def local(self):
        """The largest entries of K of each body by shifts and by turns, N m (b, 2); of others where it has none."""
        frame = self.frame
        kinds = 2 * frame.increments.body + ~frame.increments.translates
        rows, columns = kinds[frame.blocks.rows], kinds[frame.blocks.columns]
        found = np.zeros((len(frame.metric.at), 2))
        alike = (rows - columns) % 2 == 0
        np.maximum.at(found.reshape(-1), rows[alike], np.abs(self.K[alike]))
        found = np.maximum(found, self.shift)
        found = np.where(found > NOTHING * found.max(axis=1, initial=0.0)[:, None], found, found[:, ::-1])
        return np.where(found > NOTHING * found.max(initial=0.0), found, found.max(initial=0.0))

    def factors(self, mu, least):
        """The `Factors` at mu; least (b,), N m, stands for K where there is none."""
        return Factors(self, mu, least)

    @cached_property
    def circulatory(self):
        """Whether loads have no potential: K isn't symmetric."""
        apart = self.whole - self.whole.T
        return bool(np.abs(apart.data).max(initial=0.0) > NEUTRAL_ASYMMETRY * np.abs(self.K).max(initial=0.0))

    def along(self, u):
        """u.K u."""
        return float(u @ (self.whole @ u))


def _diagonal(sizes):
    """Blocks (b, 6, 6) of sizes (b, 2)."""
    found = np.zeros((len(sizes), 6, 6))
    found[:, range(6), range(6)] = np.repeat(sizes, 3, axis=1)
    return found
