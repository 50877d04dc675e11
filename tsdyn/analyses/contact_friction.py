"""Contacts with Coulomb friction at one state: impacts, and which stick, slide and open.

    u = G p + b    rates of gaps and slips, normal and two tangential rows a contact, the bilateral rows eliminated
    impact         b = (gd- + e min(gd-, 0), v-): Newton's law along normals, in tangents the cone of kinetic friction
    accelerations  b = (gdd, vd) of open contacts; a contact that slides has T = -mu N v / |v|, one at rest the cone

See maths/complementarity.py for the cone. With friction the laws of impact can add energy, or have no solution where
joints tie slips to rates of gaps: coefficients of restitution are lowered together until neither is so.
"""

from __future__ import annotations

from contextlib import suppress
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ..maths.central_path import deepest, proportional
from ..maths.complementarity import OPEN, STICKS, solve_cone
from ..maths.dense_solve import least_squares, null_space, product
from ..maths.tolerances import HALF_DIGITS, NEGLIGIBLE, RANK_TOL, SUM_ROUNDING, TINY
from .contact_problem import ContactState, NoSolution, depends, energy_gain, slack_of
from .shared_loads import groups_of, loads_of, rank_of, rows_of_closed
from .tolerances import (
    AHEAD,
    EVENT_ERROR,
    FAR,
    LEAST_SHARE,
    LEAST_SLIP,
    LEAST_WEIGHT,
    LEVEL,
    NEAR_WAY,
    PULLS,
    SECANTS,
    SLOWEST_SLIP,
    WAYS,
    WITHIN_BOUND,
)


def rows_of(inertia, which):
    """Rows (3 k, n) of the gaps `which` and of their slips."""
    return np.concatenate([inertia.J[which][:, None], inertia.tangents[which]], axis=1).reshape(3 * len(which), -1)


class Struck(NamedTuple):
    """What an impact with friction does."""

    p: np.ndarray  # (k, 3) impulses, normal and along both slips
    change: np.ndarray  # (n,) of velocities
    share: float  # of the coefficients of restitution that act


def strike(inertia, which, qd, rates, restitution, law="newton"):
    """The `Struck` of an impact of the gaps `which`; rates (k,) before, restitution (k,). Raises NoSolution."""
    rows = rows_of(inertia, which)
    response = inertia.free(rows.T)
    G, mu, rounding = product(rows, response), inertia.gaps.kinetic[which], SUM_ROUNDING * inertia.sizes(qd).max()
    before = np.column_stack([rates, inertia.slips(qd)[which]]).ravel()
    normal = np.arange(0, before.size, 3)

    def solved(given, b):
        p = solve_cone(G, b, mu, given=given, rounding=rounding)[0]
        if p is None:
            raise NoSolution
        return p

    def released(e):
        if compressed is None:
            b = before.copy()
            b[normal] += e * np.minimum(rates, 0.0)
            return solved(none, b)
        p = compressed.copy()
        p[normal] += e * compressed[normal]
        return p + solved(e * compressed[normal], before + G @ p)

    none = np.zeros(len(which))
    compressed = solved(none, before) if law == "poisson" else None
    share = 1.0
    while True:
        try:
            p = released(share * restitution)
            if energy_gain(G, before, p) <= LEVEL * (np.abs(before) @ np.abs(p)) or share == 0.0:
                return Struck(p.reshape(-1, 3), response @ p, share)
        except NoSolution:
            if share == 0.0:
                raise
        share = share / 2.0 if share > LEAST_SHARE else 0.0


class Cones:
    """The gaps `resting`, closed and without a rate, at velocities qd (n,), and the cones of their reactions.

    Attributes
    ----------
    rows : ndarray (3 k, n)
        Of gaps and slips.
    bias : ndarray (3 k,)
        Accelerations of these where the bodies have none.
    open, terms : ndarray (count,)
        Accelerations of all gaps where all are open, and the sizes of their terms.
    slow : ndarray (count,)
        Of `slow_speeds`.

    Of some that slide the friction has directions `ways` (2,) in place of those of their slips.
    """

    def __init__(self, inertia, resting, qd, ways=MappingProxyType({})):
        gaps, slips = inertia.gaps, inertia.slips(qd)[resting]
        self.open, self.terms = inertia.accelerations(qd)
        self.rounding = SUM_ROUNDING * self.terms.max(initial=0.0)
        self.rows, self.bias = rows_of(inertia, resting), inertia.biases(qd)[resting].ravel()
        speeds, self.slow = np.hypot(*slips.T), slow_speeds(inertia, qd, self.terms)
        self.slides = speeds > LEAST_SLIP * self.slow[resting]
        self.d = np.full(slips.shape, np.nan)
        self.d[self.slides] = slips[self.slides] / speeds[self.slides, None]
        for i, d in ways.items():
            self.d[resting.index(i)] = d
        self.rough, self.kinetic, self.static = (x[resting] for x in (gaps.rough, gaps.kinetic, gaps.static))
        self.broken = bool(inertia.broken)

    def solve(self, G, b, bounds=()):
        """Reactions p (3 k,), modes and coefficients (k,), where accelerations are G p + b; raises NoSolution.

        bounds: of forces (3,) that follow; they have modes, too.
        """
        mu = np.where(self.slides, self.kinetic, self.static)
        # Contacts at rest whose friction reaches the bound slide by the kinetic coefficient
        for _ in range(mu.size + 1):
            p, mode = solve_cone(G, b, mu, self.d, None, bounds, self.rounding)
            if p is None:
                raise NoSolution
            N, *T = p.reshape(-1, 3)[: mu.size].T
            bound = np.hypot(*T) >= (1.0 - EVENT_ERROR) * mu * N
            leave = bound & ~self.slides & (mode[: mu.size] != OPEN) & self.rough & (mu > self.kinetic * WITHIN_BOUND)
            if not leave.any():
                break
            mu = np.where(leave, self.kinetic * WITHIN_BOUND, mu)
        return p, mode, mu


def solve_rough_contacts(inertia, resting, qd, fired=()):
    """Which gaps that are closed and at rest stay so, and which stick or slide; arguments as of `solve_contacts`.

    Slips that are rounding have been ended in qd, see `halted`; so have slow ones that come to rest, see `at_turn`.

    Returns
    -------
    ContactState
        With `grips`: for each closed gap with friction None where it sticks, or the direction (3,) of its slip, ground
        frame.

    Raises
    ------
    NoSolution
        Where no reactions that push keep the contacts from penetrating, or several do: with much friction (Painleve).
    """
    kept = None
    for by_rows in False, True:
        found, pulls, moves_so = _solve(inertia, resting, qd, fired, by_rows)
        carries = found.spread and moves_so
        if (found.idle or len(fired)) and not carries and (shared := _together(inertia, resting, found, qd, fired)):
            return shared
        if found.idle and not carries and (alone := _alone(inertia, found, qd, fired)):
            return alone
        if not pulls:
            kept = kept or found
            if not found.idle:
                break
    if kept is None:
        raise NoSolution
    return kept


def _alone(inertia, found, qd, fired):
    """The `ContactState` in which idle contacts carry nothing, as in the phase, or None.

    What the others do follows from their own normal loads; some of them may open then, and idle ones close for them.
    """
    which, seen, small = found.closed, [], LEVEL * inertia.accelerations(qd)[1] + inertia.carried()
    while which not in seen:
        seen.append(which)
        try:
            again, pulls, _ = _solve(inertia, which, qd, fired)
        except NoSolution:
            return None
        left = {*found.closed, *found.idle}.difference(again.closed, again.idle)
        low = sorted(i for i in left if again.accelerations[i] <= small[i])
        idle = [i for i in low if depends(inertia, again.closed, i)]
        missing = [i for i in low if again.accelerations[i] < -small[i] or (i not in idle and i not in fired)]
        if not missing:
            grips = {**{i: d for i, d in found.grips.items() if i in idle}, **again.grips}
            return None if pulls else again._replace(idle=sorted([*again.idle, *idle]), grips=grips)
        which = sorted([*again.closed, *again.idle, min(missing, key=again.accelerations.item)])
    return None


def _together(inertia, resting, found, qd, fired):
    """The `ContactState` in which contacts that slide share their loads, see shared_loads.py, or None.

    Without those of them that would have to pull. What starts to slide does so along its acceleration.
    """
    gaps, grips, out = inertia.gaps, dict(found.grips), set()
    # What no longer pushes stays closed, if others hold it
    light = [i for i in resting if i in fired and i not in found.held and depends(inertia, found.closed, i)]
    if not (found.idle or light):
        return None
    slips, alone, (c, terms) = inertia.slips(qd), inertia.slip_accelerations(qd), inertia.accelerations(qd)
    least = LEVEL * terms + inertia.carried()
    light = [i for i in light if slips[i].any() and found.accelerations[i] <= least[i]]
    grips |= {i: inertia.along(i, slips[i] / np.hypot(*slips[i])) for i in light}
    held = sorted([*found.held, *light])
    groups = [members for members in groups_of(gaps, held) if all(grips[i] is not None for i in members)]
    for _ in range(WAYS if groups else 0):
        closed, dependent = _ranked(inertia, found, groups, out)
        if not (dependent or out):
            return None
        which = sorted([*closed, *dependent])
        sticks = [i for i in closed if gaps.rough[i] and grips[i] is None]
        shares = loads_of(gaps, which, dependent)[:, np.isin(which, closed)]
        tangents = inertia.tangents[sticks].reshape(-1, inertia.q.size)
        loads = np.concatenate([product(shares.T, _loads(inertia, which, _ways(inertia, grips))), tangents])
        response = inertia.free(loads.T)
        rows, a = (rows_of_closed(gaps, which, dependent, x) for x in (inertia.J, c))
        A = product(np.concatenate([rows, tangents]), response)
        p = -least_squares(A, np.concatenate([a, alone[sticks].ravel()]), RANK_TOL**2)
        if (np.linalg.eigvals(A).real < -RANK_TOL * np.abs(A).max()).any():
            return None
        N, T, push = shares @ p[: len(closed)], np.hypot(*p[len(closed) :].reshape(-1, 2).T), response @ p
        small = LEVEL * (terms + np.abs(product(inertia.J, response)) @ np.abs(p)) + inertia.carried()
        rounding = np.maximum(small[which] / inertia.G[which, which], EVENT_ERROR * N.max())
        least = np.where(np.isin(which, fired) & (N - rounding <= 0.0), -np.inf, N + rounding)
        moves, pace = alone + inertia.tangents @ push, np.abs(alone) + np.abs(inertia.tangents @ response) @ np.abs(p)
        gain, least_gain = np.hypot(*moves.T), EVENT_ERROR * pace.max(axis=1)
        begins = [i for i in which if grips.get(i) is not None and not slips[i].any()]
        if (gain[begins] <= least_gain[begins]).any():
            return None
        ways = {i: moves[i] / gain[i] for i in begins}
        turned = {i: way for i, way in ways.items() if abs(_cross(inertia.across(i, grips[i]), way)) > EVENT_ERROR}
        worst = which[least.argmin()]
        if least.min() < 0.0:
            if not any(worst in members for members in groups):
                return None
            out.add(worst)
        elif turned:
            between = {i: inertia.across(i, grips[i]) + way for i, way in turned.items()}  # whole steps may diverge
            grips |= {i: inertia.along(i, way / np.hypot(*way)) for i, way in between.items()}
        else:
            break
    else:
        return None
    left, gdd = (1.0 - EVENT_ERROR) * gaps.static[sticks] * N[np.isin(which, sticks)] - T, c + inertia.J @ push
    others = [i for i in inertia.which if i not in which]
    if (left < 0.0).any() or (gdd[others] < -small[others]).any():
        return None
    gains = {i: moves[i] for i in held if grips.get(i) is not None and slips[i].any()}
    begun = {i: float(gain[i]) for i in ways}
    idle = [i for i in held if i not in closed]
    slack = slack_of(inertia, which, N, small)
    return ContactState(
        closed, idle, gdd, push, grips, found.rows, slack, gains, begun, found.slow, dependent=tuple(dependent)
    )


def _ranked(inertia, found, groups, out):
    """Closed gaps whose rows are independent, and those that share loads with them: of groups, but those that are out.

    Groups go whose rows may depend on others at this instant alone.
    """
    gaps, closed, dependent, held = inertia.gaps, [], [], []
    closed += [i for i in found.closed if not any(i in members for members in groups)]
    for members in list(groups):
        own, first = [i for i in members if i not in out], len(closed)
        if not own:
            continue
        rest, law, n = [], gaps.list[own[0]].side.grip.sliding, inertia.normal(own[0])
        for i in sorted(own, key=lambda i: i not in found.closed):
            (rest if depends(inertia, closed, i) else closed).append(i)
        rank = len(closed) - first
        along = (a is law.a and np.abs(np.cross(z, n)).max() < HALF_DIGITS for a, z in held)
        if rank == rank_of(gaps, own):
            dependent += rest
            held += [(law.a, n)] if rank == 3 and not gaps.turns(law.b) else []
        elif rank == 1 and not gaps.turns(law.b) and (any(along) or not gaps.turns(law.a)):
            dependent += rest
        else:
            groups.remove(members)
            return _ranked(inertia, found, groups, out)
    return sorted(closed), dependent


def at_turn(inertia, resting, qd, fired, turned, opening=()):
    """Velocities (n,) and the `ContactState`, with the slips ended that come to rest where they turn.

    Below `slow_speeds` friction keeps its direction, so that a slip which ends turns again and again. It is ended where
    the contact would stick: with all that are as slow, as of a body that comes to rest, or alone. Below a part of that,
    SLOWEST_SLIP, it is ended, too, where it slows down with its friction against it, to slide off in another direction
    at once: with all of its two bodies, since the slip of one point alone is no motion that begins. Energy never grows.
    One that turns to and fro takes the direction between, see `_between`.

    turned : list of int
        Gaps whose slips have turned away from the direction of their friction.
    opening : list of int
        Gaps that open with a rate: they go on to.
    """
    limits = slow_speeds(inertia, qd, inertia.accelerations(qd)[1])
    turned = slow_slips(inertia, qd, [i for i in turned if i in resting], limits)
    slow = slow_slips(inertia, qd, [i for i in resting if inertia.gaps.rough[i]], limits)
    closed = [i for i in inertia.held if i in resting]

    def ended(which, closed=closed, ways=MappingProxyType({})):
        found, work = halted(inertia, qd, closed, which, ways)
        if found is not qd:
            rates, before = inertia.rates(found), inertia.rates(qd)
            more = [i for i in opening if rates[i] <= 0.5 * before[i]]
            if rates[resting].any() or more:  # others have closed at once
                found, work = halted(inertia, qd, [*resting, *more], which, ways)
            if work > NEGLIGIBLE * _energy(inertia, qd):  # by the friction of others that slide
                found = qd
        return found, solve_rough_contacts(inertia, resting, found, fired)

    for which in (slow, turned) if turned else ():
        try:
            found = ended(which)
        except NoSolution:
            continue
        if all(found[1].grips.get(i, ()) is None for i in which):
            return found
    least = slow_slips(inertia, qd, slow, LEAST_SLIP * limits)
    found = ended(least, resting)
    gains, slips = found[1].gains, inertia.slips(qd)
    slowest = slow_slips(inertia, qd, turned, SLOWEST_SLIP * limits)
    pairs = {_pair(inertia.gaps, i) for i in slowest if i in gains and gains[i] @ slips[i] < 0.0}
    which = [i for i in slow_slips(inertia, qd, slow, SLOWEST_SLIP * limits) if _pair(inertia.gaps, i) in pairs]
    if which:
        return ended(which)
    ways = _between(inertia, resting, *found, fired, turned)
    with suppress(NoSolution):
        return ended([*least, *ways], ways=ways) if ways else found
    return found


def _between(inertia, resting, qd, state, fired, turned):
    """Directions (2,) of slow slips that turn to and fro: in which they have no acceleration across.

    Slips turn the sooner the slower they are. So does friction, till it leaves the slip its direction: between that of
    the phase before, in which the slip has turned, and the present one, in which it would turn back.
    """
    ends = {}  # of each slip: directions, and by how much it turns with these
    for i in turned:
        way = inertia.across(i, inertia.slots[inertia.gaps.slots[i] :][:3])
        if i in state.gains and way.any():
            d, way = inertia.across(i, state.grips[i]), way / np.hypot(*way)
            ends[i] = [[way, np.nan], [d, _cross(d, state.gains[i])]]
    if not ends:
        return {}
    try:
        found = {i: way for i, ((way, _), _) in ends.items()}
        for _ in range(SECANTS + 1):
            state = _solve(inertia, resting, qd, fired, ways=found)[0]
            for i, (first, last) in list(ends.items()):
                turn, start = _cross(found[i], state.gains.get(i, 0.0 * found[i])), np.isnan(first[1])
                (first if start or turn * first[1] > 0.0 else last)[:] = found[i], turn
                (c, x), (d, y) = first, last
                if start and not (x * y < 0.0 and x * _cross(c, d) > 0.0 and d @ c > NEAR_WAY):
                    del ends[i], found[i]
                else:
                    d = abs(x) * d + abs(y) * c
                    found[i] = d / np.hypot(*d)
            if not found:
                break
    except NoSolution:
        return {}
    return found


def _cross(a, b):
    """a x b of a (2,) and b (2, ...), along the normal."""
    return a[0] * b[1] - a[1] * b[0]


def _energy(inertia, qd):
    """Kinetic energy, J, of velocities (n,)."""
    return inertia.gaps.workspace.gain(inertia.q, np.zeros_like(qd), qd)


def _pair(gaps, i):
    """The two bodies of a gap."""
    part = gaps.list[i].side.row
    return frozenset((id(part.a), id(part.b)))


def _solve(inertia, resting, qd, fired, by_rows=False, ways=MappingProxyType({})):
    """As `solve_rough_contacts`, with the normal loads shared among all contacts; whether a closed one pulls.

    And whether the bodies move so where idle contacts carry nothing, as in the phase.

    by_rows: closed contacts are chosen by what holds their rows, instead of by the same accelerations.
    ways: of `Cones`.
    """
    gaps, resting = inertia.gaps, list(resting)
    cones = Cones(inertia, resting, qd, ways)
    response = inertia.free(cones.rows.T)
    G, c, terms = product(cones.rows, response), cones.open, cones.terms
    b = np.column_stack([c[resting], inertia.slip_accelerations(qd)[resting]]).ravel()
    p, mode, mu = cones.solve(G, b)
    N, T, d, slides = p[::3], p.reshape(-1, 3)[:, 1:], cones.d, cones.slides
    _demand_unique(G, d, mu, mode)
    push = response @ p
    gdd = c + inertia.J @ push
    small, carried = LEVEL * (terms + np.abs(product(inertia.J, response)) @ np.abs(p)), inertia.carried()
    mode = _sharing(G, b, p, mode, cones, gaps.levers(inertia.q)[:, None] * response)
    moves, sizes = ((A @ x + y).reshape(-1, 3)[:, 1:] for A, x, y in ((G, p, b), (np.abs(G), np.abs(p), np.abs(b))))
    closed, idle, spare, grips, begun = [], [], [], {}, {}
    for j in np.argsort(-N * np.sqrt(np.diag(G)[::3])):
        i = resting[j]
        pushes = N[j] * G[3 * j, 3 * j] > small[i] + carried[i] * (i in fired)
        if not pushes and (gdd[i] > small[i] or i in fired):
            continue
        sticks = [k for k in closed if grips.get(k, ()) is None]
        if not pushes and depends(inertia, closed, i, sticks):  # the friction of others holds it
            spare.append(i)
        else:
            (idle if depends(inertia, closed, i) else closed).append(i)
        if gaps.rough[i]:
            # What neither opens nor pushes has no friction: it slides, or sticks where its slip has no acceleration
            held = pushes and mu[j] > 0.0
            way, rounding = (-T[j], 0.0) if held else (moves[j], 0.0 if pushes else LEVEL * sizes[j].max())
            length = np.hypot(*way)
            if slides[j]:
                grips[i] = inertia.along(i, d[j])
            elif (pushes and mode[j] == STICKS) or not length > rounding:
                grips[i] = None
            else:
                grips[i] = inertia.along(i, way / length)
                gain = moves[j] @ way / length
                begun |= {i: float(gain)} if gain > EVENT_ERROR * sizes[j].max() else {}
    alone = dict(zip(resting, b.reshape(-1, 3), strict=True))
    if by_rows:
        idle += spare
        closed, idle, spare = *_pushing(inertia, [*closed, *idle], grips, alone, fired), []
    else:
        closed, idle = _carried(inertia, closed, idle, grips, N, resting, fired)
    gains = {resting[j]: moves[j] for j in np.flatnonzero(slides)}
    which, ways = [*closed, *idle, *spare], [d for d in grips.values() if d is not None]
    as_one = all(np.abs(d - ways[0]).max() < HALF_DIGITS for d in ways)  # shares of slips that turn would turn, too
    for again in False, True:
        if again:  # where all share, closed ones need not push: those that stick first, which hold more rows
            closed, idle, spare = [], [], []
            for i in sorted(which, key=lambda i: (grips.get(i, ()) is not None, -N[resting.index(i)])):
                (idle if depends(inertia, closed, i) else closed).append(i)
            closed.sort()
        rows, depending = _independent(inertia, closed, grips)
        if depending:
            closed, spare = [i for i in closed if i not in depending], spare + depending
            rows, _ = _independent(inertia, closed, grips)
        idle = sorted(idle + spare)
        (pushes, *T), rounding, moved, braced = _held(inertia, closed, grips, alone, small + carried)
        pulls, sticks = bool((pushes < -rounding).any()), [k for k, i in enumerate(closed) if i in rows]
        bounds = (1.0 - EVENT_ERROR) * gaps.static[closed] * pushes
        braced = braced and bool(idle)
        change = np.abs(cones.rows @ (moved - push)).reshape(-1, 3).max(axis=1, initial=0.0)
        moves_so = not (change > EVENT_ERROR * sizes.max(axis=1)).any()
        if not again:
            slack = slack_of(inertia, closed, pushes, small)
            state = ContactState(closed, idle, gdd, push, grips, rows, slack, gains, begun, cones.slow)
            found = state, pulls, moves_so
        beyond = (np.hypot(*T) > np.maximum(bounds, gaps.static[closed] * rounding))[sticks].any()
        if not (sticks and as_one and (again or pulls or braced or beyond)):
            break
        spread, shares = _spread(inertia, closed, idle, grips, alone)
        if not spread:
            break
        if moves_so:
            slack = slack_of(inertia, closed, shares, small)
            return state._replace(closed=closed, idle=idle, rows=rows, slack=slack, spread=spread), False, True
    return found


def _sharing(G, b, p, mode, cones, response):
    """Modes (k,) in which all contacts stick that don't accelerate, if the same reactions can be within their bounds.

    Where slips depend on each other, the solution may have some at their bounds that others could relieve.
    """
    moves, terms = ((x @ y + z).reshape(-1, 3)[:, 1:] for x, y, z in ((G, p, b), (np.abs(G), np.abs(p), np.abs(b))))
    # Where one has just reached the bound it goes on to slide; those that are at it stay, as bodies that slide as one
    level, beyond = (LEVEL, -EVENT_ERROR) if cones.broken else (EVENT_ERROR, EVENT_ERROR)
    still = cones.rough & ~cones.slides & (mode != OPEN) & (np.abs(moves) <= level * terms).all(axis=1)
    if (mode[still] == STICKS).all():
        return mode
    loads = response.T[np.repeat(still, 3)]
    N, *T = share(cones.static[still], loads, p.reshape(-1, 3)[still])[0].T
    within = np.hypot(*T) < (1.0 + beyond) * cones.static[still] * N
    return np.where(still, STICKS, mode) if within.all() else mode


def _independent(inertia, closed, grips):
    """Which rows (2,) of the slips of closed contacts that stick are independent of the gaps and of those before.

    And closed gaps that depend on those before.
    """
    if not closed:
        return {}, []
    sticks = [i for i in closed if grips.get(i, ()) is None]
    rows = np.concatenate([inertia.J[closed], inertia.tangents[sticks].reshape(2 * len(sticks), inertia.q.size)])
    loads, kept = inertia.free(rows.T).T, np.zeros(len(rows), bool)
    sizes = (rows * loads).sum(axis=1)
    held = RANK_TOL**2 * sizes.max()  # by bilateral rows
    # Gram-Schmidt in the metric of kinetic energy: of slips, rows that are independent by far come first
    gaps, slips = range(len(closed)), range(len(closed), len(rows))
    for k, share in [(k, RANK_TOL) for k in gaps] + [(k, share) for share in (FAR, RANK_TOL) for k in slips]:
        if kept[k]:
            continue
        for _ in range(2):  # as classical Gram-Schmidt is right to rounding
            shares = loads[kept] @ rows[k]
            rows[k] -= shares @ rows[kept]
            loads[k] -= shares @ loads[kept]
        left = rows[k] @ loads[k]
        kept[k] = left > max(share * sizes[k], held)
        if kept[k]:
            rows[k] /= np.sqrt(max(left, TINY))
            loads[k] /= np.sqrt(max(left, TINY))
    depending = [i for i, own in zip(closed, kept, strict=False) if not own]
    return dict(zip(sticks, kept[len(closed) :].reshape(-1, 2).tolist(), strict=True)), depending


def _demand_unique(G, d, mu, mode):
    """Raise NoSolution where the reactions of contacts that slide would be one of several solutions."""
    known = np.isfinite(d).all(axis=1)
    if not (known & (mode != OPEN)).any():
        return
    load = np.zeros((mode.size, 3, 3))  # p by the unknowns of each contact
    for j in range(mode.size):
        load[j] = np.eye(3)
        if known[j]:
            load[j, 1:, 0] = -mu[j] * d[j]
    held = [3 * j + i for j in np.flatnonzero(mode != OPEN) for i in range(1 if mode[j] != STICKS else 3)]
    size = np.diag(G)
    held = [r for r in held if size[r] > RANK_TOL**2 * size.max()]  # bilateral rows hold the others
    own = G.reshape(G.shape[0], -1, 3)
    A = np.einsum("rji,jik->rjk", own, load).reshape(G.shape)[np.ix_(held, held)]
    scale = np.sqrt(size[held])
    A = A / scale[:, None] / scale
    values = np.linalg.eigvals(A)
    if (values.real < -RANK_TOL).any():
        raise NoSolution


def _carried(inertia, closed, idle, grips, N, resting, fired):
    """closed and idle with the idle ones exchanged so that all reactions of closed ones push."""
    if not idle:
        return sorted(closed), idle
    which = [*closed, *idle]
    columns = inertia.free(_loads(inertia, which, _ways(inertia, grips)).T)
    given = np.array([max(N[resting.index(i)], 0.0) for i in which])
    return _basis(inertia, which, columns, columns @ given, fired)


def _pushing(inertia, which, grips, b, fired):
    """closed and idle of the gaps `which`, so that closed ones push where they alone hold; arguments as of `_held`.

    With dependent rows loads of contacts that slide may be independent: other ones give other accelerations.
    """
    A, a, _ = _holding(inertia, which, grips, b)
    return _basis(inertia, which, np.hstack([A, -A[:, len(which) :]]), -a, fired)


def _basis(inertia, which, columns, load, fired):
    """closed and idle of the gaps `which`: closed ones independent, by their nonnegative shares of a load.

    columns: of the gaps first. fired: those whose reactions have vanished, and fall: others carry in their place.
    """
    from scipy.optimize import nnls

    size = np.linalg.norm(columns, axis=0)
    shares, _ = nnls(columns / np.where(size > 0.0, size, 1.0), load)
    shares, closed, idle = shares[: len(which)], [], []
    shares[np.isin(which, fired) & (shares <= EVENT_ERROR * shares.max())] = -1.0
    for j in np.argsort(-shares):
        (idle if depends(inertia, closed, which[j]) else closed).append(which[j])
    return sorted(closed), sorted(idle)


def halted(inertia, qd, resting, which, ways=MappingProxyType({})):
    """Velocities (n,) with the slips ended of the gaps `which`, while the gaps `resting` keep their rates; and work, J.

    Of slips with `ways`, directions (2,), the part across these.

    What sticks goes on to, and what goes on sliding changes its friction with its load: as in the course of time. The
    work is that of the friction: what drives bodies does some, too, where they come to rest on one that moves.
    """
    if not which:
        return qd, 0.0
    frictional, slips = [i for i in resting if inertia.gaps.rough[i]], inertia.slips(qd)
    moving = [i for i in frictional if i not in which and slips[i].any()]
    loads = _loads(inertia, resting, {i: slips[i] / np.hypot(*slips[i]) for i in moving})
    across = {i: _cross(d, inertia.tangents[i])[None] for i, d in ways.items()}
    tangents = [across.get(i, inertia.tangents[i]) for i in frictional if i not in moving]
    tangents = np.concatenate([loads[:0], *tangents])
    response = inertia.free(np.concatenate([loads, tangents]).T)
    left = np.concatenate([np.zeros(len(resting)), tangents @ qd])
    G = product(np.concatenate([inertia.J[resting], tangents]), response)
    p = least_squares(G, left, RANK_TOL**2)
    after = qd - response @ p
    friction = np.concatenate([loads - inertia.J[resting], tangents])
    return after, -0.5 * float(p @ (friction @ (qd + after)))


def slow_speeds(inertia, qd, terms):
    """Slips (count,), m/s, below which friction keeps a direction: parts of the bodies' velocities.

    And of those that the largest of the accelerations of gaps, `terms` (count,), causes along the scene's length.
    """
    velocities = (np.abs(inertia.tangents) @ np.abs(qd)).max(axis=1)
    return AHEAD * (velocities + np.sqrt(inertia.gaps.extent(inertia.q) * terms.max(initial=0.0)))


def slow_slips(inertia, qd, which, limits):
    """Of gaps with friction those that slip, by limits (count,), m/s, at most."""
    return [i for i in which if 0.0 < np.hypot(*inertia.slips(qd)[i]) <= limits[i]]


def _ways(inertia, grips):
    """Directions (2,) along the slips of the contacts that slide."""
    return {i: inertia.across(i, d) for i, d in grips.items() if d is not None}


def _loads(inertia, which, ways):
    """Loads (k, n) by unit reactions of the gaps `which`, with the friction of those that slide in directions (2,)."""
    loads = inertia.J[which].copy()
    for j, i in enumerate(which):
        if i in ways:
            loads[j] -= inertia.gaps.kinetic[i] * ways[i] @ inertia.tangents[i]
    return loads


def _held(inertia, closed, grips, b, small):
    """Reactions (3, k) of closed gaps where they and slips of those that stick have no accelerations; rounding (k,).

    And the accelerations (n,) of all coordinates by these; whether those that stick brace each other, see `share`.

    b: accelerations (3,) of gaps and slips where all are open, by gaps; small (count,): rounding of accelerations of
    gaps. Reactions may fall below zero by twice their rounding: by the error of reactions at an event. Largest
    reactions are those, or what one contact alone would carry of the terms: in free fall all reactions are rounding.
    """
    (A, a, response), k = _holding(inertia, closed, grips, b), len(closed)
    by = least_squares(A, np.eye(len(A)), RANK_TOL**2)
    p, by, found, braced = -by @ a, by[:k], np.zeros((k, 3)), False
    found[:, 0], sticks = p[:k], [i for i in closed if inertia.gaps.rough[i] and grips[i] is None]
    if sticks:
        at, slips = [closed.index(i) for i in sticks], p[k:].reshape(-1, 2)
        loads = inertia.free(rows_of(inertia, sticks).T).T * inertia.gaps.levers(inertia.q)
        found[at], braced = share(inertia.gaps.static[sticks], loads, np.column_stack([found[at, 0], slips]))
    pushes = found[:, 0]
    largest, carried = np.abs(pushes).max(initial=0.0), small[closed] / (LEVEL * inertia.G[closed, closed])
    most = PULLS * np.maximum(largest, carried)
    limits = np.clip(np.abs(by[:, :k]) @ small[closed], 0.5 * EVENT_ERROR * largest, most)
    return found.T, limits, response @ p, braced


def _spread(inertia, closed, idle, grips, b):
    """Reactions of closed and idle contacts from those of the rows of a phase, all within bounds; those of closed ones.

    The rows of a phase are independent: where contacts depend on each other, some carry nothing, and a few what all of
    them could. Here all carry. At first their reactions lie as deep in their cones as they can, see `deepest`; in the
    phase they change by the least share of their bounds. Friction of those that slide goes with their normal reactions.
    At the bound, to the error of events, friction still holds.

    Returns
    -------
    spread : dict
        Numbers (4 + 3 r,) of each: normal reaction, friction along both slips, and what its friction may exceed the
        bound by; then by how much these three grow with reactions of the rows (r,), those of closed gaps first, then of
        the slips of those that stick. Empty where no reactions are within their bounds.
    pushes : ndarray (k,)
    """
    (A, a, _), k, which, gaps = _holding(inertia, closed, grips, b), len(closed), [*closed, *idle], inertia.gaps
    sticks = np.array([gaps.rough[i] and grips[i] is None for i in which])
    p = -least_squares(A, a, RANK_TOL**2)
    loads = rows_of(inertia, which).reshape(len(which), 3, -1)
    loads[:, 0] = _loads(inertia, which, _ways(inertia, grips))
    loads[~sticks, 1:] = 0.0
    loads = inertia.free(loads.reshape(3 * len(which), -1).T).T * gaps.levers(inertia.q)
    own = np.zeros((len(which), 3), bool)
    own[:k, 0], own[:k, 1:] = True, sticks[:k, None]
    rows = np.flatnonzero(own)
    rows = np.concatenate([rows[rows % 3 == 0], rows[rows % 3 > 0]])
    x = np.zeros(own.size)
    x[rows] = p
    size = np.linalg.norm(loads, axis=1)
    some = size > RANK_TOL * size.max(initial=0.0)
    free = null_space(loads[some].T, RANK_TOL)
    if not free.size:
        return {}, p[:k]
    ways = np.zeros((x.size, free.shape[1]))
    ways[some] = free
    mu = np.where(sticks, gaps.static[which], 1.0)
    found = deepest(mu, x.reshape(-1, 3), ways)
    left, largest = mu * found[:, 0] - np.hypot(*found[:, 1:].T), np.abs(found).max()
    if (np.minimum(left, found[:, 0]) < -EVENT_ERROR * largest).any():
        return {}, p[:k]
    more = np.where(sticks & (left < EVENT_ERROR * largest), 4.0 * EVENT_ERROR * largest, 0.0)
    weight = np.maximum(found[:, :1], LEAST_WEIGHT * largest) * np.column_stack([np.ones(len(mu)), mu, mu])
    weight = np.where(some, weight.ravel(), 0.0)[:, None]
    by = weight * least_squares((weight * loads).T, loads[rows].T, RANK_TOL)
    start = found - (by @ p).reshape(-1, 3)
    numbers = np.column_stack([start, more, by.reshape(len(which), -1)])
    return dict(zip(which, map(tuple, numbers.tolist()), strict=True)), found[:k, 0]


def _holding(inertia, closed, grips, b):
    """Accelerations of closed gaps, then of slips of those that stick, by their reactions, and where all are open.

    And those of all coordinates by these reactions.
    """
    sticks = [i for i in closed if inertia.gaps.rough[i] and grips[i] is None]
    slips = inertia.tangents[sticks].reshape(-1, inertia.q.size)
    loads = np.concatenate([_loads(inertia, closed, _ways(inertia, grips)), slips])
    rows = np.concatenate([inertia.J[closed], slips])
    response, a = inertia.free(loads.T), [*(b[i][0] for i in closed), *(x for i in sticks for x in b[i][1:])]
    return product(rows, response), np.array(a), response


def share(static, loads, p):
    """The same reactions p (c, 3) of contacts that stick, shared among them: as deep in their cones as they can.

    loads (3 c, n): accelerations by unit reactions. Where slips depend on each other alone, friction is in proportion
    to its bounds. Where they depend on gaps, contacts brace each other, as those of a ball with floor and wall along
    the line through both points: see `deepest`. And whether they do.
    """
    sizes, free = np.linalg.norm(loads, axis=1), np.zeros((0, 0))
    some = sizes > RANK_TOL * sizes.max(initial=0.0)  # others are held
    if p.any():
        free = null_space(loads[some].T, RANK_TOL)
    if not free.size:
        return p, False
    ways = np.zeros((p.size, free.shape[1]))
    ways[some] = free
    if np.abs(ways[::3]).max() <= RANK_TOL:
        T = proportional(static * p[:, 0], loads.reshape(len(p), 3, -1)[:, 1:], p[:, 1:])
        return np.column_stack([p[:, 0], T]), False
    return deepest(static, p, ways), True
