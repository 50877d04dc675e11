"""The command `tsdyn completion`: a script with which a shell completes the words of `tsdyn`."""

from ..errors import MissingDependency

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
