"""Rows that take variations of q to variations of coordinates, with their first two derivatives along the motion.

    dx = Z dq,    dxd = Z dqd + Zd dq,    dxdd = Z dqdd + 2 Zd dqd + Zdd dq

Joint coordinates are functions of q. Displacements and rotations of a body are along axes that turn steadily with R:
R^T dr and R^T 2 E(p) dp.
"""

from collections import Counter
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..elements.bodies import IDENTITY, transform_g
from ..elements.joint_coordinates import AngleGeometry
from ..model.handles import handles_of
from .jets import constant, product, quotient, turning


def named_coordinates(handles):
    """Of each item with joint coordinates, by its id: their names and geometries, angles first."""
    found, seen = {}, Counter()
    for row in handles.rows:
        seen[row.item.name] += 1
        title = row.item.name + (f" #{seen[row.item.name]}" if seen[row.item.name] > 1 else "")
        own = found[id(row.item)] = []
        for kind, geometries in (("angle", row.angles), ("displacement", row.displacements)):
            for i, geometry in enumerate(geometries):
                own.append((f"{title}.{kind}" + (f" {i + 1}" if len(geometries) > 1 else ""), geometry))
    return found


class Variation(NamedTuple):
    """One coordinate."""

    name: str
    columns: np.ndarray  # (c,) of q
    jet: np.ndarray  # (3, c): Z, Zd and Zdd / 2
    length: bool  # whether it is one, m, or else an angle, rad


class Variations:
    """Rows at a `Motion`, in axes that turn at a rate (3,), rad/s."""

    def __init__(self, motion, rate):
        self.motion, self.handles, self.axes = motion, handles_of(motion.packed), turning(rate)

    @cached_property
    def _named(self):
        return named_coordinates(self.handles)

    @cached_property
    def joints(self):
        """Of all joint coordinates of the constraints."""
        own = {id(member.constraint) for member in self.motion.packed.members}
        return [one for row in self.handles.rows if id(row.item) in own for one in self.of_row(row)]

    def of_row(self, row):
        """Of the coordinates of one joint."""
        found = []
        for name, geometry in self._named[id(row.item)]:
            turns = isinstance(geometry, AngleGeometry)
            found.append(Variation(name, *(self.angle if turns else self.displacement)(geometry), not turns))
        return found

    @cached_property
    def bodies(self):
        """Of the displacement and the rotation of all bodies."""
        return [one for body in self.motion.packed.bodies for one in self.of_body(body)]

    def of_body(self, body):
        """Of the displacement of the centroid and, of a rigid body, of its rotation."""
        found = self.point(body, np.zeros(3), body.name)
        if body.dimension == 7:
            columns = self._place(body)[0] + np.arange(3, 7)
            rows = 2.0 * product(self.axes, transform_e(self._parameters(body)), "ij,jk->ik")
            found += [
                Variation(f"{body.name}.rotation {axis}", columns, rows[:, i], False) for i, axis in enumerate("xyz")
            ]
        return found

    def point(self, body, s, title):
        """Of the displacement of a point s of a body."""
        columns, rows = self._point(body, s)
        rows = product(self.axes, rows, "ij,jk->ik")
        return [Variation(f"{title}.{axis}", columns, rows[:, i], True) for i, axis in enumerate("xyz")]

    def angle(self, geometry):
        """Columns and jet of an angle atan2(F, E), E = f.v, F = g.v, all in the ground frame."""
        own, other = geometry.own, geometry.other
        (v, v_p), (f, f_p), (g, g_p) = (
            self._direction(body, s) for body, s in ((other, geometry.h), (own, geometry.f), (own, geometry.g))
        )
        E, F = product(f, v, "i,i->"), product(g, v, "i,i->")
        E_p = np.concatenate((product(v, f_p, "i,ij->j"), product(f, v_p, "i,ij->j")), axis=1)
        F_p = np.concatenate((product(v, g_p, "i,ij->j"), product(g, v_p, "i,ij->j")), axis=1)
        square = product(E, E, ",->") + product(F, F, ",->")
        jet = quotient(product(E, F_p, ",j->j") - product(F, E_p, ",j->j"), square)
        return np.concatenate((self._turning(own), self._turning(other))), jet

    def displacement(self, geometry):
        """Columns and jet of e.(x_other - x_own), e a direction of the own body."""
        own, other = geometry.own, geometry.other
        e, e_p = self._direction(own, geometry.e)
        own_columns, own_rows = self._point(own, geometry.s_own)
        other_columns, other_rows = self._point(other, geometry.s_other)
        apart = self._position(other, geometry.s_other) - self._position(own, geometry.s_own)
        parts = (
            (self._turning(own), product(apart, e_p, "i,ij->j")),
            (own_columns, -product(e, own_rows, "i,ij->j")),
            (other_columns, product(e, other_rows, "i,ij->j")),
        )
        return np.concatenate([c for c, _ in parts]), np.concatenate([jet for _, jet in parts], axis=1)

    def elongation(self, a, s, b, s_b):
        """Columns and row, at this instant alone, of the distance of two points."""
        (columns, rows), (columns_b, rows_b) = self._point(a, s), self._point(b, s_b)
        d = self._position(a, s)[0] - self._position(b, s_b)[0]
        d = d / np.linalg.norm(d)
        return np.concatenate((columns, columns_b)), np.concatenate((d @ rows[0], -d @ rows_b[0]))

    def load(self, body, s, e, frame):
        """Columns and generalised force of a unit force along e at a point s, or of a unit torque where s is None."""
        e = np.asarray(e, float) if frame == "ground" else self._direction(body, e)[0][0]
        if s is not None:
            columns, rows = self._point(body, s)
            return columns, e @ rows[0]
        return self._turning(body), 2.0 * e @ transform_e(self._parameters(body)[0])

    def _place(self, body):
        return self.handles.where(body)

    def _parameters(self, body):
        """Jet of p."""
        at, dimension = self._place(body)
        if dimension != 7:
            return constant(IDENTITY)
        motion, span = self.motion, slice(at + 3, at + 7)
        return np.stack((motion.q[span], motion.qd[span], 0.5 * motion.qdd[span]))

    def _turning(self, body):
        """Columns of p."""
        at, dimension = self._place(body)
        return np.arange(at + 3, at + dimension) if dimension else np.zeros(0, int)

    def _direction(self, body, s):
        """Jets of A s and of its derivative with respect to p."""
        p = self._parameters(body)
        slope = arm_by_parameters(p, np.asarray(s, float))
        value = 0.5 * product(slope, p, "ij,j->i")
        return value, slope if self._place(body)[1] == 7 else np.zeros((3, 3, 0))

    def _position(self, body, s):
        """Jet of r + A s."""
        at, dimension = self._place(body)
        if not dimension:
            return constant(s)
        motion, span = self.motion, slice(at, at + 3)
        r = np.stack((motion.q[span], motion.qd[span], 0.5 * motion.qdd[span]))
        return r + self._direction(body, s)[0] if dimension == 7 else r

    def _point(self, body, s):
        """Columns of a body, and the jet of the derivative of a point of it."""
        at, dimension = self._place(body)
        columns = np.arange(at, at + dimension)
        r = constant(np.eye(3) if dimension else np.zeros((3, 0)))
        return columns, np.concatenate((r, self._direction(body, s)[1]), axis=2)


def arm_by_parameters(p, s):
    """The derivative of A(p) s with respect to p, linear in p: (..., 3, 4) for p (..., 4)."""
    e0, e = p[..., 0, None], p[..., 1:]
    along = (e @ s)[..., None, None]
    cross = np.array([[0.0, -s[2], s[1]], [s[2], 0.0, -s[0]], [-s[1], s[0], 0.0]])
    by_e = along * np.eye(3) + e[..., :, None] * s - s[:, None] * e[..., None, :] - e0[..., None] * cross
    return 2.0 * np.concatenate(((e0 * s + np.cross(e, s))[..., None], by_e), axis=-1)


def transform_e(p):
    """E(p) = [-e, e~ + e0 I], shape (..., 3, 4) for p of shape (..., 4)."""
    return transform_g(p * np.array([1.0, -1.0, -1.0, -1.0])) * np.array([-1.0, 1.0, 1.0, 1.0])


def stacked(variations, n):
    """Z, Zd and Zdd of some coordinates, sparse (c, n) each."""
    from scipy.sparse import csr_array

    rows = np.repeat(np.arange(len(variations)), [one.columns.size for one in variations])
    columns = np.concatenate([one.columns for one in variations] or [np.zeros(0, int)])
    jets = np.concatenate([one.jet for one in variations] or [np.zeros((3, 0))], axis=1)
    factors = (1.0, 1.0, 2.0)
    return [csr_array((c * jet, (rows, columns)), (len(variations), n)) for c, jet in zip(factors, jets, strict=True)]
