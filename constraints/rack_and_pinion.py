"""Rack and pinion: displacement along a rack in proportion to rotation of a wheel.

    radius sin(theta - e.(x_b - x_a) / radius) = 0     (1)  Thread; theta about the axis, from e to h

e is the direction of the rack, h a direction of the pinion, made perpendicular to its axis. The row is periodic and
counts no turns. Singular if the axis of the pinion is along the rack, which its joints exclude.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import PARALLEL, Angle, Displacement, Joint, Point, Vector, beside, carried, turned_about
from .thread import Thread, demand_lead, travel

if TYPE_CHECKING:
    from ..hints import BodyLike


class RackAndPinion(Joint):
    """A pinion on a rack: its centre travels by radius times its rotation, relative to the rack.

    Parameters
    ----------
    a, b : Body or ground
        The rack and the pinion, held by other joints, which leave rotation of the pinion about its axis and translation
        along the rack. Often both are mounted on the ground.
    point_a, point_b : array_like (3,), m
        A point of the rack and a point on the pinion's axis, in the body frames.
    axis_a, axis_b : array_like (3,)
        The pinion's axis, in the bodies' own frames; scaled to unit length.
    direction_a : array_like (3,)
        Direction of the rack, perpendicular to the axis: a positive rotation of the pinion about the axis (right-hand
        rule) moves the pinion in this direction relative to the rack.
    reference_b : array_like (3,), optional
        Direction of the pinion that is along the rack when the points are level; by default derived from the present
        poses.
    radius : float, m
        Pitch radius, travel over rotation; not zero.

    Raises
    ------
    InvalidConstraint
        If the radius is zero, the rack is not across the axis, a direction is missing or zero, or a point or body is
        wrong.

    Notes
    -----
    One row: teeth. `RackAndPinion.at(a, b, point=, axis=, direction=, radius=)` takes a point on the pinion's axis,
    that axis and the rack's direction in the ground frame.

    Examples
    --------
    A pinion of 0.1 m radius moves a rack along x:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> rack = scene.add_body(mass=1.0, inertia=(1, 1, 1), velocity=(-0.2, 0, 0))
    >>> pinion = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0.1, 0), angular_velocity=(0, 0, 2))
    >>> slide = scene.add(ts.constraints.Translational.at(scene.ground, rack, point=(0, 0, 0), axis=(1, 0, 0)))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, pinion, point=(0, 0.1, 0), axis=(0, 0, 1)))
    >>> teeth = {"point": (0, 0.1, 0), "axis": (0, 0, 1), "direction": (1, 0, 0), "radius": 0.1}
    >>> scene.add(ts.constraints.RackAndPinion.at(rack, pinion, **teeth))
    <RackAndPinion(body1, body2): 1 row>
    >>> print(f"{ts.simulate(scene, (0, 1)).state.displacement(slide):.4f} m")
    -0.2000 m
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"), Vector("a", "direction_a"), Vector("b", "reference_b"))
    joint_coordinates = (Angle(reference="direction_a", direction="reference_b"), Displacement("direction_a"))

    def __init__(self, a: BodyLike, b: BodyLike, *, radius: float | None = None, **places: Any) -> None:
        follows = places.get("reference_b") is None
        if follows:
            places["reference_b"] = places.get("direction_a")  # provisional
        super().__init__(a, b, **places)
        self.radius = demand_lead(self, "radius", radius)
        if follows:
            turn = travel(a, b, self.direction_a, self.point_a, self.point_b) / self.radius
            now = carried(a, self.axis_a, self.direction_a, b, self.axis_b)
            self.reference_b = turned_about(self.axis_b, now, turn)

    def check(self):
        """Refuse a radius of zero, a rack not perpendicular to the axis, and a reference along the axis."""
        demand_lead(self, "radius", self.radius)
        if abs(self.axis_a @ self.direction_a) > PARALLEL:
            raise self.error(
                f"{self.name}: direction_a must be perpendicular to axis_a, the pinion's axis; their angle is "
                f"{np.degrees(np.arccos(np.clip(self.axis_a @ self.direction_a, -1, 1))):g} degrees."
            )
        if np.linalg.norm(np.cross(self.axis_b, self.reference_b)) < PARALLEL:
            raise self.error(
                f"{self.name}: reference_b is parallel to axis_b; choose a direction across the pinion's axis."
            )

    def counted_from(self, t, *displacements):
        """The angle of the present travel."""
        return displacements[0] / self.radius

    def compose(self):
        """Eq. (1)."""
        f, g = beside(self.axis_a, self.direction_a)
        yield (
            "teeth",
            Thread(
                self.a,
                self.b,
                reference_a=f,
                across_a=g,
                axis_a=f,
                reference_b=beside(self.axis_b, self.reference_b)[0],
                point_a=self.point_a,
                point_b=self.point_b,
                lead=self.radius,
            ),
        )

    @classmethod
    def example(cls, rng, a, b):
        """A random instance; its rows need not be satisfied."""
        one, two, axis, other, beside_, reference = rng.normal(size=(6, 3))
        return cls(
            a,
            b,
            point_a=one,
            point_b=two,
            axis_a=axis,
            axis_b=other,
            direction_a=np.cross(axis, beside_),
            reference_b=reference,
            radius=rng.uniform(0.5, 2.0),
        )
