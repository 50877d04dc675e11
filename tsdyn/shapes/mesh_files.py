"""Triangles of STL and OBJ files."""

from __future__ import annotations

from array import array
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import regular_files
from ..errors import InvalidArgument, InvalidFile

if TYPE_CHECKING:
    from ..hints import Floats

HEADER = 84  # bytes before the triangles of a binary STL file, the last four their number
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
LARGEST = 1 << 28  # bytes of a file: five million triangles of a binary STL file
MOST = 1 << 23  # vertices or triangles of an OBJ file: 200 MB of numbers each
LONGEST = 1 << 16  # bytes of a line of text: a polygon of ten thousand corners


def read(path: Any) -> tuple[Floats, Any]:
    """Vertices (v, 3) and faces (f, 3) of a file.

    Raises
    ------
    InvalidArgument
        If it is no path of an STL or OBJ file.
    StorageError
        If the file can't be read, is too large or no regular file.
    InvalidFile
        If it has no triangles, or isn't in its format.
    """
    try:
        path = Path(path)
    except TypeError as error:
        raise InvalidArgument(f"Mesh: source must be the path of a file or (vertices, faces): {error}.") from error
    kind = path.suffix.lower()
    if kind not in (".stl", ".obj"):
        raise InvalidArgument(
            f"Mesh: source must be an .stl or .obj file, got {path.name!r}; convert files of other formats."
        )
    data = regular_files.read(path, LARGEST)
    try:
        vertices, faces = _obj(data) if kind == ".obj" else _stl(data)
    except (ValueError, IndexError, OverflowError) as error:
        raise InvalidFile(f"Mesh: {path.name} is no {kind} file that can be read: {error}.") from error
    if not len(faces):
        raise InvalidFile(f"Mesh: {path.name} has no triangles.")
    return vertices, faces


def _lines(data, encoding):
    """The words of each line."""
    for line in BytesIO(data):
        if len(line) > LONGEST:
            raise ValueError(f"a line has more than {LONGEST} bytes")
        yield line.decode(encoding).split()


def _stl(data):
    if len(data) >= HEADER and len(data) == HEADER + TRIANGLE.itemsize * int.from_bytes(data[80:HEADER], "little"):
        corners = np.frombuffer(data, TRIANGLE, offset=HEADER)["corners"].reshape(-1, 3)
    else:
        numbers = array("d")
        for words in _lines(data, "ascii"):
            if words[:1] == ["vertex"]:
                x, y, z = words[1:4]
                numbers.extend((float(x), float(y), float(z)))
        corners = np.array(numbers).reshape(-1, 3)
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    return vertices.astype(float), faces.reshape(-1, 3)


def _obj(data):
    """Polygons become fans of triangles; an index counts from 1, or back from the last vertex so far."""
    vertices, faces = array("d"), array("q")
    for word, *rest in filter(None, _lines(data, "utf-8")):
        if word == "v":
            x, y, z = rest[:3]
            vertices.extend((float(x), float(y), float(z)))
        elif word == "f":
            corners = [int(x.partition("/")[0]) for x in rest]
            corners = [i - 1 if i > 0 else len(vertices) // 3 + i for i in corners]
            for i, j in pairwise(corners[1:]):
                faces.extend((corners[0], i, j))
        if max(len(vertices), len(faces)) > 3 * MOST:
            raise ValueError(f"there are more than {MOST} vertices or triangles")
    return np.array(vertices).reshape(-1, 3), np.array(faces).reshape(-1, 3)
