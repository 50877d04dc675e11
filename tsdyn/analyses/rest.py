"""A configuration at rest: loads, multipliers that balance most, and the work of increments to second order."""

from functools import cached_property

import numpy as np

from ..elements.bodies import transform_g
from ..errors import SingularConfiguration
from ..maths.dense_linalg import sparse_lu
from ..maths.tolerances import HALF_DIGITS, NEGLIGIBLE, ROUNDING, TINY
from ..model.equations import WIDTH, as_csr
from ..observables.evaluate import NOT_UNIQUE, constraint_arrays
from ..observables.generalised_forces import applied_loads
from . import tolerances as limits

# Sparse matrices of one sparsity and many values: sums of blocks, whose places are found once.


class SparsePattern:
    """Where numbers at (rows, columns), both (k,), of a matrix add up; a negative row or column has none."""

    def __init__(self, rows, columns, shape):
        self._used = np.flatnonzero((rows >= 0) & (columns >= 0))
        keys = columns[self._used].astype(np.int64) * shape[0] + rows[self._used]
        found, self._slots = np.unique(keys, return_inverse=True)
        self.rows, self.shape = (found % shape[0]).astype(np.int32), shape
        self.columns = found // shape[0]
        self._starts = np.searchsorted(self.columns, np.arange(shape[1] + 1)).astype(np.int32)

    @classmethod
    def of_blocks(cls, rows, columns, shape):
        """Of blocks (k, a, b) at rows (k, a) and columns (k, b)."""
        i, j = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
        return cls(i.ravel(), j.ravel(), shape)

    @classmethod
    def of_parts(cls, parts, shape):
        """Of several patterns, each with the row and the column where it begins; values follow one another."""
        rows = np.concatenate([part.rows + first for part, first, _ in parts])
        columns = np.concatenate([part.columns + first for part, _, first in parts])
        return cls(rows, columns, shape)

    def sum(self, values):
        """The numbers of the matrix that are not zero, of values (k,)."""
        return np.bincount(self._slots, values.ravel()[self._used], self.rows.size)

    def matrix(self, data):
        """The matrix, SciPy's CSC, of what `sum` returns."""
        from scipy.sparse import csc_array

        return csc_array((data, self.rows, self._starts), self.shape)


# Increments of a configuration by bodies: u = (dr / s, w), s a length of the scene, w a turn in the body frame, rad.
#
#     r + s u_r,    p (x) exp(w / 2)                    dq = P u,  P = s I on r and G(p)^T / 2 on p
#
# Six numbers a rigid body, three a point mass. Euler parameters stay normalised, so normalisation rows drop out.


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
        self.own = SparsePattern.of_blocks(self._columns[:-1], self._columns[:-1], (self.size, self.size))

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


# Factors of the saddle-point matrix of a `Quadratic`, and the signs of its eigenvalues.
#
#     [ K + mu D    A^T     ]
#     [ A           -delta  ]
#
# factored without exchange of rows has pivots with the signs of its eigenvalues (Sylvester's law of inertia). As many
# are negative as there are rows if K + mu D is positive on the motions that the constraints admit (Gould, Math.
# Program. 32, 1985). Small delta keeps pivots of rows from being zero.


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
        local = np.maximum(quadratic.local + mu * quadratic.shift, TINY)
        self.scale = 1.0 / np.sqrt(local[frame.increments.body, 1 * ~frame.increments.translates])
        A = rest.A * self.scale[frame.rows.columns]
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, frame.own.size))
        self._lengths = np.where(rest.left_out, 1.0, np.maximum(lengths, TINY))
        self._A, self._left_out = A / self._lengths[frame.rows.rows], rest.left_out
        self._factors, self.negative = self._signed(HALF_DIGITS)
        self._closing = None

    def _signed(self, share):
        """Factors, and how many eigenvalues of K + mu D + a share of S are negative."""
        factors = splu_of(self._matrix(share, limits.REGULARISED), symmetric=True)
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
        for share in limits.SHIFTS:
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
        factors = splu_of(self._matrix(limits.STIFFNESS_ROUNDING, 0.0))
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
        for i in range(limits.SWEEPS):  # the last by K, which leaves neutral directions out
            u = self.step(u / self.scale**2 if i < limits.SWEEPS - 1 else self._quadratic.whole @ u)
            if u is None:
                return None
            u = u / np.linalg.norm(u / self.scale)
        if not self._quadratic.along(u) < -HALF_DIGITS:
            return None
        return u if load @ u >= 0.0 else -u


def splu_of(matrix, symmetric=False):
    """The factors of a matrix, by its diagonal alone if symmetric; None where it is singular."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    try:
        return sparse_lu(matrix, **(options if symmetric else {}))
    except RuntimeError:
        return None


# The work along increments u of a configuration at rest to second order, and what makes it a minimum.
#
#     load.u - u.(K + mu D + floor) u / 2,    A u = 0        K = (Phi_q^T lam)_q - Q_q by increments
#
# D is of each constraint and force by itself, for turns of its bodies about any axis and differences of their shifts:
# the size of the geometric stiffness of a reaction, and of the negative part of the stiffness of a force. K + mu D is
# positive for mu near one at the latest, whatever the size of the scene and the number of bodies; D is nothing where
# nothing can be negative, as of springs that are stretched.


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
        least = np.where(least > NEGLIGIBLE * np.abs(forces).max(axis=(1, 2), initial=0.0), least, 0.0)
        has = norms > NEGLIGIBLE * norms.max(axis=1, initial=0.0)[:, None]
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
        return self.frame.stiffness(self._structured(self._norms), _diagonal(limits.REGULARISED * self.local))

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
        found = np.where(found > NEGLIGIBLE * found.max(axis=1, initial=0.0)[:, None], found, found[:, ::-1])
        return np.where(found > NEGLIGIBLE * found.max(initial=0.0), found, found.max(initial=0.0))

    def factors(self, mu, least):
        """The `Factors` at mu; least (b,), N m, stands for K where there is none."""
        return Factors(self, mu, least)

    @cached_property
    def circulatory(self):
        """Whether loads have no potential: K isn't symmetric."""
        apart = self.whole - self.whole.T
        return bool(np.abs(apart.data).max(initial=0.0) > limits.STIFFNESS_ROUNDING * np.abs(self.K).max(initial=0.0))

    def along(self, u):
        """u.K u."""
        return float(u @ (self.whole @ u))


def _diagonal(sizes):
    """Blocks (b, 6, 6) of sizes (b, 2)."""
    found = np.zeros((len(sizes), 6, 6))
    found[:, range(6), range(6)] = np.repeat(sizes, 3, axis=1)
    return found


# Loads, constraint rows and multipliers at a configuration at rest.
#
#     [ G    A^T ] [ y   ]     [ Q       ]
#     [ A    0   ] [ lam ]  =  [ 0       ]            Q - A^T lam = G y is left over
#
# G weighs turns by one and shifts by next to nothing, as if bodies had no mass: forces pass through joints at once, as
# they do at rest, and are left over where nothing but inertia would take them up. Corrections of positions by the same
# factors shift bodies rather than turn them, which closes trees of joints in one sweep.


class Rest:
    """A consistent configuration at rest.

    Parameters
    ----------
    frame : Frame
    memory : ndarray (slots,)
        Memory of forces and constraints.
    q : ndarray (n,)

    Attributes
    ----------
    load, left : ndarray (size,)
        Generalised forces by `Increments`, N m, and what the constraints leave of them.
    lam : ndarray (m,)
        Multipliers of Phi, zero for redundant rows.
    """

    def __init__(self, frame, memory, q):
        self.frame, self.memory, self.q, self.t = frame, memory, q, frame.t
        self.qd, self.qdd = self._rates()
        self.system = frame.system._replace(reals=frame.system.reals.copy())
        self.system.reals[self.system.memory] = memory
        self.P = frame.increments.at(q)
        self.Phi, rows, _, _ = constraint_arrays(self.system, q, np.zeros(q.size), self.t, WIDTH)
        self.rows = rows
        A = frame.transformed_rows(self.P, rows)
        self.left_out = frame.left_out(A, q)
        A = np.where(self.left_out[frame.rows.rows], 0.0, A)
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, frame.own.size))
        self.lengths = np.where(self.left_out, 1.0, np.maximum(lengths, TINY))
        self.A = A / self.lengths[frame.rows.rows]
        self.Q = self.loads_at(q)
        self.load = frame.increments.load(self.P, self.Q)
        self._factor()
        self.forces = self.solve(self.load, np.zeros(frame.own.size))[1]
        self.left = self.load - frame.rows.matrix(self.A).T @ self.forces
        self.lam = np.zeros(len(self.Phi))
        self.lam[frame.own] = self.forces / self.lengths
        self._press()

    def _rates(self):
        """qd and qdd (n,)."""
        return np.zeros((2, self.q.size))

    def _press(self):
        """Multipliers of the normalisations: no residual along p."""
        frame, p = self.frame, self.frame.metric.p
        if len(p):
            left = self.Q - self.reactions
            at = np.zeros(len(self.frame.metric.at) + 1, int)
            at[:-1][frame.metric.rigid] = p[:, 0]
            places = at[frame.normal_bodies[:, None]] + np.arange(4)
            self.lam[frame.normals] = (left[places] * self.q[places]).sum(axis=1)

    @property
    def reactions(self):
        """Phi_q^T lam (n,) of rows of Phi, (n,)."""
        return as_csr(self.frame.packed, self.rows).T @ self.lam

    def _factor(self):
        frame = self.frame
        pattern, top, (i, j), diagonal = frame.weights
        self._weights = 1.0 / np.sqrt(diagonal)
        A = self.A * self._weights[frame.rows.columns]
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, frame.own.size))
        self._scales = 1.0 / np.where(self.left_out, 1.0, np.maximum(lengths, TINY))
        A = A * self._scales[frame.rows.rows]
        self._matrix = frame.matrix(pattern, top * self._weights[i] * self._weights[j], A, self.left_out * 1.0)
        try:
            self._factors = sparse_lu(self._matrix)
        except RuntimeError as error:
            raise SingularConfiguration(NOT_UNIQUE) from error
        pivots = np.abs(self._factors.U.diagonal())
        if pivots.min(initial=np.inf) < ROUNDING * pivots.max(initial=0.0):
            raise SingularConfiguration(NOT_UNIQUE)

    def solve(self, load, bias):
        """The (y, lam) with G y + A^T lam = load and A y = bias."""
        size = load.size
        right = np.concatenate((self._weights * load, self._scales * np.where(self.left_out, 0.0, bias)))
        found = self._factors.solve(right)
        for _ in range(limits.REGULARISED_SWEEPS):
            found = found + self._factors.solve(right - self._matrix @ found)
        return self._weights * found[:size], self._scales * found[size:]

    @property
    def unbalanced(self):
        """The largest acceleration by the residual loads, m/s^2, over that by the loads alone."""
        return float(self._largest(self.left) / self.acceleration_scale)

    @property
    def gains(self):
        """Accelerations (b, 3), m/s^2, and of turns (b', 3), rad/s^2, by residual loads, on bodies without joints."""
        return self.frame.increments.accelerations(self.left)

    @property
    def fastest(self):
        """The body with the largest residual acceleration, and that acceleration: for messages."""
        shifts, spins = (np.linalg.norm(each, axis=1) for each in self.gains)
        turns = np.zeros(len(shifts))
        turns[self.frame.metric.rigid] = spins
        worst = int((shifts + self.frame.reach * turns).argmax())
        shift, turn = shifts[worst], turns[worst]
        much = f"{shift:.3g} m/s^2" if shift >= self.frame.reach * turn else f"{turn:.3g} rad/s^2"
        return f"without its joints {self.frame.packed.bodies[worst].name} would accelerate by {much}"

    def _largest(self, load):
        shifts, turns = self.frame.increments.accelerations(load)
        return max(np.abs(shifts).max(initial=0.0), self.frame.reach * np.abs(turns).max(initial=0.0))

    @cached_property
    def acceleration_scale(self):
        """The acceleration, m/s^2, that others are compared with; a spring stretched by the reach is one of them."""
        reach = self.frame.reach
        loads = self._largest(self.load), self._largest(self.frame.rows.matrix(self.A).T @ self.forces)
        return max(*loads, float(np.abs(self.system.gravity).max()), self.quadratic.rate * reach) or 1.0

    @cached_property
    def quadratic(self):
        """The `Quadratic` of the work along increments."""
        return Quadratic(self)

    def closed(self, q, correction=None):
        """The consistent configuration next to q, by corrections with factors at hand; None where there is none."""
        allowed, correction = 1.0 + np.abs(q).max(), correction or self._shifted
        q, size = self._swept(q, correction, ROUNDING * allowed)
        if size <= limits.ACCEPTED * allowed:
            return q
        return self.frame.closed(q) if size <= limits.CONSISTENT * allowed else None

    def _swept(self, q, correction, limit):
        """Positions after sweeps of simplified Newton, and what is left of the constraints."""
        before = np.inf
        for _ in range(limits.MOST_SWEEPS):
            Phi = self.residuals(q)
            size = np.abs(Phi).max(initial=0.0)
            if size <= limit or not size < limits.SLOWEST * before:
                break
            before, step = size, correction(-Phi[self.frame.own] / self.lengths)
            if not np.isfinite(step).all():
                return q, np.inf
            q = self.frame.increments.moved(q, step)
        return q, size

    def _shifted(self, bias):
        """The increment u with A u = bias of least rotation."""
        return self.solve(np.zeros(self.frame.increments.size), bias)[0]

    def force_slopes(self, Q_q, Q_qd):
        """The derivative of the forces (forces, 14, 14) by q, of those by q and qd."""
        return Q_q

    def own_slopes(self):
        """Other derivatives by q of each body, (b, 7, 7)."""
        return np.zeros((len(self.frame.metric.at), 7, 7))

    def residuals(self, q):
        """Phi (m,) at other positions."""
        return constraint_arrays(self.system, q, np.zeros(q.size), self.t, WIDTH)[0]

    def loads_at(self, q):
        """The loads (n,) at other positions."""
        return self.applied(q, np.zeros(q.size))

    def applied(self, q, qd):
        """Q_A (n,)."""
        return applied_loads(self.system, np.array([self.t]), q[None], qd[None], self.memory[None])[0]
