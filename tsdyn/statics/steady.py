"""Steady motion: all bodies turn together at a constant rate, and each may spin about an axis of symmetry of its own.

    rdd = Omega x rd,    omegad = Omega x omega,    omega - Omega along an axis of symmetry of J, or zero

Omega is the smallest that satisfies this. The scene must look the same from the turning axes: the motion is continued
rigidly by some radians, and the accelerations there must be those of here, turned. Coefficients of the linearised
equations are then constant in axes that turn with Omega.
"""

import numpy as np

from ..elements.bodies import rotation_matrix
from ..errors import TsdynError
from .motion import Motion
from .tolerances import EQUAL_INERTIA, STEADY, TURNS
from .variations import transform_e


def steady_rate(motion):
    """Omega (3,), rad/s, ground frame, zero at rest; None where the motion is not steady."""
    size = motion.packed.size or 1.0
    speeds = np.concatenate((motion.translations(1).ravel() / size, motion.spins(1).ravel()))
    rate = np.abs(speeds).max(initial=0.0)
    limit = STEADY * _largest_acceleration(motion, size, rate)
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
    Omega = np.linalg.lstsq(rows, values, rcond=STEADY)[0]
    return Omega if np.abs(rows @ Omega - values).max(initial=0.0) <= STEADY * rate else None


def asymmetry(J):
    """Projection onto the axes about which a body can't spin unseen: none of a sphere, two of a solid of rotation."""
    values, axes = np.linalg.eigh(J)
    equal = np.diff(values) <= EQUAL_INERTIA * values.sum()
    if equal.all():
        return np.zeros((3, 3))
    if not equal.any():
        return np.eye(3)
    axis = axes[:, 2 if equal[0] else 0]
    return np.eye(3) - np.outer(axis, axis)


def is_invariant(motion, Omega, size, rate):
    """Whether the motion continued rigidly is a motion of the scene."""
    limit = STEADY * _largest_acceleration(motion, size, rate)
    for turn in TURNS:
        try:
            R, later = _continued(motion, Omega, turn / rate)
        except TsdynError:
            return False
        speeds = np.abs(later.Phi_q @ later.qd + later.Phi_t).max(initial=0.0)
        moved = np.abs(later.translations(2) - motion.translations(2) @ R.T).max(initial=0.0)
        turned = np.abs(later.spins(2) - motion.spins(2) @ R.T).max(initial=0.0)
        held = (
            np.abs(later.Phi).max(initial=0.0) <= STEADY * max(size, 1.0) and speeds <= STEADY * max(size, 1.0) * rate
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
    return R, Motion(motion.packed, motion.memory, motion.t + tau, q, qd)


def _cross(v):
    """x~ of vectors (b, 3), (b, 3, 3)."""
    return np.cross(v[:, None, :], -np.eye(3))
