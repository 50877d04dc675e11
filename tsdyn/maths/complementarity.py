"""Linear complementarity of symmetric matrices: 0 <= z, w = M z + q >= 0, z.w = 0, by an active set."""

import numpy as np

from .tolerances import LEAST_PIVOT, MOST_ENTRIES, NEGLIGIBLE, WITHOUT_SOLUTION

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
        try:
            self._solve()
        except np.linalg.LinAlgError:
            held.clear()

    def _solve(self):
        """z of the held rows; without those where it is negative."""
        h, self.z = self.held, np.zeros(self.q.size)
        while h:
            self.z[h] = z = np.linalg.solve(self.M[h][:, h], -self.q[h])
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
            follow = np.linalg.solve(M[h][:, h], M[h, i]) if h else np.zeros(0)
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
