"""Point on plane: a point of a stays in a plane of b, or on one side of it.

    d     = x_a - x_b,  n = normal of b in the ground frame
    Phi   = n.d                       (1)  [m]
    Phi_x = [ n^T, -n^T, d^T ]        (2)  for (x_a, x_b, n)
    gamma = 2 nd.dd                   (3)

Never singular by itself. A unilateral contact has the gap Phi >= 0; with friction two more rows of Eq. (1), along
directions in the plane, hold the point where it sticks.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..plugins import InvalidConstraint, Point, Primitive, Side, Unilateral, Vector, across, kernel, stop_waiting

if TYPE_CHECKING:
    from ..hints import BodyLike


@kernel
def _write_gradient(x, out):
    """out = Phi_x, Eq. (2); of coefficients x its coefficient."""
    for i in range(3):
        out[0, i] = x[6 + i]
        out[0, 3 + i] = -x[6 + i]
        out[0, 6 + i] = x[i] - x[3 + i]


class PlaneContact(Unilateral, Primitive):
    """A point of one body in a plane fixed to another, or on one side of it: contact, with friction if it opens.

    Parameters
    ----------
    unilateral : bool
        Whether the contact opens: the point stays on the side of normal_b, and the plane only pushes. By default the
        plane holds the point on both sides.
    restitution : float, 0 to 1
        Coefficient of restitution e of a unilateral contact: 0 for plastic impacts, 1 for elastic ones.
    kinetic, static : float, float or None
        Coefficients of Coulomb friction of a unilateral contact: while the point slides, and the bound of sticking, by
        default the same. `ContactFriction` is the friction of a bilateral one.

    Notes
    -----
    Body a carries the point point_a, b the plane through point_b with the normal normal_b. The force
    on a is -lam n: the plane pushes where lam < 0. With friction there are three rows: gap, and two of the slip, whose
    multipliers are the friction force, opposite in sign, along two directions in the plane.

    Examples
    --------
    A particle slides down a plane at 45 degrees:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> block = scene.add_point_mass(mass=1.0, name="block")
    >>> plane = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(1, 0, 1)))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(solution.position("block")[-1].round(3) + 0.0, solution.multipliers[0].round(3))
    [ 2.5  0.  -2.5] [-7.071]

    A ball falls on a floor from 1.25 m, and rebounds with half its velocity:

    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> ball = scene.add_point_mass(mass=1.0, position=(0, 0, 1.25), name="ball")
    >>> floor = ts.constraints.PlaneContact(
    ...     ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, restitution=0.5, name="floor"
    ... )
    >>> scene.add(floor)
    <PlaneContact 'floor'>
    >>> solution = ts.simulate(scene, (0, 1.2))
    >>> print([(round(t, 9), name, round(impulse, 9)) for t, name, impulse in solution.impulses])
    [(0.5, 'floor', 7.5), (1.0, 'floor', 3.75)]
    """

    rows = 1
    markers = (Point("a"), Point("b"), Vector("b", "normal_b"))

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        unilateral: bool = False,
        restitution: float = 0.0,
        kinetic: float = 0.0,
        static: float | None = None,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        if not isinstance(unilateral, bool):
            raise InvalidConstraint(f"{self.name}: unilateral must be True or False, got {unilateral!r}.")
        self.unilateral = unilateral
        self._set_law(restitution, kinetic, static)

    def __setattr__(self, name, value):
        """Set an attribute, checked; the rows follow."""
        super().__setattr__(name, value)
        self.__dict__.pop("_three", None)

    def check(self):
        """Refuse inadmissible coefficients of impact and friction."""
        self._check_law()

    @cached_property
    def _three(self):
        """With friction: the rows along the normal and two directions in the plane."""
        found = []
        for normal, label in zip((self.normal_b, *across(self.normal_b)), self.row_labels, strict=True):
            places = {"point_a": self.point_a, "point_b": self.point_b, "normal_b": normal}
            part = PlaneContact(self.a, self.b, **places)
            stop_waiting(part)
            part.__dict__.update(owner=self, name=f"{self.name}{label}")
            found.append(part)
        return tuple(found), self._grip(found[0], point_a=self.point_a, point_b=self.point_b, normal_b=self.normal_b)

    @property
    def parts(self):
        """Itself, or with friction its three rows."""
        return self._three[0] if self.has_friction else (self,)

    @property
    def sides(self):
        """One."""
        return (Side(*self.parts[:1], 1.0, grip=self._three[1] if self.has_friction else None),)

    @property
    def row_labels(self):
        """What follows its title in the names of its rows."""
        return (" gap", " slip[0]", " slip[1]") if self.has_friction else ("",)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        out[0] = x[6] * (x[0] - x[3]) + x[7] * (x[1] - x[4]) + x[8] * (x[2] - x[5])

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        _write_gradient(x, out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (3)."""
        out[0] = 2.0 * (xd[6] * (xd[0] - xd[3]) + xd[7] * (xd[1] - xd[4]) + xd[8] * (xd[2] - xd[5]))

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2), which is linear in x."""
        _write_gradient(x, out)
