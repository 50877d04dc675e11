"""Mechanisms as they are when assembled, sketches of them that are off, and the determinants that tell their branches.

A `Mechanism` builds itself at a random configuration. Its `branch` is signed angles (rad) or the like: where one is
zero the mechanism is at a dead centre, and a configuration of other signs is another branch. Links lie along their
body's x axis; the pins of planar mechanisms are along z.
"""

from dataclasses import dataclass, field
from functools import wraps

import numpy as np

import tsdyn as ts

C = ts.constraints
Z = np.array([0.0, 0.0, 1.0])
CLEAR = 0.1  # rad, of starts from a dead centre


@dataclass
class Mechanism:
    """A scene at a consistent configuration, and what tells its branch."""

    scene: ts.Scene
    branch: object  # () -> signed angles of the bodies as they stand
    lengths: dict = field(default_factory=dict)  # of each body's link, m

    def disturb(self, rng, shift=0.3, turn=0.5):
        """Move each body by up to `shift` of its link, turn it by up to `turn` rad, both uniform, in any direction."""
        for body in self.scene.bodies:
            body.position = body.position + rng.uniform(0.0, shift) * self.lengths[body] * unit(rng)
            body.orientation = turned(body.orientation, rng.uniform(0.0, turn) * unit(rng))


def unit(rng):
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def turned(p, vector):
    """Euler parameters p turned by a rotation vector in the ground frame."""
    angle = np.linalg.norm(vector)
    e = np.sin(angle / 2) * vector / angle if angle else np.zeros(3)
    e0 = np.cos(angle / 2)
    return np.array([e0 * p[0] - e @ p[1:], *(e0 * p[1:] + p[0] * e + np.cross(e, p[1:]))])


def axes(body):
    """The body's axes as columns, ground frame."""
    e0, e = body.orientation[0], body.orientation[1:]
    return (e0 * e0 - e @ e) * np.eye(3) + 2.0 * np.outer(e, e) + 2.0 * e0 * np.cross(np.eye(3), e)


def along(body):
    """The direction of a link."""
    return axes(body)[:, 0]


def angle(u, v, n=Z):
    """From u to v about n, rad, from -pi to pi."""
    u, v = u - (u @ n) * n, v - (v @ n) * n
    return np.arctan2(n @ np.cross(u, v), u @ v)


def from_straight(theta):
    """How far an angle between links is from 0 and pi, with its sign."""
    return np.arcsin(np.sin(theta))


def arcsine(x):
    """Of a sketch it may be a little above one."""
    return np.arcsin(np.clip(x, -1.0, 1.0))


def frame(x, z):
    """Euler parameters of a body whose x axis is along x, its z axis as near to z as can be."""
    from scipy.spatial.transform import Rotation

    x = x / np.linalg.norm(x)
    z = z - (z @ x) * x
    z /= np.linalg.norm(z)
    e = Rotation.from_matrix(np.column_stack((x, np.cross(z, x), z))).as_quat()
    return np.array([e[3], *e[:3]])


class Builder:
    """Links between points, pins at points."""

    def __init__(self):
        self.scene, self.lengths = ts.Scene(), {}

    def link(self, name, start, end, z=Z):
        """A bar of 1 kg a metre from one point to the other."""
        start, end = np.array(start, float), np.array(end, float)
        L = np.linalg.norm(end - start)
        J = L**3 / 12.0
        body = self.scene.add_body(
            L, (J / 20.0, J, J), (start + end) / 2, frame(end - start, np.array(z, float)), name=name
        )
        self.lengths[body] = L
        return body

    def block(self, name, at, size):
        """A block that slides."""
        body = self.scene.add_body(0.5, np.full(3, 0.5 * size**2 / 6.0), at, name=name)
        self.lengths[body] = size
        return body

    def pin(self, a, b, at, axis=Z, name=""):
        ground = self.scene.ground
        a, b = (ground if x is None else x for x in (a, b))
        self.scene.add(C.Revolute.at(a, b, point=at, axis=axis, name=name or f"pin {a.name}-{b.name}"))

    def ball(self, a, b, at, name=""):
        ground = self.scene.ground
        a, b = (ground if x is None else x for x in (a, b))
        self.scene.add(C.Spherical.at(a, b, point=at, name=name or f"ball {a.name}-{b.name}"))

    def done(self, branch):
        return Mechanism(self.scene, lambda: np.atleast_1d(np.array(branch(), float)), self.lengths)


def polar(theta):
    return np.array([np.cos(theta), np.sin(theta), 0.0])


def meet(a, la, b, lb, side):
    """The point at distances la from a and lb from b, on one side of the line from a to b; None where there is none."""
    d = b - a
    D = np.linalg.norm(d)
    x = (D * D + la * la - lb * lb) / (2.0 * D)
    h2 = la * la - x * x
    if h2 < 0.0:
        return None
    return a + (x * d + side * np.sqrt(h2) * np.cross(Z, d)) / D


def clear(make):
    """Draw configurations until one closes and is 0.1 rad from all dead centres."""

    @wraps(make)
    def drawn(rng, *arguments):
        while True:
            found = make(rng, *arguments)
            if found is not None and np.abs(found.branch()).min() >= CLEAR:
                return found

    return drawn


def side(rng):
    return rng.choice((-1.0, 1.0))
