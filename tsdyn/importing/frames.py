"""Frames: a place and a rotation, in the ground frame or in that of another frame."""

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation


class Frame(NamedTuple):
    """A frame in another one."""

    p: Any  # (3,), m
    R: Any  # (3, 3), from this frame to the other

    def __matmul__(self, inner):
        """The frame `inner`, which is given in this one, in the other."""
        return Frame(self.point(inner.p), self.R @ inner.R)

    def point(self, x):
        """A point of this frame in the other."""
        return self.p + self.R @ x

    def seen(self, x):
        """A point of the other frame in this one."""
        return self.R.T @ (x - self.p)

    @property
    def inverse(self):
        """The other frame in this one."""
        return Frame(-self.R.T @ self.p, self.R.T)


HERE = Frame(np.zeros(3), np.eye(3))


def posed(p, wxyz):
    """A frame of a place and a quaternion, scalar first."""
    return Frame(np.array(p), of_quaternion(wxyz))


def of_body(data, i):
    """The frame of a body of MuJoCo's, in the ground frame."""
    return Frame(data.xpos[i].copy(), data.xmat[i].reshape(3, 3).copy())


def turned(rotation_vector):
    """A rotation about the origin."""
    return Frame(np.zeros(3), Rotation.from_rotvec(rotation_vector).as_matrix())


def shifted(by):
    """A translation."""
    return Frame(np.asarray(by, float), np.eye(3))


def roll_pitch_yaw(angles, *, degrees=False):
    """Rotation about the fixed axes x, y, z, one after another, (3, 3)."""
    return Rotation.from_euler("xyz", angles, degrees=degrees).as_matrix()


def of_quaternion(wxyz):
    """Rotation matrix of a quaternion, scalar first."""
    return Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
