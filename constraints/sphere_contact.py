"""Contact of a ball of a with a ball or a plane of b, or within a ball of b; unilateral.

    d     = centre of a - centre of b
    gap   = |d| - (R_a + R_b)         (1)  outside: Distance, Phi = (d.d - L^2) / 2 L, L = R_a + R_b
    gap   = (R_b - R_a) - |d|         (2)  inside: the same with L = R_b - R_a, the gap is -Phi
    gap   = n.d - R_a                 (3)  plane: PlaneContact

Eq. (2) is open where the centres coincide, so the row is never singular where the gap is closed. With friction the rows
are those of RollingContact, (3), and of SphereRolling, (1) and (2).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..plugins import InvalidConstraint, Joint, Point, Side, Unilateral, Vector, across, not_negative, shown
from .distance import Distance
from .plane_contact import PlaneContact
from .rolling_contact import RollingContact
from .sphere_rolling import SphereRolling

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike


class SphereContact(Unilateral, Joint):
    """Contact of a ball with another ball, with a plane, or within a hollow ball; it only pushes.

    Parameters
    ----------
    radius_a : float, m
        Of the ball of a; 0 for a point.
    radius_b : float, m; optional
        Of the ball of b, 0 for a point. None for a plane of b, through center_b with the normal normal_b.
    normal_b : array_like (3,), optional
        Of the plane, body frame of b; the ball is on this side.
    inside : bool
        Whether the ball of a is within the ball of b.
    restitution : float, 0 to 1
        Coefficient of restitution: 0 for plastic impacts, 1 for elastic ones.
    kinetic, static : float, float or None
        Coefficients of Coulomb friction: while the balls slide on each other, and the bound of rolling, by default the
        same. The friction turns the balls; a point mass can't turn: on a ball of b, or in it, it is a of radius 0.

    Notes
    -----
    One row: gap. `solution.reaction(contact)` is the force on a at the centre of its ball. With friction there are two
    rows on velocities beside it, slip[0] and slip[1], and the reaction is about the contact point.

    Examples
    --------
    A ball hits a ball of the same mass at rest, elastically; they exchange their velocities:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> cue = scene.add_point_mass(mass=0.2, position=(-1, 0, 0), velocity=(2, 0, 0), name="cue")
    >>> ball = scene.add_point_mass(mass=0.2, name="ball")
    >>> scene.add(ts.constraints.SphereContact(cue, ball, radius_a=0.03, radius_b=0.03, restitution=1.0, name="hit"))
    <SphereContact 'hit': 1 row>
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(f"{solution.impulses[0][0]:.3f} s", solution.velocity(ball)[-1].round(9) + 0.0)
    0.470 s [2. 0. 0.]
    """

    markers = (Point("a", "center_a"), Point("b", "center_b"))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        radius_a: float,
        radius_b: float | None = None,
        normal_b: ArrayLike | None = None,
        inside: bool = False,
        restitution: float = 0.0,
        kinetic: float = 0.0,
        static: float | None = None,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        self.radius_a, self.radius_b, self.normal_b, self.inside = radius_a, radius_b, normal_b, inside
        self._set_law(restitution, kinetic, static)

    def __setattr__(self, name, value):
        """Set a checked attribute; a normal is of unit length."""
        if name == "normal_b" and value is not None:
            value = Vector("b", name).coordinates(self.b, value, self.name)
        super().__setattr__(name, value)
        self.__dict__.pop("_friction", None)

    def check(self):
        """Refuse radii that are none, and two shapes of b at once."""
        self._check_law()
        not_negative(self.radius_a, f"{self.name}: radius_a (m)", InvalidConstraint)
        if (self.radius_b is None) == (self.normal_b is None):
            raise InvalidConstraint(
                f"{self.name}: give radius_b for a ball of b, or normal_b for a plane of b through center_b; got "
                f"{'neither' if self.radius_b is None else 'both'}."
            )
        if self.radius_b is not None:
            not_negative(self.radius_b, f"{self.name}: radius_b (m)", InvalidConstraint)
            if self.radius_a == self.radius_b == 0.0:
                raise InvalidConstraint(f"{self.name}: two points don't collide; give radius_a or radius_b above 0 m.")
        body = self.a if self.a.dimension == 3 and self.radius_a else self.b
        if self.has_friction and self.radius_b is not None and body.dimension == 3:
            raise InvalidConstraint(
                f"{self.name}: friction can't turn the point mass {body.name!r}; use add_body, leave out kinetic and "
                "static, or make it a with radius_a = 0."
            )
        if not isinstance(self.inside, bool):
            raise InvalidConstraint(f"{self.name}: inside must be True or False, got {shown(self.inside)}.")
        if self.inside and not (self.radius_b is not None and self.radius_a < self.radius_b):
            raise InvalidConstraint(
                f"{self.name}: inside=True needs radius_b, larger than radius_a = {self.radius_a:g} m."
            )

    def compose(self):
        """Eqs. (1) to (3)."""
        if self.has_friction:
            yield from self._gripping()
        else:
            yield "gap", self._gap()

    def _gap(self):
        if self.radius_b is None:
            point = self.center_b + self.radius_a * self.normal_b
            return PlaneContact(self.a, self.b, point_a=self.center_a, point_b=point, normal_b=self.normal_b)
        return Distance(self.a, self.b, point_a=self.center_a, point_b=self.center_b, length=self._distance)

    def _gripping(self):
        """The parts with friction."""
        if self.radius_b is not None:
            share = (-1.0 if self.inside else 1.0) * self.radius_a / self._distance
            centers = {"center_a": self.center_a, "center_b": self.center_b}
            yield "contact", SphereRolling(self.a, self.b, **centers, distance=self._distance, share=share)
        elif self._is_point:
            for normal in (self.normal_b, *across(self.normal_b)):
                point = self.center_b + self.radius_a * self.normal_b
                yield "contact", PlaneContact(self.a, self.b, point_a=self.center_a, point_b=point, normal_b=normal)
        else:
            first, second = across(self.normal_b)
            places = {"center_a": self.center_a, "point_b": self.center_b, "normal_b": self.normal_b}
            frame = {"first_a": (1, 0, 0), "second_a": (0, 1, 0), "third_a": (0, 0, 1)}
            plane = {"first_b": first, "second_b": second}
            yield "contact", RollingContact(self.a, self.b, **places, **frame, **plane, semi_axes=[self.radius_a] * 3)

    @property
    def _is_point(self):
        """Whether friction can't turn a: its slip is that of a point."""
        return self.a.dimension == 3 or self.radius_a == 0.0

    @property
    def _distance(self):
        return self.radius_b - self.radius_a if self.inside else self.radius_a + self.radius_b

    @cached_property
    def _friction(self):
        """Its `Grip`."""
        balls = 0.0 if self.radius_b is None else -1.0 if self.inside else 1.0
        radius = 0.0 if self._is_point else self.radius_a
        normal = (0.0, 0.0, 1.0) if self.normal_b is None else self.normal_b
        point = self.center_b if balls else self.center_b + (self.radius_a - radius) * normal
        places = {"point_a": self.center_a, "point_b": point, "normal_b": normal}
        return self._grip(self._gap(), tyre_radius=radius, balls=balls, **places)

    @property
    def row_labels(self):
        """What follows its title in the names of its rows."""
        return (" gap", " slip[0]", " slip[1]") if self.has_friction else super().row_labels

    @property
    def sides(self):
        """One."""
        return (Side(self.parts[0], -1.0 if self.inside else 1.0, grip=self._friction if self.has_friction else None),)

    @classmethod
    def example(cls, rng, a, b):
        """A random instance; the balls need not touch."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        return cls(a, b, **places, radius_a=rng.uniform(0.5, 1.0), radius_b=rng.uniform(0.5, 1.0))
