"""The result of `benchmark`: rows, their table, and the figure."""

from __future__ import annotations

import datetime
import html
import platform
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..drawing import Drawn

if TYPE_CHECKING:
    from ..hints import Reference, Solution

COUNTS = (
    "steps",
    "rejected",
    "evaluations",
    "placements",
    "jacobians",
    "iteration_matrices",
    "factorizations",
    "charts",
)
HEADS = ("steps", "rejected", "evaluations", "placements", "Jacobians", "iter.mat.", "factor.", "charts")


class Row(NamedTuple):
    """One method at one tolerance, or of one step; nan and zeros where it didn't run to the end."""

    method: str
    setting: str  # "tolerance" or "step"
    value: float  # the tolerance, or the step in s
    error_r: float  # m, largest over all bodies and outputs
    error_A: float  # entries of the rotation matrix
    trusted: bool  # whether the error is above what the reference is trusted to
    seconds: float  # median over the repeats, of the run without its preparation
    steps: int
    rejected: int
    evaluations: int
    placements: int
    jacobians: int
    iteration_matrices: int
    factorizations: int
    charts: int
    status: str
    message: str  # empty for a run that reached its end

    @property
    def error(self) -> float:
        """The larger of the two."""
        return max(self.error_r, self.error_A)

    @classmethod
    def of(
        cls,
        method: str,
        setting: str,
        value: float,
        solution: Solution | None,
        off: tuple[float, float],
        floor: float,
        message: str,
    ) -> Row:
        """The row of a run that has not been timed."""
        stats = None if solution is None else solution.stats
        counts = {name: getattr(stats, name, 0) for name in COUNTS}
        status = "refused" if solution is None else str(solution.status)
        return cls(
            method, setting, value, *off, bool(max(off) > floor), np.nan, **counts, status=status, message=message
        )


class Benchmark(Drawn):
    """Run time against error of methods on one scene.

    Attributes
    ----------
    rows : tuple of Row
    reference : agreement.Reference, or None if it was interrupted before there was one
    reference_digits : float
        Decimals of positions (m) and rotation matrices that the reference is trusted to.
    interrupted : bool
        Whether Ctrl-C ended it; rows not reached are missing, those not timed have nan seconds.
    machine : str
        Processor, versions and date.
    """

    def __init__(
        self,
        rows: tuple[Row, ...],
        reference: Reference | None,
        span: tuple[float, float],
        formulation: str,
        repeats: int,
        interrupted: bool,
    ) -> None:
        self.rows, self.reference, self.span, self.formulation = rows, reference, span, formulation
        self.repeats, self.interrupted, self.machine = repeats, interrupted, machine()

    @property
    def reference_digits(self) -> float:
        """Decimals that the reference is trusted to; 0 without one."""
        return 0.0 if self.reference is None else self.reference.digits

    def table(self) -> str:
        """The rows as text, with where the errors come from and the machine."""
        if self.reference is None:
            return "Benchmark, interrupted before there was a reference."
        head = [
            f"Run time against error, {self.span[0]:g} to {self.span[1]:g} s, formulation {self.formulation!r}.",
            f"Errors are the largest over all bodies and {self.reference.t.size} outputs; run times are medians of "
            f"{self.repeats} interleaved runs, without compilation and preparation.",
            f"Reference: {self.reference.source}; {self.reference_digits:.1f} digits are trusted.",
            *(["* below what the reference is trusted to."] if self._marked() else []),
            *(["Interrupted: what there was so far."] if self.interrupted else []),
            self.machine,
            "",
        ]
        cells = [_HEAD, *(_cells(row) for row in self.rows)]
        widths = [max(len(line[i]) for line in cells) for i in range(len(_HEAD))]
        lines = [
            "  ".join(
                cell.ljust(w) if i in _LEFT else cell.rjust(w)
                for i, (cell, w) in enumerate(zip(line, widths, strict=True))
            )
            for line in cells
        ]
        return "\n".join([*head, *(line.rstrip() for line in lines), *self._messages()])

    def _marked(self):
        return any(not row.trusted and not row.message for row in self.rows)

    def _messages(self):
        return [f"{row.method}, {row.setting} {row.value:g}: {row.message}" for row in self.rows if row.message]

    __str__ = table

    def __repr__(self) -> str:
        return f"<Benchmark: {len(self.rows)} runs, reference trusted to {self.reference_digits:.1f} digits>"

    def _repr_html_(self) -> str:
        """The table in a notebook."""
        lines = [f"<th>{html.escape(cell)}</th>" for cell in _HEAD]
        rows = [
            "".join(lines),
            *("".join(f"<td>{html.escape(cell)}</td>" for cell in _cells(row)) for row in self.rows),
        ]
        notes = "<br>".join(html.escape(text) for text in (*self._messages(), self.machine))
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return (
            f"<table><caption>Run time against error; {self.reference_digits:.1f} digits of the reference are trusted"
            f"</caption>{body}</table><p>{notes}</p>"
        )

    def figure(self) -> Any:
        """Draw it; return the matplotlib Figure."""
        from .figure import figure

        return figure({"": self})


_HEAD = ("method", "tol or step", "error r (m)", "error A", "", "time (ms)", *HEADS, "status")
_LEFT = (0, 4, len(_HEAD) - 1)


def _cells(row):
    setting = f"{row.value:.0e}" if row.setting == "tolerance" else f"{row.value:g} s"
    off = [f"{value:.1e}" if np.isfinite(value) else "-" for value in (row.error_r, row.error_A)]
    mark = "" if row.trusted or row.message else "*"
    seconds = f"{1e3 * row.seconds:.3g}" if np.isfinite(row.seconds) else "-"
    return (row.method, setting, *off, mark, seconds, *(str(getattr(row, name)) for name in COUNTS), row.status)


def machine() -> str:
    """Processor, versions and date in one line."""
    from .._version import __version__

    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [
            line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        name = models[0] if models else name
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, Numba {version('numba')}"
    return f"{name}, {platform.system()}; tsdyn {__version__}, {versions}; {datetime.date.today()}."
