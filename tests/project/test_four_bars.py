"""The four-bar of the documentation in other programs: those that are installed are as good as the page says."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from docs.four_bars import data
from examples import four_bar

FOLDER = Path(data.__file__).parent
PROGRAMS = {  # module that is needed, largest error of the angle (rad), largest gap (m)
    "four_bar_tsdyn.py": ("tsdyn", 1e-7, 1e-14),
    "four_bar_pydy.py": ("pydy", 1e-7, 1e-8),
    "four_bar_mujoco.py": ("mujoco", 1e-4, 1e-7),
    "four_bar_exudyn.py": ("exudyn", 1e-3, 1e-12),
    "four_bar_drake.py": ("pydrake", 0.1, 1e-5),
}
SAID = re.compile(r"angle off by (\S+) rad, gap (\S+) m")


def test_the_numbers_are_those_of_the_example():
    (x, y), (u, v) = four_bar.corners(four_bar.START)
    np.testing.assert_allclose([*data.B, *data.C], [x, y, u, v], atol=1e-15)
    np.testing.assert_allclose(data.rates(), four_bar.RATE * np.array(four_bar.slopes(four_bar.START)[1]), rtol=1e-13)
    assert (data.MASSES, data.INERTIAS) == (four_bar.MASSES, four_bar.INERTIAS)
    assert abs(four_bar.reference(np.array([0.0, data.END]))[0][-1] - data.ANGLE) < 1e-9


def said(command):
    """The errors that a program prints."""
    root = FOLDER.parents[1]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    result = subprocess.run(command, cwd=FOLDER, env=environment, text=True, capture_output=True, timeout=300)
    found = SAID.search(result.stdout)
    assert found, result.stdout + result.stderr
    return float(found[1]), float(found[2])


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_programs(program):
    module, angle, gap = PROGRAMS[program]
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{module} is not installed")
    off, apart = said([sys.executable, program])
    assert off < angle
    assert apart < gap


@pytest.mark.slow
def test_the_program_for_matlab_runs_in_octave():
    if shutil.which("octave-cli") is None:
        pytest.skip("Octave is not installed")
    off, apart = said(["octave-cli", "-q", "--eval", "four_bar"])
    assert off < 1e-8
    assert apart < 1e-8
