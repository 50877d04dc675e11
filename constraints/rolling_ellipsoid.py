"""Rolling ellipsoid: a rattleback, an egg on a plane.

    z.(x_a - x_b) = sqrt(sum a_j^2 (e_j.z)^2)     (1)  one row; z the normal of the plane, a_j semi-axes along e_j
    u_1 = u_2 = 0                                 (2)  two rows on velocities, RollingContact: no slip

Never singular.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..plugins import TYPED, Joint, Placing, Point, Vector, floats, rotation_matrix, shown
from .rolling_contact import RollsOnPlane

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike, Orientation


class RollingEllipsoid(RollsOnPlane, Joint):
    """An ellipsoid of one body rolls on a plane of another, without slip: a rattleback (celt), an egg.

    Parameters
    ----------
    semi_axes : array_like (3,), m
        Of the ellipsoid, positive.
    axes_a : array_like (3, 3), or a scipy Rotation; optional
        Directions of the semi-axes in the frame of a, one a row; or the rotation that takes x, y, z to them. By default
        x, y, z of the frame of a.
    slip : bool
        True for contact without friction: the ellipsoid touches the plane and slides.
    kinetic, static : float, optional
        Coefficients of Coulomb friction: while it slides, and the bound of rolling, by default the same. With kinetic,
        0 or more, the contact opens, rolls and slips; without it is held to the plane and never slips.
    restitution : float, 0 to 1
        Coefficient of restitution of impacts, where the contact opens.

    Raises
    ------
    InvalidConstraint
        If a semi-axis is not positive, the directions are not at right angles, the normal is missing or zero, or a
        point or body is wrong.

    Notes
    -----
    Body a carries the ellipsoid about center_a, which need not be the centroid; b the plane through point_b with the
    normal normal_b, which points to the ellipsoid. Body b may move. Rows: contact, and on velocities slip[0], slip[1].

    Examples
    --------
    An ellipsoid at rest on its flattest side is in equilibrium:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> stone = scene.add_body(mass=1.0, inertia=(1, 2, 3), position=(0, 0, 0.1))
    >>> contact = ts.constraints.RollingEllipsoid(stone, scene.ground, semi_axes=(0.4, 0.2, 0.1), normal_b=(0, 0, 1))
    >>> contact = scene.add(contact)
    >>> force, _ = ts.simulate(scene, (0, 1)).reaction(contact)
    >>> print(force[-1].round(9) + 0.0)
    [ 0.  0. 10.]
    """

    markers = (Point("a", "center_a"), Point("b"), Vector("b", "normal_b"))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        semi_axes: ArrayLike | None = None,
        axes_a: Orientation | None = None,
        slip: bool = False,
        kinetic: float | None = None,
        static: float | None = None,
        restitution: float = 0.0,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.semi_axes = semi_axes
        self.axes_a = np.eye(3) if axes_a is None else axes_a
        self._set_rolling(slip, restitution, kinetic, static)

    def __setattr__(self, name, value):
        """Set a checked attribute; axes_a of a Rotation are its rows."""
        super().__setattr__(name, directions(value) if name == "axes_a" else value)

    @Placing
    def at(cls, a: BodyLike, b: BodyLike | None = None, **arguments: Any) -> Self:
        """Make one from points and directions in the ground frame, axes_a too, the bodies being where they stand."""
        if arguments.get("axes_a") is not None:
            axes = directions(arguments["axes_a"])
            if axes.shape == (3, 3):
                arguments["axes_a"] = axes @ rotation_matrix(a.orientation)
        return super(RollingEllipsoid, cls).at(a, b, **arguments)  # noqa: UP008 - a classmethod by its decorator

    def check(self):
        """Refuse semi-axes that are not positive, and directions that are not at right angles."""
        super().check()
        lengths = floats(self.semi_axes)
        if lengths.shape != (3,) or not (np.isfinite(lengths) & (lengths > 0.0)).all():
            raise self.error(
                f"{self.name}: semi_axes must be three positive lengths in m, got {shown(self.semi_axes)}; a disc is "
                "RollingDisc."
            )
        axes = self.axes_a
        if axes.shape != (3, 3) or not (np.abs(axes @ axes.T - np.eye(3)) <= TYPED).all():
            raise self.error(
                f"{self.name}: axes_a must be three directions of unit length at right angles, shape (3, 3), or a "
                f"scipy Rotation; got {shown(axes)}."
            )

    compose = RollsOnPlane.rolling

    def surface(self):
        """Of the contact."""
        return self.axes_a, self.semi_axes, 0.0

    @classmethod
    def example(cls, rng, a, b):
        """A random ellipsoid; its rows need not be satisfied."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        return cls(a, b, **places, semi_axes=rng.uniform(0.5, 2.0, 3), axes_a=axes)


def directions(value):
    """Rows of directions, of an array or a scipy Rotation; an array of another shape where it is neither."""
    return value.as_matrix().T if hasattr(value, "as_matrix") else floats(value)
