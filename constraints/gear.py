"""Gear pair: wheels on parallel axes rotate in a fixed ratio, relative to the line of centres.

    l = x_b - x_a;  for w = f of a, and w = h of b:  X = l.w,  Y = u.(l x w),  S = X^2 + Y^2
    theta = atan2(Y, X)                                              (1)  from the line of centres to w, about u
    Phi   = theta_b - ratio theta_a - offset                         (2)  [rad], theta counted over turns
    theta_u = X (l x w) / S,  theta_w = (X (u x l) - Y l) / S,  theta_l = (X (w x u) - Y w) / S       (3)
    thetadd = (X Ydd - Y Xdd) / S - 2 (X Xd + Y Yd) (X Yd - Y Xd) / S^2                               (4)
              with Xdd = 2 ld.wd, Ydd = 2 (ud.(ld x w) + ud.(l x wd) + u.(ld x wd))

The line of centres rotates with the carrier of the wheels, so planetary gears are covered. Turns are counted from the
last accepted step, so a step must rotate by less than half a turn. Singular if l, f or h is along the axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    PARALLEL,
    Point,
    Primitive,
    Vector,
    across,
    angle_near,
    beside,
    cross,
    dot,
    ground_point,
    kernel,
    number,
    quotient,
    rotation_matrix,
    scaled,
    shown,
    square,
    vectors,
)

if TYPE_CHECKING:
    from ..hints import BodyLike

_dot, _cross = vectors.dot, vectors.cross  # by name: `twin` follows the names of kernels


class Gear(Primitive):
    """Fixed ratio of the rotations of two wheels, relative to the line of centres.

    Parameters
    ----------
    a, b : Body
        The wheels, on parallel axes held by joints to the ground or to a common carrier.
    point_a, point_b : array_like (3,), m
        The centres, in the body frames.
    reference_a, reference_b : array_like (3,), optional
        Directions perpendicular to the axis, in the body frames, whose angles from the line of centres are counted; by
        default along the line of centres in the present poses.
    ratio : float
        Rotation of b over rotation of a, both relative to the carrier: -radius_a / radius_b for external gears,
        positive for an internal gear. Not zero.
    offset : float, rad; optional
        theta_b - ratio theta_a; None takes the value in the present poses.

    Raises
    ------
    InvalidConstraint
        If the ratio is zero, a reference or the line of centres is along the axis, or a point or body is wrong.

    Notes
    -----
    `Gear.at(a, b, point_a=, point_b=, axis=, ratio=)` takes the centres and the axis in the ground frame. At the start
    theta_a lies in (-pi, pi], unless the run continues from a state.

    Examples
    --------
    A pinion drives a wheel of twice its radius:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> pinion = scene.add_body(mass=1.0, inertia=(1, 1, 1), angular_velocity=(0, 0, 2))
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2), position=(0.3, 0, 0), angular_velocity=(0, 0, -1))
    >>> hinges = [ts.constraints.Revolute.at(scene.ground, b, point=b.position, axis=(0, 0, 1)) for b in scene.bodies]
    >>> fast, slow = map(scene.add, hinges)
    >>> gear = scene.add(ts.constraints.Gear(pinion, wheel, axis_a=(0, 0, 1), ratio=-0.5))
    >>> state = ts.simulate(scene, (0, 10)).state
    >>> print(f"{state.angle(fast):.4f} rad, {state.angle(slow):.4f} rad")
    20.0000 rad, -10.0000 rad
    """

    rows = 1
    markers = (Vector("a"), Vector("a", "reference_a"), Vector("b", "reference_b"), Point("a"), Point("b"))
    slots = 37
    memory = 1

    def __init__(
        self, a: BodyLike, b: BodyLike, *, ratio: float | None = None, offset: float | None = None, **places: Any
    ) -> None:
        super().__init__(a, b, **places)
        self.ratio = ratio
        u, f, h, l = self._now()
        for word, v in (("reference_a", f), ("reference_b", h), ("the line of centres", l)):
            if not np.linalg.norm(np.cross(u, v)) > PARALLEL * np.linalg.norm(v):
                raise self.error(f"{self.name}: {word} is along the axis at the start; it must be perpendicular to it.")
        if offset is None:
            one, other = (float(np.arctan2(u @ np.cross(l, w), l @ w)) for w in (f, h))
            offset = other - number(ratio) * one
        self.offset = offset

    def _places(self, given):
        """Fill in missing references: along the line of centres, far from the branch cut of the angle."""
        axis, one, other, *points = given
        if one is None or other is None:
            u = rotation_matrix(self.a.orientation) @ self._place(self.markers[0], axis)
            ends = [self._place(*pair) for pair in zip(self.markers[3:], points, strict=True)]
            l = ground_point(self.b, ends[1]) - ground_point(self.a, ends[0])
            sound = np.linalg.norm(np.cross(u, l)) > PARALLEL * np.linalg.norm(l)
            f = beside(u, l)[0] if sound else across(u)[0]
            one = rotation_matrix(self.a.orientation).T @ f if one is None else one
            other = rotation_matrix(self.b.orientation).T @ f if other is None else other
        return super()._places([axis, one, other, *points])

    def _now(self):
        """u, f, h and l in the present poses, ground frame."""
        A, B = (rotation_matrix(body.orientation) for body in (self.a, self.b))
        u, f = A @ self.axis_a, A @ self.reference_a
        return u, beside(u, f)[0] if np.linalg.norm(np.cross(u, f)) > 0 else f, B @ self.reference_b, self._line()

    def _line(self):
        return ground_point(self.b, self.point_b) - ground_point(self.a, self.point_a)

    def check(self):
        """A ratio and an offset."""
        ratio = number(self.ratio)
        if not (np.isfinite(ratio) and ratio != 0.0):
            raise self.error(
                f"{self.name}: ratio is the turn of b over that of a and must be a finite number other than zero, got "
                f"{self.ratio!r}; it is negative if the wheels rotate in opposite directions."
            )
        if not np.isfinite(number(self.offset)):
            raise self.error(f"{self.name}: offset must be a finite angle in rad, got {shown(self.offset)}.")

    def parameters(self):
        """(ratio, offset); what is remembered is theta_a."""
        return number(self.ratio), number(self.offset)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (2)."""
        u, f, h, l = _parts(x)
        one = angle_near(_dot(u, _cross(l, f)), _dot(l, f), par[2])
        goal = par[0] * one + par[1]
        out[0] = angle_near(_dot(u, _cross(l, h)), _dot(l, h), goal.real) - goal

    @staticmethod
    def jacobian(x, par, t, out):
        """By Eq. (3)."""
        u, f, h, l = _parts(x)
        sides = _cross(u, l)
        for j in range(2):
            factor = -par[0] if j == 0 else 1.0
            w = f if j == 0 else h
            turned = _cross(l, w)
            X, Y = _dot(l, w), _dot(u, turned)
            S = X * X + Y * Y
            X, Y = factor * X / S, factor * Y / S
            wide = _cross(w, u)
            for i in range(3):
                out[0, i] += X * turned[i]
                out[0, 3 + 3 * j + i] = X * sides[i] - Y * l[i]
                out[0, 12 + i] += X * wide[i] - Y * w[i]
        for i in range(3):
            out[0, 9 + i] = -out[0, 12 + i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """By Eq. (4)."""
        u, f, h, l = _parts(x)
        ud, fd, hd, ld = _parts(xd)
        out[0] = _second(u, h, l, ud, hd, ld) - par[0] * _second(u, f, l, ud, fd, ld)

    @staticmethod
    def remember(x, par, t):
        """theta_a."""
        u, f, _, l = _parts(x)
        return angle_near(_dot(u, _cross(l, f)), _dot(l, f), par[2])

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (3); rows of u, f, h, l, then l x w, X, Y, S, X / S, Y / S and w x u for both, and u x l."""
        for i in range(9):
            s[i, k] = x[i]
        for i in range(3):
            s[9 + i, k] = x[12 + i] - x[9 + i]
        s[34, k], s[35, k], s[36, k] = cross(s, 0, 9, k)
        for j in range(2):
            w, at, factor = 3 + 3 * j, 12 + 11 * j, -par[0] if j == 0 else 1.0
            s[at, k], s[at + 1, k], s[at + 2, k] = cross(s, 9, w, k)
            s[at + 3, k], s[at + 4, k] = dot(s, 9, w, k), dot(s, 0, at, k)
            s[at + 5, k] = square(s[at + 3], k) + square(s[at + 4], k)
            s[at + 6, k] = quotient(s[at + 3], s[at + 5], s[at + 6], k)
            s[at + 7, k] = quotient(s[at + 4], s[at + 5], s[at + 7], k)
            s[at + 8, k], s[at + 9, k], s[at + 10, k] = cross(s, w, 0, k)
            a0, a1, a2 = scaled(s, at, at + 6, k)
            out[0, 0] += factor * a0
            out[0, 1] += factor * a1
            out[0, 2] += factor * a2
            a0, a1, a2 = scaled(s, 34, at + 6, k)
            b0, b1, b2 = scaled(s, 9, at + 7, k)
            out[0, w] = factor * (a0 - b0)
            out[0, w + 1] = factor * (a1 - b1)
            out[0, w + 2] = factor * (a2 - b2)
            a0, a1, a2 = scaled(s, at + 8, at + 6, k)
            b0, b1, b2 = scaled(s, w, at + 7, k)
            out[0, 12] += factor * (a0 - b0)
            out[0, 13] += factor * (a1 - b1)
            out[0, 14] += factor * (a2 - b2)
        for i in range(3):
            out[0, 9 + i] = -out[0, 12 + i]

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, its references and line of centres nearly across the axis."""
        A, B = (rotation_matrix(body.orientation) for body in (a, b))
        u, point = rng.normal(size=(2, 3))
        f, g = across(A @ u)
        end = ground_point(a, point) + 1.5 * f + 0.3 * rng.normal(size=3) - b.position
        one, other = (np.cos(c) * f + np.sin(c) * g + 0.2 * rng.normal(size=3) for c in rng.normal(size=2))
        return cls(
            a, b, axis_a=u, reference_a=A.T @ one, reference_b=B.T @ other, point_a=point, point_b=B.T @ end,
            ratio=rng.uniform(0.5, 2.0),
        )  # fmt: skip


@kernel
def _parts(x):
    """u, f, h and l of the markers, or of their rates."""
    line = x[12] - x[9], x[13] - x[10], x[14] - x[11]
    return (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8]), line


@kernel
def _second(u, w, l, ud, wd, ld):
    """Eq. (4)."""
    turned = _cross(l, w)
    X, Y = _dot(l, w), _dot(u, turned)
    Xd, Xdd = _dot(ld, w) + _dot(l, wd), 2.0 * _dot(ld, wd)
    one, two = _cross(ld, w), _cross(l, wd)
    Yd = _dot(ud, turned) + _dot(u, one) + _dot(u, two)
    Ydd = 2.0 * (_dot(ud, one) + _dot(ud, two) + _dot(u, _cross(ld, wd)))
    S = X * X + Y * Y
    return (X * Ydd - Y * Xdd) / S - 2.0 * (X * Xd + Y * Yd) * (X * Yd - Y * Xd) / (S * S)
