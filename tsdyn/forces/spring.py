"""Spring, damper and actuator between two points.

    d = x_a - x_b,   l = sqrt(d.d),   ld = d.dd / l
    N = k (l - l0) + c ld + actuator     (1)  [N], positive pulls the points together
    f = [ -N d / l, N d / l ]            (2)  ground frame
    U = k (l - l0)^2 / 2                 (3)
    dissipation = c ld^2                 (4)

At l = 0 the direction of d is that of dd, as it is just after; at rest there is none, and a run ends.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    Force,
    Point,
    Signal,
    dot,
    ground_point,
    inverse_root,
    kernel,
    load,
    not_negative,
    product,
    scaled,
    some,
    square,
)

if TYPE_CHECKING:
    from ..hints import BodyLike, Load


BEYOND = 1e-100  # s; d at zero length is that of so much later


@kernel
def separation(x, xd):
    """Vector d, a tuple of three."""
    d0, d1, d2 = x[0] - x[3], x[1] - x[4], x[2] - x[5]
    return d0 + BEYOND * (xd[0] - xd[3]), d1 + BEYOND * (xd[1] - xd[4]), d2 + BEYOND * (xd[2] - xd[5])


@kernel
def spread(x, xd, k, s):
    """Coefficient k of d, d.d and 1 / l, in rows 0 to 4."""
    for i in range(3):
        s[i, k] = x[i] - x[3 + i]
    if k == 0:
        s[0, 0], s[1, 0], s[2, 0] = separation(x, xd)
    s[3, k] = dot(s, 0, 0, k)
    s[4, k] = inverse_root(s[3], s[4], k)


@kernel
def pull(xd, par, k, s, out):
    """The law, from what is in row 5 without damping."""
    if some(par[1]):
        for i in range(3):
            s[6 + i, k] = xd[i] - xd[3 + i]
        s[9, k] = dot(s, 0, 6, k)
        s[10, k] = square(s[4], k)
        s[5, k] += par[1] * product(s[9], s[10], k)
    out[3], out[4], out[5] = scaled(s, 0, 5, k)
    out[0], out[1], out[2] = -out[3], -out[4], -out[5]


class Spring(Force):
    """Spring, damper and actuator between two points: stiffness (l - free_length) + damping ld + actuator pulls.

    Parameters
    ----------
    stiffness : float, N/m
    damping : float, N s/m
    free_length : float, m; optional
        None takes the distance in the present poses.
    actuator : float, function of time, or ts.Table, N
        Additional tension; its power is applied power.

    Raises
    ------
    InvalidForce
        If a number is negative or not finite, the points coincide, or stiffness, damping and actuator are all zero.

    Notes
    -----
    Points may pass each other at speed, at any distance or none: the direction turns. At rest at zero length the force
    has no direction: a start there is refused, and a run ends.

    Examples
    --------
    A mass of 1 kg hangs on a spring of 100 N/m and is released at its free length of 1 m:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> mass = scene.add_point_mass(mass=1.0, position=(0, 0, -1))
    >>> spring = scene.add(ts.forces.Spring(mass, scene.ground, stiffness=100.0))
    >>> state = ts.simulate(scene, (0, np.pi / 10)).state
    >>> print(f"lowest at {state.position(mass)[2]:.4f} m, free length {spring.free_length:g} m")
    lowest at -1.2000 m, free length 1 m
    """

    markers = (Point("a"), Point("b"))
    quantities = MappingProxyType(
        {"stiffness": not_negative, "damping": not_negative, "free_length": not_negative, "actuator": load}
    )
    loads = ("actuator",)
    sources = ("stiffness", "damping", "actuator")
    slots, positive = 11, (3,)

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        stiffness: float = 0.0,
        damping: float = 0.0,
        free_length: float | None = None,
        actuator: Load = 0.0,
        **places: Any,
    ) -> None:
        super().__init__(a, b, **places)
        ends = [ground_point(body, s) for body, s in zip((a, b), self.coordinates, strict=True)]
        length = np.linalg.norm(ends[0] - ends[1])
        if not length > 0.0:
            raise self.error(
                f"{self.name}: its points coincide at the start, so the force has no direction; move one of them."
            )
        self.stiffness, self.damping, self.actuator = stiffness, damping, actuator
        self.free_length = length if free_length is None else free_length

    def parameters(self):
        """(k, c, l0, actuator)."""
        return self.stiffness, self.damping, self.free_length, *Signal.places(self.actuator)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (2)."""
        d0, d1, d2 = separation(x, xd)
        l = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        ld = (d0 * (xd[0] - xd[3]) + d1 * (xd[1] - xd[4]) + d2 * (xd[2] - xd[5])) / l
        f = (par[0] * (l - par[2]) + par[1] * ld + par[3]) / l
        out[0], out[1], out[2] = -f * d0, -f * d1, -f * d2
        out[3], out[4], out[5] = f * d0, f * d1, f * d2

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (2), as (k + (actuator - k l0) / l + c d.dd / l^2) d."""
        spread(x, xd, k, s)
        s[5, k] = (par[3] - par[0] * par[2]) * s[4, k] + (par[0] if k == 0 else 0.0)
        pull(xd, par, k, s, out)

    @staticmethod
    def driven_series(x, xd, par, k, s, out):
        """The same; the actuator is in row 14."""
        spread(x, xd, k, s)
        s[5, k] = product(s[14], s[4], k) - par[0] * par[2] * s[4, k] + (par[0] if k == 0 else 0.0)
        pull(xd, par, k, s, out)

    @staticmethod
    def potential(x, par, t):
        """Eq. (3)."""
        d0, d1, d2 = x[0] - x[3], x[1] - x[4], x[2] - x[5]
        stretch = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2) - par[2]
        return 0.5 * par[0] * stretch * stretch

    @staticmethod
    def dissipation(x, xd, par, t):
        """Eq. (4)."""
        d0, d1, d2 = separation(x, xd)
        rate = d0 * (xd[0] - xd[3]) + d1 * (xd[1] - xd[4]) + d2 * (xd[2] - xd[5])
        return par[1] * rate * rate / (d0 * d0 + d1 * d1 + d2 * d2)

    @classmethod
    def example(cls, rng, a, b):
        """A random spring and damper."""
        numbers = dict(zip(("stiffness", "damping", "free_length"), rng.uniform(0.5, 2.0, 3), strict=True))
        return cls(a, b, point_a=rng.normal(size=3), point_b=rng.normal(size=3), **numbers)
