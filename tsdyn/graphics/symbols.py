"""What a page draws: shapes of bodies, and symbols of constraints and forces by kind, to scale."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..constraints import PlaneContact
from ..elements.joint import across
from ..elements.markers import POINT
from ..errors import InvalidArgument
from ..shapes import AXES, Box, Capsule, Geometry, Mesh, Sphere, pieces_of

if TYPE_CHECKING:
    from collections.abc import Sequence

# What a page draws: parts that move with a body, and links that stretch between points of two bodies.

UNIT = {"box": np.ones(3), "cylinder": np.array([2.0, 2.0, 1.0]), "sphere": np.full(3, 2.0)}  # dimensions, m
OUTSIDE = 1.05  # of a half width: a joint beyond it is joined to the body by a rod
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
    contact: int | None = None  # number of the contact whose state colours it

    @property
    def reach(self) -> float:
        """A distance from the centroid of the body beyond which there is nothing of it, m; of no mesh."""
        return float(np.linalg.norm(self.position) + np.linalg.norm(UNIT[self.kind] * self.size) / 2.0)

    def holds(self, point: Any) -> bool:
        """Whether a point of the body, (3,), is within the cuboid about it; true of a mesh."""
        if self.kind not in UNIT:
            return True
        inside = np.abs(np.asarray(self.rotation).T @ (point - self.position))
        return bool((inside <= OUTSIDE * UNIT[self.kind] * self.size / 2.0).all())

    def data(self) -> dict[str, Any]:
        """For the page: the columns of rotation times size, then position."""
        columns = (np.asarray(self.rotation) * np.asarray(self.size)).T
        matrix = rounded([*columns.ravel(), *self.position])
        data = {"layer": self.layer, "kind": self.kind, "body": self.body, "colour": self.colour, "matrix": matrix}
        return data if self.contact is None else data | {"contact": self.contact}


class Connector(NamedTuple):
    """A rod or a coil between a point of each of two bodies."""

    kind: str  # "cylinder", "coil"
    a: int
    point_a: Any  # (3,), m
    b: int
    point_b: Any
    radius: float
    colour: str
    layer: str = "joints"

    @property
    def ends(self) -> tuple[tuple[int, Any], tuple[int, Any]]:
        """Body and point of both ends."""
        return (self.a, self.point_a), (self.b, self.point_b)

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


# Shapes of bodies: those that they have or are given, or the uniform solid with the body's inertia, and rods.
#
# Of principal inertia (A, B, C) and mass m: a cuboid with the edges a^2 = 6 (B + C - A) / m, ...; where two are equal,
# a cylinder, r^2 = 2 C / m, h^2 = 6 (2 A - C) / m; where three are, a ball, r^2 = 5 A / (2 m). So these shapes are
# exact. A solid that extends far beyond the joints of its body, or would hide them in a link of two joints, is drawn
# smaller, in proportion. Rods join the centroid to the points of the joints, those outside of a shape that the body was
# made of.

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
    return [Part("bodies", solid.kind, index, colour, centre, solid.rotation, solid.size), *rods(index, points, reach)]


def rods(index: int, points: Any, reach: float) -> list[Part]:
    """Rods from the centroid of a body to points (j, 3) away from it."""
    colour, radius = COLOURS[index % len(COLOURS)], ROD * reach
    long = [(point, length) for point in points if (length := np.linalg.norm(point)) > radius]
    return [
        Part("bodies", "cylinder", index, colour, point / 2, along(point), (radius, radius, length))
        for point, length in long
    ]


def given(index: int, pieces: Sequence[Geometry], meshes: list[Mesh]) -> list[Part]:
    """Parts of a body, or of the ground, with shapes of its own; meshes are appended to `meshes`."""
    parts = []
    for piece in pieces:
        colour = piece.colour or (COLOURS[index % len(COLOURS)] if index >= 0 else "gray")
        for kind, place, rotation, size in _units(piece):
            if kind == "mesh":
                kind = f"mesh{len(meshes)}"
                meshes.append(piece)  # type: ignore[arg-type]
            parts.append(Part("bodies", kind, index, colour, place, rotation, size))
    return parts


def _units(piece):
    """(kind, position, rotation, size) of the unit shapes that a shape is made of."""
    place, rotation = piece.position, piece.rotation
    if isinstance(piece, Box):
        return [("box", place, rotation, piece.size)]
    if isinstance(piece, Sphere):
        return [("sphere", place, rotation, np.full(3, piece.radius))]
    if isinstance(piece, Mesh):
        return [("mesh", place, rotation, np.ones(3))]
    rotation, r = rotation @ AXES[piece.axis], piece.radius
    end = 0.5 * piece.length * rotation[:, 2] if isinstance(piece, Capsule) else None
    caps = [] if end is None else [("sphere", place + side * end, rotation, np.full(3, r)) for side in (-1.0, 1.0)]
    return [("cylinder", place, rotation, np.array([r, r, piece.length])), *caps]


def by_body(shapes: Any, handles: Any, ground: Any) -> dict[int, Sequence[Geometry]]:
    """What a user gave as shapes, by the index of the body, -1 for the ground."""
    if not isinstance(shapes, dict):
        raise InvalidArgument(f"view: shapes must be a dictionary, body -> shape, got {shapes!r}.")
    found = {}
    for key, value in shapes.items():
        is_ground = key is ground or (isinstance(key, str) and key == "ground")
        body = ground if is_ground else handles.body(key)
        index = -1 if is_ground else handles.bodies.index(body)
        found[index] = pieces_of(value, f"view: shapes[{body.name!r}]")
    return found


# Where joints and forces attach to bodies, and how large things are: what symbols are scaled by.

SAME = 1e-9  # distance of points that are one, per reach
PER_MOTION = 0.1  # reach of a lone point mass, per extent of the motion


class Attached(NamedTuple):
    """A constraint or force with its places; a and b are indices of bodies, -1: ground, or no second body."""

    item: Any
    a: int
    b: int
    places: dict[str, Any]  # argument of each marker -> coordinates (3,), frame of its body
    points: dict[str, Any]  # "a", "b" -> the first point there; absent where it has none
    path: tuple[tuple[int, Any], ...] = ()  # of a rope or cable: the body and the place of each point
    contact: int | None = None  # its number, of a contact

    def point(self, letter: str) -> Any:
        """The first point on a body, its centroid where there is none."""
        return self.points.get(letter, np.zeros(3))


def attached(packed: Any) -> tuple[list[Attached], list[Attached]]:
    """Constraints, without the normalisations, and forces of a packed scene."""
    index = {id(body): i for i, body in enumerate(packed.bodies)}

    def one(item, coordinates):
        points = {m.body: s for m, s in reversed([*zip(item.markers, coordinates, strict=True)]) if m.code == POINT}
        places = {m.argument: s for m, s in zip(item.markers, coordinates, strict=True)}
        path = tuple((index.get(id(body), -1), np.array(s)) for body, s in getattr(item, "points", ()))
        return Attached(item, index.get(id(item.a), -1), index.get(id(item.b), -1), places, points, path)

    constraints = [one(member.constraint, member.coordinates) for member in packed.members]
    constraints = [each for each in constraints if not getattr(each.item, "normalises", False)]
    opening = {id(law.contact) for law in packed.laws}  # or a plane that ought to push
    has_state = [i for i, each in enumerate(constraints) if id(each.item) in opening or type(each.item) is PlaneContact]
    for number, i in enumerate(has_state):
        constraints[i] = constraints[i]._replace(contact=number)
    return constraints, [one(load.force, load.coordinates) for load in packed.loads]


def joint_points(items: list[Attached], count: int) -> list[list[Any]]:
    """For each body the different points where something attaches."""
    found: list[list[Any]] = [[] for _ in range(count)]
    for each in items:
        for index, letter in ((each.a, "a"), (each.b, "b")):
            if index >= 0 and letter in each.points:
                found[index].append(each.points[letter])
        for index, point in each.path:
            if index >= 0:
                found[index].append(point)
    return [_different(points) for points in found]


def _different(points):
    kept: list[Any] = []
    for point in points:
        if all(np.linalg.norm(point - other) > SAME * (1.0 + np.linalg.norm(point)) for other in kept):
            kept.append(point)
    return kept


def reaches(packed: Any, points: list[list[Any]], position: Any, hidden: set[int]) -> Any:
    """How far each body reaches from its centroid, m: to its farthest joint, or as its inertia does.

    Of point masses and hidden bodies, the median of the other bodies' reaches, or a part of the extent of the motion.
    """
    reach = np.zeros(len(packed.bodies))
    for i, body in enumerate(packed.bodies):
        if i in hidden:
            continue
        reach[i] = max((float(np.linalg.norm(point)) for point in points[i]), default=0.0)
        if reach[i] == 0.0 and body.dimension == 7:
            reach[i] = solid_of(packed.system.mass[i], packed.system.inertia[i].reshape(3, 3)).extent
    if (reach > 0.0).any():
        rest = float(np.median(reach[reach > 0.0]))
    else:
        rest = PER_MOTION * float(np.ptp(position.reshape(-1, 3), axis=0).max()) or 1.0
    return np.where(reach > 0.0, reach, rest)


# Marks of a violated constraint: its symbols in red, on both of its bodies, and a line from point to point.

VIOLATED = "#d33a2c"


def violation(each: Attached, drawn: list[Part | Connector], reach: float, apart: float) -> list[Part | Connector]:
    """Parts and links of a constraint that is violated, in place of those `drawn` of it; `reach` of a usual body, m."""
    red = [part._replace(colour=VIOLATED) for part in drawn]
    if not drawn or apart > APART * reach:
        r = SYMBOL * reach
        ends = [letter for letter in "ab" if letter in each.points]
        red += [_ball(each, r, letter)._replace(colour=VIOLATED) for letter in ends]
        red += [_link("cylinder", each, 0.3 * r, VIOLATED)] if len(ends) == 2 and apart > APART * reach else []
    return red


# Symbols of constraints and forces, by kind: a pin, a ball, a slider in its guide, a plane, a coil, a rope.

STEEL, DARK, COIL, PLANE = "#8a929b", "#3f464e", "#a0522d", "#9fb4c7"
SYMBOL = 0.08  # radius, per reach of the smaller body
APART = 1e-6  # distance of the points of an element that has no symbol of its own, per reach, that is shown by a line


def symbols(each: Attached, reach: Any, girth: Any, apart: float) -> list[Part | Connector]:
    """Parts and links of a constraint or force, that show outside of its bodies.

    reach and girth (b,), m, are those of all bodies; apart is the distance of its two points at the start, m.
    """
    bodies = [index for index in (each.a, each.b) if index >= 0]
    near = reach[bodies]
    radius = SYMBOL * min(near)
    split = apart > APART * min(near)
    if each.path:
        spans = ((*one, *other) for one, other in pairwise(each.path))
        return [Connector("cylinder", *span, 0.15 * radius, COIL) for span in spans]
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
    return Connector(kind, each.a, each.point("a"), each.b, each.point("b"), radius, colour)


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
    return [plate, ball._replace(contact=each.contact)]


THIN, MARK = 0.03, 0.06  # of a disc's radius: thickness of a thin one, and what marks it


def _surface(each, kind, rotation, size, marks):
    """A rolling surface on a, with dark marks that show how it turns, over its plane on b; marks: (place, size)."""
    colour, centre, parts = COLOURS[each.a % len(COLOURS)], each.point("a"), []
    for shape, place, widths in [(kind, np.zeros(3), size), *marks]:
        tone = DARK if parts else colour
        parts.append(Part("bodies", shape, each.a, tone, centre + rotation @ place, rotation, np.array(widths)))
    return parts


def _ellipsoid(each, axes, size):
    """With dots at the ends of its semi-axes."""
    dot = 2.0 * MARK * min(size)
    marks = [("sphere", sign * np.array(size) * one, (dot, dot, dot)) for one in np.eye(3) for sign in (-1.0, 1.0)]
    return _surface(each, "sphere", axes, size, marks)


def _floor(each, r):
    """The plane of a body; that of the ground is left to the grid."""
    return [] if each.b < 0 else _plane(each, r)[:1]


def _rolling_disc(each, r):
    """With a spoke from the centre to the rim, on both sides."""
    tyre, whole = each.item.tyre_radius, each.item.radius + each.item.tyre_radius
    thick = max(2.0 * tyre, THIN * whole)
    spoke = ("box", np.array([0.5 * whole, 0, 0]), (whole, MARK * whole, 1.5 * thick))
    return [*_floor(each, r), *_surface(each, "cylinder", along(each.places["axis_a"]), (whole, whole, thick), [spoke])]


def _rolling_ball(each, r):
    return [*_floor(each, r), *_ellipsoid(each, np.eye(3), (each.item.radius,) * 3)]


def _rolling_ellipsoid(each, r):
    return [*_floor(each, r), *_ellipsoid(each, each.item.axes_a.T, each.item.semi_axes)]


def _ball_on_cylinder(each, r):
    """Over its cylinder; in a hollow one, over a line along its axis."""
    radius = 0.2 * r if each.item.inside else each.item.cylinder_radius
    length = 30.0 * r if each.item.inside else 8.0 * each.item.cylinder_radius
    cylinder = _part(each, "b", "cylinder", each.places["axis_b"], (radius, radius, length), PLANE)
    return [cylinder, *_ellipsoid(each, np.eye(3), (each.item.radius,) * 3)]


def _sphere_contact(each, r):
    """The balls, in the colours of their bodies, and the plane of a body; a hollow ball isn't drawn."""
    parts = _floor(each, r) if each.item.radius_b is None else []
    for letter, index in (("a", each.a), ("b", each.b)):
        radius = getattr(each.item, f"radius_{letter}")
        if radius is not None and not (letter == "b" and each.item.inside):
            colour = PLANE if index < 0 else COLOURS[index % len(COLOURS)]
            parts.append(_ball(each, radius, letter)._replace(layer="bodies", colour=colour))
    return parts


def contact_mark(index, radius, contact):
    """A ball where surfaces touch; index of the point, that is listed after the bodies; contact: as of `Part`."""
    return Part("joints", "sphere", index, VIOLATED, np.zeros(3), np.eye(3), np.full(3, radius), contact)


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
    "SphereContact": _sphere_contact,
    "Planar": _plane,
    "PointOnLine": _line,
    "RollingDisc": _rolling_disc,
    "RollingBall": _rolling_ball,
    "RollingEllipsoid": _rolling_ellipsoid,
    "RollingBallOnCylinder": _ball_on_cylinder,
    "Spring": _spring,
    "Bushing": _fixed,
}
SURFACES = ("RollingDisc", "RollingBall", "RollingEllipsoid", "RollingBallOnCylinder")  # shapes of their own
THROUGH = ("Spherical", "Revolute")  # larger than the bodies are thick
