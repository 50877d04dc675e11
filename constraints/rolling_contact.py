"""Rolling of a smooth convex surface on a plane: the row of SmoothContact, and two on velocities.

The frame of the plane is t_1, t_2, z, fixed to b. c_j are those of SmoothContact, Eq. (3).

    k_j = c_j - R z_j                                                (1)  contact point x_a + sum k_j e_j
    w   = xd_a - xd_b + sum k_j ed_j                                 (2)  of a's material point, relative to that of x_b
    l_i = t_i.(d + sum k_j e_j)                                      (3)  contact point in the plane, from x_b
    u_1 = t_1.w - l_2 t_1.td_2,  u_2 = t_2.w - l_1 t_2.td_1          (4)  [m/s] slip: both are zero
    u_x = t_i^T for x_a, k_j t_i^T for e_j, -t_i^T for x_b, and -l_2 t_1^T for t_2, -l_1 t_2^T for t_1       (5)
    ud  = (u_x xd)_x xd                                              (6)

Singular where SmoothContact is.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..plugins import Side, Unilateral, Vector, across, dot, scaled, shown
from .smooth_contact import E, P, SmoothContact, Z, along, axes, contact_series, moves, scaled_plane, support

if TYPE_CHECKING:
    from collections.abc import Iterator

T, U = 18, 21  # where t_1 and t_2 begin in x


class RollingContact(SmoothContact):
    """An ellipsoid of a, or a disc or torus, rolls on a plane of b: the rows of `RollingDisc`, `RollingBall`, ...

    Parameters
    ----------
    first_b, second_b : array_like (3,)
        Directions in the plane, at right angles.

    Examples
    --------
    One row on positions, two on velocities:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 0.5))
    >>> axes = {"first_a": (1, 0, 0), "second_a": (0, 1, 0), "third_a": (0, 0, 1), "semi_axes": (0.5, 0.5, 0.5)}
    >>> plane = {"first_b": (1, 0, 0), "second_b": (0, 1, 0), "normal_b": (0, 0, 1)}
    >>> contact = scene.add(ts.constraints.RollingContact(ball, scene.ground, **axes, **plane))
    >>> print(contact.rows, contact.rate_rows)
    1 2
    """

    rate_rows = 2
    markers = (*SmoothContact.markers, Vector("b", "first_b"), Vector("b", "second_b"))
    slots = 37

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (4)."""
        s, l, m = support(x, par), 0.0, 0.0
        out[0], out[1] = 0.0, 0.0
        for i in range(3):
            l += x[T + i] * (x[i] - x[P + i])
            m += x[U + i] * (x[i] - x[P + i])
            out[0] += x[T + i] * (xd[i] - xd[P + i])
            out[1] += x[U + i] * (xd[i] - xd[P + i])
        for j in range(3):
            e = E + 3 * j
            k = -(par[j] / s + par[3]) * along(x, e, x, Z)
            l += k * along(x, T, x, e)
            m += k * along(x, U, x, e)
            out[0] += k * along(x, T, xd, e)
            out[1] += k * along(x, U, xd, e)
        out[0] -= m * along(x, T, xd, U)
        out[1] -= l * along(x, U, xd, T)

    @staticmethod
    def rate_jacobian(x, par, t, out):
        """Eq. (5)."""
        s, l, m = support(x, par), 0.0, 0.0
        for i in range(3):
            l += x[T + i] * (x[i] - x[P + i])
            m += x[U + i] * (x[i] - x[P + i])
            out[0, i], out[1, i] = x[T + i], x[U + i]
            out[0, P + i], out[1, P + i] = -x[T + i], -x[U + i]
        for j in range(3):
            e = E + 3 * j
            k = -(par[j] / s + par[3]) * along(x, e, x, Z)
            l += k * along(x, T, x, e)
            m += k * along(x, U, x, e)
            for i in range(3):
                out[0, e + i], out[1, e + i] = k * x[T + i], k * x[U + i]
        for i in range(3):
            out[0, U + i] = -m * x[T + i]
            out[1, T + i] = -l * x[U + i]

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        """Eq. (6)."""
        s, sd = support(x, par), 0.0
        for j in range(3):
            e = E + 3 * j
            sd += par[j] * along(x, e, x, Z) * (along(xd, e, x, Z) + along(x, e, xd, Z)) / s
        l, m, ld, md, one, two = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[i] - x[P + i], xd[i] - xd[P + i]
            l += x[T + i] * d
            m += x[U + i] * d
            ld += xd[T + i] * d + x[T + i] * dd
            md += xd[U + i] * d + x[U + i] * dd
            one += xd[T + i] * dd
            two += xd[U + i] * dd
        for j in range(3):
            e = E + 3 * j
            z, f = along(x, e, x, Z), par[j] / s + par[3]
            k = -f * z
            kd = par[j] * z * sd / (s * s) - f * (along(xd, e, x, Z) + along(x, e, xd, Z))
            l += k * along(x, T, x, e)
            m += k * along(x, U, x, e)
            ld += kd * along(x, T, x, e) + k * (along(xd, T, x, e) + along(x, T, xd, e))
            md += kd * along(x, U, x, e) + k * (along(xd, U, x, e) + along(x, U, xd, e))
            one += kd * along(x, T, xd, e) + k * along(xd, T, xd, e)
            two += kd * along(x, U, xd, e) + k * along(xd, U, xd, e)
        out[0] = one - md * along(x, T, xd, U) - m * along(xd, T, xd, U)
        out[1] = two - ld * along(x, U, xd, T) - l * along(xd, U, xd, T)

    @staticmethod
    def series(x, par, k, s, out):
        """Of SmoothContact's row and Eq. (5); more rows of t_1, t_2, k_j, d + sum k_j e_j, -l_1, -l_2."""
        contact_series(x, par, k, s, out)
        for i in range(3):
            t, u = x[T + i], x[U + i]
            s[23 + i, k], s[26 + i, k] = t, u
            out[1, i], out[1, P + i], out[2, i], out[2, P + i] = t, -t, u, -u
        for j in range(axes(par)):
            s[29 + j, k] = s[19 + j, k] - par[3] * s[15 + j, k]
            e = E + 3 * j
            out[1, e], out[1, e + 1], out[1, e + 2] = scaled_plane(s, 23, 29 + j, k, par)
            out[2, e], out[2, e + 1], out[2, e + 2] = scaled_plane(s, 26, 29 + j, k, par)
        if moves(par):
            for i in range(3):
                s[32 + i, k] = out[0, Z + i] - par[3] * s[9 + i, k]
            s[35, k], s[36, k] = -dot(s, 32, 23, k), -dot(s, 32, 26, k)
            out[1, U], out[1, U + 1], out[1, U + 2] = scaled(s, 23, 36, k)
            out[2, T], out[2, T + 1], out[2, T + 2] = scaled(s, 26, 35, k)


class Rolls:
    """Mixed into joints that are one contact, rolling or, with slip=True, sliding."""

    name: str
    slip: bool
    a: Any
    error: Any

    def check(self) -> None:
        """Refuse a slip that is no flag, and a point mass."""
        if self.a.dimension == 3:
            raise self.error(
                f"{self.name}: the point mass {self.a.name!r} has no orientation and can't roll; use add_body, or "
                "PlaneContact."
            )
        if not isinstance(self.slip, bool):
            raise self.error(
                f"{self.name}: slip must be False (rolling) or True (sliding without friction), got {shown(self.slip)}."
            )

    @property
    def row_labels(self) -> tuple[str, ...]:
        """What follows its title in the names of its rows."""
        return (" contact",) if self.slip else (" contact", " slip[0]", " slip[1]")


class RollsOnPlane(Unilateral, Rolls):
    """Mixed into those on a plane: with `kinetic` they roll, slip and lift off."""

    _opens_by = "kinetic, 0 without friction"

    def _set_rolling(self, slip: bool, restitution: float, kinetic: float | None, static: float | None) -> None:
        """Take slip and the coefficients, at the end of `__init__`."""
        self.slip = slip
        self._set_law(restitution, kinetic, static)

    @property
    def unilateral(self) -> bool:
        """Whether the contact opens: where it has a coefficient of friction."""
        return self.kinetic is not None

    def check(self) -> None:
        """Refuse inadmissible coefficients, and slip=True with them."""
        Rolls.check(self)
        self._check_law()
        if self.slip and self.unilateral:
            raise self.error(f"{self.name}: with kinetic the contact slips where it must; leave out slip=True.")

    def surface(self) -> tuple[Any, Any, float]:
        """Directions of the semi-axes (3, 3), semi-axes (3,) and tyre radius, m."""
        raise NotImplementedError

    def rolling(self) -> Iterator[tuple[str, Any]]:
        """The parts: the contact row and, where it rolls, the two of the slip."""
        places, sizes = self._geometry()
        if self.slip or (self.unilateral and not self.has_friction):
            yield "contact", SmoothContact(self.a, self.b, **places, **sizes)
        else:
            first, second = across(self.normal_b)
            yield "contact", RollingContact(self.a, self.b, **places, **sizes, first_b=first, second_b=second)

    def _geometry(self):
        axes, semi_axes, tyre_radius = self.surface()
        places = dict(zip(("first_a", "second_a", "third_a"), axes, strict=True))
        places |= {name: getattr(self, name) for name in ("center_a", "point_b", "normal_b")}
        return places, {"semi_axes": semi_axes, "tyre_radius": tyre_radius}

    def __setattr__(self, name, value):
        """Set an attribute, checked; the rows follow."""
        super().__setattr__(name, value)
        self.__dict__.pop("_friction", None)

    @cached_property
    def _friction(self):
        """Its `Grip`."""
        places, sizes = self._geometry()
        gap = SmoothContact(self.a, self.b, **places, **sizes)
        return self._grip(gap, point_a=places.pop("center_a"), **places, **sizes)

    @property
    def sides(self):
        """One where it opens."""
        return (Side(self.parts[0], 1.0, grip=self._friction if self.has_friction else None),)

    @property
    def row_labels(self) -> tuple[str, ...]:
        """What follows its title in the names of its rows."""
        return (" contact", " slip[0]", " slip[1]")[: self.all_rows]
