"""Ratchet: the angle or the displacement of a joint only grows, or only falls; unilateral.

    rate >= 0      (1)  its row is rate = 0 where the joint is held (AngleRate, DisplacementRate)

A stop that follows: it takes hold wherever the rate vanishes. Never singular by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..plugins import InvalidConstraint, Joint, Side, Unilateral, chosen_coordinate, geometry_of, shown
from .joint_rate import AngleRate, DisplacementRate

if TYPE_CHECKING:
    from ..hints import JointCoordinate


class Ratchet(Unilateral, Joint):
    """One-way clutch of a joint: its angle or displacement only grows; backstop, freewheel, pawl with fine teeth.

    Parameters
    ----------
    joint : Joint, or (Joint, "angle" or "displacement"), or (Joint, "angle", index)
        In the scene; of a joint alone that has both the angle counts, of several angles the first.
    direction : {1, -1}
        -1: the coordinate only falls.

    Raises
    ------
    InvalidConstraint
        If the joint has no coordinate or isn't in the scene, or direction is neither.

    Notes
    -----
    One row on the rate. It holds from the instant at which the rate vanishes until its reaction does, and takes the
    impulse of an impact that would turn the joint back. A start against the direction is such an impact. A joint that
    is held creeps by rounding, 1e-12 rad in 1000 s. Analyses of the start take the joint as free.

    Examples
    --------
    A wheel on a freewheel is thrown against gravity by an eccentric mass, and stays where it comes to rest:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> crank = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0), name="crank")
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, -1, 0)))
    >>> _ = scene.set(hinge, rate=2.0)
    >>> ratchet = scene.add(ts.constraints.Ratchet(hinge, name="ratchet"))
    >>> solution = ts.simulate(scene, (0, 2))
    >>> print(solution.phases[-1][2], f"at {np.sin(solution.angle(hinge)[-1]):.6f} m")
    ('ratchet',) at 0.400000 m
    """

    permanent = ("joint", "coordinate")
    markers = ()

    def __init__(self, joint: JointCoordinate, direction: int = 1, name: str = "") -> None:
        self.__dict__["joint"], *coordinate = chosen_coordinate(name or "Ratchet", joint, default=True)
        self.__dict__["coordinate"] = tuple(coordinate)
        super().__init__(*geometry_of(self.joint, *coordinate)[:2], name=name)
        self.direction = direction
        self._set_law(0.0)

    def _untitled(self, bodies):
        return f"{self._kind()}({self.joint.name})"

    def check(self):
        """Refuse a joint that isn't in the scene, and another direction than 1 and -1."""
        self._demand_added(self.joint)
        self._check_law()
        if isinstance(self.direction, bool) or self.direction not in (1, -1):
            raise InvalidConstraint(f"{self.name}: direction must be 1 or -1, got {shown(self.direction)}.")

    def compose(self):
        """Eq. (1)."""
        own, other, *place = geometry_of(self.joint, *self.coordinate)
        if self.coordinate[0] == "angle":
            f, g, h = place
            yield "rate", AngleRate(own, other, zero_a=f, quarter_a=g, hand_b=h)
        else:
            e, s_own, s_other = place
            yield "rate", DisplacementRate(own, other, axis_a=e, point_a=s_own, point_b=s_other)

    @property
    def sides(self):
        """Eq. (1)."""
        return (Side(self.parts[0], float(self.direction), follows=(self.joint, *self.coordinate)),)

    @classmethod
    def example(cls, rng, a, b):
        """A random instance, on a hinge that it adds to the scene."""
        from .revolute import Revolute

        places = {marker.argument: rng.normal(size=3) for marker in Revolute.markers}
        return cls(a.scene.add(Revolute(a, b, **places)))
