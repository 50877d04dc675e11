"""The commands that measure: profile, benchmark and tables."""

import sys
import time

from ..errors import InvalidArgument, MissingDependency
from .output import print_json
from .run import add_json, add_scene

DEFAULT_FIGURE = "tables.png"
TOLERANCES = "1e-4,1e-6,1e-8,1e-10"


def add_profile_options(parser):
    """Add the options of `tsdyn profile`."""
    add_scene(parser)
    parser.add_argument("--t-start", type=float, default=0.0, metavar="S", help="start of the run (default 0)")
    parser.add_argument("--t-end", "--to", type=float, default=10.0, metavar="S", help="end of the run (default 10)")
    parser.add_argument("--method", metavar="NAME", help="an integrator, such as dop853")
    parser.add_argument("--rtol", type=float, metavar="TOL", help="relative tolerance")
    parser.add_argument("--atol", type=float, metavar="TOL", help="absolute tolerance")
    parser.add_argument("--formulation", default="tangent", metavar="NAME", help="tangent, null-space or maggi-kane")
    parser.add_argument("--outputs", type=int, metavar="N", help="so many output times instead of every step")
    parser.add_argument("--no-advice", action="store_true", help="don't try other methods and tolerances")
    parser.add_argument("--figure", metavar="PATH", help="where to draw it; the suffix says how")
    add_json(parser)


def add_benchmark_options(parser):
    """Add the options of `tsdyn benchmark`."""
    add_scene(parser)
    parser.add_argument("--to", type=float, default=10.0, metavar="S", help="end of the runs (default 10)")
    parser.add_argument("--methods", metavar="NAMES", help="such as taylor,dop853 (default: all adaptive ones)")
    parser.add_argument("--tolerances", default=TOLERANCES, metavar="LIST", help=f"default {TOLERANCES}")
    parser.add_argument("--steps", default="", metavar="LIST", help="of methods with fixed step, such as 1e-2,1e-3")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="timed runs of each (default 3)")
    parser.add_argument("--formulation", default="tangent", metavar="NAME", help="tangent, null-space or maggi-kane")
    parser.add_argument("--figure", metavar="PATH", help="where to draw it; the suffix says how")
    add_json(parser)


def add_tables_options(parser):
    """Add the options of `tsdyn tables`."""
    figure = parser.add_mutually_exclusive_group()
    figure.add_argument(
        "--figure", metavar="PATH", help=f"where to write the figure (default {DEFAULT_FIGURE}); the suffix says how"
    )
    figure.add_argument("--no-figure", action="store_true", help="print the tables only")
    add_json(parser)


def _profile(parsed):
    """Measure where the time of a run of a scene goes, and what to change.

    Run a scene several times, print the time of each phase of a run, what was skipped, and what to change. Options that
    are not given are those of ts.simulate.
    """
    import numpy as np

    from ..profiling.profile import profile
    from ..validation import whole
    from .scene_file import load_scene, robot_options

    began = time.perf_counter()
    scene = load_scene(parsed.scene, parsed.allow_code, robot_options(parsed))
    if not parsed.json:
        print(f"{scene!r}, built in {1e3 * (time.perf_counter() - began):.3g} ms", flush=True)
    span, count = (parsed.t_start, parsed.t_end), whole(parsed.outputs, "--outputs")
    found = profile(
        scene, span, advice=not parsed.no_advice, integrator=parsed.method, rtol=parsed.rtol, atol=parsed.atol,
        formulation=parsed.formulation, t_eval=None if count is None else np.linspace(*span, max(count, 2)),
    )  # fmt: skip
    if parsed.json:
        phases = [{**phase._asdict(), "each": phase.each} for phase in found.phases]
        print_json({"seconds": found.seconds, "driver": found.driver, "phases": phases, "once": found.once,
                    "skipped": found.skipped, "advice": found.advice, "method": found.solution.method})  # fmt: skip
    else:
        print(found)
    _drawn(found, parsed)
    return 0


def _benchmark(parsed):
    """Measure run time against error of integration methods on a scene.

    Every method runs at every tolerance, against a reference that two methods agree on. The exit code is 0 only if
    a run of each method reached its end.
    """
    from ..benchmarking.benchmark import benchmark
    from .scene_file import load_scene, robot_options

    tolerances, steps = _numbers(parsed.tolerances, "--tolerances"), _numbers(parsed.steps, "--steps")
    methods = None if parsed.methods is None else [word.strip() for word in parsed.methods.split(",")]
    scene = load_scene(parsed.scene, parsed.allow_code, robot_options(parsed))
    if not parsed.json:
        print(f"{parsed.scene}: {scene!r}", flush=True)
    found = benchmark(scene, methods, tolerances, (0.0, parsed.to), steps=steps, repeats=parsed.repeats,
                      formulation=parsed.formulation)  # fmt: skip
    if parsed.json:
        print_json({"interrupted": found.interrupted, "rows": [row._asdict() for row in found.rows]})
    else:
        print(found)
    _drawn(found, parsed)
    ended = {row.method: any(not one.message for one in found.rows if one.method == row.method) for row in found.rows}
    return 0 if all(ended.values()) and not found.interrupted else 1


def _numbers(words, option):
    try:
        return [float(word) for word in words.split(",") if word.strip()]
    except ValueError:
        raise InvalidArgument(f"{option} must be numbers with commas between them, got {words!r}.") from None


def _drawn(found, parsed):
    if parsed.figure:
        found.plot(parsed.figure)
        print(f"Figure: {parsed.figure}", file=sys.stderr if parsed.json else sys.stdout)


def _tables(parsed):
    """Measure the constraint errors of Haug (2018), Tables 1 and 2, and draw them over time.

    Run the sliding top and the two-body pendulum of Haug (2018), print the largest constraint errors beside the
    published ones, and draw them over time. The exit code is 1 where a bound is broken.
    """
    # imported here: the command line answers without what a run needs
    from ..benchmarking.haug_tables import as_text, reproduce

    tables = reproduce()
    if parsed.json:
        print_json({"within": all(table.within for table in tables), "tables": [_data(table) for table in tables]})
    else:
        print(as_text(tables), flush=True)
    if not parsed.no_figure and (parsed.figure or not parsed.json):
        _draw(tables, parsed.figure, sys.stderr if parsed.json else sys.stdout)
    return 0 if all(table.within for table in tables) else 1


def _data(table):
    rows = [{"method": name, "tolerance": row.tolerance, "measured": row.measured, "published": row.published,
             "seconds": row.seconds} for name, rows in (("tangent", table.rows), ("maggi-kane", table.baseline))
            for row in rows]  # fmt: skip
    return {"title": table.experiment.title, "within": bool(table.within), "rows": rows}


def _draw(tables, path, to):
    from ..plots import save, tables_figure

    try:
        print(f"Figure: {save(tables_figure(tables), path or DEFAULT_FIGURE)}", file=to)
    except MissingDependency as error:
        if path:  # asked for by name: then it is a failure
            raise
        print(f"No figure: {error}", file=sys.stderr)
