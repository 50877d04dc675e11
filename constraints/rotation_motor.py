"""Rotation motor: the angle about an axis is a function of time; counts any number of turns by itself.

    sin(theta - angle(t)) = 0     (1)  AngleDriver; theta from f_a to f_b about the axis

f_a and f_b are the references made perpendicular to the axes. Holds after half a turn, too: a start there is refused.
Singular where the axes are at right angles: a joint keeps them together.
"""

import numpy as np

from ..plugins import Angle, FramedJoint, InvalidConstraint, Motion, beside, fitting, turned_about
from .angle_driver import AngleDriver


class RotationMotor(FramedJoint):
    """Turn one body about an axis of another as a function of time says: a motor on a hinge, full turns included.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene, held on a common axis by a joint (Revolute, Cylindrical, ...).
    point_a, point_b : array_like (3,), m; optional
        Where reactions are taken about, in the bodies' own frames; the row itself knows no point.
    axis_a, axis_b : array_like (3,)
        The axis, in the bodies' own frames; scaled to unit length.
    reference_a, reference_b : array_like (3,), optional
        Directions beside the axis, in the bodies' own frames; the angle goes from the first to the second about the
        axis (right hand). What is left out follows from the bodies as they stand now: their angle is that at t = 0,
        or at the time nearest to it that data cover.
    angle : one of ts.motions, a function f of time or three (f, fd, fdd), or float, rad
        The angle of b against a.
    name : str, optional

    Raises
    ------
    InvalidConstraint
        If an axis is missing or zero, a reference is parallel to its axis, the angle is no motion, or a body is wrong.

    Notes
    -----
    One row: turn. `RotationMotor.of(joint, angle=)` drives a joint that has an axis; `RotationMotor.at(a, b, axis=,
    angle=)` takes the axis in the ground frame. The torque on b about the axis is that of `solution.reaction(motor,
    on=b)`, its power part of `solution.power`.
    """

    joint_coordinates = (Angle(reference="reference_a", direction="reference_b"),)

    def __init__(
        self,
        a,
        b,
        *,
        point_a=(0.0, 0.0, 0.0),
        point_b=(0.0, 0.0, 0.0),
        axis_a=None,
        axis_b=None,
        reference_a=None,
        reference_b=None,
        angle=0.0,
        name="",
    ):
        super().__init__(a, b, (point_a, point_b, axis_a, axis_b, reference_a, reference_b), name)
        self.angle = angle
        set_apart(self, reference_a is None, reference_b is None, Motion.at_start(self.angle))
        self.check()

    def __setattr__(self, name, value):
        """Set an attribute, checked; an angle is always a motion."""
        super().__setattr__(name, Motion.always(value, f"{self.name}: angle") if name == "angle" else value)

    def counted_from(self, t, *displacements):
        """The angle prescribed."""
        return self.angle.value(t)[0]

    @classmethod
    @fitting
    def of(cls, joint, *, angle, name=""):
        """Make the motor that turns b of a joint against a, about its axis, from where the bodies stand now."""
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
        """A random instance that stands still."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, angle=rng.normal())


def geometry(joint):
    """The two bodies of a joint, or an error where it has no axis on both."""
    given = [getattr(joint, name, np.zeros(3)) for name in ("axis_a", "axis_b")]
    pairs = [[u, v] for (_, u), (_, v) in getattr(joint, "opposed", ()) if not callable(u)]
    known = any(np.allclose(pair, given, rtol=0.0, atol=1e-12) for pair in pairs)
    if not known:
        raise InvalidConstraint(
            f"{joint!r} has no axis that a motor could drive; give a Revolute, Cylindrical, Translational or another "
            "joint that keeps axis_a along axis_b."
        )
    return joint.a, joint.b


def axes(joint):
    """The points and axes of a joint, as arguments."""
    names = ("point_a", "point_b", "axis_a", "axis_b")
    return {name: place for name in names if isinstance(place := getattr(joint, name, None), np.ndarray)}


def set_apart(joint, free_a, free_b, angle):
    """Turn a reference of a framed joint that was left out, so that the bodies now stand at this angle."""
    if free_b:
        joint.reference_b = turned_about(joint.axis_b, beside(joint.axis_b, joint.reference_b)[0], angle)
    elif free_a:
        joint.reference_a = turned_about(joint.axis_a, beside(joint.axis_a, joint.reference_a)[0], -angle)
