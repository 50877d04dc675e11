"""Cold start: import time, and the time of a first and a second process to the end of a 10 s run of the top.

Run it: python -m benchmarks.cold_start (the first compilation goes to a temporary folder)
"""

import os
import subprocess
import sys
import tempfile

import numpy as np

IMPORT = """
import time, numpy, numba
started = time.perf_counter()
import tsdyn
print(time.perf_counter() - started)
"""
RUN = """
import time
started = time.perf_counter()
import tsdyn
from examples import top
tsdyn.simulate(top.build(), (0.0, 10.0))
print(time.perf_counter() - started)
"""


def seconds(code, folder):
    """What the code prints, and how long its whole process took."""
    import time

    started = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "TSDYN_QUIET": "1"}
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return float(result.stdout), time.perf_counter() - started


def main():
    """Print the three figures."""
    with tempfile.TemporaryDirectory() as folder:
        print(f"first process, compiling     {seconds(RUN, folder)[1]:6.2f} s")
        print(f"second process               {np.median([seconds(RUN, folder)[1] for _ in range(5)]):6.2f} s")
        imports = np.median([seconds(IMPORT, folder)[0] for _ in range(5)])
        print(f"import tsdyn, beyond numba   {imports:6.3f} s")


if __name__ == "__main__":
    main()
