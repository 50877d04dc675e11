"""Gaps of unilateral constraints, impacts, and which contacts stay closed: complementarity problems at one state.

    J, G = J M~ J^T     rows of the closed gaps, and their Schur complement, the bilateral rows B eliminated
    impact              gd+ = gd- + G p,   0 <= gd+ + e min(gd-, 0),  p >= 0, complementary (Newton's law)
    accelerations       gdd = c + G lam,   0 <= gdd,  lam >= 0, complementary;  c: gdd of open gaps

M~ = Z (Z^T M Z)^-1 Z^T with a basis Z of the motions that B leaves free. lam and p push: the opposite of multipliers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..configuration.tolerances import INITIAL_TOL
from ..elements.markers import POINT
from ..elements.unilateral import contacts_of
from ..errors import SingularConfiguration
from ..jit.kernels import twin
from ..maths.complementarity import lemke
from ..maths.tolerances import RANK_TOL
from ..model.handles import BodyMotion, counted, handles_of
from ..model.handles import angle as angle_of
from ..observables.evaluate import constraint_arrays, mass_matrix
from ..observables.generalised_forces import applied_loads, velocity_forces
from .tolerances import AT_REST, DEPENDENT, LEVEL


class Gap(NamedTuple):
    """One inequality of the scene."""

    contact: object
    side: object  # a `unilateral.Side`
    row: int  # of Phi


class Gaps:
    """The inequalities of a packed scene whose unilateral constraints are all among its rows.

    Attributes
    ----------
    packed : Packed
    list : list of Gap
        In the order of the rows; count is their number.
    names : list of str
        Of their constraints.
    restitution : ndarray (count,)
    """

    def __init__(self, packed):
        self.packed, self.list = packed, []
        first = {id(member.constraint): member.rows.start for member in packed.members}
        for contact in contacts_of(member.constraint for member in packed.members):
            self.list += [Gap(contact, side, first[id(contact)] + i) for i, side in enumerate(contact.sides)]
        self.count, self.names = len(self.list), [gap.contact.name for gap in self.list]
        self.rows = np.array([gap.row for gap in self.list], int)
        self.sign = np.array([gap.side.sign for gap in self.list])
        self.restitution = np.array([gap.contact.restitution for gap in self.list], float)
        self.bilateral = np.setdiff1d(np.arange(len(packed.system.segments)), self.rows)
        self.are_counted = any(gap.side.joint is not None for gap in self.list)
        handles, parts = handles_of(packed), {id(part): i for i, part in enumerate(packed.constraints)}
        self._values = [self._value_of(handles, parts[id(gap.side.row.parts[0])], gap.side) for gap in self.list]

    def _value_of(self, handles, part, side):
        """A function of q (..., n) and counted angles (..., angles) that returns a gap (...)."""
        if side.joint is not None:
            place = handles.row(side.joint, "angle")
            geometry, at = place.angles[side.which], place.first + side.which

            def value(q, angles):
                found = angle_of(geometry, *handles.motions(geometry, (q,)), 0)
                return side.sign * (counted(found, angles[..., at]) - side.bound)

            return value
        terms = [self._term(handles, i) for i in range(part, part + len(side.row.parts))]

        def value(q, angles):
            return side.sign * sum(term(q) for term in terms)

        return value

    def _term(self, handles, part):
        """A function of q (..., n) that returns Phi of a primitive (...), as it is where the row is open."""
        row, given, coordinates = (
            getattr(self.packed, name)[part] for name in ("constraints", "parameters", "coordinates")
        )
        phi, markers = twin(getattr(type(row), "gap", type(row).phi)), list(zip(row.markers, coordinates, strict=True))
        markers = [(m.code == POINT, handles.where(row.body_of(m)), tuple(s.tolist())) for m, s in markers]

        def term(q):
            x, out = [], [0.0]
            for is_point, place, s in markers:
                body = BodyMotion(*place, (q,))
                x += body.point(s, 0) if is_point else body.arm(s, 0)
            phi(x, given, 0.0, out)
            return out[0]

        return term

    def value(self, i, q, angles):
        """One gap (...) at q (..., n); angles (..., angles): counted ones of joints."""
        return self._values[i](q, angles)

    def at(self, q, angles):
        """Gaps (count,) at q (n,)."""
        return np.array([value(q, angles) for value in self._values], float)


def closed_gaps(gaps, q, angles, tol=INITIAL_TOL):
    """Gaps that are closed, or penetrate, at q, to the relative tolerance of starts."""
    values = gaps.at(q, angles)
    return np.flatnonzero(values <= tol * (1.0 + np.abs(q).max())).tolist()


class Inertia:
    """Rows, masses and motions that the bilateral rows leave free, at one state.

    Parameters
    ----------
    gaps : Gaps
    t : float, s
    q, qd : ndarray (n,)
    slots : ndarray
        What forces remember.
    """

    def __init__(self, gaps, t, q, qd, slots):
        from scipy.linalg import cho_factor, qr

        self.gaps, self.t, self.q, self.qd, self.slots = gaps, t, q, qd, slots
        system = gaps.packed.system
        with np.errstate(over="ignore", invalid="ignore"):
            _, Phi_q, self.Phi_t, self.gamma = constraint_arrays(system, q, qd, t)
        self.J, self.B = gaps.sign[:, None] * Phi_q[gaps.rows], Phi_q[gaps.bilateral]
        self.M = mass_matrix(system, q)
        # Z of the bilateral rows; Q1 R^T of their independent ones
        Q, R, order = qr(self.B.T, pivoting=True)
        size = np.abs(np.diag(R))
        rank = int((size > RANK_TOL * size.max(initial=0.0)).sum())
        self.own, self.R, self.order = Q[:, :rank], R[:rank, :rank], order[:rank]
        self.Z = Z = Q[:, rank:]
        try:
            self.factor = cho_factor(Z.T @ self.M @ Z) if Z.size else None
        except np.linalg.LinAlgError as error:
            raise SingularConfiguration("a direction that the constraints leave free carries no inertia.") from error
        self.G = self.J @ self.free(self.J.T)

    def free(self, load):
        """M~ load: the accelerations (n, ...) that a load makes where the bilateral rows hold."""
        from scipy.linalg import cho_solve

        return self.Z @ cho_solve(self.factor, self.Z.T @ load) if self.Z.size else np.zeros_like(load)

    def rates(self, qd, sizes=None):
        """Rates of the gaps (count,), zero where they are so to rounding of velocities of these `sizes` (n,)."""
        drift = self.gaps.sign * self.Phi_t[self.gaps.rows]
        rates, sizes = self.J @ qd + drift, np.abs(qd) if sizes is None else sizes
        return np.where(np.abs(rates) <= AT_REST * (np.abs(self.J) @ sizes + np.abs(drift)), 0.0, rates)

    def hold(self, which, rates):
        """The least change of velocities (n,), by kinetic energy, that takes these rates from these gaps."""
        own = np.linalg.lstsq(self.G[np.ix_(which, which)], rates, rcond=RANK_TOL**2)[0]
        return -self.free(self.J[which].T @ own)

    def accelerations(self, qd):
        """Accelerations of all gaps (count,) where all are open, at velocities qd (n,); and their terms (count,)."""
        from scipy.linalg import solve_triangular

        system, t, q = self.gaps.packed.system, np.array([self.t]), self.q[None]
        _, _, _, gamma = constraint_arrays(system, self.q, qd, self.t)
        loads = applied_loads(system, t, q, qd[None], self.slots[None])[0] + velocity_forces(system, q, qd[None])[0]
        qdd = np.zeros(qd.size)
        if self.order.size:
            qdd = self.own @ solve_triangular(self.R, -gamma[self.gaps.bilateral][self.order], trans="T")
        qdd = qdd + self.free(loads - self.M @ qdd)
        bias = self.gaps.sign * gamma[self.gaps.rows]
        return self.J @ qdd + bias, np.abs(self.J) @ np.abs(qdd) + np.abs(bias)


class NoSolution(Exception):
    """A complementarity problem without a solution."""


def impulses(inertia, which, rates, restitution, law="newton"):
    """Impulses p (k,) of the gaps `which` at an impact; raises `NoSolution`.

    rates (k,) before the impact, restitution (k,). Where Poisson's law would add energy, as it can with different
    coefficients, they are lowered together.
    """
    G = inertia.G[np.ix_(which, which)]
    if law == "newton":
        return _solved(G, rates + restitution * np.minimum(rates, 0.0))[0]
    compressed = _solved(G, rates)[0]
    share, released = 1.0, None
    while released is None or energy_gain(G, rates, released) > LEVEL * (np.abs(rates) @ np.abs(released)):
        given = (1.0 + share * restitution) * compressed
        released = given + _solved(G, rates + G @ given)[0]
        share = share / 2.0 if share > LEVEL else 0.0
    return released


def energy_gain(G, rates, p):
    """Kinetic energy gained by impulses p (k,) at these rates."""
    return p @ rates + 0.5 * p @ G @ p


def _solved(G, q):
    p, basic = lemke(G, q)
    if p is None:
        raise NoSolution
    return p, basic


class Settled(NamedTuple):
    """What becomes of the gaps that are closed, at rest and not."""

    closed: list  # of gaps: independent rows, with reactions
    idle: list  # those that stay closed by themselves, as a fourth leg does
    accelerations: np.ndarray  # (count,) of all gaps


def settle(inertia, resting, qd, fired=()):
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
    resting, fired = list(resting), [i for i in fired if i in resting]
    while True:
        lam, basic = _solved(inertia.G[np.ix_(resting, resting)], c[resting])
        gdd = c + inertia.G[:, resting] @ lam
        small = LEVEL * (terms + np.abs(inertia.G[:, resting]) @ lam)
        # A reaction that has just vanished doesn't come back by rounding
        gone = [i for i, x in zip(resting, lam, strict=True) if i in fired and x * inertia.G[i, i] <= small[i]]
        if not gone:
            break
        resting = [i for i in resting if i not in gone]
        fired = [i for i in fired if i not in gone]
    closed = [i for i, held in zip(resting, basic, strict=True) if held]
    idle = []
    for i in resting:
        if i in closed or gdd[i] > small[i]:
            continue
        if _depends(inertia, closed, i):
            idle.append(i)
        else:
            closed.append(i)
    return Settled(sorted(closed), idle, gdd)


def _depends(inertia, closed, i):
    """Whether the row of a gap depends on those of closed ones and on the bilateral rows."""
    rows = inertia.J @ inertia.Z
    own, others = rows[i], rows[closed]
    if not closed:
        return not np.linalg.norm(own) > DEPENDENT * np.linalg.norm(inertia.J[i])
    left = own - np.linalg.lstsq(others.T, own, rcond=None)[0] @ others
    return bool(np.linalg.norm(left) <= DEPENDENT * np.linalg.norm(own))
