"""Triangles of STL and OBJ files."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidArgument

if TYPE_CHECKING:
    from ..hints import Floats

HEADER = 84  # bytes before the triangles of a binary STL file, the last four their number
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read(path: Any) -> tuple[Floats, Any]:
    """Vertices (v, 3) and faces (f, 3) of a file.

    Raises
    ------
    InvalidArgument
        If there is no such file, or it isn't an STL or OBJ file with triangles.
    """
    try:
        path = Path(path)
        data = path.read_bytes()
    except (OSError, TypeError) as error:
        raise InvalidArgument(f"Mesh: {path} can't be read: {getattr(error, 'strerror', None) or error}.") from error
    kind = path.suffix.lower()
    if kind not in (".stl", ".obj"):
        raise InvalidArgument(f"Mesh: {path.name} must be an .stl or .obj file; other formats can be converted.")
    try:
        vertices, faces = _obj(data.decode()) if kind == ".obj" else _stl(data)
    except (ValueError, IndexError) as error:
        raise InvalidArgument(f"Mesh: {path.name} is no {kind} file that can be read: {error}.") from error
    if not len(faces):
        raise InvalidArgument(f"Mesh: {path.name} has no triangles.")
    return vertices, faces


def _stl(data):
    if len(data) >= HEADER and len(data) == HEADER + TRIANGLE.itemsize * int.from_bytes(data[80:HEADER], "little"):
        corners = np.frombuffer(data, TRIANGLE, offset=HEADER)["corners"].reshape(-1, 3)
    else:
        words = (line.split() for line in data.decode("ascii").splitlines())
        corners = np.array([word[1:4] for word in words if word[:1] == ["vertex"]], float).reshape(-1, 3)
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    return vertices.astype(float), faces.reshape(-1, 3)


def _obj(text):
    """Polygons become fans of triangles; an index counts from 1, or back from the last vertex so far."""
    vertices, faces = [], []
    for line in text.splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif word == "f":
            corners = [int(x.partition("/")[0]) for x in rest]
            corners = [i - 1 if i > 0 else len(vertices) + i for i in corners]
            faces += [(corners[0], i, j) for i, j in pairwise(corners[1:])]
    return np.array(vertices, float).reshape(-1, 3), np.array(faces, int).reshape(-1, 3)
