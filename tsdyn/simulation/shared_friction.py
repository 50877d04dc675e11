"""Frictions at rest that share a load, along the phases of a run."""

import numpy as np

from ..analyses.friction_problem import gradients
from ..analyses.friction_shares import FrictionShares
from ..analyses.friction_units import normal_loads_of


class SharedFriction:
    """What frictions at rest that share a load exert in a phase, whose rows give it to some of them.

    Parameters
    ----------
    frictions : friction_problem.Frictions
    gaps : contact_problem.Gaps
        Of the scene.
    modes : UnitModes
    packed : Packed
        Of the phase.

    Attributes
    ----------
    units : list of friction_problem.FrictionUnit
        These frictions.
    """

    def __init__(self, frictions, gaps, modes, packed):
        self.frictions, self.gaps, self.packed, self._which = frictions, gaps, packed, modes.sharing
        self.units = [frictions.units[i] for i in self._which]
        self._ranks = [modes.sticking.get(i, 0) for i in self._which]

    def at(self, t, levels, memory, lam, N):
        """Multipliers (c, 3) of these, ground frame, and their bounds (c,).

        levels (3, n), memory (slots,): the state; lam (m,), N: multipliers and loads there, by the rows of the phase.
        """
        q, qd, frictions = levels[0], levels[1], self.frictions
        place, forces = frictions.at(q, np.ones(frictions.count), 0.0), np.zeros((len(self.units), 3))
        for own, i, unit, rank in zip(forces, self._which, self.units, self._ranks, strict=True):
            if rank:
                numbers = memory[np.array([unit.held(k) for k in range(rank)])]
                rows = self.packed.derived.holds[unit.slot][:rank]
                own[:] = lam[rows] @ place.directions(i, numbers)
        coupled = reactions = None
        if N.size:
            coupled = normal_loads_of(self.packed, t, q, qd, memory, gradients(self.packed, t, q, memory))
            reactions = coupled.reactions(lam[:, None])[..., 0]
        shares = FrictionShares(frictions, self.gaps, self._which, t, q, qd, memory)
        forces, N = shares.shared(forces, N, coupled, reactions)
        return forces, shares.bounds(N)
