"""The command `tsdyn`, also `python -m tsdyn`: scene files and their runs, profiles, compiling ahead, hard cases."""

import inspect
import sys
import time

from ..errors import MissingDependency, TsdynError
from . import run, scenes, view
from .parser import Parser
from .stress import _stress, add_options

DEFAULT_FIGURE = "tables.png"


def main(arguments=None):
    """Run the command line; returns the exit code (wrong arguments exit with 2, as argparse does)."""
    parser = _parser()
    parser.given = sys.argv[1:] if arguments is None else arguments
    parsed = parser.parse_args(arguments)
    try:
        return parsed.run(parsed)
    except TsdynError as error:
        print(f"tsdyn: {error}", file=sys.stderr)
        return 1


def _parser():
    from .._version import __version__

    parser = Parser(prog="tsdyn", description="Constrained rigid-body dynamics by Haug's tangent-space ODE.")
    parser.add_argument("--version", action="version", version=f"tsdyn {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    run.add_run_options(_command(commands, run._run))
    view.add_view_options(_command(commands, view._view))
    scenes.add_check_options(_command(commands, scenes._check))
    scenes.add_info_options(_command(commands, scenes._info))
    scenes.add_new_options(_command(commands, scenes._new))
    scenes.add_convert_options(_command(commands, scenes._convert))
    tables = _command(commands, _tables)
    figure = tables.add_mutually_exclusive_group()
    figure.add_argument(
        "--figure", metavar="PATH", help=f"where to write the figure (default {DEFAULT_FIGURE}); the suffix says how"
    )
    figure.add_argument("--no-figure", action="store_true", help="print the tables only")
    profile = _command(commands, _profile)
    profile.add_argument(
        "scene",
        metavar="SCENE",
        help="a scene file (.toml); a Python file with a function build(), or a scene; file.py:name takes another one; "
        "or an example's name",
    )
    profile.add_argument("--t-start", type=float, default=0.0, metavar="S", help="start of the run (default 0)")
    profile.add_argument("--t-end", type=float, default=10.0, metavar="S", help="end of the run (default 10)")
    profile.add_argument("--method", metavar="NAME", help="an integrator, such as dop853")
    profile.add_argument("--rtol", type=float, metavar="TOL", help="relative tolerance")
    profile.add_argument("--atol", type=float, metavar="TOL", help="absolute tolerance")
    profile.add_argument("--formulation", default="tangent", metavar="NAME", help="tangent, null-space or maggi-kane")
    profile.add_argument("--outputs", type=int, metavar="N", help="so many output times instead of every step")
    profile.add_argument("--no-advice", action="store_true", help="don't try other methods and tolerances")
    profile.add_argument("--figure", metavar="PATH", help="where to draw it; the suffix says how")
    kernels = _command(commands, _compile)
    kernels.add_argument("--all", action="store_true", help="of every method, formulation and result, too")
    add_options(_command(commands, _stress))
    return parser


def _command(commands, run):
    """The parser of a command: the first line of the docstring of `run` is its help, the rest its description."""
    help_, _, description = (run.__doc__ or "").partition("\n\n")
    parser = commands.add_parser(run.__name__[1:], help=help_, description=inspect.cleandoc(description))
    parser.set_defaults(run=run)
    return parser


def _tables(parsed):
    """Measure the constraint errors of Haug (2018), Tables 1 and 2, and draw them over time.

    Run the sliding top and the two-body pendulum of Haug (2018), print the largest constraint errors beside the
    published ones, and draw them over time. The exit code is 1 where a bound is broken.
    """
    # imported here: the command line answers without what a run needs
    from ..benchmarking.haug_tables import as_text, reproduce

    tables = reproduce()
    print(as_text(tables), flush=True)
    if not parsed.no_figure:
        _draw(tables, parsed.figure)
    return 0 if all(table.within for table in tables) else 1


def _profile(parsed):
    """Measure where the time of a run of a scene goes, and what to change.

    Run a scene several times, print the time of each phase of a run, what was skipped, and what to change. Options that
    are not given are those of ts.simulate.
    """
    import numpy as np

    from ..profiling.profile import profile
    from ..validation import whole
    from .scene_file import load_scene

    began = time.perf_counter()
    scene = load_scene(parsed.scene)
    print(f"{scene!r}, built in {1e3 * (time.perf_counter() - began):.3g} ms", flush=True)
    span, count = (parsed.t_start, parsed.t_end), whole(parsed.outputs, "--outputs")
    found = profile(
        scene, span, advice=not parsed.no_advice, integrator=parsed.method, rtol=parsed.rtol, atol=parsed.atol,
        formulation=parsed.formulation, t_eval=None if count is None else np.linspace(*span, max(count, 2)),
    )  # fmt: skip
    print(found)
    if parsed.figure:
        found.plot(parsed.figure)
        print(f"Figure: {parsed.figure}")
    return 0


def _compile(parsed):
    """Compile kernels ahead of the first run, on all processors.

    Fill the cache on disk with the kernels of the default method and of every built-in constraint and force, or with
    all of them. What is there already is left alone. The exit code is 1 where a kernel can't be compiled or stored.
    """
    from ..ahead.all_kernels import compile_kernels

    count, folder, failed = compile_kernels(parsed.all)
    for name, problem in failed.items():
        print(f"tsdyn: {name} was not compiled: {problem}", file=sys.stderr)
    if not failed:
        print(f"{count} kernels are in {folder}.")
    return 1 if failed else 0


def _draw(tables, path):
    from ..plots import save, tables_figure

    try:
        print(f"Figure: {save(tables_figure(tables), path or DEFAULT_FIGURE)}")
    except MissingDependency as error:
        if path:  # asked for by name: then it is a failure
            raise
        print(f"No figure: {error}", file=sys.stderr)
