"""The command `tsdyn stress`: the gallery of hard cases, random scenes and random calls."""

import os
import sys
from functools import partial
from pathlib import Path

from ..errors import InvalidArgument
from .parser import print_json
from .run import add_json, add_plot, demand_folder, plotted

BESIDE = {"scenes": 200, "calls": 400}  # random ones beside the gallery
ALONE = {"scenes": 1000, "calls": 4000}  # with --fuzz


def add_options(parser):
    """Add the options of `tsdyn stress` to its parser."""
    parser.add_argument("case", nargs="*", metavar="CASE", help="cases of the gallery, by a part of their names")
    parser.add_argument("--fuzz", action="store_true", help="random scenes and calls only")
    for kind, count in BESIDE.items():
        parser.add_argument(
            f"--{kind}", type=int, metavar="N", help=f"random {kind} (default {count}; with --fuzz {ALONE[kind]})"
        )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the first random scene and calls (default 0)"
    )
    parser.add_argument("--processes", type=int, metavar="N", help="worker processes (default: one a processor)")
    add_json(parser)
    add_plot(parser, "the gallery")
    parser.add_argument(
        "--markdown", metavar="PATH", help="where to write the table as Markdown; in a page with marks, between them"
    )


def _stress(parsed):
    """Run the gallery of hard cases, random scenes and random calls, and judge every run.

    Print the largest constraint errors, the energy error and its growth, the observed order, the agreement of two
    methods, and the laws that a run breaks, for each case; the errors of runs with closed forms; then how random scenes
    and calls came out. A fault is printed with the command that repeats it. Ctrl-C ends with the figures so far. The
    exit code is 0 only if all went well.
    """
    counts, processes = _counts(parsed)
    indices, forms = ([], []) if parsed.fuzz else _cases(parsed.case)
    figure = plotted(parsed, "stress")
    if parsed.markdown:
        demand_folder(parsed.markdown)

    from ..stress import campaign, report

    found, complete = [], True
    if indices:
        show = _shower(len(indices), lambda figures: figures["case"])
        found, complete = campaign.run_gallery(indices, processes, show)
    if found and not parsed.json:
        print(report.gallery_text(found), flush=True)
    closed = []
    if complete and forms:
        show = _shower(len(forms), lambda form: form.name)
        closed, complete = campaign.run_closed_forms(forms, processes, show)
    if closed and not parsed.json:
        print(report.closed_forms_text(closed), flush=True)
    tally = None
    if complete and any(counts.values()):
        plan = list(campaign.jobs(**counts, seed=parsed.seed))
        show = _shower(len(plan), _progress)
        tally = campaign.run(plan, processes, partial(_report, show=show, silent=parsed.json))
        complete = not tally.interrupted
        if not parsed.json:
            print(report.tally_text(tally, parsed.seed))
    if parsed.json:
        print_json(report.as_data(found, closed, tally, parsed.seed))
    if parsed.markdown:
        _write(parsed.markdown, report.as_markdown(found, tally), report.MARKS)
    if figure:
        _draw(found, figure)
    failed = any(report.wrong(figures) for figures in found) or bool(tally and tally.faults)
    failed = failed or not all(form.holds for form in closed)
    return 0 if complete and not failed else 1


def _counts(parsed):
    """Numbers of random scenes and calls, and of processes, checked."""
    usual = ALONE if parsed.fuzz else BESIDE
    if parsed.fuzz and parsed.case:
        raise InvalidArgument(f"--fuzz runs no case of the gallery; leave out {' '.join(parsed.case)} or --fuzz.")
    if parsed.fuzz and (parsed.plot is not None or parsed.markdown):
        raise InvalidArgument("--plot and --markdown show the gallery, which --fuzz doesn't run.")
    counts = {kind: usual[kind] if getattr(parsed, kind) is None else getattr(parsed, kind) for kind in usual}
    if parsed.case and parsed.scenes is None and parsed.calls is None:
        counts = dict.fromkeys(counts, 0)
    processes = (os.cpu_count() or 1) if parsed.processes is None else parsed.processes
    for name, value, least in (*((f"--{kind}", count, 0) for kind, count in counts.items()),
                               ("--seed", parsed.seed, 0), ("--processes", processes, 1)):  # fmt: skip
        if value < least:
            raise InvalidArgument(f"{name} must be a whole number from {least} on, got {value}.")
    return counts, processes


def _cases(words):
    """Indices of the cases, and of the closed forms, that contain one of the words; all without words."""
    from ..stress.closed_forms import CLOSED_FORMS
    from ..stress.gallery import CASES

    names = [case.name for case in CASES], [form.name for form in CLOSED_FORMS]
    known = [*names[0], *names[1]]
    for word in words:
        if not any(word.lower() in name.lower() for name in known):
            raise InvalidArgument(f"no case of the gallery contains {word!r}; there are: {'; '.join(known)}.")
    return [
        [i for i, name in enumerate(own) if not words or any(word.lower() in name.lower() for word in words)]
        for own in names
    ]


def _shower(total, text):
    """A function that shows progress in a terminal, or None."""
    if not sys.stderr.isatty():
        return None
    done = 0

    def show(result):
        nonlocal done
        done += 1
        end = "\n" if done == total else ""
        print(f"\r\033[K{done} of {total}: {text(result)}", end=end, file=sys.stderr, flush=True)

    return show


def _report(tally, new, show, silent):
    """Print faults as they come, and show progress."""
    from ..stress.report import fault_text

    for fault in new:
        if not silent:
            print(fault_text(*fault), flush=True)
    if show:
        show(tally)


def _progress(tally):
    counts = ", ".join(f"{tally.total(kind)} {kind}" for kind in tally.counts)
    return f"{counts}, {len(tally.faults)} faults"


def _write(path, text, marks):
    """Write the table, between the marks of a page that has them."""
    path, (begin, end) = Path(path), marks
    try:
        page = path.read_text() if path.exists() else ""
        before, found, rest = page.partition(begin)
        _, also_found, after = rest.partition(end)
        path.write_text(f"{before}{begin}\n{text}\n{end}{after}" if found and also_found else text + "\n")
    except OSError as error:
        raise InvalidArgument(f"the table can't be written to {path}: {error.strerror}") from error


def _draw(found, path):
    from ..drawing import save
    from ..stress.report import figure

    drawable = [figures for figures in found if "growth" in figures]
    if not drawable:
        raise InvalidArgument("no case has figures to draw.")
    print(f"Figure: {save(figure(drawable), path)}", file=sys.stderr)
