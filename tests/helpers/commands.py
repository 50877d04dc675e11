"""Commands of `tsdyn`, called in the process of the tests."""

from tsdyn.cli import main


def called(capsys, *words):
    """Exit code, stdout and stderr of a command."""
    try:
        code = main(list(words))
    except SystemExit as ended:
        code = ended.code
    return code, *capsys.readouterr()
