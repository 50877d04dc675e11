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
from .dense_solve import least_squares, null_space
from .tolerances import RANK_TOL

# The first weight, its factor and their number, by which points are right to 1e-11 of the largest reaction, also where
# some are zero; steps at most at each, the gain that ends them, the shortest share of a step; margin that is deep, as a
# share of the largest reaction
FIRST, FACTOR, WEIGHTS = 1e1, 1e1, 9
STEPS, SETTLED, SHORTEST, MARGIN = 30, 1e-9, 1e-9, 0.1
SAME = 1e-9  # shares of bounds that differ by less are alike


@kernel
def _tangent(u, i):
    """|T| of point i: u (c, 1 + d) has N, then T."""
    square = 0.0
    for j in range(1, u.shape[1]):
        square += u[i, j] * u[i, j]
    return math.sqrt(square)


@kernel
def _place(B, start, y, u):
    """u = u0 + B y (c, 1 + d); the least of N - |T|."""
    least, width = math.inf, u.shape[1]
    for i in range(u.shape[0]):
        for k in range(width):
            u[i, k] = start[i, k]
            for j in range(y.size):
                u[i, k] += B[width * i + k, j] * y[j]
        least = min(least, u[i, 0] - _tangent(u, i))
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
    for i in range(u.shape[0]):
        T = _tangent(u, i)
        value -= math.log((u[i, 0] - T) * (u[i, 0] + T))
    return value


@entry("mmdvvmmmw")
def follow(B, start, most, y, before, u, work, H, pivots):
    """The minima y (n,) of Eq. (1) at the last weight, and at the one `before`, from a y within the cones.

    start (c, 1 + d), B (c (1 + d), n): scaled, so that mu is one; most: m. Others are scratch.
    """
    n, t, weight, width = y.size, y.size - 1, FIRST, u.shape[1]
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
            for i in range(u.shape[0]):
                T, own = _tangent(u, i), B[width * i : width * (i + 1)]
                share = 2.0 / ((u[i, 0] - T) * (u[i, 0] + T))
                for j in range(n):
                    along = u[i, 0] * own[0, j]
                    for m in range(1, width):
                        along -= u[i, m] * own[m, j]
                    trial[j] = share * along
                for j in range(n):
                    slope[j] += trial[j]
                    for k in range(n):
                        square = own[0, j] * own[0, k]
                        for m in range(1, width):
                            square -= own[m, j] * own[m, k]
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
    scale = np.column_stack([np.ones(len(p)), 1.0 / mu, 1.0 / mu])
    y = inwards(scale * least.reshape(-1, 3), scale[..., None] * ways.reshape(-1, 3, k), MARGIN * np.abs(least).max())
    return size * (least + ways @ y).reshape(-1, 3)


def proportional(bounds, rows, T):
    """Forces with the same effect as T (c, d), in proportion to their bounds (c,) where their rows (c, d, n) depend.

    The least sum of |T|^2 / b: a box on a plane that doesn't turn has T / b alike at all corners. Where one comes near
    its bound before the others, as at the corner at which a box is pulled, these take over what they can. rows: what
    unit forces do; of zeros, nothing.
    """
    (c, d), rows = T.shape, rows.reshape(T.size, -1)
    weight, sizes = np.repeat(np.sqrt(np.maximum(bounds, 0.0)), d), np.linalg.norm(rows, axis=1)
    found = weight * least_squares((weight[:, None] * rows).T, T.ravel() @ rows, RANK_TOL)
    able = bounds > RANK_TOL * bounds.max(initial=0.0)
    share = np.ones((c, 1 + d))  # of the bounds
    share[able, 1:] = found.reshape(c, d)[able] / bounds[able, None]
    size = np.linalg.norm(share[able, 1:], axis=1)
    if size.max(initial=0.0) > 1.0 - MARGIN and np.ptp(size) > SAME:
        some = np.repeat(able, d) & (sizes > RANK_TOL * sizes.max())
        ways = np.zeros((T.size, (free := null_space(rows[some].T, RANK_TOL)).shape[1]))
        ways[some] = free
        across = np.zeros((c, 1 + d, ways.shape[1]))
        across[able, 1:] = ways.reshape(c, d, -1)[able] / bounds[able, None, None]
        found += ways @ inwards(share[able], across[able], MARGIN)
    return found.reshape(c, d)


def inwards(u, ways, most):
    """Shares y (k,) with which u + ways y are as deep in their cones |T| < N as they can; u (c, 1 + d): N, T.

    ways (c, 1 + d, k). They are zero where u are as deep as `most`.
    """
    k, width = ways.shape[2], u.shape[1]
    some = np.abs(ways).max(axis=(1, 2), initial=0.0) > RANK_TOL
    start = u[some]
    margin = (start[:, 0] - np.linalg.norm(start[:, 1:], axis=1)).min(initial=most)
    if margin >= most:
        return np.zeros(k)
    B = np.zeros((len(start), width, k + 1))
    B[..., :k], B[:, 0, k] = ways[some], -1.0
    y, n = np.append(np.zeros(k), margin - 1.0), k + 1
    before, work, H = np.empty(n), np.empty((3, n)), np.empty((n, n))
    scratch = np.empty_like(start)
    follow(B.reshape(-1, n), start, most, y, before, scratch, work, H, np.empty(n, np.int64))
    end = (y + (y - before) / (FACTOR - 1.0))[:k]
    part = min(2.0 * (1.0 - margin / most), 1.0)  # of the way: points are continuous
    return part * end
