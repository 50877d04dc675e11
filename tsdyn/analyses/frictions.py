"""The frictions of a scene that follow the exact law: what of each slides, and which rows hold it at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..elements.bodies import rotation_matrix
from ..elements.element import stop_waiting
from ..elements.friction import GUIDE, PIN, PLANE
from ..maths.tolerances import EPS, NEGLIGIBLE, RANK_TOL, TINY
from ..model.packed import reach_of
from .friction_units import ACROSS, ALONG, WHOLE, slip_velocities
from .tolerances import EVENT_ERROR, LEVEL, RESTS, USUAL

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

    def slopes(self, q, which):
        """Rows (k, 3, n) of the slip velocities or rates of units, ground frame, at q (n,)."""
        spans, found = self.packed.system.bodies, np.zeros((len(which), 3, q.size))
        for at, size in spans[sorted({*self.ends[which].ravel().tolist()} - {len(spans)})].tolist():
            v = self.motions(np.tile(q, (size, 1)), np.eye(size, q.size, at))[0]
            found[..., at : at + size] = v[:, which].transpose(1, 2, 0)
        return found

    def bases(self, q, which):
        """Orthonormal directions (k, 3, 3), ground frame, in which units may slide; zeros of those that are fewer."""
        axes, found = self.motions(q[None], np.zeros((1, q.size)))[2][0], np.zeros((len(which), 3, 3))
        for each, i in zip(found, which, strict=True):
            slide = self.units[i].slide
            own = axes[i][None] if slide in (PIN, GUIDE) else perpendiculars(axes[i]) if slide is PLANE else np.eye(3)
            each[: len(own)] = own
        return found

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
