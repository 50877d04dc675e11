"""Complementarity: 0 <= z, w = M z + q >= 0, z.w = 0 with symmetric M, by an active set; with Coulomb's cone."""

import math

import numpy as np

from ..jit.kernels import entry, kernel, stack
from .dense_solve import least_squares, product, solve
from .tolerances import (
    CONE_FACTORS,
    CONE_LEFT,
    CONE_SHIFT,
    CONE_SHIFTED,
    CONE_SLIP,
    CONE_STALLED,
    CONE_STEPS,
    CONE_SWEEPS,
    LEAST_PIVOT,
    MOST_ENTRIES,
    NEGLIGIBLE,
    RANK_TOL,
    SUM_ROUNDING,
    TINY,
    WITHOUT_SOLUTION,
)

# z minimises z.M z / 2 + q.z for z >= 0. Rows with w = 0 are held, their z is free; those of others are zero.
#
#     the row with the least w < 0 enters:   z_i grows, z_h = -M_hh^-1 (q_h + M_hi z_i) of the held rows follow,
#                                            w_i grows by the pivot M_ii - M_ih M_hh^-1 M_hi
#     until w_i = 0                          the row is held
#     or a z_h = 0                           that row leaves, z_i grows on
#
# Held rows are independent, as a row without a pivot takes the place of one that leaves. Where none leaves, z_i could
# grow for ever: there is no solution. Each entry lowers the minimum, so that no set of held rows comes twice.


def complement(M, q, guess=()):
    """Solve a linear complementarity problem.

    Parameters
    ----------
    M : ndarray (n, n)
        Symmetric, positive semidefinite.
    q : ndarray (n,)
    guess : sequence of int
        Rows that may be held, independent.

    Returns
    -------
    z : ndarray (n,) or None
        A solution; None where there is none.
    held : ndarray (n,), bool
        Where w is held at zero by z: independent rows and columns of M, outside of which z is zero.
    """
    M, q = np.asarray(M, float), np.asarray(q, float)
    z, held = np.zeros(q.size), np.zeros(q.size, bool)
    if q.size == 0 or q.min() >= 0.0:
        return z, held
    if q.size == 1:
        return (-q / M[0], ~held) if M[0, 0] > 0.0 else (None, held)
    # Rows and columns scaled to a unit diagonal, q to one
    scale = 1.0 / np.sqrt(np.where(np.diag(M) > 0.0, np.diag(M), 1.0))
    size = np.abs(q * scale).max()
    rows = _Rows(scale[:, None] * M * scale, scale * q / size, list(guess))
    for _ in range(MOST_ENTRIES * (q.size + 1)):
        i = rows.least()
        if i is None:
            break
        if not rows.enter(i):
            return None, held
    held[rows.held] = True
    z[rows.held] = rows.z[rows.held]
    return size * scale * z, held


class _Rows:
    """The state of the method."""

    def __init__(self, M, q, held):
        self.M, self.q, self.held, self.passed = M, q, held, set()
        self._solve()

    def _solve(self):
        """z of the held rows; without those where it is negative."""
        h, self.z = self.held, np.zeros(self.q.size)
        while h:
            z = solve(self.M[h][:, h], -self.q[h])
            if z is None:  # rows of a guess that depend on each other
                h.clear()
                break
            self.z[h] = z
            k = int(z.argmin())
            if z[k] >= 0.0:
                break
            self.z[h.pop(k)] = 0.0

    def least(self):
        """The row with the least w, below rounding; None where there is none."""
        w = self.M @ self.z + self.q
        w[[*self.held, *self.passed]] = 0.0
        i = int(w.argmin())
        return i if w[i] < -NEGLIGIBLE * (1.0 + np.abs(self.M[i]) @ self.z) else None

    def enter(self, i):
        """Let z_i grow until row i is held; False if it could for ever."""
        M, z, h = self.M, self.z, self.held
        while True:
            follow = solve(M[h][:, h], M[h, i]) if h else np.zeros(0)
            pivot, w = M[i, i] - M[i, h] @ follow, M[i] @ z + self.q[i]
            whole = -w / pivot if pivot > LEAST_PIVOT else np.inf
            falls = follow > NEGLIGIBLE
            steps = np.where(falls, z[h] / np.where(falls, follow, 1.0), np.inf)
            k = int(steps.argmin()) if h else -1
            if k < 0 or not steps[k] < whole:
                break
            z[h] -= steps[k] * follow
            z[i] += steps[k]
            z[h[k]] = 0.0
            h.pop(k)
        if whole == np.inf:
            # A row that depends on held ones, with a w of rounding, stays as it is
            self.passed.add(i)
            return w > -WITHOUT_SOLUTION
        h.append(i)
        self._solve()  # rounding may leave less than nothing of one
        return True


# Coulomb's cone: 0 <= N, 0 <= u_n, N u_n = 0, |T| <= mu N, and T against u_t where that slips.
#
# u = G p + b, p = (N, T) of each contact, T in two directions. Contacts with slip of a known direction d have
# T = -mu N d. With y = p - r u, r > 0, all in units in which the diagonal of G is about one, p solves the problem where
#
#     N = max(0, y_n)                                                                    (1)
#     T = y_t min(1, mu max(0, y_n) / |y_t|),  or  -mu N d                               (2)
#
# Newton's method on Eqs. (1), (2) (Alart and Curnier, 1991) ends in a solution to rounding, or stalls: then sweeps of
# Eqs. (1), (2) over the contacts in turn, whose fixed points are the solutions, make a better start, or another r
# another path. A result counts only by its residual.

OPEN, STICKS, SLIDES = 0, 1, 2


def solve_cone(G, b, mu, slip=None, given=None, bounds=(), rounding=0.0):
    """Solve for contacts with Coulomb friction.

    Parameters
    ----------
    G : ndarray (3 k, 3 k)
        Positive semidefinite; normal, then two tangential rows of each contact.
    b : ndarray (3 k,)
    mu : ndarray (k,)
    slip : ndarray (k, 2), optional
        Directions of slip where they are known; NaN elsewhere.
    given : ndarray (k,), optional
        Normal parts beside N, of which b has the effect already: |T| <= mu (N + given).
    bounds : sequence of float
        Of forces (3,) that follow those of the contacts, of friction alone: |p| <= bound.
    rounding : float
        Of b, where it is a difference of larger numbers: dependent rows may disagree by it.

    Returns
    -------
    p : ndarray (3 k,) or None
        None where no solution was found.
    mode : ndarray (k,)
        OPEN, STICKS or SLIDES.
    """
    mu, others = np.append(mu, np.zeros(len(bounds))), len(bounds)
    k = mu.size
    if k == 0:
        return np.zeros(0), np.zeros(0, int)
    diagonal = np.diag(G).reshape(k, 3).max(axis=1)
    scale = np.repeat(1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 3)
    size = np.abs(b * scale).max()
    if size == 0.0:
        return np.zeros(3 * k), np.full(k, OPEN)
    given = np.append(np.zeros(k - others) if given is None else given, bounds) / (scale[::3] * size)
    rounding *= scale.max() / size
    problem = _Problem(G * scale[:, None] * scale, b * scale / size, mu, slip, given, others, rounding)
    p = np.zeros(3 * k)
    nearest, least = None, CONE_SLIP
    with np.errstate(over="ignore", invalid="ignore"):  # where there is no solution
        for sweeps in CONE_SWEEPS:
            p = problem.swept(p, sweeps)
            for factor in CONE_FACTORS if np.isfinite(p).all() else ():
                found, left = problem.newton(p, factor)
                if left <= least:
                    nearest, least = found, left
                if left == 0.0:
                    break
            if least == 0.0:
                break
    if nearest is not None:
        return nearest * scale * size, problem.modes(nearest)
    return None, np.zeros(k, int)


CONE, KNOWN, BALL = 0, 1, 2  # of a contact, of one whose T follows from N, of a force of friction alone


@kernel
def _image(kind, mu, given, d, y):
    """The right-hand sides of Eqs. (1), (2) of one contact, for its y (3,)."""
    if kind == BALL:
        share = min(1.0, given / max(math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]), TINY))
        return share * y[0], share * y[1], share * y[2]
    N = max(0.0, y[0])
    bound, length = mu * (N + given), math.hypot(y[1], y[2])
    if kind == KNOWN:
        return N, -bound * d[0], -bound * d[1]
    share = bound / length if length > bound else 1.0
    return N, share * y[1], share * y[2]


@entry("vvmwmm")
def _images(mu, given, d, kinds, y, out):
    """The same of all contacts, out (k, 3) for y (k, 3)."""
    for i in range(kinds.size):
        out[i, 0], out[i, 1], out[i, 2] = _image(kinds[i], mu[i], given[i], d[i], y[i])


@entry("vvmwmvvvi")
def _sweep(mu, given, d, kinds, G, b, sizes, p, sweeps):
    """Sweeps of Eqs. (1), (2) over the contacts in turn, p in place; sizes (k,): norms of diagonal blocks of G."""
    y = stack(3)
    for _ in range(sweeps):
        for i in range(kinds.size):
            for c in range(3):
                u = b[3 * i + c]
                for j in range(p.size):
                    u += G[3 * i + c, j] * p[j]
                y[c] = p[3 * i + c] - u / sizes[i]
            p[3 * i], p[3 * i + 1], p[3 * i + 2] = _image(kinds[i], mu[i], given[i], d[i], y)


@entry("vvmwmm")
def _slope(mu, given, d, kinds, y, D):
    """D (3 k, 3 k), zero on entry: the derivative of Eqs. (1), (2) by y (k, 3), of one branch at a kink."""
    for i in range(kinds.size):
        o, pushes = 3 * i, 1.0 if y[i, 0] > 0.0 else 0.0
        # Of a ball I, or bound / |y| (I - e e^T); of a cone the same in two directions
        first = 0 if kinds[i] == BALL else 1
        square = 0.0
        for c in range(first, 3):
            square += y[i, c] * y[i, c]
        length, bound = math.sqrt(square), given[i]
        if first == 1:
            D[o, o], bound = pushes, mu[i] * (max(y[i, 0], 0.0) + given[i])
        if kinds[i] == KNOWN:
            D[o + 1, o], D[o + 2, o] = -mu[i] * pushes * d[i, 0], -mu[i] * pushes * d[i, 1]
            continue
        slides = length > bound
        for c in range(first, 3):
            D[o + c, o + c] = bound / length if slides else 1.0
            if slides:
                if first == 1:
                    D[o + c, o] = mu[i] * pushes * y[i, c] / length
                for e in range(first, 3):
                    D[o + c, o + e] -= bound / length * (y[i, c] / length) * (y[i, e] / length)


CONES = _images, _sweep, _slope


def _step(A, D, F):
    """A step x with A x = F but for CONE_SHIFTED of it, or the least one where rows that depend on each other disagree.

    A = I - D (I - r G): with G + CONE_SHIFT I, as if every contact gave way a little, A is regular.
    """
    x = solve(A + CONE_SHIFT * D, F)
    if x is not None and np.abs(F - A @ x).max() <= CONE_SHIFTED * np.abs(F).max():
        return x
    return least_squares(A, F, RANK_TOL**2)


class _Problem:
    """One problem in scaled units; arguments as of `solve_cone`."""

    def __init__(self, G, b, mu, slip, given, others, rounding):
        self.G, self.b, self.mu, self.given, self.rounding = G, b, mu, given, rounding
        known, self.balls = np.zeros(mu.size, bool), np.arange(mu.size) >= mu.size - others
        if slip is not None:
            known[: len(slip)] = np.isfinite(slip).all(axis=1)
        self.known = (known | (mu == 0.0)) & ~self.balls  # T follows from N
        direction = np.zeros((mu.size, 2))
        if slip is not None:
            direction[known] = slip[known[: len(slip)]]
        kinds = np.where(self.balls, BALL, np.where(self.known, KNOWN, CONE))
        self.laws = mu, given, direction, kinds

    def image(self, y):
        """Right-hand sides of Eqs. (1), (2) (k, 3) for y (k, 3)."""
        found = np.empty_like(y)
        _images(*self.laws, y, found)
        return found

    def residual(self, p, factor=1.0):
        """p less the right-hand sides of Eqs. (1), (2), and y (k, 3) for r."""
        y = (p - factor * (self.G @ p + self.b)).reshape(-1, 3)
        return p - self.image(y).ravel(), y

    def slope(self, y):
        """The derivative (3 k, 3 k) of the right-hand sides by y, of one branch at a kink."""
        D = np.zeros((y.size, y.size))
        _slope(*self.laws, y, D)
        return D

    def newton(self, p, factor):
        """The nearest to a solution from a start, and how much of its terms is left, 0 within rounding.

        In normal directions CONE_LEFT is left at most, beside rounding; None, and infinite, where there is more.
        """
        F, y = self.residual(p, factor)
        eye, best, stalled = np.eye(p.size), np.inf, 0
        for _ in range(CONE_STEPS):
            size = np.abs(F).max()
            if not size < np.inf:
                break
            terms = 1.0 + (np.abs(self.G) @ np.abs(p)).max()
            if size <= SUM_ROUNDING * terms and size >= 0.5 * best:  # as far as rounding lets it
                return self.image(y).ravel(), 0.0  # without the rounding of zeros
            stalled = 0 if size < 0.5 * best else stalled + 1
            if size <= best:
                best, normal, nearest = size, np.abs(F[::3]).max(), self.image(y).ravel()
            if stalled > CONE_STALLED:  # b of rows that depend on each other may disagree by rounding
                if normal > max(CONE_LEFT * terms, self.rounding):
                    break
                return nearest, 0.0 if best <= self.rounding else best / terms
            D = self.slope(y)
            step = _step(eye - product(D, eye - factor * self.G), D, -F)
            share = 1.0
            while True:
                trial = p + share * step
                F_next, y_next = self.residual(trial, factor)
                if np.linalg.norm(F_next) < (1.0 - 0.1 * share) * np.linalg.norm(F) or share < 0.02:
                    break
                share *= 0.5
            p, F, y = trial, F_next, y_next
        return None, np.inf

    def swept(self, p, sweeps):
        """p after sweeps of Eqs. (1), (2) over the contacts in turn."""
        p, k = p.copy(), self.mu.size
        sizes = np.linalg.norm(self.G.reshape(k, 3, k, 3)[range(k), :, range(k)], 2, axis=(1, 2))
        _sweep(*self.laws, self.G, self.b, np.where(sizes > 0.0, sizes, 1.0), p, sweeps)
        return p

    def modes(self, p):
        """Whether each contact is open, sticks or slides at a solution."""
        y = self.residual(p)[1]
        N, length = p[::3], np.hypot(y[:, 1], y[:, 2])
        slides = self.known | (length > self.mu * (N + self.given))
        found = np.where(N > 0.0, np.where(slides, SLIDES, STICKS), OPEN)
        beyond = np.linalg.norm(y, axis=1) > self.given
        return np.where(self.balls, np.where(beyond, SLIDES, STICKS), found)
