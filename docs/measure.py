"""Measure again what the pages have as tables, and write it between their marks.

    python -m docs.measure [methods] [benchmarks] [stress] [--quick]

methods: choosing-a-method.md; benchmarks: benchmarks.md; stress: stress.md and its figure. All of them take an hour or
two, with --quick some minutes. Milliseconds are those of your machine: compare ratios.
"""

import argparse
import math
from pathlib import Path

import tsdyn as ts
from benchmarks import provenance, stiff, work_precision
from benchmarks.measure import Measured, Row
from examples import drive_train, four_bar, stick_slip, top
from tsdyn.cli import main as tsdyn
from tsdyn.stress.gallery import rods
from tsdyn.stress.gallery.single_bodies import kapitza

DOCS = Path(__file__).parent
METHODS = ("taylor", "dop853", "rk45", "nystrom4", "sdirk54", "implicittrapezoid")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
ERRORS = (1e-4, 1e-6, 1e-10)
MOST = 50_000  # steps of a run; one that needs more is left out
SCENES = {  # name: scene, end, s
    "sliding top": (top.build, 2.0),
    "chain of 16 rods": (lambda: rods.build(rods.chain(16)), 1.0),
    "four-bar, 3 redundant rows": (four_bar.build, 2.0),
    "pendulum on a shaken pivot": (kapitza, 1.0),
    "friction in a guide": (stick_slip.build, 0.5),
    "brake and flexible shaft": (drive_train.build, 1.0),
    "stiff joint": (stiff.jointed, 0.3),
    "overdamped springs": (stiff.hung, 0.1),
}
QUICK = ("sliding top", "stiff joint")


def methods(quick):
    """The table of choosing-a-method.md: milliseconds, and steps, to an error."""
    lines = [f"| scene | error | {' | '.join(f'`{name}`' for name in METHODS)} |", "|---|---|" + "---:|" * len(METHODS)]
    for name in QUICK if quick else SCENES:
        build, end = SCENES[name]
        steps = [end / 2**k for k in range(6, 15)]
        found = ts.benchmark(
            build(), METHODS, TOLERANCES[:: 2 if quick else 1], (0.0, end), steps=steps, max_steps=MOST
        )
        rows = tuple(
            Row(row.method.lower(), row.setting, row.value, row.error, row.seconds, row.seconds, 1, row.message)
            for row in found.rows
        )
        measured = Measured(name, 0.0, "", rows)
        for error in ERRORS:
            times = [1e3 * measured.seconds_to(method, error) for method in METHODS]
            best = min(times)
            cells = [_cell(time, time == best) for time in times]
            lines.append(f"| {name}, {end:g} s | {error:.0e} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", f"Milliseconds of a run without its preparation; {provenance.line()}"])


def _cell(time, best):
    text = f"{time:.2g}" if time < 10 else f"{time:.0f}" if math.isfinite(time) else "-"
    return f"**{text}**" if best and math.isfinite(time) else text


def benchmarks(quick):
    """The table of benchmarks.md: milliseconds to an error, of tsdyn and other programs."""
    lines = []
    for one in work_precision.run(Path("benchmarks") / "results", quick=quick):
        lines += [f"**{one.scene}**", "", "| | 1e-4 | 1e-6 | 1e-8 | 1e-10 | 1e-12 |", "|---|---:|---:|---:|---:|---:|"]
        for name in one.contenders():
            times = [1e3 * one.seconds_to(name, 10.0**-k) for k in (4, 6, 8, 10, 12)]
            if any(map(math.isfinite, times)):
                lines.append(f"| {name} | {' | '.join(_cell(time, False) for time in times)} |")
        lines.append("")
    return "\n".join([*lines, f"Milliseconds to an error; {provenance.line()}"])


def stress(quick):
    """The table and the figure of stress.md, by its own command."""
    words = ["squeezer", "governor"] if quick else ["--figure", str(DOCS / "images" / "stress.png")]
    if tsdyn(["stress", *words, "--markdown", str(DOCS / "stress.md")]):
        raise SystemExit("tsdyn stress found faults; the table shows which.")


def marked(page, name, text):
    """A page with the text between its marks."""
    begin, end = (f"<!-- docs.measure {name}: {edge} -->" for edge in ("begin", "end"))
    before, found, rest = page.partition(begin)
    _, also_found, after = rest.partition(end)
    if not (found and also_found):
        raise LookupError(f"the page has no marks of docs.measure {name}")
    return f"{before}{begin}\n{text}\n{end}{after}"


TABLES = {"methods": (methods, "choosing-a-method.md"), "benchmarks": (benchmarks, "benchmarks.md")}


def main():
    """Measure what is named, or everything."""
    parser = argparse.ArgumentParser(prog="python -m docs.measure", description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="part", help="methods, benchmarks, stress; all where none is named")
    parser.add_argument("--quick", action="store_true", help="few scenes and settings")
    given = parser.parse_args()
    unknown = {*given.parts} - {*TABLES, "stress"}
    if unknown:
        parser.error(f"no part {', '.join(sorted(unknown))}; there are methods, benchmarks, stress")
    for name, (measure, page) in TABLES.items():
        if not given.parts or name in given.parts:
            text = measure(given.quick)
            path = DOCS / page
            path.write_text(marked(path.read_text(encoding="utf-8"), name, text), encoding="utf-8")
    if not given.parts or "stress" in given.parts:
        stress(given.quick)


if __name__ == "__main__":
    main()
