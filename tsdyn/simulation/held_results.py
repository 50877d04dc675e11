"""Results of a run that its scene is needed for, as a file holds them where it can't hold the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..observables.diagnostics import ConstraintError

if TYPE_CHECKING:
    from ..hints import Solution

LEVELS = tuple(f"{level}_error" for level in ConstraintError._fields)
HELD = "multipliers", "power", "potential_energy", *LEVELS


def held(solution: Solution, width: int) -> dict[str, Any]:
    """The arrays of an `Outline` that its scene doesn't tell: of a solution with its scene, for the file."""
    found = {"multipliers": solution.multipliers, "power": solution.power}
    found |= {"potential_energy": solution.potential_energy}
    found |= dict(zip(LEVELS, solution.constraint_error, strict=True))
    shapes = {name: (solution.t.size, *([width] if name == "multipliers" else [])) for name in HELD}
    return {f"held_{name}": np.asarray(array, float).reshape(shapes[name]) for name, array in found.items()}


def labelled_rows(solution):
    """Title and label of each row of Phi as they were run."""
    if solution.lacks:
        yield from solution._row_labels
        return
    seen = {}
    for member in solution.packed.members:
        title = member.constraint.title
        seen[title] = seen.get(title, 0) + 1
        again = "" if seen[title] == 1 else f" #{seen[title]}"
        yield from ((title + again, label) for label in member.constraint.row_labels)
