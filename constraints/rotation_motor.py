"""Rotation motor: the angle about an axis is a prescribed function of time, over any number of turns.

    sin(theta - angle(t)) = 0     (1)  AngleDriver; theta from f_a to f_b about the axis

f_a and f_b are the references, made perpendicular to the axes. The row also admits the angle half a turn away; such a
start is refused. Singular if the two axes are perpendicular, which the joint excludes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..plugins import Angle, FramedJoint, InvalidConstraint, Motion, beside, fitting, turned_about
from .angle_driver import AngleDriver

if TYPE_CHECKING:
    from ..hints import BodyLike, Joint, Prescribed


class RotationMotor(FramedJoint):
    """Prescribed rotation about an axis, over any number of turns: a motor on a hinge.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene, held on a common axis by a joint (Revolute, Cylindrical, ...).
    reference_a, reference_b : array_like (3,), optional
        Directions not parallel to the axis, in the body frames; the angle is measured from the first to the second
        about the axis (right-hand rule). Missing directions follow from the present poses, taken as those at t = 0, or
        at the time nearest to it that data cover.
    angle : one of ts.motions, a function f of time or three (f, fd, fdd), or float, rad
        The angle of b relative to a.

    Raises
    ------
    InvalidConstraint
        If an axis is missing or zero, a reference is parallel to its axis, the angle is no motion, or a body is wrong.

    Notes
    -----
    One row: turn. Reactions are about the points. `RotationMotor.of(joint, angle=)` drives a
    joint that has an axis; `RotationMotor.at(a, b, axis=, angle=)` takes the axis in the ground frame. The torque on b
    about the axis is that of `solution.reaction(motor, on=b)`, its power part of `solution.power`.

    Examples
    --------
    A motor accelerates a flywheel of 2 kg m^2 with 3 rad/s^2:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> motor = scene.add(ts.constraints.RotationMotor.of(hinge, angle=1.5 * ts.motions.time**2))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> _, torque = solution.reaction(motor, on=wheel)
    >>> print(f"{torque[-1, 2]:.3f} N m, {solution.power_of(motor)[-1]:.3f} W")
    6.000 N m, 18.000 W
    """

    joint_coordinates = (Angle(reference="reference_a", direction="reference_b"),)

    def __init__(self, a: BodyLike, b: BodyLike, *, angle: Prescribed = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.angle = angle
        set_apart(self, places, Motion.at_start(self.angle))
        self.check()

    def __setattr__(self, name, value):
        """Set a checked attribute; an angle is always a motion."""
        super().__setattr__(name, Motion.always(value, f"{self.name}: angle") if name == "angle" else value)

    def counted_from(self, t, *displacements):
        """The prescribed angle."""
        return self.angle.value(t)[0]

    @classmethod
    @fitting
    def of(cls, joint: Joint, *, angle: Prescribed, name: str = "") -> Self:
        """Make the motor of a joint: it rotates b relative to a about the axis of the joint, from the present poses."""
        return cls(*geometry(joint), **axes(joint), angle=angle, name=name)

    def compose(self):
        """Eq. (1)."""
        (f, g), (h, _) = self.frames
        yield "turn", AngleDriver(self.a, self.b, reference_a=f, across_a=g, reference_b=h, angle=self.angle)

    def aligned(self):
        """The axes."""
        return ((self.axis_a, self.axis_b),)

    @classmethod
    def example(cls, rng, a, b):
        """A random instance at rest."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, angle=rng.normal())


def geometry(joint):
    """Return the two bodies of a joint; refuse a joint without an axis on both."""
    given = [getattr(joint, name, np.zeros(3)) for name in ("axis_a", "axis_b")]
    pairs = [[u, v] for (_, u), (_, v) in getattr(joint, "opposed", ()) if not callable(u)]
    known = any(np.allclose(pair, given, rtol=0.0, atol=1e-12) for pair in pairs)
    if not known:
        raise InvalidConstraint(
            f"{joint!r} has no axis to be driven; give a Revolute, Cylindrical, Translational or another "
            "joint that keeps axis_a along axis_b."
        )
    return joint.a, joint.b


def axes(joint):
    """Return the points and axes of a joint, as arguments."""
    names = ("point_a", "point_b", "axis_a", "axis_b")
    return {name: place for name in names if isinstance(place := getattr(joint, name, None), np.ndarray)}


def set_apart(joint, places, angle):
    """Rotate a missing reference of a framed joint so that the angle in the present poses is as given."""
    if places.get("reference_b") is None:
        joint.reference_b = turned_about(joint.axis_b, beside(joint.axis_b, joint.reference_b)[0], angle)
    elif places.get("reference_a") is None:
        joint.reference_a = turned_about(joint.axis_a, beside(joint.axis_a, joint.reference_a)[0], -angle)
