"""Symbols of constraints and forces, by kind: a pin, a ball, a slider in its guide, a plane, a coil."""

from __future__ import annotations

from typing import Any

import numpy as np

from .parts import Link, Part, along
from .sizes import Attached

STEEL, DARK, COIL, PLANE = "#8a929b", "#3f464e", "#a0522d", "#9fb4c7"
SYMBOL = 0.08  # radius, per reach of the smaller body
APART = 1e-6  # distance of the points of an element that has no symbol of its own, per reach, that is shown by a line


def symbols(each: Attached, reach: Any, girth: Any, apart: float) -> list[Part | Link]:
    """Parts and links of a constraint or force, that show outside of its bodies.

    reach and girth (b,), m, are those of all bodies; apart is the distance of its two points at the start, m.
    """
    bodies = [index for index in (each.a, each.b) if index >= 0]
    near = reach[bodies]
    radius = SYMBOL * min(near)
    split = apart > APART * min(near)
    for kind in type(each.item).__mro__:
        if kind.__name__ == "RotationMotor" and split:  # its joint says where the axis is
            return []
        if kind.__name__ in DRAWN:
            return DRAWN[kind.__name__](each, radius, *([girth[bodies]] if kind.__name__ in THROUGH else []))
    if getattr(each.item, "law", None) is not None or not each.points:  # forces are shown by arrows
        return []
    line = split and len(each.points) == 2
    return [_ball(each, radius, "a"), *([_link("cylinder", each, 0.2 * radius, DARK)] if line else [])]


def _part(each, letter, kind, axis, size, colour=STEEL, shift=0.0):
    """A part at a point of the element, its z along an axis."""
    rotation = np.eye(3) if axis is None else along(axis)
    position = each.point(letter) + shift * rotation[:, 2]
    return Part("joints", kind, each.a if letter == "a" else each.b, colour, position, rotation, size)


def _link(kind, each, radius, colour):
    return Link(kind, each.a, each.point("a"), each.b, each.point("b"), radius, colour)


def _ball(each, r, letter="a"):
    return _part(each, letter, "sphere", None, (r, r, r), DARK)


def _spherical(each, r, girth):
    return [_ball(each, max(1.2 * r, min(0.55 * min(girth), 3.0 * r)))]


def _revolute(each, r, girth):
    """A pin along the axis."""
    return [
        _part(each, "a", "cylinder", each.places["axis_a"], (r, r, max(3.0 * r, min(1.3 * max(girth), 8.0 * r))), DARK)
    ]


def _motor(each, r):
    """A disc across the axis."""
    return [_part(each, "a", "cylinder", each.places["axis_a"], (2.0 * r, 2.0 * r, 1.2 * r))]


def _cylindrical(each, r):
    """A shaft on a in a sleeve on b."""
    shaft = _part(each, "a", "cylinder", each.places["axis_a"], (0.5 * r, 0.5 * r, 14.0 * r), DARK)
    return [shaft, _part(each, "b", "cylinder", each.places["axis_b"], (r, r, 4.0 * r))]


def _translational(each, r):
    """A guide on a, a slider on b."""
    guide = _part(each, "a", "box", each.places["axis_a"], (0.7 * r, 0.7 * r, 16.0 * r), DARK)
    return [guide, _part(each, "b", "box", each.places["axis_b"], (2.2 * r, 2.2 * r, 4.0 * r))]


def _universal(each, r):
    """A cross of two pins."""
    return [
        _part(each, letter, "cylinder", each.places[f"axis_{letter}"], (0.6 * r, 0.6 * r, 4.0 * r), DARK)
        for letter in "ab"
    ]


def _fixed(each, r):
    return [_part(each, "a", "box", None, (2.0 * r, 2.0 * r, 2.0 * r), DARK)]


def _distance(each, r):
    """A rod between two balls."""
    return [_ball(each, 0.5 * r, "a"), _ball(each, 0.5 * r, "b"), _link("cylinder", each, 0.25 * r, STEEL)]


def _plane(each, r):
    """A plate on b under a ball on a."""
    axis = each.places.get("normal_b", each.places.get("axis_b"))
    plate = _part(each, "b", "box", axis, (30.0 * r, 30.0 * r, 0.2 * r), PLANE, shift=-0.1 * r)
    return [plate, _ball(each, 0.8 * r)]


def _contact(each, r):
    """A plane, and a ball that shows whether it pushes."""
    plate, ball = _plane(each, r)
    return [plate, ball._replace(contact=True)]


def _line(each, r):
    """A wire on b through a ball on a."""
    return [_part(each, "b", "cylinder", each.places["axis_b"], (0.3 * r, 0.3 * r, 30.0 * r)), _ball(each, r)]


def _spring(each, r):
    return [_link("coil", each, 0.8 * r, COIL)]


DRAWN: dict[str, Any] = {
    "Spherical": _spherical,
    "Revolute": _revolute,
    "RotationMotor": _motor,
    "Cylindrical": _cylindrical,
    "Screw": _cylindrical,
    "Translational": _translational,
    "TranslationMotor": lambda each, r: [_link("cylinder", each, 0.4 * r, STEEL)],
    "Universal": _universal,
    "Fixed": _fixed,
    "Distance": _distance,
    "PlaneContact": _contact,
    "Planar": _plane,
    "PointOnLine": _line,
    "Spring": _spring,
    "Bushing": _fixed,
}
THROUGH = ("Spherical", "Revolute")  # larger than the bodies are thick
