"""Stop of a joint: its angle or displacement stays between bounds; unilateral.

    lower   gap = x - lower >= 0      (1)
    upper   gap = upper - x >= 0      (2)

Where a bound is reached, its row is sin(angle - bound) = 0 (Dot1), or displacement - bound = 0 (Dot2). Away from it the
gap is measured by the counted angle, over any number of turns. Never singular by itself.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import InvalidConstraint, Joint, Side, Unilateral, chosen_coordinate, finite, geometry_of, shown
from .dot1 import Dot1
from .dot2 import Dot2

if TYPE_CHECKING:
    from ..hints import JointCoordinate


class Stop(Unilateral, Joint):
    """Bounds on the angle or the displacement of a joint: a stop, without friction, that only pushes.

    Parameters
    ----------
    joint : Joint, or (Joint, "angle" or "displacement"), or (Joint, "angle", index)
        In the scene; of a joint alone that has both the angle counts, of several angles the first.
    lower, upper : float, rad or m; optional
        Bounds of `solution.angle(joint)`, or of `solution.displacement(joint)`; one of them at least.
    restitution : float, 0 to 1
        Coefficient of restitution of the rate: 0 for plastic impacts, 1 for elastic ones.

    Raises
    ------
    InvalidConstraint
        If the joint has no coordinate or isn't in the scene, the bounds are missing or cross, or restitution is
        inadmissible.

    Notes
    -----
    One row for each bound: lower, upper. `solution.reaction(stop)` is that of both. A bound counts as
    `solution.angle(joint)` does, from the pose in which the joint was built; `scene.set(joint, angle=)` starts
    elsewhere.

    Examples
    --------
    A door of 1 m, thrown against its stop at a right angle, comes back with 0.4 of its rate:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> door = scene.add_body(mass=20.0, inertia=(1, 1, 2), position=(0.5, 0, 0))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, door, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> _ = scene.set(hinge, rate=1.5)
    >>> stop = scene.add(ts.constraints.Stop(hinge, lower=0.0, upper=1.5, restitution=0.4, name="stop"))
    >>> solution = ts.simulate(scene, (0, 2))
    >>> print(f"{solution.impulses[0][0]:.3f} s", solution.angle_rate(hinge)[[0, -1]].round(9))
    1.000 s [ 1.5 -0.6]
    """

    permanent = ("joint", "coordinate")
    markers = ()
    excess = "is passed"

    def __init__(
        self,
        joint: JointCoordinate,
        lower: float | None = None,
        upper: float | None = None,
        restitution: float = 0.0,
        name: str = "",
    ) -> None:
        self.__dict__["joint"], *coordinate = chosen_coordinate(name or "Stop", joint, default=True)
        self.__dict__["coordinate"] = tuple(coordinate)
        super().__init__(*self.geometry[:2], name=name)
        self.lower, self.upper = lower, upper
        self._set_law(restitution)

    def _untitled(self, bodies):
        return f"{self._kind()}({self.joint.name})"

    def check(self):
        """Refuse a joint that isn't in the scene, and bounds that are missing, or that cross."""
        self._demand_added(self.joint)
        self._check_law()
        bounds = [(name, getattr(self, name)) for name in ("lower", "upper") if getattr(self, name) is not None]
        if not bounds:
            raise InvalidConstraint(f"{self.name}: give lower, upper or both, in rad or m.")
        for name, value in bounds:
            finite(value, f"{self.name}: {name} (rad or m)", InvalidConstraint)
        if len(bounds) == 2 and not self.lower < self.upper:
            raise InvalidConstraint(
                f"{self.name}: lower must be below upper, got lower={shown(self.lower)} and upper={shown(self.upper)}."
            )

    @property
    def geometry(self) -> Any:
        """Where the coordinate is measured: an `AngleGeometry` or a `DisplacementGeometry`."""
        return geometry_of(self.joint, *self.coordinate)

    def _bounds(self):
        return [(name, float(value)) for name in ("lower", "upper") if (value := getattr(self, name)) is not None]

    def compose(self):
        """Rows of Eqs. (1), (2)."""
        own, other, *place = self.geometry
        for name, bound in self._bounds():
            if self.coordinate[0] == "angle":
                f, g, h = map(np.array, place)
                axis = math.cos(bound) * g - math.sin(bound) * f
                yield name, Dot1(own, other, axis_a=axis, axis_b=h)
            else:
                e, s, s_other = place
                yield name, Dot2(own, other, axis_a=e, point_a=s, point_b=s_other, value=bound)

    @property
    def sides(self):
        """One for each bound."""
        kind, index = self.coordinate
        joint = self.joint if kind == "angle" else None
        bounds = zip(self.parts, self._bounds(), strict=True)
        return tuple(
            Side(part, 1.0 if name == "lower" else -1.0, joint, index, bound) for part, (name, bound) in bounds
        )

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, on a hinge that it adds to the scene."""
        from .revolute import Revolute

        places = {marker.argument: rng.normal(size=3) for marker in Revolute.markers}
        return cls(a.scene.add(Revolute(a, b, **places)), *np.sort(rng.normal(size=2)).tolist())
