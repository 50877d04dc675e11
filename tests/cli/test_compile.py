"""The command `tsdyn compile`."""

import os

import pytest

from tests.helpers.processes import python
from tsdyn import ahead
from tsdyn.cli import main

COMMAND = """
import sys
from tsdyn import ahead
from tsdyn.cli import main
from tsdyn.constraints import EulerNormalization
ahead.processors = lambda: 2
ahead._default = lambda: [EulerNormalization.kernels["phi"], EulerNormalization.kernels["gamma"]]
# CHANGED
print(main(["compile"]))
"""


@pytest.mark.slow
def test_compile_command(tmp_path):
    out, err = python("-c", COMMAND, folder=tmp_path)
    assert out.startswith("2 kernels are in ")
    lines = err.splitlines()
    assert sorted(line.split()[-1] for line in lines[1:-1]) == [
        "EulerNormalization.gamma_loop",
        "EulerNormalization.phi_loop",
    ]
    again, err = python("-c", COMMAND, folder=tmp_path)
    assert (again, err) == (out, "")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs the limits of POSIX")
def test_compile_command_that_can_not_store_says_so(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))"
    out, err = python("-W", "ignore", "-c", COMMAND.replace("# CHANGED", limit), folder=tmp_path, TSDYN_QUIET="1")
    assert out == "1"
    assert err.count("was not compiled: the file could not be written") == 2


def test_compile_command_in_debug_mode(monkeypatch, capsys):
    monkeypatch.setattr(ahead, "DEBUG", True)
    assert main(["compile"]) == 1
    assert "TSDYN_DEBUG" in capsys.readouterr().err
