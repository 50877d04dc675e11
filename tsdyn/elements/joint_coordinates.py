"""Joint coordinates: angles and displacements between two bodies, declared by the class of a joint.

    v     = A_own^T A_other h         the direction h of the other body, seen from the own body
    theta = atan2(g.v, f.v)           (1)  f, g: directions of the own body at right angles; modulo 2 pi
    s     = e.(x_other - x_own)       (2)  e: a direction of the own body

The own body is the body of the axis. f, g and the axis are right-handed; if the axis belongs to b, g is reversed, so
that theta is the angle of b relative to a about the axis (right-hand rule) in either case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ..calls import fitting_constructor
from ..jit.kernels import twin
from ..maths import vectors
from ..maths.vectors import IDENTITY, unit
from .tolerances import OPPOSED, PARALLEL_FOUND

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


def _bodies(item, axis):
    """The body that an axis belongs to, the other one, and the Euler parameters of both as built."""
    one, other = (IDENTITY if p is None else tuple(p.tolist()) for p in item.built)
    return (item.b, item.a, other, one) if axis.endswith("_b") else (item.a, item.b, one, other)


def _across(axis, direction=None):
    """The direction made perpendicular to an axis, of unit length; any, where it is left out or along the axis."""
    if direction is not None:
        along = dot(axis, direction)
        f = tuple(d - along * u for d, u in zip(direction, axis, strict=True))
        if dot(f, f) > PARALLEL_FOUND**2 * dot(direction, direction):
            return unit(f)
    least = min(range(3), key=lambda i: abs(axis[i]))
    return unit(cross(tuple(float(i == least) for i in range(3)), axis))


def _swung(u, v, d):
    """The direction d turned by the least that takes the unit vector u to v; as it is where they are opposed."""
    n, cosine = cross(u, v), dot(u, v)
    if cosine <= -1.0 + OPPOSED:
        return d
    side, along = cross(n, d), dot(n, d) / (1.0 + cosine)
    return tuple(cosine * x + y + along * z for x, y, z in zip(d, side, n, strict=True))
