"""Unilateral constraints: contacts and stops, whose rows come and go along a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import InvalidConstraint
from ..validation import number, shown

if TYPE_CHECKING:
    from .element import Attachment
    from .joint import SumRow
    from .primitive import Primitive


class Side(NamedTuple):
    """One inequality of a unilateral constraint: gap >= 0, and Phi = 0 of its row where the gap is closed."""

    row: Primitive | SumRow
    sign: float  # of the gap over Phi, where the gap is small
    joint: Any = None  # whose counted angle the gap is measured by, sign (angle - bound); else the gap is sign Phi
    which: int = 0  # angle of the joint
    bound: float = 0.0  # rad
    follows: Any = None  # joint whose rate, times sign, is not negative: the gap is closed wherever that is zero


class Unilateral:
    """Mixed into a constraint that only pushes, or only pulls.

    Attributes
    ----------
    unilateral : bool
        Whether the constraint opens. A closed one is the bilateral constraint of its rows.
    restitution : float
        Coefficient e of an impact: 0 for plastic, 1 for elastic.
    """

    unilateral = True
    restitution: float
    excess = "penetrates"  # what is said of a gap below zero
    _opens_by = "unilateral=True"  # the argument of a constraint that opens

    def _set_law(self, restitution: float, kinetic: float = 0.0, static: float | None = None) -> None:
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
        if self.kinetic != 0.0 or self.static is not None:
            raise InvalidConstraint(
                f"{self.name}: friction of unilateral contacts is not available yet: leave out kinetic and static."
            )
        if not self.unilateral and self.restitution != 0.0:
            raise InvalidConstraint(f"{self.name}: restitution is of a constraint that opens; set {self._opens_by}.")

    @property
    def sides(self) -> tuple[Any, ...]:
        """Its inequalities, in the order of its rows."""
        return tuple(Side(part, 1.0) for part in self.parts)


def contacts_of(constraints: Any) -> list[Attachment]:
    """The constraints that open."""
    return [each for each in constraints if getattr(each, "unilateral", False)]
