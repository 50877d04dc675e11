"""Rolling ball on a cylinder, or in one.

    |d - (u.d) u| = S     (1)  one row, CylinderContact; d from the axis to the centre of the ball, u along the axis
    u_1 = u_2 = 0         (2)  two rows on velocities, CylinderRolling: no slip

Never singular.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Joint, Point, Vector, across
from .cylinder_contact import CylinderContact, demand_fit
from .cylinder_rolling import CylinderRolling
from .rolling_contact import Rolls

if TYPE_CHECKING:
    from ..hints import BodyLike

FRAME = {"first_a": (1.0, 0.0, 0.0), "second_a": (0.0, 1.0, 0.0), "third_a": (0.0, 0.0, 1.0)}


class RollingBallOnCylinder(Rolls, Joint):
    """A ball of one body rolls on a cylinder of another, or in it, without slip.

    Parameters
    ----------
    radius : float, m
        Of the ball.
    cylinder_radius : float, m
    inside : bool
        True for a ball in a hollow cylinder, False for one on its outside.
    slip : bool
        True for contact without friction: the ball touches the cylinder and slides.

    Raises
    ------
    InvalidConstraint
        If a radius is not positive, the ball doesn't fit into the cylinder, the axis is missing or zero, or a point or
        body is wrong.

    Notes
    -----
    Body a carries the ball about center_a, b the cylinder about the axis through point_b along axis_b. Body b may move.
    Rows: contact, and on velocities slip[0], slip[1].

    Examples
    --------
    A solid ball in a vertical pipe doesn't fall out: it rises and falls, as golfers know.

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> ball = scene.add_body(
    ...     mass=1.0, inertia=(0.1, 0.1, 0.1), position=(1, 0, 0), velocity=(0, 7, 0), angular_velocity=(0, 0, -14)
    ... )
    >>> pipe = ts.constraints.RollingBallOnCylinder(
    ...     ball, scene.ground, axis_b=(0, 0, 1), radius=0.5, cylinder_radius=1.5, inside=True
    ... )
    >>> pipe = scene.add(pipe)
    >>> period = 2 * np.pi / (7 * (2 / 7) ** 0.5)
    >>> print(abs(ts.simulate(scene, (0, period)).position(ball)[-1, 2]) < 1e-9)
    True
    """

    markers = (Point("a", "center_a"), Point("b"), Vector("b"))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        radius: float | None = None,
        cylinder_radius: float | None = None,
        inside: bool = False,
        slip: bool = False,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.radius = radius
        self.cylinder_radius = cylinder_radius
        self.inside = inside
        self.slip = slip

    def check(self):
        """Refuse a ball that doesn't fit."""
        super().check()
        demand_fit(self)

    def compose(self):
        """Eqs. (1) and (2)."""
        first, second = across(self.axis_b)
        places = {"center_a": self.center_a, "point_b": self.point_b, "first_b": first, "second_b": second}
        sizes = {"radius": self.radius, "cylinder_radius": self.cylinder_radius, "inside": self.inside}
        if self.slip:
            yield "contact", CylinderContact(self.a, self.b, **places, **sizes)
        else:
            yield "contact", CylinderRolling(self.a, self.b, **places, **sizes, **FRAME, axis_b=self.axis_b)

    @classmethod
    def example(cls, rng, a, b):
        """A random ball in a cylinder; its rows need not be satisfied."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        radius = rng.uniform(0.5, 1.0)
        return cls(a, b, **places, radius=radius, cylinder_radius=radius + rng.uniform(0.5, 1.0), inside=True)
