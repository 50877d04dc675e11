"""Constraint errors, energy and momentum of a trajectory, recomputed in NumPy from nothing but t, q, qd, qdd.

Nothing here calls the solver's kernels. Constraint errors carry each marker's value, velocity and acceleration through
the primitive's phi as a truncated Taylor series, so neither its jacobian nor its gamma is used.
"""

from typing import NamedTuple

import numpy as np

from ._kernel import twin
from .bodies import IDENTITY, rotation_matrix, transform_g
from .jet import Jet
from .markers import PARAMETERS, POINT, TURN
from .motion import Motion


class ConstraintError(NamedTuple):
    """Maximum norms of the left-hand sides of Eqs. 1, 2 and 3 at every output, shapes (k,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def constraint_rows(packed, t, q, qd, qdd, time_rate=1.0):
    """Phi and its first two time derivatives along a trajectory of a packed scene: three arrays (k, m).

    With time_rate=0 time stands still: the derivatives are those along (qd, qdd) alone.
    """
    columns, starts = [], starts_of(packed.bodies)
    for constraint, values, places in zip(packed.constraints, packed.parameters, packed.coordinates, strict=True):
        x = [part for marker in marker_jets(starts, constraint, places, q, qd, qdd) for part in marker]
        par = [entry for value in values for entry in _parameter(value, t, time_rate)]
        out = [None] * constraint.rows
        twin(type(constraint).phi)(x, par, Jet(t, time_rate), out)
        columns += out
    if not columns:
        return (np.zeros((t.size, 0)),) * 3
    levels = ([getattr(Jet.of(row), name) for row in columns] for name in ("x", "xd", "xdd"))
    return tuple(np.stack([np.broadcast_to(row, t.shape) for row in level], axis=1) for level in levels)


def constraint_error(packed, t, q, qd, qdd):
    """Maximum norms of `constraint_rows` over the rows."""
    return ConstraintError(
        *(np.abs(level).max(axis=1, initial=0.0) for level in constraint_rows(packed, t, q, qd, qdd))
    )


def _parameter(value, t, rate):
    if not isinstance(value, Motion):
        return [value]
    f, fd, fdd = (np.array([function(time) for time in t], dtype=float) for function in value.functions)
    return [Jet(f, rate * fd, rate * rate * fdd), Jet(fd, rate * fdd), Jet(fdd)]


def starts_of(bodies):
    """Where the coordinates of each body begin."""
    return dict(zip(bodies, np.cumsum([0, *(b.dimension for b in bodies)]).tolist(), strict=False))


def marker_jets(starts, constraint, coordinates, q, qd, qdd):
    """Yield the coordinates of each marker of a constraint or force as Jets over the outputs; starts of `starts_of`."""
    for marker, s in zip(constraint.markers, coordinates, strict=True):
        body = constraint.body_of(marker)
        if marker.code == TURN:
            yield [Jet(0.0)] * 3
            continue
        if marker.code == PARAMETERS and body.dimension != 7:
            yield [Jet(value) for value in IDENTITY]
            continue
        if body.dimension == 0:
            yield [Jet(value) for value in s]
            continue
        at = starts[body]
        r = [Jet(q[:, at + i], qd[:, at + i], qdd[:, at + i]) for i in range(body.dimension)]
        if marker.code == PARAMETERS:
            yield r[3:]
            continue
        x = _rotate(r[3:], s) if body.dimension == 7 else [Jet(0.0)] * 3
        yield [a + b for a, b in zip(r[:3], x, strict=True)] if marker.code == POINT else x


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
    """The motion of one body at every output."""

    mass: float
    inertia: np.ndarray  # (3, 3)
    r: np.ndarray  # (k, 3)
    rd: np.ndarray  # (k, 3)
    p: np.ndarray | None  # (k, 4)
    omega: np.ndarray | None  # (k, 3), body frame


def body_motions(system, q, qd):
    """Yield a `Motions` for each body; masses are those of the run."""
    for (at, length), mass, J in zip(system.bodies, system.mass, system.inertia, strict=True):
        p = omega = None
        if length == 7:
            p = q[:, at + 3 : at + 7]
            omega = angular_velocity(p, qd[:, at + 3 : at + 7])
        yield Motions(mass, J.reshape(3, 3), q[:, at : at + 3], qd[:, at : at + 3], p, omega)


def angular_velocity(p, pd):
    """omega' = 2 G(p) pd, shapes (k, 4) -> (k, 3); of pdd it gives the angular acceleration, as 2 Gd pd = 0."""
    return 2.0 * np.einsum("kij,kj->ki", transform_g(p), pd)


def kinetic_energy(system, q, qd):
    """Kinetic energy (k,), J."""
    total = np.zeros(q.shape[0])
    for body in body_motions(system, q, qd):
        total += 0.5 * body.mass * (body.rd**2).sum(axis=1)
        if body.omega is not None:
            total += 0.5 * np.einsum("ki,ij,kj->k", body.omega, body.inertia, body.omega)
    return total


def potential_energy(system, q):
    """Potential energy of gravity (k,), J, zero at the ground's origin."""
    return -sum(
        mass * (q[:, at : at + 3] @ system.gravity) for (at, _), mass in zip(system.bodies, system.mass, strict=True)
    )


def linear_momentum(system, q, qd):
    """Linear momentum (k, 3), kg m/s, ground frame."""
    return sum(body.mass * body.rd for body in body_motions(system, q, qd))


def angular_momentum(system, q, qd):
    """Angular momentum about the ground's origin (k, 3), kg m^2/s, ground frame."""
    total = np.zeros((q.shape[0], 3))
    for body in body_motions(system, q, qd):
        total += body.mass * np.cross(body.r, body.rd)
        if body.omega is not None:
            total += np.einsum("kij,jl,kl->ki", rotation_matrix(body.p), body.inertia, body.omega)
    return total
