"""Continuation (homotopy) from a sketch to the nearest consistent configuration, by steps in the kinetic metric."""

from typing import NamedTuple

import numpy as np

from ..elements.bodies import IDENTITY, rotation_matrix, transform_g
from ..elements.tolerances import UNDIRECTED
from ..maths.dense_linalg import row_lengths, sparse_lu
from ..maths.tolerances import NEGLIGIBLE, PIVOT_ROUNDING, RANK_TOL, ROUNDING, SUM_ROUNDING, TINY
from ..model.equations import WIDTH, added_inertia, as_csr, with_short_rows
from ..observables.evaluate import constraint_arrays
from ..rows.constraint_graph import arms
from ..rows.tolerances import THIN
from . import tolerances as limits
from .tolerances import DENSE, FIRM, LIGHTEST, SMALL_ANGLE, SOLVED

# Continuation (homotopy) from a sketch to the nearest configuration that satisfies the constraints.
#
# A spring holds each body at its pose in the sketch, in the metric of kinetic energy; each constraint is a spring of
# stiffness 1 / s. The equilibrium is followed from s = 1, where the sketch is hardly strained, to s = 1e-8, where the
# constraint residuals are of that order. Bodies move together, so links keep the fold of the sketch. Dependent rows
# need no special treatment: parallel springs share their load. Minimum-norm Gauss-Newton steps then remove the
# remaining residual, and steps along the constraints minimise the distance to the sketch.


class ContinuationEnd(NamedTuple):
    """End of a continuation."""

    q: np.ndarray  # (n,)
    Phi: np.ndarray  # (rows,)
    iterations: int
    met: bool


class Kept(NamedTuple):
    """Pairs of bodies whose relative orientation in the sketch is held by springs of the given softness."""

    pairs: np.ndarray  # (k, 2) body numbers, the ground's is the last
    softness: float


def nearest(metric, sketch, tol):
    """Return the configuration nearest to a sketch (n,) that satisfies the rows, or the best found.

    Rows hold to tol (1 + max |q|). Gauss-Newton steps from the sketch are tried where continuation fails.
    """
    Phi = metric.linear(sketch)[0]
    if np.abs(Phi).max(initial=0.0) <= ROUNDING * (1.0 + np.abs(sketch).max()):
        return ContinuationEnd(sketch, Phi, 0, True)
    best, total = None, 0
    for attempt in range(2):
        q, count = relax(metric, sketch, sketch) if attempt == 0 else (sketch, 0)
        q, Phi, more = close(metric, q)
        total += count + more
        met = bool(np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()))
        if best is None or met or np.linalg.norm(Phi) < np.linalg.norm(best.Phi):
            best = ContinuationEnd(q, Phi, total, met)
        if met:
            break
    return approached(metric, sketch, best._replace(iterations=total), tol)


def approached(metric, sketch, found, tol):
    """Return what was found, or the nearest configuration to the sketch along the constraints from there."""
    if not found.met:
        return found
    q, Phi, more = approach_sketch(metric, sketch, found.q)
    found = found._replace(iterations=found.iterations + more)
    return found._replace(q=q, Phi=Phi) if np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()) else found


def approach_sketch(metric, sketch, q):
    """Minimise the distance to the sketch along the constraints. Return q, Phi and the number of steps."""
    steps, last = 0, np.inf
    Phi, A = metric.linear(q)
    while steps < limits.MOST_SKETCHED and metric.columns.size:
        wish = metric.towards(q, sketch)[1]
        step = wish + least_step(A, A @ wish, limits.DEPENDENCE)
        size = np.linalg.norm(step)
        if size <= limits.SETTLED * np.linalg.norm(wish) or size >= limits.DECREASE * last:
            break
        turn = metric.largest_turn(step)
        trial, residual, more = close(metric, metric.moved(q, min(1.0, limits.MOST_SLIDE / max(turn, TINY)) * step))
        steps += 1 + more
        allowed = 10.0 * np.abs(Phi).max(initial=0.0) + ROUNDING * (1.0 + np.abs(q).max())
        if np.abs(residual).max(initial=0.0) > allowed:
            break
        last, q = size, trial
        Phi, A = metric.linear(q)
    return q, Phi, steps


def stuck(metric, q, Phi):
    """Return violated rows whose derivative vanishes."""
    size = np.abs(Phi)
    return np.flatnonzero(
        (row_lengths(metric.linear(q)[1]) == 0.0) & (size > limits.DEPENDENCE * size.max(initial=0.0))
    )


def relax(metric, sketch, q, kept=None, stages=limits.STAGES):
    """Follow the equilibrium from q while the constraint springs stiffen. Return q and the number of steps."""
    Phi, A = metric.linear(q)
    if not (Phi.size and metric.columns.size):
        return q, 0
    steps, relative = 0, None if kept is None else _Relative(metric, sketch, kept)
    lengths = row_lengths(A)
    if (
        kept is None
        and q is sketch
        and _strain(Phi, lengths) < limits.NEAR_SKETCH * metric.reach(q) * metric.root.min()
    ):
        stages = stages[-1:]

    def strained(q):
        """Return residuals, unit rows, the step towards the sketch, softness and energy."""
        Phi, A = metric.linear(q)
        residual, A = Phi * weights, _weighed(A, weights)
        soft = np.full(residual.size, softness)
        if relative is not None:
            extra, B = relative.rows(q)
            residual, soft = (
                np.concatenate((residual, extra)),
                np.concatenate((soft, np.full(extra.size, kept.softness))),
            )
            A = _stacked(A, B)
        far, wish = metric.towards(q, sketch)
        return residual, A, wish, soft, far + 0.5 * residual @ (residual / soft)

    for softness, most in stages:
        lengths = row_lengths(metric.linear(q)[1])
        weights = np.where(lengths > 0.0, 1.0 / np.where(lengths > 0.0, lengths, 1.0), 0.0)
        now = strained(q)
        for _ in range(most):
            *arrays, energy = now
            step = soft_step(arrays[1], arrays[0], arrays[2], arrays[3])
            size = np.linalg.norm(step)
            if size <= limits.LAST_CONVERGED * np.linalg.norm(arrays[2]):
                break
            turn = metric.largest_turn(step)
            factor = min(1.0, limits.MOST_ROTATION / turn) if turn > 0.0 else 1.0
            steps += 1
            for _ in range(10):
                trial = metric.moved(q, factor * step)
                after = strained(trial)
                if after[-1] < energy:
                    break
                factor /= 2.0
            else:
                break
            q, now = trial, after
            if softness != stages[-1][0] and size <= limits.STAGE_CONVERGED * (np.linalg.norm(now[2]) + TINY):
                break
    return q, steps


def close(metric, q):
    """Take Gauss-Newton steps of least kinetic energy, down to rounding. Return q, Phi and the number of steps."""
    Phi, A = metric.linear(q)
    steps = 0
    while steps < limits.MOST_SKETCHED and Phi.size and metric.columns.size:
        if np.abs(Phi).max() <= ROUNDING * (1.0 + np.abs(q).max()):
            break
        steps += 1
        step = least_step(A, Phi, limits.DEPENDENCE)
        turn = metric.largest_turn(step)
        factor = min(1.0, limits.MOST_ROTATION / turn) if turn > 0.0 else 1.0
        size = np.linalg.norm(Phi)
        for _ in range(12):
            trial = metric.moved(q, factor * step)
            arrays = metric.linear(trial)
            if np.linalg.norm(arrays[0]) < size:
                break
            factor /= 2.0
        else:
            break
        q, (Phi, A) = trial, arrays
    return q, Phi, steps


class _Relative:
    """Rows that keep relative orientations: the log of A_a^T A_b (A_a^T A_b of the sketch)^T, in the frame of a."""

    def __init__(self, metric, sketch, kept):
        self.metric, self.pairs = metric, kept.pairs
        a, b = kept.pairs.T
        R = metric.rotations(sketch)
        self.drawn = R[a].swapaxes(1, 2) @ R[b]
        self.places, self.rise = metric.turns()

    def rows(self, q):
        """Return residuals (3 k,) and unit rows (3 k, free columns)."""
        R, (a, b) = self.metric.rotations(q), self.pairs.T
        between = R[a].swapaxes(1, 2) @ R[b]
        residual = np.array([_logarithm(E) for E in between @ self.drawn.swapaxes(1, 2)])
        B = np.zeros((3 * len(a), self.metric.size))
        for k in range(len(a)):
            for body, block in ((a[k], -self.rise[a[k]]), (b[k], between[k] @ self.rise[b[k]])):
                if self.places[body][0] >= 0:
                    B[3 * k : 3 * k + 3, self.places[body]] = block
        B = B[:, self.metric.columns]
        lengths = np.maximum(row_lengths(B), TINY)
        some = row_lengths(B) > 0.0
        return np.where(some, residual.ravel() / lengths, 0.0), B / lengths[:, None]


def _logarithm(E):
    """Return the rotation vector (3,) of a rotation matrix, for angles below pi."""
    v = np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]]) / 2.0
    sine = np.linalg.norm(v)
    return v * (np.arctan2(sine, (np.trace(E) - 1.0) / 2.0) / sine) if sine > NEGLIGIBLE else v


def _strain(Phi, lengths):
    some = lengths > 0.0
    return np.abs(Phi[some] / lengths[some]).max(initial=0.0)


def _weighed(A, weights):
    if isinstance(A, np.ndarray):
        return A * weights[:, None]
    from scipy.sparse import diags_array

    return diags_array(weights) @ A


def _stacked(A, B):
    if isinstance(A, np.ndarray):
        return np.vstack((A, B))
    from scipy.sparse import csr_array, vstack

    return vstack((A, csr_array(B)), format="csr")


# Increments of a configuration in the kinetic metric: six coordinates a rigid body, three a point mass.
#
#     r + x_r / sqrt(m),    p (x) exp(w' / 2),  w' = L^-T x_w,  J' = L L^T        so  2 T = |xd|^2
#     Phi + A x = 0                                                               A = Phi_q q_x
#
# Euler parameters stay normalised, so A has no normalisation rows.

_G = transform_g(np.eye(4)).reshape(4, 12)  # G is linear in p


class Metric:
    """Constraints of a packed scene at time t as rows (m', x), dense or, of more than DENSE coordinates, sparse.

    held (n,) marks coordinates that are fixed. Rows on velocities are among the rows with `rates` alone: then Phi, zero
    for them, is met by increments that they admit. With `lengths`, the metric is that of rows/constraint_graph.py: rank
    is geometry. The kinetic one `is_bounded` where masses or moments of inertia are raised, so that it stays a metric:
    it says which of many configurations is near, and no physical number. Those come of `kinetic_rows`.
    """

    def __init__(self, packed, held=None, t=0.0, lengths=False, rates=False):
        system = packed.system
        rigid = system.bodies[:, 1] == 7
        self.packed, self.t, self.n = packed, t, int(system.bodies[:, 1].sum())
        self.sparse = self.n > DENSE
        self.system = with_short_rows(packed) if self.sparse else system
        starts = np.cumsum([0, *np.where(rigid, 6, 3)])
        self.size = int(starts[-1])
        self.rigid, self.at = rigid, system.bodies[:, 0]
        self.r, self.move = self.at[:, None] + np.arange(3), starts[:-1, None] + np.arange(3)
        self.p, self.turn = self.at[rigid, None] + np.arange(3, 7), starts[:-1][rigid, None] + np.arange(3, 6)
        masses, J, L = system.mass, system.inertia[rigid].reshape(-1, 3, 3), arms(packed)[rigid]
        if lengths:
            masses, J = np.ones(len(masses)), (L**2)[:, None, None] * np.eye(3)
        least = LIGHTEST * masses.max(initial=0.0)
        size = np.maximum(np.trace(J, axis1=1, axis2=2) / 3.0, masses[rigid] * L**2)
        more = np.maximum(THIN * size, LIGHTEST * size.max(initial=0.0))
        thin = np.linalg.eigvalsh(J)[:, 0] < more
        self.is_bounded = bool(thin.any() or (masses < least).any())
        self.root = np.sqrt(np.maximum(masses, least))[:, None]
        self.fall = np.linalg.cholesky(J + (more * thin)[:, None, None] * np.eye(3)).swapaxes(1, 2)  # L^T
        self.rise = np.linalg.inv(self.fall)
        own = [
            not part.normalises and (rates or i < part.rows)
            for part in packed.constraints
            for i in range(part.all_rows)
        ]
        self.own = np.flatnonzero(np.array(own, bool))
        free = np.ones(self.size, bool)
        self.held = np.zeros(len(rigid), bool) if held is None else held[self.r[:, 0]]  # (bodies,)
        if held is not None:
            free[self.move[self.held]] = False
            free[self.turn[held[self.p[:, 0]]]] = False
        self.columns = np.flatnonzero(free)
        self._last = None, None  # q of the last `linear`, and what it returned

    def arrays(self, q):
        """Phi (m,), Phi_q (m, n), Phi_t (m,), all rows."""
        Phi, rows, Phi_t, _ = constraint_arrays(
            self.system, q, np.zeros(q.size), self.t, WIDTH if self.sparse else None
        )
        return Phi, as_csr(self.packed, rows) if self.sparse else rows, Phi_t

    def linear(self, q):
        """Phi (m',) and A (m', free columns), without normalisations."""
        known, found = self._last
        if known is q:
            return found
        Phi, Phi_q, _ = self.arrays(q)
        A = self.reduced(q, Phi_q[self.own])
        found = Phi[self.own], A if self.columns.size == self.size else A[:, self.columns]
        self._last = q, found
        return found

    def reduced(self, q, Phi_q):
        """A of rows of Phi_q, all columns."""
        blocks = 0.5 * _transforms(q[self.p]).swapaxes(1, 2) @ self.rise
        if not self.sparse:
            A = np.zeros((Phi_q.shape[0], self.size))
            A[:, self.move] = Phi_q[:, self.r] / self.root
            A[:, self.turn] = (Phi_q.T[self.p].swapaxes(1, 2) @ blocks).swapaxes(0, 1)
            return A
        from scipy.sparse import csr_array

        i, j = np.broadcast_arrays(self.p[:, :, None], self.turn[:, None, :])
        values = np.concatenate((np.broadcast_to(1.0 / self.root, self.r.shape).ravel(), blocks.ravel()))
        places = [np.concatenate((a.ravel(), b.ravel())) for a, b in ((self.r, i), (self.move, j))]
        return Phi_q @ csr_array((values, places), (self.n, self.size))

    def towards(self, q, target):
        """Half the squared distance of q from a target, and minus its gradient by the free coordinates.

        The distance is that of straight lines and of turns v about fixed axes: |v|^2 = v.J' v. A turn d of the body
        changes v by -W d, W = I - v~/2 + c v~ v~, c = (1 - a/2 cot(a/2)) / a^2, a = |v|.
        """
        x, v = np.zeros(self.size), rotation_vectors(q[self.p], target[self.p])
        shift, turn = self.root * (target[self.r] - q[self.r]), np.einsum("bij,bj->bi", self.fall, v)
        Jv, a = np.einsum("bji,bj->bi", self.fall, turn), np.linalg.norm(v, axis=1)[:, None]
        small = a < SMALL_ANGLE
        a = np.where(small, 1.0, a)
        c = np.where(small, 1.0 / 12.0, (1.0 - a / 2.0 / np.tan(a / 2.0)) / a**2)
        across = _cross(v, Jv)
        x[self.move] = shift
        x[self.turn] = np.einsum("bji,bj->bi", self.rise, Jv + 0.5 * across + c * _cross(v, across))
        return 0.5 * float((shift * shift).sum() + (turn * turn).sum()), x[self.columns]

    def moved(self, q, x):
        """The configuration after a change of the free coordinates."""
        whole, q = self._whole(x), q.copy()
        q[self.r] += whole[self.move] / self.root
        w = np.einsum("bij,bj->bi", self.rise, whole[self.turn])
        p, angle = q[self.p], np.linalg.norm(w, axis=1)[:, None]
        sine = np.sinc(angle / (2.0 * np.pi)) / 2.0  # sin(angle / 2) / angle
        turned = np.cos(angle / 2.0) * p + sine * np.einsum("bij,bi->bj", _transforms(p), w)
        q[self.p] = np.where(angle > 0.0, turned / np.linalg.norm(turned, axis=1)[:, None], p)  # rest keeps its bits
        return q

    def largest_turn(self, x):
        """Rad, of a change of the free coordinates."""
        w = np.einsum("bij,bj->bi", self.rise, self._whole(x)[self.turn])
        return float(np.linalg.norm(w, axis=1).max(initial=0.0))

    def spins(self, q, qd):
        """Angular velocities of the rigid bodies, body frames."""
        return 2.0 * np.einsum("bij,bj->bi", _transforms(q[self.p]), qd[self.p])

    def speeds(self, velocity, omega):
        """xd (size,) of velocities (bodies, 3) and angular velocities (rigid bodies, 3), body frames."""
        x = np.zeros(self.size)
        x[self.move] = self.root * velocity
        x[self.turn] = np.einsum("bij,bj->bi", self.fall, omega)
        return x

    def rates(self, q, x):
        """qd of xd (size,)."""
        qd = np.zeros(self.n)
        qd[self.r] = x[self.move] / self.root
        w = np.einsum("bij,bj->bi", self.rise, x[self.turn])
        qd[self.p] = 0.5 * np.einsum("bij,bi->bj", _transforms(q[self.p]), w)
        return qd

    def reach(self, q):
        """Return a characteristic length, m: of joints from centroids, or of bodies from each other."""
        return float(self.packed.size) or float(np.ptp(q[self.r], axis=0).max()) or 1.0

    def extent(self, x):
        """The largest displacement, m, and turn, rad, of a change (size,) of all coordinates."""
        moved = np.linalg.norm(x[self.move] / self.root, axis=1).max(initial=0.0)
        return float(moved), self.largest_turn(x[self.columns])

    def rotations(self, q):
        """Rotation matrices of all bodies and, last, of the ground, (bodies + 1, 3, 3)."""
        p = np.tile(IDENTITY, (len(self.at) + 1, 1))
        p[:-1][self.rigid] = q[self.p]
        return rotation_matrix(p)

    def turns(self):
        """For each body, and the ground, where its turn is in x, -1 for those that don't turn; and L^-T, (., 3, 3)."""
        places, rise = np.full((len(self.at) + 1, 3), -1), np.zeros((len(self.at) + 1, 3, 3))
        places[:-1][self.rigid], rise[:-1][self.rigid] = self.turn, self.rise
        return places, rise

    def _whole(self, x):
        whole = np.zeros(self.size)
        whole[self.columns] = x
        return whole


def _transforms(p):
    """G(p), (b, 3, 4), of p (b, 4)."""
    return (p @ _G).reshape(-1, 3, 4)


def _cross(u, v):
    """u x v, (b, 3) each."""
    found = np.empty_like(u)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[:, i] = u[:, j] * v[:, k] - u[:, k] * v[:, j]
    return found


def rotation_vectors(p, target):
    """Return the rotation vectors (b, 3) from orientations p (b, 4) to the target, in the frames of p, up to pi."""
    e = np.einsum("bij,bj->bi", _transforms(p), target)
    e0, size = np.einsum("bi,bi->b", p, target), np.linalg.norm(e, axis=1)
    angle = 2.0 * np.arctan2(size, np.abs(e0))
    factor = np.where(size > 0.0, angle / np.maximum(size, TINY), 0.0)
    return (np.where(e0 < 0.0, -1.0, 1.0) * factor)[:, None] * e


def soft_step(A, residual, wish, softness):
    """Return the x nearest to a wish with residual + A x = 0, the rows being springs of stiffness 1 / softness."""
    if not A.shape[0]:
        return wish
    if isinstance(A, np.ndarray):
        K = A @ A.T
        K.flat[:: len(K) + 1] += softness
        return wish - A.T @ np.linalg.solve(K, residual + A @ wish)
    from scipy.sparse import block_array, diags_array

    matrix = block_array([[diags_array(np.ones(wish.size)), A.T], [A, -diags_array(softness)]], format="csc")
    return sparse_lu(matrix).solve(np.concatenate((wish, -residual)))[: wish.size]


def least_step(A, residual, rcond=SOLVED):
    """Return the smallest least-squares x of residual + A x = 0; rcond: share of singular values taken as zero."""
    lengths = row_lengths(A)
    some = lengths > 0.0
    if not some.any():
        return np.zeros(A.shape[1])
    if isinstance(A, np.ndarray):
        unit, target = A[some] / lengths[some, None], -residual[some] / lengths[some]
        found = _of_independent(unit, target)
        return np.linalg.lstsq(unit, target, rcond=rcond)[0] if found is None else found
    from scipy.sparse import diags_array

    unit = diags_array(1.0 / lengths[some]) @ A[some]
    return soft_step(unit, residual[some] / lengths[some], np.zeros(A.shape[1]), np.full(some.sum(), PIVOT_ROUNDING))


def _of_independent(unit, target):
    """Return the smallest x of A x = target A of unit rows; None where these are nearly dependent."""
    K = unit @ unit.T
    try:
        far = np.linalg.cholesky(K).diagonal().min()
    except np.linalg.LinAlgError:
        return None
    return unit.T @ np.linalg.solve(K, target) if far > FIRM else None


def kinetic_rows(system, q, rates):
    """Rows F (6 b + 3 points + added, k) of rates qd (n, k): |F x|^2 = 2 T of qd = rates x, with masses as they are."""
    bodies = system.bodies
    rigid = bodies[:, 1] == 7
    p = bodies[rigid, :1] + np.arange(3, 7)
    size, axes = np.linalg.eigh(system.inertia[rigid].reshape(-1, 3, 3))
    roots = np.sqrt(np.maximum(size, 0.0))[:, :, None] * axes.swapaxes(1, 2)
    shifts = np.sqrt(system.mass)[:, None, None] * rates[bodies[:, :1] + np.arange(3)]
    turns = 2.0 * (roots @ _transforms(q[p])) @ rates[p]
    added = [h @ rates[columns] for columns, h, _ in added_inertia(system, q[None], np.zeros((1, q.size)))]
    parts = [part.reshape(3 * len(part), rates.shape[1]) for part in (shifts, turns)]
    return np.concatenate((*parts, *added))


def least_energy(metric, q, A, x, drift):
    """Return the x' with A x' + drift = 0 for which x' - x has the least kinetic energy; a metric of lengths, dense.

    x' = x + d + Z y,    A Z = 0,    |F (d + Z y)| -> min

    Masses enter F alone, its rows in order of size: QR with pivoting then keeps the digits of light bodies.
    """
    from scipy.linalg import lstsq  # imported here: it would double the time of `import tsdyn`

    lengths = row_lengths(A)
    some = lengths > 0.0
    U, s, V = np.linalg.svd(A[some] / lengths[some, None])
    rank = int((s > RANK_TOL * s.max(initial=0.0)).sum())
    residual = (A @ x + drift)[some] / lengths[some]
    d = -V[:rank].T @ ((U[:, :rank].T @ residual) / s[:rank])
    rates = np.stack([metric.rates(q, each) for each in (d, *V[rank:])], axis=1)
    F = kinetic_rows(metric.system, q, rates)
    F = F[np.argsort(-np.linalg.norm(F, axis=1))]
    y = lstsq(F[:, 1:], -F[:, 0], cond=SUM_ROUNDING, lapack_driver="gelsy")[0] if rank < len(V) else np.zeros(0)
    return x + d + V[rank:].T @ y


def unit_tangent(metric, q, rng):
    """Return a random tangent direction that displaces the scene by its size or rotates it by 1 rad; or None."""
    _, A = metric.linear(q)
    reach = metric.reach(q)
    wish = metric.speeds(reach * rng.normal(size=metric.r.shape), rng.normal(size=(len(metric.p), 3)))
    wish = wish + least_step(A, A @ wish, RANK_TOL)
    shift, turn = metric.extent(wish)
    size = max(shift / reach, turn)
    return wish / size if size > UNDIRECTED else None
