"""The velocities of a steady motion: all bodies turn together about an axis, rotors about their own axes besides.

    rd = Omega x (r - c),    omega = Omega + A s        s: along an axis of symmetry of the body, body frame

They are linear in the coordinates, qd = D (q - c) and qdd = D D (q - c), since pd = (Omega o p + p o s) / 2.
"""

from collections.abc import Mapping

import numpy as np

from ..elements.bodies import Body
from ..elements.names import named
from ..errors import InvalidArgument, InvalidBody
from ..validation import floats, vector3
from .steady import asymmetry
from .tolerances import ON_AXIS


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
        body = named(packed.bodies, key, "body", InvalidBody) if isinstance(key, str) else key
        if not any(body is one for one in packed.bodies) or not isinstance(body, Body):
            raise InvalidBody(f"rotors: {key!r} is no rigid body of this scene.")
        found[body] = _own_spin(body, rate)
    return found


def _own_spin(body, rate):
    across = asymmetry(body.inertia)
    values = floats(rate)
    if values.shape == ():
        axes = np.linalg.eigh(np.eye(3) - across)
        if not np.isclose(axes[0].sum(), 1.0):
            raise InvalidArgument(
                f"rotors: {body.name} has no axis of symmetry that a rate could be about: its principal moments are "
                f"{np.linalg.eigvalsh(body.inertia)}. Give the angular velocity (3,), body frame, of a sphere; any "
                "other body looks different while it spins."
            )
        axis = axes[1][:, -1]
        values = float(values) * axis * np.sign(axis[np.abs(axis).argmax()])
    if values.size not in (1, 3) or not np.isfinite(values).all():
        raise InvalidArgument(
            f"rotors: the rate of {body.name} must be a number in rad/s, or an angular velocity (3,), got {rate!r}."
        )
    spin = vector3(values, f"rotors: angular velocity of {body.name} (rad/s, body frame)", InvalidArgument)
    if np.linalg.norm(across @ spin) > ON_AXIS * np.linalg.norm(spin):
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
