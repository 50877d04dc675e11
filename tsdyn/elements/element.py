"""Base of constraints and forces: two bodies, a name, markers, joint coordinates, membership in a scene."""

from __future__ import annotations

import contextlib
import warnings
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from inspect import CO_VARKEYWORDS, signature, unwrap
from itertools import pairwise
from types import MethodType
from typing import TYPE_CHECKING, Any, NamedTuple, Never, Self

import numpy as np

from ..calls import Placing, complete_docstring, complete_signature, fitting, fitting_constructor, line_of_user
from ..errors import InvalidConstraint, UnknownAttribute
from ..jit.kernels import NumbaError, kernel, twin
from ..maths import vectors
from ..maths.vectors import IDENTITY, unit
from ..validation import counted, demand_known, floats, label, listed, number, shown, shown_for_handle
from .bodies import Ground, PointMass, ground_point, named, new_name, rotation_matrix
from .markers import PARAMETERS, POINT, TURN, Marker, entries
from .tolerances import UNDIRECTED

if TYPE_CHECKING:
    from ..hints import AnyBody, ArrayLike, BodyLike, Floats, Function, Scene, Sequence, TsdynError


# Bookkeeping of the constraints and forces made for a scene: which were added, and under which names.

_may_be_idle = ContextVar("whether forces that are made may be zero", default=False)


@contextlib.contextmanager
def idle_forces(admitted):
    """A block in which a force may be made whose numbers are all zero: a file says what it says."""
    token = _may_be_idle.set(admitted)
    try:
        yield
    finally:
        _may_be_idle.reset(token)


def note(item):
    """A constraint or force has been made: it is checked, and waits for its scene, or to become a part of a joint."""
    if "a" in vars(item):  # its __init__ has called that of its base
        item.check()
        if not _may_be_idle.get():
            item.demand_effect()
        item.scene._waiting[id(item)] = item


def stop_waiting(item):
    """It waits no longer."""
    item.scene._waiting.pop(id(item), None)


def warn_of_waiting(scene):
    """Warn, once, of what was made for a scene and never added."""
    if not scene._waiting:
        return
    titles = [item.title for item in scene._waiting.values()]
    scene._waiting.clear()
    warnings.warn(
        f"made for this scene and never added: {listed(titles)}. What scene.add(...) isn't given has no effect.",
        stacklevel=line_of_user(),
    )


def admit(scene, item):
    """Give an item that is added a name of its own, or refuse the one that its user gave it and another has."""
    taken = scene._titles
    if taken is None:
        taken = scene._titles = {other.name for other in (*scene._added, *scene._forces)}
    if item.name in taken and item.named:
        raise item.error(f"the scene has a constraint or force named {item.name!r} already; choose another name.")
    name, count = item.name, 1
    while name in taken:
        name, count = f"{item.name} #{count + 1}", count + 1
    taken.add(name)
    if name != item.name:
        item.name = name


# Joint coordinates: angles and displacements between two bodies, declared by the class of a joint.
#
#     v     = A_own^T A_other h         the direction h of the other body, seen from the own body
#     theta = atan2(g.v, f.v)           (1)  f, g: directions of the own body at right angles; modulo 2 pi
#     s     = e.(x_other - x_own)       (2)  e: a direction of the own body
#
# The own body is the body of the axis. f, g and the axis are right-handed; if the axis belongs to b, g is reversed, so
# that theta is the angle of b relative to a about the axis (right-hand rule) in either case.

cross, dot, to_body, to_ground = map(twin, (vectors.cross, vectors.dot, vectors.to_body, vectors.to_ground))


@fitting_constructor
@dataclass(frozen=True)
class Angle:
    """Declare an angle of b against a about an axis (right hand), by names of attributes of the joint.

    Parameters
    ----------
    axis : str
        The axis: "axis_a", or a name that ends with _b where it belongs to b.
    other : str
        The axis of the other body that the joint keeps along it; read only where `direction` is left out.
    reference : str, optional
        The direction of the axis' own body at which the angle is zero. Left out: the angle is zero as built, that is
        as the bodies stood when the joint was made.
    direction : str, optional
        The direction of the other body whose angle it is. Left out: the one that was at the angle zero as built.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.Revolute.joint_coordinates
    (Angle(axis='axis_a', other='axis_b', reference='', direction=''),)
    """

    axis: str = "axis_a"
    other: str = "axis_b"
    reference: str = ""
    direction: str = ""

    def of(self, item: Any) -> AngleGeometry:
        """The `AngleGeometry` of an item."""
        own, other, A, B = _bodies(item, self.axis)
        axis = unit(getattr(item, self.axis))
        h = unit(getattr(item, self.direction)) if self.direction else None
        if self.reference:
            f = _across(axis, tuple(getattr(item, self.reference)))
        else:
            f = _across(axis, to_body(A, to_ground(B, h)) if h else None)
        if h is None:
            kept = unit(getattr(item, self.other))
            h = to_body(B, _swung(to_ground(A, axis), to_ground(B, kept), to_ground(A, f)))
        g = cross(axis, f)
        return AngleGeometry(own, other, f, g if own is item.a else tuple(-x for x in g), h)


@fitting_constructor
@dataclass(frozen=True)
class Displacement:
    """Declare the displacement of the other body's point from the own body's point along a direction of the own body.

    Parameters
    ----------
    axis : str
        The direction, an attribute of the joint; its name ends with the letter of its body.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.Translational.joint_coordinates
    (Displacement(axis='axis_a'),)
    """

    axis: str = "axis_a"

    def of(self, item: Any) -> DisplacementGeometry:
        """The `DisplacementGeometry` of an item."""
        own, other, _, _ = _bodies(item, self.axis)
        points = [tuple(item.point_a.tolist()), tuple(item.point_b.tolist())]
        if own is item.b:
            points.reverse()
        return DisplacementGeometry(own, other, unit(getattr(item, self.axis)), *points)


class AngleGeometry(NamedTuple):
    """Where an angle is measured, Eq. (1): unit vectors in the body frames.

    A torque T of the joint along the angle is T on `other` about f x g, the opposite on `own`.
    """

    own: object  # the body that the axis belongs to
    other: object
    f: tuple  # of the own body, where the angle is zero
    g: tuple  # of the own body, where it is pi / 2
    h: tuple  # of the other body


class DisplacementGeometry(NamedTuple):
    """Where a displacement is measured, Eq. (2), in the body frames."""

    own: object  # the body that the direction belongs to
    other: object
    e: tuple
    s_own: tuple
    s_other: tuple


def angles(item):
    """The `AngleGeometry` of each angle that a constraint or force declares, in order."""
    return [declared.of(item) for declared in item.joint_coordinates if isinstance(declared, Angle)]


def displacements(item):
    """The `DisplacementGeometry` of each displacement that a constraint or force declares, in order."""
    return [declared.of(item) for declared in item.joint_coordinates if isinstance(declared, Displacement)]


def chosen_coordinate(where, given, default=False):
    """(joint, kind, index) of what is given for a coordinate of a joint: the joint, or (joint, kind) or with an index.

    default: whether of a joint with several the angle is meant, the first one.
    """
    joint, *which = given if isinstance(given, tuple) and given else (given,)
    declared = getattr(joint, "joint_coordinates", ())
    if not declared or getattr(joint, "drives", ""):
        raise InvalidConstraint(
            f"{where}: joint must be one with an angle or a displacement, such as Revolute or Translational, got "
            f"{shown_for_handle(joint)}."
        )
    kinds = ["angle" if isinstance(each, Angle) else "displacement" for each in declared]
    choices = [(kind, kinds[:i].count(kind)) for i, kind in enumerate(kinds)]
    if default and not which:
        return joint, *min(choices)
    found = [choice for choice in choices if list(choice)[: len(which)] == which]
    if len(found) != 1:
        shapes = ", ".join(
            f"(joint, {kind!r}, {i})" if kinds.count(kind) > 1 else f"(joint, {kind!r})" for kind, i in choices
        )
        raise InvalidConstraint(
            f"{where}: say which coordinate of {joint.name!r} is meant, by {shapes}; got {shown(given)}."
        )
    return joint, *found[0]


def geometry_of(joint, kind, index):
    """The `AngleGeometry` or `DisplacementGeometry` of a coordinate of a joint."""
    return (angles if kind == "angle" else displacements)(joint)[index]


def _bodies(item, axis):
    """The body that an axis belongs to, the other one, and the Euler parameters of both as built."""
    one, other = (IDENTITY if p is None else tuple(p.tolist()) for p in item.built)
    return (item.b, item.a, other, one) if axis.endswith("_b") else (item.a, item.b, one, other)


def _across(axis, direction=None):
    """The direction made perpendicular to an axis, of unit length; any, where it is left out or along the axis."""
    if direction is not None:
        along = dot(axis, direction)
        f = tuple(d - along * u for d, u in zip(direction, axis, strict=True))
        if dot(f, f) > UNDIRECTED**2 * dot(direction, direction):
            return unit(f)
    least = min(range(3), key=lambda i: abs(axis[i]))
    return unit(cross(tuple(float(i == least) for i in range(3)), axis))


def _swung(u, v, d):
    """The direction d turned by the least that takes the unit vector u to v; as it is where they are opposed."""
    n, cosine = cross(u, v), dot(u, v)
    if cosine <= -1.0 + UNDIRECTED:
        return d
    side, along = cross(n, d), dot(n, d) / (1.0 + cosine)
    return tuple(cosine * x + y + along * z for x, y, z in zip(d, side, n, strict=True))


# Base of constraints and forces: two bodies, a name, markers, and attributes that are validated when set.

# Part of a vector's largest component: below it a component is what a rotation into a body frame leaves of zero. Series
# would lose it from positions, but not from torques, with the same sign in every step.
ROTATED = 1e-15

ENTRIES = (  # of docstrings
    "a, b : Body or ground\n    Two different bodies of one scene.",
    "a : Body\n    A body of the scene.",
    "name : str, optional",
)


def by_name(function: Function) -> Function:
    """Wrap an `__init__`: a or b may be the name of a body in the scene of the other.

    That of `Attachment` serves a class that has none of its own: bodies by position, and b where markers are on it.
    """

    @wraps(function)
    def call(self, *arguments, **keywords):
        lacks_b = len(arguments) < 2 and "b" not in keywords and any(marker.body == "b" for marker in self.markers)
        if type(self).__init__.plain is Attachment.__init__ and (len(arguments) > 2 or lacks_b):
            raise TypeError("no call of this class")  # answered with the arguments that there are, see calls.py
        arguments, keywords = _meant(type(self), arguments, keywords)
        return function(self, *arguments, **keywords)

    return call


def _meant(cls, arguments, keywords):
    """The arguments of a call of a class, with the bodies a and b that are given by name."""
    bodies = [*arguments[:2], keywords.get("a"), keywords.get("b")]
    if any(isinstance(body, str) for body in bodies):
        for scene in (body.scene for body in bodies if isinstance(body, (PointMass, Ground))):
            known = (scene.ground, *scene.bodies)
            of = keywords.get("name") or cls.__name__
            here = [named(known, body, "body", cls.error, of) if isinstance(body, str) else body for body in bodies]
            given = len(arguments[:2])
            found = {key: body for key, body in zip("ab", here[-2:], strict=True) if key in keywords}
            return (*here[:given], *arguments[2:]), {**keywords, **found}
    return arguments, keywords


def rope_points(
    points: Any, what: str, error: type[TsdynError], apart: bool = True
) -> tuple[tuple[Any, tuple[float, ...]], ...]:
    """The points of a rope or cable as pairs of a body and three floats, in its frame; names become handles.

    apart: whether neighbours may not coincide.
    """
    how = "give points=[(body, (x, y, z)), ...], two or more, in the order of the rope"
    if not isinstance(points, (list, tuple)) or not all(
        isinstance(one, (list, tuple)) and len(one) == 2 for one in points
    ):
        raise error(f"{what}: {how}; got {shown(points)}.")
    if len(points) < 2:
        raise error(f"{what}: {counted(len(points), 'point')} given; {how}.")
    bodies = [body for body, _ in points]
    scenes = list(dict.fromkeys(body.scene for body in bodies if isinstance(body, (PointMass, Ground))))
    if len(scenes) > 1:
        raise error(f"{what}: its bodies belong to different scenes.")
    known = [scenes[0].ground, *scenes[0].bodies] if scenes else []
    bodies = [named(known, body, "body", error, what) if known and isinstance(body, str) else body for body in bodies]
    wrong = [body for body in bodies if not isinstance(body, (PointMass, Ground))]
    if wrong:
        raise error(f"{what}: {wrong[0]!r} is not a body; {how}.")
    if all(body is bodies[0] for body in bodies):
        raise error(f"{what}: all points are on {bodies[0].name!r}; a rope joins two bodies or more.")
    found = []
    for body, (_, s) in zip(bodies, points, strict=True):
        place = floats(s)
        if place.shape != (3,) or not np.isfinite(place).all() or (body.dimension == 3 and place.any()):
            asked = "(0, 0, 0), as a point mass has one point" if body.dimension == 3 else "three finite numbers, m"
            raise error(f"{what}: the point on {body.name!r} must be {asked}, got {shown(s)}.")
        found.append((body, tuple(place.tolist())))
    for i, ((a, s), (b, r)) in enumerate(pairwise(found)):
        if apart and not np.linalg.norm(ground_point(a, np.array(s)) - ground_point(b, np.array(r))) > 0.0:
            raise error(
                f"{what}: points {i} and {i + 1}, on {a.name!r} and {b.name!r}, coincide; a span of length zero has no "
                "direction. Move one of them, or leave it out."
            )
    return tuple(found)


class Attachment:
    """Base of Primitive, Joint and Force: attached to one or two bodies of a scene by markers.

    Attributes
    ----------
    a, b : Body or ground
        The bodies; b is None where there are markers on a only. Where one is given by its handle, the name of the
        other serves: Revolute(crank, "rod").
    name : str
        What error messages call it.
    coordinates : tuple of ndarray (3,)
        Where each marker is, body frame.
    """

    a: AnyBody
    b: Any  # Body or ground; None where there are markers on a only
    coordinates: tuple[Floats, ...]
    markers: tuple[Marker, ...] = ()
    error: type[TsdynError] = InvalidConstraint
    lacks = ""  # what a base class is the base of, and has none of itself
    particles = False  # whether Parameters and Turn may be on a point mass: p = (1, 0, 0, 0), no turning, no torque
    joint_coordinates: tuple[Angle | Displacement, ...] = ()  # of a joint
    permanent: tuple[str, ...] = ()  # arguments that can't be set later
    angle_near = 0.0  # on which turn its angles begin: set by `Scene.set`
    drives = ""  # of a motor: the coordinate that it prescribes, and its attribute: "angle" or "displacement"
    added = False  # to its scene
    active = True  # whether it takes part from the start of a run; see `Scene.deactivate`
    named = False  # by its user
    owner: Any = None  # the joint that it is a part of
    taken = 0  # slots that a run fills by itself, beside those of `memory`

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if not isinstance(cls.markers, (tuple, list)) or not all(isinstance(m, Marker) for m in cls.markers):
            return  # to be refused by name
        beyond = {marker.body for marker in cls.markers} - {"a", "b"}
        if beyond and not getattr(cls, "others_at", 0):
            raise cls.error(f"{cls.__name__}: a marker belongs to body 'a' or 'b', not to {min(beyond)}.")
        plain = getattr(cls.__init__, "plain", cls.__init__)  # an inherited one is wrapped already
        cls.__init__ = fitting(by_name(plain), then=note)
        cls.__init__.plain = plain
        if unwrap(plain).__code__.co_flags & CO_VARKEYWORDS:
            cls.__init__.__signature__ = complete_signature(cls)
        if cls.__new__ is not object.__new__:  # else the signature would be that of __new__
            cls.__signature__ = signature(MethodType(cls.__init__, cls))
        raises = f"{cls.error.__name__}\n    If an argument is inadmissible or missing, or the bodies don't fit."
        complete_docstring(cls, (*ENTRIES, *entries(cls.markers)), raises)

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike | None = None,
        coordinates: Sequence[ArrayLike | None] = (),
        name: str = "",
        **places: ArrayLike | None,
    ) -> None:
        """Attach it to its bodies; coordinates has an entry for each marker, in the body frame.

        A subclass whose `__init__` passes `**places` on has the arguments of its markers, and `name`.
        """
        kind = self._kind()
        if self.lacks and not self.markers:
            raise self.error(f"{kind} is the base of {self.lacks}; use one of them, or a subclass.")
        self.a, self.b = a, b
        name = label(name, kind, self.error)
        needed = {marker.body for marker in self.markers} | {"a"}
        bodies = [body for body, letter in ((a, "a"), (b, "b")) if body is not None or letter in needed]
        for body in bodies:
            if not isinstance(body, (PointMass, Ground)):
                raise self.error(
                    f"{name or kind}: {body!r} is not a body; pass one that add_body returned, the ground, or the name "
                    "of one beside the handle of the other."
                )
        self.named = bool(name)
        self.name = name or self._untitled(bodies)
        if all(body.dimension == 0 for body in bodies):
            raise self.error(f"{self.name}: one of the bodies must not be the ground.")
        if len(bodies) == 2 and a is b:
            raise self.error(f"{self.name}: it joins {a.name!r} to itself; pass two different bodies.")
        if len({id(body.scene) for body in bodies}) != 1:
            raise self.error(f"{self.name}: {a.name!r} and {b.name!r} belong to different scenes.")
        given = list(coordinates) or self._placed(places)
        if len(given) != len(self.markers):
            raise self.error(f"{self.name}: {len(self.markers)} markers, but {len(given)} coordinates.")
        self.coordinates = tuple(self._places(given))
        self.built = tuple(getattr(body, "values", {}).get("orientation") for body in (a, b))

    def _placed(self, places):
        """The coordinates of all markers by the arguments that were given."""
        known = {marker.argument: marker.default for marker in self.markers}
        for unknown in places.keys() - known:
            raise TypeError(f"unknown argument {unknown}")  # answered with the arguments that there are, see calls.py
        return list({**known, **places}.values())

    def _untitled(self, bodies):
        """The name of one that its user has given none."""
        return f"{self._kind()}({', '.join(body.name for body in bodies)})"

    @Placing
    def at(cls, a: BodyLike, b: BodyLike | None = None, **arguments: Any) -> Self:
        """Make one from points and directions in the ground frame, the bodies being where they stand now.

        Parameters
        ----------
        a, b : Body or ground
            As for the class itself.
        **arguments
            Those of the class, its points (m) and directions in the ground frame: `point_a=` is carried into the frame
            of a, `point=` into those of both bodies, and so with every other pair. All else is passed on.
        """
        (a, b), _ = _meant(cls, (a, b), {})
        given = {}
        for name, value in arguments.items():
            common = [marker for marker in cls.markers if marker.argument == f"{name}_{marker.body}"]
            own = [marker for marker in cls.markers if marker.argument == name]
            for marker in common or own:
                if own or marker.argument not in arguments:
                    given[marker.argument] = in_frame(a if marker.body == "a" else b, marker, value)
            if not common and not own:
                given[name] = value
        alone = b is None and all(marker.body == "a" for marker in cls.markers)
        return cls(*((a,) if alone else (a, b)), **given)

    def _places(self, given):
        """Where the markers are, (3,) each, in the order of `markers`."""
        return [self._place(*pair) for pair in zip(self.markers, given, strict=True)]

    @classmethod
    def _kind(cls):
        """The name of the class that users know: a private one is a variant of it."""
        return next(c.__name__ for c in cls.__mro__ if issubclass(c, Attachment) and not c.__name__.startswith("_"))

    def _place(self, marker, value):
        body = self.body_of(marker)
        if self.particles and body.dimension == 3 and marker.code in (PARAMETERS, TURN):
            return np.zeros(3)
        return marker.coordinates(body, value, self.name, self.error)

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; the scene packs its numbers again.

        A marker's argument (`point_a`, ...) may be set too. Once it is in its scene, a name that it does not have is
        refused.
        """
        if self.owner is not None:
            raise self.error(f"{self.name}: it follows from its joint; set {name} there.")
        if name in self.permanent:
            raise self.error(f"{self.name}: {name} can't be set later; remove it, and add a new one.")
        slots = [marker.argument for marker in self.markers]
        if name in slots and "coordinates" in self.__dict__:
            i = slots.index(name)
            place = self._place(self.markers[i], value)
            name, value = "coordinates", (*self.coordinates[:i], place, *self.coordinates[i + 1 :])
        if not self.added:
            super().__setattr__(name, value)
            return
        demand_known(self, name, (*self.__dict__, *slots))
        if name == "name":
            value = new_name(value, self, (*self.scene.constraints, *self.scene.forces), self.error)
            self.scene._titles = None
        if name not in self.__dict__:
            raise UnknownAttribute(f"{self.name}: {name} is of its class, or follows from others, and can't be set.")
        before = self.__dict__[name]
        super().__setattr__(name, value)
        try:
            self.check()
        except self.error:
            super().__setattr__(name, before)
            raise
        self.scene.touch()

    def __getattr__(self, name: str) -> Any:
        """The body-frame coordinates of a marker, by its argument."""
        for marker, place in zip(self.markers, self.__dict__.get("coordinates", ()), strict=False):
            if marker.argument == name:
                return place
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def demand_effect(self) -> None:
        """Raise an error where one that is made would do nothing, as if an argument had been forgotten."""

    def place_in(self, scene: Scene) -> None:
        """Find by name what it refers to in the scene that it is added to."""

    def check(self) -> None:
        """Raise an error where an attribute has an impossible value; asked when one is made, and when one is set."""

    def _demand_added(self, joint: Any) -> None:
        """Refuse a joint that the scene lacks; of `check`."""
        if not joint.added:
            raise self.error(f"{self.name}: add its joint {joint.name!r} to the scene first.")

    @property
    def referred(self) -> tuple[Any, ...]:
        """What it refers to, among other things: its bodies, a joint."""
        return tuple(vars(self).values())

    @property
    def scene(self) -> Scene:
        """The scene of its bodies."""
        return self.a.scene

    @property
    def on(self) -> PointMass:
        """The body that its reaction is given on: a, or b where a is the ground."""
        return self.a if self.a.dimension else self.b

    @property
    def title(self) -> str:
        """What its rows are called by."""
        return self.name

    def body_of(self, marker: Marker) -> AnyBody:
        """The body that a marker is on."""
        if marker.body in ("a", "b"):
            return self.a if marker.body == "a" else self.b
        return self.others[marker.body - 2]

    def counted_from(self, t: float, *displacements: float) -> float:
        """The angle, or angles, near which a run that begins at t counts turns: zero, or what `Scene.set` has set."""
        return self.angle_near

    def parameters(self) -> tuple[Any, ...]:
        """What the kernels get as `par`: floats, and functions of time."""
        return ()

    def __repr__(self) -> str:
        return f"<{self._kind()} {self.name!r}>"


def in_frame(body, marker, value):
    """The body-frame coordinates of what a marker is in the ground frame now; what is no vector is left as it is."""
    x = floats(value)
    if x.shape != (3,) or not np.isfinite(x).all() or not isinstance(body, (PointMass, Ground)):
        return value  # to be refused where it is placed
    if marker.code == POINT:
        x = x - body.position
    if body.dimension != 7:
        return x
    x = rotation_matrix(body.orientation).T @ x
    return np.where(np.abs(x) <= ROTATED * np.abs(x).max(), 0.0, x)


def layout(markers):
    """Constants of the loops over all instances of a kind: where each marker is in x, and on which body."""
    owners = [{"a": 0, "b": 1}.get(m.body, m.body) for m in markers]
    others = max(1, *owners) - 1
    sizes = [m.size for m in markers]
    return {
        "MARKERS": len(markers),
        "CODES": tuple(m.code for m in markers),
        "OWNERS": tuple(owners),
        "OTHERS": others,
        "SPAN": 14 + 7 * others,
        "STARTS": tuple(sum(sizes[:i]) for i in range(len(sizes))),
        "FIRST": tuple(int(owner not in owners[:i]) for i, owner in enumerate(owners)),
        "SIZE": sum(sizes),
        "ROOM": sum(sizes) + 1,  # for a store of four floats at the last marker
    }


def check_slots(cls, where, error):
    """Refuse a class whose `slots` is no number of rows."""
    if isinstance(cls.slots, bool) or not isinstance(cls.slots, int) or cls.slots < 0:
        raise error(f"{where}: slots must be the number of rows of scratch memory of series, 0 or more.")


def inlined(function):
    """A kernel of a function that may be one already."""
    return function if hasattr(function, "py_func") else kernel(function)


def address(kernels, name, what, error, hint=""):
    """The address of a kernel; `what` is whose it is, `error` what it raises where Numba can't compile it."""
    try:
        return kernels[name].address
    except NumbaError as reason:
        raise error(
            f"{what}: Numba can't compile {name}; use plain arithmetic, NumPy functions of scalars and constants in "
            f"it, and allocate nothing.{hint}"
        ) from reason


def checked_parameters(item, kind, kinds):
    """What `item.parameters()` gives, as a tuple of finite numbers and instances of `kind`, `kinds` in messages."""
    given = item.parameters()
    if isinstance(given, (tuple, list)) and all(isinstance(p, kind) or np.isfinite(number(p)) for p in given):
        return tuple(given)
    raise item.error(f"{item.name}: parameters() must return a tuple of finite numbers and {kinds}, it gave {given!r}.")


def static_kernel(cls, name, arguments, where, error):
    """The static method that a class has as a kernel, or an error that says how to write it."""
    function = getattr(cls, name, None)
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    if code is None or code.co_argcount != arguments:
        raise error(f"{where}: write {name} as a static method with {arguments} arguments.")
    return function
