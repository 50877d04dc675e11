"""Base of joints that hold an orientation: an axis and a perpendicular direction on each body, by default as built."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidConstraint
from .bodies import rotation_matrix
from .joint import Joint, across
from .markers import Point, Vector
from .tolerances import OPPOSED, PARALLEL


class FramedJoint(Joint):
    """Base of joints that keep an axis and a reference across it of one body along those of the other.

    References that are not given follow from the bodies as they stand: the angle about the axis that they have is kept.
    """

    markers = (
        Point("a"),
        Point("b"),
        Vector("a"),
        Vector("b"),
        Vector("a", "reference_a"),
        Vector("b", "reference_b"),
    )

    def _places(self, given):
        """Fill in the references that were left out."""
        marker_a, marker_b, *references = self.markers[2:]
        axis_a, axis_b = self._place(marker_a, given[2]), self._place(marker_b, given[3])
        reference_a, reference_b = (
            None if value is None else self._across(letter, axis, self._place(marker, value))
            for letter, axis, marker, value in zip("ab", (axis_a, axis_b), references, given[4:], strict=True)
        )
        if reference_a is None:
            reference_a = (
                across(axis_a)[0] if reference_b is None else carried(self.b, axis_b, reference_b, self.a, axis_a)
            )
        if reference_b is None:
            reference_b = carried(self.a, axis_a, reference_a, self.b, axis_b)
        return super()._places([*given[:2], axis_a, axis_b, reference_a, reference_b])

    def check(self):
        """References that are across their axes."""
        self._across("a", self.axis_a, self.reference_a)
        self._across("b", self.axis_b, self.reference_b)

    def _across(self, letter, axis, reference):
        """The reference, refused where it is parallel to the axis."""
        if np.linalg.norm(np.cross(axis, reference)) < PARALLEL:
            raise InvalidConstraint(
                f"{self.name}: reference_{letter} is parallel to axis_{letter}; choose a direction across it."
            )
        return reference

    @property
    def frames(self) -> tuple[Any, ...]:
        """(f, g) of a and of b: f is the reference made perpendicular to the axis, f, g, axis are right-handed."""
        return beside(self.axis_a, self.reference_a), beside(self.axis_b, self.reference_b)

    def aligned(self):
        """The axes, and the references across them."""
        (f_a, _), (f_b, _) = self.frames
        return (self.axis_a, self.axis_b), (f_a, f_b)


def turned_about(axis, direction, angle):
    """A direction turned about a unit axis by an angle, right hand."""
    along = (axis @ direction) * axis
    return along + np.cos(angle) * (direction - along) + np.sin(angle) * np.cross(axis, direction)


def beside(axis, reference):
    """f, g (3,): the reference made perpendicular to the axis, and across both."""
    f = reference - (axis @ reference) * axis
    f /= np.linalg.norm(f)
    return f, np.cross(axis, f)


def carried(a, axis_a, direction, b, axis_b):
    """The direction of a, (3,), as one of b, from where they stand.

    It is turned by the least that takes one axis to the other, so it is as far from the axis of b as it was from that
    of a. Where the axes are opposed it is left as it stands.
    """
    one, other = rotation_matrix(a.orientation), rotation_matrix(b.orientation)
    u, v, d = one @ axis_a, other @ axis_b, one @ direction
    n, cosine = np.cross(u, v), u @ v
    if cosine > -1.0 + OPPOSED:
        d = d * cosine + np.cross(n, d) + n * (n @ d) / (1.0 + cosine)
    return other.T @ d
