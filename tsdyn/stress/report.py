"""Cases of the gallery: their figures, and the report.

A check takes a `CheckedRun` and returns figures by name; CHECKS lists them. A figure that a case doesn't have is NaN.
"""

import time
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..drawing import BLUE, GREEN, GREY, VERMILION, ZERO, new_figure
from ..errors import TsdynError
from ..integrators import DOP853, Nystrom4, Taylor
from ..maths.tolerances import EPS
from ..simulation.prepared_run import simulate
from ..simulation.solution import Solution
from .gallery import CASES, Case
from .laws import energy_left, findings, resumed_is_same, same_bits

TOLERANCE = 1e-15, 1e-12  # of Taylor, and of the other method
OUTPUTS = 129  # output times of a run
PARTS = 5  # doublings of time, over which the growth of the energy error is fitted
SEEN = 2.0 * EPS  # energy errors below this are rounding: their growth is not fitted


class CheckedRun(NamedTuple):
    """A run of a case by the Taylor integrator, at the limit of rounding."""

    case: Case
    solution: Solution


def run(case):
    """Return the `CheckedRun` of a case."""
    t = np.linspace(0.0, case.end, OUTPUTS)
    options = {"integrator": Taylor(TOLERANCE[0]), "t_eval": t, "dense_output": True}
    return CheckedRun(case, simulate(case.build(), (0.0, case.end), **options))


def size(run):
    """Bodies, constraint rows, steps, and the time of the run, s."""
    scene, stats = run.solution.scene, run.solution.stats
    rows = len(run.solution.system.segments)
    return {"bodies": len(scene.bodies), "rows": rows, "steps": stats.steps, "seconds": stats.seconds["run"]}


def ending(run):
    """Whether the run reached its end, and what it said."""
    return {"success": run.solution.success, "message": run.solution.message}


def constraint_errors(run):
    """Largest constraint errors of position, velocity and acceleration."""
    return {name: float(error.max()) for name, error in run.solution.constraint_error._asdict().items()}


def energy(run):
    """Largest error of energy less work, relative to the energies, and the exponent of its growth with time."""
    left, whole = energy_left(run.solution)
    error = np.abs(run.solution.energy - run.solution.work - run.solution.energy[0]) / (whole or 1.0)
    ends = [(OUTPUTS - 1) >> part for part in range(PARTS)]
    sizes = np.array([np.sqrt(np.mean(error[end // 2 : end + 1] ** 2)) for end in ends])
    seen = sizes > SEEN
    exponent = np.polyfit(np.log(ends)[seen], np.log(sizes[seen]), 1)[0] if seen.sum() > 2 else np.nan
    worst = np.maximum.accumulate(np.abs(error))
    growth = [(i / (OUTPUTS - 1), float(worst[i])) for i in range(1, OUTPUTS)]
    return {"energy": left / (whole or 1.0), "exponent": float(exponent), "growth": growth}


def order(run):
    """Return the observed order of Nystrom4, of three runs with steps halved; declared: 4."""
    end, count = run.case.steps
    scene, ends = run.case.build(), []
    for halving in range(3):
        method = Nystrom4(step=end / (count << halving))
        solution = simulate(scene, (0.0, end), integrator=method, t_eval=(0.0, end))
        if not solution.success:
            return {"order": np.nan}
        ends.append(solution.q[-1])
    coarse, fine = (np.abs(a - b).max() for a, b in pairwise(ends))
    return {"order": float(np.log2(coarse / fine)) if fine > 0.0 else np.nan}


def agreement(run):
    """Largest distance in q from a run by DOP853, relative to the largest coordinate."""
    until = run.case.agree or run.case.end
    t = run.solution.t[run.solution.t <= until]
    other = simulate(run.case.build(), (0.0, t[-1]), integrator=DOP853(*2 * TOLERANCE[1:]), t_eval=t)
    if not other.success:
        return {"agreement": np.nan}
    q = run.solution.q[: t.size]
    return {"agreement": float(np.abs(other.q - q).max() / np.abs(q).max())}


def laws(run):
    """The laws that the run breaks."""
    return {"broken": [str(found) for found in findings(run.solution) if found.broken]}


def repeated(first):
    """Whether a second run gives the same bits."""
    return {"same": same_bits(first.solution, run(first.case).solution)}


def resumed(run):
    """Whether a run that was stopped, and goes on from its checkpoint, gives the same bits; None without h5py."""
    case, options = run.case, {"integrator": Taylor(TOLERANCE[0]), "t_eval": run.solution.t}
    return {"resumed": resumed_is_same(case.build(), (0.0, case.end), run.solution, **options)}


CHECKS = (size, ending, constraint_errors, energy, order, agreement, laws, repeated, resumed)


def figures(case):
    """All figures of a case, by name."""
    began, found = time.perf_counter(), {"case": case.name, "hard": case.hard}
    try:
        made = run(case)
        for check in CHECKS:
            found |= check(made)
    except TsdynError as error:
        found |= without_figures(case, f"{type(error).__name__}: {error}")
    return found | {"wall": time.perf_counter() - began}


def without_figures(case, message):
    """Figures of a case that could not be run."""
    unknown = {"broken": [], "same": True, "resumed": None}
    return {"case": case.name, "hard": case.hard, "success": False, "message": message, **unknown}


# The figure of `tsdyn stress`: constraint errors and energy errors of the cases of the gallery, over time.

COLOURS = 10  # of matplotlib's cycle
LEVELS = (("position", BLUE, "o"), ("velocity", GREEN, "s"), ("acceleration", VERMILION, "^"))


def figure(found):
    """Return a matplotlib Figure: constraint errors of each case, and its energy error over time.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    """
    with new_figure(11.0, 0.34 * len(found) + 2.2) as drawn:
        errors, energies = drawn.subplots(1, 2)
        names = [figures["case"] for figures in found]
        rows = np.arange(len(found))[::-1]
        for level, colour, marker in LEVELS:
            values = [max(figures[level], ZERO) for figures in found]
            errors.plot(values, rows, marker, color=colour, label=level, markersize=5)
        errors.set(xscale="log", yticks=rows, xlabel="largest constraint error (m, m/s, m/s²)")
        errors.set_yticklabels(names)
        errors.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small")
        errors.grid(axis="y", color=GREY, alpha=0.2)
        for i, figures in enumerate(found):
            share, error = np.array(figures["growth"]).T
            style = "-" if i < COLOURS else "--"
            energies.plot(share, np.maximum(error, ZERO), style, linewidth=1.0, label=figures["case"])
        energies.set(xscale="log", yscale="log", xlabel="share of the run", ylabel="relative error of energy")
        energies.legend(fontsize=6, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        for axes in (errors, energies):
            axes.spines[["top", "right"]].set_visible(False)
    return drawn


MARKS = "<!-- tsdyn stress: begin -->", "<!-- tsdyn stress: end -->"  # of a page, around what is written anew
LONGEST = 400  # characters of what a fault said
NONE = "-"  # of a figure that a case doesn't have


class FigureColumn(NamedTuple):
    """A column of the table: its head, the figure, and how that is written."""

    head: str
    figure: str
    spec: str


COLUMNS = (
    FigureColumn("case", "case", ""),
    FigureColumn("bodies", "bodies", "d"),
    FigureColumn("rows", "rows", "d"),
    FigureColumn("steps", "steps", "d"),
    FigureColumn("time (s)", "seconds", ".2f"),
    FigureColumn("Phi", "position", ".1e"),
    FigureColumn("velocity", "velocity", ".1e"),
    FigureColumn("acceleration", "acceleration", ".1e"),
    FigureColumn("energy", "energy", ".1e"),
    FigureColumn("exponent", "exponent", ".2f"),
    FigureColumn("order", "order", ".2f"),
    FigureColumn("methods", "agreement", ".1e"),
    FigureColumn("same bits", "same", "yes"),
    FigureColumn("resumed", "resumed", "yes"),
    FigureColumn("laws", "broken", "kept"),
)
LEGEND = (
    "Taylor at tolerance 1e-15. Phi, velocity, acceleration: largest constraint errors (m, m/s, m/s^2).",
    "energy: error of energy less work, relative to the energies; exponent: of its growth with time, above rounding.",
    "resumed: whether a run that was stopped and goes on from its checkpoint gives the same bits.",
    "order: observed, of Nystrom4 (declared: 4). methods: largest relative distance of q from DOP853 at 1e-12.",
)


def cell(figures, column):
    """Return an entry of the table."""
    value = figures.get(column.figure)
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return NONE
    if column.spec == "yes":
        return "yes" if value else "NO"
    if column.spec == "kept":
        return "kept" if not value else f"{len(value)} BROKEN"
    return format(value, column.spec)


def cells(found, columns=COLUMNS):
    """Return the heads and all entries, as lists of strings."""
    return [[column.head for column in columns], *([cell(figures, column) for column in columns] for figures in found)]


def widths(table):
    """Return the width of each column."""
    return [max(map(len, column)) for column in zip(*table, strict=True)]


def line(row, sizes):
    """Return a row, aligned: the case on the left, figures on the right."""
    first, *rest = (text.rjust(size) for text, size in zip(row, sizes, strict=True))
    return "  ".join([row[0].ljust(len(first)), *rest])


def wrong(figures):
    """Return what is wrong with a case, one line each; nothing if all went well."""
    said = [] if figures["success"] else [figures["message"]]
    said += figures["broken"]
    if not figures["same"]:
        said.append("a second run gave other bits")
    if figures["resumed"] is False:
        said.append("a run that went on from a checkpoint gave other bits")
    return [f"{figures['case']}: {text}" for text in said]


def gallery_text(found):
    """Return the table of the gallery, and what went wrong."""
    table = cells(found)
    sizes = widths(table)
    lines = [line(row, sizes) for row in table]
    return "\n".join([*lines, "", *LEGEND, *(text for figures in found for text in wrong(figures))])


def closed_forms_text(found):
    """Return the table of the closed forms, and why one could not be measured."""
    rows = [("closed form", "error", "allowed", "")]
    rows += [
        (each.name, f"{each.error:.1e}", f"{each.allowed:.1e}", "holds" if each.holds else "OFF") for each in found
    ]
    sizes = widths(rows)
    return "\n".join(
        [*(line(row, sizes) for row in rows), *(f"{each.name}: {each.message}" for each in found if each.message)]
    )


def fault_text(job, outcome):
    """Return a fault, with the command that repeats it."""
    return f"{outcome.word}: {outcome.name}: {outcome.said[:LONGEST]}\n  repeat it: {job.command}"


def tally_text(tally, seed):
    """Return the counts of the random scenes and calls."""
    lines = []
    for kind in ("scenes", "calls"):
        counts = tally.counts[kind]
        if counts:
            lines.append(f"{tally.total(kind)} random {kind}:")
            lines += [f"{count:9d}  {word}" for word, count in counts.most_common()]
    if tally.slowest:
        lines.append(f"The longest scene took {tally.slowest.seconds:.1f} s (seed {tally.slowest.seed}).")
    end = "interrupted" if tally.interrupted else "done"
    return "\n".join([*lines, f"{len(tally.faults)} faults; {end} after {tally.seconds:.0f} s, seed {seed}."])


def as_data(found, closed, tally, seed):
    """Return everything as data."""
    data = {"seed": seed, "gallery": found}
    data["closed_forms"] = [{**each._asdict(), "holds": each.holds} for each in closed]
    if tally is not None:
        faults = [{**outcome._asdict(), "command": job.command} for job, outcome in tally.faults]
        data["fuzz"] = {
            **{kind: dict(counts) for kind, counts in tally.counts.items()},
            "faults": faults, "seconds": tally.seconds, "interrupted": tally.interrupted,
        }  # fmt: skip
    return data


def as_markdown(found, tally):
    """Return the table and what makes each case hard, as Markdown."""
    head, *rows = cells(found)
    lines = ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    lines += ["", *LEGEND, ""]
    if tally is not None:
        done = " and ".join(f"{tally.total(kind)} random {kind}" for kind in tally.counts)
        lines += [f"With it: {done}, {len(tally.faults)} faults.", ""]
    lines += ["| case | what makes it hard |", "|---|---|"]
    shown = {figures["case"] for figures in found}
    lines += [f"| {case.name} | {case.hard} |" for case in CASES if case.name in shown]
    return "\n".join(lines)
