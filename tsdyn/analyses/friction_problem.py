"""Exact friction at one state: where bodies stick, where they begin to slide, and which way.

    sticking    rows J of the slide hold, |lam| <= mu_s N      lam: their multipliers, force or torque
    sliding     force mu N against v, or, from rest, against the direction d of its acceleration, J qdd + gamma ~ d

The normal loads N follow from reactions and these from the friction (`observables.evaluate.balance`). Of those that are
at rest, which stick is found by pivoting: those beyond their bounds slide against what held them, those that would
slide backwards stick. What several hold they share (friction_shares.py). Where directions turn, or pivoting goes round,
all are one problem with cones, for given normal loads. Reactions of contacts at rest are found with each choice, as a
problem with cones, too (contact_friction.py); what contacts hold by themselves needs no friction.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..jit.kernels import twin
from ..maths.complementarity import OPEN, SLIDES, STICKS, solve_cone
from ..maths.dense_solve import least_squares, null_space, product
from ..maths.tolerances import HALF_DIGITS, NEGLIGIBLE, RANK_TOL, ROUNDING
from ..model.handles import first_rows
from ..observables.evaluate import ITERATIONS, constraint_arrays
from ..observables.generalised_forces import applied_loads
from .contact_problem import NoSolution
from .friction_shares import FrictionShares
from .friction_units import normal_loads_of, within
from .tolerances import BROKEN, EVENT_ERROR, LEVEL, PIVOTS


def values_of(packed, t, q, memory):
    """Phi (m,) with what a run remembers, memory (slots,)."""
    return constraint_arrays(_remembering(packed.system, memory), q, np.zeros_like(q), t)[0]


def gradients(packed, t, q, memory):
    """Phi_q (m, n) with what a run remembers, memory (slots,)."""
    return constraint_arrays(_remembering(packed.system, memory), q, np.zeros_like(q), t)[1]


def free_motions(packed, t, q, memory, rows):
    """Velocities (rows, motions) of some rows of all motions that the others leave free."""
    Phi_q = gradients(packed, t, q, memory)
    return Phi_q[rows] @ null_space(np.delete(Phi_q, rows, axis=0), RANK_TOL)


def _remembering(system, memory):
    system = system._replace(reals=system.reals.copy())
    system.reals[system.memory] = memory
    return system


def immobile(packed, t, q, qd, memory):
    """Coordinates of the bodies that rows without time leave no motion, whatever others do."""
    spans = packed.system.bodies.tolist()
    slow = np.abs(qd) <= HALF_DIGITS * np.abs(qd).max() + ROUNDING
    columns = _columns([(at, length) for at, length in spans if slow[at : at + length].all()])
    if not columns.size:
        return columns
    _, Phi_q, _, _ = constraint_arrays(_remembering(packed.system, memory), q, np.zeros_like(q), t)
    steady = []
    for part, row in first_rows(packed.constraints):
        steady += [] if part.rheonomic else range(row, row + part.rows)
    Phi_q = Phi_q[steady]
    while columns.size:
        mine = ~np.delete(Phi_q, columns, axis=1).any(axis=1)
        moved = null_space(Phi_q[np.ix_(mine, columns)], RANK_TOL)
        moves = np.isin(np.arange(q.size), columns[np.abs(moved).max(axis=1, initial=0.0) > RANK_TOL])
        if not moves.any():
            break
        still = [(at, length) for at, length in spans if not moves[at : at + length].any()]
        columns = np.intersect1d(columns, _columns(still))
    return columns


def _columns(spans):
    return np.concatenate([np.zeros(0, int), *(np.arange(at, at + length) for at, length in spans)])


class FrictionAtRest(NamedTuple):
    """What becomes of the units that are at rest."""

    sticking: list  # units whose rows hold
    ways: dict  # direction (3,), ground frame, of each that slides
    turning: set  # of these, those whose direction turns with the slip as it begins
    blocked: list  # and those that others hold
    loads: Any  # normal loads (frictions,)
    rates: dict  # what the event of each that slides begins with: its acceleration, zero within rounding
    sharing: list  # units at rest that share a load
    partial: dict  # of those that stick some that others hold in some directions: `RestProblem._partial`
    limits: dict  # loads, N, up to which a unit has none: of those that stick, and of those that have none


class NoRest(Exception):
    """No way in which units at rest go on has been found; `units` are those that it is about."""

    def __init__(self, units):
        super().__init__()
        self.units = units


class RestProblem:
    """Rows, masses and loads at one state, with rows for all units that are at rest.

        x                  multipliers of these rows, then reactions of contacts; N: normal loads
        J qdd + gamma      c + G x + D N       D: of the frictions that slide already
        reactions          l + L x + K N       of the joints (frictions, 6), of which the normal loads follow

    Parameters
    ----------
    place : FrictionFrames
    gaps : contact_problem.Gaps
        Of the scene.
    packed : Packed
        Of a phase with the rows of these units; other units may have rows, which don't hold.
    rows : dict of int to ndarray
        Unit -> its rows of Phi.
    bases : dict of int to ndarray (r, 3)
        Unit -> the directions of its rows, ground frame.
    t, q, qd, memory
        The state; memory has the directions of the units that slide already.
    cones : contact_friction.Cones, optional
        Contacts that are closed and at rest, which the phase has no rows of.
    """

    def __init__(self, place, gaps, packed, rows, bases, t, q, qd, memory, cones=None):
        self.place, self.units, self.rows, self.bases = place, place.frictions.units, rows, bases
        self.gaps, self.state, self.shares = gaps, (t, q, qd, memory), {}  # of units at rest
        system = _remembering(packed.system, memory)
        _, Phi_q, _, gamma = constraint_arrays(system, q, qd, t)
        mine = np.concatenate([*rows.values(), np.zeros(0, int)])
        known = applied_loads(system, np.array([t]), q[None], qd[None], memory[None])[0]
        self.r, self.mass = system.bodies[:, :1] + np.arange(3), system.mass
        self.applied = np.linalg.norm(known[self.r], axis=1)
        self.normals = packed.system.normals.size
        self.coupled = normal_loads_of(packed, t, q, qd, memory, Phi_q) if self.normals else None
        sliding = self.coupled.units if self.normals else np.zeros((0, q.size))
        self.cones, self.J, self.gamma, own_loads = cones, Phi_q[mine], gamma[mine], -Phi_q[mine]
        if cones is not None:
            self.J, self.gamma = np.vstack([self.J, cones.rows]), np.append(self.gamma, cones.bias)
            own_loads = np.vstack([own_loads, cones.rows])
        self.pushing, self.normal_loads = np.arange(mine.size, len(self.J)), np.zeros(self.normals)
        self.pressed = self.pushing[:0]  # rows that contacts hold
        found, lam, left = gaps.workspace.solve(t, q, qd, memory, np.vstack([own_loads, sliding]))
        count, self.qdd = len(self.J), np.roll(found, 1, axis=0).T
        G = product(self.J, found.T)
        self.c, self.G, self.D = G[:, -1] + self.gamma, G[:, :count], G[:, count:-1]
        self.dead = dead = left[:count] <= RANK_TOL
        self.G[dead], self.G[:, dead], self.D[dead] = 0.0, 0.0, 0.0  # rates that no motion changes, as at a dead centre
        if self.normals:
            reactions = self.coupled.reactions(lam.T)
            self.l, self.L, self.K = reactions[..., -1], reactions[..., :count], reactions[..., count:-1]
        places = np.cumsum([0, *(len(each) for each in rows.values())])
        self.at = {i: np.arange(*places[k : k + 2]) for k, i in enumerate(rows)}

    def is_dead(self, i):
        """Whether no motion that the other rows leave moves a unit."""
        return bool(self.dead[self.at[i]].all())

    def solve(self, ways):
        """Multipliers x of the rows, and normal loads, where units slide in these directions and the others stick."""
        stick = self._held(i for i in self.rows if i not in (*ways, *self.idle, *self.light))
        if self.cones is not None:
            return self._with_contacts(ways, stick)
        x, P = self._sliding(ways)
        if stick.size:
            right = np.column_stack([self.c + self.G @ x, self.D + self.G @ P])[stick]
            held = -least_squares(self.G[np.ix_(stick, stick)], right, RANK_TOL**2)
            x[stick], P[stick] = held[:, 0], held[:, 1:]
        if not self.normals:
            return x, np.zeros(0)
        # N = N(l + L x + K N), by Newton's method
        first = self.l + self.L @ x
        slopes, N = self.L @ P + self.K, np.zeros(self.normals)
        for _ in range(ITERATIONS):
            values, changes = self.coupled.loads(first + slopes @ N)
            try:
                step = np.linalg.solve(np.eye(N.size) - (changes[:, None] @ slopes)[:, 0], values - N)
            except np.linalg.LinAlgError:
                raise NoRest(list(self.rows)) from None
            N = N + step
            if not np.abs(step).max() > ROUNDING * np.abs(N).max():
                break
        else:
            raise NoRest(list(self.rows))
        return x + P @ N, N

    def _sliding(self, ways):
        """Multipliers (rows,) of units that slide in these directions; by unit normal loads (rows, normals)."""
        x, P = np.zeros(len(self.c)), np.zeros((len(self.c), self.normals))
        for i, way in ways.items():
            share, force = self.units[i].sliding
            x[self.at[i]] = force * (self.bases[i] @ way)
            if share:
                P[self.at[i], self.units[i].load.normal] = share * (self.bases[i] @ way)
        return x, P

    def _with_contacts(self, ways, stick):
        """As `solve`, beside contacts; `ways` of units that may slide in several directions are written.

        Contacts and these units together are one problem with cones, for given N; N follows by iteration.
        """
        (x, P), pushing, N = self._sliding(ways), self.pushing, self.normal_loads
        balls = [i for i in ways if len(self.at[i]) > 1]
        u, pushes = self._padded(balls)
        acts, count = u >= 0, len(pushing) // 3
        G, across = self.G[np.ix_(u, u)] * acts[:, None] * pushes, self.G[np.ix_(u, stick)] * acts[:, None]
        by_u = least_squares(self.G[np.ix_(stick, stick)], self.G[np.ix_(stick, u)] * pushes, RANK_TOL**2)
        alone, G = np.diag(G), G - product(across, by_u)
        # Rows that the units at rest hold move by rounding, which is no compliance: reactions would be rounding over it
        dead = np.diag(G) <= RANK_TOL * alone
        G[dead], G[:, dead] = 0.0, 0.0
        for _ in range(ITERATIONS):
            y = x + P @ N
            bounds, y[self._held(balls)] = [np.linalg.norm(y[self.at[i]]) for i in balls], 0.0
            own = self.c + self.G @ y + self.D @ N
            held = least_squares(self.G[np.ix_(stick, stick)], own[stick], RANK_TOL**2)
            left, terms = own[u] * acts - across @ held, np.abs(own[u]) + np.abs(across) @ np.abs(held)
            left[dead & (np.abs(left) <= LEVEL * terms)] = 0.0
            p, mode, _ = self.cones.solve(G, left, bounds)
            y[u[acts]] = (pushes * p)[acts]
            y[stick] = -held - by_u @ p
            before = N
            if self.normals:
                N = self.coupled.loads(self.l + self.L @ y + self.K @ N)[0]
            if not (np.abs(N - before) > LEVEL * np.abs(N).max(initial=0.0)).any():
                break
        else:
            raise NoRest(list(self.rows))
        for i in balls:
            if y[self.at[i]].any():
                way = y[self.at[i]] @ self.bases[i]
                ways[i] = way / np.linalg.norm(way)
        closed = mode[:count] != OPEN
        rests = closed & (mode[:count] == STICKS) & self.cones.rough
        self.normal_loads, self.pressed = N, pushing[np.column_stack([closed, rests, rests]).ravel()]
        return y, N

    def pivot(self, ways, fired, turned):
        """The `FrictionAtRest` of the units, by pivoting from a guess: directions of those that slide.

        fired: units whose reactions have just reached their bounds; turned: directions of units along an axis that
        have just ended a slip, if they go on through. Raises `NoRest`.
        """
        fired, seen, judged, guessed = set(fired), set(), set(), False
        self.light, self.idle, self.engaged = set(self.rows), [], set()
        self.light &= self._unloaded(*self.solve({}))[0]  # without friction
        ways = {i: way for i, way in ways.items() if i not in self.light}
        for count in range(PIVOTS * (1 + len(self.rows))):
            self.idle = self._idle(ways)
            try:
                x, N = self.solve(ways)
            except (NoRest, NoSolution):  # a joint that a taut rope turns back at a dead centre can't stick
                if not turned:
                    raise
                ways, turned = {**ways, **{i: way for i, way in turned.items() if i not in self.light}}, {}
                continue
            a = self.c + self.G @ x + self.D @ N
            small = self._rounding(x, N)
            wrong = self._wrong(ways, x, N, a, small, fired)
            # Contacts don't hold what they were to hold alone
            moved = [i for i in self.idle if i not in self.engaged and (np.abs(a) > small)[self.at[i]].any()]
            if self.cones is not None and moved:
                self.engaged.update(moved)
                continue
            if not wrong:
                unloaded, limits = self._unloaded(x, N)
                others = (self.light ^ unloaded) & self.rows.keys() - judged
                if not others:
                    return self._found(ways, N, a, small, (unloaded, limits))
                self.light ^= others
                judged |= others
                guessed = False
                ways = {i: way for i, way in ways.items() if i not in self.light}
                continue
            known = tuple((i, *np.sign(np.round(d, 3))) for i, d in sorted(ways.items()))
            if not guessed and (known in seen or (count and any(len(self.at[i]) > 1 for i in wrong))):
                guessed = True
                if guess := self._bounded(N, fired):
                    ways = guess
                    continue
            one_by_one = known in seen or count >= PIVOTS
            seen.add(known)
            for i in sorted(wrong)[: 1 if one_by_one else None]:
                if wrong[i] is None:
                    del ways[i]
                    fired.discard(i)
                else:
                    ways[i] = wrong[i]
        raise NoRest(sorted(wrong))

    def _found(self, ways, N, a, small, unloaded):
        sticking = [i for i in self.rows if i not in (*ways, *self.idle, *self.light)]
        rates, (unloaded, limits) = self._rates(ways, a, small), unloaded
        # What a motor moves is not held, though nothing else moves it
        blocked = [i for i in ways if not rates[i] and self._is_blocked(i, sticking, self.pressed)] + self.idle
        for i in self.light:
            along = a[self.at[i]] if a[self.at[i]].any() else np.eye(len(self.at[i]))[0]
            along = along / np.abs(along).max()  # whose square may be zero
            ways[i] = along @ self.bases[i] / np.linalg.norm(along)
        known = {*sticking, *self.light, *(unloaded - self.rows.keys())}
        signed = self.place.frictions.signed
        turning = {i for i in ways if not (signed[i] or i in self.light or self.is_dead(i))}
        # In a plane a slip that begins without an acceleration has no rate: it may turn back at once
        rates = {i: rate for i, rate in rates.items() if rate or signed[i]}
        limits, partial = {i: limits[i] for i in sorted(known)}, self._partial(sticking) if self.sharing else {}
        return FrictionAtRest(sticking, ways, turning, blocked, N, rates, self.sharing, partial, limits)

    def _partial(self, sticking):
        """Of units that others hold in some directions: how many these leave, and directions, those first."""
        found, columns, eye = {}, np.zeros((len(self.c), 0)), np.eye(len(self.c))
        for i in sticking:
            own = eye[:, self.at[i]]
            across = columns.T @ self.G @ own
            left = across.T @ least_squares(columns.T @ self.G @ columns, across, RANK_TOL**2) - own.T @ self.G @ own
            size, ways = np.linalg.eigh(left)
            ways, rank = ways[:, ::-1], int((size > RANK_TOL * np.abs(np.diag(self.G)[self.at[i]]).max()).sum())
            columns = np.hstack([columns, own @ ways[:, :rank]])
            if rank < len(size):
                found[i] = rank, ways.T @ self.bases[i]
        return found

    def _bounded(self, N, fired):
        """Directions of the units that slide, by the bounds of normal loads, from N on: where pivoting goes round.

        For given bounds |x| <= b is a problem with cones, beside contacts or not; those that reach b slide by the
        kinetic coefficient. None where no solution was found.
        """
        which = [i for i in self.rows if i not in self.light and not self.is_dead(i)]
        units, first, (u, sign) = [self.units[i] for i in which], len(self.pushing) // 3, self._padded(which)
        acts, x, slid = sign != 0.0, np.zeros(len(self.c)), np.zeros(len(which), bool)
        G = self.G[np.ix_(u, u)] * np.outer(acts, sign)
        reached = np.where(np.isin(which, list(fired)), 1.0 - LEVEL, 1.0)  # so they slide, whatever rounding says
        normal = np.array([own.load.normal for own in units], int)
        static, kinetic = np.array([(own.bound, own.sliding) for own in units]).reshape(-1, 2, 2).T.swapaxes(0, 1)
        for _ in range(ITERATIONS):
            loads = np.append(N, 0.0)[normal]
            rest, slides = reached * (static[0] * loads + static[1]), kinetic[0] * loads + kinetic[1]
            bounds = np.where(slid & (slides < rest), slides, rest)
            left = (self.c + self.D @ N)[u] * acts
            if self.cones is not None:
                p, mode, _ = self.cones.solve(G, left, bounds)
            else:
                p, mode = solve_cone(G, left, np.zeros(0), bounds=bounds)
            if p is None:
                return None
            x[u[acts]], before, more = (sign * p)[acts], N, (mode[first:] == SLIDES) & ~slid
            if self.normals:
                N = self.coupled.loads(self.l + self.L @ x + self.K @ N)[0]
            if not (more.any() or (np.abs(N - before) > LEVEL * np.abs(N).max(initial=0.0)).any()):
                break
            slid |= more
        forces = {i: x[self.at[i]] @ self.bases[i] for i, slides in zip(which, slid, strict=True) if slides}
        return {i: force / np.linalg.norm(force) for i, force in forces.items() if force.any()}

    def _padded(self, units):
        """Three rows (3 k,) of each contact and each of some units, -1 for what one doesn't have; signs, or zero."""
        rows = [np.append(self.at[i], -np.ones(3 - len(self.at[i]), int)) for i in units]
        u = np.concatenate([self.pushing, *rows])
        return u, np.where(np.arange(u.size) < len(self.pushing), 1.0, -1.0) * (u >= 0)

    def _unloaded(self, x, N):
        """Units whose normal loads are small beside what acts on their bodies; up to which loads (units,)."""
        acting = self.applied + self.mass * np.linalg.norm((self.qdd @ np.concatenate(([1.0], x, N)))[self.r], axis=1)
        limits = self.place.frictions.unloaded * np.append(acting, 0.0)[self.place.frictions.ends].max(axis=1)
        loads = [unit.load.normal for unit in self.units]
        limits = np.where(np.array(loads) < 0, 0.0, limits).tolist()
        return {i for i, normal in enumerate(loads) if normal >= 0 and N[normal] < limits[i]}, limits

    def _rounding(self, x, N):
        """Accelerations of the rows that are zero to rounding."""
        qdd = self.qdd @ np.concatenate(([1.0], x, N))
        terms = np.abs(self.c) + np.abs(self.G) @ np.abs(x) + np.abs(self.D) @ N
        return LEVEL * (np.abs(self.J) @ np.abs(qdd) + np.abs(self.gamma) + terms)

    def _shared(self, ways, x, N):
        """Multipliers (3,) of units at rest, ground frame, and normal loads (frictions,), where units share a load."""
        forces = {i: x[at] @ self.bases[i] for i, at in self.at.items() if i not in ways and i not in self.light}
        rest, self.sharing = tuple(i for i in forces if not self.is_dead(i)), []
        if not self.depends or len(rest) < 2:
            return forces, N
        if rest not in self.shares:
            self.shares[rest] = FrictionShares(self.place.frictions, self.gaps, list(rest), *self.state)
        shares = self.shares[rest]
        self.sharing = shares.depending
        reactions = self.l + self.L @ x + self.K @ N if self.normals else None
        found, N, _ = shares.shared(np.array([forces[i] for i in rest]), N, self.coupled, reactions)
        return forces | dict(zip(rest, found, strict=True)), N

    def _wrong(self, ways, x, N, a, small, fired):
        """Units that can't be as they are, with the way in which they slide instead; None if they stick."""
        found, (forces, N) = {}, self._shared(ways, x, N)
        if fired.intersection(self.sharing):  # where one reaches its bound others do
            fired.update(self.sharing)
        for i, at in self.at.items():
            basis, size = self.bases[i], np.linalg.norm(a[at])
            if i in self.light:
                continue
            if i not in ways:
                (share, bound), force = self.units[i].bound, np.linalg.norm(forces[i])
                bound += share * N[self.units[i].load.normal] if share else 0.0
                if force > bound * (BROKEN if i in fired else 1.0 + LEVEL):
                    found[i] = forces[i] / force
                elif self.is_dead(i) and size > max(small[at].max(), self.place.still[i]):  # nothing holds it
                    found[i] = a[at] @ basis / size
                continue
            along, least = a[at] @ basis @ ways[i], small[at].max()
            across = np.linalg.norm(a[at] @ basis - along * ways[i])
            if along < -least * (EVENT_ERROR / LEVEL if i in fired else 1.0):  # reactions at an event have its error
                found[i] = None
            elif across > max(least, np.sqrt(2.0 * NEGLIGIBLE) * size):
                found[i] = a[at] @ basis / size
        return found

    def _left(self, i, rows):
        """Accelerations (r, r) of a unit by its own multipliers where rows (k,) hold."""
        rows, at = rows.astype(int), self.at[i]
        held = least_squares(self.G[np.ix_(rows, rows)], self.G[np.ix_(rows, at)], RANK_TOL**2)
        return self.G[np.ix_(at, at)] - self.G[np.ix_(at, rows)] @ held

    def _rates(self, ways, a, small):
        """Accelerations along the directions of sliding, in a plane as of `within`; zero within rounding."""
        found = {}
        for i, way in ways.items():
            at = self.at[i]
            rate = twin(within)(a[at] @ self.bases[i], way, self.place.frictions.signed[i])
            found[i] = float(rate) if rate > small[at].max() else 0.0
        return found

    def slip(self, units, qd):
        """The largest velocity or rate of some units."""
        return np.abs(self.J[self._held(units)] @ qd).max(initial=0.0)

    def stopping_time(self, units, qd):
        """Time, s, in which slips in a plane that are ended would end by themselves.

        Friction f against v, and g from all else: d(f |v| + g.v)/dt = |g|^2 - f^2, however v turns.
        """
        slips = {i: self.J[self.at[i]] @ qd for i in units if not self.place.frictions.signed[i]}
        slips = {i: (v, v / np.linalg.norm(v)) for i, v in slips.items() if v.any()}
        if not slips or self.cones is not None:
            return 0.0
        try:
            x, N = self.solve({i: e @ self.bases[i] for i, (_, e) in slips.items()})
        except NoRest:
            return 0.0
        a, left, falls = self.c + self.G @ x + self.D @ N, 0.0, 0.0
        for i, (v, e) in slips.items():  # of slips that end together: the sums
            at = self.at[i]
            f = -e @ self.G[np.ix_(at, at)] @ x[at]
            g = a[at] + f * e
            left, falls = left + f * (v @ e) + g @ v, falls + f * f - g @ g
        return float(left / falls) if falls > 0.0 else 0.0

    def stopped(self, units, qd):
        """Velocities (n,) with the slips ended of units that stick, by the least change of kinetic energy."""
        rows = self._held(units)
        left = self.J[rows] @ qd
        if not left.any():
            return qd
        rows, left = np.append(rows, self.pressed), np.append(left, np.zeros(len(self.pressed)))
        return qd - self.qdd[:, 1 + rows] @ least_squares(self.G[np.ix_(rows, rows)], left, RANK_TOL**2)

    def _held(self, units):
        """The rows of some units."""
        return np.concatenate([*(self.at[i] for i in units), np.zeros(0, int)]).astype(int)

    def _idle(self, ways):
        """Units that stick by what others hold, or a motor: with rows of their own the reactions wouldn't be unique."""
        free = [i for i in self.rows if i not in ways and i not in self.light]
        own, sticking, idle = self._held(free), [], []
        self.depends = True  # whether the rows of some may depend on others
        try:  # by the pivots: what is left of each row beside those before
            left = np.diag(np.linalg.cholesky(-self.G[np.ix_(own, own)])) ** 2
            self.depends = bool((left <= RANK_TOL * np.abs(np.diag(self.G)).max(initial=0.0)).any())
        except np.linalg.LinAlgError:
            pass
        if not (self.depends or self.pressed.size):
            return idle
        for i in free:
            pressed = self.pressed[:0] if i in self.engaged else self.pressed
            blocked = self.is_dead(i) or ((sticking or pressed.size) and self._is_blocked(i, sticking, pressed))
            (idle if blocked else sticking).append(i)
        return idle

    def _is_blocked(self, i, sticking, pressed):
        """Whether a unit can't move where others stick and contacts hold these rows, or at all."""
        own, left = self.G[self.at[i], self.at[i]], np.diag(self._left(i, np.append(self._held(sticking), pressed)))
        return bool(np.abs(left).max() <= RANK_TOL * np.abs(own).max())
