"""Rack and pinion: a wheel that turns about its axis moves along a rack in proportion.

    radius sin(theta - e.(x_b - x_a) / radius) = 0     (1)  Thread; theta about the axis, from e to h

e is the rack's direction, h a direction of the pinion made perpendicular to its axis. The row is periodic as the teeth
are, and counts no turns. Singular where the axis of the pinion is along the rack: joints keep it across.
"""

import numpy as np

from ..plugins import (
    PARALLEL,
    Angle,
    Displacement,
    InvalidConstraint,
    Joint,
    Point,
    Vector,
    beside,
    carried,
    turned_about,
)
from .thread import Thread, demand_lead, travel


class RackAndPinion(Joint):
    """Roll a pinion along a rack: its centre travels by radius times its turn, against the rack.

    Parameters
    ----------
    a, b : Body or ground
        The rack and the pinion, held by other joints: the pinion turns about its axis, and the two slide along the rack
        without turning. Often the rack slides in the ground and the pinion turns there.
    point_a, point_b : array_like (3,), m
        A point of the rack and one on the pinion's axis, in the bodies' own frames.
    axis_a, axis_b : array_like (3,)
        The pinion's axis, in the bodies' own frames; scaled to unit length.
    direction_a : array_like (3,)
        The rack's direction, across the axis: turning the pinion positively about the axis (right hand) moves it that
        way along the rack, or the rack the other way.
    reference_b : array_like (3,), optional
        The direction of the pinion that is along the rack where the points are level; by default it follows from the
        bodies as they stand now.
    radius : float, m
        Pitch radius: travel over turn, not zero.
    name : str, optional

    Raises
    ------
    InvalidConstraint
        If the radius is zero, the rack is not across the axis, a direction is missing or zero, or a point or body is
        wrong.

    Notes
    -----
    One row: teeth. `RackAndPinion.at(a, b, point=, axis=, direction=, radius=)` takes a point on the pinion's axis,
    that axis and the rack's direction in the ground frame.
    """

    markers = (
        Point("a"),
        Point("b"),
        Vector("a"),
        Vector("b"),
        Vector("a", "direction_a"),
        Vector("b", "reference_b"),
    )
    joint_coordinates = (Angle(reference="direction_a", direction="reference_b"), Displacement("direction_a"))

    def __init__(
        self,
        a,
        b,
        *,
        point_a=(0.0, 0.0, 0.0),
        point_b=(0.0, 0.0, 0.0),
        axis_a=None,
        axis_b=None,
        direction_a=None,
        reference_b=None,
        radius=None,
        name="",
    ):
        given = reference_b if reference_b is not None else direction_a
        super().__init__(a, b, (point_a, point_b, axis_a, axis_b, direction_a, given), name)
        self.radius = demand_lead(self, "radius", radius)
        if reference_b is None:
            turn = travel(a, b, self.direction_a, self.point_a, self.point_b) / self.radius
            now = carried(a, self.axis_a, self.direction_a, b, self.axis_b)
            self.reference_b = turned_about(self.axis_b, now, turn)
        self.check()

    def check(self):
        """A radius, a rack across the axis, and a reference beside it."""
        demand_lead(self, "radius", self.radius)
        if abs(self.axis_a @ self.direction_a) > PARALLEL:
            raise InvalidConstraint(
                f"{self.name}: direction_a must be across axis_a, the pinion's axis; they are at an angle of "
                f"{np.degrees(np.arccos(np.clip(self.axis_a @ self.direction_a, -1, 1))):g} degrees."
            )
        if np.linalg.norm(np.cross(self.axis_b, self.reference_b)) < PARALLEL:
            raise InvalidConstraint(
                f"{self.name}: reference_b is parallel to axis_b; choose a direction across the pinion's axis."
            )

    def counted_from(self, t, *displacements):
        """The angle that goes with the travel."""
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
        """A random instance; it need not hold."""
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
