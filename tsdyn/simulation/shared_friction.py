"""Frictions at rest that share a load, along the phases of a run."""

import numpy as np

from ..analyses.friction_problem import gradients
from ..analyses.friction_shares import FrictionShares
from ..analyses.friction_units import normal_loads_of
from ..maths.dense_solve import least_squares
from ..maths.tolerances import RANK_TOL


class SharedFriction:
    """What frictions at rest exert that share a load, where the rows of a phase give it to some of them.

    Parameters
    ----------
    frictions : frictions.Frictions
    gaps : contact_problem.Gaps
        Of the scene.
    """

    def __init__(self, frictions, gaps):
        self.frictions, self.gaps = frictions, gaps

    def at(self, packed, t, q, qd, memory, lam, N):
        """The `FrictionShares` at one state, multipliers (c, 3), ground frame, normal loads (frictions,) with these.

        Then by how much these change the multipliers of bilateral rows, and of each friction its rows and their
        directions. packed: of the phase; memory (slots,), by which frictions are at rest; lam (m,), N (frictions,):
        multipliers and normal loads, by the rows of the phase.
        """
        frictions, held = self.frictions, self._held(memory)
        place, directions, forces = frictions.at(q, np.ones(frictions.count), 0.0), [], np.zeros((len(held), 3))
        holds, none = packed.derived.holds, np.zeros(0, int)
        rows = [holds.get(frictions.units[i].slot, none)[:rank] for i, rank in held.items()]
        for own, i, mine in zip(forces, held, rows, strict=True):
            numbers = memory[np.array([frictions.units[i].held(k) for k in range(len(mine))], int)]
            directions.append(place.directions(i, numbers) if len(mine) else np.zeros((0, 3)))
            own[:] = lam[mine] @ directions[-1]
        coupled = reactions = None
        if N.size:
            coupled = normal_loads_of(packed, t, q, qd, memory, gradients(packed, t, q, memory))
            reactions = coupled.reactions(lam[:, None])[..., 0]
        shares = FrictionShares(frictions, self.gaps, list(held), t, q, qd, memory)
        forces, N, change = shares.shared(forces, N, coupled, reactions)
        return shares, forces, N, change, list(zip(rows, directions, strict=True))

    def _held(self, memory):
        """How many rows hold each friction at rest, or could, by units: the memory has numbers of these."""
        units = self.frictions.units
        ranks = {
            i: sum(bool(memory[own.held(k)].any()) for k in range(own.slide.freedom)) for i, own in enumerate(units)
        }
        return {i: rank for i, rank in ranks.items() if rank}

    def multipliers(self, packed, t, q, qd, memory, lam, N):
        """Multipliers (k, m) in which frictions share their loads, of those by the rows of a phase.

        t (k,), q, qd (k, n), memory (k, slots), N (k, frictions).
        """
        out = lam.copy()
        for k, own in enumerate(out):
            if len(self._held(memory[k])) < 2 or not np.isfinite(N[k]).all():
                continue
            given = np.nan_to_num(lam[k])
            _, forces, _, change, places = self.at(packed, t[k], q[k], qd[k], memory[k], given, N[k])
            if not all(len(rows) for rows, _ in places):  # beside redundant rows of joints
                continue
            own[: change.size] += change
            for (rows, directions), force in zip(places, forces, strict=True):
                own[rows] = least_squares(directions.T, force, RANK_TOL)
        return out
