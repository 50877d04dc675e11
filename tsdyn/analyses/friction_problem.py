"""Exact friction at one state: where bodies stick, where they begin to slide, and which way.

    sticking    rows J of the slide hold, |lam| <= mu_s N      lam: their multipliers, force or torque
    sliding     force mu N against v, or, from rest, against the direction d of its acceleration, J qdd + gamma ~ d

The normal loads N follow from reactions and these from the friction (`observables.evaluate.balance`). Of those that are
at rest, which stick is found by pivoting: those beyond their bounds slide against what held them, those that would
slide backwards stick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..elements.bodies import rotation_matrix
from ..elements.element import stop_waiting
from ..elements.friction import GUIDE, PIN, PLANE, slip
from ..errors import SingularConfiguration
from ..jit.kernels import twin
from ..maths.tolerances import RANK_TOL
from ..model.packed import first_rows
from ..observables.diagnostics import marker_states
from ..observables.evaluate import balance, constraint_arrays, mass_matrix
from ..observables.generalised_forces import applied_loads, velocity_forces
from .tolerances import ASIDE, BROKEN, LEVEL, PIVOTS

if TYPE_CHECKING:
    from ..elements.friction import Slide


class Unit(NamedTuple):
    """One slide of a friction of a packed scene."""

    load: Any  # a packed.Load
    force: Any  # its force, with the bodies of the scene
    slide: Slide
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
    def bound(self) -> tuple[float, float]:
        """The largest multiplier at rest: of a normal load of one, and by itself."""
        par = self.load.parameters
        if self.load.normal >= 0:
            return par[1] * (par[5] if self.slide is PIN else 1.0), 0.0
        return 0.0, par[5] if self.slide.turns else par[4]


class Hold(NamedTuple):
    """The rows that hold a unit, in the directions in which it may slide: of `phase_scenes.phase_of`."""

    unit: Unit
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


class Frictions:
    """The frictions of a scene that follow the exact law.

    Attributes
    ----------
    units : list of Unit
    names : list of str
    """

    def __init__(self, scene):
        self.packed, self.units = scene.packed, []
        for force, load in zip(scene._forces, self.packed.loads, strict=True):
            slot = load.slot + force.memory
            for slide in getattr(force, "slides", ()):
                self.units.append(Unit(load, force, slide, slot))
                slot += slide.count
        self.count, self.names = len(self.units), [unit.force.name for unit in self.units]

    def velocity(self, i, q, qd):
        """Slip velocity (k, 3) or rate, ground frame, at q, qd (k, n); and the sizes of its terms (k,)."""
        load, slide = self.units[i].load, self.units[i].slide
        x, xd = marker_states(self.packed, load, q, qd)
        x = [np.broadcast_to(part.x, len(q)) for part in x]
        xd = [np.broadcast_to(part, len(q)) for part in xd]
        if slide.turns:
            v, parts = [xd[3 + c] - xd[9 + c] for c in range(3)], (xd[3:6], xd[9:12])
        else:
            v, parts = twin(slip)(x, xd), (xd[:3], xd[6:9])
        v, sizes = np.stack(v, axis=1), sum(np.abs(part).sum(axis=0) for part in parts)
        if slide in (PIN, GUIDE, PLANE):
            n = np.stack(x[12:15], axis=1)
            along = (v * n).sum(axis=1, keepdims=True) * n
            v = v - along if slide is PLANE else along
        return v, sizes

    def along(self, i, q, v):
        """Components (k,) of slip velocities v (k, 3) at q (k, n) along the axis of a joint."""
        x, _ = marker_states(self.packed, self.units[i].load, q, np.zeros_like(q))
        return sum(np.broadcast_to(part.x, len(q)) * v[:, c] for c, part in enumerate(x[12:15]))

    def speed(self, i, q, qd, memory):
        """Of one that slides, (k,): the velocity along its direction, in a plane less half of the speed."""
        v, _ = self.velocity(i, q, qd)
        unit = self.units[i]
        if unit.slide.directions == 1:
            return memory[unit.slot] * self.along(i, q, v)
        return v @ memory[unit.way] - 0.5 * np.linalg.norm(v, axis=1)

    def axis(self, i, q):
        """The axis or the normal (3,) of a joint at q (n,), ground frame."""
        x, _ = marker_states(self.packed, self.units[i].load, q[None], np.zeros((1, q.size)))
        return np.array([float(np.squeeze(part.x)) for part in x[12:15]])

    def written(self, i, q, way):
        """The numbers of a direction (3,), ground frame: a sign where there is an axis."""
        if self.units[i].slide.directions == 1:
            return np.sign(way @ self.axis(i, q))
        return way

    def read(self, i, q, memory):
        """The direction (3,), ground frame, of a unit that slides; zeros while it sticks."""
        numbers = memory[self.units[i].way]
        return numbers[0] * self.axis(i, q) if numbers.size == 1 else numbers

    def basis(self, i, q, free):
        """Orthonormal directions (r, 3), ground frame, in which a unit may slide.

        free: function of a unit that returns its velocities (3, motions) of all motions that the rows leave free.
        """
        slide = self.units[i].slide
        if slide in (PIN, GUIDE):
            return self.axis(i, q)[None]
        if slide is PLANE:
            return np.array(perpendiculars(self.axis(i, q)))
        U, size, _ = np.linalg.svd(free(i))
        return U[:, : int((size > RANK_TOL * max(size.max(initial=0.0), 1.0)).sum())].T

    def frames(self, i, q):
        """Rotation matrices (3, 3) of the bodies a and b."""
        return [self._rotation(body, q) for body in (self.units[i].force.a, self.units[i].force.b)]

    def _rotation(self, body, q):
        if body.dimension != 7:
            return np.eye(3)
        at = self.packed.system.bodies[body.index, 0]
        return rotation_matrix(q[at + 3 : at + 7])

    def numbers(self, i, q, basis):
        """Numbers (r, numbers) of rows that hold a unit as it is at q, but for their values, which are zero."""
        A, B = self.frames(i, q)
        found = np.zeros((len(basis), self.units[i].slide.row_numbers))
        for row, t in zip(found, basis, strict=True):
            if self.units[i].slide.turns:
                s, h = perpendiculars(t)  # t = s x h
                row[:3], row[3:6] = s @ A, h @ B
            else:
                row[:3] = t @ B
        return found

    def directions(self, i, q, numbers):
        """Directions (r, 3), ground frame, of rows with these numbers (r, numbers)."""
        A, B = self.frames(i, q)
        if self.units[i].slide.turns:
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


def free_motions(packed, t, q, memory, rows):
    """Velocities (rows, motions) of some rows of all motions that the others leave free."""
    _, Phi_q, _, _ = constraint_arrays(_remembering(packed.system, memory), q, np.zeros_like(q), t)
    return Phi_q[rows] @ _null_space(np.delete(Phi_q, rows, axis=0))


def _remembering(system, memory):
    system = system._replace(reals=system.reals.copy())
    system.reals[system.memory] = memory
    return system


def immobile(packed, t, q, memory):
    """Coordinates of the bodies that rows without time leave no motion, whatever others do."""
    _, Phi_q, _, _ = constraint_arrays(_remembering(packed.system, memory), q, np.zeros_like(q), t)
    steady, spans = [], packed.system.bodies.tolist()
    for part, row in first_rows(packed.constraints):
        steady += [] if part.rheonomic else range(row, row + part.rows)
    Phi_q, columns = Phi_q[steady], np.arange(q.size)
    while columns.size:
        mine = ~np.delete(Phi_q, columns, axis=1).any(axis=1)
        moved = _null_space(Phi_q[np.ix_(mine, columns)])
        moves = np.isin(np.arange(q.size), columns[np.abs(moved).max(axis=1, initial=0.0) > RANK_TOL])
        if not moves.any():
            break
        still = [np.arange(at, at + length) for at, length in spans if not moves[at : at + length].any()]
        columns = np.intersect1d(columns, np.concatenate([*still, np.zeros(0, int)]))
    return columns.astype(int)


def _null_space(rows):
    from scipy.linalg import null_space

    return null_space(rows, RANK_TOL) if len(rows) else np.eye(rows.shape[1])


class Rest(NamedTuple):
    """What becomes of the units that are at rest."""

    sticking: list  # units whose rows hold
    ways: dict  # direction (3,), ground frame, of each that slides
    blocked: list  # of these, those that others hold
    loads: Any  # normal loads (frictions,)
    rates: dict  # what the event of each that slides begins with: its acceleration, zero within rounding


class NoRest(Exception):
    """No way in which units at rest go on has been found; `units` are those that it is about."""

    def __init__(self, units):
        super().__init__()
        self.units = units


class RestProblem:
    """Rows, masses and loads at one state, with rows for all units that are at rest.

    Parameters
    ----------
    frictions : Frictions
    packed : Packed
        Of a phase with the rows of these units.
    rows : dict of int to ndarray
        Unit -> its rows of Phi.
    bases : dict of int to ndarray (r, 3)
        Unit -> the directions of its rows, ground frame.
    t, q, qd, memory
        The state; of the memory the directions of units that slide already are read.
    """

    def __init__(self, frictions, packed, rows, bases, t, q, qd, memory):
        self.frictions, self.packed, self.rows, self.bases = frictions, packed, rows, bases
        self.t, self.q, self.qd, self.memory = t, q, qd, memory.copy()
        self.system = _remembering(packed.system, memory)
        self.Phi, self.Phi_q, _, self.gamma = constraint_arrays(self.system, q, qd, t)
        self.M, self.S = mass_matrix(self.system, q), velocity_forces(self.system, q[None], qd[None])[0]
        mine = np.concatenate([*rows.values(), np.zeros(0, int)])
        self.others = np.setdiff1d(np.arange(len(self.Phi)), mine)

    def solve(self, sticking):
        """Accelerations (n,), multipliers (m,) and normal loads where these units stick; `memory` says the rest."""
        from scipy.linalg import cho_factor, cho_solve, qr, solve_triangular

        which = np.concatenate([self.others, *(self.rows[i] for i in sorted(sticking))]).astype(int)
        Q, R, order = qr(self.Phi_q[which].T, pivoting=True)
        size = np.abs(np.diag(R))
        rank = int((size > RANK_TOL * size.max(initial=0.0)).sum())
        Z, own, R, order = Q[:, rank:], Q[:, :rank], R[:rank, :rank], which[order[:rank]]
        try:
            factor = cho_factor(Z.T @ self.M @ Z) if Z.size else None
        except np.linalg.LinAlgError as error:
            raise SingularConfiguration("a direction that the constraints leave free carries no inertia.") from error
        fixed = own @ solve_triangular(R, -self.gamma[order], trans="T") if rank else np.zeros(self.q.size)
        memory = self.memory[None]
        known = applied_loads(self.system, np.array([self.t]), self.q[None], self.qd[None], memory)[0] + self.S

        def response(load):
            load = known + load - self.M @ fixed
            free = Z @ cho_solve(factor, Z.T @ load) if Z.size else np.zeros(self.q.size)
            lam = np.zeros(len(self.Phi))
            if rank:
                lam[order] = solve_triangular(R, own.T @ (load - self.M @ free))
            return np.concatenate((fixed + free, lam))

        loads = np.zeros(0)
        if self.packed.system.normals.size:
            _, found, loads = balance(self.packed, self.t, self.q, self.qd, self.Phi_q, response, self.memory)
        else:
            found = response(np.zeros(self.q.size))
        self.free = Z
        return found[: self.q.size], found[self.q.size :], loads

    def settle(self, sticking, ways, fired):
        """The `Rest` of the units, by pivoting from a guess: those that stick, directions of those that slide.

        fired: units whose reactions have just reached their bounds. Raises `NoRest`.
        """
        sticking, ways, fired, seen = set(sticking), dict(ways), set(fired), set()
        for count in range(PIVOTS * (1 + len(self.rows))):
            self._set(sticking, ways)
            qdd, lam, loads = self.solve(sticking)
            wrong = self._wrong(sticking, ways, qdd, lam, loads, fired)
            if not wrong:
                blocked = [i for i in self.rows if i in ways and self._is_blocked(i)]
                return Rest(sorted(sticking), ways, blocked, loads, self._rates(ways, qdd))
            known = frozenset(sticking), tuple((i, *np.sign(np.round(d, 3))) for i, d in sorted(ways.items()))
            one_by_one = known in seen or count >= PIVOTS
            seen.add(known)
            for i in sorted(wrong)[: 1 if one_by_one else None]:
                way = wrong[i]
                if way is None:
                    del ways[i]
                    sticking.add(i)
                    fired.discard(i)
                else:
                    sticking.discard(i)
                    ways[i] = way
        raise NoRest(sorted(wrong))

    def _set(self, sticking, ways):
        """Let the memory say which way units slide."""
        for i in self.rows:
            unit, way = self.frictions.units[i], ways.get(i)
            self.memory[unit.way] = 0.0 if way is None else self.frictions.written(i, self.q, way)

    def _wrong(self, sticking, ways, qdd, lam, loads, fired):
        """Units that can't be as they are, with the way in which they slide instead; None if they stick."""
        found, sizes = {}, np.abs(self.Phi_q) @ np.abs(qdd) + np.abs(self.gamma)
        for i, rows in self.rows.items():
            basis = self.bases[i]
            if i in sticking:
                share, force = self.frictions.units[i].bound, np.linalg.norm(lam[rows])
                bound = share[1] + (share[0] * loads[self.frictions.units[i].load.normal] if share[0] else 0.0)
                if force > bound * (BROKEN if i in fired else 1.0 + LEVEL):
                    found[i] = lam[rows] @ basis / force
                continue
            a, small = self.Phi_q[rows] @ qdd + self.gamma[rows], LEVEL * sizes[rows].max()
            along, size = a @ basis @ ways[i], np.linalg.norm(a)
            if along < -small:
                found[i] = None
            elif len(rows) > 1 and size > small and along < size * (1.0 - ASIDE):
                found[i] = a @ basis / size
        return found

    def _rates(self, ways, qdd):
        """Accelerations along the directions of sliding, in a plane less half of their size; zero within rounding."""
        found, sizes = {}, np.abs(self.Phi_q) @ np.abs(qdd) + np.abs(self.gamma)
        for i, way in ways.items():
            rows = self.rows[i]
            a, small = self.Phi_q[rows] @ qdd + self.gamma[rows], LEVEL * sizes[rows].max()
            part = 0.0 if self.frictions.units[i].slide.directions == 1 else 0.5
            rate = a @ self.bases[i] @ way - part * np.linalg.norm(a)
            found[i] = float(rate) if rate > small else 0.0
        return found

    def _is_blocked(self, i):
        """Whether a unit can't move where those that stick hold."""
        rows = self.Phi_q[self.rows[i]]
        return not np.abs(rows @ self.free).max(initial=0.0) > RANK_TOL * np.abs(rows).max()
