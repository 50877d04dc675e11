"""Shapes of bodies: those that a user gives, or the solid of uniform density with the body's inertia, and rods.

Of principal inertia (A, B, C) and mass m: a cuboid with the edges a^2 = 6 (B + C - A) / m, ...; where two are equal, a
cylinder, r^2 = 2 C / m, h^2 = 6 (2 A - C) / m; where three are, a ball, r^2 = 5 A / (2 m). So these shapes are exact.
A solid that extends far beyond the joints of its body, or would hide them in a link of two joints, is drawn smaller, in
proportion. Rods join the centroid to the points of the joints.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..errors import InvalidArgument
from ..shapes import Box, Cylinder, Mesh, Shape, Sphere
from ..shapes.geometry import AXES, Geometry
from .parts import UNIT, Part, along

COLOURS = ("#4c8bc9", "#e0893b", "#57a773", "#c96a9b", "#b9a23c", "#7d77c7", "#4fb0b5", "#c4605a")
EQUAL = 1e-6  # relative difference of principal inertias
THINNEST = 0.04  # of the least edge, per largest
FAR, SMALL = 2.0, 0.4  # a solid that extends further than FAR reaches is drawn to extend SMALL
SLIM = 0.5  # thickness of a link at most, per reach
ROD = 0.05  # radius, per reach
POINT_MASS = 0.15  # radius, per reach


class Solid(NamedTuple):
    """A uniform solid with the inertia of a body; extent: half its largest dimension, m."""

    kind: str
    rotation: Any
    size: np.ndarray

    @property
    def extent(self) -> float:
        """Half the largest dimension, m."""
        return float(self.widths.max()) / 2.0

    @property
    def girth(self) -> float:
        """The second largest dimension, m."""
        return float(np.sort(self.widths)[1])

    @property
    def widths(self) -> Any:
        """Dimensions (3,), m."""
        return UNIT[self.kind] * self.size


def drawn_solid(mass: float, inertia: Any, points: Any, reach: float) -> Solid:
    """The solid of a body as it is drawn; points (j, 3) are where its joints are, m."""
    solid = solid_of(mass, inertia)
    factor = SMALL * reach / solid.extent if solid.extent > FAR * reach else 1.0
    if sum(np.linalg.norm(point) > ROD * reach for point in points) == 2:
        factor = min(factor, SLIM * reach / solid.girth)
    return solid._replace(size=factor * solid.size)


def solid_of(mass: float, inertia: Any) -> Solid:
    """The solid of uniform density with a mass, kg, and an inertia (3, 3), kg m^2."""
    moments, axes = np.linalg.eigh(inertia)
    moments = np.maximum(moments, 0.0)  # that of a rod may be rounded below
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    least = EQUAL * moments[2]
    if moments[2] - moments[0] <= least:
        return Solid("sphere", np.eye(3), np.full(3, np.sqrt(2.5 * moments[2] / mass)))
    for i, j, k in ((0, 1, 2), (1, 2, 0)):  # i and j across, k along
        if abs(moments[i] - moments[j]) <= least:
            radius, length = np.sqrt(2.0 * moments[k]), np.sqrt(max(0.0, 6.0 * (2.0 * moments[i] - moments[k])))
            radius, length = max(radius, THINNEST * length / 2.0), max(length, THINNEST * 2.0 * radius)
            return Solid("cylinder", along(axes[:, k]), np.array([radius, radius, length]) / np.sqrt(mass))
    edges = np.sqrt(np.maximum(0.0, 6.0 * (moments.sum() - 2.0 * moments) / mass))
    return Solid("box", axes, np.maximum(edges, THINNEST * edges.max()))


def derived(index: int, solid: Solid | None, points: Any, reach: float) -> list[Part]:
    """Parts of a body without a shape of its own; points (j, 3) are where its joints are. None: a point mass."""
    colour, eye, centre = COLOURS[index % len(COLOURS)], np.eye(3), np.zeros(3)
    if solid is None:
        return [Part("bodies", "sphere", index, colour, centre, eye, np.full(3, POINT_MASS * reach))]
    parts = [Part("bodies", solid.kind, index, colour, centre, solid.rotation, solid.size)]
    for point in points:
        length, radius = np.linalg.norm(point), ROD * reach
        if length > radius:
            parts.append(Part("bodies", "cylinder", index, colour, point / 2, along(point), (radius, radius, length)))
    return parts


def given(index: int, shapes: Any, meshes: list[Mesh], name: str) -> list[Part]:
    """Parts of a body, or of the ground, with shapes of its user's; meshes are appended to `meshes`."""
    parts = []
    for piece in _pieces(shapes, name):
        rotation = piece.rotation
        if isinstance(piece, Box):
            kind, size = "box", piece.size
        elif isinstance(piece, Sphere):
            kind, size = "sphere", np.full(3, piece.radius)
        elif isinstance(piece, Cylinder):
            kind, size = "cylinder", np.array([piece.radius, piece.radius, piece.length])
            rotation = rotation @ AXES[piece.axis]
        else:
            kind, size = f"mesh{len(meshes)}", np.ones(3)
            meshes.append(piece)
        colour = piece.colour or (COLOURS[index % len(COLOURS)] if index >= 0 else "gray")
        parts.append(Part("bodies", kind, index, colour, piece.position, rotation, size))
    return parts


def _pieces(shapes, name):
    """The geometry, in the frame of the body, of a shape or a sequence of them."""
    pieces = []
    for shape in shapes if isinstance(shapes, (tuple, list)) else [shapes]:
        if isinstance(shape, Shape):
            pieces += [piece.moved(-shape.centroid) for piece in shape.pieces]
        elif isinstance(shape, Geometry):
            pieces.append(shape)
        else:
            raise InvalidArgument(
                f"view: shapes[{name!r}] must be one of ts.shapes, such as ts.shapes.Box((1, 1, 1)), or a list of "
                f"them, got {shape!r}."
            )
    return pieces


def by_body(shapes: Any, handles: Any, ground: Any) -> dict[int, Any]:
    """What a user gave as shapes, by the index of the body, -1 for the ground."""
    if not isinstance(shapes, dict):
        raise InvalidArgument(f"view: shapes must be a dictionary, body -> shape, got {shapes!r}.")
    found = {}
    for key, value in shapes.items():
        if key is ground or (isinstance(key, str) and key == "ground"):
            found[-1] = value
        else:
            found[handles.bodies.index(handles.body(key))] = value
    return found
