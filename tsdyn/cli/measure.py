"""The commands that measure: profile, benchmark, tables and stress."""

import sys
import time
from functools import partial
from pathlib import Path

from ..ahead import processors
from ..errors import InvalidArgument
from ..files.run_tables import END
from .parser import print_json
from .run import add_end, add_method, add_plot, add_scene, demand_folder, options_of, plotted

TOLERANCES = "1e-4,1e-6,1e-8,1e-10"


def add_profile_options(parser):
    """Add the options of `tsdyn profile`."""
    add_scene(parser)
    add_method(parser)
    parser.add_argument("--no-advice", action="store_true", help="don't try other methods and tolerances")
    add_plot(parser, "the shares of the phases")


def add_benchmark_options(parser):
    """Add the options of `tsdyn benchmark`."""
    add_scene(parser)
    add_end(parser)
    parser.add_argument("--methods", metavar="NAMES", help="such as taylor,dop853 (default: all adaptive ones)")
    parser.add_argument("--tolerances", default=TOLERANCES, metavar="LIST", help=f"default {TOLERANCES}")
    parser.add_argument("--steps", default="", metavar="LIST", help="of methods with fixed step, such as 1e-2,1e-3")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="timed runs of each (default 3)")
    parser.add_argument("--formulation", default="tangent", metavar="NAME", help="tangent, null-space or maggi-kane")
    add_plot(parser, "run time against error")


def _profile(parsed):
    """Measure where the time of a run of a scene goes, and what to change.

    Run a scene several times, print the time of each phase of a run, what was skipped, and what to change. Options that
    are not given are those of the file, else of ts.simulate.
    """
    from ..measuring.profile import profile
    from .parser import load_run, robot_options

    began = time.perf_counter()
    scene, given = load_run(parsed.scene, parsed.allow_code, robot_options(parsed))
    (span, options), figure = options_of(parsed, given), plotted(parsed, "profile")
    if not parsed.json:
        print(f"{scene!r}, built in {1e3 * (time.perf_counter() - began):.3g} ms", flush=True)
    found = profile(scene, span, advice=not parsed.no_advice, **options)
    if parsed.json:
        phases = [{**phase._asdict(), "each": phase.each} for phase in found.phases]
        print_json({"seconds": found.seconds, "driver": found.driver, "phases": phases, "once": found.once,
                    "skipped": found.skipped, "advice": found.advice, "method": found.solution.method})  # fmt: skip
    else:
        print(found)
    _drawn(found, figure, parsed)
    return 0


def _benchmark(parsed):
    """Measure run time against error of integration methods on a scene.

    Every method runs at every tolerance, against a reference that two methods agree on. The exit code is 0 only if
    a run of each method reached its end.
    """
    from ..measuring.benchmark import benchmark
    from .parser import load_run, robot_options

    tolerances, steps = _numbers(parsed.tolerances, "--tolerances"), _numbers(parsed.steps, "--steps")
    methods = None if parsed.methods is None else [word.strip() for word in parsed.methods.split(",")]
    scene, given = load_run(parsed.scene, parsed.allow_code, robot_options(parsed))
    start, end = given.get("t_span", (0.0, END))
    span, figure = (start, end if parsed.to is None else parsed.to), plotted(parsed, "benchmark")
    if not parsed.json:
        print(f"{parsed.scene}: {scene!r}", flush=True)
    found = benchmark(scene, methods, tolerances, span, steps=steps, repeats=parsed.repeats,
                      formulation=parsed.formulation)  # fmt: skip
    if parsed.json:
        print_json({"interrupted": found.interrupted, "rows": [row._asdict() for row in found.rows]})
    else:
        print(found)
    _drawn(found, figure, parsed)
    ended = {row.method: any(not one.message for one in found.rows if one.method == row.method) for row in found.rows}
    return 0 if all(ended.values()) and not found.interrupted else 1


def _numbers(words, option):
    try:
        return [float(word) for word in words.split(",") if word.strip()]
    except ValueError:
        raise InvalidArgument(f"{option} must be numbers with commas between them, got {words!r}.") from None


def _drawn(found, path, parsed):
    if path:
        found.plot(path)
        print(f"Figure: {path}", file=sys.stderr if parsed.json else sys.stdout)


def _tables(parsed):
    """Measure the constraint errors of Haug (2018), Tables 1 and 2.

    Run the sliding top and the two-body pendulum of Haug (2018), and print the largest constraint errors beside the
    published ones. The exit code is 1 where a bound is broken.
    """
    # imported here: the command line answers without what a run needs
    from ..measuring.haug_tables import as_text, reproduce

    figure = plotted(parsed, "tables")
    tables = reproduce()
    if parsed.json:
        print_json({"within": all(table.within for table in tables), "tables": [_data(table) for table in tables]})
    else:
        print(as_text(tables), flush=True)
    if figure:
        from ..plots import save, tables_figure

        print(f"Figure: {save(tables_figure(tables), figure)}", file=sys.stderr if parsed.json else sys.stdout)
    return 0 if all(table.within for table in tables) else 1


def _data(table):
    rows = [{"method": name, "tolerance": row.tolerance, "measured": row.measured, "published": row.published,
             "seconds": row.seconds} for name, rows in (("tangent", table.rows), ("maggi-kane", table.baseline))
            for row in rows]  # fmt: skip
    return {"title": table.experiment.title, "within": bool(table.within), "rows": rows}


# The command `tsdyn stress`: the gallery of hard cases, random scenes and random calls.

BESIDE = {"scenes": 200, "calls": 400}  # random ones beside the gallery
ALONE = {"scenes": 1000, "calls": 4000}  # with --fuzz


def add_stress_options(parser):
    """Add the options of `tsdyn stress`."""
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

    from ..stress import campaign

    found, complete = [], True
    if indices:
        show = _shower(len(indices), lambda figures: figures["case"])
        found, complete = campaign.run_gallery(indices, processes, show)
    if found and not parsed.json:
        print(campaign.gallery_text(found), flush=True)
    closed = []
    if complete and forms:
        show = _shower(len(forms), lambda form: form.name)
        closed, complete = campaign.run_closed_forms(forms, processes, show)
    if closed and not parsed.json:
        print(campaign.closed_forms_text(closed), flush=True)
    tally = None
    if complete and any(counts.values()):
        plan = list(campaign.jobs(**counts, seed=parsed.seed))
        show = _shower(len(plan), _progress)
        tally = campaign.run(plan, processes, partial(_report, show=show, silent=parsed.json))
        complete = not tally.interrupted
        if not parsed.json:
            print(campaign.tally_text(tally, parsed.seed))
    if parsed.json:
        print_json(campaign.as_data(found, closed, tally, parsed.seed))
    if parsed.markdown:
        _write(parsed.markdown, campaign.as_markdown(found, tally), campaign.MARKS)
    if figure:
        _draw(found, figure)
    failed = any(campaign.wrong(figures) for figures in found) or bool(tally and tally.faults)
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
    processes = processors() if parsed.processes is None else parsed.processes
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
    from ..stress.campaign import fault_text

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
    from ..stress.campaign import figure

    drawable = [figures for figures in found if "growth" in figures]
    if not drawable:
        raise InvalidArgument("no case has figures to draw.")
    print(f"Figure: {save(figure(drawable), path)}", file=sys.stderr)
