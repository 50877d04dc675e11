"""Complementarity with Coulomb's cone: 0 <= N, 0 <= u_n, N u_n = 0, |T| <= mu N, and T against u_t where that slips."""

import numpy as np

from .tolerances import (
    CONE_FACTORS,
    CONE_LEFT,
    CONE_ROUNDING,
    CONE_SLIP,
    CONE_STALLED,
    CONE_STEPS,
    CONE_SWEEPS,
    RANK_TOL,
    TINY,
)

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


def solve_cone(G, b, mu, slip=None, given=None, bounds=()):
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
    problem = _Problem(G * scale[:, None] * scale, b * scale / size, mu, slip, given, others)
    p = np.zeros(3 * k)
    with np.errstate(over="ignore", invalid="ignore"):  # where there is no solution
        for left, counts in ((0.0, CONE_SWEEPS), (CONE_LEFT, CONE_SWEEPS[:1]), (CONE_SLIP, CONE_SWEEPS[:1])):
            for sweeps in counts:
                p = problem.swept(p, sweeps)
                for factor in CONE_FACTORS if np.isfinite(p).all() else ():
                    found = problem.newton(p, factor, left)
                    if found is not None:
                        return found * scale * size, problem.modes(found)
    return None, np.zeros(k, int)


class _Problem:
    """One problem in scaled units; arguments as of `solve_cone`."""

    def __init__(self, G, b, mu, slip, given, others):
        self.G, self.b, self.mu, self.given = G, b, mu, given
        known, self.balls = np.zeros(mu.size, bool), np.arange(mu.size) >= mu.size - others
        if slip is not None:
            known[: len(slip)] = np.isfinite(slip).all(axis=1)
        self.known = (known | (mu == 0.0)) & ~self.balls  # T follows from N
        self.direction = np.zeros((mu.size, 2))
        if slip is not None:
            self.direction[known] = slip[known[: len(slip)]]

    def image(self, y, contacts=slice(None)):
        """Right-hand sides of Eqs. (1), (2) (k, 3) for y (k, 3)."""
        mu, known, d = self.mu[contacts], self.known[contacts], self.direction[contacts]
        N = np.maximum(0.0, y[:, 0])
        bound, length = mu * (N + self.given[contacts]), np.hypot(y[:, 1], y[:, 2])
        share = np.where(length > bound, bound / np.where(length > 0.0, length, 1.0), 1.0)
        T = np.where(known[:, None], -bound[:, None] * d, share[:, None] * y[:, 1:])
        found, balls = np.column_stack([N, T]), self.balls[contacts]
        if balls.any():
            size = np.linalg.norm(y[balls], axis=1)
            found[balls] = y[balls] * np.minimum(1.0, self.given[contacts][balls] / np.maximum(size, TINY))[:, None]
        return found

    def residual(self, p, factor=1.0):
        """p less the right-hand sides of Eqs. (1), (2), and y (k, 3) for r."""
        y = (p - factor * (self.G @ p + self.b)).reshape(-1, 3)
        return p - self.image(y).ravel(), y

    def slope(self, y):
        """The derivative (3 k, 3 k) of the right-hand sides by y, of one branch at a kink."""
        D = np.zeros((y.size, y.size))
        for i, (n, *t) in enumerate(y):
            o, mu, pushes = 3 * i, self.mu[i], float(n > 0.0)
            if self.balls[i]:
                size, bound = np.linalg.norm(y[i]), self.given[i]
                e = y[i] / max(size, TINY)
                part = np.eye(3) if size <= bound else bound / size * (np.eye(3) - np.outer(e, e))
                D[o : o + 3, o : o + 3] = part
                continue
            D[o, o] = pushes
            length, bound = np.hypot(*t), mu * (max(n, 0.0) + self.given[i])
            if self.known[i]:
                D[o + 1 : o + 3, o] = -mu * pushes * self.direction[i]
            elif length <= bound:
                D[o + 1, o + 1] = D[o + 2, o + 2] = 1.0
            else:
                e = np.array(t) / length
                D[o + 1 : o + 3, o] = mu * pushes * e
                D[o + 1 : o + 3, o + 1 : o + 3] = bound / length * (np.eye(2) - np.outer(e, e))
        return D

    def newton(self, p, factor, left):
        """A solution from a start; None where the method stalls with more than `left` of its terms.

        In normal directions CONE_LEFT is left at most.
        """
        F, y = self.residual(p, factor)
        eye, best, stalled = np.eye(p.size), np.inf, 0
        for _ in range(CONE_STEPS):
            size = np.abs(F).max()
            if not size < np.inf:
                return None
            terms = 1.0 + (np.abs(self.G) @ np.abs(p)).max()
            if size <= CONE_ROUNDING * terms and size >= 0.5 * best:  # as far as rounding lets it
                return self.image(y).ravel()  # without the rounding of zeros
            stalled = 0 if size < 0.5 * best else stalled + 1
            if size <= best:
                best, normal, nearest = size, np.abs(F[::3]).max(), self.image(y).ravel()
            if stalled > CONE_STALLED:  # b of rows that depend on each other may disagree by rounding
                return nearest if best <= left * terms and normal <= CONE_LEFT * terms else None
            step = np.linalg.lstsq(eye - self.slope(y) @ (eye - factor * self.G), -F, rcond=RANK_TOL**2)[0]
            share = 1.0
            while True:
                trial = p + share * step
                F_next, y_next = self.residual(trial, factor)
                if np.linalg.norm(F_next) < (1.0 - 0.1 * share) * np.linalg.norm(F) or share < 0.02:
                    break
                share *= 0.5
            p, F, y = trial, F_next, y_next
        return None

    def swept(self, p, sweeps):
        """p after sweeps of Eqs. (1), (2) over the contacts in turn."""
        p = p.copy()
        rows = [slice(3 * i, 3 * i + 3) for i in range(self.mu.size)]
        lengths = [np.linalg.norm(self.G[r, r], 2) for r in rows]
        for _ in range(sweeps):
            for i, r in enumerate(rows):
                u = self.G[r] @ p + self.b[r]
                p[r] = self.image((p[r] - u / (lengths[i] or 1.0))[None], [i])[0]
        return p

    def modes(self, p):
        """Whether each contact is open, sticks or slides at a solution."""
        y = self.residual(p)[1]
        N, length = p[::3], np.hypot(y[:, 1], y[:, 2])
        slides = self.known | (length > self.mu * (N + self.given))
        found = np.where(N > 0.0, np.where(slides, SLIDES, STICKS), OPEN)
        beyond = np.linalg.norm(y, axis=1) > self.given
        return np.where(self.balls, np.where(beyond, SLIDES, STICKS), found)
