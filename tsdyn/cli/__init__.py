"""The command `tsdyn`, also `python -m tsdyn`: scene files, runs, studies, measurements, completion.

Imports everything else. Begin with `main`; each file has the commands of its name, parser.py what they share.
"""

import inspect
import os
import sys

from ..errors import MissingDependency, TsdynError
from . import ensemble, measure, run, scenes
from . import run as view
from .measure import _stress, add_stress_options
from .parser import Parser, print_json

# The command `tsdyn completion`: a script with which a shell completes the words of `tsdyn`.

SHELLS = ("bash", "zsh", "tcsh")
FILES = ("SCENE", "FILE", "PATH", "FROM", "TO", "CSV")  # metavars of paths


def add_completion_options(parser):
    """Add the options of `tsdyn completion`."""
    parser.add_argument("shell", choices=SHELLS, help="for which the script is")


def _completion(parsed):
    """Print a script with which a shell completes commands, options and paths.

    bash: tsdyn completion bash > ~/.local/share/bash-completion/completions/tsdyn
    zsh:  tsdyn completion zsh > a folder of $fpath, as _tsdyn
    """
    try:
        import shtab
    except ImportError as error:
        raise MissingDependency("tsdyn completion needs shtab: pip install 'tsdyn[completion]'.") from error
    for each in _all(parsed.parser):
        for action in each._actions:
            if action.metavar in FILES:
                action.complete = shtab.FILE
    print(shtab.complete(parsed.parser, parsed.shell))
    return 0


def _all(parser):
    """A parser and those of its commands."""
    yield parser
    for action in parser._actions:
        for child in dict.fromkeys((action.choices or {}).values()) if hasattr(action.choices, "values") else ():
            yield from _all(child)


INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it


def main(arguments=None):
    """Run the command line; returns the exit code (wrong arguments exit with 2, as argparse does)."""
    parser = parser_of_all()
    Parser.given = sys.argv[1:] if arguments is None else arguments
    parsed = parser.parse_args(arguments)
    parsed.parser = parser
    try:
        code = parsed.run(parsed)
        sys.stdout.flush()
        return code
    except TsdynError as error:
        if getattr(parsed, "json", False):
            print_json({"error": type(error).__name__, "message": str(error)})
        print(f"tsdyn: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("tsdyn: interrupted.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # what read the output has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def parser_of_all():
    """The parser of all commands."""
    from .._version import __version__

    parser = Parser(prog="tsdyn", description="Constrained rigid-body dynamics by Haug's tangent-space ODE.")
    parser.add_argument("--version", action="version", version=f"tsdyn {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    run.add_run_options(_command(commands, run._run))
    ensemble.add_ensemble_options(_command(commands, ensemble._ensemble))
    view.add_view_options(_command(commands, view._view))
    run.add_scene(_command(commands, scenes._check))
    scenes.add_info_options(_command(commands, scenes._info))
    scenes.add_new_options(_command(commands, scenes._new))
    scenes.add_convert_options(_command(commands, scenes._convert))
    measure.add_profile_options(_command(commands, measure._profile))
    measure.add_benchmark_options(_command(commands, measure._benchmark))
    run.add_plot(_command(commands, measure._tables), "constraint errors over time")
    kernels = _command(commands, _compile)
    kernels.add_argument("--all", action="store_true", help="of every method, formulation and result, too")
    add_stress_options(_command(commands, _stress))
    add_completion_options(_command(commands, _completion))
    for each in commands.choices.values():
        run.add_json(each)
    return parser


def _command(commands, run):
    """The parser of a command: the first line of the docstring of `run` is its help, the rest its description."""
    help_, _, description = (run.__doc__ or "").partition("\n\n")
    parser = commands.add_parser(run.__name__[1:], help=help_, description=inspect.cleandoc(description))
    parser.set_defaults(run=run)
    return parser


def _compile(parsed):
    """Compile kernels ahead of the first run, on all processors.

    Fill the cache on disk with the kernels of the default method and of every built-in constraint and force, those of
    impacts and of exact friction among them, or with all there are. What is there already is left alone. The exit code
    is 1 where a kernel can't be compiled or stored.
    """
    from ..ahead import compile_kernels

    count, folder, failed = compile_kernels(parsed.all)
    for name, problem in failed.items():
        print(f"tsdyn: {name} was not compiled: {problem}", file=sys.stderr)
    if parsed.json:
        print_json({"kernels": count, "folder": folder, "failed": failed})
    elif not failed:
        print(f"{count} kernels are in {folder}.")
    return 1 if failed else 0
