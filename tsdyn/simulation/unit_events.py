"""What ends a phase of a run, as event functions: gaps and reactions of contacts, holds and slips of frictions."""

from functools import cached_property

import numpy as np

from ..analyses.contact_rows import GapCounts, OpenGaps, find_open_gaps, measure_opened, reaction_workspace
from ..analyses.tolerances import LEVEL
from ..jit.kernels import resident
from ..maths.tolerances import TINY
from .tolerances import LOADED, REACTION_NOISE


class Closing:
    """The gaps of open contacts, as event functions.

    The gap of a contact that has just opened, with a rate, is divided by the time since: so its next zero is found
    however soon it comes. Of one that has opened without a rate, rounding of the gap is no zero. One that is lifted by
    less than rounding has the rate of the gap: it closes at the top of its flight, where no impact is.

    Parameters
    ----------
    gaps : Gaps
    opened : dict
        Of contacts that have opened: time, gap, rate and rounding of the gap there, by their numbers.
    lifted : list of int
    """

    def __init__(self, gaps, opened, lifted):
        self.gaps, self.lifted, count = gaps, lifted, gaps.count
        self.counts = GapCounts(rows=gaps.workspace.m, n=gaps.workspace.n)
        self.which, self.start = np.zeros(count, int), np.zeros((4, count))
        self._own, self._keep = resident(OpenGaps(self.counts, gaps.sign, self.which, self.start, gaps.stops))
        self.open(opened)

    @property
    def kernel(self):
        """The `GroupSearch.kernel` of the gaps; None where Python evaluates some: of ratchets, and those lifted."""
        if self.gaps.following or self.lifted:
            return None
        return find_open_gaps, self.gaps.workspace.rows_address, self._own, self.counts.rows

    def open(self, opened):
        """Take other contacts that have just opened."""
        self.counts.opened = 0
        for i, known in opened.items():
            if i not in self.gaps.following:
                k = self.counts.opened
                self.which[k], self.start[:, k], self.counts.opened = i, known, k + 1

    def over(self, states):
        """Values (k, count) of `States`."""
        values = self.gaps.values(states.t, states.levels, states.counted)
        for i, rate in self.gaps.following.items():
            values[:, i] = rate(states.q, states.qd)
        measure_opened(states.t, self.which[: self.counts.opened], self.start, values)
        if self.lifted:
            values[:, self.lifted] = self.gaps.rates(states.t, states.q, states.qd, self.lifted)
        return values


class Leaving:
    """The reactions of closed contacts, positive where they push, and their slack, as event functions.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    rows : list of int
    signs : list of float
        Of the gaps over Phi.
    slack : list of float
        What a reaction may fall below zero.
    """

    def __init__(self, packed, rows, signs, slack):
        self.packed, self.rows, self.signs, self.slack = packed, rows, np.array(signs), np.array(slack)

    @cached_property
    def workspace(self):
        """Made at the first evaluation: the start of the phase may show that rows are redundant."""
        return reaction_workspace(self.packed)

    def over(self, states):
        """Values (k, closed) of `States`."""
        lam, _ = self.workspace.multipliers(states.t, states.levels, states.memory)
        return self.slack - self.signs * lam[:, self.rows]


class Breaking:
    """What reactions lack of their limits, as event functions.

    Of frictions that stick: (b^2 - lam^2) / (b + c), with bound b, multipliers lam and the bound c at the limit; it is
    smooth at lam = 0. Of those without a load: the load, and one that counts.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    sticking : list of friction_problem.FrictionUnit
    light : list of friction_problem.FrictionUnit
    limits : ndarray (sticking and light units,), N
        Loads that count as none.

    Attributes
    ----------
    noise : ndarray (sticking and light units,)
        Rounding of the values.
    """

    def __init__(self, packed, sticking, light, limits):
        self.packed, self.sticking, self.normals = packed, sticking, [unit.load.normal for unit in light]
        self.least = limits[: len(sticking)]
        self.limits = LOADED * limits[len(sticking) :]
        self.noise = REACTION_NOISE * limits * ([unit.bound[0] for unit in sticking] + [1.0] * len(light))

    @cached_property
    def workspace(self):
        """Made at the first evaluation, as of `Leaving`."""
        return reaction_workspace(self.packed)

    def over(self, states):
        """Values (k, sticking and light units) of states at k times."""
        lam, loads = self.workspace.multipliers(states.t, states.levels, states.memory)
        values = np.zeros((states.t.size, len(self.sticking)))
        for unit, value, limit in zip(self.sticking, values.T, self.least, strict=True):
            (share, bound), held = unit.bound, lam[:, self.packed.derived.holds[unit.slot]]
            bound = bound + share * loads[:, unit.load.normal] if share else bound
            value += (bound * bound - (held * held).sum(axis=1)) / (bound + share * limit + TINY)
        return np.hstack((values, self.limits - loads[:, self.normals])) if self.normals else values


class Slowing:
    """The velocities of frictions, along the directions in which they slide, as event functions.

    In a plane a new direction is taken where it has turned by 60 degrees: `friction_problem.within`. The velocity of
    one that has just begun to slide is divided by the time since. Of one that is held without a force, what its
    velocity lacks of one that counts: a motor may begin to move it.

    Parameters
    ----------
    frictions : Frictions
    begun : dict
        Of those that have just begun to slide: time and acceleration there, by their numbers.
    starting : dict
        Of those that are held without a force: the velocity that counts, by their numbers.
    rates : ndarray (frictions,)
        Sizes of the terms of accelerations.

    Attributes
    ----------
    noise : ndarray (frictions,)
        Rounding of the values, of slides that begin with an acceleration that is hardly more.
    """

    def __init__(self, frictions, begun, starting, rates):
        self.frictions, self.begun, self.starting = frictions, begun, starting
        self.noise = np.zeros(frictions.count)
        for i, (_, first) in begun.items():
            self.noise[i] = LEVEL * rates[i] if first < LEVEL / REACTION_NOISE * rates[i] else 0.0

    def over(self, states):
        """Values (k, frictions) of states at k times."""
        values = self.frictions.speeds(states.q, states.qd, states.memory)
        for i, (begun, first) in self.begun.items():
            later = states.t > begun
            values[:, i] = np.where(later, values[:, i] / np.where(later, states.t - begun, 1.0), first)
        if self.starting:
            v, _, _ = self.frictions.motions(states.q, states.qd)
            for i, counts in self.starting.items():
                values[:, i] = counts - np.linalg.norm(v[:, i], axis=1)
        return values
