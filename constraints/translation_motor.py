"""Translation motor: the displacement along an axis is a prescribed function of time.

    a.(x_b - x_a) = displacement(t)     (1)  Dot2

Never singular by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

from ..plugins import Displacement, Joint, Motion, Point, Vector, displacements, fitting
from .dot2 import Dot2
from .rotation_motor import chosen

if TYPE_CHECKING:
    from ..hints import BodyLike, Prescribed


class TranslationMotor(Joint):
    """Prescribed displacement along an axis: a linear drive.

    Other joints guide the motion (Translational, Cylindrical, ...).

    Parameters
    ----------
    displacement : one of ts.motions, a function f of time or three (f, fd, fdd), or float, m
        Of point_b relative to point_a along axis_a.

    Notes
    -----
    One row: travel. `TranslationMotor.of(joint, displacement=)` prescribes the displacement of a joint;
    `TranslationMotor.at(a, b, point=, axis=, displacement=)` takes a point (or `point_a=`, `point_b=`) and the axis in
    the ground frame. The force on b along the axis is that of `solution.reaction(motor, on=b)`.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> table = scene.add_body(mass=2.0, inertia=(1, 1, 1), velocity=(0.5, 0, 0))
    >>> slide = scene.add(ts.constraints.Translational.at(scene.ground, table, point=(0, 0, 0), axis=(1, 0, 0)))
    >>> motion = 0.1 * np.sin(5.0 * ts.motions.time)
    >>> drive = scene.add(ts.constraints.TranslationMotor.of(slide, displacement=motion))
    >>> force, _ = ts.simulate(scene, (0, 1)).reaction(drive, on=table)
    >>> print(f"{force[-1, 0]:.4f} N")
    4.7946 N
    """

    markers = (Point("a"), Point("b"), Vector("a"))
    joint_coordinates = (Displacement(),)
    drives = "displacement"

    def __init__(self, a: BodyLike, b: BodyLike, *, displacement: Prescribed = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.displacement = displacement

    def __setattr__(self, name, value):
        """Set an attribute, checked."""
        if name == "displacement":
            value = Motion.wrap(value, f"{self.name}: displacement")
        super().__setattr__(name, value)

    @classmethod
    @fitting
    def of(cls, joint: Joint, *, displacement: Prescribed, name: str = "") -> Self:
        """Make the motor of a joint, which prescribes its displacement as `solution.displacement(joint)` gives it."""
        own, other, e, *points = chosen(displacements, joint, 0, "displacement", "Translational, Cylindrical or Screw")
        return cls(own, other, axis_a=e, point_a=points[0], point_b=points[1], displacement=displacement, name=name)

    def compose(self):
        """Eq. (1)."""
        yield (
            "travel",
            Dot2(
                self.a, self.b, axis_a=self.axis_a, point_a=self.point_a, point_b=self.point_b, value=self.displacement
            ),
        )
