"""Measure again what the pages have as tables, and write it between their marks.

    python -m docs.measure [methods] [benchmarks] [stiff] [ensembles] [contacts] [stress] [--quick]

methods: choosing-a-method.md; benchmarks, stiff: benchmarks.md; ensembles: ensembles.md; contacts: how-to/contact.md;
stress: stress.md and its figure. All of them take some hours, with --quick some minutes. Milliseconds are those of your
machine: compare ratios.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np

import tsdyn as ts
from benchmarks import contacts as contact_peers
from benchmarks import ensemble_peers, provenance, stiff, stiff_peers, work_precision
from examples import drive_train, four_bar, stick_slip, top
from tsdyn.cli import main as tsdyn
from tsdyn.measuring.benchmark import agreed
from tsdyn.stress import rods
from tsdyn.stress.gallery import kapitza

DOCS = Path(__file__).parent
METHODS = ("taylor", "dop853", "rk45", "nystrom4", "radau", "sdirk54", "implicittrapezoid")
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
ERRORS = (1e-4, 1e-6, 1e-10)
MOST = 20_000  # steps of a run; one that needs more is left out
CALLS, LONGEST = 8, 1.5  # calls that are timed, as far as they take no longer than so many seconds together
LONGEST_STIFF = 4.0  # s: settings of a contender end with one that takes longer
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
    """The table of choosing-a-method.md: processor time to an error, of the loosest setting that reaches it."""
    lines = [f"| scene | error | {' | '.join(f'`{name}`' for name in METHODS)} |", "|---|---|" + "---:|" * len(METHODS)]
    for name in QUICK if quick else SCENES:
        build, end = SCENES[name]
        span, times = (0.0, end), np.array([0.0, end])
        reference = agreed(build(), span, times, 10 * MOST)
        steps = [end / 2**k for k in range(5, 15)]
        found = ts.benchmark(
            build(), METHODS, TOLERANCES, span, steps=steps, max_steps=MOST, repeats=1, reference=reference
        )
        for error in ERRORS:
            cells = [_milliseconds(build(), span, found.rows, method, error) for method in METHODS]
            lines.append(
                f"| {name}, {end:g} s | {error:.0e} | {' | '.join(_cell(x, x == min(cells)) for x in cells)} |"
            )
        print("\n".join(lines[-len(ERRORS) :]), flush=True)
    return "\n".join([*lines, "", f"Milliseconds of processor time of a warm call; {provenance.line()}"])


def _milliseconds(scene, span, rows, method, error):
    """Median processor time of a call at the cheapest of the settings that reach the error; inf if none does."""
    fitting = [row for row in rows if row.method.lower() == method and not row.message and row.error <= error]
    if not fitting:
        return math.inf
    best = min(fitting, key=lambda row: row.seconds)
    kind = getattr(ts.integrators, best.method)
    chosen = kind(step=best.value) if best.setting == "step" else kind(rtol=best.value, atol=best.value)
    taken = []
    while len(taken) < CALLS and sum(taken) < LONGEST:
        begin = time.process_time()
        ts.simulate(scene, span, integrator=chosen, t_eval=span)
        taken.append(time.process_time() - begin)
    return 1e3 * float(np.median(taken[1:] or taken))


def _cell(spent, best):
    text = f"{spent:.2g}" if spent < 10 else f"{spent:.0f}" if math.isfinite(spent) else "-"
    return f"**{text}**" if best and math.isfinite(spent) else text


def benchmarks(quick):
    """The table of benchmarks.md: milliseconds to an error, of tsdyn and other programs."""
    found = work_precision.run(Path("benchmarks") / "results", quick=quick)
    return "\n".join([*map(_table, found), f"Milliseconds to an error; {provenance.line()}"])


def ensembles(quick):
    """The table of ensembles.md: milliseconds a case and core to an error, of tsdyn and other programs."""
    names, rounds = (ensemble_peers.NAMES[:1], 3) if quick else (ensemble_peers.NAMES, ensemble_peers.ROUNDS)
    found = ensemble_peers.measured(ensemble_peers.contenders()[0], rounds, names=names)
    tables = [_table(one, ensemble_peers.ERRORS) for one in found]
    return "\n".join([*tables, f"Milliseconds of processor time a case and core to an error; {provenance.line()}"])


def _table(measured, errors=(1e-4, 1e-6, 1e-8, 1e-10, 1e-12)):
    """A scene's title and table."""
    head = " | ".join(f"{error:.0e}".replace("e-0", "e-") for error in errors)
    lines = [f"**{measured.scene}**", "", f"| | {head} |", "|---|" + "---:|" * len(errors)]
    for name in measured.contenders():
        times = [1e3 * measured.seconds_to(name, error) for error in errors]
        if any(map(math.isfinite, times)):
            lines.append(f"| {name} | {' | '.join(_cell(spent, False) for spent in times)} |")
    text = "\n".join([*lines, ""])
    print(text, flush=True)
    return text


def stiff_scenes(quick):
    """The table of benchmarks.md: milliseconds to an error of stiff scenes, of tsdyn and other programs."""
    scenes = {"chain of 4": stiff_peers.SCENES["chain of 4"]} if quick else stiff_peers.SCENES
    errors, lines = [f"{level:.0e}" for level in stiff_peers.LEVELS], []
    for scene, case in scenes.items():
        begin = len(lines)
        lines += [f"**{scene}, {case.end:g} s**", "", f"| | {' | '.join(errors)} |", "|---|" + "---:|" * len(errors)]
        found = {name: stiff_peers.times(*points) for name, points in stiff_peers.measure(case, LONGEST_STIFF).items()}
        for name, seconds in found.items():
            lines.append(f"| {name} | {' | '.join(_cell(1e3 * s, False) for s in seconds)} |")
        if not np.isfinite([*found.values()]).any():
            lines[begin:] = [f"**{scene}, {case.end:g} s**: no run within {LONGEST_STIFF:g} s is as exact."]
        lines.append("")
        print("\n".join(lines[begin:]), flush=True)
    return "\n".join([*lines, f"Milliseconds to an error of positions, m; {provenance.line()}"])


def contacts(quick):
    """The table of how-to/contact.md: errors and milliseconds of contacts, of tsdyn and other programs."""
    lines = [*contact_peers.table(*([("ball", "chain")] if quick else []))]
    return "\n".join([*lines, "", provenance.line()])


def stress(quick):
    """The table and the figure of stress.md, by its own command."""
    words = ["squeezer", "governor"] if quick else ["--plot", str(DOCS / "images" / "stress.png")]
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


TABLES = {
    "methods": (methods, "choosing-a-method.md"),
    "benchmarks": (benchmarks, "benchmarks.md"),
    "stiff": (stiff_scenes, "benchmarks.md"),
    "ensembles": (ensembles, "ensembles.md"),
    "contacts": (contacts, "how-to/contact.md"),
}
PARTS = ", ".join([*TABLES, "stress"])


def main():
    """Measure what is named, or everything."""
    parser = argparse.ArgumentParser(prog="python -m docs.measure", description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="part", help=f"{PARTS}; all where none is named")
    parser.add_argument("--quick", action="store_true", help="few scenes and settings")
    given = parser.parse_args()
    unknown = {*given.parts} - {*TABLES, "stress"}
    if unknown:
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {PARTS}")
    for name, (measure, page) in TABLES.items():
        if not given.parts or name in given.parts:
            text = measure(given.quick)
            path = DOCS / page
            path.write_text(marked(path.read_text(encoding="utf-8"), name, text), encoding="utf-8")
    if not given.parts or "stress" in given.parts:
        stress(given.quick)


if __name__ == "__main__":
    main()
