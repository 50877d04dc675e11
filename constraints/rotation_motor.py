"""Rotation motor: the angle about an axis is a prescribed function of time, over any number of turns.

    sin(theta - angle(t)) = 0     (1)  AngleDriver; theta from f_a to f_b about the axis

f_a and f_b are the references, made perpendicular to the axes. The row also admits the angle half a turn away; such a
start is refused. Singular if the two axes are perpendicular, which the joint excludes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..plugins import (
    PARALLEL,
    Angle,
    FramedJoint,
    InvalidConstraint,
    Motion,
    across,
    angles,
    beside,
    fitting,
    turned_about,
)
from .angle_driver import AngleDriver

if TYPE_CHECKING:
    from ..hints import BodyLike, Joint, Prescribed


class RotationMotor(FramedJoint):
    """Prescribed rotation about an axis, over any number of turns: a motor on a hinge.

    `RotationMotor.of(joint, angle=)` prescribes the angle of a joint; `scene.assemble()` takes the joint there.

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
    One row: turn. Reactions are about the points. `RotationMotor.at(a, b, axis=, angle=)` takes the axis in the ground
    frame. The torque on b about the axis is that of `solution.reaction(motor, on=b)`, its power part of
    `solution.power`.

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
    drives = "angle"

    def __init__(self, a: BodyLike, b: BodyLike, *, angle: Prescribed = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.angle = angle
        set_apart(self, places, Motion.at_start(self.angle))

    def __setattr__(self, name, value):
        """Set a checked attribute; an angle is always a motion."""
        super().__setattr__(name, Motion.always(value, f"{self.name}: angle") if name == "angle" else value)

    def counted_from(self, t, *displacements):
        """The prescribed angle."""
        return self.angle.value(t)[0]

    @classmethod
    @fitting
    def of(cls, joint: Joint, *, angle: Prescribed, which: int = 0, name: str = "") -> Self:
        """Make the motor of a joint, which prescribes its angle as `solution.angle(joint)` gives it.

        Parameters
        ----------
        joint : Joint
            With an angle: Revolute, Cylindrical, Screw, Universal, ...
        angle : one of ts.motions, a function f of time or three (f, fd, fdd), or float, rad
            The angle of b relative to a, zero where the joint's is, over any number of turns.
        which : int
            Index of the angle, of a joint with several (Universal).
        """
        own, other, f, g, h = chosen(angles, joint, which, "angle", "Revolute, Cylindrical, Screw or Universal")
        axis_b = getattr(joint, "axis_b" if other is joint.b else "axis_a", h)
        if np.linalg.norm(np.cross(axis_b, h)) < PARALLEL:  # the arm of a cross: any direction across it serves
            axis_b = across(h)[0]
        return cls(
            own, other, point_a=point_on(joint, own), point_b=point_on(joint, other), axis_a=np.cross(f, g),
            axis_b=axis_b, reference_a=f, reference_b=h, angle=angle, name=name,
        )  # fmt: skip

    def compose(self):
        """Eq. (1)."""
        (f, g), (h, _) = self.frames
        yield "turn", AngleDriver(self.a, self.b, reference_a=f, across_a=g, reference_b=h, angle=self.angle)

    def aligned(self):
        """None: the joint keeps the axes, and the angle is about axis_a."""
        return ()

    @classmethod
    def example(cls, rng, a, b):
        """A random instance at rest."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, angle=rng.normal())


def chosen(geometries, joint, which, kind, kinds):
    """Return the geometry of a coordinate of a joint, by `angles` or `displacements`."""
    found = geometries(joint) if getattr(joint, "joint_coordinates", ()) else []
    if not found:
        raise InvalidConstraint(f"{joint!r} has no {kind} to be driven; give a {kinds} joint.")
    if not isinstance(which, (int, np.integer)) or which not in range(len(found)):
        raise InvalidConstraint(
            f"which must be from 0 to {len(found) - 1}, an index of the {kind}s of {joint!r}; got {which!r}."
        )
    return found[which]


def point_on(joint, body):
    """Return where a joint is on one of its bodies, body frame."""
    return getattr(joint, "point_a" if body is joint.a else "point_b", np.zeros(3))


def set_apart(joint, places, angle):
    """Rotate a missing reference of a framed joint so that the angle in the present poses is as given."""
    if places.get("reference_b") is None:
        joint.reference_b = turned_about(joint.axis_b, beside(joint.axis_b, joint.reference_b)[0], angle)
    elif places.get("reference_a") is None:
        joint.reference_a = turned_about(joint.axis_a, beside(joint.axis_a, joint.reference_a)[0], -angle)
