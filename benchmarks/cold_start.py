"""Cold start: the first run of an installation, a first run by DOP853 after it, a second process, the import.

Run it: python -m benchmarks.cold_start (compiles several times, into temporary folders; some minutes)
"""

import os
import subprocess
import sys
import tempfile
import time

import numpy as np

IMPORTS = "import time, numpy, numba; started = time.perf_counter(); import tsdyn"
IMPORT = f"{IMPORTS}; print(time.perf_counter() - started)"
RUN = f"""
{IMPORTS}
from benchmarks.scenes import SCENES
scene = SCENES["sliding top"]
tsdyn.simulate(scene.build(), (0.0, scene.end), integrator=METHOD)
print(time.perf_counter() - started)
"""
ONE_PROCESSOR = "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
DEFAULT, DOP853 = RUN.replace("METHOD", "None"), RUN.replace("METHOD", "'dop853'")


def process(code, folder):
    """Of a process: what it prints, how long it took, and processor time with that of its own processes; s."""
    environment = {**os.environ, "TSDYN_CACHE_DIR": folder, "TSDYN_QUIET": "1", "PYTHONPYCACHEPREFIX": f"{folder}/code"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    started, before = time.perf_counter(), os.times()
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return float(result.stdout), time.perf_counter() - started, used


def show(what, figures):
    """Print a line of figures."""
    print(f"{what:42s} {figures[0]:8.2f} {figures[1]:8.2f} {figures[2]:8.2f}", flush=True)


def median(code, folder):
    """The medians of five processes."""
    return np.median([process(code, folder) for _ in range(5)], axis=0)


def main():
    """Print the table."""
    print(f"{'s':42s} {'beyond':>8s} {'whole':>8s} {'of all':>8s}")
    print(f"{'':42s} {'Numba':>8s} {'process':>8s} {'processors':>8s}")
    with tempfile.TemporaryDirectory() as folder:
        process(IMPORT, folder)  # byte code, as an installation has it
        show(f"first run, {os.cpu_count()} processors", process(DEFAULT, folder))
        show("first run by DOP853 after it", process(DOP853, folder))
        show("second process", median(DEFAULT, folder))
        show("second process, DOP853", median(DOP853, folder))
        show("import tsdyn", median(IMPORT, folder))
    if hasattr(os, "sched_setaffinity"):
        with tempfile.TemporaryDirectory() as folder:
            process(IMPORT, folder)
            show("first run, one processor", process(ONE_PROCESSOR + DEFAULT, folder))
            show("first run by DOP853 after it", process(ONE_PROCESSOR + DOP853, folder))


if __name__ == "__main__":
    main()
