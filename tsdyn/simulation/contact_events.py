"""Reactions and slips of closed contacts as event functions, which kernels evaluate."""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..analyses.contact_rows import load_rows, reaction_workspace, write_lam, write_rows
from ..analyses.shared_loads import lifts_of, loads_of
from ..jit.kernels import Record, callback, kernel, loader, matrix, resident, vector
from ..maths.tolerances import TINY
from ..model.equations import recall
from ..model.laws import calls_laws
from ..runs.group_search import VALUES, KernelFunctions
from ..workspaces import load_parts
from .grips import carried, gap_row, slip_columns
from .phase_scenes import first_row_of
from .tolerances import BEGINS, FASTER, KEPT, SLOW, TURNED

# Reactions


class ReactionNumbers(Record):
    """What stands at redundant rows."""

    redundant: float


class ReactionParts(NamedTuple):
    """Reactions of closed contacts, and bounds of those that stick."""

    numbers: ReactionNumbers
    memory: np.ndarray  # what forces remember
    normal: np.ndarray  # int64 (closed,)  rows of the gaps, -1 of one that depends on others,
    sign: np.ndarray  # (closed,)  and their signs over Phi
    slack: np.ndarray  # (closed,)
    loads: np.ndarray  # (closed and light, closed), or none  by `loads_of` and `lifts_of`, if rows depend on others
    which: np.ndarray  # int64 (sticking,)  which of the closed stick
    slip: np.ndarray  # int64 (2 sticking,)  rows of their slips; -1 of one that depends on others
    static: np.ndarray  # (sticking,)
    own: np.ndarray  # int64 (r or 0,)  rows of closed gaps and of slips that stick, if contacts share their reactions,
    spread: np.ndarray  # (k, 4 + 3 r)  by `ContactState.spread`, closed contacts first,
    limits: np.ndarray  # (k,)  and static coefficients; -1 of those that slide
    lam: np.ndarray  # (m,)  scratch


_none, _whole, _square = np.zeros(0), np.zeros(0, int), np.zeros((0, 0))
load_reactions = loader(ReactionParts(
        ReactionNumbers(), _none, _whole, _none, _none, _square, _whole, _whole, _none, _whole, _square, _none, _none
    )
)  # fmt: skip


@callback(VALUES)
def find_unit_reactions(parts, own, t, state, out, t0, before, near):  # eight: VALUES
    """out: as of `Reactions`; NaN where T isn't unique, nor shared."""
    c, x = load_parts(parts), load_reactions(own)
    closed, lam = x.normal.size, x.lam
    values = vector(out, max(closed, x.loads.shape[0]) + x.which.size)
    recall(c.system, x.memory)
    write_lam(c, t, vector(state, 3 * c.work.q.size), x.numbers.redundant, lam)
    for i in range(closed):
        if x.loads.shape[0] == 0:
            values[i] = x.slack[i] - x.sign[i] * lam[x.normal[i]]
        else:
            values[i] = x.slack[i] + _load(x, i)
    for k in range(x.which.size):
        i, j = x.slip[2 * k], x.slip[2 * k + 1]
        T = math.hypot(lam[i], lam[j]) if i >= 0 and j >= 0 else math.nan
        values[closed + k] = x.static[k] * values[x.which[k]] - T
    for i in range(closed, x.loads.shape[0]):
        values[x.which.size + i] = _load(x, i)
    if x.own.size > 0:
        _share(x, values)
    return 0


@kernel
def _load(x, i):
    """The load by row i of `loads`."""
    total = 0.0
    for j in range(x.normal.size):
        if x.normal[j] >= 0:
            total -= x.loads[i, j] * x.sign[j] * x.lam[x.normal[j]]
    return total


@kernel
def _share(x, values):
    """Values of reactions that contacts share; what is left to idle ones counts as that of those that stick."""
    closed, sticking, s = x.normal.size, x.which.size, x.spread
    for k in range(closed, values.size):
        values[k] = math.inf
    for i in range(s.shape[0]):
        N, T0, T1, at = s[i, 0], s[i, 1], s[i, 2], 4
        for c in range(3):
            total = 0.0
            for j in range(x.own.size):
                row = x.own[j]
                if row >= 0:
                    total -= s[i, at + j] * x.lam[row] * (x.sign[j] if j < closed else 1.0)
            at += x.own.size
            if c == 0:
                N += total
            elif c == 1:
                T0 += total
            else:
                T1 += total
        if i < closed:
            values[i] = x.slack[i] + N
        left = N if x.limits[i] < 0.0 else x.limits[i] * N - math.hypot(T0, T1) + s[i, 3]
        if i < closed:
            for k in range(sticking):
                if x.which[k] == i:
                    values[closed + k] = min(values[closed + k], left)
        elif sticking > 0:
            k = closed + i % sticking
            values[k] = min(values[k], left)


class Reactions(KernelFunctions):
    """Reactions of closed contacts, positive where they push, and their slack, which they may fall below zero.

    Then what is left to the bounds of those that stick, and how much those that would pull lack to carry.

    Parameters
    ----------
    gaps : Gaps
    modes : UnitModes
    packed : Packed
        Of the phase.
    """

    def __init__(self, gaps, modes, packed):
        self.gaps, self.packed, self.closed = gaps, packed, modes.closed
        self.sticks = [i for i in modes.closed if modes.sticks(i)]
        first, rough = first_row_of(packed), bool(modes.grips)
        rows = [-1 if i in modes.dependent else first[id(gap_row(gaps, modes, i))] for i in self.closed]
        self.normal = np.array(rows, int)
        off = [i for i in modes.idle if modes.slides(i)] if all(map(modes.slides, modes.grips)) else []
        self.light, self.loads = [], _square
        if off or modes.dependent:
            self.light, lifts = lifts_of(gaps, self.closed, modes.dependent, off)
            self.loads = np.concatenate([loads_of(gaps, self.closed, modes.dependent), lifts])
        self.slip = np.array([slip_columns(gaps.list[i], first) for i in self.sticks], int).reshape(-1, 2)
        self.which = np.array([self.closed.index(i) for i in self.sticks], int)
        self.smooth = np.flatnonzero(~gaps.rough[self.closed])
        self.slack = np.array([modes.slack.get(i, 0.0) for i in modes.closed])
        own = [self.normal, self.slip.ravel()] if modes.spread else [_whole]
        self.own, self.spread = np.concatenate(own), np.array([*modes.spread.values()], float, ndmin=2)
        self.limits = np.array([gaps.static[i] if modes.sticks(i) else -1.0 for i in modes.spread])
        self.shares = False  # whether dependent rows share friction, which the kernel doesn't know of
        # Rows of gaps that are redundant have no reaction; where there is friction they have an unknown one, or a share
        self.redundant = np.nan if rough and not modes.spread else 0.0

    @cached_property
    def workspace(self):
        """Made at the first evaluation: the start of the phase may show that rows are redundant."""
        return reaction_workspace(self.packed, self.redundant)

    @cached_property
    def functions(self):
        """As of `KernelFunctions`."""
        memory, scratch = np.zeros(self.packed.system.memory.size), np.zeros(self.workspace.m)
        own, *self._keep = resident(
            ReactionParts(
                ReactionNumbers(redundant=self.redundant), memory, self.normal, self.gaps.sign[self.closed], self.slack,
                self.loads, self.which, self.slip.ravel(), self.gaps.static[self.sticks], self.own, self.spread,
                self.limits, scratch,
            )
        )  # fmt: skip
        count = len(self.closed) + len(self.sticks) + len(self.light)
        return find_unit_reactions, self.workspace.address, own, count, memory

    @property
    def kernel(self):
        """As of `GroupSearch`; none where laws are called."""
        return None if calls_laws(self.packed) else self.functions

    def over(self, states):
        """Values (k, closed and sticking) of `States`."""
        if not self.shares:
            values = super().over(states)
            if not np.isnan(values).any():
                return values
            self.shares = True
        lam, _ = self.workspace.multipliers(states.t, states.levels, states.memory)
        N = -self.gaps.sign[self.closed] * np.where(self.normal < 0, 0.0, lam[:, self.normal])
        N = N @ self.loads[: len(self.closed)].T if self.loads.size else N
        held, smooth = N[:, self.which], (np.array(self.closed)[self.smooth].tolist(), N[:, self.smooth])
        T = np.where(self.slip < 0, np.nan, -lam[:, self.slip])
        memory = np.tile(states.memory, (states.t.size, 1))
        N[:, self.which], T, N[:, self.smooth] = carried(
            self.gaps, self.sticks, states.t, states.q, memory, held, T, *smooth
        )
        N = N + self.slack
        return np.hstack([N, self.gaps.static[self.sticks] * N[:, self.which] - np.hypot(*np.moveaxis(T, 2, 0))])


# Slips


class SlipNumbers(Record):
    """Numbers of coordinates."""

    n: int


class SlipParts(NamedTuple):
    """Slips of contacts that slide, c of them."""

    numbers: SlipNumbers
    memory: np.ndarray  # what forces remember
    ways: np.ndarray  # int64 (c,)  where it has the directions (3,), of the length of a slow slip
    at: np.ndarray  # int64 (c,)  where directions of the ground frame begin in the rows,
    sign: np.ndarray  # (c,)  and their signs
    place: np.ndarray  # int64 (m,)  which row of J is that of a contact, -1 for none
    short: np.ndarray  # (lines, 14)  scratch for rows
    J: np.ndarray  # (2 c, n)
    drift: np.ndarray  # (m,)
    rounding: np.ndarray  # (c,)
    since: np.ndarray  # (c,)  when slips have become fast, s; infinite before
    begun: np.ndarray  # (2, c)  time and acceleration, if any, of those that begin at rest; infinite times of others


load_slips = loader(
    SlipParts(
        SlipNumbers(), _none, _whole, _whole, _none, _whole, np.zeros((0, 0)), np.zeros((0, 0)), *np.zeros((3, 0)),
        np.zeros((0, 0)),
    )
)  # fmt: skip


@kernel
def _slip(x, i, state):
    """Components of slip i along its direction and across it, and its size, by the rows in J; what a slow one is."""
    d, n = x.memory[x.ways[i] : x.ways[i] + 3], x.numbers.n
    v0, v1, w0, w1 = 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        v0 += x.J[2 * i, j] * state[1, j]
        v1 += x.J[2 * i + 1, j] * state[1, j]
    for j in range(3):
        w0 += x.J[2 * i, x.at[i] + j] * d[j]
        w1 += x.J[2 * i + 1, x.at[i] + j] * d[j]
    size = x.sign[i] * max(math.hypot(w0, w1), TINY)
    along, across = (v0 * w0 + v1 * w1) / size, abs(v1 * w0 - v0 * w1) / abs(size)
    return along, across, math.hypot(v0, v1), max(math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), TINY)


@kernel
def _find_rows(s, x, t, state):
    x.J[:, :] = 0.0
    write_rows(s, t, state[0], x.place, x.short, x.J, x.drift)


@callback(VALUES)
def find_unit_slips(contacts, own, t, state, out, t0, before, near):  # eight: VALUES
    """out (c,): as of `Halting`."""
    s, x = load_rows(contacts), load_slips(own)
    n, count = x.numbers.n, x.at.size
    values, now, first = vector(out, count), matrix(state, 3, n), matrix(before, 3, n)
    slow = False
    for i in range(count):
        slow = slow or x.since[i] == math.inf
    if slow:
        _find_rows(s, x, t0, first)
        for i in range(count):
            _, _, v, least = _slip(x, i, first)
            if x.since[i] == math.inf and v > FASTER * SLOW * least:
                x.since[i] = t0
    _find_rows(s, x, t, now)
    for i in range(count):
        along, across, v, least = _slip(x, i, now)
        V, h = SLOW * least, BEGINS
        if x.since[i] < math.inf:
            turned = across * across
            h = turned / (turned + (TURNED * v) * (TURNED * v) + x.rounding[i] * x.rounding[i] + TINY)
        c = 0.5 + h * V / (v + V)  # from 1 on a slip has turned too far
        value = along - c * across / math.sqrt(max(1.0 - c * c, TURNED * TURNED))
        if x.since[i] == math.inf and x.begun[0, i] < math.inf:
            value = min(along, value + least)
        if x.since[i] == math.inf and v > FASTER * V:
            value = max(value, KEPT * v)
        begun, gain = x.begun[0, i], x.begun[1, i]
        if gain > 0.0:
            value = value / (t - begun) if t > begun else gain
        values[i] = value
    return 0


class Halting(KernelFunctions):
    """Slips v of contacts, as event functions: u - z c / sqrt(1 - c^2), zero where one ends or d.v = c |v|.

        u = d.v,  z = |v - u d|,  c = 1/2 + w h,  w = V / (|v| + V),  h = z^2 / (z^2 + (TURNED |v|)^2 + noise^2)

    Of a slip that ends without turning that is as smooth as v. Here d is of unit length, and V is SLOW times D, the
    slip below which friction has this direction. A slip turns by 60 degrees at v >> V; where it has turned at all when
    it is as slow as V, it takes its direction there, so that it ends with its own. One that hasn't been FASTER V at the
    start of a step since its phase began has h = BEGINS, and turns by 8 degrees at v << V: it begins, or has its
    direction from there. What friction that follows a load leaves such a slip across d is less than D, and no turn: of
    u and the value plus D the lesser one counts. Where it begins at rest, the value is divided by the time since: the
    slip may turn at once. In the step in which it becomes faster the value is KEPT |v| at least: one that has turned
    too far before its value was above zero, as in a long step from rest, takes its direction where the next step
    begins.

    Parameters
    ----------
    gaps : Gaps
    slides : list of int
        Those that slide.
    rounding : ndarray (slides,), m/s
        Of the slips: of one that others hold, nothing else is left.
    begun : dict
        Of those that begin at rest: time and acceleration there, by the numbers of gaps.
    fast : dict of int to float
        Times, s, since when slips have been faster, by the numbers of gaps: found with the values.

    Attributes
    ----------
    noise : ndarray (slides,)
        Rounding of the values.
    """

    def __init__(self, gaps, slides, rounding, begun, fast):
        workspace, (rows, at, sign) = gaps.workspace, gaps.slips(slides)
        self._workspace = workspace  # kept as long as addresses of it are in use
        self.slides, self.since = slides, np.array([fast.get(i, np.inf) for i in slides], float)
        self.noise = np.where([begun.get(i, (0.0, 0.0))[1] > 0.0 for i in slides], 0.0, rounding)
        place, memory = np.full(workspace.m, -1), np.zeros(gaps.packed.system.memory.size)
        place[rows.ravel()] = np.arange(rows.size)
        starts = np.array([begun.get(i, (np.inf, 0.0)) for i in slides], float).reshape(-1, 2).T
        own, *self._keep = resident(
            SlipParts(
                SlipNumbers(n=workspace.n), memory, gaps.slots[slides], at, sign, place, workspace.short,
                np.zeros((rows.size, workspace.n)), np.zeros(workspace.m), rounding, self.since,
                np.ascontiguousarray(starts),
            )
        )  # fmt: skip
        self.functions = self.kernel = find_unit_slips, workspace.rows_address, own, len(slides), memory

    @property
    def fast(self):
        """Times, s, since when slips have been fast, by the numbers of gaps."""
        return {i: t for i, t in zip(self.slides, self.since.tolist(), strict=True) if t < np.inf}


KERNELS = find_unit_reactions, find_unit_slips
