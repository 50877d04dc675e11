"""Dot-2: the component, along a direction of a, of the vector from a point of a to a point of b.

    d     = x_b - x_a
    Phi   = a.d - c                     (1)  [m]; c constant or a function of time
    Phi_x = [ d^T, -a^T, a^T ]          (2)  for (a, x_a, x_b)
    Phi_t = -cd                         (3)
    gamma = 2 ad.dd - cdd               (4)

Never singular by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..plugins import Point, Primitive, Vector, kernel
from .dot1 import Prescribed

if TYPE_CHECKING:
    from ..hints import BodyLike, Prescribed


@kernel
def write_offset_gradient(x, factor, out):
    """out = factor Phi_x, Eq. (2); of coefficients x its coefficient."""
    for i in range(3):
        out[0, i] = factor * (x[6 + i] - x[3 + i])
        out[0, 3 + i] = -factor * x[i]
        out[0, 6 + i] = factor * x[i]


class Dot2(Prescribed, Primitive):
    """Offset of a point of b from a point of a, along an axis of a.

    Parameters
    ----------
    value : float, or three functions of time (c, cd, cdd), m; default 0
        The offset.

    Examples
    --------
    A point mass is kept 0.5 m above the plane z = 0:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> particle = scene.add_point_mass(mass=1.0, position=(1, 0, 0.4))
    >>> scene.add(ts.constraints.Dot2(scene.ground, particle, axis_a=(0, 0, 1), value=0.5))
    <Dot2 'Dot2(ground, body1)'>
    >>> report = scene.assemble()
    >>> print(particle.position, f"moved by {report.moved:.2f} m")
    [1.  0.  0.5] moved by 0.10 m
    """

    markers = (Vector("a"), Point("a"), Point("b"))

    def __init__(self, a: BodyLike, b: BodyLike, *, value: Prescribed = 0.0, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.value = value

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        out[0] = x[0] * (x[6] - x[3]) + x[1] * (x[7] - x[4]) + x[2] * (x[8] - x[5]) - par[0]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        write_offset_gradient(x, 1.0, out)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (4)."""
        out[0] = 2.0 * (xd[0] * (xd[6] - xd[3]) + xd[1] * (xd[7] - xd[4]) + xd[2] * (xd[8] - xd[5])) - par[2]

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2), which is linear in x."""
        write_offset_gradient(x, 1.0, out)
