"""Shapes to draw: cuboid, ball, cylinder and triangle mesh, without mass, anywhere in the frame of a body."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..calls import fitting_constructor
from ..errors import InvalidArgument, InvalidFile
from ..validation import floats, positive, vector3
from .mesh_files import read

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..hints import ArrayLike, Floats, Place

AXES = {  # name -> frame whose third column is the axis
    "x": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "y": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "z": np.eye(3),
}
COLOURS = ("black", "blue", "brown", "cyan", "gray", "green", "orange", "purple", "red", "white", "yellow")


@dataclass(frozen=True, eq=False, kw_only=True)
class Geometry:
    """Base of what is drawn.

    Attributes
    ----------
    position : ndarray (3,), m
        Of its centre, or of the origin of a mesh, in the frame of the body, which is at the centroid.
    rotation : ndarray (3, 3)
        From its own frame to that of the body; a scipy Rotation may be given.
    colour : str
        "#rrggbb" or a name, such as "red"; by default the viewer chooses one.
    """

    position: Any = (0.0, 0.0, 0.0)
    rotation: Any = None
    colour: str = ""

    def __post_init__(self) -> None:
        what = type(self).__name__
        self._set(position=vector3(self.position, f"{what}: position (m)", InvalidArgument))
        self._set(rotation=np.eye(3) if self.rotation is None else rotation_of(self.rotation, what))
        if str(self.colour) not in ("", *COLOURS) and not re.fullmatch("#[0-9a-fA-F]{6}", str(self.colour)):
            names = ", ".join(COLOURS)
            raise InvalidArgument(f"{what}: colour must be '#rrggbb' or one of {names}, got {self.colour!r}.")

    def _set(self, **values):
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def moved(self, by: ArrayLike) -> Self:
        """The same shape elsewhere; by (3,), m."""
        return replace(self, position=self.position + vector3(by, "moved: by (m)", InvalidArgument))

    def rotated(self, rotation: Any) -> Self:
        """The shape turned about the origin, by a matrix (3, 3) or a scipy Rotation."""
        A = rotation_of(rotation, type(self).__name__)
        return replace(self, position=A @ self.position, rotation=A @ self.rotation)


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Box(Geometry):
    """A cuboid to draw; size (3,), m: its edges along x, y, z. `position`, `rotation`, `colour`: see below.

    Parameters
    ----------
    size : array_like (3,), m
    position : array_like (3,), m
        Of its centre in the frame of the body, which is at the centroid.
    rotation : array_like (3, 3) or scipy Rotation
        From its own frame to that of the body.
    colour : str
        "#rrggbb" or a name, such as "red".

    Raises
    ------
    InvalidArgument
        If a length is not positive and finite, or position, rotation or colour is inadmissible.

    Examples
    --------
    >>> import tsdyn as ts
    >>> seat = ts.shapes.Box((0.4, 0.4, 0.05), position=(0, 0, 0.45), colour="brown")
    >>> print(seat.size)
    [0.4  0.4  0.05]
    """

    size: Any

    def __post_init__(self) -> None:
        super().__post_init__()
        size = vector3(self.size, "Box: size (m)", InvalidArgument)
        if not (size > 0.0).all():
            raise InvalidArgument(f"Box: size must be three positive lengths in m, got {self.size!r}.")
        self._set(size=size)


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Sphere(Geometry):
    """A ball to draw; radius, m. Other arguments and errors as for `Box`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.shapes.Sphere(0.1, position=(0, 0, 1)).radius
    0.1
    """

    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set(radius=positive(self.radius, "Sphere: radius (m)"))


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Cylinder(Geometry):
    """A cylinder to draw, about its centre along the axis "x", "y" or "z". Other arguments and errors as for `Box`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> wheel = ts.shapes.Cylinder(0.3, 0.05, axis="y", colour="#444444")
    >>> wheel.radius, wheel.length
    (0.3, 0.05)
    """

    radius: float
    length: float
    axis: str = field(default="z")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.axis, str) or self.axis not in AXES:
            raise InvalidArgument(f"Cylinder: axis must be 'x', 'y' or 'z', got {self.axis!r}.")
        self._set(radius=positive(self.radius, "Cylinder: radius (m)"))
        self._set(length=positive(self.length, "Cylinder: length (m)"))


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Mesh(Geometry):
    """A triangle mesh to draw. `position`, `rotation`, `colour` and errors as for `Box`.

    Parameters
    ----------
    source : path, or (vertices, faces)
        An STL or OBJ file; or vertices (v, 3) and the vertices of each triangle (f, 3), of int.
    scale : float
        Metres a unit of the file; 0.001 for a file in millimetres.

    Raises
    ------
    InvalidArgument
        If an array has another shape, or an index is out of range.
    StorageError
        If the file can't be read, is too large (256 MB) or no regular file.
    InvalidFile
        If its content is wrong.

    Examples
    --------
    >>> import tsdyn as ts
    >>> vertices = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    >>> mesh = ts.shapes.Mesh((vertices, ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))), scale=0.001)
    >>> print(mesh.vertices.max())
    0.001
    """

    source: Place | Sequence[ArrayLike]
    scale: float = 1.0
    vertices: Floats = field(init=False, repr=False)
    faces: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        given = isinstance(self.source, (tuple, list))
        pair, wrong = (self.source, InvalidArgument) if given else (read(self.source), InvalidFile)
        if len(pair) != 2:
            raise InvalidArgument(f"Mesh: source must be a file or (vertices, faces), got {len(pair)} parts.")
        vertices, indices = floats(pair[0]), floats(pair[1])
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise wrong(f"Mesh: vertices must be finite and have the shape (v, 3), got {vertices.shape}.")
        faces = indices.astype(int) if np.isfinite(indices).all() else np.zeros(0)
        if faces.ndim != 2 or faces.shape[1] != 3 or (faces != indices).any():
            raise wrong(f"Mesh: faces must be whole numbers of the shape (f, 3), got {indices.shape}.")
        if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
            raise wrong(f"Mesh: faces must have indices from 0 to {len(vertices) - 1}, one triangle or more.")
        self._set(vertices=positive(self.scale, "Mesh: scale") * vertices, faces=faces)


def rotation_of(value: Any, what: str) -> Floats:
    """A rotation matrix (3, 3), of one or of a scipy Rotation."""
    A = floats(value.as_matrix() if hasattr(value, "as_matrix") else value)
    if A.shape != (3, 3) or not np.abs(A @ A.T - np.eye(3)).max() < 1e-9 or np.linalg.det(A) < 0.0:
        raise InvalidArgument(
            f"{what}: rotation must be a rotation matrix (3, 3) or one scipy Rotation, got {value!r}."
        )
    return A
