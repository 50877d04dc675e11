"""Constraint errors, energy and momentum of a trajectory, recomputed in NumPy from t, q, qd, qdd alone.

The solver's kernels are not used, but for rows that add inertia. Constraint errors come from each primitive's phi,
evaluated on second-order Taylor numbers of the marker coordinates, so neither its jacobian nor its gamma enters.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..elements.bodies import IDENTITY, rotation_matrix
from ..elements.markers import PARAMETERS, POINT, TURN, Point
from ..jit.kernels import twin
from ..maths.power_series import Jet
from ..model.equations import added_inertia
from ..model.handles import first_rows
from ..model.kinematics import angular_velocity
from ..motions.of_coordinates import CoordinateFunction
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from .generalised_forces import force_loads
from .reactions import particular

if TYPE_CHECKING:
    from ..hints import Floats

AT_ONCE = 1 << 16  # numbers in an array, at most: so many constraints or bodies are evaluated together


class ConstraintError(NamedTuple):
    """Maximum norms of the left-hand sides of Eqs. 1, 2 and 3 at every output, shapes (k,)."""

    position: Floats
    velocity: Floats
    acceleration: Floats


def constraint_rows(packed, t, q, qd, qdd, time_rate=1.0, memory=None):
    """Phi and its first two time derivatives along a trajectory of a packed scene: three arrays (k, m).

    With time_rate=0 the derivatives are those along (qd, qdd) at fixed time. memory (k, slots) is the memory of
    constraints.
    """
    levels = tuple(np.zeros((t.size, len(packed.system.segments))) for _ in range(3))
    for rows, part in _groups(packed, t, q, qd, qdd, time_rate, memory):
        for level, values in zip(levels, part, strict=True):
            np.add.at(level, (slice(None), rows), values)  # a row may be a sum
    return levels


def constraint_error(packed, t, q, qd, qdd, memory=None):
    """Maximum norms of `constraint_rows` over the rows."""
    if packed.system.sums.size:
        rows = constraint_rows(packed, t, q, qd, qdd, memory=memory)
        return ConstraintError(*(np.abs(level).max(axis=1, initial=0.0) for level in rows))
    worst = np.zeros((3, t.size))
    for _, part in _groups(packed, t, q, qd, qdd, 1.0, memory):
        for level, values in zip(worst, part, strict=True):
            np.maximum(level, np.abs(values).max(axis=1), out=level)
    return ConstraintError(*worst)


def _groups(packed, t, q, qd, qdd, time_rate, memory):
    """Yield rows of Phi (r,) and their three levels, (k, r) each: for constraints of one form at a time."""
    starts, groups = starts_of(packed), {}
    lists = first_rows(packed.constraints), packed.parameters, packed.coordinates, packed.slots
    for i, ((constraint, row), values, places, slot) in enumerate(zip(*lists, strict=True)):
        held = packed.derived.places.get(i)
        if held is not None:
            yield (
                np.arange(row, row + constraint.rows),
                _remembered_levels(constraint, starts, places, values, held, memory, t, q, qd, qdd, time_rate),
            )
            continue
        if slot >= 0:
            kept = range(slot, slot + constraint.memory)
            values = *values, *(np.zeros(t.size) if memory is None else memory[:, i] for i in kept)
        bodies = tuple(constraint.body_of(marker) for marker in constraint.markers)
        form = (
            type(constraint),
            *(body.dimension for body in bodies),
            *(isinstance(value, Motion) for value in values),
        )
        members = [starts.get(body, 0) for body in bodies], places, values, row
        groups.setdefault(form, (constraint, []))[1].append(members)
    most = max(AT_ONCE // max(t.size, 1), 1)
    for constraint, members in groups.values():
        for first in range(0, len(members), most):
            some = members[first : first + most]
            try:
                found = [_levels(constraint, some, t, q, qd, qdd, time_rate)]
            except (TypeError, ValueError):  # phi of a plug-in doesn't accept arrays of parameters
                found = (_levels(constraint, [one], t, q, qd, qdd, time_rate) for one in some)
            yield from found


def _levels(constraint, members, t, q, qd, qdd, time_rate):
    """Return the rows of all constraints of the form of this one, and their levels, instances along the last axis."""
    starts, places, values, rows = zip(*members, strict=True)
    places, starts = np.array(places), np.array(starts)
    x = []
    for j, marker in enumerate(constraint.markers):
        at, s = starts[:, j], places[:, j].T
        x += marker_jet(marker, constraint.body_of(marker).dimension, at, s, q, qd, qdd)
    par = [entry for given in zip(*values, strict=True) for entry in _parameter(given, t, time_rate)]
    kind = type(constraint)
    out, shape = [None] * kind.rows, (t.size, len(members))
    if kind.rows:
        twin(kind.phi)(x, par, Jet(t[:, None], time_rate), out)
    out = [Jet.of(row) for row in out]
    if constraint.rate_rows:
        out += _rates(kind, x, par, Jet(t[:, None], time_rate), time_rate)
    levels = [[np.broadcast_to(getattr(row, name), shape) for row in out] for name in ("x", "xd", "xdd")]
    places = np.concatenate([np.array(rows) + i for i in range(len(out))])
    return places, [np.concatenate(level, axis=1) for level in levels]


def _remembered_levels(constraint, starts, places, values, held, memory, *motion):  # as of `_levels`, and:
    """The levels (k, rows) of a constraint with numbers that a run remembers: held has (slot, place in its reals)."""
    t, q, qd, qdd, time_rate = motion
    reals = np.tile(np.concatenate((*places, values)), (t.size, 1))
    for slot, at in held:
        reals[:, at] = memory[:, slot]
    x, first = [], 3 * len(places)
    for j, marker in enumerate(constraint.markers):
        body, s = constraint.body_of(marker), reals[:, 3 * j : 3 * j + 3].T
        x += marker_jet(marker, body.dimension, starts.get(body, 0), s, q, qd, qdd)
    out = [None] * constraint.rows
    twin(type(constraint).phi)(x, list(reals[:, first:].T), Jet(t, time_rate), out)
    out = [Jet.of(row) for row in out]
    return [np.stack([np.broadcast_to(getattr(row, name), t.shape) for row in out], 1) for name in ("x", "xd", "xdd")]


def _rates(kind, x, par, t, time_rate):
    """The rows on velocities as derivatives of Jets that are zero: their rate, and its derivative."""
    along, fixed = ([None] * kind.rate_rows for _ in range(2))
    rate = twin(kind.rate)
    rate(x, [Jet(each.xd, each.xdd) for each in x], par, t, along)
    rate(x, [Jet(0.0) for _ in x], par, t, fixed)
    # A xd, and b where the time goes on
    both = [Jet.of(one) + (time_rate - 1.0) * Jet.of(b) for one, b in zip(along, fixed, strict=True)]
    return [Jet(0.0, row.x, row.xd) for row in both]


def _parameter(given, t, rate):
    """One parameter of some instances, (instances,) or one number for all, or Jets (k, instances) of Motions."""
    if isinstance(given[0], np.ndarray):  # memory of each
        return [np.transpose(given)]
    if isinstance(given[0], CoordinateFunction) and len(set(given)) > 1:
        raise TypeError("functions are evaluated one by one")
    if not isinstance(given[0], Motion):
        same = all(value == given[0] for value in given)
        return [given[0] if same else np.array(given)]
    f, fd, fdd = np.array([value.over(t) for value in given]).reshape(len(given), 3, t.size).transpose(1, 2, 0)
    return [Jet(f, rate * fd, rate * rate * fdd), Jet(fd, rate * fdd), Jet(fdd)]


def starts_of(packed):
    """Return the first coordinate of each body."""
    if packed.derived.coordinate_starts is None:
        packed.derived.coordinate_starts = dict(zip(packed.bodies, packed.system.bodies[:, 0].tolist(), strict=True))
    return packed.derived.coordinate_starts


def marker_jets(starts, constraint, coordinates, q, qd, qdd):
    """Yield the coordinates of each marker of a constraint or force as Jets over the outputs; starts of `starts_of`."""
    for marker, s in zip(constraint.markers, coordinates, strict=True):
        body = constraint.body_of(marker)
        yield marker_jet(marker, body.dimension, starts.get(body, 0), s, q, qd, qdd)


def marker_jet(marker, dimension, at, s, q, qd, qdd):
    """Coordinates of a marker on a body whose own begin at `at`; or of several, at and s[i] being arrays."""
    if marker.code == TURN:
        return [Jet(0.0)] * 3
    if marker.code == PARAMETERS and dimension != 7:
        return [Jet(value) for value in IDENTITY]
    if dimension == 0:
        return [Jet(value) for value in s]
    r = [Jet(q[:, at + i], qd[:, at + i], qdd[:, at + i]) for i in range(dimension)]
    if marker.code == PARAMETERS:
        return r[3:]
    x = _rotate(r[3:], s) if dimension == 7 else [Jet(0.0)] * 3
    return [a + b for a, b in zip(r[:3], x, strict=True)] if marker.code == POINT else x


def _rotate(p, s):
    """A(p) s, from the matrix written out."""
    e0, e1, e2, e3 = p
    rows = [
        [e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3, 2.0 * (e1 * e2 - e0 * e3), 2.0 * (e1 * e3 + e0 * e2)],
        [2.0 * (e1 * e2 + e0 * e3), e0 * e0 - e1 * e1 + e2 * e2 - e3 * e3, 2.0 * (e2 * e3 - e0 * e1)],
        [2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3],
    ]
    return [row[0] * s[0] + row[1] * s[1] + row[2] * s[2] for row in rows]


class Motions(NamedTuple):
    """Motion of bodies of one kind at every output."""

    mass: np.ndarray  # (b,)
    inertia: np.ndarray  # (b, 3, 3)
    r: np.ndarray  # (k, b, 3)
    rd: np.ndarray  # (k, b, 3)
    p: np.ndarray | None  # (k, b, 4)
    omega: np.ndarray | None  # (k, b, 3), body frame


def body_motions(system, q, qd):
    """Yield a `Motions` for the point masses, and one for the rigid bodies, in batches; masses are those of the run."""
    most = max(AT_ONCE // max(len(q), 1), 1)
    for length in (3, 7):
        bodies = np.flatnonzero(system.bodies[:, 1] == length)
        for first in range(0, bodies.size, most):
            some = bodies[first : first + most]
            at = system.bodies[some, 0][:, None]
            p = omega = None
            if length == 7:
                p, pd = (x[:, at + np.arange(3, 7)] for x in (q, qd))
                omega = angular_velocity(p, pd)
            r, rd = (x[:, at + np.arange(3)] for x in (q, qd))
            yield Motions(system.mass[some], system.inertia[some].reshape(-1, 3, 3), r, rd, p, omega)


def kinetic_energy(system, q, qd):
    """Kinetic energy (k,), J."""
    total = np.zeros(q.shape[0])
    for bodies in body_motions(system, q, qd):
        total += 0.5 * (bodies.rd**2).sum(axis=2) @ bodies.mass
        if bodies.omega is not None:
            total += 0.5 * np.einsum("kbi,bij,kbj->k", bodies.omega, bodies.inertia, bodies.omega)
    for columns, h, _ in added_inertia(system, q, qd):
        total += 0.5 * (h * qd[:, columns]).sum(axis=1) ** 2
    return total


def potential_energy(system, q):
    """Potential energy of gravity (k,), J, zero at the ground's origin."""
    return -(q[:, system.bodies[:, :1] + np.arange(3)] @ system.gravity) @ system.mass


def linear_momentum(system, q, qd):
    """Linear momentum (k, 3), kg m/s, ground frame."""
    return sum(np.einsum("b,kbi->ki", bodies.mass, bodies.rd) for bodies in body_motions(system, q, qd))


def angular_momentum(system, q, qd):
    """Angular momentum about the ground's origin (k, 3), kg m^2/s, ground frame."""
    total = np.zeros((q.shape[0], 3))
    for bodies in body_motions(system, q, qd):
        total += np.einsum("b,kbi->ki", bodies.mass, np.cross(bodies.r, bodies.rd))
        if bodies.omega is not None:
            own = np.einsum("bjl,kbl->kbj", bodies.inertia, bodies.omega)
            total += np.einsum("kbij,kbj->ki", rotation_matrix(bodies.p), own)
    return total


# Energy and power of forces along a trajectory, by their Python twins: potential, dissipation, applied power.
#
#     applied = f . xd + dU/dt + dissipation
#
# so that d(kinetic + potential)/dt = applied + driving power - dissipation. dU/dt follows from the potential by
# truncated Taylor arithmetic.


class ForcePowers(NamedTuple):
    """Sums over all forces, (k,) each."""

    potential: np.ndarray  # J
    dissipation: np.ndarray  # W
    applied: np.ndarray  # W


def force_powers(solution):
    """Potential energy, dissipation and applied power of all forces of a solution."""
    total = ForcePowers(*np.zeros((3, solution.t.size)))
    arrays = solution.t, solution.q, solution.qd, solution._memory
    for load in solution.packed.loads:
        for sum_, part in zip(total, load_powers(solution.packed, load, *arrays), strict=True):
            sum_ += part
    return total


def load_powers(packed, load, t, q, qd, memory):
    """Potential energy, dissipation and applied power of one force, over outputs (k,)."""
    kind = type(load.force)
    if hasattr(kind, "powers"):
        return kind.powers(*_lengths(packed, load.force.points, q, qd), load.parameters)
    par = [entry for value in load.parameters for entry in (value.over(t) if isinstance(value, Signal) else [value])]
    par += [memory[:, load.slot + i] for i in range(load.remembers)]
    if load.normal >= 0:
        par.append(memory[:, packed.system.memory.size + load.normal])
    x, xd = marker_states(packed, load, q, qd)
    with np.errstate(divide="ignore", invalid="ignore"):
        U = Jet.of(twin(kind.potential)(x, par, t)) if getattr(kind, "potential", None) else Jet(0.0)
        values = [jet.x for jet in x]
        lost = twin(kind.dissipation)(values, xd, par, t) if getattr(kind, "dissipation", None) else 0.0
        if kind.analytic:
            f = [0.0] * len(x)
            twin(kind.law)(values, xd, par, t, f)
            work = sum(a * b for a, b in zip(f, xd, strict=True))
        else:  # user functions don't accept arrays
            system = packed.system._replace(forces=load.alone)
            work = np.einsum("kn,kn->k", force_loads(system, t, q, qd, memory), qd)
    return U.x, lost, work + U.xd + lost


def _lengths(packed, points, q, qd):
    """Length (k,) between points of bodies, and its rate."""
    length, starts = Jet(np.zeros(len(q)), np.zeros(len(q))), starts_of(packed)
    still, point = np.zeros_like(qd), Point("a")
    places = [marker_jet(point, body.dimension, starts.get(body, 0), s, q, qd, still) for body, s in points]
    for one, other in pairwise(places):
        d = [b - a for a, b in zip(one, other, strict=True)]
        length = length + np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    return length.x, length.xd


def marker_states(packed, load, q, qd):
    """x as Jets and xd as arrays, over the outputs."""
    force, starts = load.force, starts_of(packed)
    x, xd = [], []
    jets = marker_jets(starts, force, load.coordinates, q, qd, np.zeros_like(qd))
    for marker, jet in zip(force.markers, jets, strict=True):
        body = force.body_of(marker)
        x += jet
        if marker.code == TURN and body.dimension == 7:
            at = starts[body]
            xd += _turning(q[:, at + 3 : at + 7], qd[:, at + 3 : at + 7])
        else:
            xd += [entry.xd for entry in jet]
    return x, xd


def _turning(p, pd):
    """Angular velocity 2 E(p) pd, ground frame, three arrays."""
    e, ed = p[:, 1:], pd[:, 1:]
    return list((2.0 * (p[:, :1] * ed - pd[:, :1] * e + np.cross(e, ed))).T)


def power_of(solution, item):
    """Power (k,) of a constraint, lam . Phi_t of its rows, or of a force: applied power less dissipation.

    item is a packed.Member or a packed.Load.
    """
    if not hasattr(item, "rows"):
        _, lost, applied = load_powers(solution.packed, item, solution.t, solution.q, solution.qd, solution._memory)
        return applied - lost + np.zeros(solution.t.size)
    return driving_power(solution, item.rows)


def driving_power(solution, rows=slice(None)):
    """Power (k,) of constraints that depend on time, lam . Phi_t; of some rows, a slice."""
    packed, t = solution.packed, solution.t
    if not solution.system.rheonomic[0]:
        return np.zeros(t.size)
    still = np.zeros_like(solution.q)
    Phi_t = constraint_rows(packed, t, solution.q, still, still)[1]
    return (particular(solution.multipliers) * Phi_t)[:, rows].sum(axis=1)
