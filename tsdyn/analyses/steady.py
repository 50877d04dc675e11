"""Steady motion: all bodies turn together, and each may spin about an axis of symmetry of its own."""

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np

from ..elements.bodies import Body, rotation_matrix
from ..errors import InvalidArgument, InvalidBody, TsdynError
from ..maths.tolerances import HALF_DIGITS, TYPED
from ..model.handles import handles_of
from ..observables.evaluate import mass_matrix_sparse
from ..observables.generalised_forces import velocity_forces
from ..validation import floats, vector3
from .coordinates import transform_e
from .nominal_motion import NominalMotion
from .reduction import inertia_derivatives
from .rest import Rest
from .tolerances import TURNS

# Steady motion: all bodies turn together at a constant rate, and each may spin about an axis of symmetry of its own.
#
#     rdd = Omega x rd,    omegad = Omega x omega,    omega - Omega along an axis of symmetry of J, or zero
#
# Omega is the smallest that satisfies this. The scene must look the same from the turning axes: the motion is continued
# rigidly by some radians, and the accelerations there must be those of here, turned. Coefficients of the linearised
# equations are then constant in axes that turn with Omega.


def steady_rate(motion):
    """Omega (3,), rad/s, ground frame, zero at rest; None where the motion is not steady."""
    size = motion.packed.size or 1.0
    speeds = np.concatenate((motion.translations(1).ravel() / size, motion.spins(1).ravel()))
    rate = np.abs(speeds).max(initial=0.0)
    limit = HALF_DIGITS * _largest_acceleration(motion, size, rate)
    gains = np.concatenate((motion.translations(2).ravel(), size * motion.spins(2).ravel()))
    if size * rate * rate <= limit:
        return np.zeros(3) if np.abs(gains).max(initial=0.0) <= limit else None
    for symmetric in (True, False):
        Omega = _rate(motion, symmetric, size, rate)
        if Omega is not None and is_invariant(motion, Omega, size, rate):
            return Omega
    return None


def _largest_acceleration(motion, size, rate):
    """The acceleration, m/s^2, that others are compared with."""
    gains = np.abs(motion.translations(2)).max(initial=0.0)
    return max(motion.acceleration_scale(size), size * rate * rate, gains)


def _rate(motion, symmetric, size, rate):
    """The smallest Omega of the three conditions, or None; without symmetric no body spins on its own."""
    rows, values = [], []
    for vectors, scale in ((motion.translations, size * rate), (motion.spins, rate)):
        rows.append(-_cross(vectors(1) / scale).reshape(-1, 3))
        values.append((vectors(2) / scale).ravel())
    A = rotation_matrix(motion.parameters(0))
    J = motion.system.inertia[motion.rigid].reshape(-1, 3, 3)
    for turned, inertia, omega in zip(A, J, motion.spins(1), strict=True):
        across = turned @ asymmetry(inertia) @ turned.T if symmetric else np.eye(3)
        rows.append(across)
        values.append(across @ omega)
    rows, values = np.concatenate(rows), np.concatenate(values)
    Omega = np.linalg.lstsq(rows, values, rcond=HALF_DIGITS)[0]
    return Omega if np.abs(rows @ Omega - values).max(initial=0.0) <= HALF_DIGITS * rate else None


def asymmetry(J):
    """Projection onto the axes about which a body can't spin unseen: none of a sphere, two of a solid of rotation."""
    values, axes = np.linalg.eigh(J)
    equal = np.diff(values) <= TYPED * values.sum()
    if equal.all():
        return np.zeros((3, 3))
    if not equal.any():
        return np.eye(3)
    axis = axes[:, 2 if equal[0] else 0]
    return np.eye(3) - np.outer(axis, axis)


def is_invariant(motion, Omega, size, rate):
    """Whether the motion continued rigidly is a motion of the scene."""
    limit = HALF_DIGITS * _largest_acceleration(motion, size, rate)
    for turn in TURNS:
        try:
            R, later = _continued(motion, Omega, turn / rate)
        except TsdynError:
            return False
        speeds = np.abs(later.Phi_q @ later.qd + later.Phi_t).max(initial=0.0)
        moved = np.abs(later.translations(2) - motion.translations(2) @ R.T).max(initial=0.0)
        turned = np.abs(later.spins(2) - motion.spins(2) @ R.T).max(initial=0.0)
        held = (
            np.abs(later.Phi).max(initial=0.0) <= HALF_DIGITS * max(size, 1.0)
            and speeds <= HALF_DIGITS * max(size, 1.0) * rate
        )
        if not (held and max(moved, size * turned) <= limit):  # NaN is no motion
            return False
    return True


def _continued(motion, Omega, tau):
    """The rotation (3, 3) after a time tau, and the `Motion` then."""
    from scipy.spatial.transform import Rotation

    whole = Rotation.from_rotvec(Omega * tau)
    R, speed = whole.as_matrix(), np.linalg.norm(Omega)
    way = tau * np.eye(3)  # integral of R
    if speed > 0.0:
        n = _cross(Omega[None] / speed)[0]
        angle = speed * tau
        way = way + (1.0 - np.cos(angle)) / speed * n + (tau - np.sin(angle) / speed) * n @ n
    q, qd = motion.q.copy(), motion.qd.copy()
    r = motion.system.bodies[:, :1] + np.arange(3)
    q[r], qd[r] = motion.q[r] + motion.qd[r] @ way.T, motion.qd[r] @ R.T
    p = motion.system.bodies[motion.rigid, :1] + np.arange(3, 7)
    if len(p):
        spins = motion.spins(1)
        turned = whole * Rotation.from_rotvec((spins - Omega) * tau) * Rotation.from_quat(np.roll(q[p], -1, axis=1))
        q[p] = np.roll(turned.as_quat(), 1, axis=1)
        omega = spins @ R.T  # pd = E^T omega / 2
        qd[p] = 0.5 * np.einsum("bij,bi->bj", transform_e(q[p]), omega)
    return R, NominalMotion(motion.packed, motion.memory, motion.t + tau, q, qd)


def _cross(v):
    """x~ of vectors (b, 3), (b, 3, 3)."""
    return np.cross(v[:, None, :], -np.eye(3))


# The velocities of a steady motion: all bodies turn together about an axis, rotors about their own axes besides.
#
#     rd = Omega x (r - c),    omega = Omega + A s        s: along an axis of symmetry of the body, body frame
#
# They are linear in the coordinates, qd = D (q - c) and qdd = D D (q - c), since pd = (Omega o p + p o s) / 2.


class SteadyField:
    """Velocities of a steady motion of a packed scene.

    Parameters
    ----------
    packed : Packed
    spin : ndarray (3,), rad/s, ground frame
    about : ndarray (3,), m
        A point of its axis.
    rotors : dict
        Angular velocities (3,) of bodies relative to the rest, body frame, rad/s.
    """

    def __init__(self, packed, spin, about, rotors):
        from scipy.sparse import csr_array

        bodies = packed.system.bodies
        self.spin, self.n = spin, int(bodies[:, 1].sum())
        self.centre = np.zeros(self.n)
        self.centre[bodies[:, :1] + np.arange(3)] = about
        blocks, rows = [], []
        for body, (at, dimension) in zip(packed.bodies, bodies.tolist(), strict=True):
            blocks.append(np.cross(np.eye(3), spin))
            rows.append(np.arange(at, at + 3))
            if dimension == 7:
                blocks.append(0.5 * (_left(spin) + _right(rotors.get(body, np.zeros(3)))))
                rows.append(np.arange(at + 3, at + 7))
        places = [np.repeat(each, each.size) for each in rows], [np.tile(each, each.size) for each in rows]
        i, j = (np.concatenate(each) for each in places)
        self.D = csr_array((np.concatenate([block.ravel() for block in blocks]), (i, j)), (self.n, self.n))

    def levels(self, q):
        """qd and qdd (n,) at q."""
        qd = self.D @ (q - self.centre)
        return qd, self.D @ qd


def rotors_of(packed, given):
    """Angular velocities (3,) of rotors, body frame, by body; a number is about the axis of symmetry."""
    found = {}
    if not (given is None or isinstance(given, Mapping)):
        raise InvalidArgument(
            f"rotors must be a dict of bodies and their rates, such as {{top: 150.0}}, got {given!r}."
        )
    for key, rate in (given or {}).items():
        body = handles_of(packed).body(key)
        if not isinstance(body, Body):
            raise InvalidBody(f"rotors: {key!r} is no rigid body of this scene.")
        i = next(i for i, one in enumerate(packed.bodies) if one is body)
        found[body] = _own_spin(body, packed.system.inertia[i].reshape(3, 3), rate)
    return found


def _own_spin(body, inertia, rate):
    across = asymmetry(inertia)
    values = floats(rate)
    if values.shape == ():
        axes = np.linalg.eigh(np.eye(3) - across)
        if not np.isclose(axes[0].sum(), 1.0):
            raise InvalidArgument(
                f"rotors: {body.name} has no axis of symmetry that a rate could be about: its principal moments are "
                f"{np.linalg.eigvalsh(inertia)}. Give the angular velocity (3,), body frame, of a sphere; any "
                "other body looks different while it spins."
            )
        axis = axes[1][:, -1]
        values = float(values) * axis * np.sign(axis[np.abs(axis).argmax()])
    if values.size not in (1, 3) or not np.isfinite(values).all():
        raise InvalidArgument(
            f"rotors: the rate of {body.name} must be a number in rad/s, or an angular velocity (3,), got {rate!r}."
        )
    spin = vector3(values, f"rotors: angular velocity of {body.name} (rad/s, body frame)", InvalidArgument)
    if np.linalg.norm(across @ spin) > TYPED * np.linalg.norm(spin):
        raise InvalidArgument(
            f"rotors: {body.name} spins about {spin}, which is no axis of symmetry of it, so the motion is not steady."
        )
    return spin


def _left(w):
    """The matrix of p -> (0, w) o p."""
    x, y, z = w
    return np.array([[0, -x, -y, -z], [x, 0, -z, y], [y, z, 0, -x], [z, -y, x, 0.0]])


def _right(w):
    """The matrix of p -> p o (0, w)."""
    x, y, z = w
    return np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0.0]])


# What acts on a configuration in steady motion, seen from the turning axes.
#
# The loads that reactions balance are Q_A + Q_v - M D D (q - c), with qd = D (q - c) and qdd = D D (q - c). Their
# stiffness is
#
#     M D D - C* D + K*        C* = (Q_A + Q_v)_qd,    K* = (M qdd - Q_A - Q_v)_q + (Phi_q^T lam)_q


class SteadyRest(Rest):
    """A `Rest` with the velocities of a `SteadyField`; the last argument."""

    def __init__(self, frame, memory, q, field):
        self.field, self.M = field, mass_matrix_sparse(frame.system, q)
        super().__init__(frame, memory, q)

    def _rates(self):
        return self.field.levels(self.q)

    def loads_at(self, q):
        """Q_A + Q_v - M qdd (n,) at other positions."""
        qd, qdd = self.field.levels(q)
        M = self.M if q is self.q else mass_matrix_sparse(self.frame.system, q)
        return self.applied(q, qd) + velocity_forces(self.system, q[None], qd[None])[0] - M @ qdd

    def force_slopes(self, Q_q, Q_qd):
        """The derivative of the forces along with their velocities."""
        frame = self.frame
        D = np.zeros((len(Q_q), 14, 14))
        by_forces, blocks = frame.by_parts[frame.constraints :], self._of_bodies(self.field.D)
        D[:, :7, :7], D[:, 7:, 7:] = blocks[by_forces[:, 0]], blocks[by_forces[:, 1]]
        return Q_q + Q_qd @ D

    def own_slopes(self):
        """The derivative of M qdd - Q_v along with the velocities."""
        levels, metric = (self.q, self.qd, self.qdd), self.frame.metric
        parameters = {"rigid": metric.rigid, "parameters": lambda level: levels[level][metric.p]}
        shim = SimpleNamespace(q=self.q, qd=self.qd, qdd=self.qdd, system=self.system, **parameters)
        K, C = inertia_derivatives(shim)
        D = self.field.D
        return self._of_bodies(self.M @ D @ D - C @ D + K)[:-1]

    def _of_bodies(self, matrix):
        """Blocks (b + 1, 7, 7) of a sparse (n, n); zero for the ground."""
        metric, found = self.frame.metric, np.zeros((len(self.frame.metric.at) + 1, 7, 7))
        body = np.zeros(metric.n, int)
        body[metric.r], body[metric.p] = np.arange(len(metric.at))[:, None], np.flatnonzero(metric.rigid)[:, None]
        matrix = matrix.tocoo()
        i, j = matrix.coords
        np.add.at(found, (body[i], i - metric.at[body[i]], j - metric.at[body[i]]), matrix.data)
        return found
