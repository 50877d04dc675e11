"""What a page draws: parts that move with a body, and links that stretch between points of two bodies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..elements.joint import across

UNIT = {"box": np.ones(3), "cylinder": np.array([2.0, 2.0, 1.0]), "sphere": np.full(3, 2.0)}  # dimensions, m
DIGITS = 6  # of numbers that describe shapes


class Part(NamedTuple):
    """A unit shape, scaled, turned and placed in the frame of a body.

    kind: "box" with edges of 1, "sphere" of radius 1, "cylinder" of radius and length 1 along z, or "mesh0", ...
    """

    layer: str  # what is shown and hidden together: "bodies", "joints"
    kind: str
    body: int  # -1: ground
    colour: str
    position: Any  # (3,), m
    rotation: Any  # (3, 3)
    size: Any  # (3,), m
    contact: bool = False  # whether the state of a contact colours it

    @property
    def reach(self) -> float:
        """A distance from the centroid of the body beyond which there is nothing of it, m; of no mesh."""
        return float(np.linalg.norm(self.position) + np.linalg.norm(UNIT[self.kind] * self.size) / 2.0)

    def data(self) -> dict[str, Any]:
        """For the page: the columns of rotation times size, then position."""
        columns = (np.asarray(self.rotation) * np.asarray(self.size)).T
        matrix = rounded([*columns.ravel(), *self.position])
        data = {"layer": self.layer, "kind": self.kind, "body": self.body, "colour": self.colour, "matrix": matrix}
        return data | {"contact": True} if self.contact else data


class Link(NamedTuple):
    """A rod or a coil between a point of each of two bodies."""

    kind: str  # "cylinder", "coil"
    a: int
    point_a: Any  # (3,), m
    b: int
    point_b: Any
    radius: float
    colour: str
    layer: str = "joints"

    def data(self) -> dict[str, Any]:
        """For the page."""
        points = {"point_a": rounded(self.point_a), "point_b": rounded(self.point_b)}
        return {**self._asdict(), **points, "radius": rounded([self.radius])[0]}


def along(axis: Any) -> Any:
    """A rotation (3, 3) whose third column is the axis."""
    return np.column_stack([*across(axis), axis / np.linalg.norm(axis)])


def rounded(values: Any) -> list[float]:
    """Numbers with few digits."""
    return [float(f"{x:.{DIGITS}g}") for x in values]
