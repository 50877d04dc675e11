"""Torsional spring, damper and actuator about an axis of body a; the angle counts full turns.

    u = A_a axis_a,  f_a = A_a reference_a (perpendicular to u),  f_b = A_b reference_b
    angle = atan2(f_b.(u x f_a), f_b.f_a) + 2 pi turns                     (1)
    N = actuator - k (angle - free_angle) - c u.(omega_b - omega_a)        (2)  [N m], torque N u on b, -N u on a
    U = k (angle - free_angle)^2 / 2                                       (3)
    dissipation = c (u.(omega_b - omega_a))^2                              (4)

The turn is the one nearest to the angle at the last accepted step, so a step must rotate by less than half a turn.
Singular where f_b is parallel to u.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..plugins import (
    PARALLEL,
    Angle,
    Force,
    InvalidForce,
    Placing,
    Signal,
    Turn,
    Vector,
    across,
    angle_about,
    angle_series,
    dot,
    finite,
    in_frame,
    kernel,
    load,
    not_negative,
    rotation_matrix,
    scaled,
    vector3,
)

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike, Floats, Load


@kernel
def twist(x, xd, par, k, s, out):
    """Coefficient k of the law, from what is in row 19 without spring and damper."""
    for i in range(9):
        s[i, k] = x[i]
    if par[0] != 0.0:
        angle_series(par[4], k, s)
        s[19, k] -= par[0] * s[18, k]
    else:
        s[17, k] = 1.0 if k == 0 else 0.0
    if par[1] != 0.0:
        for i in range(3):
            s[12 + i, k] = xd[12 + i] - xd[9 + i]
        s[19, k] -= par[1] * dot(s, 0, 12, k)
    out[12], out[13], out[14] = scaled(s, 0, 19, k)
    out[9], out[10], out[11] = -out[12], -out[13], -out[14]


class TorsionalSpring(Force):
    """Torque actuator - stiffness (angle - free_angle) - damping rate about an axis of a, on b; the opposite on a.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene, held on a common axis by a joint. Without a joint the torque has no
        potential, and the remainder counts as applied power.
    axis_a, axis_b : array_like (3,)
        The axis, in the body frames; positive rotation of b about it (right-hand rule) increases the angle. One
        suffices: the other follows from the present poses.
    reference_a, reference_b : array_like (3,), optional
        Directions in the frames of a and b; the angle is measured from the first to the second about the axis.
        reference_a is made perpendicular to the axis. Without references, the angle is zero in the present poses.
    stiffness : float, N m/rad
    damping : float, N m s/rad
    free_angle : float, rad
        The initial angle lies in (-pi, pi].
    actuator : float, function of time, or ts.Table, N m
        Torque about the axis on b, the opposite on a; its power is applied power.

    Raises
    ------
    InvalidForce
        If a number is negative or not finite, a reference is parallel to the axis, or all of stiffness, damping and
        actuator are zero.

    Examples
    --------
    A wheel of 2 kg m^2 on a torsional spring of 8 N m/rad oscillates with 2 rad/s:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2), angular_velocity=(0, 0, 1))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> spring = scene.add(ts.forces.TorsionalSpring.at(scene.ground, wheel, axis=(0, 0, 1), stiffness=8.0))
    >>> print(f"{ts.simulate(scene, (0, np.pi / 4)).state.angle(hinge):.4f} rad")
    0.5000 rad
    """

    markers = (Vector("a"), Vector("a", "reference_a"), Vector("b", "reference_b"), Turn("a"), Turn("b"))
    joint_coordinates = (Angle(reference="reference_a", direction="reference_b"),)
    memory = 1
    slots, positive = 20, (17,)
    conservative = False  # unless a joint holds the axis
    quantities = MappingProxyType(
        {"stiffness": not_negative, "damping": not_negative, "free_angle": finite, "actuator": load}
    )
    loads = ("actuator",)
    sources = ("stiffness", "damping", "actuator")

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        axis_b: ArrayLike | None = None,
        stiffness: float = 0.0,
        damping: float = 0.0,
        free_angle: float = 0.0,
        actuator: Load = 0.0,
        **places: Any,
    ) -> None:
        self.__dict__["_given"] = axis_b
        super().__init__(a, b, **places)
        self.reference_a = self.coordinates[1]
        self.stiffness, self.damping, self.free_angle, self.actuator = stiffness, damping, free_angle, actuator
        axis, _, reference = (self._turned(i) for i in range(3))
        if np.linalg.norm(np.cross(axis, reference)) < PARALLEL:
            raise self.error(
                f"{self.name}: reference_b is parallel to the axis at the start; choose a perpendicular one, such as "
                "the direction that coincides with reference_a at angle zero."
            )

    @Placing
    def at(cls, a: BodyLike, b: BodyLike | None = None, **arguments: Any) -> Self:
        """Make the spring from directions in the ground frame, in the present poses.

        Parameters
        ----------
        axis : array_like (3,)
        reference : array_like (3,), optional
            For both bodies: the present angle is zero.
        """
        if arguments.get("axis_b") is not None:
            arguments["axis_b"] = in_frame(b, Vector("b"), arguments["axis_b"])
        return super().at(a, b, **arguments)

    def _places(self, given):
        """Fill in a missing axis and missing references: the angle in the present poses is zero."""
        axis_a, reference_a, reference_b, *rest = given
        axis_b = self.__dict__.pop("_given")
        if axis_b is not None:
            along = self._carried(self.b, self._place(Vector("b"), axis_b), self.a)
            if axis_a is None:
                axis_a = along
            elif not np.linalg.norm(np.cross(self._place(self.markers[0], axis_a), along)) < PARALLEL:
                raise self.error(f"{self.name}: axis_b is not along axis_a in the present poses; give one of them.")
        axis_a = self._place(self.markers[0], axis_a)
        if reference_a is None:
            free = reference_b is None
            other = None if free else self._place(self.markers[2], reference_b)
            reference_a = across(axis_a)[0] if free else self._carried(self.b, other, self.a)
        if reference_b is None:
            reference_b = self._carried(self.a, self._place(self.markers[1], reference_a), self.b)
        return super()._places([axis_a, reference_a, reference_b, *rest])

    @staticmethod
    def _carried(body, direction, other):
        """Return a direction of one body in the frame of the other, in the present poses."""
        return rotation_matrix(other.orientation).T @ (rotation_matrix(body.orientation) @ direction)

    @property
    def axis_b(self) -> Floats:
        """The axis in the frame of b, in the present poses."""
        return self._carried(self.a, self.axis_a, self.b)

    def _turned(self, i):
        return rotation_matrix(self.body_of(self.markers[i]).orientation) @ self.coordinates[i]

    def __setattr__(self, name, value):
        """Set an attribute; reference_a is kept perpendicular to the axis."""
        if name == "axis_b":
            name, value = "axis_a", self._carried(self.b, self._place(Vector("b"), value), self.a)
        if name == "reference_a" and "coordinates" in self.__dict__:
            value = self._across(self.coordinates[0], value)
        super().__setattr__(name, value)
        if name == "axis_a" and "coordinates" in self.__dict__:
            self.reference_a = self.coordinates[1]

    def _across(self, axis, value):
        value = vector3(value, f"{self.name}: reference_a", InvalidForce)
        across = value - axis * (axis @ value)
        if not np.linalg.norm(across) > PARALLEL * np.linalg.norm(value):
            raise self.error(
                f"{self.name}: reference_a is parallel to axis_a; choose a direction perpendicular to the axis."
            )
        return across

    def parameters(self):
        """(k, c, free angle, actuator), and the counted angle."""
        return self.stiffness, self.damping, self.free_angle, *Signal.places(self.actuator)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (2)."""
        turned = angle_about(x, par[4])
        rate = x[0] * (xd[12] - xd[9]) + x[1] * (xd[13] - xd[10]) + x[2] * (xd[14] - xd[11])
        f = par[3] - par[0] * (turned - par[2]) - par[1] * rate
        for i in range(9):
            out[i] = 0.0 * x[i]
        out[9], out[10], out[11] = -f * x[0], -f * x[1], -f * x[2]
        out[12], out[13], out[14] = f * x[0], f * x[1], f * x[2]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eqs. (1), (2); rows of u, f_a, f_b, u x f_a, the omegas' difference, then of numbers."""
        s[19, k] = par[3] + par[0] * par[2] if k == 0 else 0.0
        twist(x, xd, par, k, s, out)

    @staticmethod
    def driven_series(x, xd, par, k, s, out):
        """The same; the actuator is in row 23."""
        s[19, k] = s[23, k] + (par[0] * par[2] if k == 0 else 0.0)
        twist(x, xd, par, k, s, out)

    @staticmethod
    def remember(x, xd, par, t):
        """The angle, Eq. (1)."""
        return angle_about(x, par[4])

    @staticmethod
    def potential(x, par, t):
        """Eq. (3)."""
        turned = angle_about(x, par[4])
        return 0.5 * par[0] * (turned - par[2]) * (turned - par[2])

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (4)."""
        rate = x[0] * (xd[12] - xd[9]) + x[1] * (xd[13] - xd[10]) + x[2] * (xd[14] - xd[11])
        return par[1] * rate * rate

    @classmethod
    def example(cls, rng, a, b):
        """A random spring and damper."""
        k, c = rng.uniform(0.5, 2.0, 2)
        axis, one, two = rng.normal(size=(3, 3))
        return cls(a, b, axis_a=axis, reference_a=one, reference_b=two, stiffness=k, damping=c, free_angle=0.3)
