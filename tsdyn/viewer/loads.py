"""Arrows: reactions of constraints and applied forces, with their torques, at the points where they act."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .frames import Frames
from .sizes import Attached

NONE = 1e-9  # of the largest load: below it an arrow is left out; torques are compared with forces by a length
UNITS = {"force": "N", "torque": "N m"}


class Arrows(NamedTuple):
    """Loads of one element on one body: values (k, 3) in the ground frame."""

    layer: str  # "reactions" or "forces"
    unit: str  # "force" or "torque"
    name: str
    body: int
    point: Any  # (3,), body frame
    values: Any
    unique: bool  # False where redundant constraints may share the load in many ways


def arrows(frames: Frames, constraints: list[Attached], forces: list[Attached], length: float) -> list[Arrows]:
    """All loads that are not zero throughout, at the times of the frames; NaN, of singular configurations, is zero.

    length: of a usual body, m.
    """
    found, redundant = [], bool(np.isnan(frames.run.multipliers).any())
    for layer, items in (("reactions", constraints), ("forces", forces)):
        for each in items:
            on_a = each.item.on is each.item.a
            index, point = (each.a, each.point("a")) if on_a else (each.b, each.point("b"))
            unique = not redundant or bool(frames.run.reaction_unique(each.item).all())
            for unit, values in zip(UNITS, frames.run.reaction(each.item), strict=True):
                values = np.nan_to_num(frames.interpolated(values))
                found.append(Arrows(layer, unit, each.item.name, index, point, values, unique))
    arms = {"force": 1.0, "torque": length}
    largest = max((size(one) / arms[one.unit] for one in found), default=0.0)
    return [one for one in found if size(one) / arms[one.unit] > NONE * largest]


def size(one: Arrows) -> float:
    """The largest component."""
    return float(np.abs(one.values).max(initial=0.0))
