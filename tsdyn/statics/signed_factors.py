"""Factors of the saddle-point matrix of a `Quadratic`, and the signs of its eigenvalues.

    [ K + mu D    A^T     ]
    [ A           -delta  ]

factored without exchange of rows has pivots with the signs of its eigenvalues (Sylvester's law of inertia). As many are
negative as there are rows if K + mu D is positive on the motions that the constraints admit (Gould, Math. Program. 32,
1985). Small delta keeps pivots of rows from being zero.
"""

import numpy as np

from ..maths.sparse_lu import sparse_lu
from .tolerances import CLEARLY, LEAST_DIVISOR, SHIFTS, SOFTENED, SOFTEST, SWEEPS


class Factors:
    """Of [K + mu D + floor, A^T; A, 0] by its diagonal alone.

    Attributes
    ----------
    negative : int
        How many eigenvalues are negative on the motions that the constraints admit, by more than rounding; -1 if that
        is not known.
    scale : ndarray (size,)
        By which increments are divided: the roots of the compliance of each body, by its size.
    """

    def __init__(self, quadratic, mu, least):
        frame, rest = quadratic.frame, quadratic.rest
        self._quadratic, self._mu, self._least = quadratic, mu, least
        local = np.maximum(quadratic.local + mu * quadratic.shift, LEAST_DIVISOR)
        self.scale = 1.0 / np.sqrt(local[frame.increments.body, 1 * ~frame.increments.translates])
        A = rest.A * self.scale[frame.rows.columns]
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, frame.own.size))
        self._lengths = np.where(rest.left_out, 1.0, np.maximum(lengths, LEAST_DIVISOR))
        self._A, self._left_out = A / self._lengths[frame.rows.rows], rest.left_out
        self._factors, self.negative = self._signed(CLEARLY)
        self._closing = None

    def _signed(self, share):
        """Factors, and how many eigenvalues of K + mu D + a share of S are negative."""
        factors = splu_of(self._matrix(share, SOFTENED), symmetric=True)
        if factors is None or not np.array_equal(factors.perm_r, factors.perm_c):
            return None, -1
        return factors, int((factors.U.diagonal() < 0.0).sum()) - self._quadratic.frame.own.size

    @property
    def positive(self):
        """Whether the matrix is positive on the motions that the constraints admit."""
        return self.negative == 0

    @property
    def size_of_loads(self):
        """The size of the loads that are left over, or balance each other, scaled."""
        return float(np.linalg.norm(self.scale * self._quadratic.rest.load))

    def _top(self, share):
        """Numbers for `Frame.blocks` of K + mu D + a share of the stiffness of each body, scaled."""
        quadratic, frame = self._quadratic, self._quadratic.frame
        floor = np.maximum(share * quadratic.local, self._least)
        added = np.zeros((len(floor), 6, 6))
        added[:, range(6), range(6)] = np.repeat(floor, 3, axis=1)
        top = quadratic.K + self._mu * quadratic.D + frame.stiffness(frame.no_pairs, added)
        return top * self.scale[frame.blocks.rows] * self.scale[frame.blocks.columns]

    def _matrix(self, share, below):
        """The same with rows, and minus `below` in their diagonal."""
        frame = self._quadratic.frame
        return frame.matrix(frame.saddle, self._top(share), self._A, np.where(self._left_out, -1.0, -below))

    def dense(self):
        """K (size, size) and A (m', size), scaled."""
        frame = self._quadratic.frame
        A = frame.rows.matrix(self._A).toarray()
        return frame.blocks.matrix(self._top(0.0)).toarray(), A[~self._left_out]

    def stiffness(self, x):
        """K x, scaled."""
        return self.scale * (self._quadratic.whole @ (self.scale * x))

    def positive_shift(self):
        """A share of S with which K is positive; None if there is none."""
        for share in SHIFTS:
            if self._signed(share)[1] == 0:
                return share
        return None

    def solver(self, share):
        """Return solve(b) = x with (K + a share of S) x + A^T lam = b, A x = 0, scaled."""
        factors = splu_of(self._matrix(share, 0.0))
        rows = np.zeros(self._left_out.size)
        return lambda b: factors.solve(np.concatenate((b.ravel(), rows)))[: b.size]

    def step(self, load):
        """The increment u; None where the matrix is singular."""
        if self._factors is None:
            return None
        return self._solved(self._factors, load)

    def newton(self, load):
        """The same by factors that are accurate down to a smaller floor."""
        factors = splu_of(self._matrix(SOFTEST, 0.0))
        return None if factors is None else self._solved(factors, load)

    def correction(self, bias):
        """The increment u with A u = bias, (m',), that strains least."""
        if self._closing is None:
            quadratic, frame = self._quadratic, self._quadratic.frame
            top = quadratic.strain * self.scale[frame.blocks.rows] * self.scale[frame.blocks.columns]
            self._closing = splu_of(frame.matrix(frame.saddle, top, self._A, np.where(self._left_out, -1.0, 0.0)))
        if self._closing is None:
            return np.full(self.scale.size, np.nan)
        bias = np.where(self._left_out, 0.0, bias / self._lengths)
        return self.scale * self._closing.solve(np.concatenate((np.zeros(self.scale.size), bias)))[: self.scale.size]

    def _solved(self, factors, load):
        found = factors.solve(np.concatenate((self.scale * load, np.zeros(self._left_out.size))))
        u = self.scale * found[: load.size]
        return u if np.isfinite(u).all() else None

    def downhill(self, load, rng):
        """A unit direction u of negative K by inverse iteration, along which a load does work; None without one."""
        u = rng.normal(size=load.size)
        for i in range(SWEEPS):  # the last by K, which leaves neutral directions out
            u = self.step(u / self.scale**2 if i < SWEEPS - 1 else self._quadratic.whole @ u)
            if u is None:
                return None
            u = u / np.linalg.norm(u / self.scale)
        if not self._quadratic.along(u) < -CLEARLY:
            return None
        return u if load @ u >= 0.0 else -u


def splu_of(matrix, symmetric=False):
    """The factors of a matrix, by its diagonal alone if symmetric; None where it is singular."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    try:
        return sparse_lu(matrix, **(options if symmetric else {}))
    except RuntimeError:
        return None
