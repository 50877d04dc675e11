"""`tsdyn info --cache` on the command line: with a file, and without anything."""

import pytest

from tsdyn.cli import main


@pytest.mark.parametrize("given", [["info"], ["info", "--cache", "top"]])
def test_info_takes_a_file_or_the_cache(given, capsys):
    assert main(given) == 1
    assert "takes a FILE, or --cache, and not both" in capsys.readouterr().err


def test_the_folder_and_the_way_of_compilation_are_shown(capsys):
    assert main(["info", "--cache"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Kernels are compiled by Numba ")
    assert " kernels, " in lines[1]
    assert any(line.startswith("damaged now: ") for line in lines[2:4])
