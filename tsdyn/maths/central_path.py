"""Points of Coulomb's cones as deep in them as they can be, along given ways: the central path of a cone program.

    max t,  N - t >= |T| / mu,  t <= m      u0 + B y: N - t and T / mu of each contact, y: shares of the ways, then t
    min  |y|^2 / 2 - w t - log(m - t) - sum log((N - t)^2 - |T|^2 / mu^2)                                          (1)

The minima of Eq. (1) are smooth in all data and differ from the end of the path, w = inf, by some c / w, which two
weights w take away (Boyd and Vandenberghe, Convex Optimization, 2004, chapter 11). So points are within their cones as
long as any are. The squares of the shares bound them where cones are open to infinity along the ways.
"""

import math

import numpy as np

from ..jit.kernels import entry, kernel
from .dense_linalg import copy, lu, lu_solve
from .dense_solve import least_squares
from .tolerances import RANK_TOL

# The first weight, its factor and their number, by which points are right to 1e-11 of the largest reaction, also where
# some are zero; steps at most at each, the gain that ends them, the shortest share of a step; margin that is deep, as a
# share of the largest reaction
FIRST, FACTOR, WEIGHTS = 1e1, 1e1, 9
STEPS, SETTLED, SHORTEST, MARGIN = 30, 1e-9, 1e-9, 0.1


@kernel
def _place(B, start, y, u):
    """u = u0 + B y (3 c,); the least of u_0 - |(u_1, u_2)|."""
    least = math.inf
    for i in range(u.size):
        u[i] = start[i]
        for j in range(y.size):
            u[i] += B[i, j] * y[j]
    for i in range(0, u.size, 3):
        least = min(least, u[i] - math.hypot(u[i + 1], u[i + 2]))
    return least


@kernel
def _value(B, start, most, weight, y, u):
    """Eq. (1), infinite outside of the cones; writes u."""
    t = y[y.size - 1]
    if not (_place(B, start, y, u) > 0.0 and most > t):
        return math.inf
    value = -0.5 * t * t - weight * t - math.log(most - t)
    for j in range(y.size):
        value += 0.5 * y[j] * y[j]
    for i in range(0, u.size, 3):
        T = math.hypot(u[i + 1], u[i + 2])
        value -= math.log((u[i] - T) * (u[i] + T))
    return value


@entry("mvdvvvmmw")
def follow(B, start, most, y, before, u, work, H, pivots):
    """The minima y (n,) of Eq. (1) at the last weight, and at the one `before`, from a y within the cones.

    B (3 c, n), start (3 c,): scaled, so that mu is one; most: m. Others are scratch.
    """
    n, t, weight = y.size, y.size - 1, FIRST
    slope, step, trial = work[0], work[1], work[2]
    for _ in range(WEIGHTS):
        copy(y, before)
        now = _value(B, start, most, weight, y, u)
        for _ in range(STEPS):
            # Slope, with the opposite sign, and second derivatives
            rest = 1.0 / (most - y[t])
            for j in range(n):
                slope[j] = -y[j]
                for k in range(n):
                    H[j, k] = 1.0 if j == k else 0.0
            slope[t], H[t, t] = weight - rest, rest * rest
            for i in range(0, u.size, 3):
                T = math.hypot(u[i + 1], u[i + 2])
                share = 2.0 / ((u[i] - T) * (u[i] + T))
                for j in range(n):
                    trial[j] = share * (u[i] * B[i, j] - u[i + 1] * B[i + 1, j] - u[i + 2] * B[i + 2, j])
                for j in range(n):
                    slope[j] += trial[j]
                    for k in range(n):
                        square = B[i, j] * B[i, k] - B[i + 1, j] * B[i + 1, k] - B[i + 2, j] * B[i + 2, k]
                        H[j, k] += trial[j] * trial[k] - share * square
            copy(slope, step)
            if not lu(H, pivots, n):
                break
            lu_solve(H, pivots, step, n)
            gain, h, found = 0.0, 1.0, math.inf
            for j in range(n):
                gain += slope[j] * step[j]
            while h > SHORTEST:
                for j in range(n):
                    trial[j] = y[j] + h * step[j]
                found = _value(B, start, most, weight, trial, u)
                if found <= now - 0.1 * h * gain:
                    break
                h *= 0.5
            if not h > SHORTEST:
                _place(B, start, y, u)
                break
            copy(trial, y)
            now = found
            if gain < SETTLED:
                break
        weight *= FACTOR


def deepest(mu, p, ways):
    """p + ways y, as deep in their cones |T| < mu N as they can, p (c, 3), mu (c,), ways (3 c, k) orthonormal.

    Those with the least T stay as they are where they are deep enough.
    """
    size, k = np.abs(p).max(), ways.shape[1]
    x = p.ravel() / size
    least = x - ways @ (ways.T @ x)
    across = ways.reshape(-1, 3, k)[:, 1:].reshape(-1, k)
    least = least - ways @ least_squares(across, least.reshape(-1, 3)[:, 1:].ravel(), RANK_TOL)
    scale = np.column_stack([np.ones(len(p)), 1.0 / mu, 1.0 / mu]).ravel()
    y = inwards(scale * least, scale[:, None] * ways, MARGIN * np.abs(least).max())
    return size * (least + ways @ y).reshape(-1, 3)


def inwards(u, ways, most):
    """Shares y (k,) with which u + ways y are as deep in their cones |T| < N as they can; u (3 c,), ways (3 c, k).

    They are zero where u are as deep as `most`.
    """
    k = ways.shape[1]
    some = np.repeat(np.abs(ways).reshape(u.size // 3, 3 * k).max(axis=1, initial=0.0) > RANK_TOL, 3)
    start, B = u[some], np.column_stack([ways, np.tile([-1.0, 0.0, 0.0], u.size // 3)])[some]
    margin = (start[::3] - np.hypot(start[1::3], start[2::3])).min(initial=most)
    if margin >= most:
        return np.zeros(k)
    y, n = np.append(np.zeros(k), margin - 1.0), k + 1
    before, scratch, work, H = np.empty(n), np.empty(start.size), np.empty((3, n)), np.empty((n, n))
    follow(B, start, most, y, before, scratch, work, H, np.empty(n, np.int64))
    end = (y + (y - before) / (FACTOR - 1.0))[:k]
    part = min(2.0 * (1.0 - margin / most), 1.0)  # of the way: points are continuous
    return part * end
