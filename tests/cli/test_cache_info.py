"""`tsdyn info --cache` on the command line: with a file, and without anything."""

import pytest

from tsdyn.cli import main


@pytest.mark.parametrize("given", [[], ["--cache", "top"], ["--schema", "top"], ["--schema", "--cache"]])
def test_info_takes_one_thing(given, capsys):
    assert main(["info", *given]) == 1
    assert "takes one of FILE, --cache and --schema" in capsys.readouterr().err


def test_the_folder_and_the_way_of_compilation_are_shown(capsys):
    assert main(["info", "--cache"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Kernels are compiled by Numba ")
    assert " kernels, " in lines[1]
    assert any(line.startswith("damaged now: ") for line in lines[2:4])
