"""`Comparison`: how far the run of another engine is from the reference."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..drawing import BLUE, VERMILION, Drawn, new_figure

if TYPE_CHECKING:
    from ..hints import Floats

LEAST = 1e-17  # drawn on a logarithmic axis in place of zero


class Levels(NamedTuple):
    """What a trajectory does to constraints and energy, (k,) each."""

    position: Floats  # largest |Phi|
    velocity: Floats  # largest |Phi_q qd + Phi_t|
    energy: Floats  # J


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Drawn):
    """The result of `ts.compare`.

    Attributes
    ----------
    engine, method : str
    step : float, s
    t : ndarray (k,), s
    names : tuple of str
        Of the bodies.
    position_error : ndarray (k, b), m
        Distance of each centroid from where tsdyn has it.
    rotation_error : ndarray (k, b), rad
    theirs, ours : Levels
        Of the engine, and of tsdyn: `position`, `velocity` (largest constraint residuals), `energy` (J), (k,) each.
    seconds, reference_seconds : float, s
        Of the steps of the engine, and of tsdyn's run at 1e-12.
    reached : bool
        Whether the engine's run remained finite up to its end.
    """

    engine: str
    method: str
    step: float
    t: Floats
    names: tuple[str, ...]
    position_error: Floats
    rotation_error: Floats
    theirs: Levels
    ours: Levels
    seconds: float
    reference_seconds: float
    reached: bool

    @property
    def error(self) -> Floats:
        """The largest distance of a centroid from where it should be (k,), m."""
        return self.position_error.max(axis=1)

    def rows(self) -> list[tuple[str, str, str]]:
        """What is compared, of the engine and of tsdyn."""
        drift = [float(np.abs(one.energy - one.energy[0]).max()) for one in (self.theirs, self.ours)]
        levels = [
            [float(getattr(one, name).max()) for one in (self.theirs, self.ours)] for name in ("position", "velocity")
        ]
        worst = self.names[int(self.position_error.max(axis=0).argmax())]
        return [
            ("largest error of a position (m)", f"{self.error.max():.2e} ({worst})", ""),
            ("at the end (m)", f"{self.error[-1]:.2e}", ""),
            ("largest error of a rotation (rad)", f"{self.rotation_error.max():.2e}", ""),
            ("constraint violation, position", *(f"{x:.1e}" for x in levels[0])),
            ("constraint violation, velocity", *(f"{x:.1e}" for x in levels[1])),
            ("largest change of energy (J)", *(f"{x:.2e}" for x in drift)),
            ("time of the run (s)", f"{self.seconds:.3g}", f"{self.reference_seconds:.3g}"),
        ]

    def __str__(self) -> str:
        heads = f"{self.engine}, {self.method}, step {self.step:g} s", "tsdyn at 1e-12"
        rows = [("", *heads), *self.rows()]
        widths = [max(len(row[i]) for row in rows) for i in range(3)]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        if not self.reached:
            lines.append(f"The engine's run is not finite after t = {self.t[-1]:g} s.")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Comparison with {self.engine}: error {self.error.max():.2e} m after {self.t[-1] - self.t[0]:g} s>"

    def _repr_html_(self) -> str:
        heads = f"<tr><th></th><th>{html.escape(f'{self.engine}, {self.method}')}</th><th>tsdyn at 1e-12</th></tr>"
        rows = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in self.rows())
        return f"<table>{heads}{rows}</table>"

    def figure(self) -> Any:
        """The matplotlib Figure: error, constraint violation and energy against time, and cost."""
        with new_figure(9.0, 6.0) as figure:
            (error, violation), (energy, cost) = figure.subplots(2, 2)
            error.semilogy(self.t, np.maximum(self.error, LEAST), color=VERMILION, label="position (m)")
            angle = np.maximum(self.rotation_error.max(axis=1), LEAST)
            error.semilogy(self.t, angle, color=VERMILION, linestyle="--", label="rotation (rad)")
            error.set(xlabel="time (s)", ylabel="largest error", title=f"{self.engine}, {self.method}, {self.step:g} s")
            for one, colour, name in ((self.theirs, VERMILION, self.engine), (self.ours, BLUE, "tsdyn")):
                violation.semilogy(self.t, np.maximum(one.position, LEAST), color=colour, label=name)
                violation.semilogy(self.t, np.maximum(one.velocity, LEAST), color=colour, linestyle="--")
                change = np.maximum(np.abs(one.energy - one.energy[0]), LEAST)
                energy.semilogy(self.t, change, color=colour, label=name)
            violation.set(
                xlabel="time (s)", ylabel="position (m), velocity (m/s, dashed)", title="constraint violation"
            )
            energy.set(xlabel="time (s)", ylabel="change (J)", title="energy")
            cost.barh([self.engine, "tsdyn, 1e-12"], [self.seconds, self.reference_seconds], color=[VERMILION, BLUE])
            cost.set(xlabel="time of the run (s)", title="cost")
            for axes in (error, violation, energy):
                axes.legend(fontsize=8)
        return figure
