"""Memory doesn't grow with the number of runs, or with the length of a stored run."""

import subprocess
import sys

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="resident memory as /proc tells it"),
]
GROWTH = 10.0  # MB
RESIDENT = """
import os, sys
import numpy as np
import tsdyn as ts
from examples import top

def resident():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
"""
CALLS = """
scene, found = top.build(), []
for i in range(11_000):
    ts.simulate(scene, (0.0, 0.1), t_eval=[0.0, 0.1])
    if i % 1000 == 999:
        found.append(resident())
print(*found[1:])
"""
STORED = """
found, seen = [], set()
def progress(fraction):
    if int(10 * fraction) not in seen:
        seen.add(int(10 * fraction))
        found.append(resident())
steps, path = 10**7, sys.argv[1]
times = np.append(np.arange(0, steps, 100) * 1e-3, steps * 1e-3)
method = ts.integrators.Nystrom4(1e-3)
ts.simulate(top.build(), (0, times[-1]), integrator=method, t_eval=times, store=path, checkpoint=1.0, progress=progress)
print(*found[2:])
"""


def grown(code, *arguments):
    """By how much resident memory grows in a process that prints it, MB."""
    command = [sys.executable, "-c", RESIDENT + code, *map(str, arguments)]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    first, *_, last = map(float, found.split())
    return last - first


def test_many_runs():
    assert grown(CALLS) < GROWTH


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_a_long_stored_run(suffix, tmp_path):
    assert grown(STORED, tmp_path / f"run.{suffix}") < GROWTH
