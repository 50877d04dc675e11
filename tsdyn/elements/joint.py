"""The interface of a joint: a constraint composed of primitives; joints that hold an orientation."""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Never, Self

import numpy as np

from ..errors import InvalidConstraint
from ..validation import counted
from .bodies import rotation_matrix
from .element import Attachment, stop_waiting
from .markers import TURN, Marker, Point, Vector
from .primitive import Primitive
from .tolerances import PARALLEL, UNDIRECTED

if TYPE_CHECKING:
    from ..hints import AnyBody, ArrayLike, Floats, Iterable, Iterator, Mapping, Random


# The interface of a joint: a constraint composed of primitives, with no kernels of its own.

_registry = {}


class Composition(NamedTuple):
    """What a joint is made of."""

    parts: tuple  # Primitives, in the order of their rows
    labels: tuple  # of each row
    aligned: tuple  # ((body, direction), (body, direction)) pairs that must not be opposed, body frames


class Joint(Attachment):
    """Base class of all constraints that are composed of others.

    Subclass it in one file of your own: set `markers` and yield the parts in `compose`; an `__init__` with further
    arguments passes the bodies and `**places` on. `tsdyn.testing.check_primitive` checks the result.

    Attributes
    ----------
    markers : tuple of Point, Vector
        Where the joint is, each on body "a" or "b"; the first point on a body is what reactions on it are taken about.
    a, b : Body or ground
    name : str
        What error messages call it.

    Examples
    --------
    A pin in a slot along x, which slides and turns about z:

    >>> import tsdyn as ts
    >>> class PinInSlot(ts.Joint):
    ...     markers = (ts.Point("a"), ts.Point("b"))
    ...     def compose(self):
    ...         points = {"point_a": self.point_a, "point_b": self.point_b}
    ...         yield "axis", ts.constraints.Parallel(self.a, self.b, axis_a=(0, 0, 1), axis_b=(0, 0, 1))
    ...         yield "slot", ts.constraints.PointOnLine(self.a, self.b, **points, axis_b=(1, 0, 0))
    >>> scene = ts.Scene()
    >>> pin = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    >>> scene.add(PinInSlot(pin, scene.ground, name="pin"))
    <PinInSlot 'pin': 4 rows>
    >>> scene.mobility().degrees_of_freedom
    2
    """

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "compose" not in vars(cls):
            return
        where = f"joint {cls.__name__}"
        if not isinstance(cls.markers, (tuple, list)) or not all(
            isinstance(m, Marker) and m.code != TURN for m in cls.markers
        ):
            raise InvalidConstraint(f"{where}: markers must be a tuple of Point or Vector.")
        _registry[f"{cls.__module__}.{cls.__qualname__}"] = cls

    def compose(self) -> Iterator[tuple[str, Primitive | Joint]]:
        """Yield (label, part), part a Primitive or another Joint on the same bodies, in the order of their rows.

        The label is what a message calls the part's rows. Parts are new ones each time: `compose` is asked again when
        an attribute has been set.
        """
        raise InvalidConstraint("Joint is the base of joints and has no parts; use one of them, or a subclass.")

    def aligned(self) -> Iterable[tuple[ArrayLike, ArrayLike]]:
        """Return the pairs of directions (of a, of b; body frames) that the rows make parallel and never opposed.

        A row knows no sign, so it holds after half a turn, too: a start there is refused. What the parts say counts
        anyway.
        """
        return ()

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; the parts follow."""
        super().__setattr__(name, value)
        self.__dict__.pop("_composition", None)

    @cached_property
    def _composition(self):
        self.check()
        parts, labels, aligned = [], [], [((self.a, u), (self.b, v)) for u, v in self.aligned()]
        for pair in self.compose():
            label, part = pair if isinstance(pair, tuple) and len(pair) == 2 else (None, None)
            self._demand_fit(part, pair)
            stop_waiting(part)
            aligned += getattr(part, "opposed", ())
            parts += part.parts
            labels += [str(label)] * part.all_rows
        total, seen = Counter(labels), Counter()
        for i, label in enumerate(labels):
            labels[i] = f" {label}" if total[label] == 1 else f" {label}[{seen[label]}]"
            seen[label] += 1
        row = 0
        for part in parts:
            label = labels[row] if part.all_rows == 1 else labels[row].partition("[")[0]
            part.__dict__.update(owner=self, name=f"{self.title}{label}")
            row += part.all_rows
        return Composition(tuple(parts), tuple(labels), tuple(aligned))

    def _demand_fit(self, part, given):
        """Refuse what is no part of this joint."""
        if not isinstance(part, (Primitive, Joint)):
            raise InvalidConstraint(
                f"{self.title}: compose() must yield (label, part), part a constraint; it gave {given!r}."
            )
        if getattr(part, "normalises", False) or part.added or part.owner is not None:
            raise InvalidConstraint(
                f"{self.title}: {part.name} can't be a part of it; compose() makes new constraints each time, and no "
                "EulerNormalization."
            )
        if not {id(part.a), id(part.b)} <= {id(self.a), id(self.b), id(None)}:
            raise InvalidConstraint(f"{self.title}: {part.name} is a part of it and must be on its own two bodies.")

    @property
    def parts(self) -> tuple[Primitive, ...]:
        """The primitives that it is made of, in the order of their rows."""
        return self._composition.parts

    @property
    def rows(self) -> int:
        """Number of scalar constraints on positions."""
        return sum(part.rows for part in self.parts)

    @property
    def rate_rows(self) -> int:
        """Number of scalar constraints on velocities."""
        return sum(part.rate_rows for part in self.parts)

    @property
    def all_rows(self) -> int:
        """Number of scalar constraints of both kinds."""
        return len(self._composition.labels)

    @property
    def row_labels(self) -> tuple[str, ...]:
        """What follows its title in the names of its rows."""
        return self._composition.labels

    @property
    def opposed(self) -> tuple[Any, ...]:
        """((body, direction), (body, direction)) pairs that must not be opposed, its parts' included."""
        return self._composition.aligned

    @property
    def title(self) -> str:
        """Its kind and name."""
        kind = self._kind()
        return self.name if self.name.startswith(kind) else f"{kind} {self.name!r}"

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """Return a random instance between two bodies, for tests; it need not hold where they are."""
        places = {m.argument: rng.normal(size=3) for m in cls.markers}
        return cls(a, b, **places)

    def __repr__(self) -> str:
        return f"<{self.title}: {counted(self.all_rows, 'row')}>"


class SumRow(Joint):
    """Base of constraints of one row that is a sum of terms, each on two bodies: a row on any number of bodies.

    Subclass it and yield the terms in `compose`: primitives of one row with `summed = True`, on any bodies of the
    scene. a and b are the bodies of the first term.
    """

    @cached_property
    def _composition(self):
        self.check()
        parts = tuple(self.compose())
        for i, part in enumerate(parts):
            stop_waiting(part)
            # The row counts once, with the first term
            part.__dict__.update(owner=self, name=self.title, rows=int(i == 0), all_rows=int(i == 0))
        return Composition(parts, ("",), ())

    @property
    def bodies(self) -> tuple[AnyBody, ...]:
        """The bodies of its terms, the ground left out."""
        found = dict.fromkeys(body for part in self.parts for body in (part.a, part.b))
        return tuple(body for body in found if body.dimension)


def registered() -> Mapping[str, type[Joint]]:
    """Return every joint class known, built in or plugged in, by its full name."""
    return MappingProxyType(_registry)


def across(axis: ArrayLike) -> tuple[Floats, Floats]:
    """f, g (3,): with a direction they make a right-handed orthonormal frame f, g, axis.

    f is across the coordinate axis that is furthest from the direction, so nothing is lost to rounding.
    """
    axis = np.asarray(axis) / np.linalg.norm(axis)
    f = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    f /= np.linalg.norm(f)
    return f, np.cross(axis, f)


# Base of joints that hold an orientation: an axis and a perpendicular direction on each body, by default as built.


class FramedJoint(Joint):
    """Base of joints that keep an axis and a reference across it of one body along those of the other.

    References that are not given follow from the bodies as they stand: the angle about the axis that they have is kept.
    """

    markers = (Point("a"), Point("b"), Vector("a"), Vector("b"), Vector("a", "reference_a"), Vector("b", "reference_b"))

    def _places(self, given):
        """Fill in the references that were left out."""
        marker_a, marker_b, *references = self.markers[2:]
        axis_a, axis_b = self._place(marker_a, given[2]), self._place(marker_b, given[3])
        reference_a, reference_b = (
            None if value is None else self._across(letter, axis, self._place(marker, value))
            for letter, axis, marker, value in zip("ab", (axis_a, axis_b), references, given[4:], strict=True)
        )
        if reference_a is None:
            reference_a = (
                across(axis_a)[0] if reference_b is None else carried(self.b, axis_b, reference_b, self.a, axis_a)
            )
        if reference_b is None:
            reference_b = carried(self.a, axis_a, reference_a, self.b, axis_b)
        return super()._places([*given[:2], axis_a, axis_b, reference_a, reference_b])

    def check(self):
        """References that are across their axes."""
        self._across("a", self.axis_a, self.reference_a)
        self._across("b", self.axis_b, self.reference_b)

    def _across(self, letter, axis, reference):
        """The reference, refused where it is parallel to the axis."""
        if np.linalg.norm(np.cross(axis, reference)) < PARALLEL:
            raise InvalidConstraint(
                f"{self.name}: reference_{letter} is parallel to axis_{letter}; choose a direction across it."
            )
        return reference

    @property
    def frames(self) -> tuple[Any, ...]:
        """(f, g) of a and of b: f is the reference made perpendicular to the axis, f, g, axis are right-handed."""
        return beside(self.axis_a, self.reference_a), beside(self.axis_b, self.reference_b)

    def aligned(self):
        """The axes, and the references across them."""
        (f_a, _), (f_b, _) = self.frames
        return (self.axis_a, self.axis_b), (f_a, f_b)


def turned_about(axis, direction, angle):
    """A direction turned about a unit axis by an angle, right hand."""
    along = (axis @ direction) * axis
    return along + np.cos(angle) * (direction - along) + np.sin(angle) * np.cross(axis, direction)


def beside(axis, reference):
    """f, g (3,): the reference made perpendicular to the axis, and across both."""
    f = reference - (axis @ reference) * axis
    f /= np.linalg.norm(f)
    return f, np.cross(axis, f)


def carried(a, axis_a, direction, b, axis_b):
    """The direction of a, (3,), as one of b, from where they stand.

    It is turned by the least that takes one axis to the other, so it is as far from the axis of b as it was from that
    of a. Where the axes are opposed it is left as it stands.
    """
    one, other = rotation_matrix(a.orientation), rotation_matrix(b.orientation)
    u, v, d = one @ axis_a, other @ axis_b, one @ direction
    n, cosine = np.cross(u, v), u @ v
    if cosine > -1.0 + UNDIRECTED:
        d = d * cosine + np.cross(n, d) + n * (n @ d) / (1.0 + cosine)
    return other.T @ d
