"""The report of `tsdyn stress` as text, as Markdown, as plain data and as a figure."""

from typing import NamedTuple

import numpy as np

from ..drawing import BLUE, GREEN, GREY, VERMILION, new_figure
from .gallery.cases import CASES

# The figure of `tsdyn stress`: constraint errors and energy errors of the cases of the gallery, over time.

COLOURS = 10  # of matplotlib's cycle
ZERO = 1e-17  # what an error of zero is drawn as
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
