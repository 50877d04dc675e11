"""Frictions at rest that hold the same bodies: how they share a load.

    sum J^T T   acts on the motions that bilateral rows leave    T: multipliers (3,) of a friction, J its slip rows

Where rows depend on each other, T isn't unique, and with it where sliding begins. Here it is in proportion to the
bounds as far as these allow: `maths.central_path.proportional`. Bounds follow from normal loads, and these from T.
"""

import numpy as np

from ..maths.central_path import proportional
from ..maths.dense_solve import null_space
from ..maths.tolerances import RANK_TOL, SUM_ROUNDING
from ..observables.evaluate import ITERATIONS


class FrictionShares:
    """The frictions `which` at rest, in one state.

    Parameters
    ----------
    frictions : frictions.Frictions
    gaps : contact_problem.Gaps
        Of the scene.
    which : sequence of int
    t, q, qd, memory
        The state, and what its forces remember.

    Attributes
    ----------
    units : list of frictions.FrictionUnit
    depending : list of int
        Those whose multipliers aren't unique.
    """

    def __init__(self, frictions, gaps, which, t, q, qd, memory):
        self.units = [frictions.units[i] for i in which]
        self.normal = np.array([unit.load.normal for unit in self.units], int)
        self.share, self.own = np.array([unit.bound for unit in self.units]).reshape(-1, 2).T
        bases = frictions.bases(q, which)
        rows = bases @ frictions.slopes(q, which)
        some = rows.any(axis=2)
        found, lam, left = gaps.workspace.solve(t, q, qd, memory, -rows[some])
        found, lam = found[:-1] * gaps.levers(q), lam[:-1]
        held = left <= RANK_TOL  # by bilateral rows
        found[held], lam[held] = 0.0, 0.0
        rows, by = np.zeros(rows.shape), np.zeros((*some.shape, lam.shape[1]))
        rows[some], by[some] = found, lam
        # Of each the directions in which it moves, of one size: forces and torques
        U, sizes, _ = np.linalg.svd(rows, full_matrices=False)
        moved, turn = sizes > RANK_TOL * sizes[:, :1], U.swapaxes(1, 2)
        self.sizes = np.where(moved.any(axis=1), sizes[:, 0], 1.0)[:, None]
        self.bases, self.lam = turn @ bases, turn @ by
        self.rows = np.where(moved[..., None], turn @ rows, 0.0) / self.sizes[..., None]
        ways = np.zeros((*moved.shape, (free := null_space(self.rows[moved].T, RANK_TOL)).shape[1]))
        ways[moved] = free
        self.depending = [i for i, own in zip(which, ways, strict=True) if np.abs(own).max(initial=0.0) > RANK_TOL]

    def shared(self, forces, N, coupled, reactions):
        """Multipliers (c, 3) of all with the same effect as `forces` (c, 3), ground frame; normal loads with these.

        And by how much these change the multipliers (rows,) of bilateral rows. N (frictions,), reactions (frictions,
        6): with `forces`; coupled: the `NormalLoads`, if there are any.
        """
        T, change = np.einsum("ijk,ik->ij", self.bases, forces) * self.sizes, np.zeros(self.lam.shape[2])
        if not self.depending:
            return forces, N, change
        for _ in range(ITERATIONS):
            found = proportional(self.bounds(N) * self.sizes[:, 0], self.rows, T)
            change = np.einsum("ij,ijk->k", (found - T) / self.sizes, self.lam)
            if not N.size:
                break
            before, N = N, coupled.changed(reactions, change)
            if not (np.abs(N - before) > SUM_ROUNDING * np.abs(N).max()).any():
                break
        return np.einsum("ijk,ij->ik", self.bases, found / self.sizes), N, change

    def bounds(self, N):
        """The largest multipliers (c,) at rest, by normal loads (frictions,)."""
        return self.own + self.share * np.append(N, 0.0)[self.normal]
