"""Solutions of files whose scenes have functions, or classes, that are not here: looked at, not run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import StorageError
from ..observables.diagnostics import ConstraintError
from .solution import Solution

if TYPE_CHECKING:
    from ..hints import ConstraintError as Errors
    from ..hints import Floats

LEVELS = tuple(f"{level}_error" for level in ConstraintError._fields)
HELD = "multipliers", "power", "potential_energy", *LEVELS


def held(solution: Solution, width: int) -> dict[str, Any]:
    """The arrays of an `Outline` that its scene doesn't tell: of a solution with its scene, for the file."""
    found = {"multipliers": solution.multipliers, "power": solution.power}
    found |= {"potential_energy": solution.potential_energy}
    found |= dict(zip(LEVELS, solution.constraint_error, strict=True))
    shapes = {name: (solution.t.size, *([width] if name == "multipliers" else [])) for name in HELD}
    return {f"held_{name}": np.asarray(array, float).reshape(shapes[name]) for name, array in found.items()}


class Outline(Solution):
    """A solution whose scene lacks the parts that a file names only: they are not drawn, and nothing is run.

    Outputs, kinematics, momenta, energies, power, multipliers and constraint errors are those of the run.
    """

    _held: dict[str, Any]  # arrays of the file
    _content: Any  # numbers and arrays of the file
    _columns: list[int]  # of what is remembered: the angles of the joints that are here
    _row_labels: list[list[str]]  # title and label of each row of Phi
    lacks: str  # what is to be passed, and what isn't there without

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
        raise StorageError(f"solution.{name} needs the scene as it was run. {self.lacks}")

    return refuse


for _name in ("reaction", "reaction_unique", "rows", "at", "power_of", "work_of"):
    setattr(Outline, _name, _refused(_name))
for _name in ("state", "work", "dissipation"):
    setattr(Outline, _name, property(_refused(_name)))


def labelled_rows(solution):
    """Title and label of each row of Phi as they were run."""
    if isinstance(solution, Outline):
        yield from solution._row_labels
        return
    seen = {}
    for member in solution.packed.members:
        title = member.constraint.title
        seen[title] = seen.get(title, 0) + 1
        again = "" if seen[title] == 1 else f" #{seen[title]}"
        yield from ((title + again, label) for label in member.constraint.row_labels)
