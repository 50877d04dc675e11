"""Dot-1: the cosine of the angle between a direction of each body, constant or a function of time.

    Phi   = a.b - c                (1)  [-]
    Phi_x = [ b^T, a^T ]           (2)
    Phi_t = -cd                    (3)
    gamma = 2 ad.bd - cdd          (4)

Singular if a and b are parallel (c = 1 or -1): Parallel uses two rows on perpendicular directions instead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Motion, Primitive, Vector, kernel

if TYPE_CHECKING:
    from ..hints import BodyLike, Prescribed


class Prescribed:
    """Mixed in before `Primitive`: one row f(x) - value(t), Phi_t of Eq. (3)."""

    rows = 1
    prescribed = "value"

    def parameters(self):
        """(c, cd, cdd)."""
        return Motion.places(self.value)

    @staticmethod
    def phi_t(x, par, t, out):
        """Eq. (3)."""
        out[0] = -par[1]

    @staticmethod
    def series_t(x, par, k, s, out):
        """Of Eq. (3); c is in row 0."""
        out[0] = -(k + 1.0) * s[0, k + 1]


@kernel
def _write_gradient(x, out):
    """out = Phi_x, Eq. (2); of coefficients x its coefficient."""
    for i in range(3):
        out[0, i] = x[3 + i]
        out[0, 3 + i] = x[i]


class Dot1(Prescribed, Primitive):
    """Cosine of the angle between two body-fixed directions; by default zero: they are perpendicular.

    Parameters
    ----------
    value : float, or three functions of time (c, cd, cdd); default 0
        The cosine, between -1 and 1 (exclusive: the row is singular there).

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> body = scene.add_body(mass=1.0, inertia=(1, 2, 2))
    >>> scene.add(ts.constraints.Dot1(body, scene.ground, axis_a=(0, 0, 1), axis_b=(1, 0, 0)))
    <Dot1 'Dot1(body1, ground)'>
    >>> scene.mobility().degrees_of_freedom
    5
    """

    markers = (Vector("a"), Vector("b"))

    def __init__(self, a: BodyLike, b: BodyLike, *, value: Prescribed = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.value = value

    def check(self):
        """Refuse a value that is no cosine."""
        initial = Motion.at_start(self.value)
        if not -1.0 < initial < 1.0:
            raise self.error(
                f"{self.name}: value is the cosine of an angle and must lie between -1 and 1, got {initial:g}; "
                "for parallel axes use Parallel."
            )

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        out[0] = x[0] * x[3] + x[1] * x[4] + x[2] * x[5] - par[0]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        _write_gradient(x, out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (4)."""
        out[0] = 2.0 * (xd[0] * xd[3] + xd[1] * xd[4] + xd[2] * xd[5]) - par[2]

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2), which is linear in x."""
        _write_gradient(x, out)
