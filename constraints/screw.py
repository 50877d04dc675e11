"""Screw joint: a common axis; rotation in proportion to displacement along it.

    f_a.b = 0,  g_a.b = 0                           (1)  two rows, Parallel
    f_a.(x_b - x_a) = 0,  g_a.(x_b - x_a) = 0       (2)  two rows, PointOnLine: x_b on the axis of a
    lead sin(theta - a.(x_b - x_a) / lead) = 0      (3)  Thread; theta from f_a to f_b about the axis

f_a and f_b are the references, made perpendicular to the axes. (1) also admits opposed axes; such a start is refused.
(3) is periodic and counts no turns. Never singular.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Angle, Displacement, FramedJoint
from .parallel import Parallel
from .point_on_line import PointOnLine
from .rotation_motor import set_apart
from .thread import Thread, demand_lead, travel

if TYPE_CHECKING:
    from ..hints import BodyLike


class Screw(FramedJoint):
    """Rotation about a common axis in proportion to translation along it: a screw joint.

    Parameters
    ----------
    reference_a, reference_b : array_like (3,), optional
        Directions not parallel to the axis, in the body frames, which are parallel when the points coincide; missing
        directions follow from the present poses.
    lead : float, m/rad
        Travel of b along the axis over its rotation about it (right-hand rule), relative to a; negative for a
        left-handed thread.

    Raises
    ------
    InvalidConstraint
        If the lead is zero, an axis is missing or zero, a reference is parallel to its axis, or a point or body is
        wrong.

    Notes
    -----
    The points lie on the axis. Rows: axis[0], axis[1], line[0], line[1], thread. `Screw.at(a, b, point=, axis=, lead=)`
    takes a point and the direction of the axis in the ground frame. A single-start thread of pitch p, m, has lead = p /
    (2 pi).

    Examples
    --------
    A nut falls on a vertical screw of 0.1 m/rad:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> nut = scene.add_body(mass=1.0, inertia=(1, 1, 0.99))
    >>> screw = scene.add(ts.constraints.Screw.at(scene.ground, nut, point=(0, 0, 0), axis=(0, 0, 1), lead=0.1))
    >>> state = ts.simulate(scene, (0, 1)).state
    >>> print(f"{state.angle(screw):.4f} rad, {state.displacement(screw):.4f} m")
    -0.5000 rad, -0.0500 m
    """

    joint_coordinates = (Angle(reference="reference_a", direction="reference_b"), Displacement())

    def __init__(self, a: BodyLike, b: BodyLike, *, lead: float | None = None, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.lead = demand_lead(self, "lead", lead)
        turn = travel(a, b, self.axis_a, self.point_a, self.point_b) / self.lead
        set_apart(self, places, turn)

    def check(self):
        """Refuse a lead of zero, and references along the axes."""
        demand_lead(self, "lead", self.lead)
        super().check()

    def compose(self):
        """Eqs. (1) to (3)."""
        (f, g), (h, _) = self.frames
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield "line", PointOnLine(self.b, self.a, point_a=self.point_b, point_b=self.point_a, axis_b=self.axis_a)
        yield (
            "thread",
            Thread(
                self.a,
                self.b,
                reference_a=f,
                across_a=g,
                axis_a=self.axis_a,
                reference_b=h,
                point_a=self.point_a,
                point_b=self.point_b,
                lead=self.lead,
            ),
        )

    @property
    def travel_per_radian(self) -> float:
        """The lead, m/rad: its angle and its displacement are one freedom."""
        return self.lead

    def counted_from(self, t, *displacements):
        """The angle of the present travel."""
        return displacements[0] / self.lead

    def aligned(self):
        """None besides those of Parallel."""
        return ()

    @classmethod
    def example(cls, rng, a, b):
        """A random instance; its rows need not be satisfied."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, lead=rng.uniform(0.5, 2.0))
