"""Unilateral constraints: contacts and stops, whose rows come and go along a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import InvalidConstraint
from ..validation import number, shown
from .element import stop_waiting
from .sliding import _Sliding, _SlidingSurface

if TYPE_CHECKING:
    from .element import Attachment
    from .joint import SumRow
    from .primitive import Primitive


class Grip(NamedTuple):
    """Coulomb friction of a contact: what its phases are made of beside its parts, which hold where it sticks."""

    gap: Primitive  # the row of the gap alone, where the contact slides
    sliding: _Sliding  # and its friction then
    kinetic: float
    static: float


class Side(NamedTuple):
    """One inequality of a unilateral constraint: gap >= 0, and Phi = 0 of its row where the gap is closed."""

    row: Primitive | SumRow  # Phi is its first row; with friction the next two rows of the constraint are of the slip
    sign: float  # of the gap over Phi, where the gap is small
    joint: Any = None  # whose counted angle the gap is measured by, sign (angle - bound); else the gap is sign Phi
    which: int = 0  # angle of the joint
    bound: float = 0.0  # rad
    grip: Grip | None = None
    follows: Any = None  # (joint, kind, index) whose rate, times sign, is not negative: closed wherever that is zero

    @property
    def gap(self) -> Primitive | SumRow:
        """The row of the gap, without those of the slip."""
        return self.grip.gap if self.grip else self.row


class Unilateral:
    """Mixed into a constraint that only pushes, or only pulls.

    Attributes
    ----------
    unilateral : bool
        Whether the constraint opens. A closed one is the bilateral constraint of its rows.
    restitution : float
        Coefficient e of an impact: 0 for plastic, 1 for elastic.
    kinetic, static : float, float or None
        Coefficients of friction: while it slides, and the bound of sticking.
    """

    unilateral = True
    restitution: float
    kinetic: float | None
    static: float | None
    excess = "penetrates"  # what is said of a gap below zero
    _opens_by = "unilateral=True"  # the argument of a constraint that opens

    def _set_law(self, restitution: float, kinetic: float | None = 0.0, static: float | None = None) -> None:
        """Take the coefficients of impact and friction, at the end of `__init__`."""
        self.restitution, self.kinetic, self.static = restitution, kinetic, static
        self._check_law()

    def _check_law(self) -> None:
        """Refuse inadmissible coefficients; of `check`."""
        if not 0.0 <= number(self.restitution) <= 1.0:
            raise InvalidConstraint(
                f"{self.name}: restitution must be a number from 0 (plastic) to 1 (elastic), got "
                f"{shown(self.restitution)}."
            )
        kinetic, static = self.kinetic or 0.0, self.static
        if not 0.0 <= number(kinetic) < math.inf:
            raise InvalidConstraint(
                f"{self.name}: kinetic must be a coefficient of friction, 0 or more, got {shown(kinetic)}."
            )
        if static is not None and not kinetic <= number(static) < math.inf:
            raise InvalidConstraint(
                f"{self.name}: static must be at least kinetic = {kinetic:g}, got {shown(static)}; leave it out where "
                "they are the same."
            )
        friction = "kinetic" if kinetic else "static"
        for what, given in (("restitution", self.restitution != 0.0), (friction, self.has_friction)):
            if given and not self.unilateral:
                raise InvalidConstraint(f"{self.name}: {what} is of a constraint that opens; set {self._opens_by}.")
        for force in self.scene.forces if self.unilateral and self.added else ():
            if getattr(force, "joint", None) is self:
                raise InvalidConstraint(
                    f"{self.name}: {force.name!r} is friction of a contact that doesn't open; remove it, and set "
                    "kinetic and static of the contact."
                )

    @property
    def has_friction(self) -> bool:
        """Whether it has friction."""
        return bool(self.kinetic or self.static)

    @property
    def taken(self) -> int:
        """Numbers that a run sets, with friction: the direction in which it slides, points of b where it sticks."""
        return 3 * len(self.parts) if self.has_friction else 0

    def _grip(self, gap: Primitive, **geometry: Any) -> Grip:
        """Its friction, on the row of its gap; geometry: arguments of the law of sliding, see sliding.py."""
        stop_waiting(gap)
        kind = _SlidingSurface if "semi_axes" in geometry else _Sliding
        sliding = kind(gap, kinetic=self.kinetic, **geometry, name=self.name)
        stop_waiting(sliding)
        gap.__dict__.update(owner=self, name=self.name)
        return Grip(gap, sliding, self.kinetic, self.kinetic if self.static is None else self.static)

    @property
    def sides(self) -> tuple[Any, ...]:
        """Its inequalities, in the order of its rows."""
        return tuple(Side(part, 1.0) for part in self.parts)


def contacts_of(constraints: Any) -> list[Attachment]:
    """The constraints that open."""
    return [each for each in constraints if getattr(each, "unilateral", False)]
