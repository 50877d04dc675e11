"""Base of JointTorque and JointForce: a function of time, joint coordinate and rate, continuous or sampled."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Never, Self

import numpy as np

from ..errors import InvalidForce
from ..motions.keywords import starred
from ..validation import label, positive
from .markers import TURN
from .user_functions import ByState, arguments_of, variant

if TYPE_CHECKING:
    from ..hints import AnyBody, Attachment, Floats, JointLaw, Random


def instants(value, what, error):
    """A period, s, or None."""
    return None if value is None else positive(value, f"{what} (s)", error)


def law_of_joint(value, what, error):
    """Anything that can be called."""
    if not callable(value):
        raise error(f"{what} must be a function of (t, coordinate, rate), or an object to be called so, got {value!r}.")
    return value


class JointLoad:
    """Mixed into forces of one joint coordinate; the load does its work on that coordinate.

    With a period the load is held between instants and is what such a force remembers: see runs/sampling.py.
    """

    loads = ("function",)
    permanent = ("joint", "which")
    memory, positive = 1, ()
    quantities = MappingProxyType({"function": law_of_joint, "period": instants})
    coordinate = ""  # "angle" or "displacement"
    kind_of_example: Any = None  # a class of joints with such a coordinate and an axis
    remembers_angle = False  # of its joint, from the start of a run on

    def __new__(cls, *given: Any, period: float | None = None, **others: Any) -> Self:
        """Choose the kernel: held, or by the function; a copy has its class already."""
        continuous = (given or others) and period is None
        return super().__new__(variant(cls, ByState) if continuous else cls)

    def __init__(
        self, joint: Attachment, *, function: JointLaw, period: float | None = None, which: int = 0, name: str = ""
    ) -> None:
        kind = self._kind()
        name = label(name, kind, InvalidForce)
        geometries = self.geometries(joint) if hasattr(joint, "joint_coordinates") else []
        if not geometries:
            raise InvalidForce(f"{name or kind}: joint must be one with {self.coordinate}, got {joint!r}.")
        if not isinstance(which, (int, np.integer)) or which not in range(len(geometries)):
            raise InvalidForce(
                f"{name or kind}: which must be from 0 to {len(geometries) - 1}, as {joint.name!r} has "
                f"{len(geometries)} of {self.coordinate}; got {which!r}."
            )
        self.__dict__.update(joint=joint, which=int(which))
        own, other = self.geometry[:2]
        super().__init__(own, other, self.coordinates, name)
        self.function, self.period = function, period
        self.check()

    def _untitled(self, bodies):
        return f"{self._kind()}({self.joint.name})"

    @property
    def geometry(self) -> Any:
        """Where the coordinate is measured: a `joint_coordinates.AngleGeometry` or `DisplacementGeometry`."""
        return self.geometries(self.joint)[self.which]

    @property
    def coordinates(self) -> tuple[Floats, ...]:
        """Where the markers are, (3,) each: where the joint measures."""
        given = iter(self.directions(self.geometry))
        return tuple(np.zeros(3) if marker.code == TURN else np.array(next(given)) for marker in self.markers)

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; where it acts is the joint's."""
        if name == "coordinates":
            return
        if name in (*self.permanent, "geometry") or name in [marker.argument for marker in self.markers]:
            raise self.error(f"{self.name}: {name} is that of its joint {self.joint.name!r}; set it there.")
        if name == "period" and self.added and (value is None) != (self.period is None):
            raise self.error(f"{self.name}: make a new one to change between a continuous and a sampled load.")
        super().__setattr__(name, value)

    def check(self) -> None:
        """A joint that the scene has; of a continuous load a plain function of three arguments."""
        if not self.joint.added:
            raise self.error(f"{self.name}: add its joint {self.joint.name!r} to the scene first.")
        if self.__dict__.get("period") is None and arguments_of(self.function) != 3:
            raise self.error(
                f"{self.name}: function must be a plain Python function of three arguments (t, {self.coordinate}, "
                f"rate), got {self.function!r}{starred(self.function)}. With period= it may be any object to be called "
                "so."
            )

    def parameters(self) -> tuple[Any, ...]:
        """None but what it remembers."""
        return ()

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """A damper that is sampled, on a joint that is added to the scene."""
        joint = cls.kind_of_example(a, b, axis_a=rng.normal(size=3), axis_b=rng.normal(size=3))
        return cls(a.scene.add(joint), function=lambda t, x, rate: -rate, period=0.1)
