"""Distance between two points, constant or a function of time.

    d     = x_a - x_b
    Phi   = (d.d - L^2) / (2 L0)            (1)  [m], ground frame; L0 = L(0) is a constant
    Phi_x = [ d^T, -d^T ] / L0              (2)
    Phi_t = -L Ld / L0                      (3)
    gamma = (dd.dd - Ld^2 - L Ldd) / L0     (4)  dd = d/dt d

Singular if x_a = x_b: for zero distance use Spherical.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Motion, Point, Primitive, ground_point, kernel, square

if TYPE_CHECKING:
    from ..hints import BodyLike, Prescribed


@kernel
def _write_gradient(x, par, out):
    """out = Phi_x, Eq. (2); of coefficients x its coefficient."""
    scale = 1.0 / par[3]
    for i in range(3):
        d = (x[i] - x[3 + i]) * scale
        out[0, i] = d
        out[0, 3 + i] = -d


class Distance(Primitive):
    """Distance between a point of one body and a point of another: a massless rod with two ball joints.

    Parameters
    ----------
    length : float, or three functions of time (L, Ld, Ldd), m; optional
        The distance, > 0; None takes the distance in the present poses.

    Raises
    ------
    InvalidConstraint
        If the length is not positive and finite (at t = 0, for a function), or a point or body is wrong.

    Examples
    --------
    A pendulum, 2 m long, passes its lowest point:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(2, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground))
    >>> def lowest(t, state):
    ...     return state.position(bob)[0]
    >>> solution = ts.simulate(scene, (0, 1), events=lowest)
    >>> print(f"length {rod.length:g} m, lowest at {solution.t_events[0][0]:.4f} s")
    length 2 m, lowest at 0.8292 s
    """

    rows = 1
    markers = (Point("a"), Point("b"))
    prescribed = "length"

    def __init__(self, a: BodyLike, b: BodyLike, *, length: Prescribed | None = None, **places: Any) -> None:
        super().__init__(a, b, **places)
        if length is None:
            ends = [ground_point(body, s) for body, s in zip((a, b), self.coordinates, strict=True)]
            length = np.linalg.norm(ends[0] - ends[1])
        self.length = length

    def check(self):
        """Refuse a length that is not positive."""
        initial = Motion.at_start(self.length)
        if not initial > 0.0:
            raise self.error(
                f"{self.name}: the length is {initial:g} m and must be positive; "
                "to hold two points together use Spherical."
            )

    def parameters(self):
        """(L, Ld, Ldd, L0)."""
        return (*Motion.places(self.length), Motion.at_start(self.length))

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        d0, d1, d2 = x[0] - x[3], x[1] - x[4], x[2] - x[5]
        out[0] = (d0 * d0 + d1 * d1 + d2 * d2 - par[0] * par[0]) / (2.0 * par[3])

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        _write_gradient(x, par, out)

    @staticmethod
    def phi_t(x, par, t, out):
        """Eq. (3)."""
        out[0] = -par[0] * par[1] / par[3]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (4)."""
        d0, d1, d2 = xd[0] - xd[3], xd[1] - xd[4], xd[2] - xd[5]
        out[0] = (d0 * d0 + d1 * d1 + d2 * d2 - par[1] * par[1] - par[0] * par[2]) / par[3]

    @staticmethod
    def series_t(x, par, k, s, out):
        """Of Eq. (3), (L^2)' / 2; L is in row 0."""
        out[0] = -0.5 * (k + 1.0) * square(s[0], k + 1) / par[3]

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2), which is linear in x."""
        _write_gradient(x, par, out)
