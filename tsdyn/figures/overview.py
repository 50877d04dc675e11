"""`solution.plot()`: constraint errors, energies, steps and charts of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..drawing import GREY, save
from ..errors import InvalidArgument
from .axes import axes_of
from .errors import constraint_error
from .history import charts, energy, steps

if TYPE_CHECKING:
    from ..hints import Solution

SIZE = 11.0, 7.5  # inches


def overview(solution: Solution, path: Any = None) -> Any:
    """What `Solution.plot` does."""
    axes = axes_of(None, 2, 2, figsize=SIZE, sharex=True)
    constraint_error(solution, axes[0, 0])
    energy(solution, axes[0, 1])
    for ax, draw in ((axes[1, 0], steps), (axes[1, 1], charts)):
        try:
            draw(solution, ax)
        except InvalidArgument:  # no histories
            ax.text(0.5, 0.5, "no history kept", color=GREY, ha="center", transform=ax.transAxes)
            ax.set_xlabel("time (s)")
    axes[0, 0].figure.suptitle(f"{solution.method}, formulation {solution.formulation}", x=0.01, ha="left")
    if path is not None:
        save(axes[0, 0].figure, path)
    return axes
