"""The command `tsdyn`, also `python -m tsdyn`: `tsdyn tables` measures the tables of Haug (2018)."""

import argparse
import sys

from .errors import MissingDependency, TsdynError

DEFAULT_FIGURE = "tables.png"


def main(arguments=None):
    """Run the command line; returns the exit code (wrong arguments exit with 2, as argparse does)."""
    parsed = _parser().parse_args(arguments)
    try:
        return parsed.run(parsed)
    except TsdynError as error:
        print(f"tsdyn: {error}", file=sys.stderr)
        return 1


def _parser():
    from . import __version__

    parser = argparse.ArgumentParser(
        prog="tsdyn", description="Constrained rigid-body dynamics by Haug's tangent-space ODE."
    )
    parser.add_argument("--version", action="version", version=f"tsdyn {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    tables = commands.add_parser(
        "tables",
        help="measure the constraint errors of Haug (2018), Tables 1 and 2, and draw them over time",
        description="Run the sliding top and the two-body pendulum of Haug (2018), print the largest constraint errors "
        "beside the published ones, and draw them over time. The exit code is 1 where a bound is broken.",
    )
    figure = tables.add_mutually_exclusive_group()
    figure.add_argument(
        "--figure", metavar="PATH", help=f"where to write the figure (default {DEFAULT_FIGURE}); the suffix says how"
    )
    figure.add_argument("--no-figure", action="store_true", help="print the tables only")
    tables.set_defaults(run=_tables)
    return parser


def _tables(parsed):
    # imported here: the command line answers without what a run needs
    from .tables import as_text, reproduce

    tables = reproduce()
    print(as_text(tables), flush=True)
    if not parsed.no_figure:
        _draw(tables, parsed.figure)
    return 0 if all(table.within for table in tables) else 1


def _draw(tables, path):
    from .plots import save, tables_figure

    try:
        print(f"Figure: {save(tables_figure(tables), path or DEFAULT_FIGURE)}")
    except MissingDependency as error:
        if path:  # asked for by name: then it is a failure
            raise
        print(f"No figure: {error}", file=sys.stderr)
