"""Mass and inertia of shapes of uniform density: box, sphere, cylinder, rod, from_mesh, and what they compose."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting, fitting_constructor
from ..errors import InvalidArgument
from ..maths.mesh_integrals import moments
from ..validation import number, positive, vector3
from .geometry import AXES, Box, Cylinder, Geometry, Mesh, Sphere, rotation_of

if TYPE_CHECKING:
    from ..hints import ArrayLike, Axis, Floats, Rotation

DRAWN_RADIUS = 0.02  # of a rod, which has none, per length


@fitting_constructor
@dataclass(frozen=True, eq=False)
class Shape:
    """Mass, centroid and inertia of a shape; unpacked by `**` it is the mass and inertia of `Scene.add_body`.

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

    def keys(self) -> tuple[str, str]:
        """What `add_body` is given."""
        return ("mass", "inertia")

    def __getitem__(self, name: str) -> Any:
        return {"mass": self.mass, "inertia": self.inertia}[name]

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
        inertia = self.inertia + other.inertia + (self.mass * other.mass / mass) * _steiner(apart)
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


def _steiner(d):
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
