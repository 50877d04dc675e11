"""Gaps of unilateral constraints, impacts, and which contacts stay closed: complementarity problems at one state.

    J, G = J M~ J^T     rows of the gaps, and their Schur complement, the bilateral rows eliminated
    impact              gd+ = gd- + G p,   0 <= gd+ + e min(gd-, 0),  p >= 0, complementary (Newton's law)
    accelerations       gdd = c + G lam,   0 <= gdd,  lam >= 0, complementary;  c: gdd of open gaps

M~ f are the accelerations that loads f make where the bilateral rows hold. lam and p push: the opposite of multipliers.
"""

from __future__ import annotations

import math
import threading
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ..configuration.tolerances import INITIAL_TOL
from ..elements.bodies import turning
from ..formulations.locked_orientations import still
from ..maths.complementarity import complement
from ..maths.dense_solve import least_squares, product
from ..maths.tolerances import NEGLIGIBLE, RANK_TOL
from ..model.handles import all_angles, counted, displacement, first_rows, handles_of, index_of
from ..model.handles import angle as angle_of
from ..model.packed import reach_of
from .contact_rows import ContactWorkspace, Stops
from .tolerances import LEVEL


class Gap(NamedTuple):
    """One inequality of the scene, as it was when it was packed."""

    contact: object
    side: object  # a `unilateral.Side`
    row: int  # of Phi
    parts: tuple  # of the contact


class Gaps:
    """The inequalities of a scene.

    Parameters
    ----------
    packed : Packed
        Of the scene, whose unilateral constraints are all among its rows.
    contacts, free : Packed
        Of its contacts' rows alone, the gaps first in their order, and other rows of contacts with friction; of the
        scene with all contacts open.
    gaps : list of Gap
        In the order of the rows.

    Attributes
    ----------
    packed : Packed
    list : list of Gap
        Count is their number.
    names : list of str
        Of their constraints.
    restitution, kinetic, static : ndarray (count,)
    rough : ndarray (count,), bool
        Whether there is friction.
    slots : ndarray (count,)
        Where the numbers of those with friction begin in what the run remembers.
    stops : Stops
        Those of angles of joints.
    slip_rows : ndarray (count, 2)
        Rows of Phi of the slips, where there is friction.
    following : dict
        Of ratchets, whose gap is always zero: their rate, a function of q and qd (..., n), by their numbers.
    """

    def __init__(self, packed, contacts, free, gaps):
        self.packed, self.list, self._own = packed, gaps, threading.local()
        self._made_of = packed, contacts, free, gaps
        self.count, self.names = len(gaps), handles_of(packed).names_of([gap.contact for gap in gaps])
        self.rows = np.array([gap.row for gap in gaps], int)
        self.sign = np.array([gap.side.sign for gap in self.list])
        coefficients = {id(law.contact): law.coefficients for law in packed.laws}
        self.restitution = np.array([coefficients[id(gap.contact)][0] for gap in gaps], float)
        grips = [gap.side.grip for gap in self.list]
        self.rough = np.array([grip is not None for grip in grips], bool)
        self.kinetic = np.array([grip.kinetic if grip else 0.0 for grip in grips], float)
        self.static = np.array([grip.static if grip else 0.0 for grip in grips], float)
        slots = {id(contact): slot for contact, slot in packed.contacts}
        self.slots = np.array([slots.get(id(gap.contact), 0) for gap in self.list], int)
        self.slip_rows = np.where(self.rough, self.rows, 0)[:, None] + [1, 2]
        own = {id(part): first for part, first in first_rows(contacts.constraints)}
        self._slips = np.zeros((self.count, 2), int)  # among the rows of `contacts`
        # Where the directions of slips are in their rows, at the point of one of the bodies; their sign there
        self._ways, self._ways_sign = np.zeros(self.count, int), np.ones(self.count)
        for i in np.flatnonzero(self.rough):
            self._slips[i], part = slip_rows(self.list[i], own), self.list[i].side.row
            body, self._ways_sign[i] = (part.a, 1.0) if part.a.dimension else (part.b, -1.0)
            self._ways[i] = packed.system.bodies[index_of(packed, body), 0]
        handles, bodies = handles_of(packed), packed.system.bodies
        self._places, self._reach = bodies[:, :1] + np.arange(3), reach_of(packed)
        self.following = {i: self._rate(handles, gap.side) for i, gap in enumerate(self.list) if gap.side.follows}
        stops = [(i, gap.side) for i, gap in enumerate(self.list) if gap.side.joint]
        self._stops, self._bounds = [i for i, _ in stops], np.array([side.bound for _, side in stops])
        self._counted = [handles.row(side.joint, "angle").first + side.which for _, side in stops]
        of_stops = np.array(self._stops, int), np.array(self._counted, int), np.array(self._bounds, float)
        self.stops = Stops(*of_stops, handles.joints.ravel(), handles.frames)
        self._angles = np.array([max(1.0, abs(gap.side.bound)) if gap.side.joint else 0.0 for gap in self.list])
        self._lengths = None, None  # a length, and `lengths` of it
        self.together = {}  # friction of contacts that share their loads, see grips.py

    def extent(self, q):
        """The scene's length at q (n,), m: of points and positions the one farthest off; where there is none, one."""
        length = max(self._reach, float(np.linalg.norm(q[self._places], axis=1).max(initial=0.0)))
        return length if length > NEGLIGIBLE * self.packed.size else self.packed.size

    def levers(self, q):
        """Lengths for units of coordinates (n,): one, and for Euler parameters the scene's length at q, m."""
        return np.where(turning(self.packed.system.bodies, q.size), self.extent(q), 1.0)

    def lengths(self, length):
        """What rounding of gaps is a part of (count,): the scene's length, m; of an angle one rad, or its bound.

        The same array for the same length.
        """
        known, lengths = self._lengths
        if length != known:
            lengths = np.where(self._angles > 0.0, self._angles, length)
            self._lengths = length, lengths
        return lengths

    def __reduce__(self):
        """Made again in another process: the memory of kernels belongs to this one."""
        return Gaps, self._made_of, {"together": self.together}

    def turns(self, body):
        """Whether a body may rotate, with all contacts open."""
        packed = self._made_of[2]
        locked = [packed.bodies[i] for i in still(packed).bodies]
        return body.dimension == 7 and not any(body is each for each in locked)

    @property
    def workspace(self):
        """The `ContactWorkspace` of this thread."""
        try:
            return self._own.workspace
        except AttributeError:
            self._own.workspace = ContactWorkspace(*self._made_of[1:3])
            return self._own.workspace

    def all_rows(self, which=slice(None)):
        """Rows of Phi of gaps and of their slips, by default of all."""
        return np.concatenate((self.rows[which], self.slip_rows[which][self.rough[which]].ravel()))

    @staticmethod
    def _rate(handles, side):
        """A function of q, qd (..., n) that returns the rate (...) of a joint, in the direction of its ratchet."""
        joint, kind, index = side.follows
        geometry = getattr(handles.row(joint, kind), f"{kind}s")[index]
        rate = angle_of if kind == "angle" else displacement
        return lambda q, qd: side.sign * rate(geometry, *handles.motions(geometry, (q, qd)), 1)

    def values(self, t, levels, counted):
        """Gaps (k, count) at times t (k,).

        levels (k, ...) begin with q (n,); counted is a function that returns the counted angles (k, angles) of joints.
        Of a joint's angle a gap is +- (angle - bound).
        """
        rows = levels.reshape(t.size, math.prod(levels.shape[1:]))
        found = np.ascontiguousarray(self.workspace.gaps(t, rows, self.sign)[:, : self.count])
        if self._stops:
            found[:, self._stops] = self.sign[self._stops] * (counted()[:, self._counted] - self._bounds)
        return found

    def of_contact(self, contact):
        """The numbers of the gaps of a constraint."""
        return [i for i, gap in enumerate(self.list) if gap.contact is contact]

    def slopes(self, t, q, which):
        """Rows (k, 2, n) of the slips of the gaps `which`, which have friction."""
        return self.workspace.rows(t, q, self._slips[which].ravel())[0].reshape(len(which), 2, -1)

    def rates(self, t, q, qd, which):
        """Rates (k, c) of the gaps `which` at times t (k,), with q and qd (k, n)."""
        found = np.empty((t.size, len(which)))
        for k in range(t.size):
            J, drift = self.workspace.rows(t[k], q[k], which)
            found[k] = J @ qd[k] + drift[which]
        return self.sign[which] * found

    def normals(self, t, q, which):
        """Rows (k, n) of the gaps `which`."""
        return self.sign[which, None] * self.workspace.rows(t, q, np.array(which))[0]

    def responses(self, t, q, memory, which):
        """Accelerations (k, 3, n) by unit reactions of these gaps, normal and along both slips, with all gaps open.

        Those without friction have no slips, and their reactions the unit of those with friction.
        """
        slopes = np.where(self.rough[which][:, None, None], self.slopes(t, q, which), 0.0)
        rows = np.concatenate([self.normals(t, q, which)[:, None], slopes], axis=1)
        return self.workspace.respond(t, q, memory, rows.reshape(3 * len(which), -1)).reshape(len(which), 3, -1)

    def biases(self, gamma):
        """Of the accelerations of slips (count, 2), from those of all rows; zero without friction."""
        return np.where(self.rough[:, None], gamma[self._slips], 0.0)

    def across(self, i, tangents, d):
        """Components (..., 2) of directions d (..., 3), ground frame, along slips of a gap; tangents (..., 2, n)."""
        return np.einsum("...ij,...j->...i", self._along(i, tangents), d)

    def along(self, i, tangents, d):
        """The direction (3,), ground frame, of components d (2,)."""
        return d @ self._along(i, tangents)

    def _along(self, i, tangents):
        """Directions (..., 2, 3) of the slips of a gap."""
        at = self._ways[i]
        return self._ways_sign[i] * tangents[..., at : at + 3]

    def slips(self, which):
        """Of the slips of gaps: their rows (k, 2), where directions along these are in them (k,), and their signs."""
        return self._slips[which], self._ways[which], self._ways_sign[which]

    def at(self, q, angles, t=0.0):
        """Gaps (count,) at one state; angles (angles,) near which those of joints are counted."""
        if self._stops:
            handles = handles_of(self.packed)
            return self.values(np.array([t]), q[None], lambda: counted(all_angles(handles, q), angles)[None])[0]
        return self.workspace.gaps(np.array([t]), q[None], self.sign)[0, : self.count]


def slip_rows(gap, first):
    """The rows (2,) of the slip of a contact with friction; first: the first row of each primitive, by its id."""
    return [first[id(part)] + i for part in gap.parts for i in range(part.all_rows)][1:3]


def closed_gaps(gaps, q, angles, tol=INITIAL_TOL):
    """Gaps that are closed, or penetrate, at q, to the relative tolerance of starts."""
    return np.flatnonzero(gaps.at(q, angles) <= tol * gaps.lengths(gaps.extent(q))).tolist()


class Inertia:
    """What pushes at gaps do where the bilateral rows hold, at one state.

    Parameters
    ----------
    gaps : Gaps
    t : float, s
    q : ndarray (n,)
    slots : ndarray
        What forces remember.
    which : list of int
        Gaps that are evaluated; values of others are zero.
    held : sequence of int
        Those that may be held closed, independent: a guess.
    loads : ndarray (n,), optional
        Beside those of the scene.
    broken : sequence of int
        Gaps whose slips have just begun, ended or turned.

    Attributes
    ----------
    J : ndarray (count, n)
    G : ndarray (count, count)
    tangents : ndarray (count, 2, n)
        Rows of the slips; zero without friction.
    """

    def __init__(self, gaps, t, q, slots, which, held=(), loads=None, broken=()):
        self.gaps, self.t, self.q, self.slots, self.which, self.held = gaps, t, q, slots, np.array(which, int), held
        self.broken = broken
        rows, drift = gaps.workspace.rows(t, q, self.which)
        self._rows, self._drift = gaps.sign[self.which, None] * rows, (gaps.sign * drift[: gaps.count])[self.which]
        self.J, self.response, self.G = (np.zeros((gaps.count, size)) for size in (q.size, q.size, gaps.count))
        response = gaps.workspace.respond(t, q, slots, self._rows)
        self.J[self.which], self.response[self.which] = self._rows, response  # M~ J^T, transposed
        self.G[self.which[:, None], self.which] = product(self._rows, response.T)
        self._sizes, self.tangents = np.abs(self._rows), np.zeros((gaps.count, 2, q.size))
        self._more = 0.0 if loads is None else self.free(loads)
        frictional = self.which[gaps.rough[self.which]]
        if frictional.size:
            self.tangents[frictional] = gaps.slopes(t, q, frictional)

    def among(self, which):
        """G of some gaps."""
        return self.G[which][:, which]

    def _of_all(self, values):
        out = np.zeros(self.gaps.count)
        out[self.which] = values
        return out

    def free(self, loads):
        """M~ loads: the accelerations (n, ...) that loads (n, ...) make where the bilateral rows hold."""
        rows = np.ascontiguousarray(loads.T).reshape(-1, loads.shape[0])
        return self.gaps.workspace.respond(self.t, self.q, self.slots, rows).T.reshape(loads.shape)

    def pushed(self, which, p):
        """The change of velocities (n,) by impulses p (k,) of the gaps `which`."""
        return p @ self.response[which]

    def sizes(self, x):
        """|J| |x| (count,): the sizes of terms."""
        return self._of_all(self._sizes @ np.abs(x))

    def rates(self, qd, sizes=None):
        """Rates of the gaps (count,), zero where they are so to rounding of velocities of these `sizes` (n,)."""
        rates, terms = self._rows @ qd + self._drift, self._sizes @ (np.abs(qd) if sizes is None else sizes)
        rates[np.abs(rates) <= NEGLIGIBLE * (terms + np.abs(self._drift))] = 0.0
        return self._of_all(rates)

    def hold(self, which, rates):
        """Impulses (k,) that take these rates from these gaps; negative ones pull."""
        return -least_squares(self.among(which), rates, RANK_TOL**2)

    def slips(self, qd):
        """Velocities (count, 2) of the slips, zero where they are rounding."""
        found, terms = self.tangents @ qd, np.abs(self.tangents) @ np.abs(qd)
        return np.where(np.abs(found) <= NEGLIGIBLE * terms, 0.0, found)

    def slip_accelerations(self, qd):
        """Accelerations (count, 2) of the slips where all gaps are open."""
        qdd, gamma = self._open(qd)
        return self.tangents @ qdd + self.gaps.biases(gamma)

    def biases(self, qd):
        """Accelerations (count, 3) of gaps and slips where the bodies have none."""
        _, gamma = self._open(qd)
        return np.column_stack([self.gaps.sign * gamma[: self.gaps.count], self.gaps.biases(gamma)])

    def motion(self, qd, push):
        """Accelerations (n,) of the bodies, by those that reactions cause, `push` (n,)."""
        return self._open(qd)[0] + push

    def _open(self, qd):
        """Accelerations (n,) where all gaps are open, and gamma of the rows of all contacts."""
        qdd, gamma = self.gaps.workspace.accelerations(self.t, self.q, qd)
        return qdd + self._more, gamma

    def normal(self, i):
        """The normal (3,) of a contact with friction, ground frame."""
        _, at, sign = self.gaps.slips([i])
        return sign * self.J[i, at[0] : at[0] + 3]

    def across(self, i, d):
        """Components (2,) of a direction d (3,), ground frame, along the slips of a gap."""
        return self.gaps.across(i, self.tangents[i], d)

    def along(self, i, d):
        """The direction (3,), ground frame, of components d (2,)."""
        return self.gaps.along(i, self.tangents[i], d)

    def accelerations(self, qd):
        """Accelerations of the gaps (count,) where all are open, at velocities qd (n,); and their terms (count,)."""
        qdd, gamma = self._open(qd)
        bias = (self.gaps.sign * gamma[: self.gaps.count])[self.which]
        return self._of_all(self._rows @ qdd + bias), self._of_all(self._sizes @ np.abs(qdd) + np.abs(bias))

    def carried(self):
        """Rounding (count,) of accelerations of the gaps, of weight that bilateral reactions carry."""
        return LEVEL * np.abs(self.J).sum(axis=1) * np.abs(self.gaps.packed.system.gravity).max()


class NoSolution(Exception):
    """A complementarity problem without a solution."""


def impulses(inertia, which, rates, restitution, law="newton"):
    """Impulses p (k,) of the gaps `which` at an impact; raises `NoSolution`.

    rates (k,) before the impact, restitution (k,). Where Poisson's law would add energy, as it can with different
    coefficients, they are lowered together.
    """
    if law == "newton":
        return _solved(inertia, which, rates + restitution * np.minimum(rates, 0.0))[0]
    G, compressed = inertia.among(which), _solved(inertia, which, rates)[0]
    share, released = 1.0, None
    while released is None or energy_gain(G, rates, released) > LEVEL * (np.abs(rates) @ np.abs(released)):
        given = (1.0 + share * restitution) * compressed
        released = given + _solved(inertia, which, rates + G @ given)[0]
        share = share / 2.0 if share > LEVEL else 0.0
    return released


def energy_gain(G, rates, p):
    """Kinetic energy gained by impulses p (k,) at these rates."""
    return p @ rates + 0.5 * p @ G @ p


def _solved(inertia, which, q):
    """Solution (k,) of the gaps `which`, and which of them are held; those held at last are a first guess."""
    p, held = complement(inertia.among(which), q, [k for k, i in enumerate(which) if i in inertia.held])
    if p is None:
        raise NoSolution
    inertia.held = {i for i, own in zip(which, held, strict=True) if own}
    return p, held


class ContactState(NamedTuple):
    """What becomes of the gaps that are closed, at rest and not."""

    closed: list  # of gaps: independent rows, with reactions
    idle: list  # those that stay closed by themselves, as a fourth leg does
    accelerations: np.ndarray  # (count,) of all gaps
    push: np.ndarray | float  # (n,) accelerations by reactions
    grips: dict = MappingProxyType({})  # of those with friction, see contact_friction.py
    rows: dict = MappingProxyType({})  # of closed ones that stick: which of the two rows of the slip are independent
    slack: dict = MappingProxyType({})  # of closed ones whose reactions are rounding: what these may fall below zero
    gains: dict = MappingProxyType({})  # of those that slide: accelerations (2,) of their slips, m/s^2
    begun: dict = MappingProxyType({})  # the size of these, of those that begin to slide, above rounding
    slow: np.ndarray | None = None  # (count,) slips, m/s, below which friction keeps a direction
    spread: dict = MappingProxyType({})  # of closed and idle ones, see contact_friction.py
    dependent: tuple = ()  # idle ones that carry, too, see shared_loads.py

    @property
    def held(self):
        """Closed and idle ones, a sorted list."""
        return sorted([*self.closed, *self.idle])


def solve_contacts(inertia, resting, qd, fired=()):
    """Which of the gaps that are closed and at rest stay so, by the complementarity problem of accelerations.

    Parameters
    ----------
    inertia : Inertia
    resting : list of int
        Gaps that are closed, with no rate.
    qd : ndarray (n,)
    fired : sequence of int
        Gaps whose reactions have just changed sign.

    Raises
    ------
    NoSolution
    """
    c, terms = inertia.accelerations(qd)
    if not resting:
        return ContactState([], [], c, 0.0)
    resting, fired, carried = list(resting), [i for i in fired if i in resting], inertia.carried()
    while True:
        lam, basic = _solved(inertia, resting, c[resting])
        gdd = c + inertia.G[:, resting] @ lam
        small = LEVEL * (terms + np.abs(inertia.G[:, resting]) @ lam)
        # A reaction that has just vanished doesn't come back by rounding
        least = small + carried
        gone = [i for i, x in zip(resting, lam, strict=True) if i in fired and x * inertia.G[i, i] <= least[i]]
        if not gone:
            break
        resting = [i for i in resting if i not in gone]
        fired = [i for i in fired if i not in gone]
    closed = [i for i, held in zip(resting, basic, strict=True) if held]
    idle = []
    for i in resting:
        if i in closed or gdd[i] > small[i]:
            continue
        if depends(inertia, closed, i):
            idle.append(i)
        else:
            closed.append(i)
    pushes = lam[basic] if len(closed) == basic.sum() else inertia.hold(closed, c[closed])
    push = inertia.pushed(resting, lam)
    return ContactState(sorted(closed), idle, gdd, push, slack=slack_of(inertia, closed, pushes, small))


def slack_of(inertia, closed, pushes, small):
    """The `slack` of closed gaps, from which on their reactions leave them.

    pushes (k,): reactions in the phase, in which closed gaps alone hold; small (count,): rounding of accelerations of
    the gaps. Reactions may begin below zero by what rounding allows: they leave when they have fallen from there, since
    no zero is found of what begins beyond it.
    """
    small, G, found = small + inertia.carried(), np.diag(inertia.G), zip(closed, pushes, strict=True)
    return {i: float(max(small[i] / G[i], -2.0 * p)) for i, p in found if p * G[i] <= small[i]}


def depends(inertia, closed, i, sticks=()):
    """Whether the row of a gap depends on those of closed ones, on slips of those that stick, and on bilateral rows."""
    own, alone, mobile = inertia.response[i], inertia.J[i], np.diag(inertia.G)
    if mobile[i] <= RANK_TOL**2 * mobile.max():  # bilateral rows hold it
        return True
    if not closed:
        return not inertia.G[i, i] > RANK_TOL**2 * (np.abs(alone) @ np.abs(own))
    rows, loads = inertia.J[closed], inertia.response[closed]
    if len(sticks):
        slips = inertia.tangents[sticks].reshape(2 * len(sticks), -1)
        rows, loads = np.concatenate([rows, slips]), np.concatenate([loads, inertia.free(slips.T).T])
    share = least_squares(product(rows, loads.T), rows @ own, RANK_TOL**2)
    lengths = inertia.gaps.levers(inertia.q)
    return bool(np.linalg.norm(lengths * (own - share @ loads)) <= RANK_TOL * np.linalg.norm(lengths * own))
