"""The commands that measure: profile, benchmark and tables."""

import sys
import time

from ..errors import InvalidArgument
from ..files.run_tables import END
from .parser import print_json
from .run import add_end, add_json, add_method, add_plot, add_scene, options_of, plotted

TOLERANCES = "1e-4,1e-6,1e-8,1e-10"


def add_profile_options(parser):
    """Add the options of `tsdyn profile`."""
    add_scene(parser)
    add_method(parser)
    parser.add_argument("--no-advice", action="store_true", help="don't try other methods and tolerances")
    add_plot(parser, "the shares of the phases")
    add_json(parser)


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
    add_json(parser)


def add_tables_options(parser):
    """Add the options of `tsdyn tables`."""
    add_plot(parser, "constraint errors over time")
    add_json(parser)


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
