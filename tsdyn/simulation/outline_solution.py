"""Solutions of files whose scenes have functions, or classes, that are not here: read, not run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import StorageError
from ..observables.diagnostics import ConstraintError
from .saved_solutions import LEVELS
from .solution import Solution

if TYPE_CHECKING:
    from ..hints import ConstraintError as Errors
    from ..hints import Floats


class Outline(Solution):
    """A solution whose scene lacks the parts that a file names only: they are not drawn, and nothing is run.

    Outputs, kinematics, momenta and kinetic energy are those of the run. So are potential energy, power, multipliers
    and constraint errors of a saved solution; of a store they are NaN.
    """

    _held: dict[str, Any]  # arrays of the file
    _content: Any  # numbers and arrays of the file
    _columns: list[int]  # of what is remembered: the angles of the joints that are here
    _row_labels: list[list[str]]  # title and label of each row of Phi

    def _set_remembered(self, rest):
        self._all_remembered = rest
        super()._set_remembered(rest[:, self._columns])

    def _of_run(self, name):
        return self._held[f"held_{name}"][self._slice]

    @property
    def multipliers(self) -> Floats:  # type: ignore[override]
        """Multipliers (k, m) of the run."""
        return self._of_run("multipliers")

    @property
    def power(self) -> Floats:  # type: ignore[override]
        """Power of the run (k,), W."""
        return self._of_run("power")

    @property
    def potential_energy(self) -> Floats:  # type: ignore[override]
        """Potential energy of the run (k,), J."""
        return self._of_run("potential_energy")

    @property
    def constraint_error(self) -> Errors:  # type: ignore[override]
        """Constraint errors of the run, (k,) each."""
        return ConstraintError(*map(self._of_run, LEVELS))


def _refused(name):
    def refuse(self, *_, **__):
        raise StorageError(f"solution.{name} needs the scene as it was run. {self._lacks}")

    return refuse


for _name in (
    "actuation",
    "contact_point",
    "friction_demand",
    "reaction",
    "reaction_unique",
    "rows",
    "at",
    "power_of",
    "work_of",
):
    setattr(Outline, _name, _refused(_name))
for _name in ("state", "work", "dissipation"):
    setattr(Outline, _name, property(_refused(_name)))
