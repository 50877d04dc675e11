"""What ends a phase of a run, as event functions: gaps of contacts, holds and slips of frictions."""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..analyses.contact_rows import GapCounts, OpenGaps, find_open_gaps, measure_opened, reaction_workspace, write_lam
from ..analyses.friction_units import INTS, slip_velocity, within
from ..analyses.tolerances import LEVEL
from ..jit.kernels import callback, loader, matrix, resident, stack, vector
from ..maths.tolerances import TINY
from ..model.equations import recall
from ..model.laws import calls_laws
from ..runs.group_search import VALUES, KernelFunctions
from ..workspaces import load_parts
from .tolerances import FASTER, LOADED, REACTION_NOISE, TURNS


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
        return find_open_gaps, self.gaps.workspace.rows_address, self._own, self.counts.rows, np.zeros(0)

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


# Reactions that hold frictions


class BreakingParts(NamedTuple):
    """Frictions that stick, and after them those without a load."""

    memory: np.ndarray  # what forces remember
    first: np.ndarray  # int64 (sticking + 1,)  where the rows of each begin
    held: np.ndarray  # int64  these rows
    normal: np.ndarray  # int64 (sticking and light,)  the number of its normal load, -1 for none
    share: np.ndarray  # (sticking,)  the bound for a normal load of one,
    bound: np.ndarray  # (sticking,)  and by itself
    limits: np.ndarray  # (sticking and light,)  loads that count as none
    lam: np.ndarray  # (m,)  scratch


_none, _whole = np.zeros(0), np.zeros(0, int)
load_breaking = loader(BreakingParts(_none, *np.zeros((3, 0), int), *np.zeros((4, 0))))


@callback(VALUES)
def find_breaking(parts, own, t, state, out, t0, before, near):  # eight: VALUES
    """out (sticking and light,): as of `Breaking`."""
    c, x = load_parts(parts), load_breaking(own)
    sticking, count, lam, load = x.share.size, x.normal.size, x.lam, c.tangent.friction.load
    values = vector(out, count)
    recall(c.system, x.memory)
    regular = write_lam(c, t, vector(state, 3 * c.work.q.size), 0.0, lam)
    for i in range(count):
        N = load[7 * x.normal[i]] if x.normal[i] >= 0 else 0.0
        if not regular:
            values[i] = math.nan
        elif i >= sticking:
            values[i] = LOADED * x.limits[i] - N
        else:
            b, square = x.bound[i] + x.share[i] * N, 0.0
            for j in range(x.first[i], x.first[i + 1]):
                square += lam[x.held[j]] * lam[x.held[j]]
            values[i] = (b * b - square) / (b + x.share[i] * x.limits[i] + TINY)
    return 0


class Breaking(KernelFunctions):
    """What reactions lack of their limits, as event functions.

    Of frictions that stick: (b^2 - lam^2) / (b + c), with bound b, multipliers lam and the bound c at the limit; it is
    smooth at lam = 0. Of those without a load: the load, and one that counts.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    sticking : list of frictions.FrictionUnit
    light : list of frictions.FrictionUnit
    limits : ndarray (sticking and light units,), N
        Loads that count as none.
    shares : shared_friction.SharedFriction, optional
        Where units share a load. What is left to those without rows of their own counts as that of others.

    Attributes
    ----------
    noise : ndarray (sticking and light units,)
        Rounding of the values.
    """

    def __init__(self, packed, sticking, light, limits, shares=None):
        self.packed, self.sticking, self.light, self.limits, self.shares = packed, sticking, light, limits, shares
        self.noise = REACTION_NOISE * limits * ([unit.bound[0] for unit in sticking] + [1.0] * len(light))

    @cached_property
    def functions(self):
        """As of `KernelFunctions`; made late: the start of the phase may show that rows are redundant."""
        workspace = self._workspace = reaction_workspace(self.packed)  # kept as long as its address is in use
        rows = self.packed.derived.holds
        held = [rows[unit.slot] for unit in self.sticking]
        first = np.cumsum([0, *map(len, held)])
        bounds = np.array([unit.bound for unit in self.sticking], float).reshape(-1, 2)
        loads = [*(unit.load.normal if unit.bound[0] else -1 for unit in self.sticking)]
        normal = np.array([*loads, *(unit.load.normal for unit in self.light)], int)
        memory = np.zeros(self.packed.system.memory.size)
        own, *self._keep = resident(
            BreakingParts(
                memory, first, np.concatenate([_whole, *held]), normal, *bounds.T.copy(), self.limits,
                np.zeros(workspace.m),
            )
        )  # fmt: skip
        return find_breaking, workspace.address, own, normal.size, memory

    @property
    def kernel(self):
        """As of `GroupSearch`; none where laws are called, or units share a load."""
        return None if self.shares or calls_laws(self.packed) else self.functions

    def over(self, states):
        """As of `KernelFunctions`."""
        values = super().over(states)
        if self.shares is None:
            return values
        found = self._workspace.multipliers(states.t, states.levels, states.memory)
        places = {unit.slot: k for k, unit in enumerate(self.sticking)}
        for value, t, (q, qd, _), lam, N in zip(values, states.t, states.levels, *found, strict=True):
            if not (np.isfinite(lam).all() and np.isfinite(N).all()):  # at singular configurations
                value[:] = np.nan
                continue
            shares, forces, N, *_ = self.shares.at(self.packed, t, q, qd, states.memory, lam, N)
            b = shares.bounds(N)
            at = [places.get(unit.slot, -1) for unit in shares.units]
            limits = np.append(self.limits, 0.0)[at] * shares.share
            left = (b * b - (forces * forces).sum(axis=1)) / (b + limits + TINY)
            own = np.array(at) >= 0
            value[np.array(at)[own]] = left[own]
            for j, least in enumerate(left[~own]):
                value[j % len(places)] = min(value[j % len(places)], least)
        return values


# Slides of frictions


class SlowingParts(NamedTuple):
    """Frictions that slide or stick."""

    memory: np.ndarray  # what forces remember
    table: np.ndarray  # int64, as of `slip_velocities`
    points: np.ndarray
    axes: np.ndarray
    ways: np.ndarray  # int64 (3 units,)  where the memory has directions
    signed: np.ndarray  # int64 (units,)  1 of those along an axis, whose direction is a sign
    begun: np.ndarray  # (4, units)  time and acceleration of those that have just begun; as of `starting`, of `turning`
    sizes: np.ndarray  # (2,)  numbers of coordinates and units


load_slowing = loader(SlowingParts(_none, _whole, _none, _none, _whole, _whole, np.zeros((4, 0)), _whole))


@callback(VALUES)
def find_slowing(parts, own, t, state, out, t0, before, near):  # eight: VALUES
    """out (units,): as of `Slowing`."""
    x = load_slowing(own)
    n, count = x.sizes[0], x.sizes[1]
    now, values, v, axis, d = matrix(state, 3, n), vector(out, count), stack(3), stack(3), stack(3)
    earlier = matrix(before, 3, n)  # where the step began
    for u in range(count):
        o, one = 3 * u, x.table[INTS * u : INTS * (u + 1)]
        if x.begun[3, u] > 0.0:
            slip_velocity(earlier[0], earlier[1], one, x.points[o : o + 3], x.axes[o : o + 3], v, axis)
            if math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) > FASTER * x.begun[3, u]:
                x.begun[3, u] = 0.0
        slip_velocity(now[0], now[1], one, x.points[o : o + 3], x.axes[o : o + 3], v, axis)
        # The direction: a sign along the axis, or a vector
        square = 0.0
        for i in range(3):
            d[i] = x.memory[x.ways[o + i]]
            square += d[i] * d[i]
        size = math.sqrt(square) if square > 0.0 else 1.0
        for i in range(3):
            d[i] = x.memory[x.ways[o]] * axis[i] if x.signed[u] != 0 else d[i] / size
        values[u] = within(v, d, x.signed[u] != 0)
        begun, first, counts, kept = x.begun[0, u], x.begun[1, u], x.begun[2, u], x.begun[3, u]
        if kept > 0.0:
            values[u] = min(within(v, d, True), values[u] + kept)
        if begun < math.inf:
            values[u] = values[u] / (t - begun) if t > begun else first
        if counts < math.inf:
            values[u] = counts - math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return 0


class Slowing(KernelFunctions):
    """The velocities of frictions, along the directions in which they slide, as event functions.

    In a plane a new direction is taken where it has turned by 60 degrees: `within`. The velocity of one that has just
    begun to slide is divided by the time since, and a slow one across the direction is no turn: by it friction follows
    a load that turns. Of one that is held without a force, what its velocity lacks of one that counts: a motor may
    begin to move it.

    Parameters
    ----------
    frictions : Frictions
    begun : dict
        Of those that have just begun to slide: time and acceleration there, by their numbers.
    starting : dict
        Of those that are held without a force: the velocity that counts, by their numbers.
    rates : ndarray (frictions,)
        Sizes of the terms of accelerations.
    turning : dict
        Of those that begin to slide in a plane: the velocity up to which friction keeps its direction, by their
        numbers. Less across that direction is no turn; without an acceleration, a part of it back is no end. Until the
        slip has been faster at the start of a step.

    Attributes
    ----------
    noise : ndarray (frictions,)
        Rounding of the values, of slides that begin with an acceleration that is hardly more.
    """

    def __init__(self, frictions, begun, starting, rates, turning):
        count, packed = frictions.count, frictions.packed
        self.noise, starts = np.zeros(count), np.tile([[np.inf], [0.0], [np.inf], [0.0]], count)
        for i, (t, first) in begun.items():
            self.noise[i] = LEVEL * rates[i] if first < LEVEL / REACTION_NOISE * rates[i] else 0.0
            starts[:2, i] = t, first
        for i, most in turning.items():
            self.noise[i], starts[3, i] = self.noise[i] if i in begun else TURNS * most, most
        starts[2, list(starting)] = list(starting.values())
        memory, sizes = np.zeros(packed.system.memory.size), np.array([packed.system.bodies[:, 1].sum(), count], int)
        ways, signed = np.ascontiguousarray(frictions.ways).ravel(), frictions.signed.astype(int)
        own, *self._keep = resident(
            SlowingParts(memory, frictions.table, frictions.points, frictions.axes, ways, signed, starts, sizes)
        )
        self._turning = starts[3]
        self.functions = self.kernel = find_slowing, own, own, count, memory

    @property
    def turning(self):
        """Those of `turning` whose slips haven't been faster yet."""
        return {i: most for i, most in enumerate(self._turning.tolist()) if most > 0.0}


KERNELS = find_breaking, find_slowing
