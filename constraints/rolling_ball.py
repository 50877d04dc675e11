"""Rolling ball: a ball on a plane.

    z.(x_a - x_b) = radius     (1)  one row; z the normal of the plane
    u_1 = u_2 = 0              (2)  two rows on velocities, RollingContact: no slip

Never singular.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Joint, Point, Vector, positive
from .rolling_contact import RollsOnPlane

if TYPE_CHECKING:
    from ..hints import BodyLike


class RollingBall(RollsOnPlane, Joint):
    """A ball of one body rolls on a plane of another, without slip.

    Parameters
    ----------
    radius : float, m
        Of the ball.
    slip : bool
        True for contact without friction: the ball touches the plane and slides.
    kinetic, static : float, optional
        Coefficients of Coulomb friction: while it slides, and the bound of rolling, by default the same. With kinetic,
        0 or more, the contact opens, rolls and slips; without it is held to the plane and never slips.
    restitution : float, 0 to 1
        Coefficient of restitution of impacts, where the contact opens.

    Raises
    ------
    InvalidConstraint
        If the radius is not positive, the normal is missing or zero, or a point or body is wrong.

    Notes
    -----
    Body a carries the ball about center_a, which need not be the centroid; b the plane through point_b with the normal
    normal_b, which points to the ball. Body b may move: a turntable, a ramp. Rows: contact, and on velocities slip[0],
    slip[1]. The ball may pivot about the normal.

    Examples
    --------
    A solid ball rolls down a ramp at 45 degrees, with 5/7 of the acceleration of a block without friction:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> ball = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0, 0, 0.5 * 2**0.5))
    >>> ramp = scene.add(ts.constraints.RollingBall(ball, scene.ground, radius=0.5, normal_b=(1, 0, 1)))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(solution.acceleration(ball)[-1].round(6) + 0.0)
    [ 3.571429  0.       -3.571429]
    """

    markers = (Point("a", "center_a"), Point("b"), Vector("b", "normal_b"))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        radius: float | None = None,
        slip: bool = False,
        kinetic: float | None = None,
        static: float | None = None,
        restitution: float = 0.0,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.radius = radius
        self._set_rolling(slip, restitution, kinetic, static)

    def check(self):
        """Refuse a radius that is not positive."""
        super().check()
        positive(self.radius, f"{self.name}: radius (m)", self.error)

    compose = RollsOnPlane.rolling

    def surface(self):
        """Of the contact."""
        return np.eye(3), [float(self.radius)] * 3, 0.0

    @classmethod
    def example(cls, rng, a, b):
        """A random ball; its rows need not be satisfied."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, radius=rng.uniform(0.5, 2.0))
