"""Rigid bodies, point masses and the ground, with attributes that are validated when set; lookup by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, Never, TypeVar

import numpy as np

from ..calls import fitting
from ..errors import CONTROL, InvalidArgument, InvalidBody
from ..maths.tolerances import NEGLIGIBLE, TINY, TYPED
from ..shapes import pieces_of
from ..validation import close, demand_known, floats, listed, positive, shown, vector3
from .tolerances import SQUARABLE, UNIT_LENGTH

if TYPE_CHECKING:
    from ..hints import ArrayLike, Callable, Floats, Orientation, Scene


# Lookup of bodies, constraints and forces by name or handle.


def named(things, name, what, error=InvalidArgument, of=""):
    """The one of some bodies, constraints or forces that has a name; `what` they are, `of` which item, in messages.

    Raises
    ------
    InvalidArgument, or `error`
        If none has it, or several have.
    """
    found = [thing for thing in things if thing.name == name]
    if len(found) == 1:
        return found[0]
    if found:
        raise error(
            f"{name!r} is the name of {len(found)}: {', '.join(map(repr, found))}; pass the handle itself, or give "
            "each a name of its own."
        )
    known = list(dict.fromkeys(thing.name for thing in things))
    near = close(name, known)
    there = (
        f"did you mean {' or '.join(map(repr, near))}?"
        if near
        else f"there are {listed([*map(repr, known)]) or 'none'}."
    )
    raise error(f"{f'{of}: ' * bool(of)}no {what} is named {name!r}; {there}")


def new_name(value, thing, others, error):
    """Return a name that a thing may be given in its scene: text, which none of some others has; or raise `error`."""
    if not isinstance(value, str) or not value or CONTROL.search(value):
        raise error(
            f"{thing.name}: name must be text that is not empty and holds no control characters, got {shown(value)}."
        )
    if any(other is not thing and other.name == value for other in others):
        raise error(f"{thing.name}: the scene has another named {value!r}; choose another name.")
    return value


IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


class Shaped:
    """Mixed into bodies and the ground: what the viewer draws."""

    _shape: Any = None  # geometry, or a function that makes it: files of meshes are read when they are drawn

    @property
    def shape(self) -> Any:
        """What the viewer draws, a tuple of `ts.shapes` in the frame of the body; None: a solid of its inertia.

        Set it to a shape, a list of shapes, or None; an empty list draws nothing.
        """
        return self._shape() if callable(self._shape) else self._shape

    @shape.setter
    def shape(self, value: Any) -> None:
        self._shape = None if value is None else pieces_of(value, f"{self.name}: shape")  # type: ignore[attr-defined]


class Ground(Shaped):
    """The inertial frame, as a body that constraints attach to."""

    dimension = 0
    name = "ground"

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @property
    def position(self) -> Floats:
        """The origin."""
        return np.zeros(3)

    @property
    def orientation(self) -> Floats:
        """Euler parameters (1, 0, 0, 0)."""
        return IDENTITY.copy()

    def __repr__(self) -> str:
        return "<ground>"


START = ("position", "velocity", "orientation", "angular_velocity")  # attributes that say where a run starts
Given = TypeVar("Given")  # what an attribute is set to
Kept = TypeVar("Kept")  # and what is kept of it


class Attribute(Generic[Given, Kept]):
    """A checked, read-only attribute of a body; setting it marks the packed numbers of the scene as out of date."""

    def __init__(self, check: Callable[[Any, Any], Any], what: str) -> None:
        self.check, self.__doc__ = check, what

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, body: Any, owner: type | None = None) -> Kept:
        return self if body is None else body.values[self.name]

    def __set__(self, body: Any, value: Given) -> None:
        value = self.check(value, body)
        value.setflags(write=False)  # a change of one component would not reach the packed numbers
        body.values[self.name] = value
        if self.name in START:
            body.scene.touch_start()
        else:
            body.scene.touch()


def _mass(value, body):
    mass = np.float64(positive(value, f"{body.name}: mass (kg)", InvalidBody))
    _demand_within(mass, value, "mass (kg)", body)
    return mass


def _demand_within(size, value, what, body):
    if not TINY <= size <= SQUARABLE:
        raise InvalidBody(
            f"{body.name}: the {what} must be from {TINY:g} to {SQUARABLE:g}, got {shown(value)}: its reciprocal "
            "and its products must be finite numbers."
        )


def _inertia(value, body):
    given = floats(value)
    if given.shape == (3,):
        given = np.diag(given)
    if given.shape != (3, 3) or not np.isfinite(given).all():
        raise InvalidBody(
            f"{body.name}: inertia must be 3 principal values or a symmetric 3 x 3 matrix, finite, kg m^2, "
            f"got {shown(value)}."
        )
    scale = np.abs(given).max()
    if scale > 0.0:
        _demand_within(scale, value, "largest moment of inertia (kg m^2)", body)
    unit = given / (scale or 1.0)  # no square or sum of its entries overflows
    skew = np.abs(unit - unit.T).max()
    if skew > NEGLIGIBLE:
        raise InvalidBody(f"{body.name}: the inertia matrix is not symmetric; J - J^T is up to {skew * scale:.3g}.")
    principal = np.linalg.eigvalsh(unit / 2.0 + unit.T / 2.0)
    moments = principal * scale
    if principal[0] < -NEGLIGIBLE or scale == 0.0:
        raise InvalidBody(
            f"{body.name}: the principal moments of inertia {moments} kg m^2 must not be negative, nor all "
            "zero; a body without extent is scene.add_point_mass(...)."
        )
    if principal[2] > (principal[0] + principal[1]) * (1.0 + TYPED):
        raise InvalidBody(
            f"{body.name}: no body has the principal moments {moments} kg m^2: the largest exceeds the sum "
            "of the others (triangle inequality). Are products of inertia or units mixed up?"
        )
    return given / 2.0 + given.T / 2.0


def _orientation(value, body):
    if hasattr(value, "as_quat") and not isinstance(value, type):  # a SciPy Rotation has the scalar last
        p = np.roll(value.as_quat(), 1, axis=-1)
    else:
        p = floats(value)
    if p.shape == (3, 3) and np.isfinite(p).all():
        return _of_matrix(p, body)
    if p.shape != (4,) or not np.isfinite(p).all():
        raise InvalidBody(
            f"{body.name}: orientation must be four finite Euler parameters (e0, e1, e2, e3), scalar first, a rotation "
            f"matrix (3, 3), or one scipy Rotation, got {shown(value)}."
        )
    known = body.values.get("orientation")
    if known is not None and p.tobytes() == known.tobytes():
        return p.copy()  # scaled before: once more might change a bit
    length = np.sqrt(p @ p)
    if abs(length - 1.0) > UNIT_LENGTH:
        raise InvalidBody(
            f"{body.name}: orientation {p} has length {length:.9g} and Euler parameters have 1; divide by it"
            + (", or give a rotation: they are zero." if length == 0.0 else ".")
        )
    return p / length


def _of_matrix(A, body):
    """Euler parameters of a rotation matrix, e0 >= 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(A.T @ A - np.eye(3)).max()
    if not skew <= UNIT_LENGTH:
        raise InvalidBody(
            f"{body.name}: orientation is no rotation matrix: its columns must be orthogonal unit vectors, and "
            f"A^T A - I is up to {skew:.3g}."
        )
    if np.linalg.det(A) < 0.0:
        raise InvalidBody(
            f"{body.name}: orientation is a reflection, of determinant -1; reverse one of its axes: they must be "
            "right-handed."
        )
    from scipy.spatial.transform import Rotation  # half of the time that tsdyn takes to import

    return np.roll(Rotation.from_matrix(A).as_quat(canonical=True), 1)


def _vector(what, unit):
    return lambda value, body: vector3(value, f"{body.name}: {what} ({unit})", InvalidBody)


class PointMass(Shaped):
    """A particle: three coordinates, no orientation. Made by `Scene.add_point_mass`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> bob = scene.add_point_mass(mass=1.0, position=(0, 0, -2), name="bob")
    >>> bob, bob.position
    (<PointMass 'bob'>, array([ 0.,  0., -2.]))
    """

    dimension = 3
    mass: Attribute[float, float] = Attribute(_mass, "Mass, kg.")
    position: Attribute[ArrayLike, Floats] = Attribute(
        _vector("position", "m"), "Position at the start, ground frame, m, shape (3,)."
    )
    velocity: Attribute[ArrayLike, Floats] = Attribute(
        _vector("velocity", "m/s"), "Velocity at the start, ground frame, m/s, shape (3,)."
    )

    _made_by = "scene.add_body(...) or scene.add_point_mass(...)"

    @fitting
    def __init__(self, scene: Scene = None, index: int = -1, name: str = "", **values: Any) -> None:  # type: ignore[assignment]
        if index < 0:
            raise InvalidBody("bodies are made by scene.add_body(...) and scene.add_point_mass(...).")
        self.scene, self.index, self.name, self.values = scene, index, name, {}
        for attribute, value in values.items():
            setattr(self, attribute, value)

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute that there is; a misspelt one is refused."""
        demand_known(self, name, ("scene", "index", "name", "values"))
        if name == "name" and "name" in self.__dict__:
            value = new_name(value, self, (*self.scene.bodies, self.scene.ground), InvalidBody)
            self.scene._names = None
            self.scene.touch()  # parameters go by names
        super().__setattr__(name, value)

    @property
    def orientation(self) -> Any:
        """A point mass has none."""
        raise InvalidBody(f"{self.name}: a point mass has no orientation; use scene.add_body for a rigid body.")

    @property
    def q(self) -> Floats:
        """Coordinates at the start, shape (3,) or (7,)."""
        return self.values["position"]

    @property
    def qd(self) -> Floats:
        """Velocities at the start."""
        return self.values["velocity"]

    def place(self, q: Floats, qd: Floats) -> None:
        """Take over coordinates and velocities as the values at the start."""
        for name, value in self.values_at(q, qd).items():
            setattr(self, name, value)

    def values_at(self, q: Floats, qd: Floats) -> dict[str, Floats]:
        """Return the attributes of a start with these coordinates and velocities."""
        return {"position": q, "velocity": qd}

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name!r}>"


class Body(PointMass):
    """A rigid body: centroid r and Euler parameters p, seven coordinates. Made by `Scene.add_body`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> crank = scene.add_body(mass=2.0, inertia=(0.1, 0.2, 0.2), name="crank")
    >>> crank.mass = 3.0  # for all runs from now on
    >>> crank, float(crank.mass), crank.position
    (<Body 'crank'>, 3.0, array([0., 0., 0.]))
    """

    dimension = 7
    inertia: Attribute[ArrayLike, Floats] = Attribute(
        _inertia, "Inertia about the centroid, body frame, kg m^2, shape (3, 3)."
    )
    orientation: Attribute[Orientation, Floats] = Attribute(
        _orientation,
        "Euler parameters at the start, body to ground, scalar first, shape (4,); set by a rotation matrix, too.",
    )
    angular_velocity: Attribute[ArrayLike, Floats] = Attribute(
        _vector("angular velocity", "rad/s"), "Angular velocity at the start, body frame, rad/s, shape (3,)."
    )

    @property
    def q(self) -> Floats:
        """Coordinates (r, p) at the start, shape (7,)."""
        return np.concatenate((self.values["position"], self.values["orientation"]))

    @property
    def qd(self) -> Floats:
        """Velocities (rd, pd), pd = G(p)^T omega' / 2, shape (7,)."""
        p, w = self.values["orientation"], self.values["angular_velocity"]
        return np.concatenate((self.values["velocity"], 0.5 * (transform_g(p).T @ w)))

    def values_at(self, q: Floats, qd: Floats) -> dict[str, Floats]:
        """Return the attributes of a start with these coordinates and velocities."""
        spin = 2.0 * (transform_g(q[3:]) @ qd[3:])
        return {"position": q[:3], "velocity": qd[:3], "orientation": q[3:], "angular_velocity": spin}


def turning(bodies, n):
    """Which of n coordinates are Euler parameters (n,); bodies (b, 2): as in a `System`."""
    found = np.zeros(n, bool)
    found[bodies[bodies[:, 1] == 7, :1] + np.arange(3, 7)] = True
    return found


def largest_of_kind(bodies, x):
    """The largest size of numbers of its kind, in place of each coordinate of x (..., n).

    Kinds are positions and Euler parameters, or their rates; bodies (b, 2): as in a `System`.
    """
    turns = turning(bodies, x.shape[-1])
    largest = [np.abs(x).max(axis=-1, keepdims=True, initial=0.0, where=kind) for kind in (turns, ~turns)]
    return np.where(turns, *largest)


def transform_g(p: ArrayLike) -> Floats:
    """G(p) = [-e, -e~ + e0 I], shape (3, 4), or (..., 3, 4) for p of shape (..., 4)."""
    e0, e1, e2, e3 = _components(p)
    rows = [[-e1, e0, e3, -e2], [-e2, -e3, e0, e1], [-e3, e2, -e1, e0]]
    found = np.array(rows)
    return found if found.ndim == 2 else np.moveaxis(found, (0, 1), (-2, -1))


def rotation_matrix(p: ArrayLike) -> Floats:
    """A(p), homogeneous, shape (3, 3), or (..., 3, 3) for p of shape (..., 4)."""
    e0, e1, e2, e3 = _components(p)
    rows = [
        [e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3, 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)],
        [2 * (e1 * e2 + e0 * e3), e0 * e0 - e1 * e1 + e2 * e2 - e3 * e3, 2 * (e2 * e3 - e0 * e1)],
        [2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3],
    ]
    found = np.array(rows)
    return found if found.ndim == 2 else np.moveaxis(found, (0, 1), (-2, -1))


def euler_product(p, o):
    """The Euler parameters (..., 4) of A(p) A(o)."""
    e0 = p[..., :1] * o[..., :1] - (p[..., 1:] * o[..., 1:]).sum(axis=-1, keepdims=True)
    e = p[..., :1] * o[..., 1:] + o[..., :1] * p[..., 1:] + np.cross(p[..., 1:], o[..., 1:])
    return np.concatenate((e0, e), axis=-1)


def _components(p):
    """e0 to e3: numbers of Python, which are quicker, where there is one p."""
    p = np.asarray(p)
    return p.tolist() if p.ndim == 1 else np.moveaxis(p, -1, 0)


def ground_point(body: Any, s: ArrayLike) -> Floats:
    """Return where a point s of a body is now, ground frame."""
    return body.position + (rotation_matrix(body.orientation) @ s if body.dimension != 3 else 0.0)
