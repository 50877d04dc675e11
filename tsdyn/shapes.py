"""Mass and inertia of shapes, and shapes to draw: scene.add_body(**ts.shapes.box((1, 2, 3), density=7850)).

`box`, `sphere`, `cylinder`, `capsule`, `rod` and `from_mesh` have mass and inertia; +, moved and rotated make one body
of several. `Box`, `Sphere`, `Cylinder`, `Capsule` and `Mesh` are geometry alone, for the viewer.
"""

from __future__ import annotations

import math
import re
from array import array
from dataclasses import dataclass, field, replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from . import validation
from .calls import fitting, fitting_constructor
from .errors import InvalidArgument, InvalidFile
from .maths.tolerances import NEGLIGIBLE
from .validation import floats, number, positive, vector3

if TYPE_CHECKING:
    from .hints import ArrayLike, Axis, Floats, Place, Rotation, Sequence

__all__ = [
    "Box", "Capsule", "Cylinder", "Mesh", "Shape", "Sphere", "box", "capsule", "cylinder", "from_mesh", "rod", "sphere",
]  # fmt: skip


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)


# Volume, centroid and second moments of a closed triangle mesh, and the check that it is closed.


def moments(vertices, faces):
    """Volume, m^3, centroid (3,), m, and the integral of x x^T about it (3, 3), m^5.

    Each triangle and a point inside the mesh span a tetrahedron of signed volume d / 6, d = a.(b x c), with

        integral of x x^T = d / 120 (a a^T + b b^T + c c^T + s s^T),  s = a + b + c

    Raises
    ------
    InvalidArgument
        If the mesh is not closed, not oriented or without volume.
    """
    x, triangles = _checked(vertices, faces)
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    size = np.abs(x - middle).max()
    corners = ((x - middle) / size)[triangles]
    a, b, c = corners.transpose(1, 0, 2)
    d = np.einsum("fi,fi->f", a, np.cross(b, c))
    volume = d.sum() / 6.0
    if abs(volume) <= NEGLIGIBLE:
        raise InvalidArgument("from_mesh: the mesh encloses no volume; all of its faces lie in a plane, or cancel out.")
    if volume < 0.0:
        raise InvalidArgument("from_mesh: all faces are oriented inward; reverse them: faces[:, ::-1].")
    total = corners.sum(axis=1)
    centroid = d @ total / (24.0 * volume)
    second = np.einsum("f,fki,fkj->ij", d, corners, corners) + np.einsum("f,fi,fj->ij", d, total, total)
    second = second / 120.0 - volume * np.outer(centroid, centroid)
    return volume * size**3, middle + size * centroid, 0.5 * (second + second.T) * size**5


def _checked(vertices, faces):
    """Return vertices (v, 3) and triangles (f, 3) of a closed mesh with consistent orientation."""
    x, given = floats(vertices), np.asarray(faces)
    if x.ndim != 2 or x.shape[1:] != (3,) or not np.isfinite(x).all():
        raise InvalidArgument("from_mesh: vertices must be finite numbers of shape (v, 3), in m.")
    if given.ndim != 2 or given.shape[1:] != (3,) or given.dtype.kind not in "iu" or not len(given):
        raise InvalidArgument(
            f"from_mesh: faces must be whole numbers of shape (f, 3), the vertices of each triangle; got shape "
            f"{given.shape}. Cut faces of more corners into triangles."
        )
    triangles = given.astype(np.int64)
    if triangles.min() < 0 or triangles.max() >= len(x):
        i = int(np.flatnonzero((triangles < 0).any(axis=1) | (triangles >= len(x)).any(axis=1))[0])
        raise InvalidArgument(f"from_mesh: face {i} is {given[i].tolist()}, and there are {len(x)} vertices, from 0.")
    ends = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if (ends[:, 0] == ends[:, 1]).any():
        i = int(np.flatnonzero(ends[:, 0] == ends[:, 1])[0]) // 3
        raise InvalidArgument(f"from_mesh: face {i} has a vertex twice, {given[i].tolist()}; leave it out.")
    forth, back = (ends[:, i] * len(x) + ends[:, 1 - i] for i in (0, 1))
    known, first, times = np.unique(forth, return_index=True, return_counts=True)
    if (times > 1).any():
        edge = ends[first[np.argmax(times > 1)]]
        raise InvalidArgument(
            f"from_mesh: faces {_faces_with(ends, edge)} go along the edge {edge.tolist()} the same way; reverse "
            "one, or remove a duplicate face."
        )
    open_ = np.flatnonzero(~np.isin(back, known))
    if open_.size:
        raise InvalidArgument(
            f"from_mesh: the mesh is not closed: the edge {ends[open_[0]].tolist()} of face {open_[0] // 3} belongs to "
            f"no other face ({open_.size} such edges). Vertices at the same place must have the same index: "
            "np.unique(vertices, axis=0, return_inverse=True) merges them."
        )
    return x, triangles


def _faces_with(ends, edge):
    """Return the faces that run along an edge in its direction."""
    return (np.flatnonzero((ends == edge).all(axis=1)) // 3).tolist()


# Triangles of STL and OBJ files.

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
    data = validation.read(path, LARGEST)
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


# Shapes to draw: cuboid, ball, cylinder, capsule and triangle mesh, without mass, anywhere in the frame of a body.

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

    def __deepcopy__(self, memo: Any) -> Self:
        return self  # nothing changes it, and a mesh is large

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
        what = type(self).__name__
        self._set(axis=_axis(what, self.axis), radius=positive(self.radius, f"{what}: radius (m)"))
        self._set(length=positive(self.length, f"{what}: length (m)"))


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Capsule(Cylinder):
    """A cylinder with a half ball on each end, to draw; length, m, is that of the cylinder. Otherwise as `Cylinder`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> shin = ts.shapes.Capsule(0.04, 0.3, axis="x")
    >>> shin.radius, shin.length
    (0.04, 0.3)
    """


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


DRAWN_RADIUS = 0.02  # of a rod, which has none, per length


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Shape:
    """Mass, centroid and inertia of a shape; unpacked by `**` it is mass, inertia and shape of `Scene.add_body`.

    Attributes
    ----------
    mass : float, kg
    inertia : ndarray (3, 3), kg m^2
        About the centroid, in axes parallel to the shape's own frame: those of the body.
    centroid : ndarray (3,), m
        In the shape's own frame. A point p of that frame is p - centroid in the body's.
    pieces : tuple of Geometry
        What the viewer draws, in the shape's own frame.

    Examples
    --------
    A hammer, its handle along z:

    >>> import tsdyn as ts
    >>> handle = ts.shapes.cylinder(0.015, 0.3, density=700)
    >>> head = ts.shapes.box((0.1, 0.03, 0.03), density=7850).moved((0, 0, 0.15))
    >>> hammer = handle + head
    >>> print(f"{hammer.mass:.3f} kg, centroid at z = {hammer.centroid[2]:.4f} m")
    0.855 kg, centroid at z = 0.1240 m
    >>> body = ts.Scene().add_body(**hammer)
    """

    mass: float
    inertia: Floats
    centroid: Floats
    pieces: tuple[Geometry, ...] = field(default=(), repr=False)

    def keys(self) -> tuple[str, ...]:
        """What `add_body` is given."""
        return ("mass", "inertia", "shape")

    def __getitem__(self, name: str) -> Any:
        return {"mass": self.mass, "inertia": self.inertia, "shape": self}[name]

    def moved(self, by: ArrayLike) -> Shape:
        """The same shape elsewhere in its frame; by (3,), m."""
        by = vector3(by, "shape.moved: by (m)", InvalidArgument)
        return Shape(self.mass, self.inertia, self.centroid + by, tuple(piece.moved(by) for piece in self.pieces))

    def rotated(self, rotation: ArrayLike | Rotation) -> Shape:
        """The shape turned about the origin of its frame, by a matrix (3, 3) or a scipy Rotation."""
        A = rotation_of(rotation, "shape.rotated")
        pieces = tuple(piece.rotated(A) for piece in self.pieces)
        return Shape(self.mass, A @ self.inertia @ A.T, A @ self.centroid, pieces)

    def __add__(self, other: Shape) -> Shape:
        if not isinstance(other, Shape):
            raise InvalidArgument(f"a shape can be added to a shape only, not to {other!r}.")
        mass = self.mass + other.mass
        apart = other.centroid - self.centroid
        centroid = self.centroid + (other.mass / mass) * apart
        inertia = self.inertia + other.inertia + (self.mass * other.mass / mass) * steiner(apart)
        return Shape(mass, inertia, centroid, self.pieces + other.pieces)


@fitting
def box(size: ArrayLike, *, mass: float | None = None, density: float | None = None) -> Shape:
    """A cuboid about its centre, edges along the axes.

    Parameters
    ----------
    size : array_like (3,), m
        Lengths of the edges along x, y, z.
    mass : float, kg
    density : float, kg/m^3
        Either of the two.

    Returns
    -------
    Shape

    Raises
    ------
    InvalidArgument
        If a length, mass or density is not positive and finite, or not one of mass and density is given.

    Examples
    --------
    >>> import tsdyn as ts
    >>> block = ts.shapes.box((1, 2, 3), mass=12.0)
    >>> print(block.inertia.diagonal())
    [13. 10.  5.]
    """
    edges = vector3(size, "box: size (m)", InvalidArgument)
    if not (edges > 0.0).all():
        raise InvalidArgument(f"box: size must be three positive lengths in m, got {size!r}.")
    m = _mass("box", float(edges.prod()), mass, density)
    squares = edges**2
    return _shape(m, (m / 12.0) * (squares.sum() - squares), Box(edges))


@fitting
def sphere(radius: float, *, inner: float = 0.0, mass: float | None = None, density: float | None = None) -> Shape:
    """A ball about its centre; with an inner radius, m, a hollow one. Other arguments and errors as for `box`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> print(ts.shapes.sphere(0.5, mass=10.0).inertia.diagonal().round(6))
    [1. 1. 1.]
    """
    a, b = _radii("sphere", radius, inner)
    m = _mass("sphere", 4.0 / 3.0 * math.pi * (a - b) * (a * a + a * b + b * b), mass, density)
    ratio = b / a  # (a^5 - b^5) / (a^3 - b^3), with a - b divided out
    share = (1 + ratio + ratio**2 + ratio**3 + ratio**4) / (1 + ratio + ratio**2)
    return _shape(m, np.full(3, 0.4 * m * a * a * share), Sphere(a))


@fitting
def cylinder(
    radius: float,
    length: float,
    *,
    axis: Axis = "z",
    inner: float = 0.0,
    mass: float | None = None,
    density: float | None = None,
) -> Shape:
    """A cylinder about its centre, along the axis "x", "y" or "z"; with an inner radius, m, a tube.

    Other arguments and errors as for `box`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> print(ts.shapes.cylinder(0.2, 1.0, axis="x", mass=6.0).inertia.diagonal().round(6))
    [0.12 0.56 0.56]
    """
    a, b = _radii("cylinder", radius, inner)
    length = positive(length, "cylinder: length (m)")
    m = _mass("cylinder", math.pi * (a - b) * (a + b) * length, mass, density)
    return _round(m, a * a + b * b, Cylinder(a, length, _axis("cylinder", axis)))


@fitting
def capsule(
    radius: float, length: float, *, axis: Axis = "z", mass: float | None = None, density: float | None = None
) -> Shape:
    """A cylinder with a half ball on each end, about its centre; length, m, is that of the cylinder.

    Other arguments and errors as for `cylinder`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> print(ts.shapes.capsule(0.5, 1.0, mass=5.0).inertia.diagonal().round(6))
    [1.5125 1.5125 0.575 ]
    """
    # of a half ball of mass h: its centroid is 3/8 r from its base, and the moment about that is 83/320 h r^2
    r, length = positive(radius, "capsule: radius (m)"), positive(length, "capsule: length (m)")
    axis, bar, cap = _axis("capsule", axis), math.pi * r * r * length, 2.0 / 3.0 * math.pi * r**3
    m = _mass("capsule", bar + 2.0 * cap, mass, density)
    bar, cap = m * bar / (bar + 2.0 * cap), m * cap / (bar + 2.0 * cap)
    across = 83.0 / 320.0 * r * r + (0.5 * length + 0.375 * r) ** 2
    inertia = np.full(3, bar * (3.0 * r * r + length**2) / 12.0 + 2.0 * cap * across)
    inertia["xyz".index(axis)] = 0.5 * bar * r * r + 0.8 * cap * r * r
    return _shape(m, inertia, Capsule(r, length, axis))


@fitting
def rod(length: float, *, axis: Axis = "z", mass: float) -> Shape:
    """A slender rod about its centre, along the axis "x", "y" or "z".

    It has no inertia about its axis, so a joint must constrain that rotation. For a rod with thickness use `cylinder`.

    Raises
    ------
    InvalidArgument
        If the length or mass is not positive and finite, or the axis is unknown.

    Examples
    --------
    >>> import tsdyn as ts
    >>> print(ts.shapes.rod(2.0, axis="x", mass=3.0).inertia.diagonal())
    [0. 1. 1.]
    """
    length = positive(length, "rod: length (m)")
    drawn = Cylinder(DRAWN_RADIUS * length, length, _axis("rod", axis))
    return _round(positive(mass, "rod: mass (kg)"), 0.0, drawn)


@fitting
def from_mesh(
    vertices: ArrayLike, faces: ArrayLike, *, mass: float | None = None, density: float | None = None
) -> Shape:
    """The solid bounded by a closed triangle mesh; exact to rounding.

    Parameters
    ----------
    vertices : array_like (v, 3), m
    faces : array_like (f, 3) of int
        Vertices of each triangle, counterclockwise as seen from outside. A cavity is bounded by triangles that are
        counterclockwise as seen from within it.
    mass, density : float
        As for `box`.

    Returns
    -------
    Shape
        Its `centroid` is in the frame of the vertices.

    Raises
    ------
    InvalidArgument
        If the mesh is not closed, its triangles don't turn the same way or all face inward, it has no volume, or an
        index is out of range. Self-intersections are not detected.

    Examples
    --------
    A tetrahedron:

    >>> import tsdyn as ts
    >>> vertices = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    >>> faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    >>> solid = ts.shapes.from_mesh(vertices, faces, density=600.0)
    >>> print(f"{solid.mass:.3f} kg", solid.centroid.round(6))
    100.000 kg [0.25 0.25 0.25]
    """
    volume, centroid, second = moments(vertices, faces)
    m = _mass("from_mesh", volume, mass, density)
    second = (m / volume) * second
    return Shape(m, np.trace(second) * np.eye(3) - second, centroid, (Mesh((vertices, faces)),))


def pieces_of(shapes: Any, what: str) -> tuple[Geometry, ...]:
    """The geometry, in the frame of the body, of a shape or a list of them; `what` it is given as, in messages.

    Raises
    ------
    InvalidArgument
        If something is none of the shapes of this module.
    """
    pieces: list[Geometry] = []
    for shape in shapes if isinstance(shapes, (tuple, list)) else [shapes]:
        if isinstance(shape, Shape):
            pieces += [piece.moved(-shape.centroid) for piece in shape.pieces]
        elif isinstance(shape, Geometry):
            pieces.append(shape)
        else:
            raise InvalidArgument(
                f"{what} must be one of ts.shapes, such as ts.shapes.Box((1, 1, 1)), or a list of them, got {shape!r}."
            )
    return tuple(pieces)


def _round(m, squares, drawn):
    """A body of revolution without taper: squares is the sum of both radii's."""
    inertia = np.full(3, m * (3.0 * squares + drawn.length**2) / 12.0)
    inertia["xyz".index(drawn.axis)] = 0.5 * m * squares
    return _shape(m, inertia, drawn)


def _axis(what, axis):
    if not isinstance(axis, str) or axis not in AXES:
        raise InvalidArgument(f"{what}: axis must be 'x', 'y' or 'z', got {axis!r}.")
    return axis


def _shape(mass, inertia, drawn):
    return Shape(mass, np.diag(inertia), np.zeros(3), (drawn,))


def steiner(d):
    """d.d I - d d^T."""
    return (d @ d) * np.eye(3) - np.outer(d, d)


def _radii(what, radius, inner):
    a, b = positive(radius, f"{what}: radius (m)"), number(inner)
    if not 0.0 <= b < a:
        raise InvalidArgument(f"{what}: inner must be a radius from 0 to less than {a:g} m, got {inner!r}.")
    return a, b


def _mass(what, volume, mass, density):
    if (mass is None) == (density is None):
        raise InvalidArgument(f"{what}: give either mass= in kg or density= in kg/m^3.")
    if mass is not None:
        return positive(mass, f"{what}: mass (kg)")
    return positive(density, f"{what}: density (kg/m^3)") * volume
