"""The work along increments u of a configuration at rest to second order, and what makes it a minimum.

    load.u - u.(K + mu D + floor) u / 2,    A u = 0        K = (Phi_q^T lam)_q - Q_q by increments

D is isotropic for each body: the size of the geometric stiffness of its joints' reactions, and of the negative part
of its forces' stiffness. K + mu D is positive for mu near one at the latest, in any scene of any size, whatever the
number of bodies; D is nothing where nothing can be negative, as of springs that are stretched.

The signs of the pivots of

    [ K + mu D    A^T     ]
    [ A           -delta  ]

factored without exchange of rows are those of its eigenvalues (Sylvester); as many are negative as there are rows if
K + mu D is positive on the motions that the constraints admit (Gould 1985).
"""

from functools import cached_property

import numpy as np

from ..maths.sparse_lu import sparse_lu
from .tolerances import CLEARLY, LEAST_DIVISOR, NEUTRAL, SOFTENED, SOFTEST, SWEEPS


class Quadratic:
    """Of a `Rest`.

    Attributes
    ----------
    K : ndarray
        Numbers for `Frame.blocks`, N m.
    shift : ndarray (b, 2)
        D of shifts and of turns of each body, N m.
    """

    def __init__(self, rest):
        frame, P = rest.frame, rest.P
        self.rest, self.frame = rest, frame
        (nc, _), lam = frame.pairs.counts, rest.lam
        K, _, Q_q, Q_qd = frame.pairs.blocks(rest, lam)
        whole = np.concatenate((K, -rest.force_slopes(Q_q, Q_qd)))[frame.parts]
        T = np.zeros((len(whole), 14, 12))
        T[:, :7, :6], T[:, 7:, 6:] = P[frame.by_parts[:, 0]], P[frame.by_parts[:, 1]]
        blocks = T.swapaxes(1, 2) @ whole @ T
        inertial = P[:-1].swapaxes(1, 2) @ rest.own_slopes() @ P[:-1]
        self.K = frame.stiffness(blocks, inertial + self._normalised())
        self.shift = self._shift(blocks[: frame.constraints], blocks[frame.constraints :])
        self.shift += np.linalg.norm(inertial.reshape(-1, 2, 3, 6), axis=(2, 3))
        self.whole = frame.blocks.matrix(self.K)

    def _normalised(self):
        """(lam p) by p of the normalisations, of each body (b, 6, 6)."""
        rest, frame = self.rest, self.frame
        found = np.zeros((len(frame.metric.at) + 1, 7, 7))
        found[frame.normal_bodies, 3:, 3:] = rest.lam[frame.normals][:, None, None] * np.eye(4)
        P = rest.P[:-1]
        return P.swapaxes(1, 2) @ found[:-1] @ P

    def _shift(self, geometric, elastic):
        """D (b, 2)."""
        found = np.zeros((len(self.frame.metric.at) + 1, 2))
        sizes = np.linalg.norm(geometric.reshape(-1, 4, 3, 12), axis=(2, 3))
        least = np.zeros(len(elastic))
        some = np.flatnonzero(elastic.any(axis=(1, 2)))
        if some.size:
            least[some] = -np.linalg.eigvalsh(0.5 * (elastic[some] + elastic[some].swapaxes(1, 2)))[:, 0]
        least = np.where(least > 1e-12 * np.abs(elastic).max(axis=(1, 2), initial=0.0), least, 0.0)
        sizes = np.concatenate((sizes, np.repeat(least[:, None], 4, axis=1)))
        for half in range(2):
            np.add.at(found, self.frame.by_parts[:, half], sizes[:, 2 * half : 2 * half + 2])
        return found[:-1]

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
        """The largest entry of K of each body, N m (b,)."""
        frame = self.frame
        found = np.zeros(len(frame.metric.at))
        np.maximum.at(found, frame.increments.body[frame.blocks.rows], np.abs(self.K))
        found = np.maximum(found, self.shift.max(axis=1))
        return np.where(found > 1e-9 * found.max(initial=0.0), found, found.max(initial=0.0))

    def factors(self, mu, least):
        """The `Factors` at mu; least (b,), N m, stands for K where there is none."""
        return Factors(self, mu, least)

    def newton(self, load):
        """Newton's increment, to a minimum or not; None where the matrix is singular."""
        return Factors(self, 0.0, 0.0, definite=False).step(load)

    @cached_property
    def circulatory(self):
        """Whether loads have no potential: K isn't symmetric."""
        apart = self.whole - self.whole.T
        return bool(np.abs(apart.data).max(initial=0.0) > NEUTRAL * np.abs(self.K).max(initial=0.0))

    def along(self, u):
        """u.K u."""
        return float(u @ (self.whole @ u))


class Factors:
    """Of [K + mu D + floor, A^T; A, 0].

    Attributes
    ----------
    positive : bool
        Whether the matrix is positive on the motions that the constraints admit, or so little negative that it is
        rounding.
    """

    def __init__(self, quadratic, mu, least, definite=True):
        frame, rest = quadratic.frame, quadratic.rest
        m, body = frame.own.size, frame.increments.body
        D = mu * quadratic.shift
        self._scale = 1.0 / np.sqrt(np.maximum(quadratic.local + D.max(axis=1), LEAST_DIVISOR))[body]
        A = rest.A * self._scale[frame.rows.columns]
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, m))
        self._row_scale = 1.0 / np.where(rest.dropped, 1.0, np.maximum(lengths, LEAST_DIVISOR))
        self._quadratic, self._D, self._least = quadratic, D, least
        self._A, self._dropped = A * self._row_scale[frame.rows.rows], rest.dropped
        self.positive = definite and self._is_positive(m)
        if not definite or (self.positive and mu == 0.0):
            self._factors = splu_of(self._matrix(SOFTEST, 0.0))

    def _is_positive(self, m):
        self._factors = splu_of(self._matrix(CLEARLY, SOFTENED), symmetric=True)
        if self._factors is None or not np.array_equal(self._factors.perm_r, self._factors.perm_c):
            return False
        return int((self._factors.U.diagonal() < 0.0).sum()) == m

    def _matrix(self, share, below):
        """With a share of the stiffness of each body as floor, and minus `below` in the diagonal of the rows."""
        quadratic, scale = self._quadratic, self._scale
        frame = quadratic.frame
        D = self._D + np.maximum(share * quadratic.local, self._least)[:, None]
        added = np.zeros((len(D), 6, 6))
        added[:, [0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]] = np.repeat(D, 3, axis=1)
        top = quadratic.K + frame.stiffness(frame.no_pairs, added)
        top = top * scale[frame.blocks.rows] * scale[frame.blocks.columns]
        return frame.matrix(frame.saddle, top, self._A, np.where(self._dropped, -1.0, -below))

    def downhill(self, load, rng):
        """A unit direction u of negative K by inverse iteration, along which a load does work; None without one."""
        u = rng.normal(size=load.size)
        for i in range(SWEEPS):  # the last by K, which leaves neutral directions out
            u = self.step(u / self._scale**2 if i < SWEEPS - 1 else self._quadratic.whole @ u)
            if u is None:
                return None
            u = u / np.linalg.norm(u / self._scale)
        if not self._quadratic.along(u) < -CLEARLY:
            return None
        return u if load @ u >= 0.0 else -u

    def step(self, load):
        """The increment u; None where the matrix is singular."""
        if self._factors is None:
            return None
        found = self._factors.solve(np.concatenate((self._scale * load, np.zeros(self._row_scale.size))))
        u = self._scale * found[: load.size]
        return u if np.isfinite(u).all() else None


def splu_of(matrix, symmetric=False):
    """The factors of a matrix, by its diagonal alone if symmetric; None where it is singular."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    try:
        return sparse_lu(matrix, **(options if symmetric else {}))
    except RuntimeError:
        return None
