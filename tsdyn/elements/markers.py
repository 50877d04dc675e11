"""Markers: the points, vectors and Euler parameters of a body on which constraints and forces are written.

    Point       x = r + A(p) s    xd = rd + (A s)_p pd    at qdd = 0: xdd = 2 A(pd) s
    Vector      x = A(p) s        xd = (A s)_p pd                     xdd = 2 A(pd) s
    Parameters  x = p             xd = pd                             xdd = 0
    Turn        x = 0             xd = 2 E(p) pd, the angular velocity; for forces only

x and xd are in the ground frame, s in the body frame. On the ground x = s or p = (1, 0, 0, 0), at rest; a point mass
has r only.
"""

from __future__ import annotations

from dataclasses import dataclass
from inspect import Parameter
from typing import TYPE_CHECKING

import numpy as np

from ..calls import fitting_constructor
from ..errors import InvalidBody, InvalidConstraint
from ..jit.kernels import kernel, stack
from ..maths.vectors import rotate, rotate_gradient, rotate_rate
from ..validation import vector3
from .tolerances import SQUARABLE

if TYPE_CHECKING:
    from ..hints import AnyBody, ArrayLike, Floats, Iterator, Sequence, TsdynError

POINT, VECTOR, PARAMETERS, TURN = 0, 1, 2, 3  # codes in kernels


@fitting_constructor
@dataclass(frozen=True)
class Marker:
    """What one slot of a constraint or force is on: body "a" or "b", and the argument that places it there.

    A term of a sum may read markers of further bodies, 2 for the first of its `others`: rows have no columns there.
    """

    body: str | int
    argument: str = ""
    code = POINT
    size = 3
    prefix = "point_"
    placed = True  # by an argument, three body-frame coordinates
    default = (0.0, 0.0, 0.0)
    meaning = "array_like (3,), m\n    A point in the {}; by default the centroid."

    def __post_init__(self) -> None:
        if self.body not in ("a", "b") and not (isinstance(self.body, int) and self.body > 1):
            raise InvalidConstraint(f"a marker belongs to body 'a' or 'b', not to {self.body!r}.")
        if not self.argument:
            object.__setattr__(self, "argument", f"{self.prefix}{self.body}")

    def parameter(self) -> Parameter:
        """Return the argument that places it, as one of a signature."""
        annotation = "ArrayLike | None" if self.default is None else "ArrayLike"
        return Parameter(self.argument, Parameter.KEYWORD_ONLY, default=self.default, annotation=annotation)

    def coordinates(
        self, body: AnyBody, value: ArrayLike | None, where: str, error: type[TsdynError] = InvalidConstraint
    ) -> Floats:
        """Check the body-frame coordinates that a user gave, return them as an array (3,)."""
        if not self.placed:
            _needs_rotation(body, where)
            return np.zeros(3)
        what = f"{where}: {self.argument}"
        place = self.fitted(vector3(value, what, error), body, what, error)
        place.setflags(write=False)
        return place

    def fitted(self, place: Floats, body: AnyBody, what: str, error: type[TsdynError]) -> Floats:
        """Return the coordinates of a marker of this kind, or raise an error where the body has none such."""
        return place


class Point(Marker):
    """A point of a body, by its coordinates in the body frame, m.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.Point("a").argument, ts.Point("b", "tip_b").argument
    ('point_a', 'tip_b')
    """

    def fitted(self, place: Floats, body: AnyBody, what: str, error: type[TsdynError]) -> Floats:
        """Return the coordinates; a point mass has no other point than itself."""
        if body.dimension == 3 and place.any():
            raise error(f"{what} must be (0, 0, 0) on the point mass {body.name!r}.")
        if not np.abs(place).max() < SQUARABLE:
            raise error(f"{what} must be within {SQUARABLE:g} m: squares of its coordinates overflow.")
        return place


class Vector(Marker):
    """A direction of a body, by its components in the body frame; scaled to unit length.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.Vector("b").argument, ts.Vector("b", "normal_b").argument
    ('axis_b', 'normal_b')
    """

    code = VECTOR
    prefix = "axis_"
    default = None
    meaning = "array_like (3,)\n    A direction in the {}; scaled to unit length."

    def fitted(self, place: Floats, body: AnyBody, what: str, error: type[TsdynError]) -> Floats:
        """Return the direction at unit length."""
        _needs_rotation(body, what)
        size = np.abs(place).max()
        if not size > 0.0:
            raise error(f"{what} has length zero; give a direction, such as (0, 0, 1).")
        place = np.ldexp(place, -np.frexp(size)[1])  # by a power of two: no square overflows, no bit changes
        return place / np.linalg.norm(place)


class Parameters(Marker):
    """The Euler parameters of a rigid body themselves; (1, 0, 0, 0) on the ground.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.EulerNormalization.markers
    (Parameters(body='a', argument='parameters_a'),)
    """

    code = PARAMETERS
    size = 4
    prefix = "parameters_"
    placed = False
    default = None


class Turn(Marker):
    """The turning of a rigid body, for forces: xd is its angular velocity, conjugate is a torque, ground frame.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.forces.Torque.markers
    (Turn(body='a', argument='turn_a'),)
    """

    code = TURN
    prefix = "turn_"
    placed = False
    default = None


def entries(markers: Sequence[Marker]) -> Iterator[str]:
    """Entries of a docstring for the arguments that place markers; one for a pair on both bodies."""
    pairs = {}
    for marker in markers:
        if marker.placed:
            pairs.setdefault((marker.code, marker.argument.removesuffix(f"_{marker.body}")), []).append(marker)
    for one, *others in pairs.values():
        arguments = ", ".join(marker.argument for marker in (one, *others))
        yield f"{arguments} : {one.meaning.format('frame of each body' if others else f'frame of {one.body}')}"


def _needs_rotation(body, where):
    if body.dimension == 3:
        raise InvalidBody(f"{where}: the point mass {body.name!r} has no orientation; use add_body.")


@kernel
def position(code, dimension, at, q, s, x):
    """x of one marker; its body's coordinates begin at q[at]."""
    if code == TURN:
        for i in range(3):
            x[i] = 0.0
    elif code == PARAMETERS and dimension != 7:
        x[0] = 1.0
        for i in range(1, 4):
            x[i] = 0.0
    elif dimension == 7:
        if code == PARAMETERS:
            for i in range(4):
                x[i] = q[at + 3 + i]
            return
        rotate(q[at + 3 : at + 7], s, x)
        if code == POINT:
            for i in range(3):
                x[i] += q[at + i]
    elif dimension == 3:
        for i in range(3):
            x[i] = q[at + i]
    else:
        for i in range(3):
            x[i] = s[i]


@kernel
def rate(code, dimension, at, q, qd, s, xd):
    """xd = x_q qd of one marker that is no Turn."""
    for i in range(4 if code == PARAMETERS else 3):
        xd[i] = 0.0
    if dimension == 7:
        if code == PARAMETERS:
            for i in range(4):
                xd[i] = qd[at + 3 + i]
            return
        rotate_rate(q[at + 3 : at + 7], qd[at + 3 : at + 7], s, xd)
    if dimension != 0 and code == POINT:
        for i in range(3):
            xd[i] += qd[at + i]


@kernel
def motion(code, dimension, at, q, qd, s, x, xd, xdd):
    """x, xd, and xdd at qdd = 0, of one marker."""
    position(code, dimension, at, q, s, x)
    rate(code, dimension, at, q, qd, s, xd)
    for i in range(4 if code == PARAMETERS else 3):
        xdd[i] = 0.0
    if dimension == 7 and code != PARAMETERS:
        rotate(qd[at + 3 : at + 7], s, xdd)
        for i in range(3):
            xdd[i] *= 2.0


@kernel
def chain_rule(code, dimension, at, q, s, f, first, out):
    """out (+)= f x_q, one row over the coordinates of the marker's body; f (3,) or (4,), out (7,) or (3,)."""
    if dimension == 0:
        return
    if first:
        for i in range(dimension):
            out[i] = 0.0
    if code == PARAMETERS:
        if dimension == 7:  # a point mass has none
            for i in range(4):
                out[3 + i] += f[i]
        return
    if code == POINT:
        for i in range(3):
            out[i] += f[i]
    if dimension == 7:
        g = stack(4)
        rotate_gradient(q[at + 3 : at + 7], s, f[0], f[1], f[2], g)
        for i in range(4):
            out[3 + i] += g[i]
