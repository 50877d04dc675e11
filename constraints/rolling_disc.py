"""Rolling disc: a thin disc or a torus on a plane.

    z.(x_a - x_b) = radius sqrt(1 - (z.n)^2) + tyre_radius     (1)  one row
    u_1 = u_2 = 0                                              (2)  two rows on velocities, RollingContact: no slip

n is the axis of the disc, z the normal of the plane. Singular where n is parallel to z: the disc lies flat.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Joint, Point, Vector, across, not_negative, positive
from .rolling_contact import RollsOnPlane

if TYPE_CHECKING:
    from ..hints import BodyLike


class RollingDisc(RollsOnPlane, Joint):
    """A disc of one body rolls on a plane of another: a coin, a wheel; with `tyre_radius` a torus.

    Parameters
    ----------
    radius : float, m
        Of the disc; of a torus, that of the circle along which the centre of its round section runs.
    tyre_radius : float, m
        Radius of the round section of a torus; 0 for a thin disc.
    slip : bool
        True for contact without friction: the disc touches the plane and slides.
    kinetic, static : float, optional
        Coefficients of Coulomb friction: while it slides, and the bound of rolling, by default the same. With kinetic,
        0 or more, the contact opens, rolls and slips; without it is held to the plane and never slips.
    restitution : float, 0 to 1
        Coefficient of restitution of impacts, where the contact opens.

    Raises
    ------
    InvalidConstraint
        If the radius is not positive, an axis or normal is missing or zero, or a point or body is wrong.

    Notes
    -----
    Body a carries the disc about center_a and axis_a, b the plane through point_b with the normal normal_b, which
    points to the disc. Body b may move: a turntable, a ramp. Rows: contact, and on velocities slip[0], slip[1]. The
    disc never leaves the plane: where `solution.friction_demand` is infinite, the plane would have to pull.

    Examples
    --------
    A coin of 1 kg and 0.5 m rolls on its edge in a straight line:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> coin = scene.add_body(mass=1.0, inertia=(0.0625, 0.125, 0.0625), position=(0, 0, 0.5))
    >>> coin.velocity, coin.angular_velocity = (2, 0, 0), (0, 4, 0)
    >>> plane = {"normal_b": (0, 0, 1)}
    >>> contact = scene.add(ts.constraints.RollingDisc(coin, scene.ground, axis_a=(0, 1, 0), radius=0.5, **plane))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(solution.contact_point(contact)[-1].round(9) + 0.0)
    [2. 0. 0.]
    """

    markers = (Point("a", "center_a"), Vector("a"), Point("b"), Vector("b", "normal_b"))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        radius: float | None = None,
        tyre_radius: float = 0.0,
        slip: bool = False,
        kinetic: float | None = None,
        static: float | None = None,
        restitution: float = 0.0,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.radius = radius
        self.tyre_radius = tyre_radius
        self._set_rolling(slip, restitution, kinetic, static)

    def check(self):
        """Refuse a radius that is not positive."""
        super().check()
        positive(self.radius, f"{self.name}: radius (m)", self.error)
        not_negative(self.tyre_radius, f"{self.name}: tyre_radius (m)", self.error)

    compose = RollsOnPlane.rolling

    def surface(self):
        """Of the contact."""
        return (*across(self.axis_a), self.axis_a), (float(self.radius), float(self.radius), 0.0), self.tyre_radius

    @classmethod
    def example(cls, rng, a, b):
        """A random disc with a tyre; its rows need not be satisfied."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, radius=rng.uniform(0.5, 2.0), tyre_radius=rng.uniform(0.1, 0.5))
