"""Exact friction at one state: where bodies stick, where they begin to slide, and which way.

    sticking    rows J of the slide hold, |lam| <= mu_s N      lam: their multipliers, force or torque
    sliding     force mu N against v, or, from rest, against the direction d of its acceleration, J qdd + gamma ~ d

The normal loads N follow from reactions and these from the friction (`observables.evaluate.balance`). Of those that are
at rest, which stick is found by pivoting: those beyond their bounds slide against what held them, those that would
slide backwards stick. Reactions of contacts at rest are found with each choice, as a problem with cones
(contact_friction.py); what contacts hold by themselves needs no friction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..elements.bodies import rotation_matrix
from ..elements.element import stop_waiting
from ..elements.friction import GUIDE, PIN, PLANE
from ..jit.kernels import twin
from ..maths.complementarity import OPEN, STICKS
from ..maths.dense_solve import least_squares, null_space, product
from ..maths.tolerances import EPS, HALF_DIGITS, NEGLIGIBLE, RANK_TOL, ROUNDING, TINY
from ..model.handles import first_rows
from ..model.packed import reach_of
from ..observables.evaluate import ITERATIONS, constraint_arrays
from ..observables.generalised_forces import applied_loads
from .contact_problem import NoSolution
from .friction_units import ACROSS, ALONG, WHOLE, normal_loads_of, slip_velocities, within
from .tolerances import BROKEN, EVENT_ERROR, LEVEL, PIVOTS, RESTS, USUAL

if TYPE_CHECKING:
    from ..elements.friction import Sliding


class FrictionUnit(NamedTuple):
    """One slide of a friction of a packed scene."""

    load: Any  # a packed.Load
    force: Any  # its force, with the bodies of the scene
    slide: Sliding
    slot: int  # of the memory of the run, where its numbers begin

    @property
    def way(self) -> slice:
        """Where the direction of sliding is in the memory of the run."""
        return slice(self.slot, self.slot + self.slide.directions)

    def held(self, i: int) -> range:
        """Where the numbers of row i are."""
        first = self.slot + self.slide.directions + i * self.slide.row_numbers
        return range(first, first + self.slide.row_numbers)

    @property
    def sliding(self) -> tuple[float, float]:
        """The multiplier with which it begins to slide: of a normal load of one, and by itself."""
        par = self.load.parameters
        if self.load.normal >= 0:
            return par[1 if par[2] else 0] * (par[5] if self.slide is PIN else 1.0), 0.0
        return 0.0, par[1] if self.slide.turns else par[0]

    @property
    def bound(self) -> tuple[float, float]:
        """The largest multiplier at rest: of a normal load of one, and by itself."""
        par = self.load.parameters
        if self.load.normal >= 0:
            return par[1] * (par[5] if self.slide is PIN else 1.0), 0.0
        return 0.0, par[5] if self.slide.turns else par[4]


class Hold(NamedTuple):
    """The rows that hold a unit, in the directions in which it may slide: of `phase_scenes.phase_of`."""

    unit: FrictionUnit
    rank: int
    numbers: Any  # (rank, row numbers), for the rows that are packed

    @property
    def key(self) -> tuple[int, int]:
        """The same for the same rows."""
        return self.unit.slot, self.rank

    def rows(self) -> list[Any]:
        """Primitives, one for each direction."""
        force, found = self.unit.force, []
        for one in self.numbers.tolist():
            if self.unit.slide.turns:
                row = Dot1(force.a, force.b, axis_a=one[:3], axis_b=one[3:6], value=one[6])
            else:
                ends = {"point_a": (0.0, 0.0, 0.0), "point_b": force.point_a}
                row = Dot2(force.b, force.a, axis_a=one[:3], value=one[3], **ends)
            stop_waiting(row)
            found.append(row)
        return found

    def places(self) -> list[list[tuple[int, int]]]:
        """Of each row the (slot, place among its reals) of all numbers; the markers' coordinates come first."""
        at = (0, 1, 2, 3, 4, 5, 6) if self.unit.slide.turns else (0, 1, 2, 9)
        return [list(zip(self.unit.held(i), at, strict=True)) for i in range(self.rank)]


def hold_of(unit):
    """All rows of a `FrictionUnit`, with numbers to be packed with."""
    numbers = np.ones((unit.slide.freedom, unit.slide.row_numbers))
    numbers[:, -1] = 0.0
    return Hold(unit, len(numbers), numbers)


class Frictions:
    """The frictions of a scene that follow the exact law.

    Parameters
    ----------
    scene : Scene
    acting : sequence of packed.Load, optional
        Of its phases, with numbers of normal loads; without those of inactive forces. By default those of the scene.

    Attributes
    ----------
    units : list of FrictionUnit
    names : list of str
    """

    def __init__(self, scene, acting=None):
        self.packed, self.units, self.reach = scene.packed, [], reach_of(scene.packed)
        known = {id(load.force): load for load in (self.packed.loads if acting is None else acting)}
        for force, load in zip(scene._forces, self.packed.loads, strict=True):
            load, slot = known.get(id(force), load._replace(normal=-1)), load.slot + force.memory
            for slide in getattr(force, "slides", ()):
                self.units.append(FrictionUnit(load, force, slide, slot))
                slot += slide.count
        self.count, self.names = len(self.units), [unit.force.name for unit in self.units]
        self.held = [np.array([unit.held(k) for k in range(unit.slide.freedom)], int) for unit in self.units]
        # Of each unit the bodies a and b, numbers of rows of System.bodies; the ground is behind them
        spans, slides = self.packed.system.bodies, [unit.slide for unit in self.units]
        ends = [(unit.force.a, unit.force.b) for unit in self.units]
        self.ends = np.array([[body.index if body.dimension else len(spans) for body in pair] for pair in ends], int)
        self.ends = self.ends.reshape(-1, 2)
        self.rigid = np.flatnonzero(spans[:, 1] == 7)
        self.turns = np.array([slide.turns for slide in slides], bool)
        self.signed = np.array([slide.directions == 1 for slide in slides], bool)
        part = [ALONG if slide in (PIN, GUIDE) else ACROSS if slide is PLANE else WHOLE for slide in slides]
        places = np.vstack([spans, (0, 0)])[self.ends].reshape(-1, 4)
        self.table = np.column_stack([places, self.turns, np.array(part, int)]).astype(np.int64).ravel()
        # The point of a; the axis of a, or the normal of b
        points = np.array([unit.load.coordinates[0] for unit in self.units], float).reshape(-1, 3)
        self.points, arms = points.ravel(), np.where(self.turns, np.linalg.norm(points, axis=1), 1.0)
        shares = np.array([max(unit.bound[0], unit.sliding[0]) for unit in self.units])
        # Loads over the forces on bodies
        self.unloaded = EVENT_ERROR * np.maximum(arms / np.maximum(shares, TINY), 1.0)
        axes = [unit.load.coordinates[4] if one else np.zeros(3) for unit, one in zip(self.units, part, strict=True)]
        self.axes = np.array(axes, float).ravel()
        self.ways = np.array([range(unit.slot, unit.slot + 3) for unit in self.units], int).reshape(-1, 3)
        self.ways = np.where(self.signed[:, None], self.ways[:, :1], self.ways)

    def frames(self, q):
        """Rotation matrices (k, bodies, 3, 3), that of the ground last, at q (k, n)."""
        spans = self.packed.system.bodies
        A = np.broadcast_to(np.eye(3), (len(q), len(spans) + 1, 3, 3)).copy()
        A[:, self.rigid] = rotation_matrix(q[:, spans[self.rigid, :1] + np.arange(3, 7)])
        return A

    def motions(self, q, qd):
        """Slip velocities or rates (k, units, 3), ground frame, sizes of their terms (k, units), axes; q, qd (k, n)."""
        v, axes = np.zeros((2, len(q), 3 * self.count))
        sizes = np.zeros((len(q), self.count))
        slip_velocities(q, qd, self.table, self.points, self.axes, v, sizes, axes)
        return v.reshape(-1, self.count, 3), sizes, axes.reshape(-1, self.count, 3)

    def sizes(self, q, qd, length):
        """What rounding of velocities at q, qd (n,) is a share of (units,): sizes of their terms.

        Joints couple rates of turning to the velocities of their bodies: these count, over the largest lever, or where
        there is none over the scene's length, m.
        """
        if not self.count:
            return np.zeros(0)
        sizes, r = self.motions(q[None], qd[None])[1][0], self.packed.system.bodies[:, :1] + np.arange(3)
        passing = np.append(np.linalg.norm(qd[r], axis=1), 0.0)[self.ends].sum(axis=1)
        return sizes + np.where(self.turns, passing, 0.0) / (self.reach or length or np.inf)

    def turn(self, t, levels, memory):
        """Write the directions of slip into memory (k, slots), zero where a slip rate is zero to rounding.

        levels (k, 3, n); rates that change within rounding of the time t (k,) are zero, too.
        """
        q, qd, qdd = levels.swapaxes(0, 1).copy()
        v, sizes, axes = self.motions(q, qd)
        speeds = np.linalg.norm(v, axis=2)
        gained = RESTS * EPS * np.abs(t)[:, None] * self.motions(q, qdd)[1]
        moves = speeds > np.maximum(NEGLIGIBLE * sizes, gained)
        ways = np.where(moves[..., None], v / np.where(moves, speeds, 1.0)[..., None], 0.0)
        for i, unit in enumerate(self.units):
            along = np.sign((ways[:, i] * axes[:, i]).sum(axis=1))[:, None]
            memory[:, unit.way] = along if self.signed[i] else ways[:, i]

    def paces(self, sizes, rates, gravity, length):
        """Velocities (units,) over USUAL: those of their terms, sizes (units,), and what accelerations make of them.

        These act along the scene's length, m, or one radian; rates (units,): their terms before, gravity: m/s^2. One
        where nothing is known, as where forces move bodies from rest.
        """
        gained = np.where(self.turns, rates + gravity / (length or np.inf), (rates + gravity) * length)
        found = (sizes + np.sqrt(gained)) / USUAL
        return np.where(found > 0.0, found, 1.0)

    def at(self, q, paces, length):
        """The `FrictionFrames` at q (n,); length: of the scene, m."""
        A, (_, _, axes) = self.frames(q[None])[0], self.motions(q[None], np.zeros((1, q.size)))
        still = LEVEL * (USUAL * paces) ** 2 / np.where(self.turns, 1.0, length or np.inf)
        return FrictionFrames(self, axes[0], A, paces, still)


class FrictionFrames:
    """The frictions of a scene in one configuration: axes (units, 3) and rotation matrices (bodies, 3, 3).

    paces (units,): the lengths of directions that are written, over which friction keeps them below SLIP. still
    (units,): accelerations of driven units that count as none.
    """

    def __init__(self, frictions, axes, A, paces, still):
        self.frictions, self.axes, self.A, self.paces, self.still = frictions, axes, A, paces, still

    def written(self, i, way):
        """The numbers of a direction (3,), ground frame: a sign where there is an axis."""
        return np.sign(way @ self.axes[i]) if self.frictions.signed[i] else self.paces[i] * way

    def read(self, i, memory):
        """The direction (3,), ground frame, of a unit that slides; zeros while it sticks."""
        numbers = memory[self.frictions.units[i].way]
        return numbers[0] * self.axes[i] if numbers.size == 1 else numbers / (np.linalg.norm(numbers) or 1.0)

    def basis(self, i, free, mobility):
        """Orthonormal directions (r, 3), ground frame, in which a unit may slide.

        free: function of a unit that returns its velocities (3, motions), of all motions that the rows leave free;
        mobility: of a unit and directions (r, 3), its accelerations (r, r) along these by unit forces.
        """
        slide = self.frictions.units[i].slide
        if slide in (PIN, GUIDE):
            return self.axes[i][None]
        if slide is PLANE:
            basis = np.array(perpendiculars(self.axes[i]))
            size, ways = np.linalg.eigh(mobility(i, basis))
            moves = size > NEGLIGIBLE * size.max()
            return basis if moves.all() else ways.T[moves] @ basis
        U, size, _ = np.linalg.svd(free(i))
        return U[:, : int((size > RANK_TOL * max(size.max(initial=0.0), 1.0)).sum())].T

    def numbers(self, i, basis):
        """Numbers (r, numbers) of rows that hold a unit as it is, but for their values, which are zero."""
        A, B = self.A[self.frictions.ends[i]]
        found = np.zeros((len(basis), self.frictions.units[i].slide.row_numbers))
        for row, t in zip(found, basis, strict=True):
            if self.frictions.turns[i]:
                s, h = perpendiculars(t)  # t = s x h
                row[:3], row[3:6] = s @ A, h @ B
            else:
                row[:3] = t @ B
        return found

    def directions(self, i, numbers):
        """Directions (r, 3), ground frame, of rows with these numbers (r, numbers)."""
        A, B = self.A[self.frictions.ends[i]]
        if self.frictions.turns[i]:
            return np.cross(numbers[:, :3] @ A.T, numbers[:, 3:6] @ B.T)
        return numbers[:, :3] @ B.T


def perpendiculars(t):
    """Unit vectors s, h with t = s x h, a unit vector (3,)."""
    e = np.eye(3)[np.argmin(np.abs(t))]
    s = np.cross(t, e)
    s /= np.linalg.norm(s)
    return s, np.cross(t, s)


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
    blocked: list  # of these, those that others hold
    loads: Any  # normal loads (frictions,)
    rates: dict  # what the event of each that slides begins with: its acceleration, zero within rounding
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
        # Three rows of each; -1 for one that a unit doesn't have
        u = np.concatenate([pushing, *(np.append(self.at[i], -np.ones(3 - len(self.at[i]), int)) for i in balls)])
        acts, count = u >= 0, len(pushing) // 3
        pushes = np.where(np.isin(u, pushing), 1.0, -1.0) * acts
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
                ways = {i: way for i, way in ways.items() if i not in self.light}
                continue
            known = tuple((i, *np.sign(np.round(d, 3))) for i, d in sorted(ways.items()))
            if known in seen and (guess := self._bounded(N)) and not guessed:
                ways, guessed = guess, True
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
        return FrictionAtRest(sticking, ways, blocked, N, rates, {i: limits[i] for i in sorted(known)})

    def _bounded(self, N):
        """Directions of those that slide, by the bounds of these normal loads; None where units have several rows.

        x minimises x.H x / 2 - c.x within |x| <= mu N, H = -G: where pivoting goes round, as along a chain.
        """
        from scipy.linalg import LinAlgError, cholesky, solve_triangular
        from scipy.optimize import lsq_linear

        units = [i for i in self.rows if i not in self.idle and i not in self.light]
        at = self._held(units)
        if len(at) > len(units) or self.cones is not None:
            return None
        try:
            R = cholesky(-self.G[np.ix_(at, at)])
        except LinAlgError:
            return None
        pairs = [self.units[i].bound for i in units]
        loads = [N[self.units[i].load.normal] if share else 0.0 for i, (share, _) in zip(units, pairs, strict=True)]
        bounds = np.maximum([share * load + own for load, (share, own) in zip(loads, pairs, strict=True)], TINY)
        c = solve_triangular(R, (self.c + self.D @ N)[at], trans="T")
        x = lsq_linear(R, c, (-bounds, bounds), method="bvls", tol=TINY).x
        slides = zip(units, x, np.abs(x) >= bounds * (1.0 - LEVEL), strict=True)
        return {i: np.sign(one) * self.bases[i][0] for i, one, beyond in slides if beyond}

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

    def _wrong(self, ways, x, N, a, small, fired):
        """Units that can't be as they are, with the way in which they slide instead; None if they stick."""
        found = {}
        for i, at in self.at.items():
            basis, size = self.bases[i], np.linalg.norm(a[at])
            if i in self.light:
                continue
            if i not in ways:
                (share, bound), force = self.units[i].bound, np.linalg.norm(x[at])
                bound += share * N[self.units[i].load.normal] if share else 0.0
                if force > bound * (BROKEN if i in fired else 1.0 + LEVEL):
                    found[i] = x[at] @ basis / force
                elif self.is_dead(i) and size > max(small[at].max(), self.place.still[i]):  # nothing holds it
                    found[i] = a[at] @ basis / size
                continue
            along = a[at] @ basis @ ways[i]
            if along < -small[at].max():
                found[i] = None
            elif len(at) > 1 and size > small[at].max() and along < size * (1.0 - NEGLIGIBLE):
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
        try:  # by the pivots: what is left of each row beside those before
            left = np.diag(np.linalg.cholesky(-self.G[np.ix_(own, own)])) ** 2
            if not self.pressed.size and (left > RANK_TOL * np.abs(np.diag(self.G)).max(initial=0.0)).all():
                return idle
        except np.linalg.LinAlgError:
            pass
        for i in free:
            pressed = self.pressed[:0] if i in self.engaged else self.pressed
            blocked = self.is_dead(i) or ((sticking or pressed.size) and self._is_blocked(i, sticking, pressed))
            (idle if blocked else sticking).append(i)
        return idle

    def _is_blocked(self, i, sticking, pressed):
        """Whether a unit can't move where others stick and contacts hold these rows, or at all."""
        own, left = self.G[self.at[i], self.at[i]], np.diag(self._left(i, np.append(self._held(sticking), pressed)))
        return bool(np.abs(left).max() <= RANK_TOL * np.abs(own).max())
